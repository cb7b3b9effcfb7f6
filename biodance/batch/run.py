"""An archive through all stages: what is done stays done, what fails is told, the rest goes on.

What is done is written into one SQLite file in the results' folder, under a lock, so that no two runs mix.
"""

import fcntl
import os
import shutil
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

from biodance.batch.engines import Work, run_here, run_on_dask
from biodance.batch.outcome import (
    Outcome,
    SessionStatus,
    SessionTask,
    Why,
    fingerprint_of,
    outcome_of,
    readable,
    untold,
)
from biodance.batch.summary import SESSIONS, folder_name, write_summary
from biodance.batch.work import PART, process_session
from biodance.errors import BiodanceError
from biodance.lab.session.archive import archive_folders
from biodance.settings import assignments

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
    """The book of one archive's results, open for one run.

    Raises
    ------
    BiodanceError
        The folder holds something else, the results of another archive, or another run is writing into it.
    """

    def __init__(self, folder: Path, archive: Path) -> None:
        known = folder / LEDGER
        if folder.exists() and not folder.is_dir():
            raise BiodanceError(f"{folder}: is a file; the results need a folder. Choose another --out.")
        if folder.is_dir() and any(folder.iterdir()) and not (known.exists() or (folder / _LOCK).exists()):
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
        try:
            self._book.executescript(_TABLE)
        except sqlite3.Error:
            self.close()
            raise
        place = readable(archive.resolve())
        with self._book:
            self._book.execute("INSERT INTO archive SELECT ? WHERE NOT EXISTS (SELECT 1 FROM archive)", (place,))
        (owner,) = self._book.execute("SELECT folder FROM archive").fetchone()
        if owner != place:
            self.close()
            raise BiodanceError(f"{folder}: holds the results of another archive ({owner}). Choose another --out.")

    def write(self, outcome: Outcome) -> None:
        """Write down what became of a session; it is on disk when this returns."""
        row = attrgetter("name", "fingerprint", "status", "reason", "seconds", "memory_mb")(outcome)
        with self._book:
            self._book.execute(_WRITE, row)

    def note(self, outcomes: Iterable[Outcome]) -> None:
        """Write down what lies in the sessions' folders and is not in the book."""
        known = dict(self._book.execute("SELECT name, fingerprint FROM sessions"))
        for outcome in outcomes:
            if known.get(outcome.name) != outcome.fingerprint:
                self.write(outcome)

    def told(self, task: SessionTask) -> Outcome | None:
        """Return what is written down of a session that has no folder of its own (its process died each time)."""
        query = "SELECT fingerprint, status, reason FROM sessions WHERE name = ?"
        row = self._book.execute(query, (task.name,)).fetchone()
        if row is None or row[0] != task.fingerprint:
            return None
        return untold(task, SessionStatus(row[1]), row[2], Why.MACHINE)

    def close(self) -> None:
        """Close the book and let others in."""
        self._book.close()
        self._lock.close()


@dataclass(frozen=True)
class BatchRun:
    """What a run over an archive came to.

    Parameters
    ----------
    archive, folder : pathlib.Path
        Of the recordings and of the results.
    outcomes : tuple of Outcome
        One for every session of the archive, of this run or an earlier one, by name.
    fresh : int
        Sessions gone through in this run.
    left_out : tuple of str
        Tables of recordings that are no sessions.
    """

    archive: Path
    folder: Path
    outcomes: tuple[Outcome, ...]
    fresh: int
    left_out: tuple[str, ...] = ()

    @property
    def counts(self) -> dict[str, int]:
        """Sessions by status."""
        return dict(Counter(str(outcome.status) for outcome in self.outcomes))

    @property
    def needs_a_person(self) -> bool:
        """Whether any session is not simply done."""
        return any(one.status is not SessionStatus.DONE for one in self.outcomes)


