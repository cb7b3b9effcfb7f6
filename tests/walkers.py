"""Feet that step over known ground, with force plates that measure what stands on them: trials whose contact is
known.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.lab.markers.sets import read_marker_set
from biodance.motion.soles import Soles, soles_from_markers
from biodance.records import Markers, Plate, Source, Trial, Wrench

RATE = 100.0
WEIGHT = 650.0
MARKER_HEIGHTS = np.array([0.03, 0.04])
HEEL_TO_TOE = 0.20


@dataclass(frozen=True)
class Stand:
    """A foot on the ground from ``start`` to ``stop`` s with its heel at ``place`` (3,) m, pointing along x turned
    by ``yaw`` rad.
    """

    start: float
    stop: float
    place: tuple[float, float, float]
    yaw: float = 0.0


def plate(name: str, x: tuple[float, float], y: tuple[float, float], height: float = 0.0) -> Plate:
    """Return an empty plate over the rectangle x, y (m)."""
    corners = [[x[1], y[1], height], [x[0], y[1], height], [x[0], y[0], height], [x[1], y[0], height]]
    return Plate(name, 2, np.array(corners), Wrench(np.zeros(1), np.zeros((1, 6))))


def foot_path(stands: list[Stand], time: np.ndarray, lift: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Return heel and toe marker (T, 2, 3) m of one foot and where it truly touches (T,)."""
    place = np.empty((time.size, 3))
    yaw, touching = np.empty(time.size), np.zeros(time.size, dtype=bool)
    for now, after in zip(stands, [*stands[1:], None], strict=True):
        here = (time >= now.start - 1e-9) & (time <= now.stop + 1e-9)
        place[here], yaw[here], touching[here] = now.place, now.yaw, True
        if after is not None:
            swing = (time > now.stop) & (time < after.start)
            part = (time[swing] - now.stop) / (after.start - now.stop)
            eased = part**3 * (10 - 15 * part + 6 * part**2)
            place[swing] = np.array(now.place) + eased[:, None] * (np.array(after.place) - np.array(now.place))
            place[swing, 2] += lift * np.sin(np.pi * eased) ** 2
            yaw[swing] = now.yaw + eased * (after.yaw - now.yaw)
    ahead = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    heel, toe = place + MARKER_HEIGHTS[0] * up, place + HEEL_TO_TOE * ahead + MARKER_HEIGHTS[1] * up
    return np.stack([heel, toe], axis=1), touching


def walker(
    right: list[Stand],
    left: list[Stand],
    plates: list[Plate],
    *,
    duration: float,
    air: tuple[str, ...] = (),
    noise: float = 2e-4,
) -> tuple[Trial, Soles, np.ndarray, np.ndarray]:
    """Return a prepared trial, its soles, the true contact (T, 2) and, per foot, whether a plate carried all of it (T,
    2).

    ``air`` names feet ("right", "left") whose stands are held in the air: they carry nothing.
    """
    time = np.arange(round(duration * RATE) + 1) / RATE
    paths = [foot_path(stands, time) for stands in (right, left)]
    true = np.stack([path[1] & (side not in air) for path, side in zip(paths, ("right", "left"), strict=True)], axis=1)
    share = true / np.maximum(true.sum(axis=1, keepdims=True), 1)
    carried = np.zeros_like(true)
    forces = np.zeros((len(plates), time.size, 6))
    for foot, (xyz, _) in enumerate(paths):
        cop = xyz.mean(axis=1)
        cop[:, 2] = xyz[:, 0, 2] - MARKER_HEIGHTS[0]
        force = share[:, foot, None] * np.array([10.0, -5.0, WEIGHT])
        for index, one in enumerate(plates):
            low, high = one.corners[:, :2].min(axis=0), one.corners[:, :2].max(axis=0)
            on = (
                ((cop[:, :2] > low) & (cop[:, :2] < high)).all(axis=1)
                & (np.abs(cop[:, 2] - one.height) < 0.01)
                & true[:, foot]
            )
            forces[index] += np.where(on[:, None], np.concatenate([force, np.cross(cop, force)], axis=1), 0.0)
            carried[:, foot] |= on
    rng = np.random.default_rng(11)
    xyz = np.concatenate([paths[0][0], paths[1][0]], axis=1)
    markers = Markers(("RHEE", "RTOE", "LHEE", "LTOE"), time, xyz + rng.normal(0, noise, xyz.shape))
    loaded = tuple(Plate(p.name, 2, p.corners, Wrench(time, force)) for p, force in zip(plates, forces, strict=True))
    trial = Trial("steps", "fit", markers, loaded, Source(Path("steps.c3d"), "", "C3D", RATE, RATE), "plug_in_gait")
    return trial, soles_from_markers(markers, read_marker_set("plug_in_gait")), true, carried
