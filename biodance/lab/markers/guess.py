"""A marker set that nobody described, guessed from what its labels say and from where the markers are on a standing
person: one landmark a marker, right on the right, knees under hips, lateral outside medial.

A wrong map is worse than none: a landmark whose marker stands where no person has it is left out, and a guess that
lacks a landmark the body needs, or of which too much is contradicted, is none.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from biodance.lab.markers.absent import absent_landmarks, fill_absent
from biodance.lab.markers.names import Meaning, joints_from_video, meanings_of, sides_exchanged
from biodance.lab.markers.person import mirror_images, person_of
from biodance.lab.markers.set_file import LANDMARKS, MIDLINE, segment_of
from biodance.lab.markers.sets import GUESSED
from biodance.lab.markers.spelling import plain_labels, side_words
from biodance.lab.markers.standing import Standing, standing_person
from biodance.lab.markers.still import median_places, posture_frames
from biodance.records import SIDES, Array, Markers

_BELIEVED = 0.85
"""Share of the named landmarks that the standing person must confirm, or the names mean something else here."""
_USUAL = 30
"""Rank of a spelling below which it is a common one, whose word counts."""
_WEIGHT = 20.0
"""Ranks of spelling by which a marker at the limit of where it is believed counts less than one at the usual place."""
_AS_USUAL = 0.5
"""Share of the way to that limit within which all places are equally usual."""
_HALFWAY = 0.3
"""Share of the width of a joint within which of its half a marker is the middle of it."""
_JOINT_WIDTH = (0.03, 0.09)
"""Shares of the stature between which a knee or ankle is wide, over the skin."""
_LEVEL = 0.5
"""Share of that width by which its two markers may differ in height and fore and aft."""
_APART = 0.005
"""m: by so much a lateral marker must lie farther out than the medial one, or the two are exchanged."""
_FROM_VIDEO = (
    "These labels are joints, as software estimates them from video, not markers on the skin: {named}. A body is "
    "placed by markers on both iliac spines, at the side of knees and ankles, on heels and toes. Give positions of "
    "markers, for example the augmented markers (.trc) of the same software."
)


@dataclass(frozen=True, eq=False)
class GuessedSet:
    """What was guessed: ``map`` label -> landmark or segment, "" ``name`` where it is not believed; ``doubts`` why
    markers were left out, or why nothing is guessed, in sentences.
    """

    map: Mapping[str, str]
    doubts: tuple[str, ...]
    name: str = ""


def guess_set(markers: Markers) -> GuessedSet:
    """Return the guessed map of a recording's labels, from their names and the posture of its quietest half second.

    Geometry needs z up; for a recording without anybody upright nothing is believed.
    """
    at = median_places(markers, posture_frames(markers)[0])
    found = _guessed(at)
    joints = () if found.name else joints_from_video(at)
    return replace(found, doubts=(_FROM_VIDEO.format(named=", ".join(joints)), *found.doubts)) if joints else found


def _guessed(at: Mapping[str, Array]) -> GuessedSet:
    """Return the guess by names, else by the words that mirror images teach."""
    named = _by_names(at)
    if named.name:
        return named
    plain = plain_labels(at)
    person = person_of({label: at[label] for label in plain})
    if person is None:
        return named
    words = side_words((plain[right], plain[left]) for right, left in mirror_images(person))
    if sides_exchanged(words):
        return named
    stood = _on(replace(person, at=at), meanings_of(at, sides=words))
    return stood if stood.name or len(stood.map) > len(named.map) else named


def _by_names(at: Mapping[str, Array]) -> GuessedSet:
    """Return the guess in which the names say who stands where."""
    said = meanings_of(at)
    named = _assigned(said, lambda place, label: 0.0)
    stand = standing_person(at, named)
    if stand is not None and not isinstance(stand, str):
        named = _assigned(said, stand.misfit)
        stand = standing_person(at, named)
    if stand is None:
        return GuessedSet({}, ("Too few labels say which landmark they mark, so no marker set can be guessed.",))
    return GuessedSet({}, (stand,)) if isinstance(stand, str) else _on(stand, said)


def _on(stand: Standing, said: Mapping[str, tuple[Meaning, ...]]) -> GuessedSet:
    """Return the guess for a standing person: what the labels say and the person confirms, then what posture tells."""
    named = _assigned(said, stand.misfit)
    said, crossed = _as_they_lie(said, named, stand)
    named = _assigned(said, stand.misfit) if crossed else named
    stand = replace(stand, named=named)
    confirmed = {
        label: tuple(one for one in found if stand.believed(one.place, label)) for label, found in said.items()
    }
    places = _assigned(confirmed, stand.misfit)
    doubts = [
        *crossed,
        *(
            f"{label} was not taken for the {one.replace('_', ' ')}: no standing person has it there."
            for one, label in named.items()
            if one in LANDMARKS and not confirmed[label]
        ),
    ]
    _take_ends(places, stand, confirmed)
    _take_outer(places, stand, doubts)
    _sort_pairs(places, stand, doubts)
    usual = [label for place, label in named.items() if said[label][0].rank < _USUAL]
    believed, total = sum(bool(confirmed[label]) for label in usual), len(usual)
    doubts += fill_absent(places, stand, confirmed) + _medial_alone(places)
    absent = absent_landmarks(places)
    map_ = _map(places, confirmed)
    reasons = [f"No marker could be taken for: {', '.join(absent)}."] if absent else []
    if believed < _BELIEVED * total:
        reasons.append(
            f"Only {believed} of {total} landmarks that the labels name stand where a person has them; elsewhere: "
            f"{', '.join(label for label in usual if not confirmed[label])}."
        )
    if reasons:
        return GuessedSet(map_, (" ".join(reasons), *doubts))
    return GuessedSet(map_, tuple(doubts), GUESSED + json.dumps(map_, separators=(",", ":")))


def _as_they_lie(
    said: Mapping[str, tuple[Meaning, ...]], named: Mapping[str, str], stand: Standing
) -> tuple[Mapping[str, tuple[Meaning, ...]], list[str]]:
    """Return what the labels say, with two labels of one landmark exchanged where each stands where a person has the
    other side's, and a sentence for each such pair: what lies on the right is right, whatever it is called.
    """
    meant, doubts = dict(said), []
    for right, a in named.items():
        left = right.replace("right_", "left_", 1)
        b = named.get(left) if right.startswith("right_") else None
        if b is None or stand.believed(right, a) or stand.believed(left, b):
            continue
        if stand.believed(right, b) and stand.believed(left, a):
            meant[a], meant[b] = said[b], said[a]
            words = right.removeprefix("right_").replace("_", " ")
            doubts.append(f"{a} and {b} lie on each other's sides: taken for the {words} of the side where they are.")
    return meant, doubts


def _assigned(said: Mapping[str, tuple[Meaning, ...]], misfit: Callable[[str, str], float]) -> dict[str, str]:
    """Return landmark -> label: of several labels for one landmark the one that is called and placed most usually, the
    others take what else they may mean.
    """
    wishes = [
        (one.rank + _WEIGHT * max(misfit(one.place, label) - _AS_USUAL, 0.0), label, one.place)
        for label, ways in said.items()
        for one in ways
        if one.place in LANDMARKS
    ]
    places: dict[str, str] = {}
    for _, label, place in sorted(wishes, key=lambda wish: wish[:2]):
        if place not in places and label not in places.values():
            places[place] = label
    return places


def _ends(joint: str) -> dict[str, tuple[str, str]]:
    """Return side -> lateral and medial landmark of a joint."""
    return {side: (f"{side}_{joint}_lateral", f"{side}_{joint}_medial") for side in SIDES}


def _take_ends(places: dict[str, str], stand: Standing, confirmed: Mapping[str, tuple[Meaning, ...]]) -> None:
    """Of several labels for one end of a joint take the marker at that end: Knee half way between KneeLat and KneeMed
    is its middle, not its lateral marker; two that are called medial are the outer and the inner one.
    """
    for joint in ("knee", "ankle", "elbow"):
        for side, (lateral, medial) in _ends(joint).items():
            outer, inner = (
                [label for label, said in confirmed.items() if said and said[0].place == place]
                for place in (lateral, medial)
            )
            if lateral in places and medial in places:
                now, inside = stand.at[places[lateral]], stand.at[places[medial]]
                for label in outer:
                    across = stand.at[label] - inside
                    if np.linalg.norm(now - inside - across / 2) < _HALFWAY * np.linalg.norm(across):
                        places[lateral] = label
            elif lateral not in places and len(inner) > 1 and places.get(medial) in inner:
                outward = [float(stand.at[label] @ stand.outwards(side)) for label in inner]
                places[medial], places[lateral] = inner[int(np.argmin(outward))], inner[int(np.argmax(outward))]


def _take_outer(places: dict[str, str], stand: Standing, doubts: list[str]) -> None:
    """Take the only marker of a knee or ankle for its medial one where on both sides one that says nothing lies across
    the joint from it, outside: a body has nothing there but its lateral marker.
    """
    for joint in ("knee", "ankle"):
        alone = {side: [places[end] for end in both if end in places] for side, both in _ends(joint).items()}
        outer = {side: _across(one[0], side, places, stand) if len(one) == 1 else [] for side, one in alone.items()}
        if any(len(found) != 1 for found in outer.values()):
            continue
        for side, (lateral, medial) in _ends(joint).items():
            (places[lateral],), (places[medial],) = outer[side], alone[side]
            doubts.append(
                f"{places[lateral]} lies across the {side} {joint} from {places[medial]}, outside: it was taken for "
                f"the lateral marker, {places[medial]} for the medial one."
            )


def _across(label: str, side: str, places: Mapping[str, str], stand: Standing) -> list[str]:
    """Return the labels without a landmark that lie a joint's width outside a marker, as high as it."""
    out, (narrowest, widest) = stand.outwards(side), _JOINT_WIDTH
    found = []
    for other in (other for other in stand.at if other not in places.values()):
        way = stand.at[other] - stand.at[label]
        wide = way @ out
        level = np.linalg.norm(way - wide * out) < _LEVEL * wide
        if level and narrowest * stand.stature < wide < widest * stand.stature:
            found.append(other)
    return found


