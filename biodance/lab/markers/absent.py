"""The landmarks that a body needs, and where no label names one, the marker that must be it: at the mirror image of the
other side's, or the hindmost and foremost of the foot. What is found so is said.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from biodance.lab.markers.names import Meaning, sides_of
from biodance.lab.markers.posture import joint_by_posture, middle_by_posture, taken_by_posture, toes_by_posture
from biodance.lab.markers.set_file import LANDMARKS
from biodance.lab.markers.spelling import plain_labels
from biodance.lab.markers.standing import Standing
from biodance.records import SIDES

_NEEDS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("asis", "knee_lateral", "ankle_lateral", "heel"), ()),
    "toe": ("toe_lateral", "toe_medial"),
}
"""Landmarks that a body needs on each side, and what stands in for them."""
_USEFUL = ("knee_medial", "ankle_medial", "acromion")
"""Landmarks that a body can do without, and that posture tells as well."""
_TRUE = 0.85
"""Share of the labels with a side whose markers must lie on it."""
_MIRRORED = 0.035
"""m: a marker so near to the mirror image of the other side's is the same landmark, if no other is nearly as near."""
_ALONE = 1.6
"""The next free marker is so many times farther from the mirror image, or beyond `_MIRRORED`."""
_LENGTH = 0.13
"""Share of the stature within which the markers of a foot are from its ankle."""
_BEHIND, _BEFORE = -0.012, 0.045
"""Shares of the stature by which a marker of the foot lies before its ankle: the heel less, the toe more."""


def absent_landmarks(places: Iterable[str]) -> list[str]:
    """Return the landmarks, in words, that a body needs and that are not among ``places``."""
    have = set(places)
    absent = [_words(place) for place in _needed(have)]
    if "mid_psis" not in have and not {"left_psis", "right_psis"} <= have:
        absent.append("the posterior iliac spines or the sacrum")
    return absent


def fill_absent(places: dict[str, str], stand: Standing, said: Mapping[str, tuple[Meaning, ...]]) -> list[str]:
    """Take markers without a landmark for those that a body needs and that no label names; return what was taken, in
    sentences. ``places`` landmark -> label is added to.
    """
    filling = _Filling(places, stand, said, _said_sides(stand))
    return [*filling.by_mirror_image(), *filling.by_posture(), *filling.by_ends_of_feet()]


def _needed(have: Collection[str]) -> list[str]:
    """Return the needed landmarks of both sides, but the posterior iliac spines, that are not there."""
    return [
        f"{side}_{part}"
        for side in SIDES
        for part, others in _NEEDS.items()
        if not any(f"{side}_{one}" in have for one in (part, *others))
    ]


