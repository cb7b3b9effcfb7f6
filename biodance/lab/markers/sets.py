"""Marker sets: which marker sits on which segment and marks which landmark; data files in
``anthropometry/marker_sets``. A set is recognised by its labels, never by a count: markers that a lab leaves out are
simply not there.
"""

import json
import os
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from biodance.discovery import DataFamily
from biodance.errors import BiodanceError, FileRefused, TrialRefused, known_index, refuse_unknown
from biodance.library import read_toml
from biodance.records import SIDES, Array, Markers, Trial, grouped

MARKED_SEGMENTS = (
    "pelvis",
    *(f"{side}_{part}" for side in SIDES for part in ("thigh", "shank", "foot")),
    "trunk_head",
    *(f"{side}_{part}" for side in SIDES for part in ("upper_arm", "forearm_hand")),
)
"""The 12 segments that a marker can sit on."""

_SIDED = {
    **dict.fromkeys(("asis", "psis", "hip_centre"), "pelvis"),
    **dict.fromkeys(("knee_lateral", "knee_medial"), "thigh"),
    **dict.fromkeys(("ankle_lateral", "ankle_medial"), "shank"),
    **{"thigh_wand": "thigh", "shank_wand": "shank", "knee_axis": "thigh"},
    **dict.fromkeys(("heel", "toe", "toe_lateral", "toe_medial"), "foot"),
    **{"acromion": "trunk_head", "elbow_lateral": "upper_arm", "elbow_medial": "upper_arm"},
    **dict.fromkeys(("wrist_radial", "wrist_ulnar", "hand"), "forearm_hand"),
}
_SINGLE = {
    "mid_psis": "pelvis",
    **dict.fromkeys(("c7", "t10", "jugular_notch", "xiphoid", "head_front", "head_back"), "trunk_head"),
}
"""Landmarks that each side has, and single ones, with the segment that a marker on them sits on."""
LANDMARKS = (*(f"{side}_{name}" for side in SIDES for name in _SIDED), *_SINGLE)
"""The anatomical landmarks that joint centres, scaling and contact ask for."""
MIDLINE = ("mid_psis", "head_front", "head_back")
"""Landmarks that may be the mean of several markers in a map."""

_NORMALISERS = "asis_width foot_length thigh_length shank_length upper_arm_length forearm_length trunk_length stature"
"""Body measures in m: joint centre to joint centre for the limbs, heel to toe tip for the foot, mid shoulder to mid
hip for the trunk.
"""
_FILE_KEYS = ("name", "description", "source", "required", "aliases", "markers", "landmarks", "map")


@dataclass(frozen=True)
class _SetMarker:
    """One marker of a set.

    ``weight`` >= 0 multiplies its squared residual; ``offset`` (3,) times the body measure ``normaliser`` (m) is its
    place in the segment frame (x anterior, y up, z right) relative to ``origin``: "segment" (the segment's own origin)
    or "mid_shoulder" (the middle of the two shoulder joint centres). ``offset`` is None where no generic place is
    known: such a marker exists only once a static trial places it. ``corner_of``: the three markers of a knee alignment
    device that stands in for this one in the static trial.
    """

    label: str
    segment: str
    weight: float = 1.0
    offset: tuple[float, float, float] | None = None
    normaliser: str = ""
    origin: str = "segment"
    corner_of: tuple[str, ...] = ()


