"""OpenSim's table of markers, with the forces in a table of the same stem beside it."""

import re
from dataclasses import replace
from itertools import product
from pathlib import Path

from biodance.errors import FileRefused
from biodance.lab.opensim.mot import TimeTable, columns_of, read_mot
from biodance.lab.opensim.plate_columns import has_plates, plates_of
from biodance.lab.opensim.trc import read_trc
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.readers import head_text
from biodance.lab.readers.mot import plates_rate
from biodance.records import Role, Trial

NAME = "markers of OpenSim"
EXTENSIONS = (".trc",)
PREFERENCE = 10
_FORCES_BESIDE = ("", "_grf", "_GRF", "_forces", "_ground_forces")
_TABLES = (".mot", ".sto")

_MARKER_FOLDER = re.compile(r"marker|mocap|trc", flags=re.IGNORECASE)
_FORCE_FOLDER = re.compile(r"force|grf|^id$|kinetic|^mot$|inverse.?dynamics", flags=re.IGNORECASE)


def sniff(head: bytes) -> bool:
    """Return whether the head begins with "PathFileType"."""
    return head_text(head).startswith("PathFileType")


def read(path: Path, *, role: Role, subject: str | None = None) -> Trial:
    """Return the trial of a .trc file; with plates where a table of forces lies beside it."""
    trial = read_trc(path, role=role)
    forces = beside(path)
    return _with_forces(trial, forces) if forces else trial


def beside(path: Path) -> Path | None:
    """Return the .mot or .sto file with plate columns that belongs to a .trc file (or should, but is damaged), in its
    folder or in the one for forces beside it (MarkerData/ and ForceData/ or ID/); None if there is none.

    It has the stem of the markers with a usual ending, else it is the only one whose stem goes on behind theirs.
    """
    places = (path.parent, *_places_of_forces(path.parent))
    for place in places:
        for ending, suffix in product(_FORCES_BESIDE, _TABLES):
            candidate = place / f"{path.stem}{ending}{suffix}"
            if candidate.is_file() and _may_hold_forces(candidate):
                return candidate
    longer = [table for place in places for table in _going_on(path, place) if _may_hold_forces(table)]
    return longer[0] if len(longer) == 1 else None


def _may_hold_forces(table: Path) -> bool:
    """Return whether a table has plate columns, or is damaged."""
    try:
        return has_plates(columns_of(table))
    except FileRefused:
        return True


def _going_on(markers: Path, place: Path) -> list[Path]:
    """Return the tables of a folder whose stem is that of the markers and more (``walk_GRF_2plates`` for ``walk``, not
    ``walk2``), and of no other markers with a longer stem.
    """
    stems = [path.stem for path in markers.parent.glob("*.trc")]

    def fits(stem: str, table: Path) -> bool:
        return table.stem.startswith(stem) and not table.stem[len(stem) : len(stem) + 1].isalnum()

    tables = [path for path in sorted(place.iterdir()) if path.suffix.lower() in _TABLES and path.is_file()]
    own = [table for table in tables if fits(markers.stem, table) and table.stem != markers.stem]
    return [table for table in own if not any(len(s) > len(markers.stem) and fits(s, table) for s in stems)]


def _places_of_forces(markers: Path) -> list[Path]:
    """Return the folders for forces beside a folder for markers; none where the folder is no such one."""
    if not _MARKER_FOLDER.search(markers.name):
        return []
    return [path for path in sorted(markers.parent.iterdir()) if path.is_dir() and _FORCE_FOLDER.search(path.name)]


def _with_forces(trial: Trial, path: Path) -> Trial:
    """Return the trial with the plates of the table beside it; a damaged table is a warning, the markers stay."""
    try:
        table = read_mot(path)
        plates, said, doubts = plates_of(table, where=str(path))
    except FileRefused as error:
        return replace(trial, warnings=(*trial.warnings, f"The forces beside the markers were left out. {error}"))
    digest = sha256((trial.source.sha256 + sha256(read_bytes(path))).encode())
    source = replace(trial.source, format="TRC + MOT", sha256=digest, analog_rate=plates_rate(plates))
    history = tuple(dict.fromkeys((*trial.history, f"Forces were read from {path.name} beside it.", *said)))
    warnings = (*trial.warnings, *table.warnings, *doubts, *_out_of_step(trial, table))
    return replace(trial, plates=plates, source=source, history=history, warnings=warnings)


def _out_of_step(trial: Trial, table: TimeTable) -> list[str]:
    """Return a warning if markers and forces do not cover the same time."""
    assert trial.markers is not None  # a .trc file always holds markers
    time = trial.markers.time
    overlap = min(time[-1], table.time[-1]) - max(time[0], table.time[0])
    if overlap >= 0.9 * (time[-1] - time[0]):
        return []
    span = f"{time[0]:g} to {time[-1]:g} s, the forces {table.time[0]:g} to {table.time[-1]:g} s"
    return [f"The markers cover {span}: they may not belong together."]
