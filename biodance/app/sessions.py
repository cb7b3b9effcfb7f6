"""The sessions below a window's folder: which may be shown, their session.toml with every state it had, their runs."""

import hashlib
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import closing, suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from threading import Lock
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AbstractTable

from biodance.batch.run import Ledger, Work, ready_process, run_here, told_of_book
from biodance.batch.summary import SESSIONS, folder_name
from biodance.batch.work import (
    OUTCOME,
    PART,
    TABLES,
    SessionTask,
    Why,
    clear_up,
    fingerprint_of,
    process_session,
)
from biodance.errors import BiodanceError, FileRefused, refuse_unknown
from biodance.lab.plain_text import write_whole
from biodance.lab.session.archive import archive_folders, visit_date
from biodance.lab.session.file import check_session_text
from biodance.lab.session.results_folder import made_folder
from biodance.library import parse_json

KeyChange = tuple[Sequence[str], Any]
"""Where in session.toml, as ``("subject", "mass_kg")``, and the new value; None takes the key out."""


class ChangedElsewhereError(BiodanceError):
    """session.toml is not as the one who wants to change it has seen it."""


class SessionText:
    """The session.toml of the session in ``folder``, with all states that it had in the folder ``history``.

    States are files ``0001.toml``, ... in the order in which they were; none is ever removed. `step` goes back along
    them and forth; a `change` after that adds the state gone back to, and then the new one.
    """

    def __init__(self, folder: Path, history: Path) -> None:
        self.path, self._history, self._lock = folder / "session.toml", history, Lock()
        self._at: int | None = None

    @property
    def text(self) -> str:
        """What the file says; "" where there is none."""
        try:
            return self.path.read_bytes().decode("utf-8-sig") if self.path.exists() else ""
        except UnicodeDecodeError as error:
            raise FileRefused(f"{self.path}: is no text in UTF-8, so not valid TOML. Save it as UTF-8.") from error
        except OSError as error:
            raise FileRefused(f"{self.path}: cannot be opened ({error.strerror}). Check the path.") from error

    @property
    def revision(self) -> str:
        """What changes whenever the file does."""
        content = self.path.read_bytes() if self.path.is_file() else b""
        return hashlib.sha256(content).hexdigest()[:16]

    @property
    def steps(self) -> tuple[bool, bool]:
        """Whether there is a state to go back to, and one to go forth to."""
        states, at = self._states(), self._position()
        # changed elsewhere: going back leads to what was written here last, and nothing lies ahead
        changed = bool(states) and _read(states[at]) != self.text
        return at > 0 or changed, at < len(states) - 1 and not changed

    def change(self, revision: str, changed: Callable[[str], str]) -> None:
        """Write what ``changed`` makes of the file's text, which must be as at the ``revision``.

        Raises
        ------
        ChangedElsewhereError
            It is not.
        BiodanceError
            What would stand there is not legal: nothing is written.
        """
        with self._lock:
            self._same(revision)
            text = changed(self.text)
            check_session_text(self.path, text)
            if text == self.text:
                return
            # a change after undo: the state gone back to is added again, so that no later one is lost
            self._keep()
            if self._position() < len(self._states()) - 1:
                self._add(self.text)
            self._add(text)
            self._put(text)

    def step(self, revision: str, by: int) -> None:
        """Go back to the state before (-1), or forth to the one that was undone (1); nothing where there is none."""
        with self._lock:
            self._same(revision)
            if by < 0:
                self._keep()
            states, at = self._states(), self._position() + by
            if 0 <= at < len(states):
                self._put(_read(states[at]))
                self._at = at

    def _same(self, revision: str) -> None:
        if revision != self.revision:
            raise ChangedElsewhereError(
                f"{self.path.name} was changed elsewhere in the meantime. It is shown as it is now; make your change "
                f"again."
            )

    def _keep(self) -> None:
        """Keep what stands there now as the last state, unless it is the one that was written here."""
        states, now = self._states(), self.text
        if not states or _read(states[self._position()]) != now:
            self._add(now)

    def _add(self, text: str) -> None:
        number = len(self._states()) + 1
        write_whole(made_folder(self._history) / f"{number:04}.toml", text.encode())
        self._at = number - 1

    def _put(self, text: str) -> None:
        if text:
            write_whole(self.path, text.encode(), over=True)
        else:
            self.path.unlink(missing_ok=True)  # the state of no file; an empty one says no more

    def _states(self) -> list[Path]:
        return sorted(self._history.glob("*.toml"))

    def _position(self) -> int:
        return len(self._states()) - 1 if self._at is None else self._at


def _read(path: Path) -> str:
    return path.read_bytes().decode("utf-8")


