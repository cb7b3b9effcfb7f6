"""What lies in the archive of a laboratory: session folders, and tables that tell whose recordings lie beside them."""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from pathlib import Path

import numpy as np

from biodance.errors import BiodanceError, FileRefused, SessionRefused
from biodance.lab.plain_text import (
    COMMAS_READ,
    cells,
    parse_number,
    plain_table,
    read_bytes,
    read_text,
    sha256,
    with_points,
)
from biodance.lab.plates import FORCE, MOMENT, plain_unit
from biodance.lab.readers import extensions
from biodance.lab.session.file import read_session_file
from biodance.lab.session.recordings import recordings_in
from biodance.records import CHANNELS, Plate, Source, Trial, Wrench, grouped

NAMES = ("trials.csv", "recordings.csv", "index.csv")
"""Files that are looked for."""
_COLUMNS = {
    "trial": ("trial", "recording", "file", "filename"),
    "person": ("person", "subject", "participant", "patient", "subject_id", "id"),
    "date": ("date", "datetime", "day", "recorded"),
    "mass": ("mass_kg", "weight_kg", "body_mass_kg", "mass", "weight"),
    "visit": ("visit", "session"),
}
"""What a table may call its columns."""
_CHANNEL = re.compile(r"\s*\"?(time|t|[FM][xyz])\s*[\[(]?\s*([\w·.]*)\s*[\])]?", flags=re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class IndexedTrial:
    """One row: the ``path`` of its recording, ``person``, ``visit``, ``date`` as written ("" = not said), declared
    ``mass`` kg (NaN = not said), ``conditions``.
    """

    path: Path
    person: str
    visit: str
    date: str
    mass: float
    conditions: Mapping[str, str] = field(default_factory=dict)


def _index_of(folder: Path) -> Path | None:
    """Return the table of a folder, None without one: a file of a known name with columns for trial and person."""
    for name in NAMES:
        path = folder / name
        if path.is_file():
            header = {cell.strip().lower() for cell in _rows(path)[0]}
            if header & {*_COLUMNS["trial"]} and header & {*_COLUMNS["person"]}:
                return path
    return None


def read_index(path: Path) -> tuple[IndexedTrial, ...]:
    """Return the rows of a table in their order; rows whose recording is not there are left out.

    Raises
    ------
    FileRefused
        It is no table, lacks a column, or no recording that it names is there.
    """
    header, *rows = _rows(path)
    names = [cell.strip().lower() for cell in header]
    column = {kind: next((name for name in some if name in names), "") for kind, some in _COLUMNS.items()}
    trials = []
    for cells_of_row in filter(any, rows):
        row = dict(zip(names, (cell.strip() for cell in cells_of_row), strict=False))
        trial, person, said, mass, visit = (row.get(column[kind], "") for kind in _COLUMNS)
        # with or without its extension, and never outside the folder
        names_file = bool(trial) and Path(trial).name == trial
        files = [path.parent / f"{trial}{ending}" for ending in ("", *extensions())] if names_file else []
        recording = next(filter(Path.is_file, files), None)
        if recording is not None:
            visit = visit or " ".join(filter(None, (person, said[:16])))
            trials.append((IndexedTrial(recording, person, visit, said, _number(mass)), row))
    if not trials:
        raise FileRefused(
            f"{path}: names no recording that lies beside it. Check the column {column['trial'] or 'trial'}."
        )
    differing = _conditions(trials, [name for name in names if name not in column.values()])
    return tuple(replace(one, conditions={name: row[name] for name in differing}) for one, row in trials)


def _rows(path: Path) -> list[list[str]]:
    return list(csv.reader(read_text(path).splitlines())) or [[]]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _conditions(trials: list[tuple[IndexedTrial, dict[str, str]]], names: list[str]) -> list[str]:
    """Return the columns that name kinds of trial: few values, and different ones within a visit."""
    chosen = []
    for name in names:
        values = {row.get(name, "") for _, row in trials}
        visits = grouped((one.visit, row.get(name, "")) for one, row in trials)
        # Different values up to which a column names conditions
        if 1 < len(values) <= 6 and any(len(set(some)) > 1 for some in visits.values()):
            chosen.append(name)
    return chosen


def read_plate_text(path: Path) -> Trial:
    """Return a recording of one plate in its own axes, turned so that a load pushes the person up; its corners, which
    the text does not tell, are NaN.

    Raises
    ------
    FileRefused
        The header does not name six channels with units that are known, or a cell is no number.
    """
    text, commas = with_points(read_text(path))
    lines = [line for line in text.splitlines() if line.strip()]
    columns: dict[str, tuple[int, float]] = {}
    for i, cell in enumerate(_cells(lines[0])):
        name = _CHANNEL.fullmatch(cell)
        if name:
            key = "time" if name[1].lower() in ("time", "t") else name[1].capitalize()
            columns.setdefault(key, (i, _factor(key, name[2], path)))
    if lacking := [name for name in ("time", *CHANNELS) if name not in columns]:
        raise FileRefused(
            f"{path}: its header does not name {', '.join(lacking)}. Write a first line such as Time[s], Fx[N], Fy[N], "
            f"Fz[N], Mx[Nm], My[Nm], Mz[Nm]."
        )
    raw = plain_table(lines[1:], len(_cells(lines[0])))
    if raw is None:
        rows = ((f"{path}, line {k}", _cells(line)) for k, line in enumerate(lines[1:], start=2))
        raw = np.array([[parse_number(cell, where) for cell in row] for where, row in rows])
    time, *value = (raw[:, i] * factor for i, factor in (columns[name] for name in ("time", *CHANNELS)))
    wrench = np.column_stack(value)
    sign = -1.0 if wrench[:, 2].mean() < 0 else 1.0
    said = "Signs as written" if sign > 0 else "All signs turned, so that a load pushes the person up"
    how = f"{said}; the table does not tell where the plate lies: axes and origin are the plate's own."
    plate = Plate("plate1", 0, np.full((4, 3), np.nan), Wrench(np.asarray(time), sign * wrench), (how,))
    source = Source(path, sha256(read_bytes(path)), "text")
    return Trial(path.stem, "fit", None, (plate,), source, history=(*[COMMAS_READ] * commas, how))


def _cells(line: str) -> list[str]:
    return cells(line) if "," not in line and ";" not in line else [cell.strip() for cell in re.split("[,;]", line)]


def _factor(channel: str, unit: str, path: Path) -> float:
    """Return what a channel's numbers are multiplied with: to s, N, N·m."""
    legal = {"s": 1.0, "ms": 1e-3} if channel == "time" else FORCE if channel[0] == "F" else MOMENT
    usual = {"t": "s", "F": "N", "M": "Nm"}[channel[0]]
    try:
        return float(legal[unit or usual] if channel == "time" else legal[plain_unit(unit or usual)])
    except KeyError:
        raise FileRefused(f"{path}: the unit {unit!r} of {channel} is not known. Legal: {', '.join(legal)}.") from None


_PART_FOLDERS = re.compile(
    r"static|straight|turn|cal|dynamic|trials?|fit|validat|squat|walk|movement|recordings?|markerdata|forcedata|id$",
    flags=re.IGNORECASE,
)
"""Names of folders that are parts of a session, not sessions."""


def archive_folders(archive: str | Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Return the session folders of an archive at any depth, and the tables (`biodance.lab.session.archive`) of folders
    whose recordings say nothing by themselves, both sorted.

    A folder with recordings, or with parts such as ``static`` and ``dynamic`` that hold them, is a session.

    Raises
    ------
    SessionRefused
        There is no such folder, or nothing in it.
    """
    archive = archive_folder(archive)
    sessions: list[Path] = []
    indices: list[Path] = []
    _collect(archive, sessions, indices)
    if not sessions and not indices:
        raise SessionRefused(
            f"{archive}: holds no session: no folder with recordings, and no trials.csv beside text files."
        )
    return tuple(sessions), tuple(indices)


def archive_folder(archive: str | Path) -> Path:
    """Return the path of an archive; SessionRefused if it is no folder."""
    archive = Path(archive)
    if not archive.is_dir():
        raise SessionRefused(f"{archive}: is no folder. Give the folder that holds the sessions of a laboratory.")
    return archive


def _collect(folder: Path, sessions: list[Path], indices: list[Path]) -> None:
    """Add what lies in ``folder`` and below it."""
    index = _index_of(folder)
    if index is not None:
        indices.append(index)
        return
    above = folder.resolve()
    below = [path for path in sorted(folder.iterdir()) if path.is_dir() and not path.name.startswith(".")]
    # below a link to a folder above there would be no end
    below = [path for path in below if not (path.is_symlink() and above.is_relative_to(path.resolve()))]
    parts = [path for path in below if _PART_FOLDERS.match(path.name) and recordings_in(path)]
    if parts or recordings_in(folder):
        sessions.append(folder)
    for path in below:
        if path not in parts:
            _collect(path, sessions, indices)


def visit_date(folder: Path) -> str:
    """Return when a session was recorded, ISO 8601: as ``[session] date`` of session.toml says, else as the folder's
    name (or that of the folder above) contains it; "" where nobody says.
    """
    try:
        said = read_session_file(folder).visit.date
    except BiodanceError:
        said = None
    if said is not None:
        return iso_date(said)
    year_month_day = r"(?<!\d)((?:19|20)\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)"
    for name in (folder.resolve().name, folder.resolve().parent.name):
        if found := re.search(year_month_day, name):
            return "-".join(found.groups())
    return ""


def iso_date(said: str | date | datetime) -> str:
    """Return a date as ISO 8601 to the minute; "" for text that is none, for nobody knows whether 3/4 is in March."""
    if isinstance(said, datetime):
        return said.isoformat(sep=" ", timespec="minutes")
    if isinstance(said, date):
        return said.isoformat()
    text = said.strip()
    try:
        return iso_date(date.fromisoformat(text) if len(text) <= 10 else datetime.fromisoformat(text))
    except ValueError:
        return ""
