"""Who stands here, told by the points alone: the plane between right and left, the way the feet point, how tall, and
which marker is which landmark where no label says it.

A standing person is nearly symmetric, and has knees, ankles, heels, toes and iliac spines at shares of the stature that
hardly differ between people. A marker is taken for a landmark only where no other could be it.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from biodance.lab.markers.standing import Standing
from biodance.records import SIDES, Array

_USUAL = {
    "asis": ((0.073, 0.085, 0.555), (0.015, 0.022, 0.024)),
    "psis": ((0.030, -0.016, 0.587), (0.012, 0.022, 0.028)),
    "mid_psis": ((0.0, -0.016, 0.587), (0.010, 0.022, 0.028)),
    "knee_lateral": ((0.099, 0.020, 0.287), (0.016, 0.018, 0.016)),
    "knee_medial": ((0.033, 0.021, 0.285), (0.016, 0.018, 0.018)),
    "ankle_lateral": ((0.102, 0.0, 0.044), (0.022, 0.018, 0.008)),
    "ankle_medial": ((0.054, 0.017, 0.049), (0.020, 0.012, 0.008)),
    "heel": ((0.074, -0.031, 0.016), (0.022, 0.012, 0.010)),
    "toe": ((0.098, 0.084, 0.022), (0.026, 0.014, 0.010)),
    "acromion": ((0.098, 0.023, 0.820), (0.018, 0.022, 0.018)),
    "c7": ((0.0, 0.0, 0.836), (0.010, 0.022, 0.020)),
}
"""Where a standing person has a landmark, and how much people and laboratories differ (standard deviation): out from
the middle of the body, ahead of the ankles, up from the floor; shares of the stature. Static trials of nine persons.
"""
_ACROSS = {
    "knee": (np.array([-0.066, 0.001, -0.002]), np.array([0.014, 0.012, 0.012])),
    "ankle": (np.array([-0.048, 0.017, 0.005]), np.array([0.010, 0.012, 0.010])),
}
"""Where the medial marker of a joint lies from the lateral one, and how much people differ: out, ahead, up; shares of
the stature."""
_NEEDED = ("asis", "knee_lateral", "ankle_lateral", "heel", "toe")
_NEAR, _APART = 9.0, 12.0
"""Squared distance, in standard deviations of the three axes, within which a marker may be a landmark, and by which the
next pair of markers must fit worse."""
_SOLE = 0.014
"""Share of the stature at which the lowest marker of a foot is."""
_REACH = 0.6
"""m, horizontal, from the middle within which the markers of a person are."""
_BALL = 0.036
"""Share of the stature by which markers at the big and the little toe are at least apart."""
_MIDDLE = 0.012
"""Share of the stature within which a landmark of the middle lies from it."""
_SAME = 0.012
"""Share of the stature within which two markers mark one landmark."""
_MIRRORED = 0.03
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
    ways = [fit for sign in (1.0, -1.0) if (fit := _fitted(at, xyz, sign * axis, sign * offset)) is not None]
    ways.sort(key=lambda fit: fit[0])
    if not ways or (len(ways) > 1 and ways[1][0] - ways[0][0] < _WAYS):
        return None
    return ways[0][1]


def taken_by_posture(
    part: str, free: Mapping[str, Iterable[str]], known: Mapping[str, str], stand: Standing
) -> dict[str, str]:
    """Return landmark -> label of a ``part`` (without side) of both sides, as far as it is not among ``known``; nothing
    where none or several pairs of markers can be it.

    ``free`` side -> labels that may be it; ``known`` landmark -> label of those that are certain.
    """
    places = [f"{side}_{part}" for side in SIDES]
    first, second = (
        [known[place]] if place in known else list(free[side]) for side, place in zip(SIDES, places, strict=True)
    )
    pair = _only_pair(part, first, second, stand, _ankles(known, stand)) if first and second else None
    found = dict(zip(places, pair, strict=True)) if pair else {}
    return {place: label for place, label in found.items() if place not in known}


def joint_by_posture(
    joint: str, free: Mapping[str, Iterable[str]], known: Mapping[str, str], stand: Standing
) -> dict[str, str]:
    """Return landmark -> label of the lateral and medial markers of a joint of both sides: the two pairs that
    lie beside each other as those of this joint do; nothing where there are none or several.

    ``free`` side -> labels that may be them; ``known`` landmark -> label of those that are certain.
    """
    origin = _ankles(known, stand)
    lateral, medial = (_pairs(f"{joint}_{end}", free, stand, origin) for end in ("lateral", "medial"))
    found = []
    for one, outer in lateral:
        for other, inner in medial:
            if not set(outer) & set(inner):
                apart = _across(outer, inner, stand) - _ACROSS[joint][0]
                found.append((one + other + float(((apart / _ACROSS[joint][1]) ** 2).sum()), outer, inner))
    found.sort()
    if not found or found[0][0] > 4 * _NEAR:
        return {}
    ill, outer, inner = found[0]
    if any(
        one - ill < _APART and not all(_beside(stand, a, b) for a, b in zip(outer + inner, pair + last, strict=True))
        for one, pair, last in found[1:]
    ):
        return {}
    named = ((f"{joint}_lateral", outer), (f"{joint}_medial", inner))
    return {f"{side}_{part}": label for part, pair in named for side, label in zip(SIDES, pair, strict=True)}


def _pairs(
    part: str, free: Mapping[str, Iterable[str]], stand: Standing, origin: float
) -> list[tuple[float, tuple[str, str]]]:
    """Return the pairs of labels, as `SIDES`, that may be a part of both sides, and how ill they fit."""
    near = []
    for side in SIDES:
        labels = list(free[side])
        away = _away(_points(labels, stand), part, 1.0 if side == "right" else -1.0, stand, origin)
        near.append([(float(ill), label) for ill, label in zip(away, labels, strict=True) if ill < _NEAR])
    return [
        (one + two + (apart / _MIRRORED) ** 2, (first, second))
        for one, first in near[0]
        for two, second in near[1]
        if (apart := float(np.linalg.norm(_image(stand.at[first], stand) - stand.at[second]))) < 2 * _MIRRORED
    ]


def _across(outer: tuple[str, str], inner: tuple[str, str], stand: Standing) -> Array:
    """Return (2, 3) where the inner markers of both sides lie from the outer ones: out, ahead, up; shares of the
    stature.
    """
    step = (_points(inner, stand) - _points(outer, stand)) / stand.stature
    return np.array([step[k] * [1.0 if side == "right" else -1.0, 1.0, 1.0] for k, side in enumerate(SIDES)])


def toes_by_posture(free: Mapping[str, Iterable[str]], known: Mapping[str, str], stand: Standing) -> dict[str, str]:
    """Return landmark -> label of the front of both feet: one marker on each is the toes, of several the outermost and
    innermost are those of the little and the big toe if they are as far apart; nothing where that is not so.

    ``free`` side -> labels that may be there; ``known`` landmark -> label of those that are certain.
    """
    origin, out = _ankles(known, stand), {}
    for side in SIDES:
        labels = list(free[side])
        points, sign = _points(labels, stand), 1.0 if side == "right" else -1.0
        front = [k for k, ill in enumerate(_away(points, "toe", sign, stand, origin)) if ill < _NEAR]
        front.sort(key=lambda k: -sign * float(points[k, 0]))
        if len(front) == 1:
            out[f"{side}_toe"] = labels[front[0]]
        elif front and _ball(points[front[0]], points[front[-1]]) > _BALL * stand.stature:
            out |= {f"{side}_toe_lateral": labels[front[0]], f"{side}_toe_medial": labels[front[-1]]}
    parts = [{place for place in out if place.startswith(side)} for side in SIDES]
    return out if len(parts[0]) == len(parts[1]) else {}


def _ball(outer: Array, inner: Array) -> float:
    """Return how far apart two markers of a foot are, m; 0 where one is not beside but before the other."""
    across, along = np.abs(outer - inner)[:2]
    return float(np.hypot(across, along)) if along < across else 0.0


def middle_by_posture(part: str, free: Iterable[str], known: Mapping[str, str], stand: Standing) -> str | None:
    """Return the only marker that can be a landmark of the middle of the body; None if there is none or several."""
    labels = [label for label in free if abs(_points([label], stand)[0, 0]) < _MIDDLE * stand.stature]
    away = _away(_points(labels, stand), part, 1.0, stand, _ankles(known, stand))
    order = np.argsort(away)
    if not labels or away[order[0]] > _NEAR:
        return None
    first = stand.at[labels[order[0]]]
    others = [k for k in order[1:] if np.linalg.norm(stand.at[labels[k]] - first) > _SAME * stand.stature]
    return labels[order[0]] if not others or away[others[0]] - away[order[0]] > _APART / 2 else None


def _ankles(known: Mapping[str, str], stand: Standing) -> float:
    """Return where the ankles are along the person's ahead, m; the middle of a person told by the points."""
    ankles = [stand.at[known[place]] @ stand.ahead for side in SIDES if (place := f"{side}_ankle_lateral") in known]
    spines = [stand.at[known[place]] @ stand.ahead for side in SIDES if (place := f"{side}_asis") in known]
    if len(ankles) == 2:
        return float(np.mean(ankles))
    if not stand.named or len(spines) < 2:
        return float(stand.middle @ stand.ahead)
    return float(np.mean(spines)) - _USUAL["asis"][0][1] * stand.stature


