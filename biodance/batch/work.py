"""One session of an archive, in a process of its own: page, numbers, log, and an outcome that is there whole or not."""

import hashlib
import json
import resource
import shutil
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from biodance.errors import BiodanceError
from biodance.version import __version__

OUTCOME = "outcome.json"
"""Written last into a session's folder: where it is, the session is done."""
_LOG = "log.txt"
Rows = tuple[dict[str, Any], ...]
"""One row of plain values for each trial."""


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
    """

    name: str
    session: str
    out: str
    fingerprint: str
    chosen: tuple[str, ...] = ()
    pages: bool = True
    limit: float = 1800.0


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
    """

    name: str
    fingerprint: str
    status: SessionStatus
    reason: str = ""
    rows: Rows = ()
    seconds: float = 0.0
    memory_mb: float = 0.0

    @property
    def unread(self) -> bool:
        """Whether nothing can be said of the session."""
        return self.status in (SessionStatus.REFUSED, SessionStatus.FAILED)


def untold(name: str, fingerprint: str, status: SessionStatus, reason: str) -> Outcome:
    """Return the outcome of a session of which nothing but the reason can be told."""
    return Outcome(name, fingerprint, status, reason, ({"trial": "", "status": str(status), "reason": reason},))


def fingerprint_of(session: Path, chosen: tuple[str, ...]) -> str:
    """Return what changes when recordings, settings or version change: of names, sizes and times of the files."""
    seen = hashlib.sha256(repr((__version__, sorted(chosen))).encode())
    for path in sorted(session.rglob("*")):
        if path.is_file():
            known = path.stat()
            seen.update(repr((str(path.relative_to(session)), known.st_size, known.st_mtime_ns)).encode())
    return seen.hexdigest()[:24]


def outcome_of(task: SessionTask) -> Outcome | None:
    """Return what became of a session in this or an earlier run; None where it is not done as it is now."""
    try:
        found = json.loads((Path(task.out) / OUTCOME).read_text(encoding="utf-8"))
        outcome = Outcome(**{**found, "status": SessionStatus(found["status"]), "rows": tuple(found["rows"])})
    except (OSError, ValueError, TypeError, KeyError):
        return None
    return outcome if outcome.fingerprint == task.fingerprint else None


