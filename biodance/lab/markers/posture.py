"""Which marker is which landmark where no label says it: by where a standing person has it, and only where no other
marker could be it.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from biodance.lab.markers.person import NEAR, PAIRED, from_the_middle, from_usual, mirror_image
from biodance.lab.markers.standing import OUTWARDS, Standing, usual_standing
from biodance.records import SIDES, Array

_APART = 12.0
"""By so much, in squared standard deviations, the next pair of markers must fit worse."""
_BALL = 0.036
"""Share of the stature by which markers at the big and the little toe are at least apart."""
_MIDDLE = 0.012
"""Share of the stature within which a landmark of the middle lies from it."""
_SAME = 0.012
"""Share of the stature within which two markers mark one landmark."""


def taken_by_posture(
    part: str, free: Mapping[str, Iterable[str]], known: Mapping[str, str], stand: Standing
) -> dict[str, str]:
    """Return landmark -> label of a ``part`` (without side) of both sides, as far as it is not among ``known``; nothing
    where none or several pairs of markers can be it.

    ``free`` side -> labels that may be it; ``known`` landmark -> label of those that are certain.
    """
    places = {side: f"{side}_{part}" for side in SIDES}
    labels = [[known[place]] if place in known else list(free[side]) for side, place in places.items()]
    pair = _only_pair(part, labels, stand, _ankles(known, stand)) if all(labels) else ()
    found = zip(places.values(), pair, strict=bool(pair))
    return {place: label for place, label in found if place not in known}


def joint_by_posture(
    joint: str, free: Mapping[str, Iterable[str]], known: Mapping[str, str], stand: Standing
) -> dict[str, str]:
    """Return landmark -> label of the lateral and medial markers of a joint of both sides: the two pairs that
    lie beside each other as those of this joint do; nothing where there are none or several.

    ``free`` side -> labels that may be them; ``known`` landmark -> label of those that are certain.
    """
    origin = _ankles(known, stand)
    lateral, medial = (_pairs(f"{joint}_{end}", free, stand, origin) for end in ("lateral", "medial"))
    found = [
        (one + other + _misfit_across(joint, outer, inner, stand), outer + inner)
        for one, outer in lateral
        for other, inner in medial
        if not set(outer) & set(inner)
    ]
    found.sort()
    if not found or found[0][0] > 4 * NEAR:
        return {}
    ill, best = found[0]
    rivals = [labels for other, labels in found[1:] if other - ill < _APART]
    if not all(_beside(stand, a, b) for labels in rivals for a, b in zip(best, labels, strict=True)):
        return {}
    places = (f"{side}_{joint}_{end}" for end in ("lateral", "medial") for side in SIDES)
    return dict(zip(places, best, strict=True))


def toes_by_posture(free: Mapping[str, Iterable[str]], known: Mapping[str, str], stand: Standing) -> dict[str, str]:
    """Return landmark -> label of the front of both feet: one marker on each is the toes, of several the outermost and
    innermost are those of the little and the big toe if they are as far apart; nothing where that is not so.

    ``free`` side -> labels that may be there; ``known`` landmark -> label of those that are certain.
    """
    origin, found = _ankles(known, stand), []
    for side in SIDES:
        labels = list(free[side])
        points = from_the_middle(labels, stand)
        front = np.flatnonzero(from_usual(points, f"{side}_toe", stand, origin) < NEAR)
        front = front[np.argsort(-OUTWARDS[side] * points[front, 0], kind="stable")]
        if front.size == 1:
            found.append({f"{side}_toe": labels[front[0]]})
        elif front.size and _ball(points[front[0]], points[front[-1]]) > _BALL * stand.stature:
            found.append({f"{side}_toe_lateral": labels[front[0]], f"{side}_toe_medial": labels[front[-1]]})
    return found[0] | found[1] if len(found) == 2 and len(found[0]) == len(found[1]) else {}


def middle_by_posture(part: str, free: Iterable[str], known: Mapping[str, str], stand: Standing) -> str | None:
    """Return the only marker that can be a landmark of the middle of the body; None if there is none or several."""
    labels = [label for label in free if abs(from_the_middle([label], stand)[0, 0]) < _MIDDLE * stand.stature]
    away = from_usual(from_the_middle(labels, stand), part, stand, _ankles(known, stand))
    order = np.argsort(away)
    if not labels or away[order[0]] > NEAR:
        return None
    first = stand.at[labels[order[0]]]
    others = [k for k in order[1:] if np.linalg.norm(stand.at[labels[k]] - first) > _SAME * stand.stature]
    return labels[order[0]] if not others or away[others[0]] - away[order[0]] > _APART / 2 else None


def _pairs(
    part: str, free: Mapping[str, Iterable[str]], stand: Standing, origin: float
) -> list[tuple[float, tuple[str, str]]]:
    """Return the pairs of labels, as `SIDES`, that may be a part of both sides, and how ill they fit."""
    near = []
    for side in SIDES:
        labels = list(free[side])
        away = from_usual(from_the_middle(labels, stand), f"{side}_{part}", stand, origin)
        near.append([(float(ill), label) for ill, label in zip(away, labels, strict=True) if ill < NEAR])
    return [
        (one + two + (apart / PAIRED) ** 2, (first, second))
        for one, first in near[0]
        for two, second in near[1]
        if (apart := float(np.linalg.norm(mirror_image(stand.at[first], stand) - stand.at[second]))) < 2 * PAIRED
    ]


def _misfit_across(joint: str, outer: tuple[str, str], inner: tuple[str, str], stand: Standing) -> float:
    """Return how ill the inner markers of both sides lie to the outer ones, in squared standard deviations."""
    usual = usual_standing()["across"][joint]
    step = (from_the_middle(inner, stand) - from_the_middle(outer, stand)) / stand.stature
    step[:, 0] *= [OUTWARDS[side] for side in SIDES]
    return float((((step - usual["at"]) / usual["sd"]) ** 2).sum())


def _ball(outer: Array, inner: Array) -> float:
    """Return how far apart two markers of a foot are, m; 0 where one is not beside but before the other."""
    across, along = np.abs(outer - inner)[:2]
    return float(np.hypot(across, along)) if along < across else 0.0


def _ankles(known: Mapping[str, str], stand: Standing) -> float:
    """Return where the ankles are along the person's ahead, m; the middle of a person told by the points."""
    ankles = [stand.at[known[place]] @ stand.ahead for side in SIDES if (place := f"{side}_ankle_lateral") in known]
    spines = [stand.at[known[place]] @ stand.ahead for side in SIDES if (place := f"{side}_asis") in known]
    if len(ankles) == 2:
        return float(np.mean(ankles))
    if not stand.named or len(spines) < 2:
        return float(stand.middle @ stand.ahead)
    return float(np.mean(spines) - usual_standing()["places"]["asis"]["at"][1] * stand.stature)