@dataclass(frozen=True)
class MarkerSet:
    """A marker set: ``markers``; ``aliases`` label in files -> label of the set; ``landmarks`` name -> alternatives,
    each the labels whose mean is the landmark; ``required`` labels without which the set is not recognised; ``name``
    finds it again with ``read_marker_set``.
    """

    name: str
    description: str
    source: str
    markers: tuple[_SetMarker, ...]
    aliases: Mapping[str, str]
    landmarks: Mapping[str, tuple[tuple[str, ...], ...]]
    required: tuple[str, ...]

    @property
    def title(self) -> str:
        """The name for a reader: of a guessed set without its map."""
        return self.name.partition(" {")[0]

    @property
    def labels(self) -> tuple[str, ...]:
        """All labels of the set, in file order."""
        return tuple(marker.label for marker in self.markers)

    def marker(self, label: str) -> _SetMarker:
        """Return one marker by its label; UnknownName lists the legal ones."""
        return self.markers[known_index(f"marker of the set {self.name}", label, self.labels)]

    def match(self, labels: Iterable[str]) -> dict[str, str]:
        """Return ``{label of the set: label in the file}`` for every marker of the set that the file has.

        The exact label wins over an alias, an alias over another letter case; a difference in case only counts where
        the file has one such label.
        """
        known = set(given := tuple(labels))
        folded = grouped((label.casefold(), label) for label in given)
        found = {}
        for label, spellings in self._spellings.items():
            alike = [spelling for spelling in spellings if spelling in known]
            alike = alike or [one[0] for s in spellings if len(one := folded.get(s.casefold(), [])) == 1]
            if alike:
                found[label] = alike[0]
        return found

    @cached_property
    def _spellings(self) -> Mapping[str, tuple[str, ...]]:
        """Every label with itself and its aliases, in file order."""
        spelt = {label: [label] for label in self.labels}
        for alias, target in self.aliases.items():
            if target in spelt:
                spelt[target].append(alias)
        return {label: tuple(some) for label, some in spelt.items()}


def _parse_marker_set(path: Path) -> MarkerSet:
    """Read and check a marker-set file; a ``[map]`` is the short form of ``[markers]`` and ``[landmarks]``."""
    table = read_toml(path)
    _legal(path, "key", tuple(table), _FILE_KEYS)
    for name in ("aliases", "markers", "landmarks", "map"):
        if not isinstance(table.get(name, {}), dict):
            raise BiodanceError(f"{path}: [{name}] must be a table. Write [{name}] and one line per entry below it.")
    short = parse_map(table["map"], str(path)) if table.get("map") else None
    markers = {label: _marker(path, label, fields) for label, fields in table.get("markers", {}).items()}
    markers |= {one.label: one for one in short.markers} if short else {}
    if not markers:
        raise BiodanceError(f"{path}: the set has no marker. Write one line per marker under [markers].")
    required = tuple(_labels(path, "required", table.get("required", []), markers))
    if not required:
        raise BiodanceError(
            f"{path}: 'required' is empty, so every file would be taken for this set. List the labels that must be "
            f"there."
        )
    aliases = table.get("aliases", {})
    _labels(path, "[aliases]", list(aliases.values()), markers)
    twice = [alias for alias in aliases if alias in markers]
    if twice:
        raise BiodanceError(
            f"{path}: {', '.join(twice)} stands under [aliases] and under [markers]. Keep one of the two."
        )
    landmarks = table.get("landmarks", {})
    _legal(path, "landmark", tuple(landmarks), LANDMARKS)
    chosen = dict(short.landmarks) if short else {}
    chosen |= {name: _alternatives(path, name, value, markers) for name, value in landmarks.items()}
    description, source = (str(table.get(key, "")) for key in ("description", "source"))
    return MarkerSet("", description, source, tuple(markers.values()), dict(aliases), chosen, required)


def parse_map(given: Mapping[str, Any], path: str) -> MarkerSet:
    """Return the marker set, without a name, of a map of labels to places; ``path`` names where it stands.

    Raises
    ------
    BiodanceError
        A place is no landmark and no segment, or one landmark is given to two labels.
    """
    markers: dict[str, _SetMarker] = {}
    landmarks: dict[str, tuple[tuple[str, ...], ...]] = {}
    for label, place in given.items():
        if place not in (*LANDMARKS, *MARKED_SEGMENTS):
            legal = f"landmarks {', '.join(LANDMARKS)}; segments {', '.join(MARKED_SEGMENTS)}"
            raise BiodanceError(
                f"{path}: [markers] map says {label} = {place!r}, which is no landmark and no segment. Legal are "
                f"{legal}."
            )
        if place in landmarks and place not in MIDLINE:
            raise BiodanceError(
                f"{path}: [markers] map gives {place} to {landmarks[place][0][0]} and to {label}. Keep one of the two."
            )
        markers[label] = _SetMarker(label, place if place in MARKED_SEGMENTS else segment_of(place))
        if place in LANDMARKS:
            landmarks[place] = ((*landmarks.get(place, ((),))[0], label),)
    if "mid_psis" not in landmarks and {"left_psis", "right_psis"} <= landmarks.keys():
        landmarks["mid_psis"] = ((*landmarks["left_psis"][0], *landmarks["right_psis"][0]),)
    pelvis = tuple(names[0][0] for place, names in landmarks.items() if segment_of(place) == "pelvis")
    required = pelvis or tuple(markers)[:1]
    return MarkerSet("", "labels of the session's own", path, tuple(markers.values()), {}, landmarks, required)


