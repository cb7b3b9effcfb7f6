"""Archives that are quickly made, and stand-ins for the work on one session, for processes that import them: quick,
deadly, slow.
"""

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path

from biodance.batch import work
from biodance.batch.work import (
    OUTCOME,
    Outcome,
    SessionStatus,
    SessionTask,
    TrialRows,
    outcome_of,
    process_session,
)
from biodance.lab.session.results_folder import write_manifest


def archive_of(folder: Path, count: int) -> Path:
    """Return an archive of sessions that hold one file which is no recording."""
    for k in range(count):
        (folder / f"s{k}").mkdir(parents=True)
        (folder / f"s{k}" / "walk.c3d").write_bytes(b"no recording")
    return folder


def worked(archive: Path, log: str = "worked.log") -> dict[str, int]:
    """Return how many times each session was worked on."""
    return {path.parent.name: len(path.read_text().splitlines()) for path in archive.rglob(log)}


def client_of(archive: Path, out: Path, work: str, workers: int | str) -> "subprocess.Popen[str]":
    """Start a process that goes through an archive with a ``work`` of `batch_work`."""
    program = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a job behind & ignores it
        "sys.path.insert(0, sys.argv[3]); import batch_work; from biodance.batch.run import run_batch\n"
        "if __name__ == '__main__':\n    run_batch(*sys.argv[1:3], tell=lambda *said: print(*said, flush=True),\n"
        f"        workers={workers!r}, work=batch_work.{work})"
    )
    words = [sys.executable, "-c", program, str(archive), str(out), str(Path(__file__).parent)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


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


def on_a_full_disk(task: SessionTask) -> Outcome:
    """Go through a session as in earnest, on a disk that is full when its results are put in place."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", task.out)

    work.put_in_place = full
    return process_session(task)


def wait_for_go(task: SessionTask) -> Outcome:
    """Go through a session as in earnest, but for its stages: they wait for the file ``go`` among the results."""
    work._examined = _waiting
    return process_session(task)


def _waiting(task: SessionTask, *_: object) -> tuple[SessionStatus, str, TrialRows, dict[str, str]]:
    results = Path(task.out).parent.parent
    (results / "worked" / task.name).mkdir(parents=True, exist_ok=True)
    with (results / "worked" / task.name / "worked.log").open("a") as log:
        log.write(f"{os.getpid()}\n")
    while not (results / "go").exists():
        time.sleep(0.02)
    return SessionStatus.DONE, "", ({"trial": "walk", "status": "ok"},), {}
