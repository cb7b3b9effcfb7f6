"""Stand-ins for the work on one session, for processes that import them: quick, deadly, slow."""

import fcntl
import json
import os
import signal
import time
from dataclasses import asdict, replace
from pathlib import Path

from biodance.batch.work import OUTCOME, Outcome, SessionStatus, SessionTask, outcome_of, process_session
from biodance.lab.session.results_folder import write_manifest


def count(task: SessionTask) -> Outcome:
    """Write down who worked on a session, and its outcome; nothing else."""
    if (found := outcome_of(task)) and found.is_final(task):
        return found
    with (Path(task.session) / "worked.log").open("a") as log:
        log.write(f"{os.getpid()}\n")
    outcome = Outcome(task.name, task.fingerprint, SessionStatus.DONE, rows=({"trial": "walk", "status": "ok"},))
    Path(task.out).mkdir(parents=True, exist_ok=True)
    (Path(task.out) / OUTCOME).write_text(json.dumps(asdict(outcome)))
    write_manifest(Path(task.out), Path(task.session), {})
    return outcome


def die_in_s2(task: SessionTask) -> Outcome:
    """Be killed in session s2, each time."""
    if task.name == "s2":
        os.kill(os.getpid(), signal.SIGKILL)
    return count(task)


def die_once(task: SessionTask) -> Outcome:
    """Be killed in every session at the first try."""
    mark = Path(task.session) / "tried"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return count(task)


def die_beside(task: SessionTask) -> Outcome:
    """Be killed in s1 at the first try, while s0 is worked on in the same process; in s2 each time."""
    time.sleep({"s0": 0.6, "s1": 0.3}.get(task.name, 0.0))
    return die_once(task) if task.name == "s1" else die_in_s2(task)


def stuck(task: SessionTask) -> Outcome:
    """Go through a session that is refused; in s3 wait to be killed with the one that asked."""
    if (found := outcome_of(task)) is None:
        found = process_session(replace(task, pages=False))
    if task.name == "s3":
        alive = (Path(task.session) / "alive").open("w")
        fcntl.flock(alive, fcntl.LOCK_EX)
        (Path(task.out).parent / ".part-at-work").mkdir()
        signal.pause()
    return found