def _only_pair(
    part: str, first: list[str], second: list[str], stand: Standing, origin: float
) -> tuple[str, str] | None:
    """Return the labels on both sides, as `SIDES`, that fit so much better than any others that nothing else can be
    meant; None if there are none.
    """
    one, two = (
        _away(_points(labels, stand), part, 1.0 if side == "right" else -1.0, stand, origin)
        for labels, side in zip((first, second), SIDES, strict=True)
    )
    image = np.array([_image(stand.at[label], stand) for label in first])
    apart = np.linalg.norm(image[:, None] - np.array([stand.at[label] for label in second])[None], axis=2)
    ill = one[:, None] + two[None] + (apart / _MIRRORED) ** 2
    ill[np.array([[label == other for other in second] for label in first])] = np.inf
    i, j = (int(k) for k in np.unravel_index(int(np.argmin(ill)), ill.shape))
    if not np.isfinite(ill[i, j]) or max(one[i], two[j]) > _NEAR or apart[i, j] > 3 * _MIRRORED:
        return None
    same = [np.array([_beside(stand, own[k], label) for label in own]) for own, k in ((first, i), (second, j))]
    rest = ill[~(same[0][:, None] & same[1][None])]
    return (first[i], second[j]) if not rest.size or rest.min() - ill[i, j] > _APART else None


