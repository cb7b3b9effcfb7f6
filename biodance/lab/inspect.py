"""Say what is in a recording: all that a person wants to know before trusting it, as plain values ready for JSON; and
what is in a session: ``biodance init`` writes what is declared into session.toml, and what was guessed as comments.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import BiodanceError, SessionRefused
from biodance.lab.c3d.subject import subjects_in
from biodance.lab.markers.guess import guess_set, said_of
from biodance.lab.markers.names import plain_labels
from biodance.lab.markers.sets import GUESSED, MarkerSet, canonical, read_marker_set
from biodance.lab.markers.signals import report_gaps
from biodance.lab.markers.upright import standing_mass
from biodance.lab.plain_text import write_whole
from biodance.lab.plates import Told
from biodance.lab.readers import read_trial, reader_of
from biodance.lab.session.entries import plate_lines
from biodance.lab.session.file import read_session_file
from biodance.lab.session.read import read_session
from biodance.lab.session.recordings import recordings_below
from biodance.lab.session.subject import declared
from biodance.records import Plate, Session, Trial
from biodance.settings import COP_FORCE

_KEYS = (
    "file status reason format frames rate_hz analog_rate_hz markers marker_set marker_map gaps_percent subjects "
    "plates mean_vertical_n mass_on_plates_kg declared_mass_kg declared_height_m history warnings"
)


def inspect_paths(
    paths: Sequence[str | Path],
    *,
    subject: str | None = None,
    markers: str | Path | None = None,
    tell: Callable[[str], None] | None = None,
) -> list[dict[str, Any]]:
    """Return one record (see `inspect_file`) for each file, and for each recording in each folder and below it.

    ``subject`` chooses the person in C3D files that hold several; ``markers`` is the name or file of the marker set
    that was worn; without it, what the session.toml of a file's folder says of it, else the known set that fits, else
    what can be guessed.

    Raises
    ------
    BiodanceError
        No path is given.
    """
    if not paths:
        raise BiodanceError("There is nothing to inspect: name files, or folders with recordings.")
    worn = read_marker_set(markers) if markers is not None else None
    said: dict[Path, tuple[MarkerSet | None, Told, str]] = {}
    records = []
    for path in map(Path, paths):
        files = recordings_below(path) if path.is_dir() else [path]
        if not files:
            records.append(_refused(path, "holds no recording."))
        for file in files:
            if tell:
                tell(file.name)
            chosen, told, fault = said.setdefault(file.parent, _said_in(file.parent))
            record = inspect_file(file, subject=subject, markers=worn or chosen, told=told)
            if fault and record["status"] != "refused":
                warnings = [*record["warnings"], fault]
                record |= {"status": "warning", "reason": warnings[0], "warnings": warnings}
            records.append(record)
    return records


def _said_in(folder: Path) -> tuple[MarkerSet | None, Told, str]:
    """Return the marker set that a session.toml names, what it says of the plates, and what is wrong with it."""
    try:
        said = read_session_file(folder)
        return (read_marker_set(said.marker_set) if said.marker_set else None), said.told, ""
    except BiodanceError as error:
        return None, Told(), str(error)


def inspect_file(
    path: str | Path, *, subject: str | None = None, markers: MarkerSet | None = None, told: Told | None = None
) -> dict[str, Any]:
    """Return what is in one recording; a file that cannot be read gives the status "refused" and the reason.

    Keys: ``file``; ``status`` "ok", "warning" or "refused"; ``reason`` (None if ok); ``format``; ``frames``,
    ``rate_hz``, ``analog_rate_hz``; ``markers`` names; ``marker_set``, "guessed" where no known one fits;
    ``marker_map`` label -> landmark or segment of a guessed one; ``gaps_percent`` of the set's markers that were
    seen at all (of all markers, without a set); ``subjects`` names in the file; ``plates`` with ``type``,
    ``corners_m``, ``mean_force_n`` (3), ``mean_vertical_n``, ``zero_n`` (3, what the empty plate read and was taken
    off), ``cop_m`` (2, mean while loaded, lab frame) and ``decisions``; ``mean_vertical_n`` of all plates together as
    the file stores it, before their zeros are taken off; ``mass_on_plates_kg`` in quiet standing; ``declared_mass_kg``,
    ``declared_height_m``; ``history``; ``warnings``. What is not there is None; no number is NaN.
    """
    path = Path(path)
    try:
        trial = read_trial(path, subject=subject, markers=markers, told=told)
    except BiodanceError as error:
        return _refused(path, str(error))
    trial, guessed = _guessed(trial)
    gap, never = _gaps(trial)
    warnings = [*(one.text for one in trial.defects), *trial.warnings, *guessed, *never]
    plates = [_plate(plate) for plate in trial.plates]
    clocks = [*([trial.markers.time] if trial.markers else ()), *(plate.wrench.time for plate in trial.plates)]
    as_read = [plate["mean_vertical_n"] + plate["zero_n"][2] for plate in plates]
    worn = trial.marker_set
    return {
        "file": str(path),
        "status": "warning" if warnings else "ok",
        "reason": warnings[0] if warnings else None,
        "format": trial.source.format,
        "frames": int(clocks[0].size) if clocks else 0,
        "rate_hz": _number(trial.source.rate),
        "analog_rate_hz": _number(trial.source.analog_rate),
        "markers": list(trial.markers.names) if trial.markers is not None else [],
        "marker_set": trial.worn or None,
        "marker_map": json.loads(worn.removeprefix(GUESSED)) if worn.startswith(GUESSED) else None,
        "gaps_percent": gap,
        "subjects": list(subjects_in(path)) if ".c3d" in reader_of(path).EXTENSIONS else [],
        "plates": plates,
        "mean_vertical_n": float(sum(as_read)) if as_read else None,
        "mass_on_plates_kg": standing_mass(trial),
        "declared_mass_kg": _number(declared(trial.measurements, "mass")),
        "declared_height_m": _number(declared(trial.measurements, "stature")),
        "history": list(trial.history),
        "warnings": warnings,
    }


def _gaps(trial: Trial) -> tuple[float | None, list[str]]:
    """Return the mean share of gaps, per cent, of the set's markers (of all, without a set) that were seen at all, None
    without one; and a sentence about those that never were.
    """
    if trial.markers is None:
        return None, []
    worn = read_marker_set(trial.marker_set) if trial.marker_set else None
    gaps = report_gaps(canonical(trial.markers, worn) if worn else trial.markers)
    hidden = [gap.percent for gap in gaps if gap.percent < 100.0]
    never = [gap.label for gap in gaps if gap.percent >= 100.0]
    said = [f"Never seen: {', '.join(never[:12])}{' ...' if len(never) > 12 else ''}."] if never else []
    return float(np.mean(hidden)) if hidden else None, said


def _guessed(trial: Trial) -> tuple[Trial, list[str]]:
    """Return a trial of no known set with what can be guessed of it, and that it was."""
    if trial.markers is None or trial.marker_set:
        return trial, []
    guess = guess_set(trial.markers)
    return replace(trial, marker_set=guess.name), [said_of(guess, trial.name)]


def _refused(path: Path, reason: str) -> dict[str, Any]:
    """Return the record of a file that cannot be read, with all keys."""
    empty: dict[str, Any] = {name: [] for name in ("markers", "subjects", "plates", "history", "warnings")}
    return {**dict.fromkeys(_KEYS.split()), **empty, "file": str(path), "status": "refused", "reason": reason}


def _plate(plate: Plate) -> dict[str, Any]:
    force = np.nanmean(plate.wrench.force, axis=0) if plate.wrench.time.size else np.full(3, math.nan)
    cop = plate.wrench.cop(height=plate.height, threshold=COP_FORCE)[:, :2]
    loaded = cop[np.isfinite(cop).all(axis=1)]
    # Less than 0.05 s under load is noise.
    stepped_on = loaded.size > 0 and len(loaded) >= 0.05 * plate.wrench.rate
    return {
        "name": plate.name,
        "type": plate.type,
        "corners_m": [[_number(x) for x in corner] for corner in plate.corners],
        "mean_force_n": [_number(f) for f in force],
        "mean_vertical_n": _number(force[2]),
        "zero_n": [float(f) for f in plate.zero],
        "cop_m": [_number(x) for x in loaded.mean(axis=0)] if stepped_on else None,
        "decisions": list(plate.decisions),
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def init_session(folder: str | Path, *, subject_name: str | None = None) -> dict[str, Any]:
    """Read a session and write what is declared of it into its session.toml, and what was guessed as comments, to be
    confirmed or corrected.

    Parameters
    ----------
    folder : str or pathlib.Path
        With the recordings of one visit, and no session.toml yet.
    subject_name : str, optional
        Chooses the person in C3D files that hold several.

    Returns
    -------
    dict
        ``file`` that was written; ``subject`` {name, mass_kg, height_m, sex, age, guessed: [names]}; ``trials``
        [{name, role, why}]; ``marker_set`` name, "guessed" or None; ``marker_map`` label -> landmark or segment where
        it was guessed, else None; ``markers`` whether there are any; ``plates`` [{trial, name, type, decisions}];
        ``refused`` file -> reason; ``notes``.

    Raises
    ------
    SessionRefused
        There is a session.toml already, or the session cannot be read.

    Examples
    --------
    >>> from biodance.lab.inspect import init_session
    >>> init_session("visit")
    Traceback (most recent call last):
    biodance.errors.SessionRefused: visit/session.toml is there already, and nothing of yours is overwritten. ...
    """
    target = Path(folder) / "session.toml"
    if target.exists():
        raise SessionRefused(
            f"{target} is there already, and nothing of yours is overwritten. Correct it, or move it away and run this "
            f"again."
        )
    session = read_session(folder, subject_name=subject_name)
    worn = next((trial.marker_set for trial in _statics_first(session) if trial.marker_set), "")
    trials, plates = [], []
    for trial in session.trials:
        start = f"{trial.name} has the role {trial.role}: "
        why = next((note.removeprefix(start).rstrip(".") for note in session.notes if note.startswith(start)), "")
        trials.append({"name": trial.source.path.stem, "role": trial.role, "why": why})
        for plate in trial.plates:
            said = {"name": plate.name, "type": plate.type, "decisions": list(plate.decisions)}
            plates.append({"trial": trial.name, **said})
    who = session.subject
    numbers = {"mass_kg": who.mass, "height_m": who.stature, "age": who.age}
    known = {key: float(f"{value:.4g}") if math.isfinite(value) else None for key, value in numbers.items()}
    found = {
        "file": str(target),
        "subject": {"name": who.name, **known, "sex": who.sex, "guessed": list(who.guessed)},
        "trials": trials,
        "markers": any(trial.markers is not None for trial in session.trials),
        "marker_set": worn.partition(" {")[0] or None,
        "marker_map": json.loads(worn.removeprefix(GUESSED)) if worn.startswith(GUESSED) else None,
        "plates": plates,
        "refused": dict(session.refused),
        "notes": list(session.notes),
    }
    lines = [" ".join(line.split()) for line in (*_lines(found), *plate_lines(session), *_begun_map(session, found))]
    write_whole(target, ("\n".join(lines) + "\n").encode())
    return found


def _statics_first(session: Session) -> list[Trial]:
    return sorted(session.trials, key=lambda trial: trial.role != "static")


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the file; every guess and every doubt is a comment: what stands here is believed."""
    yield "# Written by biodance init: what the recordings say. What was guessed has a # before it and says nothing:"
    yield "# take the # away where it is right, or correct it."
    for note in found["notes"]:
        if " has the role " not in note and "the map was guessed" not in note:
            yield f"# {note}"
    for file, reason in found["refused"].items():
        yield f"# {file} was refused: {reason}"
    yield from ("", "[subject]")
    subject = found["subject"]
    guessed = {"mass_kg": "mass", "height_m": "stature", "sex": "sex"}
    for key in ("mass_kg", "height_m", "sex", "age"):
        value = subject[key]
        if value is None:
            yield f"# {key} =   not known"
        elif guessed.get(key) in subject["guessed"]:
            yield f"# {key} = {json.dumps(value)}  # guessed"
        else:
            yield f"{key} = {json.dumps(value)}"
    yield '# prosthesis = "left_shank"  # the segment that a prosthesis begins with'
    yield from ("", "# [devices]  kg worn beside mass_kg, by segment", "# right_shank = 0.6")
    for trial in {trial["name"]: trial for trial in found["trials"]}.values():
        yield from ("", f"[trials.{json.dumps(trial['name'])}]", f'# role = "{trial["role"]}"  # {trial["why"]}')
    yield from ("", *_marker_lines(found))
    if found["plates"]:
        yield "# What was decided about zero, signs and place of every plate is told by: biodance inspect"