def segment_of(landmark: str) -> str:
    """Return the segment that a marker on a landmark sits on."""
    side, segment = landmark.partition("_")[0], (_SIDED | _SINGLE)[part_of(landmark)]
    return f"{side}_{segment}" if f"{side}_{segment}" in MARKED_SEGMENTS else segment


def part_of(landmark: str) -> str:
    """Return a landmark, segment or joint without its side: ``left_thigh`` -> ``thigh``."""
    return landmark.partition("_")[2] if landmark.startswith(SIDES) else landmark


def other_side(name: str) -> str:
    """Return the same landmark or segment of the other side."""
    side, _, part = name.partition("_")
    return f"{'left' if side == 'right' else 'right'}_{part}"


def other_end(landmark: str) -> str | None:
    """Return the landmark at the other end of the joint; None for a landmark that is not one of two ends."""
    joint, _, end = landmark.rpartition("_")
    return {"lateral": f"{joint}_medial", "medial": f"{joint}_lateral"}.get(end)


def _legal(path: Path, kind: str, found: tuple[str, ...], legal: tuple[str, ...]) -> None:
    wrong = [name for name in found if name not in legal]
    if wrong:
        raise BiodanceError(f"{path}: {wrong[0]!r} is not a {kind} of a marker set. Legal: {', '.join(legal)}.")


def _labels(path: Path, where: str, value: Any, markers: Collection[str]) -> list[str]:
    """Check that ``value`` is a list of labels of this set."""
    if not isinstance(value, list) or not all(isinstance(label, str) for label in value):
        raise BiodanceError(f"{path}: {where} is {value!r}, expected a list of marker labels.")
    unknown = [label for label in value if label not in markers]
    if unknown:
        raise BiodanceError(
            f"{path}: {where} names {unknown[0]!r}, which is not under [markers]. Add the marker or correct the label."
        )
    return value


def _alternatives(path: Path, name: str, value: Any, markers: Collection[str]) -> tuple[tuple[str, ...], ...]:
    if not isinstance(value, list) or not value or not all(isinstance(labels, list) and labels for labels in value):
        raise BiodanceError(
            f'{path}: landmark {name} is {value!r}, expected lists of labels, for example [["LPSI", "RPSI"], ["SACR"]].'
        )
    return tuple(tuple(_labels(path, f"landmark {name}", labels, markers)) for labels in value)


def _marker(path: Path, label: str, fields: Any) -> _SetMarker:
    """Return one marker after checking its entry."""
    where = f"{path}: marker {label}"
    if not isinstance(fields, dict) or "segment" not in fields:
        raise BiodanceError(f"{where} has no segment. Write segment = one of {', '.join(MARKED_SEGMENTS)}.")
    for key, value in fields.items():
        if key not in _MARKER_KEYS:
            raise BiodanceError(f"{where} has the unknown key {key!r}. Legal: {', '.join(_MARKER_KEYS)}.")
        is_legal, expected = _MARKER_KEYS[key]
        if not is_legal(value):
            raise BiodanceError(f"{where} has the {key} {value!r}, expected {expected}.")
    if ("offset" in fields) != ("normaliser" in fields):
        raise BiodanceError(
            f"{where} has an offset without normaliser or a normaliser without offset. Give both or neither."
        )
    said = {
        "offset": tuple(map(float, fields["offset"])) if "offset" in fields else None,
        "corner_of": tuple(map(str, fields.get("corner_of", ()))),
        "weight": float(fields.get("weight", 1.0)),
    }
    return _SetMarker(label, **{**fields, **said})


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6