def _beside(stand: Standing, label: str, other: str) -> bool:
    return bool(np.linalg.norm(stand.at[label] - stand.at[other]) <= _SAME * stand.stature)


def _image(point: Array, stand: Standing) -> Array:
    """Return the mirror image (3,) m of a point."""
    image: Array = point - 2 * ((point - stand.middle) @ stand.right) * stand.right
    return image


def mirror_images(stand: Standing) -> list[tuple[str, str]]:
    """Return the pairs of labels (right, left) of which each lies nearest to the mirror image of the other."""
    labels = list(stand.at)
    xyz = np.array([stand.at[label] for label in labels])
    away = np.linalg.norm(np.array([_image(point, stand) for point in xyz])[:, None] - xyz[None], axis=2)
    nearest = away.argmin(axis=1)
    return [
        (labels[i], labels[j])
        for i, j in enumerate(nearest)
        if nearest[j] == i and i != j and away[i, j] < _MIRRORED and (xyz[i] - xyz[j]) @ stand.right > 0
    ]


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
    one = np.flatnonzero((away.min(axis=1) < _MIRRORED) & (xyz @ axis > offset + _WIDE / 4))
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
    return float(np.clip(1.5 - near / _MIRRORED, 0.0, 1.0).sum())


def _fitted(at: Mapping[str, Array], xyz: Array, right: Array, offset: float) -> tuple[float, Standing] | None:
    """Return how ill a person fits who has the right in this direction, and that person; None if none does."""
    ahead = np.cross([0.0, 0.0, 1.0], right)
    out, along, up = xyz @ right - offset, xyz @ ahead, xyz[:, 2]
    person = np.hypot(out, along - np.median(along)) < _REACH
    low = float(up[person].min()) if person.any() else 0.0
    best, points = (np.inf, 0.0, 0.0), np.stack([out, along, up], axis=1)
    for stature in _STATURES:
        floor = low - _SOLE * stature
        lateral = person & (np.abs((up - floor) / stature - 0.044) < 0.02) & (np.abs(out) > 0.05 * stature)
        stand = Standing(at, {}, right, ahead, right * offset, floor, float(stature))
        origins = np.unique(along[lateral].round(2))
        if origins.size:
            ill = _misfit(points, stand, origins[:, None])
            best = min(best, (float(ill.min()), float(stature), float(origins[int(ill.argmin())])))
    ill, stature, origin = best
    if ill > _NEAR * len(_NEEDED):
        return None
    floor = low - _SOLE * stature
    return ill, Standing(at, {}, right, ahead, right * offset + ahead * origin, floor, stature)


