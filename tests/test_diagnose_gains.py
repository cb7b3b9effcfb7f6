"""Every finding has its own gain: a culprit gains much, one that nobody hid gains nothing and is taken back."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, windows

from biodance.diagnosis import engine
from biodance.diagnosis.accept import case_fit
from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.diagnosis.engine import Examined, assess, diagnose_trials
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.diagnosis.witness_inference import WitnessFindings
from biodance.effects import effect
from biodance.identification.identification import identify_body
from biodance.pipeline import gains
from biodance.pipeline.judged_trials import cases_of


def faulty(local, session):
    """Fz reads 5 % too much, Fy 25 N."""
    local[:, 2] *= 1.05
    local[:, 1] += 25.0
    return local


def diagnosed(monkeypatch: pytest.MonkeyPatch) -> tuple[Examined, gains.Accepted]:
    """Return the diagnosis of a session with two faults, and what accepting them and a third one changes."""
    every = windows(1, trials=4, hidden=about_plate(faulty))
    by_role = {"fit": every[:2], "validate": every[2:]}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    monkeypatch.setattr(
        engine, "significant_dependences", lambda _: {}
    )  # which would refuse the bogus drift before its gain is asked
    found = diagnose_trials(
        body(), by_role["fit"], tolerances=known(), effects=("plate_gain", "plate_offset", "plate_drift")
    )
    fits = tuple(
        case_fit(case, window.use) for case, window in zip(cases_of(body(), every[:2]), every[:2], strict=True)
    )
    result = SimpleNamespace(body=body(), trials=())
    return found, gains.accepted(result, with_bogus(found), identify_body(body(), fits))  # type: ignore[arg-type]


def with_bogus(examined: Examined) -> Examined:
    """Return the diagnosis with a drift of 20 N named that nobody hid, before the culprits."""
    naming = examined.naming
    drift = NamedCause(effect("plate_drift").at("Fx", naming.found.problem.cases[0]), np.array([20.0]), np.eye(1))
    found = replace(naming.found, named=(drift, *naming.found.named))
    return assess(
        replace(examined, naming=replace(naming, found=found, accepted=(naming.accepted[0], *naming.accepted)))
    )


def test_culprits_gain_each_their_own_and_a_bogus_companion_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    found, one = diagnosed(monkeypatch)
    told = one.examined.diagnosis
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


def accused(effect_name: str, target: str, parameter: str, value: float, unit: str) -> Finding:
    """Return what a witness says of a plate."""
    cause = Alias(effect_name, target, 50.0)
    return Finding(effect_name, target, (Estimate(parameter, value, 0.1 * abs(value), unit),), (cause,), 1.0)


RIGHT = accused("plate_gain", "plate1:Fz", "gain", 0.05, "1")
WRONG = accused("plate_position", "plate1:x", "shift", 0.04, "m")


@pytest.mark.parametrize("kept", [True, False], ids=["trials were kept", "none was kept"])
def test_a_plate_that_is_wrongly_accused_is_not_corrected_and_one_that_is_wrong_is(
    monkeypatch: pytest.MonkeyPatch, kept: bool
) -> None:
    every = windows(1, trials=4, hidden=about_plate(lambda local, _: local * [1, 1, 1.05, 1, 1, 1]))
    by_role = {"fit": every[:2] if kept else every, "validate": every[2:] if kept else ()}
    monkeypatch.setattr(gains, "windows", lambda _, roles: by_role[roles[0]])
    found = diagnose_trials(body(), by_role["fit"], tolerances=known(), effects=("plate_gain",), search=False)
    result: Any = SimpleNamespace(body=body(), trials=())
    right, wrong = gains._with_gains(result, found, (RIGHT, WRONG))
    assert right.gain is not None
    assert right.gain.proven
    assert wrong.gain is not None
    assert wrong.gain.ci95[1] < 0
    assert set(right.gain.trials) == {window.trial.name for window in every[2 * kept :]}
    said = WitnessFindings((RIGHT, WRONG), ObservedEvidence((), {}, {}))
    monkeypatch.setattr(gains, "infer_causes", lambda _: said)
    told = gains.combined_with_witnesses(result, found.diagnosis, found, ObservedEvidence((), {}, {}), {})
    assert [one.effect for one in told.findings] == ["plate_gain"]
    assert any(note.startswith("plate position plate1:x was taken back: accepting it") for note in told.notes)


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
