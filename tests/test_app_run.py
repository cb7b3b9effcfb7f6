"""Runs that a window asks for: one at a time, followed by their log, killed whole when they are stopped."""

import fcntl
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from batch_work import count, die_in_s2, on_a_full_disk, stuck

from biodance.app.sessions import Archive, RunState, Worker
from biodance.batch.run import Ledger
from biodance.batch.summary import SESSIONS
from biodance.errors import BiodanceError


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    """Four folders with a file that is no recording: enough for stand-ins, refused at once by the real work."""
    for name in ("s0", "s1", "s2", "s3"):
        (tmp_path / "archive" / name).mkdir(parents=True)
        (tmp_path / "archive" / name / "static.c3d").write_bytes(b"no recording")
    return Archive(tmp_path / "archive", tmp_path / "results")


def ended(worker: Worker) -> dict:
    end = time.monotonic() + 60
    while worker.document()["state"] is RunState.RUNNING:
        assert time.monotonic() < end
        time.sleep(0.05)
    return worker.document()


def test_a_run_goes_through_its_sessions_and_what_is_done_is_fresh(archive):
    worker = Worker(archive, count)
    assert worker.document() is None
    worker.start([archive["s0"], archive["s1"]])
    told = ended(worker)
    assert (told["state"], told["done"]) == (RunState.FINISHED, 2)
    found = {row["name"]: row["found"] for row in archive.rows()}
    assert found["s0"]["status"] == "done"
    assert not found["s0"]["page"]  # the stand-in draws none
    assert found["s2"] is None
    (archive["s0"].folder / "session.toml").write_text("[subject]\nage = 30\n")
    assert not archive["s0"].found()["fresh"]


def test_who_asks_how_a_run_stands_is_answered_as_soon_as_it_ends(archive):
    worker = Worker(archive, count)
    worker.wait(60)  # nothing is at work
    worker.start([archive["s0"], archive["s1"]])
    worker.wait(0.001)
    assert worker.running
    began = time.monotonic()
    worker.wait(600)
    assert time.monotonic() - began < 300
    assert worker.document()["state"] is RunState.FINISHED


def test_what_is_said_of_the_subject_in_the_folder_above_makes_results_old(archive):
    before = archive["s1"].task().fingerprint
    assert archive["s1"].task().fingerprint == before
    (archive.folder / "subject.toml").write_text("[subject]\nage = 30\n")
    assert archive["s1"].task().fingerprint != before


def test_a_window_asks_for_the_pages_that_it_shows(archive):
    task = archive["s1"].task()
    assert task.pages
    assert task.tables


def test_a_refused_session_says_why(archive):
    worker = Worker(archive)
    worker.start([archive["s0"]])
    assert ended(worker)["state"] is RunState.FINISHED
    found = archive["s0"].found()
    assert found["status"] == "refused"
    assert "static.c3d" in found["reason"]


def test_a_killed_process_costs_its_own_session_alone(archive):
    worker = Worker(archive, die_in_s2)
    worker.start([archive["s2"], archive["s3"]])
    told = ended(worker)
    assert told["state"] is RunState.FINISHED
    assert told["why"].startswith("s2: Its process was ended from outside 3 times")
    assert archive["s2"].found() is None
    assert archive["s3"].found()["status"] == "done"


def test_a_full_disk_is_said_and_nothing_half_written_stays(archive, monkeypatch):
    worker = Worker(archive, on_a_full_disk)
    worker.start([archive["s0"]])
    told = ended(worker)
    assert told["state"] is RunState.FINISHED
    assert "No space left on device" in told["why"]
    assert archive["s0"].found() is None
    assert not [*(archive.out / SESSIONS).iterdir()]


def test_a_stop_kills_what_is_at_work_and_leaves_nothing_half_done(archive):
    worker = Worker(archive, stuck)
    worker.start([archive["s3"], archive["s0"]])
    alive = archive["s3"].folder / "alive"
    end = time.monotonic() + 60
    while not (archive.out / SESSIONS / ".part-at-work").exists():
        assert time.monotonic() < end
        time.sleep(0.05)
    with pytest.raises(BiodanceError, match="not finished"):
        worker.start([archive["s0"]])
    worker.stop()
    with alive.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)  # nobody holds it any more
    assert worker.document()["state"] is RunState.STOPPED
    assert not list((archive.out / SESSIONS).glob(".part-*"))
    assert archive["s0"].found() is None
    worker.start([archive["s0"]])
    assert ended(worker)["state"] is RunState.FINISHED


def test_a_process_made_ready_does_every_run_and_is_replaced_once_it_was_killed(archive):
    worker = Worker(archive, count)
    worker.make_ready()
    for name in ("s0", "s1"):
        worker.start([archive[name]])
        assert ended(worker)["done"] == 1
    first, second = (int((archive[name].folder / "worked.log").read_text()) for name in ("s0", "s1"))
    assert first == second
    os.kill(first, signal.SIGKILL)
    worker.start([archive["s2"]])
    told = ended(worker)
    assert (told["state"], told["done"], told["why"]) == (RunState.FINISHED, 1, "")
    assert archive["s2"].found()["status"] == "done"


def test_ctrl_c_ends_a_window_as_it_should(archive, tmp_path):
    command = [sys.executable, "-m", "biodance", "app", str(archive.folder), "--no-browser", "--out", tmp_path / "out"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as window:
        try:
            assert select.select([window.stdout], [], [], 120.0)[0]
            window.send_signal(signal.SIGINT)
            _, said = window.communicate(timeout=60)
        finally:
            window.kill()  # one that did not end would be waited for without end
    assert window.returncode == 0
    assert "Ctrl-C ends it" in said
    assert "Stopped" not in said


def test_while_a_batch_writes_there_a_run_says_so(archive):
    ledger = Ledger(archive.out, archive.folder)
    try:
        worker = Worker(archive, count)
        worker.start([archive["s0"]])
        told = ended(worker)
    finally:
        ledger.close()
    assert told["state"] is RunState.FAILED
    assert "another run is writing" in told["why"]
