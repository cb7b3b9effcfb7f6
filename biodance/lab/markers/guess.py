"""A marker set that nobody described, guessed from what its labels say and from where the markers are on a standing
person: one landmark a marker, right on the right, knees under hips, lateral outside medial.

A wrong map is worse than none: a landmark whose marker stands where no person has it is left out, and a guess that
lacks a landmark the body needs, or of which too much is contradicted, is none.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from biodance.lab.markers.names import Meaning, meanings_of
from biodance.lab.markers.set_file import LANDMARKS, MIDLINE, segment_of
from biodance.lab.markers.sets import GUESSED
from biodance.lab.markers.still import posture_frames
from biodance.records import SIDES, Array, Markers

_HEIGHT = {
    "asis": (0.56, 0.06),
    "psis": (0.57, 0.06),
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
_BELIEVED = 0.85
"""Share of the named landmarks that the standing person must confirm, or the names mean something else here."""
_APART = 0.005
"""m: by so much a lateral marker must lie farther out than the medial one, or the two are exchanged."""


@dataclass(frozen=True, eq=False)
class GuessedSet:
    """What was guessed: ``map`` label -> landmark or segment, "" ``name`` where it is not believed; ``doubts`` why
    markers were left out, or why nothing is guessed, in sentences.
    """

    map: Mapping[str, str]
    doubts: tuple[str, ...]
    name: str = ""


@dataclass(frozen=True, eq=False)
class _Stand:
    """One standing posture: ``at`` label -> (3,) m; ``right``, ``ahead`` horizontal unit vectors; ``stature`` m."""

    at: Mapping[str, Array]
    right: Array
    ahead: Array
    floor: float
    stature: float

    def believed(self, place: str, label: str) -> bool:
        """Return whether a marker stands where a person has this landmark."""
        part = place.partition("_")[2] if place.startswith(SIDES) else place
        kind = next((key for key in _HEIGHT if part == key or part.startswith(f"{key}_")), None)
        if kind is None:
            return True
        share, spare = _HEIGHT[kind]
        return bool(abs((self.at[label][2] - self.floor) / self.stature - share) <= spare)


def guess_set(markers: Markers) -> GuessedSet:
    """Return the guessed map of a recording's labels, from their names and the posture of its quietest half second.

    Geometry needs z up; for a recording without anybody upright nothing is believed.
    """
    at = _posture(markers)
    said = meanings_of(at)
    named = _assigned(said, {label: one[0].rank for label, one in said.items()})
    stand = _stand(at, named)
    if stand is None:
        return GuessedSet({}, ("Too few labels say which landmark they mark, so no marker set can be guessed.",))
    if isinstance(stand, str):
        return GuessedSet({}, (stand,))
    confirmed = {
        label: tuple(one for one in found if stand.believed(one.place, label)) for label, found in said.items()
    }
    places = _assigned(confirmed, {label: _cost(one, label, stand) for label, one in confirmed.items() if one})
    doubts = [
        f"{label} was not taken for the {one.replace('_', ' ')}: no standing person has it there."
        for one, label in named.items()
        if one in LANDMARKS and not confirmed[label]
    ]
    _sort_pairs(places, stand, doubts)
    believed = sum(bool(confirmed[label]) for place, label in named.items() if place in LANDMARKS)
    total = sum(place in LANDMARKS for place in named)
    absent = _absent(places)
    map_ = _map(places, confirmed)
    if believed < _BELIEVED * total:
        doubts.insert(0, f"Only {believed} of {total} landmarks that the labels name stand where a person has them.")
    elif absent:
        doubts.insert(0, f"No marker could be taken for: {', '.join(absent)}.")
    else:
        return GuessedSet(map_, tuple(doubts), guessed_name(map_))
    return GuessedSet(map_, tuple(doubts))


def guessed_name(map_: Mapping[str, str]) -> str:
    """Return the name under which `read_marker_set` finds a guessed map: the map itself."""
    return GUESSED + json.dumps(dict(map_), separators=(",", ":"))


def _posture(markers: Markers) -> dict[str, Array]:
    """Return label -> (3,) m in the posture that geometry is judged by."""
    chosen, _ = posture_frames(markers)
    near = markers.xyz[chosen]
    seen = np.asarray(np.isfinite(near).all(axis=2))
    return {name: np.median(near[seen[:, k], k], axis=0) for k, name in enumerate(markers.names) if seen[:, k].any()}


def _assigned(said: Mapping[str, tuple[Meaning, ...]], cost: Mapping[str, float]) -> dict[str, str]:
    """Return landmark -> label: of several labels for one landmark the cheapest, the others take what else they may
    mean.
    """
    wishes = sorted(
        ((one.rank + 0.001 * cost.get(label, 0.0), one.place, label) for label, found in said.items() for one in found),
        key=lambda wish: (wish[0], wish[2]),
    )
    places: dict[str, str] = {}
    used: set[str] = set()
    for _, place, label in wishes:
        free = place in LANDMARKS and place not in places
        if free and label not in used:
            places[place] = label
            used.add(label)
    return places


def _cost(found: tuple[Meaning, ...], label: str, stand: _Stand) -> float:
    """Return how far a marker is from the usual height of what it most probably marks, shares of the stature."""
    part = found[0].place.partition("_")[2] if found[0].place.startswith(SIDES) else found[0].place
    kind = next((key for key in _HEIGHT if part == key or part.startswith(f"{key}_")), None)
    return abs((stand.at[label][2] - stand.floor) / stand.stature - _HEIGHT[kind][0]) if kind else 0.0


def _stand(at: Mapping[str, Array], named: Mapping[str, str]) -> _Stand | str | None:
    """Return the frame of the standing person, a sentence if nobody stands so, None if the names are too few."""
    pairs = [
        at[named[f"right_{part}"]] - at[named[f"left_{part}"]]
        for part in ("asis", "psis", "knee_lateral", "ankle_lateral", "heel", "toe", "toe_lateral", "acromion")
        if f"right_{part}" in named and f"left_{part}" in named
    ]
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
    flat = np.array([1.0, 1.0, 0.0])
    right = np.sum(pairs, axis=0) * flat
    right = right / max(float(np.linalg.norm(right)), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    agree = float(np.mean([step @ forward > 0 for step in ahead]))
    if agree < 0.5:
        return (
            "The labels say right where the person has the left: toes and iliac spines would point backwards. Are the "
            "sides exchanged, or is z not up?"
        )
    sides = float(np.mean([pair @ right > 0 for pair in pairs]))
    if sides < 0.99:
        return "Of some pairs of markers the right one lies left of the left one: the sides are exchanged in part."
    feet = [at[named[place]][2] for place in named if place.endswith(("_heel", "_toe", "_toe_lateral"))]
    floor = min(feet) - 0.02
    shares = [
        (at[named[place]][2] - floor) / share
        for place, share in ((f"{side}_{part}", _HEIGHT[key][0]) for side in SIDES for part, key in _LEGS)
        if place in named
    ]
    stature = float(np.median(shares)) if shares else 0.0
    if not 0.6 < stature < 2.6:
        return f"Nobody stands upright here: the labels would make a person of {stature:.2f} m."
    return _Stand(at, right, forward, floor, stature)


_LEGS = (("asis", "asis"), ("psis", "psis"), ("knee_lateral", "knee"))


def _sort_pairs(places: dict[str, str], stand: _Stand, doubts: list[str]) -> None:
    """Drop both markers of a medial and lateral pair that lie the other way round: the names mean something else."""
    for side in SIDES:
        out = stand.right if side == "right" else -stand.right
        for joint in ("knee", "ankle", "toe"):
            lateral, medial = f"{side}_{joint}_lateral", f"{side}_{joint}_medial"
            if lateral in places and medial in places:
                apart = (stand.at[places[lateral]] - stand.at[places[medial]]) @ out
                if apart < -_APART:
                    places[lateral], places[medial] = places[medial], places[lateral]
                    doubts.append(
                        f"{places[lateral]} lies outside {places[medial]}, so it was taken for the lateral marker of "
                        f"the {side} {joint}, against its name."
                    )


def _absent(places: Iterable[str]) -> list[str]:
    """Return the landmarks that a body needs and the guess lacks."""
    have = set(places)
    needs = [
        (f"{side} {part.replace('_', ' ')}", {f"{side}_{part}", *(f"{side}_{other}" for other in others)})
        for side in SIDES
        for part, others in (
            ("asis", ()),
            ("knee_lateral", ()),
            ("ankle_lateral", ()),
            ("heel", ()),
            ("toe", ("toe_lateral", "toe_medial")),
        )
    ]
    absent = [name for name, any_of in needs if not any_of & have]
    if "mid_psis" not in have and not {"left_psis", "right_psis"} <= have:
        absent.append("the posterior iliac spines or the sacrum")
    return absent


def _map(places: Mapping[str, str], said: Mapping[str, tuple[Meaning, ...]]) -> dict[str, str]:
    """Return label -> landmark, and for labels without one the segment that they name."""
    found = {label: place for place, label in places.items()}
    for label, several in said.items():
        if label in found:
            continue
        whole = next((one.place for one in several if one.place in MIDLINE and one.place.startswith("head")), None)
        segment = next((one.place for one in several if one.place not in LANDMARKS), None)
        if several and several[0].place.endswith("_wand"):
            segment = segment_of(several[0].place)
        if whole or segment:
            found[label] = whole or segment or ""
    return found
