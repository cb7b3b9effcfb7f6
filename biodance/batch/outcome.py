"""What became of one session of an archive, kept in its folder: done, refused or failed, and whether that is final."""

import hashlib
import math
import os
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from biodance.errors import FileRefused
from biodance.lab.session.file import FILES
from biodance.lab.session.results_folder import read_manifest, refuse_mixture
from biodance.library import parse_json
from biodance.version import __version__

OUTCOME = "outcome.json"
"""In a session's folder: where it and the manifest are, the session is done."""
TABLES = "tables"
"""Folder of a session's tables, in that of its results."""
TrialRows = tuple[dict[str, Any], ...]
"""One row of plain values for each trial."""


class Why(StrEnum):
    """What a result hangs on. Only what hangs on the recordings is final: the machine may have room another time, the
    limit may be higher then.
    """

    SESSION = "session"
    MACHINE = "machine"
    LIMIT = "limit"


class SessionStatus(StrEnum):
    """What became of a session. Refused: the recordings cannot be used. Failed: biodance, or the machine, did not get
    through.
    """

    DONE = "done"
    NEEDS_A_PERSON = "needs a person"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True)
class SessionTask:
    """One session to go through.

    Parameters
    ----------
    name : str
        The session's folder below the archive.
    session, out : str
        Folders of the recordings and of the results.
    fingerprint : str
        Of the recordings, the settings and the version (`fingerprint_of`).
    chosen : tuple of str
        Settings, such as ``filter.cutoff=6``.
    pages : bool
        Whether the page is drawn; numbers are written always.
    limit : float
        s after which the session is given up.
    tables : bool
        Whether the results are also written as tables, into the folder `TABLES`.
    """

    name: str
    session: str
    out: str
    fingerprint: str
    chosen: tuple[str, ...] = ()
    pages: bool = True
    limit: float = 1800.0
    tables: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of one session.

    Parameters
    ----------
    name, fingerprint : str
        Of its `SessionTask`.
    status : SessionStatus
        What became of it.
    reason : str
        Why, where it is not done; else the first thing that a person must see.
    rows : tuple of dict
        One for each trial, of plain values.
    seconds, memory_mb : float
        It took, and the process had at most.
    why : Why
        What it hangs on.
    limit : float
        s that it was given.
    """

    name: str
    fingerprint: str
    status: SessionStatus
    reason: str = ""
    rows: TrialRows = ()
    seconds: float = 0.0
    memory_mb: float = 0.0
    why: Why = Why.SESSION
    limit: float = math.inf

    def is_final(self, task: SessionTask) -> bool:
        """Return whether doing the ``task`` again, as it is asked for now, would give the same."""
        same = self.fingerprint == task.fingerprint
        same &= not task.tables or self.unread or (Path(task.out) / TABLES).is_dir()
        return same and (self.why is Why.SESSION or (self.why is Why.LIMIT and task.limit <= self.limit))

    @property
    def unread(self) -> bool:
        """Whether nothing can be said of the session."""
        return self.status in (SessionStatus.REFUSED, SessionStatus.FAILED)


def untold(task: SessionTask, status: SessionStatus, reason: str, why: Why) -> Outcome:
    """Return the outcome of a session of which nothing but the reason can be told."""
    return Outcome(task.name, task.fingerprint, status, reason, only_row(status, reason), why=why, limit=task.limit)


def only_row(status: SessionStatus, reason: str) -> TrialRows:
    """Return the one row of a session of which nothing but the reason can be told."""
    return ({"trial": "", "status": str(status), "reason": reason},)


def fingerprint_of(session: Path, chosen: tuple[str, ...]) -> str:
    """Return what changes when recordings, settings or version change: of names, sizes and times of the files, those
    that tell of the subject in the folder above included.
    """
    seen = hashlib.sha256(repr((__version__, sorted(chosen))).encode())
    above = (session.resolve().parent / name for name in FILES)
    for path in (*sorted(session.rglob("*")), *above):
        if path.is_file():
            known, name = path.stat(), os.path.relpath(path, session)
            seen.update(repr((name, known.st_size, known.st_mtime_ns)).encode())
    return seen.hexdigest()[:24]


def outcome_of(task: SessionTask) -> Outcome | None:
    """Return what became of a session as it is now, in this or an earlier run; None where that is not known."""
    try:
        if read_manifest(Path(task.out)) is None:
            return None
        found = parse_json((Path(task.out) / OUTCOME).read_text(encoding="utf-8"))
        told = {"status": SessionStatus(found["status"]), "rows": tuple(found["rows"]), "why": Why(found["why"])}
        outcome = Outcome(**{**found, **told})
        refuse_mixture(Path(task.out), (OUTCOME, "results.json"))
    except (OSError, ValueError, TypeError, KeyError, FileRefused):
        return None
    return outcome if outcome.fingerprint == task.fingerprint else None


def readable(path: Path | str) -> str:
    """Return a path as text that every file can hold: a byte that is no UTF-8 becomes its code."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