def process_session(task: SessionTask) -> Outcome:
    """Go through one session and return what became of it; nothing but a signal gets out of here.

    All is written beside and put in place at once, so that a killed process leaves nothing half done. A session that
    was finished meanwhile is not gone through again.
    """
    if found := outcome_of(task):
        return found
    started, place = time.perf_counter(), Path(task.out)
    part = place.with_name(f".{place.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    with (part / _LOG).open("w", encoding="utf-8") as log:

        def tell(text: str) -> None:
            log.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {text}\n")
            log.flush()

        status, reason, rows = _attempt(task, part, tell)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    seconds = time.perf_counter() - started
    outcome = Outcome(task.name, task.fingerprint, status, reason, rows, round(seconds, 2), round(memory, 1))
    (part / OUTCOME).write_text(json.dumps(asdict(outcome), indent=1), encoding="utf-8")
    shutil.rmtree(place, ignore_errors=True)  # of an earlier version of these recordings
    part.replace(place)
    return outcome


def _attempt(task: SessionTask, folder: Path, tell: Callable[[str], None]) -> tuple[SessionStatus, str, Rows]:
    """Return status, reason and rows of a session; what is raised becomes a status."""
    try:
        with _limited(task.limit):
            return _examined(task, folder, tell)
    except BiodanceError as error:
        status, reason = SessionStatus.REFUSED, str(error)
    except TimeoutError:
        status, reason = SessionStatus.FAILED, f"Given up after {task.limit:.0f} s; see --limit."
    except MemoryError:
        status, reason = SessionStatus.FAILED, "The memory of the machine was not enough. Take fewer workers."
    except OSError as error:
        status, reason = SessionStatus.FAILED, f"{error.filename or folder}: {error.strerror or error}."
    except Exception as error:
        tell(traceback.format_exc())
        status, reason = SessionStatus.FAILED, f"biodance itself failed ({type(error).__name__}: {error}); see {_LOG}."
    tell(f"{status}: {reason}")
    return status, reason, ({"trial": "", "status": str(status), "reason": reason},)


def _examined(task: SessionTask, folder: Path, tell: Callable[[str], None]) -> tuple[SessionStatus, str, Rows]:
    """Return status, reason and rows of a session that goes through."""
    from biodance.lab.session.read import read_session
    from biodance.pipeline.diagnosis import diagnosed
    from biodance.pipeline.load import as_diagnosed
    from biodance.pipeline.movement import session_movement
    from biodance.pipeline.session import examine
    from biodance.report.write import write_report
    from biodance.settings import assignments

    result = examine(read_session(task.session, settings=assignments(task.chosen), tell=tell), tell=tell)
    found = diagnosed(result, tell=tell)
    result = as_diagnosed(result, found.diagnosis) if found else result
    tell("writing")
    document = write_report(result, folder, diagnosis=found, movement=session_movement(result), drawn=task.pages)
    first = document["attention"][0]["text"] if document["attention"] else ""
    well = all(row["level"] == "note" for row in document["attention"])
    status = SessionStatus.DONE if well else SessionStatus.NEEDS_A_PERSON
    tell(f"{status}: {first}")
    return status, first, rows_of(document)


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise TimeoutError when what follows takes longer; in a thread that is not the main one, as those of a Dask
    worker, nothing can be interrupted and there is no limit.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


_ANGLES = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
ROW_TYPES: dict[str, str] = {
    **dict.fromkeys(("session", "trial", "role", "status", "reason", "session_status"), "string"),
    **dict.fromkeys(("verdict", "findings", "first"), "string"),
    **dict.fromkeys(("declared_mass_kg", "mass_on_plates_kg", "mass_difference_percent"), "float64"),
    "frames": "Int64",
    **dict.fromkeys(("rate_hz", "gaps_percent", "marker_rms_m", "marker_max_m"), "float64"),
    **dict.fromkeys(("fz_rms_table_n", "fz_rms_identified_n"), "float64"),
    **dict.fromkeys(("gait_cycles", "squats", "rises", "foot_events"), "Int64"),
    "speed_m_per_s": "float64",
    **dict.fromkeys((f"{angle}_max_deg" for angle in _ANGLES), "float64"),
    "warnings": "Int64",
    **dict.fromkeys(("seconds", "memory_mb"), "float64"),
}
"""Every column of summary.parquet and summary.csv, and its type."""
_KINDS = {"gait": "gait_cycles", "squat": "squats", "sit_to_stand": "rises"}
_OF_TRIAL = ("role", "status", "reason", "frames", "rate_hz", "gaps_percent", "marker_rms_m", "marker_max_m")


def rows_of(document: dict[str, Any]) -> tuple[dict[str, Any], ...]:
    """Return one row for each trial of a session (results.json): what it is, how well it was followed, what its plates
    say, what moved; trials that were refused have a row, too.
    """
    moved = {one["trial"]: one for one in (document["movement"] or {"trials": ()})["trials"]}
    mass, diagnosis = document["mass_check"] or {}, document["diagnosis"] or {}
    shared = {
        "verdict": _verdict(diagnosis),
        "findings": "; ".join(f"{one['effect']} {one['target']}".strip() for one in diagnosis.get("findings", ())),
        "first": document["attention"][0]["text"] if document["attention"] else "",
        "declared_mass_kg": document["subject"]["mass_kg"],
        "mass_on_plates_kg": mass.get("mass_on_plates_kg"),
        "mass_difference_percent": mass.get("difference_percent"),
    }
    rows = [
        {
            "trial": trial["name"],
            **{name: trial[name] for name in _OF_TRIAL},
            **{f"fz_rms_{body}_n": _vertical(trial["wrench"], body) for body in ("table", "identified")},
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


def _verdict(diagnosis: dict[str, Any]) -> str:
    """Return the verdict on a session: "not judged" where nothing was named and no second could be compared, as with
    plates alone, "cannot tell" where evidence is short.
    """
    if not diagnosis or not (diagnosis["findings"] or any(row["seconds"] > 0 for row in diagnosis["judged"])):
        return "not judged"
    return "cannot tell" if diagnosis["status"] == "cannot tell" else str(diagnosis["verdict"])


def _vertical(wrench: dict[str, Any] | None, body: str) -> float | None:
    """Return the RMS of vertical force between plates and the simulation with one ``body``, N; None where unknown."""
    found = wrench.get(body) if wrench else None
    return float(found["rms"][2]) if found and found["rms"][2] is not None else None


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
