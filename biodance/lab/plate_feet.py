"""Does the centre of pressure lie under a foot? The markers near the surface of a plate are the witness, whatever their names."""

import numpy as np

from biodance.lab.plate_corners import half_sides
from biodance.records import Array, Markers

LOW = 0.15  # m above the surface: markers of a standing foot, ankle included
BESIDE = 0.15  # m beyond the edge
FRAMES = 200


def distance_to_feet(cop: Array, time: Array, corners: Array, markers: Markers) -> float | None:
    """Return the median distance in m between the centre of pressure and the feet on the plate; None if no foot is seen on it.

    ``cop`` (S, 2) m in the lab frame at ``time`` (S,) s, NaN while unloaded; ``corners`` (4, 3) m. The feet are all markers within 0.15 m
    over the surface and 0.15 m around the plate; the distance is to the nearest straight line between two of them, so it is near 0
    between two feet.
    """
    if markers.time.size == 0 or not np.isfinite(cop).any():
        return None
    frames = np.unique(np.linspace(0, markers.time.size - 1, FRAMES).round().astype(int))
    at = np.clip(np.searchsorted(time, markers.time[frames]), 0, time.size - 1)
    centre, reach = corners.mean(axis=0), float(np.linalg.norm(half_sides(corners))) + BESIDE
    distances = []
    for frame, sample in zip(frames, at, strict=True):
        xyz = markers.xyz[frame]
        near = (np.abs(xyz[:, 2] - centre[2]) <= LOW) & (np.linalg.norm(xyz[:, :2] - centre[:2], axis=1) <= reach)
        if np.isfinite(cop[sample]).all() and near.sum() >= 2:
            distances.append(_distance(cop[sample], xyz[near, :2]))
    return float(np.median(distances)) if len(distances) >= min(5, markers.time.size) else None


def _distance(point: Array, feet: Array) -> float:
    """Return the distance of a point (2,) to the nearest segment between any two of ``feet`` (n, 2)."""
    i, j = np.triu_indices(len(feet), 1)
    start, along = feet[i], feet[j] - feet[i]
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - start) * along).sum(axis=1) / length, 0, 1)
    return float(np.linalg.norm(start + share[:, None] * along - point, axis=1).min())
