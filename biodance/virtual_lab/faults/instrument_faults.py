"""Faults of cameras, clocks, amplifiers and plates: made in stored trajectories and raw samples, without the
formulas of ``effects``.
"""

from dataclasses import replace

import numpy as np

from biodance.errors import BiodanceError
from biodance.records import CHANNELS, Array, Markers
from biodance.virtual_lab.faults.faults import all_late, fault_channel, on_plate
from biodance.virtual_lab.recording.laboratory import Fault, Recording
from biodance.virtual_lab.recording.plates import HALF_SIZE
from biodance.virtual_lab.tolerances import stream


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
            raise BiodanceError(
                f"dropped_frames: count = {count:g}; legal: 1 to {frames // 4} frames of this recording."
            )
        kept = np.delete(np.arange(frames), np.arange(frames // 2, frames // 2 + lost))
        samples = len(recording.plates[0].channels) // frames
        shorter = Markers(markers.names, markers.time[: kept.size], markers.xyz[kept])
        plates = tuple(replace(plate, channels=plate.channels[: kept.size * samples]) for plate in recording.plates)
        return replace(recording, markers=shorter, plates=plates)

    return fault


def swaying_cameras(target: str, sway: float) -> Fault:
    """Swing the frame that carries the cameras at 1.7 Hz with an amplitude of ``sway`` (m): all markers seem to
    move.
    """

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        phase = 2 * np.pi * 1.7 * markers.time
        move = sway * np.stack([np.sin(phase), 0.6 * np.cos(phase), 0.0 * phase], axis=1)
        return replace(recording, markers=Markers(markers.names, markers.time, markers.xyz + move[:, None]))

    return fault


_SLACK = (10.0, 20.0, 40.0)
"""N, half widths of the plays in the plate's joints; a third of it in N·m."""


def filter_mismatch(target: str, cutoff: float) -> Fault:
    """Smooth all channels at ``cutoff`` Hz (second order, twice, without lag), as an amplifier may before they are
    stored.
    """

    def fault(recording: Recording) -> Recording:
        from scipy.signal import butter, sosfiltfilt

        if not 0 < cutoff < recording.analog_rate / 2:
            raise BiodanceError(
                f"filter_mismatch: cutoff = {cutoff:g} Hz; legal: above 0 and below {recording.analog_rate / 2:g} Hz."
            )
        smooth = butter(2, cutoff, fs=recording.analog_rate, output="sos")
        plates = tuple(replace(p, channels=sosfiltfilt(smooth, p.channels, axis=0)) for p in recording.plates)
        return replace(recording, plates=plates)

    return fault


def plate_hysteresis(target: str, width: float) -> Fault:
    """Let a channel follow its load in a loop of half ``width`` (N or N·m): part of the load passes through joints
    with play (`SLACK`).
    """
    index = fault_channel(target)
    slacks = np.array(_SLACK) * (1.0 if index < 3 else 0.33)

    def change(wrench: Array, _: Recording) -> Array:
        out, load = wrench.copy(), wrench[:, index]
        out[:, index] += width * np.mean([(_play(load, slack) - load) / slack for slack in slacks], axis=0)
        return out

    return on_plate(target, change)


def _play(load: Array, slack: float) -> Array:
    """Return what comes through a joint with play: it moves only when pushed by ``slack``."""
    out = np.empty_like(load)
    place = load[0]
    for k, value in enumerate(load):
        place = min(max(place, value - slack), value + slack)
        out[k] = place
    return out


def plate_creep(target: str, ratio: float) -> Fault:
    """Let a loaded channel go on rising: ``ratio`` of the load of the last 4 s or so is added."""
    index = fault_channel(target)

    def change(wrench: Array, recording: Recording) -> Array:
        from scipy.signal import lfilter

        step = 1.0 / (4.0 * recording.analog_rate)
        out = wrench.copy()
        out[:, index] += ratio * lfilter([step], [1.0, step - 1.0], wrench[:, index])
        return out

    return on_plate(target, change)


def plate_bending(target: str, size: float) -> Fault:
    """Bend the top plate: the centre of pressure errs with the square of its distance from the middle, by ``size``
    (m) at the long edge.
    """

    def change(wrench: Array, _: Recording) -> Array:
        out = wrench.copy()
        safe = np.where(np.abs(wrench[:, 2]) > 20.0, wrench[:, 2], np.inf)
        x, y = -wrench[:, 4] / safe, wrench[:, 3] / safe
        far = (x**2 + y**2) / HALF_SIZE[1] ** 2
        out[:, 4] -= size * far * wrench[:, 2]
        out[:, 3] += 0.5 * size * far * wrench[:, 2]
        return out

    return on_plate(target, change)


def loose_connection(target: str, gain: float) -> Fault:
    """Shake a plug with bad contact: for some tenths of a second a channel reads ``gain`` too much, about once in 3
    s and at least once.
    """
    index = fault_channel(target)

    def change(wrench: Array, recording: Recording) -> Array:
        rng = stream(0, "loose connection", recording.name)
        out, rate = wrench.copy(), recording.analog_rate
        for _ in range(max(1, rng.poisson(len(wrench) / rate / 3.0))):
            first = int(rng.integers(0, len(wrench)))
            out[first : first + int(rng.uniform(0.2, 0.8) * rate), index] *= 1.0 + gain
        return out

    return on_plate(target, change)


def trigger_jitter(target: str, jitter: float) -> Fault:
    """Start the forces of every trial at another time: late by a standard deviation of ``jitter`` (s), drawn per
    trial.
    """
    return lambda recording: all_late(recording, np.asarray(jitter * stream(3, "trigger", recording.name).normal()))


def object_on_plate(target: str, weight: float) -> Fault:
    """Put something of ``weight`` (N) on a corner of the plate for the middle 40 % of every trial."""
    x, y = 0.7 * HALF_SIZE

    def change(wrench: Array, _: Recording) -> Array:
        share = np.linspace(0.0, 1.0, len(wrench))
        on = ((share > 0.3) & (share < 0.7)).astype(float)
        return wrench + on[:, None] * weight * np.array([0.0, 0.0, 1.0, y, -x, 0.0])

    return on_plate(target, change)


def saturating(target: str, ratio: float) -> Fault:
    """Let a channel read less the more it is loaded: ``ratio`` less at 1000 N or 300 N·m, growing with the square of
    the load.
    """
    index = fault_channel(target)
    full = 1000.0 if index < CHANNELS.index("Mx") else 300.0

    def change(wrench: Array, _: Recording) -> Array:
        out = wrench.copy()
        out[:, index] *= 1.0 - ratio * (wrench[:, index] / full) ** 2
        return out

    return on_plate(target, change)
