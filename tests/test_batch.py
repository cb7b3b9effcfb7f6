"""Archives go through whole: nothing twice, nothing lost, whatever dies."""

import errno
import fcntl
import json
import os
import shutil
import signal
import sqlite3
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import batch_work
import pandas as pd
import pytest
from batch_work import archive_of, client_of, worked

import biodance
from biodance.batch.run import LEDGER, Ledger, _submitted, run_batch
from biodance.batch.summary import SESSIONS, outliers, same_recordings, summary_table, write_summary
from biodance.batch.work import (
    ROW_TYPES,
    Outcome,
    SessionStatus,
    SessionTask,
    fingerprint_of,
    process_session,
    trial_rows,
)
from biodance.cli import run
from biodance.errors import BiodanceError
from biodance.lab.session.results_folder import write_manifest
from biodance.pipeline.trial import attempt


def test_every_session_once_and_a_second_call_does_nothing(tmp_path: Path) -> None:
    archive = archive_of(tmp_path / "a", 6)
    tasks = [SessionTask(f"s{k}", str(archive / f"s{k}"), "", "f") for k in range(6)]
    first = run_batch(archive, tmp_path / "out", workers=2, work=process_session, pages=False)
    assert (first.fresh, first.counts) == (6, {"refused": 6})
    assert len(tasks) == len(first.outcomes)
    assert all("walk.c3d" in one.reason for one in first.outcomes)
    again = run_batch(archive, tmp_path / "out", workers=2, work=batch_work.die_in_s2)
    assert again.fresh == 0
    assert again.outcomes == first.outcomes
    (archive / "s4" / "walk.c3d").write_bytes(b"another recording")
    assert run_batch(archive, tmp_path / "out", workers=1, pages=False).fresh == 1


def test_a_session_inside_another_one_keeps_its_results(tmp_path: Path) -> None:
    archive = archive_of(archive_of(tmp_path / "a", 1) / "s0", 1).parent
    found = run_batch(archive, tmp_path / "out", workers=1, pages=False)
    assert [one.name for one in found.outcomes] == ["s0", "s0/s0"]
    (archive / "s0" / "walk.c3d").write_bytes(b"another recording")
    assert [one.name for one in run_batch(archive, tmp_path / "out", workers=1).outcomes] == ["s0", "s0/s0"]
    assert len([*(tmp_path / "out").rglob("outcome.json")]) == 2
    assert 'href="sessions' not in (tmp_path / "out" / "report.html").read_text(), "no page was drawn"


def test_a_session_that_lies_elsewhere_is_called_as_its_link(tmp_path: Path) -> None:
    archive, far = archive_of(tmp_path / "a", 1), archive_of(tmp_path / "far", 1)
    (archive / "linked").symlink_to(far / "s0", target_is_directory=True)
    found = run_batch(archive, tmp_path / "out", workers=1, work=batch_work.count, pages=False)
    assert [one.name for one in found.outcomes] == ["linked", "s0"]


def test_a_session_that_kills_its_process_takes_nobody_along(tmp_path: Path) -> None:
    archive = archive_of(tmp_path / "a", 5)
    found = run_batch(archive, tmp_path / "out", workers=2, work=batch_work.die_in_s2)
    status = {one.name: one.status for one in found.outcomes}
    assert status["s2"] == "failed"
    with closing(sqlite3.connect(tmp_path / "out" / LEDGER)) as book:
        known = dict(book.execute("SELECT name, status FROM sessions"))
    assert known == {"s0": "done", "s1": "done", "s2": "failed", "s3": "done", "s4": "done"}
    assert worked(archive) == {"s0": 1, "s1": 1, "s3": 1, "s4": 1}


def test_a_process_killed_between_two_sessions_is_a_lost_process() -> None:
    with ProcessPoolExecutor(1) as pool:
        assert isinstance(pool.submit(os._exit, 1).exception(), BrokenProcessPool)
        assert isinstance(
            _submitted(pool, batch_work.count, SessionTask("s", "", "", "")).exception(), BrokenProcessPool
        )


