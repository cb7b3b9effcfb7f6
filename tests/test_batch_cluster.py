"""Archives on a Dask cluster: what dies - worker, client, scheduler - costs no session and does none twice."""

import builtins
import json
import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, nullcontext
from pathlib import Path

import batch_work
import pytest
from batch_work import archive_of, client_of, worked

from biodance.batch.run import LEDGER, run_batch
from biodance.batch.work import Outcome, SessionTask
from biodance.errors import BiodanceError


def test_a_cluster_that_exists_is_used(tmp_path: Path, monkeypatch) -> None:
    """Its workers have working folders of their own: what they are told is absolute, though both folders are given as
    seen from ours.
    """
    distributed = pytest.importorskip("distributed")
    archive = archive_of(tmp_path / "a", 3)
    monkeypatch.chdir(tmp_path)

    def count(task: SessionTask) -> Outcome:
        assert Path(task.session).is_absolute()
        assert Path(task.out).is_absolute()
        return batch_work.count(task)

    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        found = run_batch(Path("a"), Path("out"), workers=cluster.scheduler_address, work=count)
        real = run_batch(archive, tmp_path / "real", workers=cluster.scheduler_address, pages=False)
    assert found.fresh == 3
    assert worked(archive) == {"s0": 1, "s1": 1, "s2": 1}
    assert real.counts == {"refused": 3}, "the work itself runs in the threads of a cluster"


def test_a_session_whose_worker_dies_on_a_cluster_is_tried_alone(tmp_path: Path) -> None:
    distributed, dask = pytest.importorskip("distributed"), pytest.importorskip("dask")
    archive = archive_of(tmp_path / "a", 3)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),  # a death blames all that the worker held
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=":0") as cluster,
    ):
        found = run_batch(archive, tmp_path / "out", workers=cluster.scheduler_address, work=batch_work.die_beside)
    assert worked(archive) == {"s0": 1, "s1": 1}
    assert {one.name: one.status for one in found.outcomes if one.status != "done"} == {"s2": "failed"}


@contextmanager
def cluster(place: Path) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """Start a scheduler and two workers as somebody else would; yield the address and the scheduler."""
    pytest.importorskip("distributed")
    place.unlink(missing_ok=True)
    told = ["--scheduler-file", str(place), "--no-dashboard"]
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    start, quiet = [sys.executable, "-m"], subprocess.DEVNULL
    scheduler, workers = (
        subprocess.Popen([*start, f"distributed.cli.dask_{name}", *told, *more], env=paths, stderr=quiet)
        for name, *more in (["scheduler", "--port", "0"], ["worker", "--nworkers", "2", "--nthreads", "1"])
    )
    try:
        wait_for(lambda: place.exists() and place.read_text().rstrip().endswith("}"))
        yield json.loads(place.read_text())["address"], scheduler
    finally:
        for one in (workers, scheduler):
            one.terminate()
            one.wait()


def wait_for(told: Callable[[], bool]) -> None:
    """Wait three minutes at most."""
    until = time.monotonic() + 180
    while not told():
        assert time.monotonic() < until
        time.sleep(0.05)


@pytest.mark.parametrize("dies", ["client", "worker", "scheduler"])
def test_what_dies_is_started_again_and_costs_no_session(tmp_path: Path, dies: str) -> None:
    archive, out = archive_of(tmp_path / "a", 6), tmp_path / "out"
    with ExitStack() as stack:
        address, scheduler = stack.enter_context(cluster(tmp_path / "scheduler.json"))
        client = stack.enter_context(client_of(archive, out, "wait_for_go", address))
        wait_for(lambda: len(worked(out)) == 2)
        at_work = worked(out)
        worker = int(next(out.rglob("worked.log")).read_text())
        os.kill({"client": client.pid, "worker": worker, "scheduler": scheduler.pid}[dies], signal.SIGKILL)
        go = threading.Timer(1.0, (out / "go").touch)
        if dies == "worker":
            go.start()
        said = client.communicate(timeout=180)[1]
        assert ("the Dask scheduler went away" in said) == (dies == "scheduler")
        if dies == "scheduler":
            address, _ = stack.enter_context(cluster(tmp_path / "another.json"))

        def tell(what: str, *_: int) -> None:
            if what == "beginning" and dies != "worker":  # what was left half done has been cleared up
                go.start()

        found = run_batch(archive, out, workers=address, work=batch_work.wait_for_go, tell=tell)
    assert found.counts == {"done": 6}, [one.reason for one in found.outcomes]
    again = {name for name, times in worked(out).items() if times > 1}
    assert again <= (set() if dies == "client" else set(at_work))
    with closing(sqlite3.connect(out / LEDGER)) as book:
        assert book.execute("SELECT count(*), max(times) FROM sessions").fetchone() == (6, 1)
    assert not list((out / "sessions").glob(".part-*"))


@pytest.mark.parametrize(
    ("raised", "told"),
    [
        ("CancelledError", r"scheduler went away.*run the same command"),
        ("ModuleNotFoundError", r"the scheduler and each worker need biodance [\d.]+, as here \(no module\)"),
        ("RuntimeError", r"the scheduler and each worker need biodance"),
    ],
)
def test_a_cluster_that_cannot_go_on_is_one_sentence(tmp_path: Path, monkeypatch, raised: str, told: str) -> None:
    distributed = pytest.importorskip("distributed")

    def lost(*_: object) -> None:
        raise getattr(distributed, raised, None) or getattr(builtins, raised)("no module\nof that name")

    monkeypatch.setattr(distributed, "Client", lambda *_, **__: nullcontext())
    monkeypatch.setattr("biodance.batch.run._on_cluster", lost)
    with pytest.raises(BiodanceError, match=told):
        run_batch(archive_of(tmp_path / "a", 1), tmp_path / "out", workers="tcp://x", work=batch_work.count)


def test_an_address_where_nobody_answers_is_one_sentence(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(BiodanceError, match="no Dask scheduler answers there"):
        run_batch(archive_of(tmp_path / "a", 1), tmp_path / "out", workers="nobody://x", work=batch_work.count)
