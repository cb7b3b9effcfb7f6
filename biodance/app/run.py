"""The work that a window has asked for: one run at a time, in a process of its own that a stop kills whole."""

import threading
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from biodance.app.sessions import Archive, SessionPlace
from biodance.batch.run import Ledger, Work, run_here, told_of_book
from biodance.batch.summary import SESSIONS
from biodance.batch.work import PART, clear_up, process_session
from biodance.errors import BiodanceError

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
