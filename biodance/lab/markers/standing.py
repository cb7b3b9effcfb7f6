"""Where a standing person has the landmarks: how high, on which side, toes before heels, arms within reach."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.lab.markers.spelling import plain_labels
from biodance.records import SIDES, Array

_HEIGHT = {
    "asis": (0.56, 0.06),
    "psis": (0.57, 0.07),
    "mid_psis": (0.57, 0.07),
    "knee": (0.275, 0.055),
    "ankle": (0.05, 0.035),
    "heel": (0.03, 0.04),
    "toe": (0.03, 0.04),
    "acromion": (0.82, 0.07),
    "c7": (0.84, 0.06),
    "t10": (0.71, 0.08),
    "jugular_notch": (0.81, 0.05),
    "xiphoid": (0.71, 0.05),
    "head": (0.94, 0.06),
}
"""Share of the stature at which a standing person has a landmark, and how far from it it is still believed; arms may be
anywhere (Winter 2009; static trials of nine persons).
"""
_SOMEWHERE = {
    "pelvis": (0.45, 0.72),
    "thigh": (0.24, 0.62),
    "shank": (0.02, 0.36),
    "foot": (-0.02, 0.11),
    "trunk_head": (0.5, 1.1),
    "elbow_lateral": (0.45, 1.2),
    "elbow_medial": (0.45, 1.2),
    "wrist_radial": (0.32, 1.4),
    "wrist_ulnar": (0.32, 1.4),
    "hand": (0.25, 1.4),
}
"""Shares of the stature between which markers of a segment are, and landmarks of the arms."""
_ON_THE_SIDE = ("asis", "knee", "ankle", "heel", "toe", "acromion")
_ACROSS = 0.02
"""Share of the stature by which a landmark may lie beyond the middle of the body, or one of the middle beside it."""
_OFF_MIDDLE = 0.06
_WIDEST = {"asis": 0.12, "psis": 0.09, "acromion": 0.19}
"""Share of the stature beyond which a landmark of the trunk does not lie from the middle."""
_LIFTED = 0.085
"""Share of the stature above which an ankle belongs to a foot that is not flat on the ground."""
_REACH = {"elbow": (0.09, 0.26), "wrist": (0.15, 0.44), "hand": (0.18, 0.52)}
"""Shares of the stature between a landmark of the arm and its own acromion."""
_PAIRS = ("asis", "psis", "knee_lateral", "ankle_lateral", "heel", "toe", "toe_lateral", "acromion")
_STRAIGHT = ("asis", "psis", "acromion")
"""Pairs that point right even where one leg is before the other."""
_FEET = ("_heel", "_toe", "_toe_lateral", "_toe_medial")


def part_of(place: str) -> str:
    """Return a landmark without its side."""
    return place.partition("_")[2] if place.startswith(SIDES) else place


def _kind(place: str) -> str | None:
    part = part_of(place)
    return next((key for key in _HEIGHT if part == key or part.startswith(f"{key}_")), None)


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

    def _stands_on(self, ankle: str) -> bool:
        return bool(self.at[ankle][2] - self.floor < _LIFTED * self.stature)

    def misfit(self, place: str, label: str) -> float:
        """Return how far a marker is from the usual height of a landmark: 1 at the limit where it is believed; 0 where
        the height tells nothing.
        """
        kind = _kind(place)
        if kind is None:
            return 0.0
        share, spare = _HEIGHT[kind]
        return float(abs((self.at[label][2] - self.floor) / self.stature - share) / spare)

    def believed(self, place: str, label: str) -> bool:
        """Return whether a marker stands where a person has this landmark or segment."""
        if part_of(place) in _SOMEWHERE:
            lowest, highest = _SOMEWHERE[part_of(place)]
            if not lowest <= (self.at[label][2] - self.floor) / self.stature <= highest:
                return False
        return self.misfit(place, label) <= 1 and self._on_its_side(place, label) and self._in_its_place(place, label)

    def _on_its_side(self, place: str, label: str) -> bool:
        """Return whether a landmark lies on its side of the body, one of the middle in the middle."""
        out = float((self.at[label] - self.middle) @ self.right) / self.stature
        if place.startswith(SIDES):
            own = out if place.startswith("right") else -out
            widest = _WIDEST.get(part_of(place), np.inf)
            return own < widest and (own > -_ACROSS or not part_of(place).startswith(_ON_THE_SIDE))
        return abs(out) < _OFF_MIDDLE or _kind(place) in (None, "head")

    def _in_its_place(self, place: str, label: str) -> bool:
        """Return whether heel and toes lie behind and before their ankle, and arms within reach of their shoulder."""
        side, part = place.partition("_")[0], part_of(place)
        ankle = self.named.get(f"{side}_ankle_lateral")
        if part.startswith(("heel", "toe")) and ankle not in (None, label) and self._stands_on(str(ankle)):
            ahead = float((self.at[label] - self.at[str(ankle)]) @ self.ahead) / self.stature
            return ahead < 0 if part == "heel" else ahead > _ACROSS
        reach = next((span for key, span in _REACH.items() if part.startswith(key)), None)
        shoulder = self.named.get(f"{side}_acromion")
        if reach is not None and shoulder not in (None, label):
            away = float(np.linalg.norm(self.at[label] - self.at[str(shoulder)])) / self.stature
            return reach[0] <= away <= reach[1]
        return True


def standing_person(at: Mapping[str, Array], named: Mapping[str, str]) -> Standing | str | None:
    """Return the standing person that labelled points show, a sentence if nobody stands so, None if the names are too
    few.

    ``at`` label -> (3,) m, z up; ``named`` landmark -> label.
    """
    pairs = {
        part: at[named[f"right_{part}"]] - at[named[f"left_{part}"]]
        for part in _PAIRS
        if f"right_{part}" in named and f"left_{part}" in named
    }
    ahead = [
        at[named[front]] - at[named[back]]
        for side in SIDES
        for front, back in (
            (f"{side}_toe", f"{side}_heel"),
            (f"{side}_toe_lateral", f"{side}_heel"),
            (f"{side}_asis", f"{side}_psis"),
            (f"{side}_asis", "mid_psis"),
        )
        if front in named and back in named
    ]
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
    middle = np.mean([at[named[f"{side}_{part}"]] for part in both for side in SIDES], axis=0)
    floor, stature = _size(at, named)
    if not 0.6 < stature < 2.6:
        return f"Nobody stands upright here: the labels would make a person of {stature:.2f} m."
    return Standing(at, named, right, forward, middle, floor, stature)


def _size(at: Mapping[str, Array], named: Mapping[str, str]) -> tuple[float, float]:
    """Return the height of the floor and the stature, m: the median of what every landmark above the ankles says; 0
    without one.
    """
    heights = {place: float(at[label][2]) for place, label in named.items()}
    feet = [z for place, z in heights.items() if place.endswith(_FEET)]
    floor = min(feet or (float(at[label][2]) for label in plain_labels(at))) - 0.02
    shares = [
        (z - floor) / _HEIGHT[kind][0]
        for place, z in heights.items()
        if (kind := _kind(place)) is not None and _HEIGHT[kind][0] > 0.2
    ]
    return floor, float(np.median(shares)) if shares else 0.0