def _medial_alone(places: dict[str, str]) -> list[str]:
    """Take the only marker of a joint for the lateral one where both sides call it medial: nobody puts that alone."""
    said = []
    for joint in ("knee", "ankle"):
        ends = _ends(joint).values()
        if all(medial in places and lateral not in places for lateral, medial in ends):
            for lateral, medial in ends:
                places[lateral] = places.pop(medial)
                words = lateral.replace("_", " ")
                said.append(f"{places[lateral]} is the only marker there: taken for the {words}, against its name.")
    return said


def _sort_pairs(places: dict[str, str], stand: Standing, doubts: list[str]) -> None:
    """Exchange the markers of a medial and lateral pair that lie the other way round, against their names."""
    for side in SIDES:
        for joint in ("knee", "ankle", "toe"):
            lateral, medial = _ends(joint)[side]
            if lateral in places and medial in places:
                apart = (stand.at[places[lateral]] - stand.at[places[medial]]) @ stand.outwards(side)
                if apart < -_APART:
                    places[lateral], places[medial] = places[medial], places[lateral]
                    doubts.append(
                        f"{places[lateral]} lies outside {places[medial]}, so it was taken for the lateral marker of "
                        f"the {side} {joint}, against its name."
                    )


def _map(places: Mapping[str, str], said: Mapping[str, tuple[Meaning, ...]]) -> dict[str, str]:
    """Return label -> landmark, and for labels without one the segment that they name or whose landmark another has."""
    found = {label: place for place, label in places.items()}
    for label, several in said.items():
        if label in found:
            continue
        whole = next((one.place for one in several if one.place in MIDLINE and one.place.startswith("head")), None)
        segment = next((one.place for one in several if one.place not in LANDMARKS), None)
        on = {segment_of(one.place) for one in several if one.place in LANDMARKS}
        if len(on) == 1 and (segment is None or several[0].place.endswith("_wand")):
            segment = on.pop()
        if whole or segment:
            found[label] = whole or segment or ""
    return found