def changed_text(text: str, changes: Sequence[KeyChange]) -> str:
    """Return a TOML text with keys set or taken out and all else as before; FileRefused where that cannot be."""
    try:
        document = tomlkit.parse(text)
        for keys, value in changes:
            _set(document, list(keys), value)
        return tomlkit.dumps(document)
    except (TOMLKitError, TypeError, ValueError) as error:
        raise FileRefused(f"session.toml: cannot be changed ({error}). Correct it as text first.") from error


def _set(document: Container, keys: list[str], value: Any) -> None:
    if not 1 <= len(keys) <= 4 or not all(isinstance(key, str) and key for key in keys):
        raise ValueError(f"{keys!r} is no key")
    if value is None:
        return _take_out(document, keys)
    table: Any = document
    for depth, key in enumerate(keys[:-1]):
        if key not in table:
            table[key] = tomlkit.table(is_super_table=depth < len(keys) - 2)
        table = table[key]
    table[keys[-1]] = _inline(value)
    return None


def _inline(value: Any) -> Any:
    """Return a value as it is written on one line, whatever it holds."""
    if isinstance(value, list):
        array = tomlkit.array()
        array.extend(map(_inline, value))
        return array
    if isinstance(value, dict):
        table = tomlkit.inline_table()
        table.update(value)
        return table
    return tomlkit.item(value)


def _take_out(document: Container, keys: list[str]) -> None:
    """Take a key out, and tables that hold nothing more."""
    tables: list[Any] = [document]
    for key in keys[:-1]:
        if key not in tables[-1]:
            return
        tables.append(tables[-1][key])
    for table, key in zip(reversed(tables), reversed(keys), strict=True):
        inner = table.get(key)
        if key == keys[-1] and table is tables[-1]:
            table.pop(key, None)
        elif isinstance(inner, AbstractTable) and not inner and not tomlkit.dumps(inner.value).strip():
            table.pop(key)  # Empty, and no comment stands in it


def allowed_folder(path: str, roots: Sequence[Path]) -> Path:
    """Return a folder as it truly lies, links followed; BiodanceError where it is not in one of the ``roots``."""
    try:
        found = Path(path).resolve(strict=True)
    except (OSError, RuntimeError, ValueError) as error:
        raise BiodanceError(f"{path}: there is no such folder ({error}). Choose another one.") from error
    if not any(found.is_relative_to(root) for root in roots):
        legal = ", ".join(map(str, roots))
        raise BiodanceError(f"{path}: is not in {legal}. Start biodance app with that folder to work in it.")
    if not found.is_dir():
        raise BiodanceError(f"{path}: is a file. Choose the folder that holds it.")
    return found


def folders_document(path: str, roots: Sequence[Path]) -> dict[str, Any]:
    """Return a ``folder`` ("" = the last root), the one ``above`` it ("" = none), and ``folders`` in it."""
    folder = allowed_folder(path or str(roots[-1]), roots)
    try:
        below = sorted((one for one in folder.iterdir() if not one.name.startswith(".")), key=lambda one: one.name)
    except OSError as error:
        raise BiodanceError(f"{folder}: cannot be opened ({error.strerror}). Choose another one.") from error
    above = "" if folder in roots and not _within(folder.parent, roots) else str(folder.parent)
    shown = [one.name for one in below if _within(one, roots)]
    return {"folder": str(folder), "above": above, "folders": shown, "roots": [str(one) for one in roots]}


def _within(path: Path, roots: Sequence[Path]) -> bool:
    with suppress(BiodanceError):
        return bool(allowed_folder(str(path), roots))
    return False


HISTORY = "history"
"""Folder of the states of every session.toml, in that of the results."""


def results_beside(folder: Path) -> Path:
    """Return where the results of a folder go unless another place is named."""
    return folder.with_name(f"{folder.name}-results")


@dataclass(frozen=True)
class SessionPlace:
    """One session by its ``name`` below the archive: ``folder`` of its recordings, ``results``, session.toml."""

    name: str
    folder: Path
    results: Path
    file: SessionText

    def task(self) -> SessionTask:
        """Return the work that gives its results as they should be now."""
        folder, out = os.path.abspath(self.folder), os.path.abspath(self.results)
        return SessionTask(self.name, folder, out, fingerprint_of(self.folder, ()), tables=True)

    def found(self) -> dict[str, Any] | None:
        """Return what the last run made of the session; whether of its present files (``fresh``), and whether it wrote
        ``tables`` and a ``page``; None where it was not run.
        """
        try:
            told = parse_json((self.results / OUTCOME).read_text(encoding="utf-8"))
            row: dict[str, Any] = next(iter(told["rows"]), {})
            found = {"status": str(told["status"]), "reason": str(told["reason"]), "verdict": row.get("verdict") or ""}
            found["fresh"] = told["fingerprint"] == fingerprint_of(self.folder, ())
            there = {"tables": (self.results / TABLES).is_dir(), "page": (self.results / "report.html").is_file()}
            return found | there
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None