def test_processes_that_die_once_are_replaced(tmp_path: Path) -> None:
    archive = archive_of(tmp_path / "a", 4)
    run_batch(archive, tmp_path / "out", workers=2, work=batch_work.die_once)
    assert worked(archive) == {f"s{k}": 1 for k in range(4)}


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_what_ends_the_client_ends_what_is_at_work_and_a_restart_goes_on(tmp_path: Path, how: signal.Signals) -> None:
    archive, out = archive_of(tmp_path / "a", 6), tmp_path / "out"
    with client_of(archive, out, "stuck", 2) as client:
        next(line for line in client.stdout if line.startswith("s5"))
        with pytest.raises(BiodanceError, match="another run is writing here"):
            Ledger(out, archive)
        client.send_signal(how)
        try:
            said = client.communicate(timeout=30)[1]
        finally:
            client.kill()
    assert said.count("Traceback") == (how == signal.SIGINT), "that of the client alone, which is no command"
    with (archive / "s3" / "alive").open("w") as alive:
        fcntl.flock(alive, fcntl.LOCK_EX | (fcntl.LOCK_NB if how == signal.SIGINT else 0))
    found = run_batch(archive, out, workers=2, work=batch_work.count)
    assert set(worked(archive)) <= {"s3"}, "what has an outcome is not worked on again"
    assert sum(found.counts.values()) == 6
    assert not list((out / "sessions").glob(".part-*"))


def test_a_folder_that_is_taken_is_refused(tmp_path: Path) -> None:
    archive, other = archive_of(tmp_path / "a", 1), archive_of(tmp_path / "b", 1)
    run_batch(archive, tmp_path / "out", work=batch_work.count)
    with pytest.raises(BiodanceError, match=r"results of another archive \(.*a\)"):
        run_batch(other, tmp_path / "out", work=batch_work.count)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("dear")
    with pytest.raises(BiodanceError, match="nothing is overwritten"):
        run_batch(archive, tmp_path / "mine", work=batch_work.count)
    with pytest.raises(BiodanceError, match="among the recordings"):
        run_batch(other, tmp_path, work=batch_work.count)
    with pytest.raises(BiodanceError, match="at least one process"):
        run_batch(archive, tmp_path / "o", workers=0)


