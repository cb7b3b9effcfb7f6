"""When, where, by whom and in which condition a session was recorded, as the lab's own files say."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from biodance.errors import BiodanceError
from biodance.lab.session.archive import visit_date
from biodance.lab.session.file import VisitEntry, read_session_file
from biodance.lab.session.recordings import vicon_notes
from biodance.lab.vicon import EclipseNotes


def visit_words(folder: Path, trials: Iterable[str]) -> Mapping[str, str]:
    """Return ``date`` (ISO 8601), ``lab``, ``operator`` and ``condition`` of a session, each "" where nobody says.

    ``[session]`` of session.toml says it; else the Eclipse notes (.enf) of its ``trials``: their descriptions are the
    condition, the day they were made the date.
    """
    try:
        said = read_session_file(folder).visit
    except BiodanceError:
        said = VisitEntry()
    notes = _notes(folder, {name.lower() for name in trials})
    described = dict.fromkeys(one.description for one in notes if one.description)
    made = sorted(filter(None, map(_made, notes)))
    return {
        "date": visit_date(folder) or (made[0] if made else ""),
        "lab": said.lab or "",
        "operator": said.operator or "",
        "condition": said.condition or ", ".join(described),
    }


def _notes(folder: Path, trials: set[str]) -> list[EclipseNotes]:
    if not folder.is_dir():
        return []
    return [one for one in vicon_notes([folder])[0].values() if one.trial.lower() in trials]


def _made(notes: EclipseNotes) -> str:
    """Return the day of ``CREATIONDATEANDTIME=2020,3,5,11,16,0``; "" for another form."""
    found = re.match(r"(\d{4}),(\d{1,2}),(\d{1,2})\b", notes.fields.get("CREATIONDATEANDTIME", ""))
    return "-".join([found[1], found[2].zfill(2), found[3].zfill(2)]) if found else ""
