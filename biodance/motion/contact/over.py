"""What lies over which plate, seen from above: points, soles, pressures."""

from functools import reduce

import numpy as np

from biodance.motion.contact.soles import Soles
from biodance.records import SIDES, Array, Mask, Plate
from biodance.settings import COP_FORCE

_UNDER = 0.03
"""m: a centre of pressure so near to a sole is under it."""


def inside(plate: Plate, points: Array) -> Array:
    """Return how far points (..., 3) m are inside the plate seen from above: distance to the nearest edge, negative
    outside.
    """
    corners = plate.corners[:, :2]
    after = np.concatenate([corners[1:], corners[:1]])
    (x, y), (u, v) = corners.T, (after - corners).T
    inward = np.sign(x @ after[:, 1] - y @ after[:, 0]) * np.array([-v, u]) / np.hypot(u, v)
    within = points[..., :2] @ inward - (x * inward[0] + y * inward[1])
    return np.asarray(reduce(np.minimum, np.moveaxis(within, -1, 0)))


def standing_on(plates: tuple[Plate, ...], soles: Soles) -> Mask:
    """Return (T, 2, P) which soles are on each plate, as far as one frame tells: their middle lies over it; of a plate
    of unknown place, whose rectangle is only drawn round its pressures, or whose foot is told, they press it.
    """
    seen = [one.placed and not one.foot for one in plates]
    on = [inside(p, soles.centre) > 0 if s else pressed_by(p, soles) for p, s in zip(plates, seen, strict=True)]
    return np.stack(on, axis=2)


def pressed_by(plate: Plate, soles: Soles) -> Mask:
    """Return (T, 2) which soles carry what a plate measures: the foot that is told; else its centre of pressure lies
    under this foot, else under both.
    """
    cop = plate.wrench.cop(height=plate.height, threshold=COP_FORCE)[:, :2]
    known = np.isfinite(cop).all(axis=1)
    alone = np.zeros((len(cop), 2), dtype=bool)
    if plate.foot:
        alone[:, SIDES.index(plate.foot)] = known
        return alone
    for feet in ([0], [1], [0, 1]):
        here = known & np.isfinite(soles.outline[:, feet]).all(axis=(1, 2, 3)) & ~alone.any(axis=1)
        points = np.concatenate([soles.outline[here, foot, :, :2] for foot in feet], axis=1)
        alone[np.ix_(np.flatnonzero(here), np.array(feet))] |= (distance_to_hull(cop[here], points) < _UNDER)[:, None]
    return alone


def distance_to_hull(point: Array, points: Array) -> Array:
    """Return the distance (n,) of each ``point`` (n, 2) from the convex hull of its ``points`` (n, P, 2); 0 inside.

    A point is outside if all others are seen from it within half a turn; then the nearest of all chords between them is
    the hull's edge.
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
