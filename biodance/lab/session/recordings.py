"""Find the recordings in a folder, what belongs to them, and which role each trial plays; leave out the same recording
twice, and those of another person.

Beside them may lie what Vicon Nexus knows: measurements (.mp), skeleton (.vsk), notes on a trial (.enf), in mm and kg;
here they leave in m and kg, under the names of the C3D PROCESSING group (``Bodymass``, ``Height``, ``LLegLength`` ...).
Angles are left out: they are results of the static trial, not measures of the person.
"""

import filecmp
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np

from biodance.discovery import Chosen
from biodance.errors import BiodanceError, FileRefused, SessionRefused
from biodance.lab.plain_text import COMMAS_READ, decode, parse_number, read_bytes, read_text
from biodance.lab.readers import Reader, extensions, read_head, sniffed
from biodance.lab.session.file import SubjectEntry
from biodance.lab.session.subject import declared
from biodance.records import Role, Trial, grouped
from biodance.records.attention import AnotherPerson, Doubt

ANGLES = re.compile(r"torsion|rotation|plantflex|rotoff|abadd|headoffset|^theta$|^beta$|angle", flags=re.IGNORECASE)


def read_mp(path: str | Path) -> dict[str, float]:
    """Return the measurements of an .mp file, rows such as ``$Bodymass = 66.2``: by name, in m and kg.

    Rows that hold no number (a name, a comment) are passed over; zeros mean "not measured" and are left out.

    Raises
    ------
    FileRefused
        Missing, empty, binary, or without a single ``$Name = number``.
    """
    path = Path(path)
    rows = re.findall(r"^\s*\$(\w+)\s*=\s*([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*$", read_text(path), flags=re.MULTILINE)
    if not rows:
        raise FileRefused(
            f"{path}: holds no row such as '$Bodymass = 66.2'. Save the subject's measurements again in Nexus."
        )
    return _in_si({name: parse_number(value.replace(",", "."), f"{path}, {name}") for name, value in rows})


def read_vsk(path: str | Path) -> dict[str, float]:
    """Return the measurements that were typed into a .vsk skeleton (its static parameters with a value): by name, in m
    and kg.

    ``LeftLegLength`` is called ``LLegLength`` here, as in .mp and C3D files. Values that Nexus computes (read-only) are
    left out.

    Raises
    ------
    FileRefused
        Missing, empty, no XML, or no Vicon skeleton.
    """
    path = Path(path)
    text = decode(read_bytes(path), path)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FileRefused(f"{path}: declares XML entities, which no Vicon skeleton does. Export it again from Nexus.")
    try:
        root = ElementTree.fromstring(re.sub(r"^\s*<\?xml.*?\?>", "", text, flags=re.DOTALL))
    except ElementTree.ParseError as error:
        raise FileRefused(f"{path}: is not valid XML ({error}). Export the skeleton again from Nexus.") from error
    if root.tag != "KinematicModel":
        raise FileRefused(
            f"{path}: its root is <{root.tag}>, a Vicon skeleton begins with <KinematicModel>. Export it again from "
            f"Nexus."
        )
    typed: dict[str, float] = {}
    for parameter in root.iter("StaticParameter"):
        name, value = parameter.get("NAME", ""), parameter.get("VALUE", "")
        computed = parameter.get("READONLY", "").lower() in ("1", "true")
        if name and value and not computed and parameter.get("QUANTITY", "length") in ("length", "mass"):
            typed[name] = parse_number(value, f"{path}, {name}")
    return _in_si(typed)


@dataclass(frozen=True)
class EclipseNotes:
    """What the operator noted on a trial in Vicon Eclipse.

    ``trial`` name without ending; ``type`` such as "Static" or "Dynamic" ("" = not said); ``description`` the
    condition; ``notes`` free text; ``plates`` what the operator found of each plate, ``FP1`` -> "Auto", "Left", "Right"
    or "Invalid"; ``fields`` everything else.
    """

    trial: str
    type: str = ""
    description: str = ""
    notes: str = ""
    plates: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, str] = field(default_factory=dict)


