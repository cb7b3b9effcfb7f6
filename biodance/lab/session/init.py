"""``biodance init``: what was guessed of a session, written into its session.toml to be confirmed or corrected."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from biodance.errors import SessionRefused
from biodance.lab.markers.sets import GUESSED
from biodance.lab.session.read import read_session
from biodance.records import Session, Subject, Trial

FILE = "session.toml"


def init_session(folder: str | Path, *, subject_name: str | None = None) -> dict[str, Any]:
    """Read a session and write what was found and guessed of it into its session.toml.

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
        it was guessed, else None; ``plates`` [{trial, name, type, decisions}]; ``refused`` file -> reason; ``notes``.

    Raises
    ------
    SessionRefused
        There is a session.toml already, or the session cannot be read.

    Examples
    --------
    >>> from biodance.lab.session.init import init_session
    >>> init_session("visit")
    Traceback (most recent call last):
    biodance.errors.SessionRefused: visit/session.toml is there already, and nothing of yours is overwritten. ...
    """
    target = Path(folder) / FILE
    _refuse_existing(target)
    session = read_session(folder, subject_name=subject_name)
    found = _found(session, target)
    _refuse_existing(target)
    lines = [" ".join(line.split()) for line in _lines(found)]
    with open(target, "x", encoding="utf-8") as stream:
        stream.write("\n".join(lines) + "\n")
    return found


def _refuse_existing(target: Path) -> None:
    if target.exists():
        raise SessionRefused(
            f"{target} is there already, and nothing of yours is overwritten. Correct it, or move it away and run this "
            f"again."
        )


def _found(session: Session, target: Path) -> dict[str, Any]:
    """Return what the file will say, as plain values."""
    worn = next((trial.marker_set for trial in _statics_first(session) if trial.marker_set), "")
    plates = [
        {"trial": trial.name, "name": plate.name, "type": plate.type, "decisions": list(plate.decisions)}
        for trial in session.trials
        for plate in trial.plates
    ]
    return {
        "file": str(target),
        "subject": _subject(session.subject),
        "trials": [
            {"name": trial.source.path.stem, "role": trial.role, "why": _why(session, trial)}
            for trial in session.trials
        ],
        "marker_set": worn.partition(" {")[0] or None,
        "marker_map": json.loads(worn.removeprefix(GUESSED)) if worn.startswith(GUESSED) else None,
        "plates": plates,
        "refused": dict(session.refused),
        "notes": list(session.notes),
    }


def _statics_first(session: Session) -> list[Trial]:
    return sorted(session.trials, key=lambda trial: trial.role != "static")


def _subject(subject: Subject) -> dict[str, Any]:
    numbers = {"mass_kg": subject.mass, "height_m": subject.stature, "age": subject.age}
    known = {key: float(f"{value:.4g}") if math.isfinite(value) else None for key, value in numbers.items()}
    return {"name": subject.name, **known, "sex": subject.sex, "guessed": list(subject.guessed)}


def _why(session: Session, trial: Trial) -> str:
    start = f"{trial.name} has the role {trial.role}: "
    return next((note.removeprefix(start).rstrip(".") for note in session.notes if note.startswith(start)), "")


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the file; every guess and every doubt is a comment beside what it is about."""
    yield "# Written by biodance init: what the recordings say, and what was guessed. Correct what is wrong."
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
        remark = "  # guessed" if guessed.get(key) in subject["guessed"] else ""
        yield f"{key} = {json.dumps(value)}{remark}" if value is not None else f"# {key} =   not known"
    for trial in {trial["name"]: trial for trial in found["trials"]}.values():
        yield from ("", f"[trials.{json.dumps(trial['name'])}]", f'role = "{trial["role"]}"  # {trial["why"]}')
    yield from ("", *_marker_lines(found))
    for plate in found["plates"]:
        yield f"# {plate['trial']}: {plate['name']}, TYPE {plate['type']}. {' '.join(plate['decisions'])}".rstrip()


def _marker_lines(found: dict[str, Any]) -> Iterator[str]:
    if found["marker_map"] is None:
        worn = found["marker_set"]
        yield "[markers]" if worn else '# [markers]  no marker set is known; file = "set.toml", or map = {...}'
        if worn:
            yield f"file = {json.dumps(worn)}  # recognised by its labels"
    else:
        yield "# Guessed from the names and from where the markers are on the standing person; a wrong map is worse"
        yield "# than none: compare it with what you placed. Legal are landmarks (left_asis) and segments (left_thigh)."
        yield "[markers.map]"
        for label, place in sorted(found["marker_map"].items(), key=lambda item: (item[1].split("_")[-2:], item[0])):
            yield f"{json.dumps(label)} = {json.dumps(place)}"
    yield ""
