"""Folders that are written for others - BIDS, OpenSim, simulated and registered sessions - are there whole or as they
were, at whatever access to a file the power is cut.
"""

import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from example_results import full_session
from lab_sessions import person, plate
from squatting import BODY as SQUATTING
from squatting import squat

from biodance.batch.work import SessionStatus, SessionTask, outcome_of, process_session
from biodance.body.human.human import human
from biodance.body.solids import segment_solids
from biodance.cli.dance import _simulated_anew
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.plain_text import write_whole
from biodance.lab.session.results_folder import check_results, file_hash, results_folder, whole_folder
from biodance.pipeline.accepted import CORRECTED, write_corrected
from biodance.pipeline.program_folders import write_bids_folder, write_opensim_folder
from biodance.pipeline.trial import TrialResult
from biodance.records import Motion, Session, Source, Subject, Trial
from biodance.registration import write_registered
from biodance.report.files import tables_folder, write_files, write_tables
from biodance.report.write import write_session

WHO = Subject(62.0, 1.70, "F", name="S 01")
BODY = human(WHO)
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = ("os.rename", "os.link", "os.mkdir", "os.remove", "os.rmdir", "os.truncate", "os.symlink")


class PowerCutError(BaseException):
    """Nothing is written any more, by no clean-up either."""


class Power:
    """Counts every change of a file below ``place`` and every flush, and lets none happen from number ``cut`` on. Then
    the power is gone: of each file there is left what was flushed, however late its name was given.
    """

    def __init__(self) -> None:
        self.place, self.cut, self.done = "", -1, 0
        self.flushed: dict[int, bytes] = {}
        sys.addaudithook(self._seen)

    def _seen(self, event: str, words: tuple) -> None:
        if not self.place or not (event in _CHANGES or (event == "open" and (words[2] or 0) & _WRITES)):
            return
        name = os.fsdecode(words[0]) if isinstance(words[0], str | bytes | os.PathLike) else ""
        if name.startswith(self.place) or not os.path.isabs(name):
            self._step()

    def _step(self) -> None:
        if self.done >= self.cut >= 0:
            raise PowerCutError
        self.done += 1

    def _flush(self, handle: int) -> None:
        self._step()
        path = Path(f"/proc/self/fd/{handle}").resolve()
        if path.is_file():
            self.flushed[path.stat().st_ino] = path.read_bytes()

    def until(self, cut: int, place: Path, work: Callable[[], object]) -> bool:
        """Do the work until change number ``cut``; return whether it came to its end."""
        self.flushed = {path.stat().st_ino: path.read_bytes() for path in place.rglob("*") if path.is_file()}
        self.place, self.cut, self.done = str(place), cut, 0
        try:
            with mock.patch("os.fsync", self._flush):
                work()
        except PowerCutError:
            return False
        finally:
            self.place = ""
            for path in place.rglob("*"):
                if path.is_file() and path.read_bytes() != (left := self.flushed.get(path.stat().st_ino, b"")):
                    path.write_bytes(left)
        return True


POWER = Power()