def _three(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3


def _one_of(*words: str) -> tuple[Callable[[Any], bool], str]:
    return words.__contains__, f"one of {', '.join(words)}"


_MARKER_KEYS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "segment": _one_of(*MARKED_SEGMENTS),
    "weight": (lambda value: _number(value) and value >= 0, "a number >= 0"),
    "offset": (
        lambda value: _three(value) and all(map(_number, value)),
        "three numbers [x, y, z] (anterior, up, right)",
    ),
    "normaliser": _one_of(*_NORMALISERS.split()),
    "origin": _one_of("segment", "mid_shoulder"),
    "corner_of": (_three, "the three labels of an alignment device"),
}
"""What the entries of a marker must be, and how that is said."""


FOLDER = "anthropometry/marker_sets"
FAMILY = DataFamily("marker set", "biodance.marker_sets", FOLDER, ".toml")
GUESSED = "guessed "
"""How the name of a guessed set begins; its map follows (`guess.guess_set`)."""


def read_marker_set(name_or_path: str | Path) -> MarkerSet:
    """Return a marker set: a shipped or installed one by its name, a user's own by the path of its TOML file (then the
    path is its name), or by the path of a session.toml that has a ``[markers] map``.

    Raises
    ------
    UnknownName
        There is no set of that name.
    BiodanceError
        The file is missing, is not TOML, or breaks a rule; the message names the file, the entry and what would be
        legal.
    """
    if str(name_or_path).startswith(GUESSED):
        return _guessed(str(name_or_path))
    path = FAMILY.locate(name_or_path)
    if not os.path.isfile(path):
        raise FileRefused(
            f"{path}: cannot be opened, there is no such marker set. Check the path; sets known by name are "
            f"{', '.join(FAMILY.files())}."
        )
    return _read(str(name_or_path), path, path.stat().st_mtime_ns)


_PLACED = ("plug_in_gait", "isb_landmarks")
"""The sets whose own places are the usual ones of their landmarks."""


@cache
def _read(name: str, path: Path, _stamp: int) -> MarkerSet:
    """Return the marker set in a file, or of the map in a session.toml; read anew when the file has changed."""
    if path.name not in ("session.toml", "subject.toml"):
        return _made(name, _parse_marker_set(path), usual=path.stem not in _PLACED)
    table = read_toml(path).get("markers")
    given = table.get("map") if isinstance(table, dict) else None
    if not isinstance(given, dict) or not given:
        raise BiodanceError(
            f'{path}: [markers] has no map. Write map = {{LABEL = "left_asis", ...}}, one label per landmark.'
        )
    return _made(name, parse_map(given, str(path)), usual=True)


@cache
def _guessed(name: str) -> MarkerSet:
    """Return the set of a guessed map, which its name holds."""
    given = json.loads(name.removeprefix(GUESSED))
    return _made(name, parse_map(given, "the guess from names and posture"), usual=True)


def _made(name: str, said: MarkerSet, *, usual: bool) -> MarkerSet:
    """Return a set as it was ``said`` under its ``name``; ``usual``: landmarks without a place get the usual one."""
    markers = {one.label: one for one in said.markers}
    for place, labels in said.landmarks.items() if usual else ():
        label, known = labels[0][0], usual_places().get(place)
        if known and len(labels[0]) == 1 and markers[label].offset is None:
            markers[label] = replace(known, label=label, corner_of=())
    aliases, landmarks = MappingProxyType(said.aliases), MappingProxyType(said.landmarks)
    return replace(said, name=name, markers=tuple(markers.values()), aliases=aliases, landmarks=landmarks)


def recognise(labels: Iterable[str], *, candidates: Iterable[MarkerSet] | None = None) -> MarkerSet | None:
    """Return the set whose required labels are all among ``labels`` and of which most markers are there; None if there
    is none.

    ``candidates`` are the sets to choose from, by default all known by name.
    """
    labels = tuple(labels)
    sets = tuple(read_marker_set(name) for name in FAMILY.files()) if candidates is None else tuple(candidates)
    matches = [(marker_set, marker_set.match(labels)) for marker_set in sets]
    complete = [(marker_set, match) for marker_set, match in matches if match.keys() >= set(marker_set.required)]
    return max(complete, key=lambda pair: len(pair[1]))[0] if complete else None