def run_batch(
    archive: str | Path,
    out: str | Path,
    *,
    workers: int | str | None = None,
    chosen: tuple[str, ...] = (),
    pages: bool = True,
    limit: float = 1800.0,
    work: Work = process_session,
    tell: Callable[[str, int, int], None] = lambda *_: None,
) -> BatchRun:
    """Go through every session of an archive and write page, numbers and log of each, and the summary of all.

    A run that was stopped is gone on with by the same call: sessions that are done with the recordings, settings and
    version of now are not gone through again.

    Parameters
    ----------
    archive : str or pathlib.Path
        Folder with session folders at any depth.
    out : str or pathlib.Path
        Folder for the results: empty, new, or of an earlier run over this archive.
    workers : int or str, optional
        Processes of this machine, by default one for each core; or the address of a Dask scheduler whose workers see
        both folders.
    chosen : tuple of str
        Settings, such as ``filter.cutoff=6``.
    pages : bool
        Whether a page is drawn for every session.
    limit : float
        s after which a session is given up.
    work : callable
        What is done with one session; for tests.
    tell : callable, optional
        Called with what is being done, how many sessions are finished, and of how many.

    Returns
    -------
    BatchRun
        What became of every session; ``summary.parquet``, ``summary.csv`` and ``report.html`` in ``out``.

    Raises
    ------
    BiodanceError
        There is no session, the results' folder is taken, or settings or workers are not legal.
    """
    archive, folder = Path(archive), Path(out)
    assignments(chosen)
    sessions, indices = archive_folders(archive)
    if folder.resolve() in (archive.resolve(), *archive.resolve().parents):
        raise BiodanceError(f"{folder}: results must not lie among the recordings. Choose another --out.")
    if isinstance(workers, int) and workers < 1:
        raise BiodanceError(f"--workers {workers}: at least one process is needed. Leave it out for one a core.")
    if not limit > 0:
        raise BiodanceError(f"--limit {limit:g}: legal is more than 0 s for one session.")
    results = folder.resolve()
    tasks = []
    for path in sessions:
        if results not in (path.resolve(), *path.resolve().parents):
            name, fingerprint = _name(path, archive), fingerprint_of(path, chosen)
            place = os.path.abspath(folder / SESSIONS / folder_name(name))  # workers of a cluster work elsewhere
            tasks.append(SessionTask(name, os.path.abspath(path), place, fingerprint, chosen, pages, limit))
    if not tasks:
        left = f"only recordings of plates ({indices[0]}): see biodance plates" if indices else "only results"
        raise BiodanceError(f"{archive}: holds no session, {left}.")
    with told_of_book(folder), closing(Ledger(folder, archive)) as ledger:
        for part in (folder / SESSIONS).glob(f"{PART}*"):  # of a run that was killed
            shutil.rmtree(part, ignore_errors=True)
        fresh = _work_off(tasks, ledger, workers, work, tell)
        outcomes = tuple(found for task in tasks if (found := outcome_of(task) or ledger.told(task)))
        left_out = tuple(str(path.relative_to(archive)) for path in indices)
        tell("writing the summary", len(tasks), len(tasks))
        write_summary(folder, archive.resolve().name, outcomes, left_out)
    return BatchRun(archive, folder, outcomes, fresh, left_out)


@contextmanager
def told_of_book(folder: Path) -> Iterator[None]:
    """Raise BiodanceError where the book cannot be written or is none: sessions' folders tell what is done."""
    try:
        yield
    except sqlite3.Error as error:
        raise BiodanceError(
            f"{folder / LEDGER}: {error}. Make room, or delete that file if it is damaged, and run the same command: "
            f"what is done is kept."
        ) from error


def _work_off(
    tasks: list[SessionTask],
    ledger: Ledger,
    workers: int | str | None,
    work: Work,
    tell: Callable[[str, int, int], None],
) -> int:
    """Go through all tasks that are open, write down each as it is finished, and return how many were open.

    What counts is the outcome in a session's folder: where it is missing, damaged, or not final, the session is open.
    """
    known = {task.name: found for task in tasks if (found := outcome_of(task))}
    open_tasks = [task for task in tasks if not (task.name in known and known[task.name].is_final(task))]
    ledger.note(known.values())  # finished when a run was killed
    done = len(tasks) - len(open_tasks)
    tell("beginning", done, len(tasks))
    if not open_tasks:
        return 0
    if isinstance(workers, str):
        finished = run_on_dask(open_tasks, work, scheduler=workers)
    else:
        finished = run_here(open_tasks, work, workers=min(workers or os.cpu_count() or 1, len(open_tasks)))
    with closing(finished):  # Ctrl-C while a line is told ends what is at work, too
        for task, outcome in finished:
            ledger.write(outcome)
            done += 1
            tell(f"{task.name}: {outcome.status}", done, len(tasks))
    return len(open_tasks)


def _name(session: Path, archive: Path) -> str:
    """Return the name of a session: its folder below the archive, that of the archive where it is one session."""
    below = session.relative_to(archive)  # as it is called there, also where it is a link to another disk
    return readable(below if below.parts else archive.resolve().name)


def summary_of(run: BatchRun) -> dict[str, Any]:
    """Return what a run came to, for programs."""
    return {
        "archive": str(run.archive),
        "sessions": len(run.outcomes),
        "fresh": run.fresh,
        "counts": run.counts,
        "not_done": [
            {"session": one.name, "status": one.status, "reason": one.reason} for one in run.outcomes if one.unread
        ],
        "left_out": list(run.left_out),
        "seconds": round(sum(one.seconds for one in run.outcomes), 1),
        "peak_memory_mb": max((one.memory_mb for one in run.outcomes), default=None),
    }