def test_real_sessions_end_in_tables_and_on_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = archive_of(tmp_path / "a", 1)
    biodance.simulate(biodance.Subject(61.0, 1.68, "F", 30.0), "standing", archive / "good", seed=3)
    out = tmp_path / "out"
    code = run(["batch", str(archive), "--out", str(out), "--workers", "1", "--no-pages", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert code == 1
    assert (found["sessions"], found["fresh"]) == (2, 2)
    assert [one["session"] for one in found["not_done"]] == ["s0"]
    table = pd.read_parquet(out / "summary.parquet")
    assert list(table.columns) == list(ROW_TYPES)
    good = table[table["session"] == "good"]
    assert good["declared_mass_kg"].to_numpy() == pytest.approx(61.0, abs=2.0)
    assert good["mass_difference_percent"].abs().max() < 2.0
    assert set(table.loc[table["session"] == "s0", "session_status"]) == {"refused"}
    assert len(pd.read_csv(out / "summary.csv")) == len(table)
    page = (out / "report.html").read_text()
    assert "2 sessions" in page
    assert "walk.c3d" in page
    assert (out / "sessions" / "good" / "results.json").exists()
    assert not (out / "sessions" / "good" / "report.html").exists()


def test_what_moved_stands_beside_each_trial() -> None:
    curves = [{"quantity": "knee_flexion", "side": side, "max": top} for side, top in (("left", 61.0), ("right", 64.0))]
    speed = {"quantity": "speed", "side": "both", "mean": 1.2}
    cycles = [{"kind": "gait"}, {"kind": "gait"}, {"kind": "sit_to_stand"}]
    moved = {"trial": "walk", "cycles": cycles, "events": [{}] * 5, "spatiotemporal": [speed], "curves": curves}
    trial = dict.fromkeys(("role", "status", "reason", "frames", "rate_hz", "gaps_percent"))
    trial |= {"marker_rms_m": None, "marker_max_m": None, "wrench": None, "warnings": []}
    document = {"mass_check": None, "diagnosis": None, "attention": [], "subject": {"mass_kg": 60.0}, "refused": {}}
    document |= {"trials": [{**trial, "name": "walk"}, {**trial, "name": "static"}], "movement": {"trials": [moved]}}
    walk, static = trial_rows(document)
    assert [walk[name] for name in ("gait_cycles", "squats", "rises", "foot_events")] == [2, 0, 1, 5]
    assert (walk["speed_m_per_s"], walk["knee_flexion_max_deg"], walk["hip_flexion_max_deg"]) == (1.2, 64.0, None)
    assert "gait_cycles" not in static
    assert set(walk) <= set(ROW_TYPES)
    assert walk["verdict"] == "not judged"


@pytest.mark.parametrize(
    ("seconds", "status", "findings", "told"),
    [
        (3.0, "unknown", [], "unexplained"),
        (3.0, "cannot tell", [], "cannot tell"),
        (0.0, "cannot tell", [], "not judged"),
        (0.0, "named", [{"effect": "clipping", "target": "Fz"}], "unexplained"),
    ],
)
def test_plates_alone_have_no_verdict(seconds: float, status: str, findings: list, told: str) -> None:
    trial = dict.fromkeys(("name", "role", "status", "reason", "frames", "rate_hz", "gaps_percent", "wrench"))
    trial |= {"marker_rms_m": None, "marker_max_m": None, "warnings": []}
    judged = [{"trial": "stand", "seconds": seconds, "why_not": None if seconds else "it has no markers"}]
    diagnosis = {"verdict": "unexplained", "status": status, "findings": findings, "judged": judged}
    document = {"mass_check": None, "diagnosis": diagnosis, "attention": [], "subject": {"mass_kg": 60.0}}
    (row,) = trial_rows(document | {"refused": {}, "trials": [trial], "movement": None})
    assert row["verdict"] == told


def test_what_stands_out_is_measured_by_the_archive_itself() -> None:
    def session(name: str, mass: float) -> Outcome:
        row = {"trial": "static", "status": "ok", "mass_difference_percent": mass}
        return Outcome(name, "f", SessionStatus.DONE, rows=(row,))

    usual = [session(f"s{k}", 0.1 * (-1) ** k) for k in range(9)]
    (strange,) = outliers(summary_table([*usual, session("odd", 2.4)]))
    assert (strange["session"], strange["value"]) == ("odd", "2.4 %")
    assert outliers(summary_table([*usual[:6], session("odd", 2.4)])) == []


def refused_without_room() -> BiodanceError:
    refusal = BiodanceError("results.json cannot be written")
    refusal.__cause__ = OSError(errno.ENOSPC, "No space left on device")
    return refusal


@pytest.mark.parametrize(
    ("raised", "status", "again"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "failed", True),
        (MemoryError(), "failed", True),
        (BiodanceError("broken header"), "refused", False),
        (refused_without_room(), "failed", True),
        (ZeroDivisionError("a fault of ours"), "failed", False),
    ],
)
def test_only_what_hangs_on_the_recordings_is_final(tmp_path: Path, monkeypatch, raised, status, again) -> None:
    def fails(*_: object) -> None:
        raise raised

    monkeypatch.setattr("biodance.batch.work._examined", fails)
    task = SessionTask("s0", str(archive_of(tmp_path / "a", 1) / "s0"), str(tmp_path / "out" / "s0"), "f")
    assert process_session(task).status == status
    monkeypatch.setattr("biodance.batch.work._examined", lambda *_: (SessionStatus.DONE, "", (), {}))
    assert process_session(task).status == ("done" if again else status)


@pytest.mark.parametrize("where", ["main", "thread"])
def test_a_higher_limit_tries_again_and_no_step_swallows_it(tmp_path: Path, monkeypatch, where: str) -> None:
    def forever() -> None:
        while True:
            time.sleep(0.001)

    def slow(*_: object) -> tuple[SessionStatus, str, tuple, dict]:
        steps: list = []
        attempt(steps, "track", signal.pause if where == "main" else forever)
        return SessionStatus.DONE, "ran on without its step", (), {}

    monkeypatch.setattr("biodance.batch.work._examined", slow)
    task = SessionTask("s0", str(archive_of(tmp_path / "a", 1) / "s0"), str(tmp_path / "out" / "s0"), "f", limit=0.01)
    with ThreadPoolExecutor(1) as pool:
        found = process_session(task) if where == "main" else pool.submit(process_session, task).result()
    assert (found.status, found.why, found.limit) == ("failed", "limit", 0.01)
    assert "Given up after 0 s; a higher --limit tries again." in (tmp_path / "out" / "s0" / "log.txt").read_text()
    assert found.is_final(task)
    assert found.is_final(replace(task, limit=0.005))
    assert not found.is_final(replace(task, limit=0.02))


@pytest.mark.parametrize("damage", ["deleted", "empty", "cut", "changed"])
def test_a_missing_or_damaged_outcome_is_done_again(tmp_path: Path, damage: str) -> None:
    archive, out = archive_of(tmp_path / "a", 3), tmp_path / "out"
    run_batch(archive, out, workers=1, pages=False)
    victim = out / "sessions" / "s1" / "outcome.json"
    if damage == "deleted":
        shutil.rmtree(victim.parent)
    elif damage == "changed":
        victim.write_text(victim.read_text().replace("refused", "done"))
    else:
        victim.write_bytes(victim.read_bytes()[: 0 if damage == "empty" else 40])
    again = run_batch(archive, out, workers=1, pages=False)
    assert (again.fresh, again.counts) == (1, {"refused": 3})
    assert all(one.rows for one in again.outcomes)


@pytest.mark.parametrize("damage", ["full", "no book"])
def test_a_book_that_cannot_be_written_is_one_sentence_and_no_loss(tmp_path: Path, monkeypatch, damage: str) -> None:
    archive, out = archive_of(tmp_path / "a", 2), tmp_path / "out"
    with monkeypatch.context() as patch:
        if damage == "full":
            patch.setattr("biodance.batch.run._WRITE", "SELECT no such column")
        else:
            run_batch(archive, out, workers=1)
            (out / LEDGER).write_text("no book " * 2000)
        with pytest.raises(BiodanceError, match=r"ledger\.sqlite: .*run the same command: what is done is kept"):
            run_batch(archive, out, workers=1)
    if damage == "no book":
        (out / LEDGER).unlink()
    found = run_batch(archive, out, workers=1, work=batch_work.count)
    assert (len(found.outcomes), "s0" in worked(archive)) == (2, False)


def test_the_same_recordings_in_two_folders_are_said(tmp_path: Path) -> None:
    for name, held in {"a": "1", "b": "1", "c": "2", "d": ""}.items():
        place = tmp_path / SESSIONS / name
        place.mkdir(parents=True)
        place.joinpath("results.json").write_text(name)
        write_manifest(place, tmp_path, {"walk.c3d": held, "session.toml": name} if held else {})
    tmp_path.joinpath(SESSIONS, "d", "manifest.json").write_text("{")
    assert same_recordings(tmp_path, "abcde") == [("a", "b")]
    write_summary(tmp_path, "archive", [Outcome(name, "0", "done", "") for name in "abcd"])
    assert "a, b hold the same recordings; each is counted here." in (tmp_path / "report.html").read_text()


def test_settings_and_times_of_files_belong_to_the_fingerprint(tmp_path: Path) -> None:
    session = archive_of(tmp_path / "a", 1) / "s0"
    before = fingerprint_of(session, ())
    assert fingerprint_of(session, ("filter.cutoff=6",)) != before
    (session / "walk.c3d").write_bytes(b"other number")  # as long as before
    os.utime(session / "walk.c3d", ns=(1, 1))
    assert fingerprint_of(session, ()) != before


def test_a_folder_name_that_is_no_utf8_does_not_end_the_archive(tmp_path: Path) -> None:
    archive = archive_of(tmp_path / "a", 1)
    strange = Path(os.fsdecode(os.fsencode(archive) + b"/M\xfcller"))
    strange.mkdir()
    (strange / "walk.c3d").write_bytes(b"no recording")
    found = run_batch(archive, tmp_path / "out", workers=1, pages=False)
    assert [one.name for one in found.outcomes] == ["M\\xfcller", "s0"]
    assert found.counts == {"refused": 2}
