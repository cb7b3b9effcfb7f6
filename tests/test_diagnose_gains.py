"""Every finding has its own gain: a culprit gains much, one that nobody hid gains nothing and is taken back."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, windows
from inferred_sessions import inferred

from biodance.diagnosis.accept import case_fit
from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.diagnosis.reasons import Reason
from biodance.effects import NamedCause, effect
from biodance.identification.identification import identify_body
from biodance.inference.decision import Inferred
from biodance.pipeline import accepted as gains
from biodance.pipeline.judged_trials import cases_of


def faulty(local, session):
    """Fz reads 5 % too much, Fy 25 N."""
    local[:, 2] *= 1.05
    local[:, 1] += 25.0
    return local


def diagnosed(monkeypatch: pytest.MonkeyPatch) -> tuple[Inferred, gains.SessionDiagnosis]:
    """Return the diagnosis of a session with two faults, and what accepting them and a third one changes."""
    every = windows(1, trials=4, hidden=about_plate(faulty))
    by_role = {"fit": every[:2], "validate": every[2:]}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    causes = ("plate_gain", "plate_offset", "plate_drift")
    found = inferred(body(), by_role["fit"], tolerances=known(), effects=causes)
    cases = cases_of(body(), every[:2])
    fits = tuple(case_fit(case, window.use) for case, window in zip(cases, every[:2], strict=True))
    result: Any = SimpleNamespace(body=body(), trials=())
    drift = NamedCause(effect("plate_drift").at("Fx", cases[0]), np.array([20.0]), np.eye(1))
    return found, gains.accepted(result, accused(found, drift), identify_body(body(), fits))


def accused(one: Inferred, cause: NamedCause) -> Inferred:
    """Return the diagnosis with a cause named that nobody hid, before the culprits."""
    name, target, parameter = cause.effect.name, cause.effect.target, cause.effect.parameters[0]
    size = Estimate(parameter.name, float(cause.theta[0]), 1.0, parameter.unit)
    finding = Finding(name, target, (size,), (Alias(name, target, 50.0),), 1.0)
    told = replace(one.diagnosis, findings=(finding, *one.diagnosis.findings))
    return replace(one, diagnosis=told, named=(cause, *one.named))


def test_culprits_gain_each_their_own_and_a_bogus_companion_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    found, one = diagnosed(monkeypatch)
    told = one.inferred.diagnosis
    gain = {f"{f.effect} {f.target}": f.gain for f in told.findings}
    assert set(gain) == {"plate_gain Fz", "plate_offset Fy"}
    assert all(own.proven for own in gain.values())
    assert one.gain.proven
    fy, fz = 1, 2
    without = {name: own.rms_before for name, own in gain.items()}
    assert without["plate_offset Fy"][fy] > 3 * without["plate_gain Fz"][fy]
    assert without["plate_gain Fz"][fz] > 1.5 * without["plate_offset Fy"][fz]
    np.testing.assert_allclose(gain["plate_gain Fz"].rms_after, gain["plate_offset Fy"].rms_after)
    assert [(f.effect, f.target) for f in told.resembles] == [("plate_drift", "Fx")]
    assert told.resembles[0].gain.ci95[1] <= 0
    assert any(note.startswith("plate drift Fx was taken back") for note in told.notes)
    assert told.verdict == found.diagnosis.verdict


@pytest.mark.parametrize("kept", [True, False], ids=["trials were kept", "none was kept"])
def test_a_plate_that_is_wrongly_accused_is_not_corrected_and_one_that_is_wrong_is(
    monkeypatch: pytest.MonkeyPatch, kept: bool
) -> None:
    every = windows(1, trials=4 if kept else 2, hidden=about_plate(lambda local, _: local * [1, 1, 1.05, 1, 1, 1]))
    by_role = {"fit": every[:2], "validate": every[2:]}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    found = inferred(body(), by_role["fit"], tolerances=known(), effects=("plate_gain", "plate_position"))
    result: Any = SimpleNamespace(body=body(), trials=())
    cases = cases_of(body(), by_role["fit"])
    before = identify_body(body(), tuple(case_fit(c, w.use) for c, w in zip(cases, by_role["fit"], strict=True)))
    moved = NamedCause(effect("plate_position").at("plate1:x", cases[0]), np.array([0.04]), np.eye(1) * 1e-6)
    told = gains.accepted(result, accused(found, moved), before).inferred.diagnosis
    (right,), (wrong,) = told.findings, told.resembles
    assert (right.effect, right.target) == ("plate_gain", "Fz")
    assert right.gain is not None
    assert right.gain.proven
    assert set(right.gain.trials) == {window.trial.name for window in every[2 * kept :]}
    assert wrong.effect == "plate_position"
    assert wrong.gain is not None
    assert wrong.gain.ci95[1] < 0
    assert any(note.startswith("plate position plate1:x was taken back: accepting it") for note in told.notes)


@pytest.mark.parametrize(("name", "target", "there"), [("trunk_joint", "", True), ("plate_gain", "Fz", False)])
def test_kept_data_refute_a_fault_but_no_joint_that_markers_show(name: str, target: str, there: bool) -> None:
    every = windows(1, trials=2)
    found = inferred(body(), every, tolerances=known(), effects=("trunk_joint", "plate_gain"))
    assert found.diagnosis.verdict == "nothing wrong"
    kind = replace(effect(name), target=target)
    size = np.array([0.1, 0.0][: len(kind.parameters)])
    told = accused(found, NamedCause(kind, size, 1e-6 * np.eye(size.size))).refuted(0)
    assert not told.named
    assert ((name, target) in told.idle) is there
    assert (Reason.CONTRADICTED in told.diagnosis.why) is not there
    assert told.diagnosis.verdict == ("nothing wrong" if there else "unexplained")


def test_a_touch_that_came_and_went_before_is_not_judged_by_trials_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    every = windows(1, trials=2)
    by_role = {"fit": every[:1], "validate": every[1:]}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    result: Any = SimpleNamespace(body=body(), trials=())
    case = cases_of(body(), every)[0]
    touch = NamedCause(effect("external_contact").at("pelvis", case), np.zeros(3), np.eye(3))
    for window, judged in zip(every, (False, True), strict=True):
        course = {window.trial.name: np.ones(3)}
        assert gains._acts(result, replace(touch, course=course)) is judged


def test_a_habit_beside_named_causes_is_nothing_to_accept(monkeypatch: pytest.MonkeyPatch) -> None:
    every = windows(1, trials=4, hidden=about_plate(lambda local, _: local * [1, 1, 1.05, 1, 1, 1]))
    by_role = {"fit": every[:2], "validate": every[2:]}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    found = inferred(body(), by_role["fit"], tolerances=known(), effects=("plate_gain",))
    habit = Finding("toe_landmark", "both", (), (Alias("toe_landmark", "both", np.inf),), 1.0)
    told = replace(found, diagnosis=replace(found.diagnosis, findings=(*found.diagnosis.findings, habit)))
    result: Any = SimpleNamespace(body=body(), trials=())
    cases = cases_of(body(), every[:2])
    before = identify_body(body(), tuple(case_fit(c, w.use) for c, w in zip(cases, every[:2], strict=True)))
    one, last = gains.accepted(result, told, before).inferred.diagnosis.findings
    assert one.gain is not None
    assert one.gain.proven
    assert (last.effect, last.gain) == ("toe_landmark", None)


@pytest.mark.parametrize("judged", ["standing", "unchanged"])
def test_what_tells_nothing_of_a_finding_does_not_take_it_back(monkeypatch: pytest.MonkeyPatch, judged: str) -> None:
    """The trials that were kept only stand and contradict it, or the cause does nothing in any."""

    def faulty(local, session):
        return local * [1, 1, 1.05 if session[0] < 0.4 or judged == "unchanged" else 0.95, 1, 1, 1]

    every = windows(1, trials=4, hidden=about_plate(faulty))
    kept = every[2:]
    if judged == "standing":
        kept = tuple(replace(one, trial=replace(one.trial, role="static")) for one in kept)
    by_role = {"fit": every[:2], "validate": kept}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    found = inferred(body(), by_role["fit"], tolerances=known(), effects=("plate_gain",))
    if judged == "unchanged":
        monkeypatch.setattr(gains, "accept", lambda case, named: case)
    result: Any = SimpleNamespace(body=body(), trials=())
    cases = cases_of(body(), every[:2])
    before = identify_body(body(), tuple(case_fit(c, w.use) for c, w in zip(cases, every[:2], strict=True)))
    (one,) = gains.accepted(result, found, before).inferred.diagnosis.findings
    assert one.effect == "plate_gain"
    if judged == "unchanged":
        assert one.gain is None
    else:
        assert one.gain.proven
        assert set(one.gain.trials) == {window.trial.name for window in every[:2]}