def _misfit(points: Array, stand: Standing, origin: Array) -> Array:
    """Return (O,) the sum over the needed landmarks of both sides of how far the nearest of ``points`` (N, 3) is, in
    squared standard deviations, each at most twice what is believed; more for a person with markers above the head.
    ``origin`` (O, 1) m where the ankles are.
    """
    sides = [(part, sign) for part in _NEEDED for sign in (1.0, -1.0)]
    near = [_away(points, part, sign, stand, origin).min(axis=1) for part, sign in sides]
    behind = [_away(points, part, 1.0, stand, origin).min(axis=1) for part in ("psis", "mid_psis")]
    ill = np.minimum([*near, np.minimum(*behind)], 2 * _NEAR).sum(axis=0)
    trunk = points[np.abs(points[:, 0]) < 0.12 * stand.stature]
    over = max(float((trunk[:, 2] - stand.floor).max(initial=0.0)) / stand.stature - 1.03, 0.0) / 0.02
    found: Array = ill + over**2
    return found


def _points(labels: Iterable[str], stand: Standing) -> Array:
    """Return (N, 3) m of markers: right of the middle, ahead, up."""
    xyz = np.array([stand.at[label] for label in labels]).reshape(-1, 3)
    return np.stack([(xyz - stand.middle) @ stand.right, xyz @ stand.ahead, xyz[:, 2]], axis=1)


def _away(points: Array, part: str, sign: float, stand: Standing, origin: float | Array) -> Array:
    """Return (N,) how far every point is from the usual place of a landmark, in squared standard deviations; ``sign``
    -1 for the left one, ``origin`` m where the ankles are along the person's ahead ((O, 1): for each of them, (O, N)).
    """
    place, spread = _USUAL[part]
    here = (sign * points[:, 0], points[:, 1] - origin, points[:, 2] - stand.floor)
    steps = [(one / stand.stature - usual) / by for one, usual, by in zip(here, place, spread, strict=True)]
    found: Array = steps[0] ** 2 + steps[1] ** 2 + steps[2] ** 2
    return found
