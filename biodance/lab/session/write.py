"""A session's own files: ``biodance init`` writes what is declared into session.toml, and what was guessed as comments;
markers and registered plates are written as an ordinary session, one C3D file with both.
"""

import json
import math
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import SessionRefused
from biodance.lab.c3d.subject import as_written
from biodance.lab.c3d.write import PlateRecording, plate_recording, write_c3d
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.names import plain_labels
from biodance.lab.markers.sets import GUESSED
from biodance.lab.plain_text import write_whole
from biodance.lab.plates.decode import plate_axes
from biodance.lab.session.entries import plate_lines
from biodance.lab.session.file import FILES
from biodance.lab.session.read import read_session
from biodance.lab.session.results_folder import whole_folder
from biodance.records import Markers, Plate, Session, Trial, Wrench

_FILE = "session.toml"


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
    >>> from biodance.lab.session.write import init_session
    >>> init_session("visit")
    Traceback (most recent call last):
    biodance.errors.SessionRefused: visit/session.toml is there already, and nothing of yours is overwritten. ...
    """
    target = Path(folder) / _FILE
    if target.exists():
        raise SessionRefused(
            f"{target} is there already, and nothing of yours is overwritten. Correct it, or move it away and run this "
            f"again."
        )
    session = read_session(folder, subject_name=subject_name)
    found = _found(session, target)
    lines = [" ".join(line.split()) for line in (*_lines(found), *plate_lines(session), *_begun_map(session, found))]
    write_whole(target, ("\n".join(lines) + "\n").encode())
    return found


def _found(session: Session, target: Path) -> dict[str, Any]:
    """Return what the file will say, as plain values."""
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
    return {
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
    for plate in found["plates"]:
        yield f"# {plate['trial']}: {plate['name']}, TYPE {plate['type']}. {' '.join(plate['decisions'])}".rstrip()


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


_MARK = "registration.json"
"""Name of the file that says that a folder was written by `biodance register`."""
_BESIDE = (".mp", ".vsk", ".enf", ".toml")  # What belongs to a session beside its recordings


def registered_folder(folder: Path, *, force: bool) -> Path:
    """Return the folder for a registered session, which is missing, empty, or with ``force`` an earlier one; nothing is
    made or removed yet.

    Raises
    ------
    SessionRefused
        It is a file, or holds files: others' always, those of an earlier registration without ``force``.
    """
    if folder.exists() and not folder.is_dir():
        raise SessionRefused(f"{folder}: is a file; a session needs a folder. Choose another name.")
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    if files and not (folder / _MARK).is_file():
        raise SessionRefused(
            f"{folder}: holds files that biodance did not write ({files[0].name}). Choose another name."
        )
    if files and not force:
        raise SessionRefused(f"{folder}: holds an earlier registration. Choose another name, or --force.")
    return folder


def write_registered(
    folder: Path, session: Session, trial: Trial, plates: Sequence[Plate], *, said: Mapping[str, Any]
) -> Path:
    """Write ``trial`` (as read, any format) with ``plates`` in the room and on the markers' clock into ``folder``, the
    static trials and the subject's files of its ``session`` beside it, and what was ``said`` of the plates as
    `registration.json`; return the C3D file. An earlier registration in the folder is replaced.

    Frames of markers that the plates do not cover are left out, as C3D holds no unknown force.

    Raises
    ------
    SessionRefused
        The two share no time.
    """
    assert trial.markers is not None
    markers, recorded, rate = _common(trial.markers, plates)
    path, first = folder / f"{trial.source.path.stem}.c3d", trial.source.first_frame
    first += int(np.searchsorted(trial.markers.time, markers.time[0]))
    typed = {"PROCESSING": as_written(trial.measurements)} if trial.measurements else None
    with whole_folder(folder, over=True) as part:
        c3d = part / path.name
        write_c3d(c3d, markers=markers, plates=recorded, analog_rate=rate, parameters=typed, first_frame=first)
        _copy_beside(session, trial, part)
        (part / _MARK).write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
        # What lies in the folder of an earlier registration and was not written by it.
        inside = sorted(folder.iterdir()) if folder.is_dir() else []
        for file in [
            one for one in inside if one.is_dir() or not (one.suffix == ".c3d" or one.name in (*FILES, _MARK))
        ]:
            if not (part / file.name).exists():
                shutil.copy2(file, part / file.name) if file.is_file() else shutil.copytree(file, part / file.name)
    return path


def _copy_beside(session: Session, trial: Trial, folder: Path) -> None:
    """Copy the static trials and the subject's files of a session, without what they say of the plates."""
    own = trial.source.path.parent
    for static in session.of_role("static"):
        if static.source.path != trial.source.path:
            shutil.copyfile(static.source.path, folder / static.source.path.name)
    for file in sorted(own.iterdir()):
        if file.is_file() and file.suffix.lower() in _BESIDE:
            shutil.copyfile(file, folder / file.name)
    for name in FILES:
        if (own.resolve().parent / name).is_file() and not (folder / name).exists():
            shutil.copyfile(own.resolve().parent / name, folder / name)
    # the tables [plates.NAME] of a copied file are about plates as they were before
    for path in (folder / name for name in FILES if (folder / name).is_file()):
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r"(?ms)^\[plates\b.*?(?=^\[[A-Za-z]|\Z)", "", text), encoding="utf-8")


def _common(markers: Markers, plates: Sequence[Plate]) -> tuple[Markers, list[PlateRecording], float]:
    """Return the markers within the plates' time and what the plates record at a whole multiple of their rate."""
    from scipy.interpolate import make_interp_spline

    time = plates[0].wrench.time
    many = max(1, round(plates[0].wrench.rate / markers.rate))
    step = 1.0 / markers.rate
    # A frame is kept where all its samples lie within what the plates recorded.
    kept = np.flatnonzero((markers.time >= time[0]) & (markers.time + (many - 1) / many * step <= time[-1]))
    if kept.size < 2:
        raise SessionRefused("Markers and plates share no time, so there is nothing to write.")
    seen = Markers(markers.names, markers.time[kept], markers.xyz[kept])
    # Every frame and the samples between it and the next.
    fine = (seen.time[:, None] + step / many * np.arange(many)).ravel()
    recordings = []
    for plate in plates:
        value = make_interp_spline(time, plate.wrench.value, k=3)(fine)
        down = plate_axes(plate.corners)[2, 2] < 0  # the order of corners that a plate of TYPE 2 has
        corners = plate.corners if down else plate.corners[[1, 0, 3, 2]]
        recordings.append(plate_recording(replace(plate, corners=corners, wrench=Wrench(fine, np.asarray(value)))))
    return seen, recordings, many * markers.rate
