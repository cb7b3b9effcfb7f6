"""Where a standing person has the landmarks: how high, on which side, toes before heels, arms within reach."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from biodance.lab.markers.spelling import plain_labels
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array

OUTWARDS = {"right": 1.0, "left": -1.0}
"""Sign of a person's right on each side."""

_ON_THE_SIDE = ("asis", "knee", "ankle", "heel", "toe", "acromion")
_ACROSS = 0.02
"""Share of the stature by which a landmark may lie beyond the middle of the body, or one of the middle beside it."""
_OFF_MIDDLE = 0.06
_LIFTED = 0.085
"""Share of the stature above which an ankle belongs to a foot that is not flat on the ground."""
_PAIRS = ("asis", "psis", "knee_lateral", "ankle_lateral", "heel", "toe", "toe_lateral", "acromion")
_STRAIGHT = ("asis", "psis", "acromion")
"""Pairs that point right even where one leg is before the other."""
_FRONT_AND_BACK = (("toe", "{}_heel"), ("toe_lateral", "{}_heel"), ("asis", "{}_psis"), ("asis", "mid_psis"))
"""Landmarks before others, of the same side where both have one."""
_FEET = ("_heel", "_toe", "_toe_lateral", "_toe_medial")


@cache
def usual_standing() -> dict[str, dict[str, Any]]:
    """Return where a standing person has landmarks and segments: the tables of ``anthropometry/standing.toml``."""
    return read_toml(locate("anthropometry", "standing"))


def _part_of(place: str) -> str:
    """Return a landmark without its side."""
    return place.partition("_")[2] if place.startswith(SIDES) else place


def _height_of(place: str) -> tuple[float, float] | None:
    """Return the usual height of a landmark and how far from it it is believed; None where it has none."""
    part, heights = _part_of(place), usual_standing()["heights"]
    return next((pair for key, pair in heights.items() if part == key or part.startswith(f"{key}_")), None)


@dataclass(frozen=True, eq=False)
class Standing:
    """One standing posture: ``at`` label -> (3,) m; ``named`` landmark -> label as far as known; ``right``, ``ahead``
    horizontal unit vectors; ``middle`` (3,) m of the body; ``floor`` m; ``stature`` m.
    """

    at: Mapping[str, Array]
    named: Mapping[str, str]
    right: Array
    ahead: Array
    middle: Array
    floor: float
    stature: float

    def outwards(self, side: str) -> Array:
        """Return the horizontal unit vector (3,) out of one side of the body."""
        return OUTWARDS[side] * self.right

    def _height(self, label: str) -> float:
        """Return how high a marker is over the floor, as a share of the stature."""
        return float((self.at[label][2] - self.floor) / self.stature)

    def misfit(self, place: str, label: str) -> float:
        """Return how far a marker is from the usual height of a landmark: 1 at the limit where it is believed; 0 where
        the height tells nothing.
        """
        usual = _height_of(place)
        return float(abs(self._height(label) - usual[0]) / usual[1]) if usual else 0.0

    def believed(self, place: str, label: str) -> bool:
        """Return whether a marker stands where a person has this landmark or segment."""
        lowest, highest = usual_standing()["between"].get(_part_of(place), (-np.inf, np.inf))
        high = lowest <= self._height(label) <= highest and self.misfit(place, label) <= 1
        return high and self._on_its_side(place, label) and self._in_its_place(place, label)

    def _on_its_side(self, place: str, label: str) -> bool:
        """Return whether a landmark lies on its side of the body, one of the middle in the middle."""
        out = float((self.at[label] - self.middle) @ self.right) / self.stature
        if not place.startswith(SIDES):
            return abs(out) < _OFF_MIDDLE or place.startswith("head") or _height_of(place) is None
        side, _, part = place.partition("_")
        own, widest = OUTWARDS[side] * out, usual_standing()["widest"].get(part, np.inf)
        return bool(own < widest and (own > -_ACROSS or not part.startswith(_ON_THE_SIDE)))

    def _in_its_place(self, place: str, label: str) -> bool:
        """Return whether heel and toes lie behind and before their ankle, and arms within reach of their shoulder."""
        side, part = place.partition("_")[0], _part_of(place)
        ankle, shoulder = (self.named.get(f"{side}_{end}", label) for end in ("ankle_lateral", "acromion"))
        if part.startswith(("heel", "toe")) and ankle != label and self._height(ankle) < _LIFTED:
            ahead = float((self.at[label] - self.at[ankle]) @ self.ahead) / self.stature
            return ahead < 0 if part == "heel" else ahead > _ACROSS
        reach = next((span for key, span in usual_standing()["reach"].items() if part.startswith(key)), None)
        if reach is not None and shoulder != label:
            away = float(np.linalg.norm(self.at[label] - self.at[shoulder])) / self.stature
            return bool(reach[0] <= away <= reach[1])
        return True


def standing_person(at: Mapping[str, Array], named: Mapping[str, str]) -> Standing | str | None:
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
    if np.mean([pair @ right > 0 for pair in pairs.values()]) < 0.99:
        return "Of some pairs of markers the right one lies left of the left one: the sides are exchanged in part."
    both = [part for part in _STRAIGHT[:2] if part in pairs] or list(pairs)
    middle = np.mean([known[f"{side}_{part}"] for part in both for side in SIDES], axis=0)
    floor, stature = _size(at, named)
    if not 0.6 < stature < 2.6:
        return f"Nobody stands upright here: the labels would make a person of {stature:.2f} m."
    return Standing(at, named, right, forward, middle, floor, stature)


def _size(at: Mapping[str, Array], named: Mapping[str, str]) -> tuple[float, float]:
    """Return the height of the floor and the stature, m, the median of what all landmarks say; 0 without one."""
    heights = {place: float(at[label][2]) for place, label in named.items()}
    feet = [z for place, z in heights.items() if place.endswith(_FEET)]
    floor = min(feet or (float(at[label][2]) for label in plain_labels(at))) - 0.02
    usual = [(z, pair[0]) for place, z in heights.items() if (pair := _height_of(place)) and pair[0] > 0.2]
    shares = [(z - floor) / share for z, share in usual]
    return floor, float(np.median(shares)) if shares else 0.0
