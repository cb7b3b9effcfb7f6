"""A chair carries a person who sits down on it: named, its frames left out, and no joint placed by them."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.motion.contact import carried_elsewhere
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine, identified
from biodance.records import LeftOut, Session

RISES = ("STS1", "STSAsym1", "STSweakLegs1")


@cache
def session(data: Path, folder: Path, names: tuple[str, ...]) -> Session:
    """Return a session of subject4 with its static and some other recordings."""
    for source in sorted((data / "subject4").rglob("*")):
        if source.suffix in (".trc", ".mot") and source.stem.removesuffix("_grf") in ("static1", *names):
            (folder / source.name).symlink_to(source)
    return read_session(folder)


@pytest.fixture(scope="module")
def seated(data: Path, tmp_path_factory: pytest.TempPathFactory) -> SessionResult:
    return examine(session(data, tmp_path_factory.mktemp("sts"), RISES))


def test_a_chair_is_seen_by_newton(data: Path, tmp_path: Path) -> None:
    """The plates carry nothing of 60 kg for a second, six times; in squats and jumps they carry all at all times."""
    for trial in session(data, tmp_path, ("STS1", "squats1", "DJ1")).trials:
        ready = prepare(trial)
        carried = carried_elsewhere(ready, weight=60.05 * 9.80665)
        if trial.name == "STS1":
            assert 0.3 < carried.mean() < 0.5
            assert ready.wrench.force[carried, 2].mean() < 0.2 * 60.05 * 9.80665
            assert ready.wrench.force[~carried, 2].mean() > 0.9 * 60.05 * 9.80665
        else:
            assert not carried.any()


def test_what_a_chair_carries_is_named_and_left_out(seated: SessionResult) -> None:
    """In two of the three rises: those that were examined, without the third one."""
    two = RISES[:2]
    trials = tuple(one for one in seated.trials if one.name != RISES[2])
    visit = replace(seated.session, trials=tuple(one for one in seated.session.trials if one.name != RISES[2]))
    found = diagnose_session(identified(replace(seated, session=visit, trials=trials))).diagnosis
    (first,) = found.findings
    assert (first.effect, first.target) == ("unmeasured_contact", "pelvis")
    assert first.parameters[0].value == pytest.approx(60.0 * 9.80665, rel=0.1)
    assert "in STS1, STSAsym1" in first.advice
    rows = {row.trial: row for row in found.judged}
    for name in two:
        assert rows[name].left_out[LeftOut.CARRIED_ELSEWHERE] > 5.0
        assert rows[name].seconds > 5.0


def test_a_chair_places_no_joint_and_leaves_the_table_as_it_was(seated: SessionResult) -> None:
    """With the seated frames the trunk's joint went 129 mm, and the table missed Fz by 168 N."""
    notes = " ".join(seated.body.notes)
    assert "from the static trial's place, outside the body" in notes or "trunk" not in notes.split("placed by")[-1]
    far = {error.joint: error.moved for error in seated.body.joint_errors}
    assert far.get("trunk", 0.0) < 0.1
    for name in RISES:
        assert np.all(seated[name].comparison.rms[:3] < 50.0)
