"""Who stands here: a person's right, ahead, floor and stature, told by labels or by the points alone, and where such a
person has landmarks (``anthropometry/standing.toml``).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from biodance.lab.markers.set_file import part_of
from biodance.lab.markers.spelling import plain_labels
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array

OUTWARDS = {"right": 1.0, "left": -1.0}
"""Sign of a person's right on each side."""
_ON_THE_SIDE = ("asis", "knee", "ankle", "heel", "toe", "acromion")
_STRAIGHT = ("asis", "psis", "acromion")
"""Pairs that point right even where one leg is before the other."""
_PAIRS = (*_STRAIGHT, "knee_lateral", "ankle_lateral", "heel", "toe", "toe_lateral")
_FRONT_AND_BACK = (("toe", "{}_heel"), ("toe_lateral", "{}_heel"), ("asis", "{}_psis"), ("asis", "mid_psis"))
"""Landmarks before others, of the same side where both have one."""
_ABOVE = ("ankle_lateral", "asis")
_FEET = ("_heel", "_toe", "_toe_lateral", "_toe_medial")
_NEEDED = ("asis", "knee_lateral", "ankle_lateral", "heel", "toe")
_STATURES = np.geomspace(0.85, 2.15, 40)
"""m: statures that are tried."""


@cache
def usual_standing() -> dict[str, Any]:
    """Return where a standing person has landmarks and segments: the tables of ``anthropometry/standing.toml``."""
    return read_toml(locate("anthropometry", "standing"))


def bound(name: str) -> float:
    """Return one of the numbers by which a standing person is told: ``[rules]`` of ``anthropometry/standing.toml``."""
    return float(usual_standing()["rules"][name])


def _height_of(place: str) -> tuple[float, float] | None:
    """Return the usual height of a landmark and how far from it it is believed; None where it has none."""
    part, heights = part_of(place), usual_standing()["heights"]
    return next((pair for key, pair in heights.items() if part == key or part.startswith(f"{key}_")), None)


@dataclass(frozen=True, eq=False)
class Standing:
    """One standing posture: ``at`` label -> (3,) m; ``named`` landmark -> label as far as known; ``right``, ``ahead``
    horizontal unit vectors; ``middle`` (3,) m of the body, above the ankles; ``floor`` m; ``stature`` m.
    """

    at: Mapping[str, Array]
    named: Mapping[str, str]
    right: Array
    ahead: Array
    middle: Array
    floor: float
    stature: float

    def shares(self, labels: Iterable[str]) -> Array:
        """Return (N, 3) of markers, in shares of the stature: right of the middle, ahead of it, above the floor."""
        xyz = np.array([self.at[label] for label in labels]).reshape(-1, 3) - [*self.middle[:2], self.floor]
        return np.asarray(xyz @ np.stack([self.right, self.ahead, [0.0, 0.0, 1.0]]).T / self.stature)

    def misfit(self, place: str, label: str) -> float:
        """Return how far a marker is from the usual height of a landmark: 1 at the limit where it is believed; 0 where
        the height tells nothing.
        """
        usual = _height_of(place)
        return float(abs(self.shares([label])[0, 2] - usual[0]) / usual[1]) if usual else 0.0

    def believed(self, place: str, label: str) -> bool:
        """Return whether a marker stands where a person may have this landmark or segment: as high, on its side, heel
        and toes behind and before their ankle, arms within reach of their shoulder.
        """
        side, part, usual = place.partition("_")[0], part_of(place), usual_standing()
        out, ahead, high = self.shares([label])[0]
        lowest, highest = usual["between"].get(part, (-np.inf, np.inf))
        if not lowest <= high <= highest or self.misfit(place, label) > 1:
            return False
        if side not in SIDES:
            return bool(abs(out) < bound("off_middle")) or place.startswith("head") or _height_of(place) is None
        own = OUTWARDS[side] * out
        if own >= usual["widest"].get(part, np.inf) or (own <= -bound("across") and part.startswith(_ON_THE_SIDE)):
            return False
        ankle, shoulder = (self.named.get(f"{side}_{end}", label) for end in ("ankle_lateral", "acromion"))
        _, before, lifted = self.shares([ankle])[0]
        if part.startswith(("heel", "toe")) and ankle != label and lifted < bound("lifted"):
            return bool(ahead < before if part == "heel" else ahead - before > bound("across"))
        reach = next((span for key, span in usual["reach"].items() if part.startswith(key)), None)
        away = float(np.linalg.norm(self.at[label] - self.at[shoulder])) / self.stature
        return reach is None or shoulder == label or bool(reach[0] <= away <= reach[1])