def read_enf(path: str | Path) -> EclipseNotes:
    """Return the notes of one ``<trial>.Trial.enf`` (or ``<trial>.Trial12.enf``) file; a file without any entry gives
    empty notes.

    The rows are taken as they come (a note may hold any character), the encoding is found by itself, keys count without
    case.

    Raises
    ------
    FileRefused
        Missing, empty or binary.
    """
    path = Path(path)
    fields: dict[str, str] = {}
    node_type = ""
    section = ""
    for row in read_text(path).splitlines():
        if found := re.match(r"\s*\[(.*)\]\s*$", row):
            section = found[1].strip().upper()
        elif "=" in row:
            key, value = (part.strip() for part in row.split("=", 1))
            if section == "NODE INFORMATION" and key.upper() == "TYPE":
                node_type = value  # the kind of the node (TRIAL, SESSION), not of the trial
            else:
                fields[key.upper()] = value
    plates = {key: fields.pop(key) for key in sorted(fields) if re.fullmatch(r"FP\d+", key)}
    kind = fields.pop("TYPE", "") or fields.pop("TRIAL_TYPE", "")
    if not kind and node_type.upper() not in ("TRIAL", "SESSION", "SUBJECT", "PROJECT", "PATIENT"):
        kind = node_type
    trial = re.sub(r"(?:\.Trial\d*)?\.enf$", "", path.name, flags=re.IGNORECASE)
    said = (fields.pop("DESCRIPTION", ""), fields.pop("NOTES", ""))
    return EclipseNotes(trial, kind, *said, MappingProxyType(plates), MappingProxyType(fields))


def _in_si(values: dict[str, float]) -> dict[str, float]:
    """Return lengths (m) and masses (kg) by the names of the PROCESSING group, no angles, flags and zeros."""
    measures: dict[str, float] = {}
    for name, value in values.items():
        short = re.sub(r"^(Left|Right)(?=[A-Z])", lambda side: side[1][0], name)
        none = re.search(r"usefloorff|hindfootflat|^(?:subject)?(?:name|id)$", short, flags=re.IGNORECASE)
        if value == 0 or ANGLES.search(short) or none:
            continue
        measures[short] = value if short.lower() == "bodymass" else value * 1e-3
    return measures


