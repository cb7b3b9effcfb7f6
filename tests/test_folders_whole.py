"""Folders that are written for others - BIDS, OpenSim, simulated and registered sessions - are there whole or as they
were, at whatever access to a file the power is cut.
"""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lab_sessions import person, plate
from squatting import BODY as SQUATTING
from squatting import squat

from biodance.body.human.human import human
from biodance.body.solids import segment_solids
from biodance.cli.virtual import _simulated_anew
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.plain_text import write_whole
from biodance.lab.session.manifest import file_hash
from biodance.lab.session.results_folder import whole_folder
from biodance.lab.session.write import write_registered
from biodance.pipeline.program_folders import write_bids_folder, write_opensim_folder
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Motion, Session, Source, Subject, Trial

WHO = Subject(62.0, 1.70, "F", name="S 01")
BODY = human(WHO)
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = ("os.rename", "os.link", "os.mkdir", "os.remove", "os.rmdir", "os.truncate", "os.symlink")


class PowerCutError(BaseException):
    """Nothing is written any more, by no clean-up either."""


class Power:
    """Counts every change of a file below ``place`` and lets none happen from number ``cut`` on."""

    def __init__(self) -> None:
        self.place, self.cut, self.done = "", -1, 0
        sys.addaudithook(self._seen)

    def _seen(self, event: str, words: tuple) -> None:
        if not self.place or not (event in _CHANGES or (event == "open" and (words[2] or 0) & _WRITES)):
            return
        name = os.fsdecode(words[0]) if isinstance(words[0], str | bytes | os.PathLike) else ""
        if not name.startswith(self.place) and os.path.isabs(name):
            return
        if self.done >= self.cut >= 0:
            raise PowerCutError
        self.done += 1

    def until(self, cut: int, place: Path, work: Callable[[], object]) -> bool:
        """Do the work until change number ``cut``; return whether it came to its end."""
        self.place, self.cut, self.done = str(place), cut, 0
        try:
            work()
        except PowerCutError:
            return False
        finally:
            self.place = ""
        return True


POWER = Power()


def content(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): file_hash(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def cut_everywhere(work: Callable[[Path], object], tmp_path: Path, *, before: Callable[[Path], object] | None) -> int:
    """Cut the power at every change of a file; return how many there are."""
    whole, number = tmp_path / "reference" / "out", 0
    whole.parent.mkdir()
    if before:
        before(whole)
    old = content(whole) if before else {}
    work(whole)
    new = content(whole)
    assert new
    while True:
        out = tmp_path / str(number) / "out"
        out.parent.mkdir()
        if before:
            before(out)
        ended = POWER.until(number, tmp_path, lambda out=out: work(out))
        now = content(out) if out.is_dir() else {}
        assert now in (old, new), f"half a folder at change {number}: {sorted(set(now) ^ set(new))}"
        if ended:
            assert now == new
            return number
        if now == old:
            work(out)  # what was cut is done again
            assert content(out) == new
        number += 1


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


def test_a_file_on_a_full_disk_is_as_before(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "lab.toml").write_text("old")

    def full(_: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("biodance.lab.plain_text.flush", full)
    with pytest.raises(FileRefused, match="No space left on device"):
        write_whole(tmp_path / "lab.toml", b"new", over=True)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]