def standing_by_names(at: Mapping[str, Array], named: Mapping[str, str]) -> Standing | str | None:
    """Return the standing person that labelled points show, a sentence if nobody stands so, None if the names are too
    few.

    ``at`` label -> (3,) m, z up; ``named`` landmark -> label.
    """
    known = {place: at[label] for place, label in named.items()}
    paired = [part for part in _PAIRS if known.keys() >= {f"right_{part}", f"left_{part}"}]
    pairs = {part: known[f"right_{part}"] - known[f"left_{part}"] for part in paired}
    ends = [(f"{side}_{front}", back.format(side)) for side in SIDES for front, back in _FRONT_AND_BACK]
    ahead = [known[front] - known[back] for front, back in ends if known.keys() >= {front, back}]
    if len(pairs) < 3 or not ahead:
        return None
    straight = [pairs[part] for part in _STRAIGHT if part in pairs] or list(pairs.values())
    right = np.sum(straight, axis=0) * [1.0, 1.0, 0.0]
    right = right / max(float(np.linalg.norm(right)), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    if np.mean([step @ forward > 0 for step in ahead]) < 0.5:
        return (
            "The labels say right where the person has the left: toes and iliac spines would point backwards. Are the "
            "sides exchanged, or is z not up?"
        )
    if any(pair @ right <= 0 for pair in pairs.values()):
        return "Of some pairs of markers the right one lies left of the left one: the sides are exchanged in part."
    both = [part for part in _STRAIGHT[:2] if part in pairs] or list(pairs)
    middle = np.mean([known[f"{side}_{part}"] for part in both for side in SIDES], axis=0)
    feet = [place[2] for name, place in known.items() if name.endswith(_FEET)]
    floor = float(min(feet or (at[label][2] for label in plain_labels(at)))) - 0.02
    usual = [(place[2], _height_of(name)) for name, place in known.items()]
    statures = [(high - floor) / pair[0] for high, pair in usual if pair and pair[0] > 0.2]
    stature = float(np.median(statures)) if statures else 0.0
    if not 0.6 < stature < 2.6:
        return f"Nobody stands upright here: the labels would make a person of {stature:.2f} m."
    ankles, spines = ([known[place] for s in SIDES if (place := f"{s}_{part}") in known] for part in _ABOVE)
    usual_place = usual_standing()["places"]["asis"]["at"][1] * stature
    back = np.mean(ankles, axis=0) if len(ankles) == 2 else np.mean(spines or [middle], axis=0) - usual_place * forward
    return Standing(at, named, right, forward, middle + (back - middle) @ forward * forward, floor, stature)


def standing_by_points(at: Mapping[str, Array]) -> Standing | None:
    """Return who stands in the points ``at`` label -> (3,) m, z up, without reading a label; None where nobody stands
    straight, or where front and back cannot be told.

    A standing person is nearly symmetric, and has knees, ankles, heels, toes and iliac spines at shares of the stature
    that hardly differ between people.
    """
    plane = _plane_between(np.array(list(at.values())).reshape(-1, 3))
    ways = [_fitted(at, sign * plane[0], sign * plane[1]) for sign in (1.0, -1.0)] if plane else []
    fits = sorted((fit for fit in ways if fit is not None), key=lambda fit: fit[0])
    if not fits or (len(fits) > 1 and fits[1][0] - fits[0][0] < bound("ways")):
        return None
    return fits[0][1]


def mirror_images(stand: Standing) -> list[tuple[str, str]]:
    """Return the pairs of labels (right, left) of which each lies nearest to the mirror image of the other."""
    labels, xyz = list(stand.at), np.array(list(stand.at.values()))
    out = (xyz - stand.middle) @ stand.right
    away = _mirrored(xyz, stand.right, float(stand.middle @ stand.right))
    nearest = away.argmin(axis=1)
    return [
        (labels[i], labels[j])
        for i, j in enumerate(nearest)
        if nearest[j] == i and i != j and away[i, j] < bound("paired_m") and out[i] > out[j]
    ]


def _plane_between(xyz: Array) -> tuple[Array, float] | None:
    """Return the horizontal unit vector (3,) across the body and the place of the middle along it, m: of the planes
    between two markers of one height the one that mirrors most markers onto others; None if it mirrors too few.
    """
    step = xyz[:, None] - xyz[None]
    flat = np.hypot(step[..., 0], step[..., 1])
    first, second = np.nonzero(np.triu((np.abs(step[..., 2]) < bound("level_m")) & (flat > bound("wide_m"))))
    best, plane = 0.0, None
    level = np.argsort(np.abs(step[first, second, 2]))[: int(bound("tried"))]
    for i, j in zip(first[level], second[level], strict=True):
        axis = step[i, j] * [1.0, 1.0, 0.0] / flat[i, j]
        offset = float((xyz[i] + xyz[j]) @ axis / 2)
        here = float(np.clip(1.5 - _mirrored(xyz, axis, offset).min(axis=1) / bound("paired_m"), 0.0, 1.0).sum())
        if here > best:
            best, plane = here, (axis, offset)
    if plane is None or best < bound("half") * len(xyz):
        return None
    axis, offset = plane
    away = _mirrored(xyz, axis, offset)
    one = np.flatnonzero((away.min(axis=1) < bound("paired_m")) & (xyz @ axis > offset + bound("wide_m") / 4))
    if not one.size:
        return plane
    # The plane in the middle of all pairs, not of the one that it was found by.
    other = away.argmin(axis=1)[one]
    across = (xyz[one] - xyz[other]).sum(axis=0) * [1.0, 1.0, 0.0]
    across = across / np.linalg.norm(across)
    return across, float(np.median((xyz[one] + xyz[other]) @ across / 2))


def _mirrored(xyz: Array, axis: Array, offset: float) -> Array:
    """Return (N, N) m from the mirror image of every marker to every marker."""
    image = xyz - 2 * (xyz @ axis - offset)[:, None] * axis
    away: Array = np.linalg.norm(image[:, None] - xyz[None], axis=2)
    return away


def _fitted(at: Mapping[str, Array], right: Array, offset: float) -> tuple[float, Standing] | None:
    """Return how ill a person fits who has the right in this direction, and that person; None if none does."""
    xyz = np.array(list(at.values()))
    ahead = np.cross([0.0, 0.0, 1.0], right)
    out, along, up = xyz @ right - offset, xyz @ ahead, xyz[:, 2]
    person = np.hypot(out, along - np.median(along)) < bound("reach_m")
    low = float(up[person].min()) if person.any() else 0.0
    best = (float("inf"), 0.0, 0.0)
    for stature in _STATURES:
        shares = np.stack([out, along, up - low], axis=1) / stature + [0.0, 0.0, bound("sole")]
        lateral = person & (np.abs(shares[:, 2] - 0.044) < 0.02) & (np.abs(shares[:, 0]) > 0.05)
        origins = np.unique(along[lateral].round(2))
        if origins.size:
            misfits = _misfit(shares, origins[:, None] / stature)
            best = min(best, (float(misfits.min()), float(stature), float(origins[int(misfits.argmin())])))
    ill, stature, origin = best
    if ill > bound("near") * len(_NEEDED):
        return None
    return ill, Standing(at, {}, right, ahead, right * offset + ahead * origin, low - bound("sole") * stature, stature)


def _misfit(shares: Array, origin: Array) -> Array:
    """Return (O,) the sum over the needed landmarks of both sides of how far the nearest of the markers (N, 3) is, in
    squared standard deviations, each at most twice what is believed; more for a person with markers above the head.
    ``origin`` (O, 1): where the ankles are ahead. All in shares of the stature.
    """

    def nearest(part: str, side: float) -> Array:
        usual = usual_standing()["places"][part]
        here = (side * shares[:, 0], shares[:, 1] - origin, shares[:, 2])
        steps = [((x - at) / sd) ** 2 for x, at, sd in zip(here, usual["at"], usual["sd"], strict=True)]
        found: Array = (steps[0] + steps[1] + steps[2]).min(axis=1)
        return found

    near = [nearest(part, side) for part in _NEEDED for side in OUTWARDS.values()]
    behind = np.minimum(nearest("psis", 1.0), nearest("mid_psis", 1.0))
    trunk = shares[np.abs(shares[:, 0]) < 0.12]
    over = max(float(trunk[:, 2].max(initial=0.0)) - 1.03, 0.0) / 0.02
    return np.asarray(np.minimum([*near, behind], 2 * bound("near")).sum(axis=0) + over**2)
