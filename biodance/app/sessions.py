"""The sessions below the folder of a window, and what is known of each without reading its recordings."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from biodance.app.edits import SessionText
from biodance.batch.run import Ledger, told_of_book
from biodance.batch.summary import SESSIONS, folder_name
from biodance.batch.work import OUTCOME, TABLES, SessionTask, fingerprint_of
from biodance.errors import BiodanceError, refuse_unknown
from biodance.lab.session.archive import archive_folders, visit_date
from biodance.library import parse_json

HISTORY = "history"
"""Folder of the states of every session.toml, in that of the results."""


def results_beside(folder: Path) -> Path:
    """Return where the results of a folder go unless another place is named."""
    return folder.with_name(f"{folder.name}-results")


@dataclass(frozen=True)
class SessionPlace:
    """One session of the window: its ``name`` below the archive, the ``folder`` of its recordings, the folder
    ``results``, and its session.toml (``file``).
    """

    name: str
    folder: Path
    results: Path
    file: SessionText

    def task(self) -> SessionTask:
        """Return the work that gives its results as they should be now."""
        folder, out = os.path.abspath(self.folder), os.path.abspath(self.results)
        return SessionTask(self.name, folder, out, fingerprint_of(self.folder, ()), tables=True)

    def found(self) -> dict[str, Any] | None:
        """Return what became of the session in the last run, whether that is of the recordings as they are now
        (``fresh``), and whether it wrote ``tables``; None where there was none.
        """
        try:
            told = parse_json((self.results / OUTCOME).read_text(encoding="utf-8"))
            row: dict[str, Any] = next(iter(told["rows"]), {})
            found = {"status": str(told["status"]), "reason": str(told["reason"]), "verdict": row.get("verdict") or ""}
            fresh = told["fingerprint"] == fingerprint_of(self.folder, ())
            return found | {"fresh": fresh, "tables": (self.results / TABLES).is_dir()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None


class Archive:
    """The sessions of a ``folder``, which is an archive or one session, with their results in ``out``.

    Raises
    ------
    BiodanceError
        There is no session, or the results would lie among the recordings.
    """

    def __init__(self, folder: Path, out: Path) -> None:
        self.folder, self.out = folder, out
        if out.resolve() in (folder.resolve(), *folder.resolve().parents):
            raise BiodanceError(f"{out}: results must not lie among the recordings. Choose another --out.")
        self._places: dict[str, SessionPlace] = {}
        self.look()
        with told_of_book(out):
            Ledger(out, folder).close()

    def look(self) -> None:
        """Look again which sessions there are."""
        known, here = self._places, self.folder.resolve()
        results = self.out.resolve()
        places = {}
        for path in archive_folders(self.folder)[0]:
            if results in (path.resolve(), *path.resolve().parents):
                continue
            below = path.relative_to(self.folder)
            name = below.as_posix() if below.parts else here.name
            file = SessionText(path, self.out / HISTORY / folder_name(name))
            places[name] = known.get(name) or SessionPlace(name, path, self.out / SESSIONS / folder_name(name), file)
        self._places = places

    def __getitem__(self, name: str) -> SessionPlace:
        """Return a session by its name; UnknownName where there is none, so that no other path can be asked for."""
        refuse_unknown("session of this folder", name, self._places)
        return self._places[name]

    def __iter__(self) -> Iterator[SessionPlace]:
        return iter(self._places.values())

    def __len__(self) -> int:
        return len(self._places)

    def rows(self) -> list[Mapping[str, Any]]:
        """Return one row for each session: ``name``, ``date``, and `SessionPlace.found`."""
        return [{"name": one.name, "date": visit_date(one.folder), "found": one.found()} for one in self]