def _begun_map(session: Session, found: dict[str, Any]) -> Iterator[str]:
    """Yield, where no set could be guessed, a map to complete: what is certain, and the other labels."""
    worn = [trial.markers for trial in _statics_first(session) if trial.markers is not None]
    if found["marker_set"] or not worn:
        return
    begun = guess_set(worn[0]).map
    yield "# A map to complete: write a landmark (left_asis) or a segment (left_thigh) behind every label; take away"
    yield "# the lines of labels that mark nothing, and the # before the others."
    yield "# [markers.map]"
    for label in sorted(plain_labels(worn[0].names), key=lambda one: (begun.get(one, "~"), one)):
        yield f"# {json.dumps(label)} = {json.dumps(begun.get(label, ''))}"


def _marker_lines(found: dict[str, Any]) -> Iterator[str]:
    if found["marker_map"] is None:
        worn = found["marker_set"]
        yield '# [markers]  no marker set is known; file = "set.toml", or map = {...}' if not worn else "[markers]"
        if worn:
            yield f"# file = {json.dumps(worn)}  # recognised by its labels"
    else:
        yield "# Guessed from the names and from where the markers are on the standing person; a wrong map is worse"
        yield "# than none: compare it with what you placed. Legal are landmarks (left_asis) and segments (left_thigh)."
        yield "# [markers.map]"
        for label, place in sorted(found["marker_map"].items(), key=lambda item: (item[1].split("_")[-2:], item[0])):
            yield f"# {json.dumps(label)} = {json.dumps(place)}"
    yield ""
