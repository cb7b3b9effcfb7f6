"""Faults of forces too large for gates and statistics: found before them, undone in a copy, and nothing else named."""

import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import two_plates
from shared_markers import examined_beside
from two_plates import changed, exchanged, foreign, late, session, weak

from biodance.effects import Recorded
from biodance.effects.dead_plate import DeadPlate
from biodance.effects.frame_rate import FrameRate
from biodance.effects.plate_gain import PlateGain
from biodance.effects.plates_exchanged import PlatesExchanged
from biodance.effects.time_delay import TimeDelay
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.judged_trials import recorded_of
from biodance.pipeline.results import SessionDiagnosis
from biodance.pipeline.session import examine
from biodance.records import Plate, Wrench
from biodance.report.write import write_diagnosis


def diagnosed(monkeypatch: pytest.MonkeyPatch, *change) -> SessionDiagnosis:
    """Return what is found in the session with a change in it."""
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    return diagnose_session(examined_beside(changed(session(), *change) if change else session()))


def names(found: SessionDiagnosis) -> list[tuple[str, str, tuple[str, ...]]]:
    return [(one.effect, one.target, one.trials) for one in found.findings]


def test_beside_a_session_with_the_same_markers_all_is_found_as_alone(monkeypatch):
    """What these tests share of one session is what each would have found by itself."""
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    wrong, first = changed(session(), weak), examined_beside(session())
    beside, alone = examined_beside(wrong), examine(wrong)
    assert beside.placed is first.placed
    assert alone.placed is not first.placed
    np.testing.assert_array_equal(beside.body.sip.phi, alone.body.sip.phi)
    for one, other in zip(beside.trials, alone.trials, strict=True):
        np.testing.assert_array_equal(one.motion.q, other.motion.q)
        np.testing.assert_array_equal(one.comparison.simulated, other.comparison.simulated)
        np.testing.assert_array_equal(one.comparison.rms, other.comparison.rms)


def test_nothing_is_undone_without_a_fault(monkeypatch):
    found = diagnosed(monkeypatch)
    assert found.mended is None
    assert names(found) == []


@pytest.mark.parametrize("declared", [True, False])
def test_a_mass_is_wrong_only_where_one_was_declared(declared, monkeypatch):
    """What the plates weighed is right for these plates; who asks for the mass by name is answered all the same."""
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    visit = session()
    subject = replace(visit.subject, mass=1.08 * visit.subject.mass, guessed=() if declared else ("mass",))
    result = examined_beside(replace(visit, subject=subject))
    assert any(one.effect == "body_mass" for one in diagnose_session(result).findings) is declared
    assert any(one.effect == "body_mass" for one in diagnose_session(result, effects=["body_mass"]).findings)


def test_plates_that_weighed_the_person_are_held_against_each_other_alone(data, tmp_path):
    """Nobody declared a mass; plate 1 reads 30 % too little and weighs the person with plate 2, which is no name."""
    for name in ("static1", "squats1", "walking1"):
        for file in (data / "subject4").glob(f"{name}[._]*"):
            shutil.copy(file, tmp_path)
    visit = changed(read_session(tmp_path), lambda plates: weak(plates[::-1])[::-1])
    assert "mass" in visit.subject.guessed
    (static,) = visit.of_role("static")
    weighed = static.wrench.value[:, 2].mean() / static.settings.gravity
    found = diagnose_session(examine(replace(visit, subject=replace(visit.subject, mass=weighed))))
    for one in found.findings:
        assert any(target.startswith("plate1") for target in [one.target, *(alias.target for alias in one.set)])


@pytest.mark.parametrize("seconds", [0.1, 0.2, 0.4])
def test_a_delay_of_one_trial_is_named_there_with_its_size(seconds, monkeypatch):
    found = diagnosed(monkeypatch, late(seconds), "squat_1")
    assert names(found) == [("time_delay", "", ("squat_1",))]
    size = found.findings[0].parameters[0]
    assert size.value == pytest.approx(seconds, abs=0.02)
    assert 0 < size.sd < 0.02
    assert "squat_1" in found.diagnosis.attention[0].text