def _only_pair(part: str, labels: list[list[str]], stand: Standing, origin: float) -> tuple[str, ...]:
    """Return the labels on both sides, as `SIDES`, that fit so much better than any others that nothing else can be
    meant; () if there are none.
    """
    first, second = labels
    one, two = (
        from_usual(from_the_middle(own, stand), f"{side}_{part}", stand, origin)
        for own, side in zip(labels, SIDES, strict=True)
    )
    image = np.array([mirror_image(stand.at[label], stand) for label in first])
    apart = np.linalg.norm(image[:, None] - np.array([stand.at[label] for label in second])[None], axis=2)
    ill = one[:, None] + two[None] + (apart / PAIRED) ** 2
    ill[np.array([[label == other for other in second] for label in first])] = np.inf
    i, j = (int(k) for k in np.unravel_index(int(np.argmin(ill)), ill.shape))
    if not np.isfinite(ill[i, j]) or max(one[i], two[j]) > NEAR or apart[i, j] > 3 * PAIRED:
        return ()
    same = [np.array([_beside(stand, own[k], label) for label in own]) for own, k in ((first, i), (second, j))]
    rest = ill[~(same[0][:, None] & same[1][None])]
    return (first[i], second[j]) if not rest.size or rest.min() - ill[i, j] > _APART else ()


def _beside(stand: Standing, label: str, other: str) -> bool:
    return bool(np.linalg.norm(stand.at[label] - stand.at[other]) <= _SAME * stand.stature)