def wearing(trial: Trial, marker_set: MarkerSet) -> Trial:
    """Return the trial with its markers taken as ``marker_set``, which a person chose, whatever set its labels are
    like; of no set where none of the labels that the set requires is there.

    A moving trial need not have all of them (medial markers are taken off); a warning says which are missing from a
    static one, and from one that more labels of another set are in.
    """
    if trial.markers is None:
        return trial
    match, title = marker_set.match(trial.markers.names), marker_set.title
    absent = [label for label in marker_set.required if label not in match]
    worn = len(absent) < len(marker_set.required)
    other = len(read_marker_set(trial.marker_set).match(trial.markers.names)) if trial.marker_set else 0
    said = f"The markers were read as the set {title}: {len(match)} of its {len(marker_set.labels)} labels are there."
    doubt = f"The markers are not of the chosen set {title}: {', '.join(absent)} missing. Choose the set that was worn."
    doubtful = bool(absent) and (trial.role == "static" or not worn or other > len(match))
    history = (*trial.history, said) if worn else trial.history
    warnings = (*trial.warnings, doubt) if doubtful else trial.warnings
    return replace(trial, marker_set=marker_set.name if worn else "", history=history, warnings=warnings)


def canonical(markers: Markers, marker_set: MarkerSet) -> Markers:
    """Return the markers of the set only, under the set's own labels and in its order.

    A moving trial need not have all that the static one has: which joints its markers determine is not asked here.

    Raises
    ------
    TrialRefused
        No required label of the set is there.
    """
    match = marker_set.match(markers.names)
    absent = [label for label in marker_set.required if label not in match]
    if len(absent) == len(marker_set.required):
        raise TrialRefused(
            f"The markers are not of the set {marker_set.title}: {', '.join(absent)} "
            f"{'is' if len(absent) == 1 else 'are'} not among them. Label them, or choose the set that was worn."
        )
    chosen = markers.select(match.values())
    return Markers(tuple(match), chosen.time, chosen.xyz)


def landmark(markers: Markers, marker_set: MarkerSet, name: str) -> Array | None:
    """Return the trajectory (T, 3) m of an anatomical landmark, for example "mid_psis", in the lab frame.

    The first alternative of which every label was recorded is taken, as the mean of its markers; NaN in frames where
    one of them is not seen. None where the set or the recording does not have this landmark. ``markers`` may have the
    file's or the set's labels.

    Raises
    ------
    UnknownName
        ``name`` is no landmark that biodance knows.
    """
    refuse_unknown("landmark", name, LANDMARKS)
    match = marker_set.match(markers.names)
    for alternative in marker_set.landmarks.get(name, ()):
        if all(label in match for label in alternative):
            return np.mean([markers[match[label]] for label in alternative], axis=0)
    side, _, part = name.partition("_")
    for others in _STAND_INS.get(part if side in SIDES else name, ()):
        places = [landmark(markers, marker_set, f"{side}_{other}" if side in SIDES else other) for other in others]
        if all(place is not None for place in places):
            return np.mean(np.array(places), axis=0)
    return None


_STAND_INS = {
    "toe": (("toe_medial", "toe_lateral"), ("toe_lateral",), ("toe_medial",)),
    "mid_psis": (("left_psis", "right_psis"),),
}
"""Landmarks whose mean stands in for one that has no marker of its own."""


@cache
def usual_places() -> Mapping[str, _SetMarker]:
    """Return the marker with a usual place on every landmark that has one: of plug-in gait, else of the ISB set."""
    found: dict[str, _SetMarker] = {}
    for name in _PLACED:
        known = read_marker_set(name)
        for place, alternatives in known.landmarks.items():
            marker = known.marker(alternatives[0][0])
            if len(alternatives[0]) == 1 and marker.offset is not None:
                found.setdefault(place, marker)
    return MappingProxyType(found)
