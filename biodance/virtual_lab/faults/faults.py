"""Faults of instruments and hands, made in the raw recording: analog samples, corners, labels, typed measures.

Written without the formulas of ``effects``: what is hidden in a file must not be made by the formula that finds it.
Every fault speaks about the plate's wrench on the subject about the plate's centre in lab axes (channels ``Fx`` ..
``Mz``), reached through the plate's own decoding, and is put back into the channels as the amplifier would have given
it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from biodance.errors import UnknownName
from biodance.lab.c3d.write import PlateRecording
from biodance.records import CHANNELS, Array, Markers
from biodance.virtual_lab.recording.laboratory import Fault, Recording

PlateChange = Callable[[Array, Recording], Array]
"""Changes the wrench (S, 6) on the subject about the plate's centre, lab axes, of one recording."""


def decoding(plate: PlateRecording) -> Array:
    """Return D (6, 6): wrench on the subject about the plate's centre in lab axes = D @ channels, for TYPE 2 and 4."""
    first, second, _, fourth = plate.corners
    x = (first - second) / np.linalg.norm(first - second)
    z = np.cross(x, first - fourth)
    z /= np.linalg.norm(z)
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    ox, oy, oz = plate.origin
    to_surface = np.eye(6)
    to_surface[3:, :3] = -np.array([[0, -oz, oy], [oz, 0, -ox], [-oy, ox, 0]])
    loads = np.eye(6) if plate.calibration is None else plate.calibration
    return np.kron(np.eye(2), turn) @ to_surface @ loads


def on_plate(target: str, change: PlateChange) -> Fault:
    """Return the fault that applies ``change`` to the plate that the target names (``plate2:Fz``), or to the first
    one.
    """

    def fault(recording: Recording) -> Recording:
        index = _plate_index(target, len(recording.plates))
        plate = recording.plates[index]
        D = decoding(plate)
        channels = change(plate.channels @ D.T, recording) @ np.linalg.inv(D).T
        return _with_plate(recording, index, replace(plate, channels=channels))

    return fault


def _plate_index(target: str, count: int) -> int:
    name = target.partition(":")[0] if target.startswith("plate") else "plate1"
    legal = [f"plate{i + 1}" for i in range(count)]
    if name not in legal:
        raise UnknownName.of("force plate of the virtual laboratory", name, legal)
    return legal.index(name)


def _with_plate(recording: Recording, index: int, plate: PlateRecording) -> Recording:
    return replace(recording, plates=(*recording.plates[:index], plate, *recording.plates[index + 1 :]))


def fault_channel(target: str) -> int:
    """Return the place 0..5 of the channel that a target names last; UnknownName lists the channels."""
    name = target.rpartition(":")[2]
    if name not in CHANNELS:
        raise UnknownName.of("channel of a force plate", name, CHANNELS)
    return CHANNELS.index(name)


def axis_index(target: str) -> int:
    """Return 0, 1, 2 for a target that ends with x, y, z; UnknownName otherwise."""
    if target[-1:] not in ("x", "y", "z"):
        raise UnknownName.of("axis", target[-1:], ("x", "y", "z"))
    return "xyz".index(target[-1])


def _axis(target: str) -> Array:
    return np.eye(3)[axis_index(target)]


def plate_offset(target: str, offset: float) -> Fault:
    """Add a constant ``offset`` (N or N·m) to a channel."""
    step = offset * np.eye(6)[fault_channel(target)]
    return on_plate(target, lambda wrench, _: wrench + step)


def plate_gain(target: str, gain: float) -> Fault:
    """Let a channel read ``gain`` (0.04 = 4 %) too much."""
    factor = np.ones(6) + gain * np.eye(6)[fault_channel(target)]
    return on_plate(target, lambda wrench, _: wrench * factor)


def plate_crosstalk(target: str, ratio: float) -> Fault:
    """Let ``ratio`` of the first channel show in the second; target ``Fz->My``."""
    first, _, second = target.rpartition(":")[2].partition("->")
    mixing = np.eye(6)
    mixing[fault_channel(second), fault_channel(first)] += ratio
    return on_plate(target, lambda wrench, _: wrench @ mixing.T)


def plate_drift(target: str, drift: float, clock: dict[str, tuple[float, float]]) -> Fault:
    """Let the zero of a channel wander by ``drift`` over the session; ``clock`` says from and to where in the
    session each trial lies.
    """
    unit = np.eye(6)[fault_channel(target)]

    def change(wrench: Array, recording: Recording) -> Array:
        start, stop = clock[recording.name]
        return wrench + drift * (np.linspace(start, stop, len(wrench)) - 0.5)[:, None] * unit

    return on_plate(target, change)