def test_a_delay_of_all_trials_is_one_finding_without_companions(monkeypatch):
    found = diagnosed(monkeypatch, late(0.1))
    assert names(found) == [("time_delay", "", ())]
    assert found.findings[0].parameters[0].value == pytest.approx(0.1, abs=0.02)
    assert found.mended is not None


def test_a_plate_that_reads_seven_tenths_in_all_trials_is_no_body_mass_alone(monkeypatch):
    found = diagnosed(monkeypatch, weak)
    assert names(found) == [("plate_gain", "plate2", ())]
    assert found.findings[0].parameters[0].value == pytest.approx(-0.3, abs=0.05)


def test_a_plate_that_reads_seven_tenths_in_one_trial_is_named_there(monkeypatch):
    found = diagnosed(monkeypatch, weak, "squat_2")
    assert names(found) == [("plate_gain", "plate2", ("squat_2",))]
    assert all(alias.effect != "body_mass" for alias in found.findings[0].set)


def test_exchanged_plates_are_named(monkeypatch):
    found = diagnosed(monkeypatch, exchanged)
    assert names(found) == [("plates_exchanged", "plate1/plate2", ())]


def test_plates_exchanged_in_one_trial_are_named_there():
    checks = PlatesExchanged.check(Recorded(changed(session(), exchanged, "squat_2")))
    assert [(one.ok, one.trials) for one in checks] == [(False, ("squat_2",))]


def test_forces_of_another_trial_are_never_fine(monkeypatch):
    found = diagnosed(monkeypatch, foreign, "squat_1")
    assert ("unrelated_forces", "", ("squat_1",)) in names(found)
    assert next(row for row in found.diagnosis.judged if row.trial == "squat_1").seconds == 0


@pytest.mark.parametrize("beside", ["static", "squat_2"])
def test_a_plate_that_a_trial_lacks_stops_nothing(beside, monkeypatch):
    """As where a reader leaves out a dead plate: a third one, on which nobody stands, is in one trial alone."""
    far = replace(session().trials[0].plates[0], name="plate3", corners=two_plates.HALF + np.array([2.0, 0, 0]))
    quiet = Wrench(far.wrench.time, two_plates.NOISE * np.random.default_rng(5).normal(size=far.wrench.value.shape))
    found = diagnosed(monkeypatch, lambda plates: (*plates, replace(far, wrench=quiet)), beside)
    assert names(found) == []
    assert found.diagnosis.status == "clean"


def silent(*plates: str):
    """Return a change: these plates read zero to the last bit."""

    def change(them: tuple[Plate, ...]) -> tuple[Plate, ...]:
        return tuple(
            replace(p, wrench=Wrench(p.wrench.time, 0 * p.wrench.value)) if p.name in plates else p for p in them
        )

    return change


def test_a_plate_that_reads_nothing_under_a_foot_is_dead(monkeypatch):
    """Weight and movement are missing with it; without it the squats are feet beside the plates."""
    found = diagnosed(monkeypatch, silent("plate1"))
    assert names(found) == [("dead_plate", "plate1", ("static", "squat_1", "squat_2"))]


@pytest.mark.parametrize(("plates", "trial"), [(("plate1", "plate2"), "static"), ((), "")])
def test_a_trial_in_which_no_force_was_recorded_has_no_dead_plate(plates, trial, monkeypatch):
    found = diagnosed(monkeypatch, silent(*plates), *[trial] * bool(trial))
    assert "dead_plate" not in [one[0] for one in names(found)]


def test_a_real_walk_over_a_plate_of_zeros_names_it_where_a_foot_stands(data: Path) -> None:
    """Its other plate, too, reads zero to the last bit in the static trial: nobody stands on it there."""
    visit = read_session(data / "biomechzoo/HC044A")
    for plates, trials in (((), ()), (("plate1",), ("HC044A15", "HC044A29"))):
        recorded = recorded_of(examine(changed(visit, silent(*plates))))
        failed = [one for one in DeadPlate.check(recorded) if not one.ok]
        assert [(one.target, one.trials) for one in failed] == [(name, trials) for name in plates]


