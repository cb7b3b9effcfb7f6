"""The sessions below the folder of a window: which folders it may show and open, what is known of each session without
reading its recordings, and their runs, one at a time, in a process of its own that a stop kills whole.
"""

import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from biodance.app.edits import SessionText
from biodance.batch.run import Ledger, Work, run_here, told_of_book
from biodance.batch.summary import SESSIONS, folder_name
from biodance.batch.work import OUTCOME, PART, TABLES, SessionTask, clear_up, fingerprint_of, process_session
from biodance.errors import BiodanceError, refuse_unknown
from biodance.lab.session.archive import archive_folders, visit_date
from biodance.library import parse_json


def allowed_folder(path: str, roots: Sequence[Path]) -> Path:
    """Return a folder as it truly lies, links followed; BiodanceError where it is not in one of the ``roots``."""
    try:
        found = Path(path).resolve(strict=True)
    except (OSError, RuntimeError, ValueError) as error:
        raise BiodanceError(f"{path}: there is no such folder ({error}). Choose another one.") from error
    if not any(root == found or root in found.parents for root in roots):
        legal = ", ".join(map(str, roots))
        raise BiodanceError(f"{path}: is not in {legal}. Start biodance app with that folder to work in it.")
    if not found.is_dir():
        raise BiodanceError(f"{path}: is a file. Choose the folder that holds it.")
    return found


def folders_document(path: str, roots: Sequence[Path]) -> dict[str, Any]:
    """Return a ``folder`` ("" = the last of the ``roots``), the one ``above`` it ("" = none that may be shown), and the
    names of the ``folders`` in it; hidden ones, files, and links that lead elsewhere are left out.
    """
    folder = allowed_folder(path or str(roots[-1]), roots)
    try:
        below = sorted((one for one in folder.iterdir() if not one.name.startswith(".")), key=lambda one: one.name)
    except OSError as error:
        raise BiodanceError(f"{folder}: cannot be opened ({error.strerror}). Choose another one.") from error
    above = "" if folder in roots and not _within(folder.parent, roots) else str(folder.parent)
    shown = [one.name for one in below if _within(one, roots)]
    return {"folder": str(folder), "above": above, "folders": shown, "roots": [str(one) for one in roots]}


def _within(path: Path, roots: Sequence[Path]) -> bool:
    try:
        return bool(allowed_folder(str(path), roots))
    except BiodanceError:
        return False


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


_LOG = "log.txt"


class RunState(StrEnum):
    """How a run stands."""

    RUNNING = "running"
    FINISHED = "finished"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass
class SessionRun:
    """One run over the sessions ``names``: its ``state``, those ``done``, and ``why`` it failed."""

    names: tuple[str, ...]
    began: float = field(default_factory=time.monotonic)
    state: RunState = RunState.RUNNING
    done: list[str] = field(default_factory=list)
    why: str = ""
    stop: threading.Event = field(default_factory=threading.Event)
    seconds: float = 0.0

    def document(self, folder: Path) -> dict[str, Any]:
        """Return how it stands, with the last line that the worker wrote below ``folder``."""
        running = self.state is RunState.RUNNING
        seconds = time.monotonic() - self.began if running else self.seconds
        told = {"state": self.state, "names": self.names, "done": len(self.done), "why": self.why}
        return told | {"seconds": round(seconds, 1), "doing": _last_line(folder) if running else ""}


class Worker:
    """Runs sessions of an ``archive``, one run at a time; ``work`` what is done with each, for tests."""

    def __init__(self, archive: Archive, work: Work = process_session) -> None:
        self._archive, self._work, self._lock = archive, work, threading.Lock()
        self._run: SessionRun | None = None
        self._thread: threading.Thread | None = None

    def start(self, places: Sequence[SessionPlace]) -> None:
        """Begin a run over some sessions.

        Raises
        ------
        BiodanceError
            Another run is not finished.
        """
        with self._lock:
            if self.running:
                raise BiodanceError("Another run is not finished. Wait for it, or stop it.")
            self._run = SessionRun(tuple(one.name for one in places))
            self._thread = threading.Thread(target=self._go, args=(self._run, tuple(places)), daemon=True)
            self._thread.start()

    @property
    def running(self) -> bool:
        """Whether a run is not finished."""
        return self._run is not None and self._run.state is RunState.RUNNING

    def stop(self) -> None:
        """Stop the run; what is at work is killed, what is done stays. Returns when nothing works any more."""
        if self._run is not None and self._thread is not None:
            self._run.stop.set()
            self._thread.join()

    def document(self) -> dict[str, Any] | None:
        """Return how the last run stands; None before the first."""
        return self._run.document(self._archive.out / SESSIONS) if self._run else None

    def _go(self, run: SessionRun, places: tuple[SessionPlace, ...]) -> None:
        try:
            with told_of_book(self._archive.out), closing(Ledger(self._archive.out, self._archive.folder)) as ledger:
                clear_up(self._archive.out / SESSIONS)
                tasks = (one.task() for one in places)
                with closing(run_here(tasks, self._work, workers=1, stop=run.stop)) as finished:
                    for task, outcome in finished:
                        ledger.write(outcome)
                        run.done.append(task.name)
                clear_up(self._archive.out / SESSIONS)
            state = RunState.STOPPED if run.stop.is_set() else RunState.FINISHED
        except BiodanceError as error:
            state, run.why = RunState.FAILED, str(error)
        except Exception as error:
            state, run.why = (
                RunState.FAILED,
                f"{self._archive.out}: cannot be worked in ({error}). Make room, or run again.",
            )
        run.seconds, run.state = time.monotonic() - run.began, state


def _last_line(folder: Path) -> str:
    """Return what the worker said last, without the time."""
    for log in folder.glob(f"{PART}*/{_LOG}"):
        try:
            lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            continue
        if lines:
            return lines[-1][20:]
    return ""
