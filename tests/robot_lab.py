"""The files of a robot's laboratory: encoders on the robot's clock, a force plate on its own, noise on both.

Whatever made motion and wrench (a simulator, inverse dynamics) is not asked; truth stays with the caller. Algebra of
its own, as everywhere in this room.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.records import Array, Markers

_PLATE_SIZE = (0.50, 0.46)
"""m along the plate's x and y (AMTI AccuGait)."""
_ENCODER_RATE, _PLATE_RATE, _CAMERA_RATE = 500.0, 1000.0, 100.0
"""Hz, of Bonnet et al. 2016."""


@dataclass(frozen=True)
class RobotLab:
    """Where and when: the plate starts ``ahead`` s before the encoders; the frame in which motion and wrench are given
    lies at ``place`` (x, y) m from the plate's centre, turned by ``yaw`` rad; standard deviations of one sample:
    ``encoder`` rad, ``force`` N, ``moment`` N·m, ``camera`` m.
    """

    ahead: float = 0.37
    place: tuple[float, float] = (0.03, -0.02)
    yaw: float = 0.1
    encoder: float = 0.0005
    force: float = 0.3
    moment: float = 0.02
    camera: float = 0.0001


def write_robot_trial(
    path: Path,
    joints: tuple[str, ...],
    time: Array,
    angle: Array,
    wrench: Array,
    *,
    lab: RobotLab,
    seed: int,
    markers: tuple[tuple[str, ...], Array] | None = None,
) -> None:
    """Write ``PATH_joints.csv`` and ``PATH_plate.c3d`` of one motion: joint ``angle`` (T, n) rad as the encoders see it
    and the ``wrench`` (T, 6) N, N·m of the ground on the robot at ``time`` (T,) s, about a point of the ground;
    ``markers`` names (K) and places (T, K, 3) m in the same frame.
    """
    rng, length = np.random.default_rng(seed), float(time[-1] - time[0])
    clock = np.arange(0.0, length, 1 / _ENCODER_RATE)
    seen = np.stack([np.interp(clock + time[0], time, one) for one in angle.T], axis=1)
    seen = seen + lab.encoder * rng.normal(size=seen.shape)
    table = np.column_stack([clock, seen])
    path.parent.mkdir(parents=True, exist_ok=True)
    heading = ",".join(["time (s)", *(f"{joint} (rad)" for joint in joints)])
    np.savetxt(path.with_name(f"{path.name}_joints.csv"), table, fmt="%.6f", delimiter=",", header=heading, comments="")
    per = round(_PLATE_RATE / _CAMERA_RATE)
    ticks = np.arange(int((length + lab.ahead) * _CAMERA_RATE) * per) / _PLATE_RATE - lab.ahead + time[0]
    pressed = np.stack([np.interp(ticks, time, one) for one in wrench.T], axis=1)
    size = np.array([lab.force] * 3 + [lab.moment] * 3)
    write_c3d(
        path.with_name(f"{path.name}_plate.c3d"),
        markers=_seen(markers, time, ticks[::per], lab, rng),
        plates=[_plate(pressed, lab, size * rng.normal(size=pressed.shape))],
        analog_rate=_PLATE_RATE,
    )


def _seen(
    markers: tuple[tuple[str, ...], Array] | None, time: Array, ticks: Array, lab: RobotLab, rng: np.random.Generator
) -> Markers | None:
    """Return what cameras see of the markers, on the plate's clock, in its lab."""
    if markers is None:
        return None
    names, xyz = markers
    flat = np.stack([np.interp(ticks, time, one) for one in xyz.reshape(len(time), -1).T], axis=1)
    c, s = np.cos(lab.yaw), np.sin(lab.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    middle = np.array([*(np.array(_PLATE_SIZE) / 2 + lab.place), 0.0])
    place = flat.reshape(len(ticks), -1, 3) @ turn.T + middle
    return Markers(names, ticks - ticks[0], place + lab.camera * rng.normal(size=place.shape))


def _plate(wrench: Array, lab: RobotLab, noise: Array) -> PlateRecording:
    """Return what a TYPE 2 plate gives: the load on it in its axes (x as the lab's, z down), about its centre."""
    c, s = np.cos(lab.yaw), np.sin(lab.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    force = wrench[:, :3] @ turn.T
    moment = wrench[:, 3:] @ turn.T + np.cross([*lab.place, 0.0], force)
    down = np.array([1.0, -1.0, -1.0])
    channels = np.concatenate([-force * down, -moment * down], axis=1) + noise
    (x, y), middle = np.array(_PLATE_SIZE) / 2, np.array([0.25, 0.23, 0.0])
    corners = middle + np.array([[x, -y, 0.0], [-x, -y, 0.0], [-x, y, 0.0], [x, y, 0.0]])
    return PlateRecording(2, corners, np.zeros(3), channels)
