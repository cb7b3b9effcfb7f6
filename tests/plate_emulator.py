"""A force plate run backwards: from a wrench that is known in the lab to the channels that a plate of each C3D TYPE
would record.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from biodance.lab.c3d.raw import RawC3d

RATE = 500.0


@dataclass
class Emulated:
    """One plate: pose (lab_R_plate, centre m), half sides m, sensor -> surface vector or (a, b, z) m, ``reaction``
    False = load recorded.
    """

    type: int = 2
    rotation: np.ndarray = field(default_factory=lambda: np.diag([1.0, -1.0, -1.0]))
    centre: np.ndarray = field(default_factory=lambda: np.array([0.3, 0.2, 0.0]))
    half: np.ndarray = field(default_factory=lambda: np.array([0.2, 0.3]))
    origin: np.ndarray = field(default_factory=lambda: np.array([0.001, -0.002, -0.04]))
    reaction: bool = True
    matrix: np.ndarray | None = None
    polynomial: np.ndarray | None = None

    @property
    def corners(self):
        signs = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
        return self.centre + (signs * np.append(self.half, 0)) @ self.rotation.T


def yaw(angle):
    """Return the rotation (3, 3) by an angle, rad, about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def random_pose(rng, *, z_up=False):
    """A plate anywhere in the lab, at any height, turned by any angle and tilted by up to 6 degrees."""
    from scipy.spatial.transform import Rotation

    tilt = Rotation.from_rotvec(rng.uniform(-0.1, 0.1, 3) * [1, 1, 0]).as_matrix()
    return tilt @ yaw(rng.uniform(-np.pi, np.pi)) @ (np.eye(3) if z_up else np.diag([1.0, -1.0, -1.0]))


def step(rng, plate, *, seconds=4.0, weight=700.0):
    """A person steps on after 1 s and off before the end: wrench (S, 6) ground on subject about the lab origin, and its
    centre of pressure.
    """
    time = np.arange(0, seconds, 1 / RATE)
    ramp = np.clip((time - 1.0) / 0.2, 0, 1) * np.clip((seconds - 0.5 - time) / 0.2, 0, 1)

    def wave(size):
        return size * np.sin(2 * np.pi * rng.uniform(0.3, 2) * time + rng.uniform(0, 6))

    up = plate.rotation[:, 2] * np.sign(plate.rotation[2, 2])
    along, across = plate.rotation[:, 0], plate.rotation[:, 1]
    force = ramp[:, None] * (
        (weight + wave(80))[:, None] * up + wave(60)[:, None] * along + (20 + wave(60))[:, None] * across
    )
    point = (
        plate.centre
        + (wave(0.5) * plate.half[0])[:, None] * along
        + (0.3 * plate.half[1] + wave(0.4) * plate.half[1])[:, None] * across
    )
    moment = np.cross(point, force) + (ramp * wave(8))[:, None] * up
    return np.hstack([force, moment]), point


def channels(plate, wrench):
    """The plate's channels (S, C) in SI (volts where it has a matrix)."""
    sign = 1.0 if plate.reaction else -1.0
    force = sign * wrench[:, :3] @ plate.rotation
    moment = sign * (wrench[:, 3:] - np.cross(plate.centre, wrench[:, :3])) @ plate.rotation
    if plate.polynomial is not None:
        force, moment = uncorrected(plate.polynomial, force, moment)
    if plate.type in (3, 6, 7):
        signals = _sensors(plate, force, moment)
    elif plate.type == 1:
        px, py = (
            np.divide(m, force[:, 2], out=np.zeros(len(m)), where=np.abs(force[:, 2]) > 1e-9)
            for m in (-moment[:, 1], moment[:, 0])
        )
        free = moment[:, 2] - px * force[:, 1] + py * force[:, 0]
        signals = np.column_stack([force, px + plate.origin[0], py + plate.origin[1], free])
    else:
        signals = np.hstack([force, moment - np.cross(force, plate.origin)])
    return signals if plate.matrix is None else signals @ np.linalg.pinv(plate.matrix).T


def uncorrected(polynomial, force, moment):
    """The wrench as measured if the maker's polynomial then corrects it to the true one (fixed point)."""
    fz = np.where(np.abs(force[:, 2]) > 20, force[:, 2], np.nan)
    true = np.column_stack([-moment[:, 1] / fz, moment[:, 0] / fz]) * 1000
    seen = true.copy()
    for _ in range(60):
        x, y = seen.T
        p, q = polynomial
        dx = (p[0] * y**4 + p[1] * y**2 + p[2]) * x**3 + (p[3] * y**4 + p[4] * y**2 + p[5]) * x
        dy = (q[0] * x**4 + q[1] * x**2 + q[2]) * y**3 + (q[3] * x**4 + q[4] * x**2 + q[5]) * y
        seen = true + np.column_stack([dx, dy])
    shift = np.nan_to_num(seen - true) / 1000
    return force, moment + np.cross(np.column_stack([shift, np.zeros(len(shift))]), force)


