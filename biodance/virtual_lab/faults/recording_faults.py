"""Faults of clocks, amplifiers, cameras and hands, made in the whole recording: stored trajectories, samples of all
plates, labels, typed measures; without the formulas of ``effects``.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from biodance.errors import BiodanceError, UnknownName
from biodance.records import Array, Markers
from biodance.virtual_lab.faults.plate_faults import Clock, on_recording
from biodance.virtual_lab.recording.laboratory import Fault, Recording
from biodance.virtual_lab.tolerances import stream


def _with_channels(recording: Recording, change: Callable[[Array], Array]) -> Recording:
    """Return the recording with the stored channels (S, 6) of every plate changed."""
    return replace(recording, plates=tuple(replace(p, channels=change(p.channels)) for p in recording.plates))


def _late(recording: Recording, delay: Array | float) -> Recording:
    """Return the recording with all forces late by ``delay`` s: one number, or one a sample."""

    def late(values: Array) -> Array:
        samples = np.arange(len(values)) / recording.analog_rate
        return np.stack([np.interp(samples - delay, samples, column) for column in values.T], axis=1)

    return _with_channels(recording, late)


@on_recording
def time_delay(recording: Recording, target: str, delay: float) -> Recording:
    """Let all forces come ``delay`` (s) late."""
    return _late(recording, delay)


@on_recording
def clock_drift(recording: Recording, target: str, stretch: float, clock: Clock) -> Recording:
    """Let the forces fall behind by ``stretch`` (s) over the session, on time in its middle."""
    share = np.linspace(*clock[recording.name], len(recording.plates[0].channels))
    return _late(recording, stretch * (share - 0.5))


@on_recording
def trigger_jitter(recording: Recording, target: str, jitter: float) -> Recording:
    """Start the forces of every trial late by a standard deviation of ``jitter`` (s), drawn per trial."""
    return _late(recording, jitter * stream(3, "trigger", recording.name).normal())


@on_recording
def unit_error(recording: Recording, target: str, factor: float) -> Recording:
    """Store all channels ``factor`` times too large (4.448 for pounds taken for newtons, 1000 for mm taken for m)."""
    return _with_channels(recording, lambda channels: factor * channels)


@on_recording
def filter_mismatch(recording: Recording, target: str, cutoff: float) -> Recording:
    """Smooth all channels at ``cutoff`` Hz (second order, twice, without lag), as an amplifier may before storing."""
    from scipy.signal import butter, sosfiltfilt

    if not 0 < cutoff < recording.analog_rate / 2:
        raise BiodanceError(
            f"filter_mismatch: cutoff = {cutoff:g} Hz; legal: above 0 and below {recording.analog_rate / 2:g} Hz."
        )
    smooth = butter(2, cutoff, fs=recording.analog_rate, output="sos")
    return _with_channels(recording, lambda channels: sosfiltfilt(smooth, channels, axis=0))


@on_recording
def body_mass(recording: Recording, target: str, error: float) -> Recording:
    """Declare ``error`` (kg) less than the person weighs."""
    processing = dict(recording.parameters["PROCESSING"])
    processing["Bodymass"] = float(processing["Bodymass"]) - error  # type: ignore[arg-type]
    return replace(recording, parameters={**recording.parameters, "PROCESSING": processing})


@on_recording
def labels_swapped(recording: Recording, target: str) -> Recording:
    """Exchange the labels of two markers; target ``LKNE/RKNE``."""
    one, _, other = target.partition("/")
    markers, exchange = recording.markers, {one: other, other: one}
    for name in (one, other):
        if name not in markers:
            raise UnknownName.of("marker of the recording", name, markers.names)
    names = tuple(exchange.get(name, name) for name in markers.names)
    return replace(recording, markers=Markers(names, markers.time, markers.xyz))


def frame_rate(target: str, ratio: float) -> Fault:
    """Declare the rates (cameras and force alike) ``ratio`` times what they were."""
    if not 0.1 < ratio < 10:
        raise BiodanceError(f"frame_rate: ratio = {ratio:g}; legal: between 0.1 and 10 (declared over true rate).")

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        slow = Markers(markers.names, markers.time / ratio, markers.xyz)
        return replace(recording, markers=slow, analog_rate=recording.analog_rate * ratio)

    return fault


@on_recording
def dropped_frames(recording: Recording, target: str, count: float) -> Recording:
    """Let the cameras lose ``count`` frames in a row in the middle of every trial, and not say so; the forces go on."""
    lost, markers, frames = round(count), recording.markers, recording.markers.time.size
    if not 0 < lost < frames // 4:
        raise BiodanceError(f"dropped_frames: count = {count:g}; legal: 1 to {frames // 4} frames of this recording.")
    kept = np.delete(np.arange(frames), np.arange(frames // 2, frames // 2 + lost))
    samples = kept.size * (len(recording.plates[0].channels) // frames)
    shorter = Markers(markers.names, markers.time[: kept.size], markers.xyz[kept])
    return replace(_with_channels(recording, lambda channels: channels[:samples]), markers=shorter)


@on_recording
def swaying_cameras(recording: Recording, target: str, sway: float) -> Recording:
    """Swing the frame of the cameras at 1.7 Hz with an amplitude of ``sway`` (m): all markers seem to move."""
    markers = recording.markers
    phase = 2 * np.pi * 1.7 * markers.time
    move = sway * np.stack([np.sin(phase), 0.6 * np.cos(phase), 0.0 * phase], axis=1)
    return replace(recording, markers=Markers(markers.names, markers.time, markers.xyz + move[:, None]))