def content(folder: Path) -> object:
    return {str(p.relative_to(folder)): file_hash(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def cuts(changes: int) -> Iterator[int]:
    """Yield where to cut: the first changes, the last ones, in which names change, and some of those between."""
    yield from sorted({*range(4), *range(4, changes, 9), *range(max(changes - 12, 0), changes + 1)})


def cut_everywhere(
    work: Callable[[Path], object],
    tmp_path: Path,
    *,
    before: Callable[[Path], object] | None,
    told: Callable[[Path], object] = content,
) -> int:
    """Cut the power at changes of files and ask what is ``told`` of the folder then; return how many there are."""
    whole = tmp_path / "reference" / "out"
    whole.parent.mkdir()
    if before:
        before(whole)
    old = told(whole) if before else {}
    with mock.patch("os.fsync"):
        work(whole)
    new = told(whole)
    assert new not in ({}, old)
    counted = tmp_path / "counted" / "out"
    counted.parent.mkdir()
    if before:
        before(counted)
    assert POWER.until(-1, counted.parent, lambda: work(counted))
    changes = POWER.done
    for number in cuts(changes):
        out = tmp_path / str(number) / "out"
        out.parent.mkdir()
        if before:
            before(out)
        ended = POWER.until(number, out.parent, lambda out=out: work(out))
        now = told(out) if out.is_dir() else {}
        assert now == new if ended else now in (old, new), f"half a folder at change {number}"
        if before or now == old:  # what was cut is done again
            assert POWER.until(-1, out.parent, lambda out=out: work(out))
        assert told(out) == new
        shutil.rmtree(out.parent)
    return changes


@pytest.fixture(scope="module")
def visit() -> tuple[Session, tuple[TrialResult, ...]]:
    names = tuple(joint.name for joint in BODY.joints)
    trials, found = [], []
    for name in ("walk_1", "walk_2"):
        markers = person(frames=40)
        trial = Trial(name, "fit", markers, (plate(frames=400),), Source(Path(f"{name}.trc"), "", "TRC", 100.0, 1000.0))
        still = Motion(markers.time, np.tile(BODY.neutral, (40, 1)), *np.zeros((2, 40, BODY.nv)), joint_names=names)
        trials.append(trial)
        found.append(TrialResult(replace(trial, plates=()), (), motion=still))
    return Session(WHO, tuple(trials), Path("/lab/S01")), tuple(found)


def test_a_bids_dataset_is_whole_at_any_cut(visit, tmp_path: Path) -> None:
    session, found = visit
    changes = cut_everywhere(lambda out: write_bids_folder(session, found, BODY, out), tmp_path, before=None)
    assert changes > 60


def test_a_folder_for_opensim_is_whole_at_any_cut(tmp_path: Path) -> None:
    one, solids = squat(), segment_solids(SQUATTING)

    def work(out: Path) -> None:
        write_opensim_folder((one,), SQUATTING, out, source="The table.", solids=solids)

    assert cut_everywhere(work, tmp_path, before=None) > 30


@pytest.fixture
def recorded(tmp_path: Path) -> Session:
    place = tmp_path / "raw"
    place.mkdir()
    (place / "session.toml").write_text('[subject]\nmass_kg = 62\n[plates.plate1]\nfoot = "left"\n[trials.walk]\n')
    (place / "static.c3d").write_bytes(b"a static trial")
    static = Trial("static", "static", None, (), Source(place / "static.c3d", "", "C3D", 100.0, 1000.0))
    source = Source(place / "walk.trc", "", "TRC", 100.0, 1000.0)
    return Session(WHO, (static, Trial("walk", "fit", person(frames=40), (), source)), place)


def test_a_registered_session_is_the_earlier_or_the_new_one(recorded: Session, tmp_path: Path) -> None:
    plates, walk = (plate(frames=400),), recorded["walk"]

    def earlier(out: Path) -> None:
        write_registered(out, recorded, walk, plates, said={"status": "rough"})
        (out / "notes.txt").write_text("call her")

    def work(out: Path) -> None:
        write_registered(out, recorded, walk, plates, said={"status": "registered"})

    (tmp_path / "a").mkdir()
    assert cut_everywhere(work, tmp_path / "a", before=earlier) > 8
    out = tmp_path / "a" / "reference" / "out"
    assert (out / "notes.txt").read_text() == "call her", "files of others stay"
    assert "[plates" not in (out / "session.toml").read_text()
    assert json.loads((out / "registration.json").read_text()) == {"status": "registered"}


def _of_one_run(out: Path) -> object:
    """Return whose results a folder holds, and which; all of them are of one run."""
    found = check_results(out)
    assert found is not None
    assert (found.missing, found.changed) == ((), ())
    return sorted(found.manifest.outputs), json.loads((out / "results.json").read_text())["subject"]["mass_kg"]


def test_a_report_and_what_was_accepted_are_of_one_run(tmp_path: Path, monkeypatch) -> None:
    """All that `report`, `identify` and `diagnose --accept` write, but for drawing the page."""
    monkeypatch.setattr("biodance.report.write._page", lambda *_, **__: "<html>")
    first, session = full_session(), replace(full_session().session, trials=())
    second = replace(first, session=replace(first.session, subject=replace(first.session.subject, mass=95.0)))

    def earlier(out: Path) -> None:
        place = results_folder(out, session.folder)
        write_session(first, None, place.part)
        write_files(place.part, {"subject.html": "hers", "body.json": "hers"})
        place.finish(session.folder, {})

    def work(out: Path) -> None:
        place = results_folder(out, session.folder, force=True)
        write_session(second, None, place.part)
        write_corrected(session, (), (), place.part / CORRECTED)
        write_files(place.part, {"lab.toml": "of this run"})
        place.finish(session.folder, {})

    assert cut_everywhere(work, tmp_path, before=earlier, told=_of_one_run) > 25


def test_a_session_of_an_archive_is_done_or_not(tmp_path: Path, monkeypatch) -> None:
    def examined(task: SessionTask, part: Path, tell: Callable[[str], None]) -> tuple:
        write_files(part, {"results.json": "{}", "report.html": ""})
        return SessionStatus.DONE, "", ({"trial": "walk"},), {}

    def task(out: Path) -> SessionTask:
        return SessionTask("s0", str(tmp_path), str(out / "s0"), "f")

    def told(out: Path) -> object:
        found = outcome_of(task(out))
        return (found.status, found.rows, check_results(out / "s0").whole) if found else {}

    monkeypatch.setattr("biodance.batch.work._examined", examined)
    assert cut_everywhere(lambda out: process_session(task(out)), tmp_path, before=None, told=told) > 20


def test_tables_are_those_of_one_run(tmp_path: Path) -> None:
    def tables(out: Path, *names: str) -> None:
        with whole_folder(tables_folder(out, tmp_path / "session", force=True), over=True) as part:
            write_tables({name: pd.DataFrame({"x": [1.0]}) for name in names}, part)

    def work(out: Path) -> None:
        tables(out, "angles", "moments")

    assert cut_everywhere(work, tmp_path, before=lambda out: tables(out, "angles", "findings")) > 6


def _simulated(out: Path, truth: str) -> None:
    (out / "truth").mkdir(parents=True)
    (out / "session.toml").write_text("[subject]\n")
    (out / "truth" / "truth.json").write_text(truth)


def test_a_simulated_session_is_replaced_whole(tmp_path: Path) -> None:
    def again(out: Path) -> None:
        with _simulated_anew(out, force=True) as place, whole_folder(place) as part:
            _simulated(part, "of the second")

    assert cut_everywhere(again, tmp_path, before=lambda out: _simulated(out, "of the first")) > 6


def test_a_simulation_that_is_cut_leaves_no_session(tmp_path: Path, monkeypatch) -> None:
    """The real command, cut at its first, a middle and its last changes."""
    from biodance.virtual_lab import simulate as room

    made: list[int] = []

    def work(out: Path) -> None:
        room.simulate_session(Subject(62.0, 1.70, "F", 31.0), "standing", out, seed=1)

    (tmp_path / "whole").mkdir()
    POWER.until(10**9, tmp_path / "whole", lambda: work(tmp_path / "whole" / "out"))
    made.append(POWER.done)
    for cut in (1, made[0] // 2, made[0] - 2):
        place = tmp_path / str(cut)
        place.mkdir()
        assert not POWER.until(cut, place, lambda place=place: work(place / "out"))
        assert not (place / "out").exists()


def test_trials_of_one_name_are_refused_before_anything_is_written(visit, tmp_path: Path) -> None:
    session, found = visit
    alike = tuple(replace(one, name=name) for one, name in zip(session.trials, ("walk-1", "WALK_1"), strict=True))
    with pytest.raises(SessionRefused, match="walk-1 and WALK_1 would both be called"):
        write_bids_folder(replace(session, trials=alike), (), BODY, tmp_path / "bids")
    twins = tuple(replace(one, trial=replace(one.trial, name=n)) for one, n in zip(found, ("a", "A"), strict=True))
    with pytest.raises(SessionRefused, match=r"would both be called"):
        write_opensim_folder(twins, BODY, tmp_path / "osim", source="")
    named = tuple(
        replace(one, trial=replace(one.trial, name=n)) for one, n in zip(found, ("a", "a_forces"), strict=True)
    )
    with pytest.raises(SessionRefused, match=r"would both be called a_forces\.mot"):
        write_opensim_folder(named, BODY, tmp_path / "osim", source="")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_in_the_middle_leaves_nothing(visit, tmp_path: Path, monkeypatch) -> None:
    session, found = visit
    from biodance.lab.session import results_folder as rooms

    def full(_: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(rooms, "flush", full)
    with pytest.raises(SessionRefused, match=r"No space left on device.*as before"):
        write_bids_folder(session, found, BODY, tmp_path / "bids")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("over", [False, True])
def test_a_single_file_is_whole_at_any_cut(tmp_path: Path, over: bool) -> None:
    for cut in range(6):
        path = tmp_path / f"model{cut}.osim"
        if over:
            path.write_bytes(b"<old/>")
        ended = POWER.until(cut, tmp_path, lambda path=path: write_whole(path, b"<whole/>", over=over))
        assert (path.read_bytes() if path.exists() else b"") in (
            (b"<whole/>",) if ended else (b"<old/>" * over, b"<whole/>")
        )
    if not over:
        with pytest.raises(FileRefused, match="exists already"):
            write_whole(path, b"<other/>")
