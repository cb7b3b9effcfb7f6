"""What is done and what is not: one SQLite file in the results' folder, and a lock so that no two runs mix."""

import fcntl
import sqlite3
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

from biodance.batch.work import Outcome, SessionStatus, SessionTask, untold
from biodance.errors import BiodanceError

LEDGER = "ledger.sqlite"
_LOCK = ".running"
_TABLE = """
CREATE TABLE IF NOT EXISTS archive (folder TEXT PRIMARY KEY);
CREATE TABLE IF NOT EXISTS sessions (
    name TEXT PRIMARY KEY, fingerprint TEXT NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL,
    seconds REAL NOT NULL, memory_mb REAL NOT NULL, finished TEXT NOT NULL DEFAULT CURRENT_TIMESTAMP,
    times INTEGER NOT NULL DEFAULT 1
);
"""
_WRITE = """
INSERT INTO sessions (name, fingerprint, status, reason, seconds, memory_mb) VALUES (?, ?, ?, ?, ?, ?)
ON CONFLICT (name) DO UPDATE SET fingerprint = excluded.fingerprint, status = excluded.status, reason = excluded.reason,
    seconds = excluded.seconds, memory_mb = excluded.memory_mb, finished = CURRENT_TIMESTAMP, times = times + 1
"""


class Ledger:
    """The book of one archive's results, open for one run; a context manager.

    Raises
    ------
    BiodanceError
        The folder holds something else, the results of another archive, or another run is writing into it.
    """

    def __init__(self, folder: Path, archive: Path) -> None:
        known = folder / LEDGER
        if folder.exists() and not folder.is_dir():
            raise BiodanceError(f"{folder}: is a file; the results need a folder. Choose another --out.")
        if folder.is_dir() and any(folder.iterdir()) and not known.exists():
            raise BiodanceError(
                f"{folder}: holds files that are not of a batch run; nothing is overwritten. Choose another --out."
            )
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = (folder / _LOCK).open("w", encoding="utf-8")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise BiodanceError(
                f"{folder}: another run is writing here. Wait for it, or choose another --out."
            ) from None
        self._book = sqlite3.connect(known)
        self._book.executescript(_TABLE)
        self._belongs(folder, archive)

    def _belongs(self, folder: Path, archive: Path) -> None:
        with self._book:
            self._book.execute(
                "INSERT INTO archive SELECT ? WHERE NOT EXISTS (SELECT 1 FROM archive)", (str(archive.resolve()),)
            )
        (owner,) = self._book.execute("SELECT folder FROM archive").fetchone()
        if owner != str(archive.resolve()):
            self.close()
            raise BiodanceError(f"{folder}: holds the results of another archive ({owner}). Choose another --out.")

    def open_tasks(self, tasks: Iterable[SessionTask]) -> list[SessionTask]:
        """Return the tasks that are not written down as done with the recordings as they are now."""
        known = dict(self._book.execute("SELECT name, fingerprint FROM sessions"))
        return [task for task in tasks if known.get(task.name) != task.fingerprint]

    def write(self, outcome: Outcome) -> None:
        """Write down what became of a session; it is on disk when this returns."""
        one = outcome
        with self._book:
            self._book.execute(_WRITE, (one.name, one.fingerprint, one.status, one.reason, one.seconds, one.memory_mb))

    def told(self, task: SessionTask) -> Outcome | None:
        """Return what is written down of a session that has no folder of its own (its process died each time)."""
        query = "SELECT fingerprint, status, reason FROM sessions WHERE name = ?"
        row = self._book.execute(query, (task.name,)).fetchone()
        if row is None or row[0] != task.fingerprint:
            return None
        return untold(task.name, row[0], SessionStatus(row[1]), row[2])

    def close(self) -> None:
        """Close the book and let others in."""
        self._book.close()
        self._lock.close()

    def __enter__(self) -> "Ledger":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
