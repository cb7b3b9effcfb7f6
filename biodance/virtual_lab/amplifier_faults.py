"""Faults of amplifiers and plates that remember, bend or lose contact: made in the raw samples, without the formulas of ``effects``."""

from dataclasses import replace

import numpy as np

from biodance.errors import BiodanceError
from biodance.records import CHANNELS, Array
from biodance.virtual_lab.faults import all_late, channel_index, on_plate
from biodance.virtual_lab.laboratory import Fault, Recording
from biodance.virtual_lab.plates import HALF_SIZE
from biodance.virtual_lab.randomness import stream

SLACK = (10.0, 20.0, 40.0)
"""N, half widths of the plays in the plate's joints; a third of it in N·m."""


def filter_mismatch(target: str, cutoff: float) -> Fault:
    """Smooth all channels at ``cutoff`` Hz (second order, twice, without lag), as an amplifier may before they are stored."""

    def fault(recording: Recording) -> Recording:
        from scipy.signal import butter, sosfiltfilt

        if not 0 < cutoff < recording.analog_rate / 2:
            raise BiodanceError(f"filter_mismatch: cutoff = {cutoff:g} Hz; legal: above 0 and below {recording.analog_rate / 2:g} Hz.")
        smooth = butter(2, cutoff, fs=recording.analog_rate, output="sos")
        plates = tuple(replace(p, channels=sosfiltfilt(smooth, p.channels, axis=0)) for p in recording.plates)
        return replace(recording, plates=plates)

    return fault


def plate_hysteresis(target: str, width: float) -> Fault:
    """Let a channel follow its load in a loop of half ``width`` (N or N·m): part of the load passes through joints with play (`SLACK`)."""
    index = channel_index(target)
    slacks = np.array(SLACK) * (1.0 if index < 3 else 0.33)

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
    index = channel_index(target)

    def change(wrench: Array, recording: Recording) -> Array:
        from scipy.signal import lfilter

        step = 1.0 / (4.0 * recording.analog_rate)
        out = wrench.copy()
        out[:, index] += ratio * lfilter([step], [1.0, step - 1.0], wrench[:, index])
        return out

    return on_plate(target, change)


def plate_bending(target: str, size: float) -> Fault:
    """Bend the top plate: the centre of pressure errs with the square of its distance from the middle, by ``size`` (m) at the long edge."""

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
    """Shake a plug with bad contact: for some tenths of a second a channel reads ``gain`` too much, about once in 3 s."""
    index = channel_index(target)

    def change(wrench: Array, recording: Recording) -> Array:
        rng = stream(0, "loose connection", recording.name)
        out, rate = wrench.copy(), recording.analog_rate
        for _ in range(rng.poisson(len(wrench) / rate / 3.0)):
            first = int(rng.integers(0, len(wrench)))
            out[first : first + int(rng.uniform(0.2, 0.8) * rate), index] *= 1.0 + gain
        return out

    return on_plate(target, change)


def trigger_jitter(target: str, jitter: float) -> Fault:
    """Start the forces of every trial at another time: late by a standard deviation of ``jitter`` (s), drawn per trial."""
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
    """Let a channel read less the more it is loaded: ``ratio`` less at 1000 N or 300 N·m, growing with the square of the load."""
    index = channel_index(target)
    full = 1000.0 if index < CHANNELS.index("Mx") else 300.0

    def change(wrench: Array, _: Recording) -> Array:
        out = wrench.copy()
        out[:, index] *= 1.0 - ratio * (wrench[:, index] / full) ** 2
        return out

    return on_plate(target, change)
