"""What a window shows of one session before anything is computed: trials, subject, markers, plates; as plain values."""

import json
import math
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from biodance.app.sessions import SessionPlace
from biodance.errors import BiodanceError
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.names import meanings_of, plain_labels
from biodance.lab.markers.sets import GUESSED, LANDMARKS, MARKED_SEGMENTS, MarkerSet, read_marker_set
from biodance.lab.markers.signals import fill_gaps, report_gaps
from biodance.lab.markers.upright import is_still, movement
from biodance.lab.session.entries import plate_channels
from biodance.lab.session.file import SessionFile, read_session_file
from biodance.lab.session.read import read_session
from biodance.lab.session.recordings import find_recordings
from biodance.pipeline.still import packed_numbers
from biodance.records import ROLES, Markers, Session, Trial, runs
from biodance.report.tables.schema import plain_values
from biodance.report.tables.session import EVENT_ROW

_FRAMES = 1500  # Frames of a trial that are drawn at most
_LOADED = 20.0  # N from which a plate has a centre of pressure


def markers_document(trial: Trial) -> dict[str, Any]:
    """Return a trial's markers to be drawn: ``names``, ``start_s``, ``step_s``, ``frames``, ``origin`` m, ``unit`` m of
    a step of ``places``, int16 (frames, markers, 3) in base64; ``gaps`` and ``filled`` spans (from, to) s by label: not
    seen, and those of them that would be filled; ``plates`` corners m.
    """
    markers = trial.markers
    if markers is None or not markers.seen.any():
        return {"names": [], "frames": 0}
    segments: dict[str, str] = {}
    if trial.marker_set:
        worn = read_marker_set(trial.marker_set)
        segments = {label: worn.marker(own).segment for own, label in worn.match(markers.names).items()}
    filled = fill_gaps(markers, segments)[0]  # as a run would fill them
    # -(-a // b) rounds up: so many frames are left out between two that at most `_FRAMES` stay
    chosen = np.arange(0, markers.time.size, max(1, -(-markers.time.size // _FRAMES)))
    xyz = filled.xyz[chosen]
    origin = np.nanmean(markers.xyz, axis=(0, 1)).round(4)
    # places are whole numbers of 16 bits, and the furthest is 30,000 steps from the origin
    unit = max(1e-4, float(np.nanmax(np.abs(xyz - origin))) / 30000)
    drawn = filled.filled if filled.filled.size else np.zeros(markers.seen.shape, dtype=bool)
    spans = {"gaps": ~markers.seen, "filled": drawn}
    told = {
        "names": markers.names,
        "start_s": float(markers.time[0]),
        "step_s": float(np.median(np.diff(markers.time[chosen]))) if chosen.size > 1 else 0.0,
        "frames": chosen.size,
        "origin": origin,
        "unit": unit,
        "places": packed_numbers((xyz - origin) / unit),
        "plates": [plate.corners.round(4) for plate in trial.plates],
    }
    return dict(plain_values(told | {key: _spans(markers, mask) for key, mask in spans.items()}))


def _spans(markers: Markers, mask: Any) -> dict[str, list[list[float]]]:
    """Return the spans (from, to) s of each label in which ``mask`` (T, K) holds; labels without one are left out."""
    found = {
        name: [[float(markers.time[a]), float(markers.time[b - 1])] for a, b in runs(mask[:, k])]
        for k, name in enumerate(markers.names)
    }
    return {name: spans for name, spans in found.items() if spans}


def forces_document(trial: Trial) -> dict[str, Any]:
    """Return vertical force (N) of every plate over time (s) and the path of its centre of pressure (m, lab frame)."""
    rows = []
    for plate in trial.plates:
        time, force = plate.wrench.time, plate.wrench.value[:, 2]
        chosen = np.arange(0, time.size, max(1, -(-time.size // 600)))
        path = plate.wrench.cop(height=plate.height, threshold=_LOADED)[chosen, :2]
        cop = path[np.isfinite(path).all(axis=1)].round(4)
        about = {"time_s": time[chosen].round(4), "force_n": force[chosen].round(1), "cop_m": cop}
        rows.append({"name": plate.name} | about)
    clocks = [one.time for one in (trial.markers, *(plate.wrench for plate in trial.plates)) if one is not None]
    ends = [float(min(time[0] for time in clocks)), float(max(time[-1] for time in clocks))] if clocks else [0.0, 0.0]
    return {"plates": plain_values(rows), "ends_s": ends}


class PlacedBy(StrEnum):
    """How it is known what a marker marks."""

    MAP = "map"
    """session.toml says it."""
    SET = "set"
    """The marker set says it, which was recognised by its labels."""
    NAME = "name"
    """Guessed: its name says it."""
    POSTURE = "posture"
    """Guessed: it stands there on the standing person."""
    NOBODY = "nobody"
    """Nobody knows; it is not used."""


class SessionView:
    """One session as it is read now, kept until its recordings or its session.toml change."""

    def __init__(self, place: SessionPlace) -> None:
        self.place = place
        self.stamp = place.task().fingerprint
        self.session: Session | None = None
        self.why = ""
        self._said = SessionFile()
        try:
            self._said = read_session_file(place.folder)
            self.session = read_session(place.folder)
        except BiodanceError as error:
            self.why = str(error)

    def document(self) -> dict[str, Any]:
        """Return what the tabs Trials and Markers show; ``why`` where the session cannot be read."""
        undo, redo = self.place.file.steps
        told: dict[str, Any] = {
            "name": self.place.name,
            "folder": str(self.place.folder),
            "text": self.place.file.text,
            "revision": self.place.file.revision,
            "undo": undo,
            "redo": redo,
            "why": self.why,
            "found": self.place.found(),
            "roles": ROLES,
            "segments": MARKED_SEGMENTS,
        }
        if self.session is not None:
            told |= {
                "subject": self._subject(self.session),
                "trials": [*self._trials(self.session)],
                "refused": dict(self.session.refused),
                "notes": self.session.notes,
                "markers": self._markers(self.session),
                "plates": [*_plates(self.session, self._said)],
            }
        return dict(plain_values(told))

    def _subject(self, session: Session) -> dict[str, Any]:
        person, said = session.subject, self._said.subject
        told = {"mass_kg": person.mass, "height_m": person.stature, "sex": person.sex, "age": person.age}
        names = {"mass_kg": "mass", "height_m": "stature", "sex": "sex"}
        rows = {
            key: {
                "value": None if isinstance(value, float) and math.isnan(value) else value,
                "guessed": names.get(key) in person.guessed,
                "told": getattr(said, key) is not None,
            }
            for key, value in told.items()
        }
        return {"name": person.name, **rows, "prosthesis": person.prosthesis, "devices": dict(person.devices)}

    def _trials(self, session: Session) -> Iterator[dict[str, Any]]:
        read = {trial.source.path: trial for trial in session.trials}
        for path in find_recordings(self.place.folder)[0]:
            trial, parts = read.get(path), self._said.parts(path.stem)
            role = self._said.role(path.stem)
            row: dict[str, Any] = {
                "file": path.name,
                "stem": path.stem,
                "role": role or (trial.role if trial else ""),
                "told": role is not None,
                "why": session.refused.get(path.name, ""),
                "exchange": [one.entry for one in parts.exchanges],
                "events": EVENT_ROW.rows(parts.events),
                "leave_out": [[one.start, one.end, *([one.side] if one.side else [])] for one in parts.left_out],
            }
            yield row | (_of_trial(trial) if trial else {"name": ""})

    def _markers(self, session: Session) -> dict[str, Any]:
        shown = [trial for trial in session.trials if trial.markers is not None]
        leader = min(shown, key=lambda trial: (trial.role != "static", not trial.marker_set), default=None)
        if leader is None:
            return {"set": "", "guessed": False, "labels": [], "doubts": [], "landmarks": LANDMARKS}
        worn = read_marker_set(leader.marker_set) if leader.marker_set else None
        guessed = bool(worn and worn.name.startswith(GUESSED))
        guess = guess_set(leader.markers) if leader.markers and not self._said.marker_set else None
        return {
            "set": worn.title if worn else "",
            "guessed": guessed,
            "labels": self._labels([trial.markers for trial in shown if trial.markers], worn),
            "dropped": self._said.dropped,
            "doubts": guess.doubts if guess and (guessed or not worn) else [],
            "landmarks": LANDMARKS,
        }

    def _labels(self, recorded: list[Markers], worn: MarkerSet | None) -> list[dict[str, Any]]:
        """Return every label with its place, who says so, how much of it is not seen, and in how many trials it is."""
        labels = sorted({label for markers in recorded for label in plain_labels(markers.names)})
        places, named, gaps = _places(worn) if worn else {}, meanings_of(labels), dict[str, float]()
        for gap in (gap for markers in recorded for gap in report_gaps(markers)):  # the worst trial's
            gaps[gap.label] = max(gaps.get(gap.label, 0.0), gap.percent)
        return [
            {
                "label": label,
                "place": places.get(label, ""),
                "by": self._by(worn, label, places.get(label, ""), {one.place for one in named.get(label, ())}),
                "gaps_percent": gaps.get(label, 0.0),
                "trials": sum(label in markers.names for markers in recorded),
            }
            for label in labels
        ]

    def _by(self, worn: MarkerSet | None, label: str, place: str, named: set[str]) -> PlacedBy:
        if not worn or not place:
            return PlacedBy.NOBODY
        if Path(worn.name).name in ("session.toml", "subject.toml"):
            return PlacedBy.MAP
        if not worn.name.startswith(GUESSED):
            return PlacedBy.SET
        return PlacedBy.NAME if place in named else PlacedBy.POSTURE


def _places(worn: MarkerSet) -> dict[str, str]:
    """Return label -> the landmark that it marks alone, else its segment, for every spelling that a file may have."""
    if worn.name.startswith(GUESSED):
        return dict(json.loads(worn.name.removeprefix(GUESSED)))
    places = {marker.label: marker.segment for marker in worn.markers}
    for landmark, alternatives in worn.landmarks.items():
        if len(alternatives[0]) == 1:
            places[alternatives[0][0]] = landmark
    return places | {alias: places[label] for alias, label in worn.aliases.items() if label in places}


def _of_trial(trial: Trial) -> dict[str, Any]:
    row = trial._row()
    clock = trial.markers or (trial.plates[0].wrench if trial.plates else None)
    return {
        "name": trial.name,
        "seconds": row["duration (s)"],
        "rate_hz": row["rate (Hz)"],
        "start_s": float(clock.time[0]) if clock is not None else 0.0,
        "markers": row["markers"],
        "travels_m": None if trial.markers is None or is_still(trial) else movement(trial.markers),
        "plates": [plate.name for plate in trial.plates],
        "warnings": [*trial.warnings, *(one.text for one in trial.defects)],
    }


def _plates(session: Session, said: SessionFile) -> Iterator[dict[str, Any]]:
    """Yield every plate of the session, also those that are switched off."""
    names = dict.fromkeys(plate.name for trial in session.trials for plate in trial.plates)
    for name in dict.fromkeys([*names, *said.plates]):
        told = said.plates.get(name)
        on = [(trial, plate) for trial in session.trials for plate in trial.plates if plate.name == name]
        row: dict[str, Any] = {"name": name, "use": told is None or told.use, "foot": told.foot if told else ""}
        if on:
            trial, plate = on[0]
            labels, _ = plate_channels(plate, trial)
            row |= {"type": plate.type, "corners_m": plate.corners.round(5), "placed": plate.placed}
            row |= {"channels": labels, "decisions": plate.decisions}
            row["loads"] = []
            for trial, plate in on:
                force = plate.wrench.value[:, 2]
                force = force[np.isfinite(force)]
                mean, most = (float(force.mean()), float(force.max())) if force.size else (None, None)
                row["loads"].append({"trial": trial.name, "mean_n": mean, "most_n": most})
        yield row
