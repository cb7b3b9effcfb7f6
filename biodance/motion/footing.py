"""The geometry of soles on plates: what lies over which plate, and how far a centre of pressure is from a sole."""

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from biodance.motion.soles import Soles
from biodance.records import Array, Plate

if TYPE_CHECKING:
    from biodance.motion.surfaces import Surfaces

Mask = NDArray[np.bool_]
RIM = 0.005
"""m of the outline's edge that carry nothing: a sole is rounded, and broadest above the ground."""
REACH = 0.09
"""m: a foot within this height of a plate is over that plate and not over one of another step."""
HALF = 0.3
"""Share of the sole that must be over a raised plate."""
RAISED = 0.05
"""m that a plate stands out of everything around it to count as raised."""


@dataclass(frozen=True, eq=False)
class Footing:
    """Feet (right, left) on plates: ``on_plate`` (T, 2, P) a part of a touching foot is over the plate; ``share`` (T, 2) of the sole over
    plates of its height; ``covered`` (T, 2) nothing of the foot can touch anything but plates; ``unseen`` (T, 2) not seen.
    """

    on_plate: Mask
    share: Array
    covered: Mask
    unseen: Mask


def inside(plate: Plate, points: Array) -> Array:
    """Return how far points (..., 3) m are inside the plate seen from above: distance to the nearest edge, negative outside."""
    corners = plate.corners[:, :2]
    edges = np.roll(corners, -1, axis=0) - corners
    turn = np.sign(np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1)))
    distance = np.full(points.shape[:-1], np.inf)
    for corner, edge in zip(corners, edges, strict=True):
        normal = turn * np.array([-edge[1], edge[0]]) / np.linalg.norm(edge)
        distance = np.minimum(distance, (points[..., :2] - corner) @ normal)
    return distance


def footing(plates: tuple[Plate, ...], soles: Soles, surfaces: "Surfaces", touching: Mask) -> Footing:
    """Return which plates the touching feet (T, 2) are over, and whether they can touch anything else."""
    samples = _samples(soles)
    low = (soles.outline[..., 2] - surfaces.offset).min(axis=2)
    unseen = np.isnan(low)
    anywhere = np.zeros(samples.shape[:-1], dtype=bool)
    raised = np.ones(low.shape, dtype=bool)
    on_plate = np.zeros((*low.shape, len(plates)), dtype=bool)
    for index, plate in enumerate(plates):
        over = (inside(plate, samples) >= 0) & (np.abs(low - plate.height) < REACH)[..., None]
        on_plate[..., index] = over.any(axis=-1) & touching
        anywhere |= over
        if any(abs(height - plate.height) < RAISED for height in surfaces.bare):
            raised &= ~over.any(axis=-1)
    share = anywhere.mean(axis=-1)
    covered = (share == 1) | (raised & (share >= HALF))
    return Footing(on_plate, share, covered & ~unseen, unseen)


def _samples(soles: Soles) -> Array:
    """Return points (T, 2, S, 3) m all over the soles without their rim: the outline and the middles of all its chords."""
    centre = soles.centre[:, :, None]
    outwards = (soles.outline - centre) * np.array([1.0, 1.0, 0.0])
    length = np.linalg.norm(outwards, axis=-1, keepdims=True)
    narrow = soles.outline - np.minimum(RIM / np.maximum(length, 1e-9), 1.0) * outwards
    middles = [(narrow[:, :, i] + narrow[:, :, j]) / 2 for i, j in combinations(range(narrow.shape[2]), 2)]
    return np.concatenate([narrow, np.stack(middles, axis=2)], axis=2)


def cop_outside(plates: tuple[Plate, ...], soles: Soles, place: Footing, pressed: Mask) -> Array:
    """Return the distance (T, P) m of every plate's centre of pressure from the soles on it; 0 inside, NaN without foot or not ``pressed``.

    With both feet on a plate, the area between them counts as inside.
    """
    found = np.full(pressed.shape, np.nan)
    for index, plate in enumerate(plates):
        cop = plate.wrench.cop(height=plate.height)[:, :2]
        known = pressed[:, index] & np.isfinite(cop).all(axis=1)
        for feet in ([0], [1], [0, 1]):
            here = known & (place.on_plate[:, :, index] == np.isin([0, 1], feet)).all(axis=1)
            points = np.concatenate([soles.outline[here, foot, :, :2] for foot in feet], axis=1)
            found[here, index] = distance_to_hull(cop[here], points)
    return found


def distance_to_hull(point: Array, points: Array) -> Array:
    """Return the distance (n,) of each ``point`` (n, 2) from the convex hull of its ``points`` (n, P, 2); 0 inside.

    A point is outside if all others are seen from it within half a turn; then the nearest of all chords between them is the hull's edge.
    """
    towards = points - point[:, None]
    angle = np.sort(np.arctan2(towards[..., 1], towards[..., 0]), axis=1)
    widest = np.max(np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi), axis=1)
    distance = np.zeros(len(point))
    for row in np.flatnonzero(widest > np.pi):
        i, j = np.triu_indices(points.shape[1], k=1)
        start, chord = towards[row, i], towards[row, j] - towards[row, i]
        along = np.clip(-np.sum(chord * start, axis=1) / np.maximum(np.sum(chord**2, axis=1), 1e-18), 0, 1)[:, None]
        distance[row] = np.linalg.norm(start + along * chord, axis=1).min()
    return distance
