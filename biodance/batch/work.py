"""One session of an archive in a process of its own: page, numbers, log, and an outcome that is whole or not there."""

import ctypes
import errno
import fcntl
import gc
import hashlib
import json
import math
import os
import resource
import shutil
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from biodance.errors import BiodanceError, FileRefused
from biodance.lab.session.file import FILES
from biodance.lab.session.results_folder import inputs_of, put_in_place, read_manifest, refuse_mixture, write_manifest
from biodance.library import parse_json
from biodance.report.tables.schema import Schema
from biodance.settings import Value
from biodance.version import __version__

if TYPE_CHECKING:
    from biodance.records import Session

OUTCOME = "outcome.json"
"""In a session's folder: where it and the manifest are, the session is done."""
TABLES = "tables"
"""Folder of a session's tables, in that of its results."""
TrialRows = tuple[dict[str, Any], ...]
"""One row of plain values for each trial."""


class Why(StrEnum):
    """What a result hangs on; only what hangs on the recordings is final: room or limit may be larger another time."""

    SESSION = "session"
    MACHINE = "machine"
    LIMIT = "limit"


class SessionStatus(StrEnum):
    """Refused: the recordings cannot be used. Failed: biodance, or the machine, did not get through."""

    DONE = "done"
    NEEDS_A_PERSON = "needs a person"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True)
class SessionTask:
    """One session to go through: its ``name`` below the archive, the folders of its recordings (``session``) and
    results (``out``), the `fingerprint_of` recordings, settings and version; the settings ``chosen``
    (``filter.cutoff=6``), whether ``pages`` are drawn and ``tables`` written, and s after which it is given up
    (``limit``).
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
    """What became of one session, ``name`` and ``fingerprint`` as its task's: the ``reason`` why it is not done, else
    the first thing to be seen; ``rows`` of plain values by trial; ``seconds`` it took and was given (``limit``), the
    most memory it had (``memory_mb``); and ``why``, what that hangs on.
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
    row = {"trial": "", "status": str(status), "reason": reason}
    return Outcome(task.name, task.fingerprint, status, reason, (row,), why=why, limit=task.limit)


def fingerprint_of(session: Path, chosen: tuple[str, ...]) -> str:
    """Return what changes with names, sizes or times of the recordings (and FILES above), settings, version."""
    seen = hashlib.sha256(repr((__version__, sorted(chosen))).encode())
    above = (session.resolve().parent / name for name in FILES)
    for path in (*sorted(session.rglob("*")), *above):
        if path.is_file():
            # size and time stand for the content: to hash a whole archive would take hours at every start
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


def load_all() -> None:
    """Load what the first session of a process would wait for: the families, and numba with the machine code."""
    from biodance.body.human.human import human
    from biodance.effects import causes
    from biodance.lab.readers import readers
    from biodance.motion.kinematics import poses
    from biodance.observations import observers
    from biodance.records import Subject

    for family in (readers, causes, observers):
        family()
    body = human(Subject(70.0, 1.75, "F"))
    poses(body, body.neutral)
    gc.freeze()  # what is loaded stays: no collection need look through it


PART = ".part-"
"""Beginning of the name of a folder that is still being written."""
_LOG = "log.txt"
_OF_MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.EROFS)


class _OutOfTimeError(BaseException):
    """A session takes too long; no step of it may take that for a fault of its own."""


def process_session(task: SessionTask) -> Outcome:
    """Go through one session and return what became of it; nothing but a signal gets out of here.

    All is written beside, flushed to the disk, and put in place at once, so that neither a killed process nor a power
    cut leaves anything half done. A session that was finished meanwhile is not gone through again.
    """
    started, place = time.perf_counter(), Path(task.out)
    try:
        with _written_alone(place) as (part, log):
            if (found := outcome_of(task)) and found.is_final(task):
                return found

            def tell(text: str) -> None:
                log.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {text}\n")
                log.flush()

            outcome, inputs, settings = _attempt(task, part, tell)
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            seconds = time.perf_counter() - started
            outcome = replace(outcome, seconds=round(seconds, 2), memory_mb=round(memory, 1), limit=task.limit)
            (part / OUTCOME).write_text(json.dumps(asdict(outcome), indent=1), encoding="utf-8")
            write_manifest(part, Path(task.session), inputs, settings)
            put_in_place(part, place)
    except OSError as error:
        return untold(task, SessionStatus.FAILED, f"{place}: {error.strerror or error}.", Why.MACHINE)
    return outcome


