"""Marker sets: which marker sits on which segment and marks which landmark; data files in
``anthropometry/marker_sets``.

A set is recognised by its labels, never by a count: markers that a lab leaves out are simply not there. A set file
names the labels that must be there (``required``), other spellings (``aliases``), per marker its segment and weight
and, for bodies that nobody has measured, an ``offset`` in units of a body measure (``normaliser``), and which labels
mark which anatomical landmark.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from biodance.discovery import DataFamily
from biodance.errors import FileRefused, TrialRefused, UnknownName
from biodance.lab.markers.set_file import LANDMARKS, Contents, SetMarker, parse_map, parse_marker_set, read_map
from biodance.records import SIDES, Array, Markers, Trial

FOLDER = "anthropometry/marker_sets"
FAMILY = DataFamily("marker set", "biodance.marker_sets", FOLDER, ".toml")
_MAPS = ("session.toml", "subject.toml")
"""Files whose ``[markers] map`` is a marker set of its own."""
GUESSED = "guessed "
"""How the name of a guessed set begins; its map follows (`guess.guess_set`)."""


@dataclass(frozen=True)
class MarkerSet:
    """A marker set: ``markers``; ``aliases`` label in files -> label of the set; ``landmarks`` name -> alternatives,
    each the labels whose mean is the landmark; ``required`` labels without which the set is not recognised; ``name``
    finds it again with ``read_marker_set``.
    """

    name: str
    description: str
    source: str
    markers: tuple[SetMarker, ...]
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

    def marker(self, label: str) -> SetMarker:
        """Return one marker by its label; UnknownName lists the legal ones."""
        if label not in self.labels:
            raise UnknownName.of(f"marker of the set {self.name}", label, self.labels)
        return self.markers[self.labels.index(label)]

    def match(self, labels: Iterable[str]) -> dict[str, str]:
        """Return ``{label of the set: label in the file}`` for every marker of the set that the file has.

        The exact label wins over an alias, an alias over another letter case; a difference in case only counts where
        the file has one such label.
        """
        known = set(given := tuple(labels))
        folded: dict[str, list[str]] = {}
        for label in given:
            folded.setdefault(label.casefold(), []).append(label)
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
    if not path.is_file():
        raise FileRefused(
            f"{path}: cannot be opened, there is no such marker set. Check the path; sets known by name are "
            f"{', '.join(FAMILY.files())}."
        )
    return _read(str(name_or_path), path, path.stat().st_mtime_ns)


_PLACED = ("plug_in_gait", "isb_landmarks")
"""The sets whose own places are the usual ones of their landmarks."""


@cache
def _read(name: str, path: Path, _stamp: int) -> MarkerSet:
    """Return the marker set in a file; read anew when the file has changed."""
    if path.name in _MAPS:
        return _made(name, read_map(path), usual=True)
    return _made(name, parse_marker_set(path), usual=path.stem not in _PLACED)


@cache
def _guessed(name: str) -> MarkerSet:
    """Return the set of a guessed map, which its name holds."""
    given = json.loads(name.removeprefix(GUESSED))
    return _made(name, parse_map(given, "the guess from names and posture"), usual=True)


def _made(name: str, contents: Contents, *, usual: bool) -> MarkerSet:
    """Return the set of a file's contents; ``usual``: landmarks without a place get the usual one."""
    markers = dict(contents.markers)
    for place, labels in contents.landmarks.items() if usual else ():
        label, known = labels[0][0], usual_places().get(place)
        if known and len(labels[0]) == 1 and markers[label].offset is None:
            markers[label] = replace(known, label=label, corner_of=())
    aliases, landmarks = MappingProxyType(contents.aliases), MappingProxyType(contents.landmarks)
    said = (contents.description, contents.source)
    return MarkerSet(name, *said, tuple(markers.values()), aliases, landmarks, contents.required)


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
    if name not in LANDMARKS:
        raise UnknownName.of("landmark", name, LANDMARKS)
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
def usual_places() -> Mapping[str, SetMarker]:
    """Return the marker with a usual place on every landmark that has one: of plug-in gait, else of the ISB set."""
    found: dict[str, SetMarker] = {}
    for name in _PLACED:
        known = read_marker_set(name)
        for place, alternatives in known.landmarks.items():
            marker = known.marker(alternatives[0][0])
            if len(alternatives[0]) == 1 and marker.offset is not None:
                found.setdefault(place, marker)
    return MappingProxyType(found)