class Archive:
    """The sessions of a ``folder``, which is an archive or one session, with their results in ``out``. Raises
    BiodanceError: there is no session, or the results would lie among the recordings.
    """

    def __init__(self, folder: Path, out: Path) -> None:
        self.folder, self.out = folder, out
        if folder.resolve().is_relative_to(out.resolve()):
            raise BiodanceError(f"{out}: results must not lie among the recordings. Choose another --out.")
        self._places: dict[str, SessionPlace] = {}
        self.look()
        with told_of_book(out):
            Ledger(out, folder).close()

    def look(self) -> None:
        """Look again which sessions there are."""
        known, results, self._places = self._places, self.out.resolve(), {}
        for path in archive_folders(self.folder)[0]:
            if not path.resolve().is_relative_to(results):
                below = path.relative_to(self.folder)
                name = below.as_posix() if below.parts else self.folder.resolve().name
                file = SessionText(path, self.out / HISTORY / folder_name(name))
                place = SessionPlace(name, path, self.out / SESSIONS / folder_name(name), file)
                self._places[name] = known.get(name, place)

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
    """One run over the sessions ``names``: its ``state``, those ``done``, and ``why`` it failed, or the machine failed
    some of them.
    """

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
    """Runs sessions of an ``archive``, one run at a time, in a process that stays; ``work`` what is done with each, for
    tests.
    """

    def __init__(self, archive: Archive, work: Work = process_session) -> None:
        self._archive, self._work, self._lock = archive, work, threading.Lock()
        self._run: SessionRun | None = None
        self._turn, self._at_work = ThreadPoolExecutor(1), Future[None]()
        self._idle: list[ProcessPoolExecutor] = []

    def open(self, archive: Archive) -> None:
        """Run sessions of another archive from now on."""
        self._archive, self._run = archive, None

    def make_ready(self) -> None:
        """Let a process load all that sessions need, after the run that is at work."""

        def ready() -> None:
            if not self._idle:
                self._idle.append(ready_process())

        self._turn.submit(ready)

    def start(self, places: Sequence[SessionPlace]) -> None:
        """Begin a run over some sessions. Raises BiodanceError: another run is not finished."""
        with self._lock:
            if self.running:
                raise BiodanceError("Another run is not finished. Wait for it, or stop it.")
            self._run = SessionRun(tuple(one.name for one in places))
            self._at_work = self._turn.submit(self._go, self._run, tuple(places))

    @property
    def running(self) -> bool:
        """Whether a run is not finished."""
        return self._run is not None and self._run.state is RunState.RUNNING

    def wait(self, seconds: float) -> None:
        """Return as soon as no run is at work, or after so many s."""
        wait([self._at_work] if self.running else [], timeout=seconds)

    def stop(self) -> None:
        """Stop the run; what is at work is killed, what is done stays. Returns when nothing works any more."""
        with self._lock:
            run, at_work = self._run, self._at_work
        if run is not None:
            run.stop.set()
            at_work.result()

    def document(self) -> dict[str, Any] | None:
        """Return how the last run stands; None before the first."""
        return self._run.document(self._archive.out / SESSIONS) if self._run else None

    def _go(self, run: SessionRun, places: tuple[SessionPlace, ...]) -> None:
        try:
            with told_of_book(self._archive.out), closing(Ledger(self._archive.out, self._archive.folder)) as ledger:
                clear_up(self._archive.out / SESSIONS)
                tasks = (one.task() for one in places)
                with closing(run_here(tasks, self._work, workers=1, stop=run.stop, idle=self._idle)) as finished:
                    for task, outcome in finished:
                        ledger.write(outcome)
                        run.done.append(task.name)
                        if outcome.why is Why.MACHINE:  # perhaps no folder of its own tells it
                            run.why = f"{run.why} {task.name}: {outcome.reason}".strip()
                clear_up(self._archive.out / SESSIONS)
            state = RunState.STOPPED if run.stop.is_set() else RunState.FINISHED
        except BiodanceError as error:
            state, run.why = RunState.FAILED, str(error)
        except Exception as error:
            state = RunState.FAILED
            run.why = f"{self._archive.out}: cannot be worked in ({error}). Make room, or run again."
        run.seconds, run.state = time.monotonic() - run.began, state


def _last_line(folder: Path) -> str:
    """Return what the worker said last, without the time."""
    for log in folder.glob(f"{PART}*/{_LOG}"):
        with suppress(OSError):
            if lines := log.read_text(encoding="utf-8", errors="replace").splitlines():
                return lines[-1][20:]
    return ""