@contextmanager
def _written_alone(place: Path) -> Iterator[tuple[Path, TextIO]]:
    """Yield an empty folder beside ``place`` and its log, as soon as no other process writes these results."""
    part = place.parent / f"{PART}{hashlib.sha256(os.fsencode(place.name)).hexdigest()[:24]}"
    while (log := _locked(part, fcntl.LOCK_EX)) is None:
        pass
    with log:
        for left in (path for path in part.iterdir() if path.name != _LOG):  # of a process that was killed
            shutil.rmtree(left) if left.is_dir() else left.unlink()
        log.truncate(0)
        try:
            yield part, log
        finally:
            shutil.rmtree(part, ignore_errors=True)


def _locked(part: Path, how: int) -> TextIO | None:
    """Return the log in a folder, locked; None where another process has it, or has put it in place meanwhile."""
    part.mkdir(parents=True, exist_ok=True)
    with suppress(FileNotFoundError):
        log = (part / _LOG).open("a", encoding="utf-8", errors="backslashreplace")
        with suppress(FileNotFoundError, BlockingIOError):
            fcntl.flock(log, how)
            # while we waited, its owner may have put the folder in place: only the log that lies here now is one
            if os.path.samestat(os.fstat(log.fileno()), (part / _LOG).stat()):
                return log
        log.close()
    return None


def clear_up(folder: Path) -> None:
    """Remove what killed processes left half done below the ``folder`` of sessions; what is still written stays."""
    for part in folder.glob(f"{PART}*"):
        if log := _locked(part, fcntl.LOCK_EX | fcntl.LOCK_NB):
            shutil.rmtree(part, ignore_errors=True)
            log.close()


def _attempt(
    task: SessionTask, folder: Path, tell: Callable[[str], None]
) -> tuple[Outcome, dict[str, str], Mapping[str, Value]]:
    """Return what became of a session, hashes of its recordings, and settings; what is raised becomes a status."""
    status, why = SessionStatus.FAILED, Why.MACHINE
    try:
        with _limited(task.limit):
            status, reason, rows, session = _examined(task, folder, tell)
            read = {trial.source.path: trial.source.sha256 for trial in session.trials}
            outcome = Outcome(task.name, task.fingerprint, status, reason, rows)
            return outcome, inputs_of(read, session.folder), session.settings.as_dict()
    except BiodanceError as error:
        why, reason = _hangs_on(error), str(error)
        status = SessionStatus.REFUSED if why is Why.SESSION else SessionStatus.FAILED
    except _OutOfTimeError:
        why, reason = Why.LIMIT, f"Given up after {task.limit:.0f} s; a higher --limit tries again."
    except MemoryError:
        reason = "The memory of the machine was not enough. Take fewer workers."
    except OSError as error:
        reason = f"{error.filename or folder}: {error.strerror or error}."
    except Exception as error:
        tell(traceback.format_exc())
        why, reason = Why.SESSION, f"biodance itself failed ({type(error).__name__}: {error}); see {_LOG}."
    reason = readable(reason)
    tell(f"{status}: {reason}")
    return untold(task, status, reason, why), {}, {}


def _hangs_on(error: BaseException) -> Why:
    """Return whether a refusal comes of the recordings, or of a machine without room: by what raised it."""
    cause = error.__cause__ or error.__context__
    if isinstance(cause, MemoryError) or (isinstance(cause, OSError) and cause.errno in _OF_MACHINE):
        return Why.MACHINE
    return _hangs_on(cause) if cause else Why.SESSION


def _examined(
    task: SessionTask, folder: Path, tell: Callable[[str], None]
) -> "tuple[SessionStatus, str, TrialRows, Session]":
    """Return status, reason and rows of a session that goes through, and the session as read."""
    from biodance.lab.session.read import read_session
    from biodance.pipeline.diagnosis import diagnosed_and_corrected
    from biodance.pipeline.session import followed
    from biodance.report.tables.diagnosis import asks_nobody
    from biodance.report.write import Wanted, write_session
    from biodance.settings import assignments

    session = read_session(task.session, settings=assignments(task.chosen), tell=tell)
    result, found = diagnosed_and_corrected(followed(session, tell=tell), tell=tell)
    tables = folder / TABLES if task.tables else None
    _, document = write_session(result, found, folder, Wanted(tables=tables, drawn=task.pages), tell=tell)
    first = document["attention"][0]["text"] if document["attention"] else ""
    status = SessionStatus.DONE if asks_nobody(document["attention"]) else SessionStatus.NEEDS_A_PERSON
    tell(f"{status}: {first}")
    return status, first, trial_rows(document), session


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise `_OutOfTimeError` when what follows takes longer; in a Dask worker's thread once machine code ends."""
    if threading.current_thread() is not threading.main_thread():
        with _limited_thread(seconds):
            yield
        return

    def stop(*_: object) -> None:
        raise _OutOfTimeError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def _limited_thread(seconds: float) -> Iterator[None]:
    """Raise `_OutOfTimeError` in this thread when what follows takes longer."""
    thread, at_work, guard = ctypes.c_ulong(threading.get_ident()), [True], threading.Lock()

    def stop() -> None:
        with guard:  # never once the session is over
            if at_work:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(_OutOfTimeError))

    timer = threading.Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with guard:
            at_work.clear()
        timer.cancel()