@dataclass(frozen=True, eq=False)
class _Filling:
    """A map that is being completed: ``places`` landmark -> label, added to; the standing person; what every label may
    mean, and which side it says.
    """

    places: dict[str, str]
    stand: Standing
    said: Mapping[str, tuple[Meaning, ...]]
    sides: Mapping[str, str]

    def by_mirror_image(self) -> list[str]:
        """Take the markers at the mirror images of those that are known on the other side."""
        taken = []
        for place in self._lacking():
            side, _, part = place.partition("_")
            other = self.places.get(f"{'left' if side == 'right' else 'right'}_{part}")
            found = _at_mirror_image(place, other, self._free(place), self.stand) if other else None
            if found is not None:
                self.places[place] = found
                taken.append(f"{found} lies where the mirror image of {other} is: taken for the {_words(place)}.")
        return taken

    def by_posture(self) -> list[str]:
        """Take pairs of markers for what nobody named, where no other markers of a standing person can be it: of those
        whose labels say nothing, then of those that say no more than a segment.
        """
        before = dict(self.places)
        for mute in (True, False):
            self._take_by_posture(mute)
        return [
            f"{label} stands where people have the {_words(place)}, and no other marker does: taken for it."
            for place, label in self.places.items()
            if place not in before
        ]

    def _take_by_posture(self, mute: bool) -> None:
        def free(part: str) -> dict[str, list[str]]:
            return {side: self._free(f"{side}_{part}", mute=mute) for side in SIDES}

        places, stand = self.places, self.stand
        for joint in ("knee", "ankle"):
            if not self._have(f"{joint}_lateral", f"{joint}_medial"):
                places.update(joint_by_posture(joint, free(f"{joint}_lateral"), places, stand))
        for part in (*(part for part in _NEEDS if part != "toe"), "psis", *(_USEFUL if mute else ())):
            outer = part.replace("_medial", "_lateral")
            if (part != "psis" or "mid_psis" not in places) and (outer == part or self._have(outer)):
                places.update(taken_by_posture(part, free(part), places, stand))
        if not self._have("psis") and "mid_psis" not in places:
            middle = middle_by_posture("mid_psis", self._free("mid_psis", mute=mute), places, stand)
            places.update({"mid_psis": middle} if middle else {})
        if not self._have("toe", *_NEEDS["toe"]):
            places.update(toes_by_posture(free("toe"), places, stand))

    def by_ends_of_feet(self) -> list[str]:
        """Take the hindmost and the foremost marker of a foot for its heel and its toe."""
        taken = []
        for place in self._lacking():
            side = place.partition("_")[0]
            own = [label for label in self._free(place) if self.sides.get(label) == side]
            found = _end_of_foot(place, self.places.get(f"{side}_ankle_lateral"), own, self.stand)
            if found is not None:
                self.places[place] = found
                which = "hind" if place.endswith("heel") else "fore"
                taken.append(f"{found} is the {which}most of its foot: taken for the {_words(place)}.")
        return taken

    def _lacking(self) -> list[str]:
        """Return the needed landmarks of both sides that nothing is taken for."""
        spines = {f"{side}_psis" for side in SIDES} if "mid_psis" not in self.places else set()
        return sorted({*_needed(self.places), *spines - self.places.keys()})

    def _have(self, *parts: str) -> bool:
        return any(f"{side}_{part}" in self.places for side in SIDES for part in parts)

    def _free(self, place: str, *, mute: bool = False) -> list[str]:
        """Return the labels without a landmark that say nothing (``mute``), or nothing but this place."""
        side, taken = place.partition("_")[0], set(self.places.values())
        own = [label for label in plain_labels(self.stand.at) if label not in taken]
        own = [label for label in own if side not in SIDES or self.sides.get(label, side) == side]
        return [
            label for label in own if (not self.said.get(label) if mute else _may_be(place, self.said.get(label, ())))
        ]


def _said_sides(stand: Standing) -> dict[str, str]:
    """Return label -> the side that it says; nothing where the words mean something else, for too many of these markers
    lie on the other side.
    """
    sides = sides_of(stand.at)
    right = [bool((stand.at[label] - stand.middle) @ stand.right > 0) == (sides[label] == SIDES[0]) for label in sides]
    return sides if right and np.mean(right) > _TRUE else {}


def _words(place: str) -> str:
    return place.replace("_", " ")


def _may_be(place: str, ways: tuple[Meaning, ...]) -> bool:
    """Return whether a label says nothing, or nothing else than this side: no landmark, not the other side."""
    side = place.partition("_")[0]
    return all(
        one.place == place or (one.place not in LANDMARKS and (one.place.startswith(side) or place.endswith("sis")))
        for one in ways
    )


def _at_mirror_image(place: str, other: str, free: Iterable[str], stand: Standing) -> str | None:
    """Return the only free marker at the mirror image of the other side's; None if there is none or several."""
    out = (stand.at[other] - stand.middle) @ stand.right
    image = stand.at[other] - 2 * out * stand.right
    near = sorted((float(np.linalg.norm(stand.at[label] - image)), label) for label in free)
    if not near or near[0][0] > _MIRRORED or not stand.believed(place, near[0][1]):
        return None
    return near[0][1] if len(near) == 1 or near[1][0] > max(_ALONE * near[0][0], _MIRRORED) else None


def _end_of_foot(place: str, ankle: str | None, own: Iterable[str], stand: Standing) -> str | None:
    """Return the hindmost (heel) or foremost (toe) marker near the ground and this ankle, of those whose labels say its
    side; None if none lies far enough from the ankle.
    """
    if ankle is None or not place.endswith(("heel", "toe")):
        return None
    ahead = {}
    for label in own:
        step = (stand.at[label] - stand.at[ankle]) / stand.stature
        if np.linalg.norm(step) < _LENGTH and step[2] < 0 and stand.believed(place, label):
            ahead[label] = float(step @ stand.ahead)
    if place.endswith("heel"):
        found = min(ahead, key=ahead.__getitem__, default=None)
        return found if found is not None and ahead[found] < _BEHIND else None
    found = max(ahead, key=ahead.__getitem__, default=None)
    return found if found is not None and ahead[found] > _BEFORE else None
