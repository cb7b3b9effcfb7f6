"""The landmarks that a body needs, and where no label names one, the marker that must be it: at the mirror image of the
other side's, or the hindmost and foremost of the foot. What is found so is said.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from biodance.lab.markers.names import Meaning, sides_of
from biodance.lab.markers.set_file import LANDMARKS
from biodance.lab.markers.spelling import plain_labels
from biodance.lab.markers.standing import Standing
from biodance.records import SIDES

_NEEDS = (
    ("asis", ()),
    ("knee_lateral", ()),
    ("ankle_lateral", ()),
    ("heel", ()),
    ("toe", ("toe_lateral", "toe_medial")),
)
"""Landmarks that a body needs on each side, and what stands in for them."""
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
    absent = [
        f"{side} {part.replace('_', ' ')}"
        for side in SIDES
        for part, others in _NEEDS
        if not have & {f"{side}_{one}" for one in (part, *others)}
    ]
    if "mid_psis" not in have and not {"left_psis", "right_psis"} <= have:
        absent.append("the posterior iliac spines or the sacrum")
    return absent


def fill_absent(places: dict[str, str], stand: Standing, said: Mapping[str, tuple[Meaning, ...]]) -> list[str]:
    """Take markers without a landmark for those that a body needs and that no label names; return what was taken, in
    sentences. ``places`` landmark -> label is added to.
    """
    taken, markers, sides = [], plain_labels(stand.at), sides_of(stand.at)
    lacking = {f"{side}_{part}" for side in SIDES for part, others in _NEEDS} - places.keys()
    if "mid_psis" not in places:
        lacking |= {f"{side}_psis" for side in SIDES} - places.keys()
    for place in sorted(lacking):
        side, _, part = place.partition("_")
        if part == "toe" and places.keys() & {f"{side}_toe_lateral", f"{side}_toe_medial"}:
            continue
        other = places.get(f"{'left' if side == 'right' else 'right'}_{part}")
        free = [label for label in markers if label not in places.values() and _may_be(place, said.get(label, ()))]
        found = _at_mirror_image(place, other, free, stand) if other else None
        if found is not None:
            places[place] = found
            taken.append(f"{found} lies where the mirror image of {other} is: taken for the {_words(place)}.")
        elif part in ("heel", "toe"):
            own = [label for label in free if sides.get(label) == side]
            found = _end_of_foot(place, places.get(f"{side}_ankle_lateral"), own, stand)
            if found is not None:
                places[place] = found
                taken.append(
                    f"{found} is the {'hind' if part == 'heel' else 'fore'}most of its foot: taken for the "
                    f"{_words(place)}."
                )
    return taken


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
    if ankle is None:
        return None
    way = {label: (stand.at[label] - stand.at[ankle]) / stand.stature for label in own}
    ahead = {
        label: float(step @ stand.ahead)
        for label, step in way.items()
        if np.linalg.norm(step) < _LENGTH and step[2] < 0 and stand.believed(place, label)
    }
    if place.endswith("heel"):
        found = min(ahead, key=lambda label: ahead[label], default=None)
        return found if found is not None and ahead[found] < _BEHIND else None
    found = max(ahead, key=lambda label: ahead[label], default=None)
    return found if found is not None and ahead[found] > _BEFORE else None
