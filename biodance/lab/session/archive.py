"""What lies in the archive of a laboratory: session folders, and tables that tell whose recordings lie beside them."""

import re
from datetime import date, datetime
from pathlib import Path

from biodance.errors import BiodanceError, SessionRefused
from biodance.lab.session.file import read_session_file
from biodance.lab.session.index import index_of
from biodance.lab.session.recordings import recordings_in

_PART_FOLDERS = re.compile(
    r"static|straight|turn|cal|dynamic|trials?|fit|validat|squat|walk|movement|recordings?|markerdata|forcedata|id$",
    flags=re.IGNORECASE,
)
"""Names of folders that are parts of a session, not sessions."""
_IN_NAME = re.compile(r"(?<!\d)((?:19|20)\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)")
"""Year, month and day in the name of a folder."""


def archive_folders(archive: str | Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Return the session folders of an archive at any depth, and the tables (`biodance.lab.session.index`) of folders
    whose recordings say nothing by themselves, both sorted.

    A folder with recordings, or with parts such as ``static`` and ``dynamic`` that hold them, is a session.

    Raises
    ------
    SessionRefused
        There is no such folder, or nothing in it.
    """
    archive = Path(archive)
    if not archive.is_dir():
        raise SessionRefused(f"{archive}: is no folder. Give the folder that holds the sessions of a laboratory.")
    sessions: list[Path] = []
    indices: list[Path] = []
    _collect(archive, sessions, indices)
    if not sessions and not indices:
        raise SessionRefused(
            f"{archive}: holds no session: no folder with recordings, and no trials.csv beside text files."
        )
    return tuple(sessions), tuple(indices)


def _collect(folder: Path, sessions: list[Path], indices: list[Path]) -> None:
    """Add what lies in ``folder`` and below it."""
    index = index_of(folder)
    if index is not None:
        indices.append(index)
        return
    below = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
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
    for name in (folder.resolve().name, folder.resolve().parent.name):
        if found := _IN_NAME.search(name):
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
