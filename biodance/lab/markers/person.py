"""Who stands here, told by the points alone: the plane between right and left, the way the feet point, how tall.

A standing person is nearly symmetric, and has knees, ankles, heels, toes and iliac spines at shares of the stature that
hardly differ between people.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from biodance.lab.markers.standing import OUTWARDS, Standing, usual_standing
from biodance.records import Array

_NEEDED = ("asis", "knee_lateral", "ankle_lateral", "heel", "toe")
NEAR = 9.0
"""Squared distance, in standard deviations of the three axes, within which a marker may be a landmark."""
_SOLE = 0.014
"""Share of the stature at which the lowest marker of a foot is."""
_REACH = 0.6
"""m, horizontal, from the middle within which the markers of a person are."""
PAIRED = 0.03
"""m: so near to the mirror image of another marker a marker is its pair."""
_STATURES = np.geomspace(0.85, 2.15, 40)
"""m: statures that are tried."""
_LEVEL, _WIDE = 0.025, 0.1
"""m: difference in height, and distance, of two markers that may be mirror images."""
_TRIED = 250
"""Pairs of markers, those of the most equal height, of which the plane between is tried."""
_HALF = 0.3
"""Share of the markers that must have a mirror image, or lie in the middle, in a person who stands straight."""
_WAYS = 5.0
"""By so much (in squared standard deviations) the other way round must fit worse."""


def person_of(at: Mapping[str, Array]) -> Standing | None:
    """Return who stands in the points ``at`` label -> (3,) m, z up, without reading a label; None where nobody stands
    straight, or where front and back cannot be told.
    """
    xyz = np.array(list(at.values())).reshape(-1, 3)
    plane = _plane_between(xyz)
    if plane is None:
        return None
    axis, offset = plane
    fits = [fit for sign in (1.0, -1.0) if (fit := _fitted(at, xyz, sign * axis, sign * offset)) is not None]
    fits.sort(key=lambda fit: fit[0])
    if not fits or (len(fits) > 1 and fits[1][0] - fits[0][0] < _WAYS):
        return None
    return fits[0][1]


def mirror_images(stand: Standing) -> list[tuple[str, str]]:
    """Return the pairs of labels (right, left) of which each lies nearest to the mirror image of the other."""
    labels = list(stand.at)
    xyz = np.array([stand.at[label] for label in labels])
    away = np.linalg.norm(np.array([mirror_image(point, stand) for point in xyz])[:, None] - xyz[None], axis=2)
    nearest = away.argmin(axis=1)
    return [
        (labels[i], labels[j])
        for i, j in enumerate(nearest)
        if nearest[j] == i and i != j and away[i, j] < PAIRED and (xyz[i] - xyz[j]) @ stand.right > 0
    ]


def mirror_image(point: Array, stand: Standing) -> Array:
    """Return the mirror image (3,) m of a point."""
    image: Array = point - 2 * ((point - stand.middle) @ stand.right) * stand.right
    return image


def from_the_middle(labels: Iterable[str], stand: Standing) -> Array:
    """Return (N, 3) m of markers: right of the middle, ahead, up."""
    xyz = np.array([stand.at[label] for label in labels]).reshape(-1, 3)
    return np.stack([(xyz - stand.middle) @ stand.right, xyz @ stand.ahead, xyz[:, 2]], axis=1)


def from_usual(points: Array, place: str, stand: Standing, origin: float | Array) -> Array:
    """Return (N,) how far every point is from the usual place of a landmark, in squared standard deviations; ``origin``
    m where the ankles are along the person's ahead ((O, 1): for each of them, (O, N)).
    """
    side, _, part = place.partition("_")
    usual = usual_standing()["places"][part if side in OUTWARDS else place]
    here = (OUTWARDS.get(side, 1.0) * points[:, 0], points[:, 1] - origin, points[:, 2] - stand.floor)
    steps = [(x / stand.stature - at) / sd for x, at, sd in zip(here, usual["at"], usual["sd"], strict=True)]
    found: Array = steps[0] ** 2 + steps[1] ** 2 + steps[2] ** 2
    return found


def _plane_between(xyz: Array) -> tuple[Array, float] | None:
    """Return the horizontal unit vector (3,) across the body and the place of the middle along it, m: of the planes
    between two markers of one height the one that mirrors most markers onto others; None if it mirrors too few.
    """
    step = xyz[:, None] - xyz[None]
    flat = np.hypot(step[..., 0], step[..., 1])
    first, second = np.nonzero(np.triu((np.abs(step[..., 2]) < _LEVEL) & (flat > _WIDE)))
    best, plane = 0.0, None
    level = np.argsort(np.abs(step[first, second, 2]))[:_TRIED]
    for i, j in zip(first[level], second[level], strict=True):
        axis = step[i, j] * [1.0, 1.0, 0.0] / flat[i, j]
        offset = float((xyz[i] + xyz[j]) @ axis / 2)
        here = _symmetry(xyz, axis, offset)
        if here > best:
            best, plane = here, (axis, offset)
    if plane is None or best < _HALF * len(xyz):
        return None
    return _mean_plane(xyz, *plane)


def _mean_plane(xyz: Array, axis: Array, offset: float) -> tuple[Array, float]:
    """Return the plane (axis (3,), offset m) through the middle of all markers that one near it mirrors onto others."""
    image = xyz - 2 * (xyz @ axis - offset)[:, None] * axis
    away = np.linalg.norm(image[:, None] - xyz[None], axis=2)
    one = np.flatnonzero((away.min(axis=1) < PAIRED) & (xyz @ axis > offset + _WIDE / 4))
    other = away.argmin(axis=1)[one]
    if not one.size:
        return axis, offset
    across = (xyz[one] - xyz[other]).sum(axis=0) * [1.0, 1.0, 0.0]
    across = across / np.linalg.norm(across)
    return across, float(np.median((xyz[one] + xyz[other]) @ across / 2))


def _symmetry(xyz: Array, axis: Array, offset: float) -> float:
    """Return how many markers lie at the mirror image of another, each weighted by how near it is."""
    image = xyz - 2 * (xyz @ axis - offset)[:, None] * axis
    near = np.linalg.norm(image[:, None] - xyz[None], axis=2).min(axis=1)
    return float(np.clip(1.5 - near / PAIRED, 0.0, 1.0).sum())


def _fitted(at: Mapping[str, Array], xyz: Array, right: Array, offset: float) -> tuple[float, Standing] | None:
    """Return how ill a person fits who has the right in this direction, and that person; None if none does."""
    ahead = np.cross([0.0, 0.0, 1.0], right)
    out, along, up = xyz @ right - offset, xyz @ ahead, xyz[:, 2]
    person = np.hypot(out, along - np.median(along)) < _REACH
    low = float(up[person].min()) if person.any() else 0.0
    best, points = (float("inf"), 0.0, 0.0), np.stack([out, along, up], axis=1)
    for stature in _STATURES:
        floor = low - _SOLE * stature
        lateral = person & (np.abs((up - floor) / stature - 0.044) < 0.02) & (np.abs(out) > 0.05 * stature)
        stand = Standing(at, {}, right, ahead, right * offset, floor, float(stature))
        origins = np.unique(along[lateral].round(2))
        if origins.size:
            misfits = _misfit(points, stand, origins[:, None])
            best = min(best, (float(misfits.min()), float(stature), float(origins[int(misfits.argmin())])))
    ill, stature, origin = best
    if ill > NEAR * len(_NEEDED):
        return None
    floor = low - _SOLE * stature
    return ill, Standing(at, {}, right, ahead, right * offset + ahead * origin, floor, stature)


def _misfit(points: Array, stand: Standing, origin: Array) -> Array:
    """Return (O,) the sum over the needed landmarks of both sides of how far the nearest of ``points`` (N, 3) is, in
    squared standard deviations, each at most twice what is believed; more for a person with markers above the head.
    ``origin`` (O, 1) m where the ankles are.
    """
    places = [f"{side}_{part}" for part in _NEEDED for side in OUTWARDS]
    near = [from_usual(points, place, stand, origin).min(axis=1) for place in places]
    behind = [from_usual(points, place, stand, origin).min(axis=1) for place in ("right_psis", "mid_psis")]
    ill = np.minimum([*near, np.minimum(*behind)], 2 * NEAR).sum(axis=0)
    trunk = points[np.abs(points[:, 0]) < 0.12 * stand.stature]
    over = max(float((trunk[:, 2] - stand.floor).max(initial=0.0)) / stand.stature - 1.03, 0.0) / 0.02
    found: Array = ill + over**2
    return found