def _sensors(plate, force, moment):
    """Signals of an eight- or twelve-channel plate: the share of the sums among the sensors is arbitrary and drawn
    here.
    """
    a, b, z = plate.origin
    f, m = force, moment - np.cross(force, [0, 0, z])
    # four sums that the moments fix, the rest is free
    n12, n34 = (f[:, 2] + m[:, 0] / b) / 2, (f[:, 2] - m[:, 0] / b) / 2
    n23 = (f[:, 2] + m[:, 1] / a) / 2
    z1 = 0.3 * f[:, 2]
    z2 = n12 - z1
    z3 = n23 - z2
    z4 = n34 - z3
    fx12 = 0.4 * f[:, 0]
    fx34 = f[:, 0] - fx12
    rest = (m[:, 2] - b * (fx34 - fx12)) / a
    fy14, fy23 = (f[:, 1] + rest) / 2, (f[:, 1] - rest) / 2
    if plate.type != 6:
        return np.column_stack([fx12, fx34, fy14, fy23, z1, z2, z3, z4])
    return np.column_stack(
        [0.7 * fx12, 0.2 * fy14, z1, 0.3 * fx12, 0.6 * fy23, z2, 0.1 * fx34, 0.4 * fy23, z3, 0.9 * fx34, 0.8 * fy14, z4]
    )


def raw_file(plates, signals, *, units=None, metres=0.001, zero=(1, 0), offsets=None, spare=2, rate=RATE, **changes):
    """A RawC3d with these plates; ``signals`` list of (S, C) SI; ``changes`` replace FORCE_PLATFORM entries; spare
    channels come first.
    """
    count = max(s.shape[1] for s in signals)
    table, names, unit = [np.zeros((len(signals[0]), spare))], ["EMG"] * spare, ["V"] * spare
    channel = np.zeros((count, len(plates)))
    column = spare
    for k, (plate, signal) in enumerate(zip(plates, signals, strict=True)):
        scale, text = _written_units(plate, metres) if units is None else units[k]
        table.append(signal / np.array(scale) + (0 if offsets is None else offsets[k]))
        unit += text
        names += [f"P{k + 1}.{i}" for i in range(signal.shape[1])]
        channel[: signal.shape[1], k] = np.arange(column, column + signal.shape[1]) + 1
        column += signal.shape[1]
    group = {
        "USED": np.array([len(plates)]),
        "TYPE": np.array([p.type for p in plates]),
        "ZERO": np.array(zero),
        "CORNERS": np.stack([p.corners.T for p in plates], axis=2) / metres,
        "ORIGIN": np.stack([p.origin for p in plates], axis=1) / metres,
        "CHANNEL": channel,
    }
    matrices = [p for p in plates if p.matrix is not None]
    if matrices:
        shape = np.max([p.matrix.shape for p in matrices], axis=0)
        stored = np.zeros((*shape, len(plates)))
        for k, p in enumerate(plates):
            if p.matrix is not None:
                stored[: p.matrix.shape[0], : p.matrix.shape[1], k] = p.matrix * _row_units(p, metres)[:, None]
        group["CAL_MATRIX"] = stored
    if any(p.polynomial is not None for p in plates):
        group["FPCOPPOLY"] = np.stack(
            [np.zeros((2, 6)) if p.polynomial is None else p.polynomial for p in plates], axis=2
        )
    group |= changes
    group = {k: v for k, v in group.items() if v is not None}
    analog = np.hstack(table)
    return RawC3d(
        path=Path("made.c3d"), sha256="0" * 64, labels=(), points=np.empty((0, 0, 3)), rate=100.0,
        first_frame=1,
        analog=analog, analog_labels=tuple(names), analog_units=tuple(unit), analog_rate=rate,
        parameters={"FORCE_PLATFORM": group},
    )  # fmt: skip


def _written_units(plate, metres):
    """SI per written unit and the unit texts of each channel."""
    length = {0.001: "mm", 0.01: "cm", 1.0: "m"}[metres]
    if plate.matrix is not None:
        n = plate.matrix.shape[1]
        return [1.0] * n, ["V"] * n
    kinds = {1: "FFFLLM", 2: "FFFMMM", 3: "F" * 8}[plate.type]
    per = {"F": (1.0, "N"), "M": (metres, "N" + length), "L": (metres, length)}
    return [per[k][0] for k in kinds], [per[k][1] for k in kinds]


def _row_units(plate, metres):
    """What a CAL_MATRIX row is multiplied with, so that its output is in N and N times the file's length unit."""
    return (
        np.array([1, 1, 1, 1 / metres, 1 / metres, 1 / metres])
        if plate.type in (4, 5)
        else np.ones(plate.matrix.shape[0])
    )