def role_by_name(name: str) -> Role | None:
    """Return "static" for static* and cal*, "validate" for squat*, as a word anywhere in the name; None if the name
    says nothing.

    Words end where letters end and where upper case begins: ``CB_Static0001``, ``WalkSquat2``; ``calf_raise`` is no
    calibration.
    """
    words = [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
    if {"cal", "calib", "calibration", "tpose", "npose"} & {*words} or any(word.startswith("static") for word in words):
        return "static"
    return "validate" if {"squat", "squats"} & {*words} else None


TEXT = (".txt", ".csv", ".tsv")
"""Extensions that notes and tables for people have, too: there the content decides."""
RESULTS = ("results.json", "report.html", "results.partial.json")
"""Files by which a folder with results of biodance is known."""
_OWN_FILES = ("session.toml", "subject.toml")


def find_recordings(folder: Path, readers: Chosen[Reader] = None) -> tuple[list[Path], list[str]]:
    """Return the recordings of a session, sorted by name, and notes on what was left aside; a file is read alone.

    They lie in the folder itself and in its parts (folders such as ``Static``, ``Straight``, ``MarkerData``). Folders
    that are sessions of their own (a static trial and others, or a session.toml, in more than one place) are left aside
    and named. A table of forces that belongs to a .trc file is no recording of its own; of one trial in several formats
    the C3D file is taken; text that holds no table of numbers is none.
    """
    if folder.is_file():
        return [folder], [f"{folder.name} was read alone."]
    files, order = recordings_in(folder, readers), list(extensions(readers))
    more, notes = _in_parts(folder, files, readers)
    kept: dict[tuple[Path, str], Path] = {}
    trials = _without_companions([*files, *more], readers)
    for file in sorted(trials, key=lambda f: (order.index(f.suffix.lower()), not _beside(f, readers), str(f))):
        trial = (file.parent, file.stem.lower())
        # ordinary files only: a pipe is not opened, and a broken link is left to its reader
        alike = [one for one in kept.values() if one.name == file.name and one.is_file() and file.is_file()]
        alike = [one for one in alike if one.stat().st_size == file.stat().st_size]
        twin = next((one for one in alike if filecmp.cmp(one, file, shallow=False)), None)
        if trial in kept:
            notes.append(f"{file.name} was left aside: it is the same trial as {kept[trial].name}.")
        elif twin is not None:
            notes.append(f"{file.relative_to(folder)} was left aside: it is a copy of {twin.relative_to(folder)}.")
        else:
            kept[trial] = file
    return sorted(kept.values()), notes


def _in_parts(folder: Path, own: list[Path], readers: Chosen[Reader]) -> tuple[list[Path], list[str]]:
    """Return the recordings in the parts of a session folder, and a sentence for every folder that is none."""
    parts, notes = {}, []
    for part in sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")):
        found = recordings_below(part, readers)
        if found and _holds_any(part, RESULTS):
            notes.append(f"The folder {part.name} was left aside: it holds results of biodance.")
        elif found:
            parts[part] = found
    several = len(parts) > 1
    trials = set(_without_companions([*own, *(file for found in parts.values() for file in found)], readers))
    parts = {part: own_trials for part, found in parts.items() if (own_trials := [f for f in found if f in trials])}
    for part in _sessions_of_their_own(parts, own, beside=bool(own) or several):
        count = len(parts.pop(part))
        notes.append(
            f"The folder {part.name} ({count} recordings) was left aside: it is a session of its own. Point at it to "
            f"read it."
        )
    return [file for found in parts.values() for file in found], notes


def _sessions_of_their_own(parts: Mapping[Path, list[Path]], own: list[Path], *, beside: bool) -> list[Path]:
    """Return the parts that are sessions of their own: those that say so; the others only if there are static trials in
    more than one place, or nothing is ``beside`` them.
    """
    whole = []
    for part, found in parts.items():
        roles = [role_by_name(file.stem) or role_by_name(file.parent.name) for file in found]
        if _holds_any(part, _OWN_FILES) or ("static" in roles and any(role != "static" for role in roles)):
            whole.append(part)
    places = len(whole) + any(role_by_name(file.stem) == "static" for file in own)
    return [part for part in whole if _holds_any(part, _OWN_FILES)] if places < 2 and beside else whole


def _holds_any(folder: Path, names: Iterable[str]) -> bool:
    return any((folder / name).is_file() for name in names)


def recordings_in(folder: Path, readers: Chosen[Reader] = None) -> list[Path]:
    """Return the files directly in a folder whose extension or content says they are recordings, by name."""
    legal = extensions(readers)
    files = (path for path in sorted(folder.iterdir()) if not path.is_dir() and not path.name.startswith("."))
    found = [path for path in files if path.suffix.lower() in legal]
    return [path for path in found if path.suffix.lower() not in TEXT or _is_data(path, readers)]


def recordings_below(folder: Path, readers: Chosen[Reader] = None) -> list[Path]:
    """Return the recordings in a folder and below it, by path, without tables that belong to a .trc file."""
    folders = [folder, *(path for path in sorted(folder.rglob("*")) if path.is_dir() and not path.name.startswith("."))]
    return sorted(_without_companions([file for place in folders for file in recordings_in(place, readers)], readers))


def vicon_notes(folders: Iterable[Path]) -> tuple[dict[str, EclipseNotes], dict[str, dict[str, float]], dict[str, str]]:
    """Return Eclipse notes by trial name (lower case), measurements (m, kg) by file, refused files and why."""
    eclipse: dict[str, EclipseNotes] = {}
    measurements: dict[str, dict[str, float]] = {}
    refused: dict[str, str] = {}
    for file in (path for folder in sorted(folders) for path in sorted(folder.iterdir()) if path.is_file()):
        try:
            if re.search(r"\.trial\d*\.enf$", file.name, flags=re.IGNORECASE):
                notes = read_enf(file)
                eclipse[notes.trial.lower()] = notes
            elif file.suffix.lower() in (".mp", ".vsk"):
                measurements[file.name] = read_mp(file) if file.suffix.lower() == ".mp" else read_vsk(file)
        except BiodanceError as error:
            refused[file.name] = str(error)
    return eclipse, dict(sorted(measurements.items(), key=lambda item: not item[0].lower().endswith(".mp"))), refused


def _without_companions(files: list[Path], readers: Chosen[Reader]) -> list[Path]:
    companions = {other for file in files if (other := _beside(file, readers))}
    return [file for file in files if file not in companions]


def _is_data(file: Path, readers: Chosen[Reader]) -> bool:
    """Return whether the content of a .txt or .csv file is a recording: no notes, no export for people."""
    try:
        return sniffed(file, read_head(file), readers) is not None
    except BiodanceError:
        return False


def _beside(file: Path, readers: Chosen[Reader]) -> Path | None:
    """Return the file that the reader of ``file``, by its extension, reads together with it; None if there is none."""
    beside = getattr(extensions(readers)[file.suffix.lower()], "beside", None)
    try:
        return beside(file) if beside else None
    except BiodanceError:
        return None


ANOTHER_STATURE = 1.04
"""Ratio of two statures from which on they are of two people, or of one who grew."""
_PEOPLE = (("mass", "kg", 1.1), ("stature", "m", ANOTHER_STATURE))
"""What files declare of a person: name, unit, and from which ratio on it is somebody else's."""


def each_once(trials: Sequence[Trial], notes: list[str]) -> list[Trial]:
    """Return the trials without second copies of a file, which would count twice; ``notes`` says which were left aside.

    Of two copies the static trial stays, else the one of the shorter name. A reader of one's own need not say what
    bytes it read.
    """
    held = {id(trial): trial.source.sha256 or f"{trial.source.path} {trial.name}" for trial in trials}
    first: dict[str, Trial] = {}
    for trial in sorted(trials, key=lambda one: (one.role != "static", len(one.name), one.name)):
        kept = first.setdefault(held[id(trial)], trial)
        if kept is not trial:
            notes.append(
                Doubt(
                    f"{trial.source.path.name} holds the same bytes as {kept.source.path.name} and was left aside, or "
                    "it would count twice",
                    "Move one of the two away.",
                )
            )
    return [trial for trial in trials if first[held[id(trial)]] is trial]


def of_one_person(trials: Sequence[Trial], typed: SubjectEntry) -> tuple[list[Trial], dict[str, str]]:
    """Return the trials of the person of the static trial, and by file why others are refused: they declare another
    mass or stature. What was ``typed`` in session.toml is believed of all of them.
    """
    static = next((trial for trial in trials if trial.role == "static"), None)
    if static is None:
        return list(trials), {}
    strangers: dict[str, str] = {}
    for (of, unit, alike), known in zip(_PEOPLE, (typed.mass_kg, typed.height_m), strict=True):
        right = declared(static.measurements, of)
        if known is not None or not math.isfinite(right):
            continue
        for trial in trials:
            value = declared(trial.measurements, of)
            if max(value / right, right / value) > alike:
                strangers.setdefault(
                    trial.source.path.name,
                    AnotherPerson(
                        f"declares another person: {of} {value:.4g} {unit}, but {right:.4g} {unit} in the static trial "
                        f"{static.name}. Move it to that person's session; if it is the same one, write "
                        f"{'mass_kg' if unit == 'kg' else 'height_m'} in session.toml."
                    ),
                )
    return [trial for trial in trials if trial.source.path.name not in strangers], strangers


def forces_apart(trials: Sequence[Trial]) -> list[str]:
    """Return a sentence for every table of forces without markers that covers the time of one .trc file without forces:
    what to call it, so that the two are read together.
    """
    said: list[str] = []
    alone = [one for one in trials if one.source.format == "TRC"]
    for forces in (one for one in trials if one.source.format == "MOT" and one.plates):
        span = forces.plates[0].wrench.time[[0, -1]]
        times = [(one, one.markers.time[[0, -1]]) for one in alone if one.markers is not None]
        # Markers and forces of one recording, exported by two programs, may begin 0.1 s apart and differ by 2 %.
        near = [one for one in times if abs(one[1][0] - span[0]) < 0.1]
        fits = [one for one, time in near if abs(np.ptp(time) - np.ptp(span)) < 0.02 * np.ptp(span) + 0.02]
        if len(fits) == 1:
            file, name = forces.source.path, f"{fits[0].source.path.stem}_grf{forces.source.path.suffix}"
            said.append(
                Doubt(
                    f"{file.name} looks like the forces of {fits[0].source.path.name}: both cover {span[0]:.2f} to "
                    f"{span[1]:.2f} s",
                    f"Rename it {name}, and they are read together.",
                )
            )
    return said


def decimal_commas(trials: Sequence[Trial]) -> list[str]:
    """Return one sentence for all files whose numbers have decimal commas."""
    read = [one.source.path.name for one in trials if COMMAS_READ in one.history]
    more = f" and {len(read) - 1} more" if len(read) > 1 else ""
    return [f"{COMMAS_READ.removesuffix('.')} ({read[0]}{more})."] if read else []


def refuse_several_people(folder: Path, trials: Sequence[Trial], typed: SubjectEntry) -> None:
    """Raise SessionRefused where the recordings of two parts of a session declare masses or statures of two people;
    what was ``typed`` in session.toml is believed of all of them.
    """
    for (of, unit, alike), told in zip(_PEOPLE, (typed.mass_kg, typed.height_m), strict=True):
        if told is not None:
            continue
        values = ((trial.source.path.parent, declared(trial.measurements, of)) for trial in trials)
        parts = grouped((part, value) for part, value in values if math.isfinite(value))
        known = sorted((median(values), part.name) for part, values in parts.items())
        if known and known[-1][0] > alike * known[0][0]:
            raise SessionRefused(
                f"{folder}: its folders hold several people: {of} {known[0][0]:.4g} {unit} in {known[0][1]}, "
                f"{known[-1][0]:.4g} {unit} in {known[-1][1]}. Point at one of them; `biodance batch` goes through all."
            )