_ANGLES = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
ROW_TYPES: dict[str, str] = {
    **dict.fromkeys(("session", "trial", "role", "status", "reason", "session_status"), "string"),
    **dict.fromkeys(("verdict", "findings", "first"), "string"),
    **dict.fromkeys(("declared_mass_kg", "mass_on_plates_kg", "mass_difference_percent"), "float64"),
    "frames": "Int64",
    **dict.fromkeys(("rate_hz", "gaps_percent", "marker_rms_m", "marker_max_m"), "float64"),
    **dict.fromkeys(("fz_rms_table_n", "fz_rms_identified_n"), "float64"),
    **dict.fromkeys(("gait_cycles", "squats", "rises", "jumps", "foot_events"), "Int64"),
    "speed_m_per_s": "float64",
    **dict.fromkeys((f"{angle}_max_deg" for angle in _ANGLES), "float64"),
    "warnings": "Int64",
    **dict.fromkeys(("seconds", "memory_mb"), "float64"),
}
"""Every column of summary.parquet and summary.csv, and its type."""
_KINDS = {"gait": "gait_cycles", "squat": "squats", "sit_to_stand": "rises", "jump": "jumps"}
_TRIAL = Schema(
    "trial=name role status reason frames rate_hz gaps_percent marker_rms_m marker_max_m "
    "fz_rms_table_n=wrench.table.rms.2 fz_rms_identified_n=wrench.identified.rms.2"
)


def trial_rows(document: dict[str, Any]) -> tuple[dict[str, Any], ...]:
    """Return one row for each trial of a session's results.json, those that were refused included."""
    moved = {one["trial"]: one for one in (document["movement"] or {"trials": ()})["trials"]}
    diagnosis = document["diagnosis"] or {}
    verdict = "not judged"  # nothing was named and no second could be compared, as with plates alone
    if diagnosis and (diagnosis["findings"] or any(row["seconds"] > 0 for row in diagnosis["judged"])):
        verdict = "cannot tell" if diagnosis["status"] == "cannot tell" else str(diagnosis["verdict"])
    shared = {
        "verdict": verdict,
        "findings": "; ".join(f"{one['effect']} {one['target']}".strip() for one in diagnosis.get("findings", ())),
        "first": document["attention"][0]["text"] if document["attention"] else "",
        **Schema(
            "declared_mass_kg=subject.mass_kg mass_on_plates_kg=mass_check.mass_on_plates_kg "
            "mass_difference_percent=mass_check.difference_percent"
        ).row(document),
    }
    rows = [
        {
            **_TRIAL.row(trial),
            **(_moved(moved[trial["name"]]) if trial["name"] in moved else {}),
            "warnings": len(trial["warnings"]),
            **shared,
        }
        for trial in document["trials"]
    ]
    refused = (
        {"trial": name, "status": "refused", "reason": why, **shared} for name, why in document["refused"].items()
    )
    return (*rows, *refused)


def _moved(one: dict[str, Any]) -> dict[str, Any]:
    """Return what moved in a trial: repetitions, events, speed, the largest angle of both sides' mean curves."""
    kinds = [cycle["kind"] for cycle in one["cycles"]]
    speeds = [row["mean"] for row in one["spatiotemporal"] if (row["quantity"], row["side"]) == ("speed", "both")]
    row: dict[str, Any] = {column: kinds.count(kind) for kind, column in _KINDS.items()}
    row |= {"foot_events": len(one["events"]), "speed_m_per_s": speeds[0] if speeds else None}
    for angle in _ANGLES:
        most = [curve["max"] for curve in one["curves"] if curve["quantity"] == angle and "max" in curve]
        row[f"{angle}_max_deg"] = max(most) if most else None
    return row
