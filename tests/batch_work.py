"""Stand-ins for the work on one session, for processes that import them: quick, deadly, slow."""

import os
import signal
import time
from dataclasses import replace
from pathlib import Path

from biodance.batch.work import Outcome, SessionStatus, Task, outcome_of, process_session


def count(task: Task) -> Outcome:
    """Write down who worked on a session; nothing else."""
    with (Path(task.session) / "worked.log").open("a") as log:
        log.write(f"{os.getpid()}\n")
    return Outcome(task.name, task.fingerprint, SessionStatus.DONE, rows=({"trial": "walk", "status": "ok"},))


def die_in_s2(task: Task) -> Outcome:
    """Be killed in session s2, each time."""
    if task.name == "s2":
        os.kill(os.getpid(), signal.SIGKILL)
    return count(task)


def die_once(task: Task) -> Outcome:
    """Be killed in every session at the first try."""
    mark = Path(task.session) / "tried"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return count(task)


def slow(task: Task) -> Outcome:
    """Go through a session that is refused, then wait to be killed with the one that asked."""
    if (found := outcome_of(task)) is None:
        found = process_session(replace(task, pages=False))
    time.sleep(30.0 if task.name == "s3" else 0.0)
    return found