WALKS = [("biomechzoo/HC044A", "HC044A15"), ("c3d_parser_QCMAS", "QCMAS.dynamic"), ("c3d_parser_Sydney", "S4-AMGait04")]


@pytest.mark.parametrize(("folder", "name"), WALKS)
def test_large_delays_of_real_walks_are_named_with_their_size(folder: str, name: str, data: Path) -> None:
    visit = read_session(data / folder)
    for seconds in (0.1, 0.2):
        failed = [one for one in TimeDelay.check(Recorded(changed(visit, late(seconds), name))) if not one.ok]
        assert [one.size for one in failed] == [pytest.approx(seconds, abs=0.015)]


def test_a_real_plate_that_reads_seven_tenths_in_one_trial_is_named_and_no_clock(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Deep squats, in which the pelvis goes back by more than a step; the body alone would ask for another rate."""
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    for source in sorted((data / "subject4").iterdir()):
        if source.stem.removesuffix("_grf") in ("static1", "squats1", "squatsAsym1"):
            (tmp_path / source.name).symlink_to(source)
    visit = read_session(tmp_path)
    for number in (None, 1, 2):
        change = [partial(weak, number=number), "squats1"] if number else [lambda plates: plates]
        seen = recorded_of(examined_beside(changed(visit, *change)))
        failed = [(one.target, one.trials) for one in PlateGain.check(seen) if not one.ok]
        assert failed == ([(f"plate{number}", ("squats1",))] if number else [])
        assert all(one.ok for one in FrameRate.check(seen))


@pytest.mark.parametrize(("number", "too_much"), [(1, False), (2, False), (1, True)])
def test_of_plates_that_weighed_the_person_one_reads_less_than_the_other(
    number: int, too_much: bool, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody declared a mass, so that the weight of no trial is right; where the pressure lies tells the plates apart,
    and only the mass which of the two is wrong. Without it the person is weighed again, and nothing is proven.
    """
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    for source in sorted((data / "subject4").iterdir()):
        if source.stem.removesuffix("_grf") in ("static1", "squats1", "squatsAsym1"):
            (tmp_path / source.name).symlink_to(source)
    share = 1 / 0.7 if too_much else 0.7
    visit = changed(read_session(tmp_path), lambda plates: weak(plates, number=number, share=share))
    (static,) = visit.of_role("static")
    weighed = static.wrench.value[:, 2].mean() / static.settings.gravity
    visit = replace(visit, subject=replace(visit.subject, mass=weighed))
    result = examine(visit)
    found = diagnose_session(result)
    less, more = ("plate2", "plate1") if (number == 2) != too_much else ("plate1", "plate2")
    first = found.findings[0]
    assert [(one.effect, one.target) for one in first.set] == [("plate_gain", less), ("plate_gain", more)]
    assert first.trials == ()
    assert first.parameters[0].value == pytest.approx(-0.3, abs=0.04)
    assert {one.effect for one in found.findings} <= {"plate_gain", "toe_landmark"}
    assert "accept" not in found.diagnosis.attention[0].text
    (tmp_path / "out").mkdir()
    accepted = write_diagnosis(result, found, tmp_path / "out", accept=())["accepted"]
    assert accepted["written"] == accepted["corrections"] == []
    assert accepted["not_applied"][0]["why"] == f"nothing tells it from plate gain {more}"


def test_what_is_undone_is_the_recording_again():
    one = two_plates.session()
    wrong = changed(one, late(0.2), "squat_1")
    (failed,) = [check for check in TimeDelay.check(Recorded(wrong)) if not check.ok]
    (again,) = TimeDelay.check(
        Recorded(changed(wrong, lambda p: TimeDelay.undone(wrong.trials[1], failed).plates, "squat_1"))
    )
    assert again.ok