def _late(values: Array, rate: float, delay: Array) -> Array:
    samples = np.arange(len(values)) / rate
    return np.stack([np.interp(samples - delay, samples, column) for column in values.T], axis=1)


def time_delay(target: str, delay: float) -> Fault:
    """Let all forces come ``delay`` (s) late."""
    return lambda recording: all_late(recording, np.asarray(delay))


def clock_drift(target: str, stretch: float, clock: dict[str, tuple[float, float]]) -> Fault:
    """Let the forces fall behind by ``stretch`` (s) over the session, on time in its middle."""

    def fault(recording: Recording) -> Recording:
        share = np.linspace(*clock[recording.name], len(recording.plates[0].channels))
        return all_late(recording, stretch * (share - 0.5))

    return fault


def all_late(recording: Recording, delay: Array) -> Recording:
    """Return the recording with all forces late by ``delay`` s: one number, or one a sample."""
    plates = tuple(replace(p, channels=_late(p.channels, recording.analog_rate, delay)) for p in recording.plates)
    return replace(recording, plates=plates)


def plate_position(target: str, shift: float) -> Fault:
    """Let the file put a plate ``shift`` (m) beside where it lies; target ``plate1:x``, lab axes."""

    def fault(recording: Recording) -> Recording:
        index = _plate_index(target, len(recording.plates))
        plate = recording.plates[index]
        return _with_plate(recording, index, replace(plate, corners=plate.corners + shift * _axis(target)))

    return fault


def plate_rotation(target: str, angle: float) -> Fault:
    """Let the file turn a plate by ``angle`` (rad) about a lab axis through its centre; target ``plate1:z``."""

    def fault(recording: Recording) -> Recording:
        from scipy.spatial.transform import Rotation

        index = _plate_index(target, len(recording.plates))
        plate = recording.plates[index]
        centre = plate.corners.mean(axis=0)
        turned = centre + Rotation.from_rotvec(angle * _axis(target)).apply(plate.corners - centre)
        return _with_plate(recording, index, replace(plate, corners=turned))

    return fault


def body_mass(target: str, error: float) -> Fault:
    """Declare ``error`` (kg) less than the person weighs."""

    def fault(recording: Recording) -> Recording:
        processing = dict(recording.parameters["PROCESSING"])
        processing["Bodymass"] = float(processing["Bodymass"]) - error  # type: ignore[arg-type]
        return replace(recording, parameters={**recording.parameters, "PROCESSING": processing})

    return fault


def unit_error(target: str, factor: float) -> Fault:
    """Store all channels ``factor`` times too large (4.448 for pounds taken for newtons, 1000 for mm taken for m)."""

    def fault(recording: Recording) -> Recording:
        return replace(recording, plates=tuple(replace(p, channels=factor * p.channels) for p in recording.plates))

    return fault


def axis_error(target: str) -> Fault:
    """Turn the sign of one channel."""
    sign = np.ones(6) - 2 * np.eye(6)[fault_channel(target)]
    return on_plate(target, lambda wrench, _: wrench * sign)


def clipping(target: str, limit: float) -> Fault:
    """Let a channel saturate at +-``limit`` (N or N·m)."""
    bound = np.where(np.eye(6)[fault_channel(target)] > 0, limit, np.inf)
    return on_plate(target, lambda wrench, _: np.clip(wrench, -bound, bound))


def mains_hum(target: str, amplitude: float) -> Fault:
    """Add a 50 Hz sine of ``amplitude`` (N or N·m) to a channel."""
    unit = amplitude * np.eye(6)[fault_channel(target)]

    def change(wrench: Array, recording: Recording) -> Array:
        return wrench + np.sin(2 * np.pi * 50 * np.arange(len(wrench)) / recording.analog_rate)[:, None] * unit

    return on_plate(target, change)


def labels_swapped(target: str) -> Fault:
    """Exchange the labels of two markers; target ``LKNE/RKNE``."""
    one, _, other = target.partition("/")

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        for name in (one, other):
            if name not in markers:
                raise UnknownName.of("marker of the recording", name, markers.names)
        exchange = {one: other, other: one}
        names = tuple(exchange.get(name, name) for name in markers.names)
        return replace(recording, markers=Markers(names, markers.time, markers.xyz))

    return fault
