"""Faults of cameras and clocks: made in the marker trajectories and rates as they are stored."""

from dataclasses import replace

import numpy as np

from biodance.errors import BiodanceError
from biodance.records import Markers
from biodance.virtual_lab.laboratory import Fault, Recording


def frame_rate(target: str, ratio: float) -> Fault:
    """Declare the rates (cameras and force alike) ``ratio`` times what they were."""
    if not 0.1 < ratio < 10:
        raise BiodanceError(f"frame_rate: ratio = {ratio:g}; legal: between 0.1 and 10 (declared over true rate).")

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        slow = Markers(markers.names, markers.time / ratio, markers.xyz)
        return replace(recording, markers=slow, analog_rate=recording.analog_rate * ratio)

    return fault


def dropped_frames(target: str, count: float) -> Fault:
    """Let the cameras lose ``count`` frames in a row in the middle of every trial, and not say so; the forces go on."""
    lost = round(count)

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        frames = markers.time.size
        if not 0 < lost < frames // 4:
            raise BiodanceError(f"dropped_frames: count = {count:g}; legal: 1 to {frames // 4} frames of this recording.")
        kept = np.delete(np.arange(frames), np.arange(frames // 2, frames // 2 + lost))
        samples = len(recording.plates[0].channels) // frames
        shorter = Markers(markers.names, markers.time[: kept.size], markers.xyz[kept])
        plates = tuple(replace(plate, channels=plate.channels[: kept.size * samples]) for plate in recording.plates)
        return replace(recording, markers=shorter, plates=plates)

    return fault


def swaying_cameras(target: str, sway: float) -> Fault:
    """Swing the frame that carries the cameras at 1.7 Hz with an amplitude of ``sway`` (m): all markers seem to move."""

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        phase = 2 * np.pi * 1.7 * markers.time
        move = sway * np.stack([np.sin(phase), 0.6 * np.cos(phase), 0.0 * phase], axis=1)
        return replace(recording, markers=Markers(markers.names, markers.time, markers.xyz + move[:, None]))

    return fault
