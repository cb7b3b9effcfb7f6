"""A cause is named only where it has one size everywhere: a look-alike, whose size hangs on the load, is resembled."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, redrawn, windows
from scipy.signal import butter, sosfiltfilt

from biodance.diagnosis import witness_evidence
from biodance.diagnosis.adequacy import CONFLICT_LIMIT, LIMIT, conflict_at_own_noise, energies, prior_data_conflict
from biodance.diagnosis.combine_witnesses import combine_findings
from biodance.diagnosis.consequence import matters
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Unobservable
from biodance.diagnosis.engine import _is_reportable, diagnose_trials
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.naming import build_model
from biodance.diagnosis.problem import problem
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.size_dependence import changes_wrench, size_dependences
from biodance.diagnosis.witness_inference import WitnessFindings
from biodance.effects import effects
from biodance.observations import ObservableCause, Observation
from biodance.pipeline.reason_words import reason_notes

ZERO, LEAK = ("plate_offset", "Fx"), ("plate_crosstalk", "Fz->Fx")


def zero(local, session):
    local[:, 0] += 25.0
    return local


def leaking(local, session):
    local[:, 0] += 0.04 * local[:, 2]
    return local


@pytest.mark.parametrize(("change", "guilty", "innocent"), [(zero, ZERO, LEAK), (leaking, LEAK, ZERO)])
def test_a_zero_and_a_leak_of_the_load_do_not_stand_for_one_another(change, guilty, innocent) -> None:
    some = windows(1, trials=2, hidden=about_plate(change))
    right, wrong = (
        diagnose_trials(body(), some, tolerances=known(), effects=(name,)) for name, _ in (guilty, innocent)
    )
    assert [(f.effect, f.target) for f in right.diagnosis.findings] == [guilty]
    assert not right.diagnosis.findings[0].varies_with
    assert max(abs(one.z) for one in size_dependences(right.naming.found)) < LIMIT
    assert (wrong.diagnosis.verdict, wrong.diagnosis.findings) == ("unexplained", ())
    like = next(f for f in wrong.diagnosis.resembles if (f.effect, f.target) == innocent)
    assert like.varies_with
    assert any("the size of this one hangs on" in note for note in reason_notes(wrong.diagnosis))
    if innocent == ZERO:  # a leak is in proportion to the load: its size as a zero doubles with it
        by_load = next(one for one in size_dependences(wrong.naming.found) if (one.cause, one.over) == (ZERO, "load"))
        assert by_load.share == pytest.approx(1.0, abs=0.35)


def test_a_zero_that_the_reader_took_off_in_one_trial_is_that_of_the_others() -> None:
    """Two of four trials saw the plate empty: the reader took the 25 N off there, and nowhere else."""
    some = windows(
        1, trials=4, hidden=about_plate(lambda local, session: zero(local, session) if session[0] < 0.4 else local)
    )
    plates = [window.trial.plates[0] for window in some]
    tared = tuple(
        replace(window, trial=replace(window.trial, plates=(replace(plate, zero=np.array([25.0, 0, 0]) * (k > 1)),)))
        for k, (window, plate) in enumerate(zip(some, plates, strict=True))
    )
    untold, told = (
        diagnose_trials(body(), those, tolerances=known(), effects=("plate_offset",)) for those in (some, tared)
    )
    assert not untold.diagnosis.findings
    (found,) = told.diagnosis.findings
    assert (found.effect, found.target) == ZERO
    assert found.parameters[0].value == pytest.approx(25.0, abs=1.0)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_gain_is_not_doubted_where_the_movement_itself_errs(seed: int) -> None:
    """Markers shake the pelvis at 2.5 to 6 Hz as much as sessions without fault do, and the plate reads 7 % too much:
    there the error of what the movement needs is a good part of it, and its share in the residual has the other sign.
    """
    rng, some = np.random.default_rng(seed), []
    for window in windows(1, trials=3, hidden=about_plate(lambda local, session: local * [1, 1, 1, 1.07, 1, 1])):
        band = butter(4, (2.5, 6.0), "bandpass", fs=window.motion.rate, output="sos")
        shaken = sosfiltfilt(band, rng.normal(size=len(window.motion.a)))
        wrong = window.motion.a + 0.025 * (shaken / shaken.std())[:, None] * np.eye(window.motion.a.shape[1])[3]
        some.append(replace(window, motion=replace(window.motion, a=wrong)))
    noise = known().noise.copy()
    noise[4, 3, 3] = 1.0
    found = diagnose_trials(body(), tuple(some), tolerances=replace(known(), noise=noise), effects=("plate_gain",))
    assert found.diagnosis.verdict == "named, complete"
    assert [(f.effect, f.target) for f in found.diagnosis.findings] == [("plate_gain", "Mx")]
    assert found.diagnosis.findings[0].parameters[0].value == pytest.approx(0.07, abs=0.005)


def test_the_movement_errs_by_what_the_session_shows() -> None:
    """The pelvis shakes at 2.5 to 6 Hz, and no session without fault left as little there as the tolerances say: the
    size of a true gain is 5.6 standard deviations too small there, by which it would be resembled, and none once what
    was measured is the regressor.
    """
    rng, some = np.random.default_rng(3), []
    for window in windows(1, trials=3, hidden=about_plate(lambda local, session: local * [1, 1, 1, 1.07, 1, 1])):
        band = butter(4, (2.5, 6.0), "bandpass", fs=window.motion.rate, output="sos")
        shaken = sosfiltfilt(band, rng.normal(size=len(window.motion.a)))
        wrong = window.motion.a + 0.025 * (shaken / shaken.std())[:, None] * np.eye(window.motion.a.shape[1])[3]
        some.append(replace(window, motion=replace(window.motion, a=wrong)))
    little = replace(known(), energy=0.01 * known().energy)
    found = diagnose_trials(body(), tuple(some), tolerances=little, effects=("plate_gain",)).naming.found
    assert [one.effect.name for one in found.named] == ["plate_gain"]
    (quick,) = (one for one in size_dependences(found) if one.over == "2.5-6 Hz")
    assert abs(quick.z) < 1.0


def test_what_is_told_must_move_something_that_matters() -> None:
    """A leak of 1 % of a shear of some newtons is large for a plate, and a tenth of a newton."""
    some = windows(1, trials=1, hidden=about_plate(zero))
    found = diagnose_trials(body(), some, tolerances=known(), effects=("plate_offset",)).naming.found
    (named,) = found.named
    leak = NamedCause(effects()["plate_crosstalk"].at("Fy->Fz", found.problem.cases[0]), np.array([0.01]), np.eye(1))
    assert changes_wrench(found, named)
    assert _is_reportable(found, named)
    assert not changes_wrench(found, replace(named, theta=np.array([0.2])))
    assert matters(leak.effect, leak.theta)
    assert not _is_reportable(found, leak)
    assert _is_reportable(found, replace(leak, course={"some trial": np.ones(3)}))


def a_finding(value: float, varies_with: str = "") -> Finding:
    size = Estimate("offset", value, 0.5, "N")
    return Finding(*ZERO, (size,), (Alias(*ZERO, 30.0),), 0.5, varies_with=varies_with)


HEARD = witness_evidence.ObservedEvidence((), {}, {}, {})
DOUBTED = Diagnosis("unexplained", (), limits=(Unobservable(*ZERO, 2.0, "N"),), why={Reason.TOLERANCES_DO_NOT_HOLD: ()})


@pytest.mark.parametrize(
    ("simulation", "named"),
    [
        (replace(DOUBTED, candidates=(Alias(*ZERO, -4.0),)), False),
        (replace(DOUBTED, candidates=(Alias(*ZERO, 40.0),)), True),
        (replace(DOUBTED, candidates=(Alias(*ZERO, 40.0),), resembles=(a_finding(9.0, "load"),)), False),
        (replace(DOUBTED, candidates=(Alias(*ZERO, -4.0),), limits=()), True),
    ],
)
def test_a_witness_names_nothing_of_which_the_simulation_saw_no_trace(simulation: Diagnosis, named: bool) -> None:
    one = combine_findings(simulation, WitnessFindings((a_finding(9.2),), HEARD), HEARD, judged=True)
    assert bool(one.findings) is named


MASS = ("body_mass", "")


def weighed(value: float, sd: float, varies_with: str = "") -> Finding:
    return Finding(*MASS, (Estimate("error", value, sd, "kg"),), (Alias(*MASS, 12.0),), 0.5, varies_with=varies_with)


def observed(witness: str) -> witness_evidence.ObservedEvidence:
    one = Observation(witness, "mass", "stand", 66.0, 0.5, 70.0, "kg")
    step = ObservableCause(*MASS, "error", "kg", 0.5)
    return witness_evidence.ObservedEvidence((one,), {MASS: step}, {MASS: np.array([1.0])})


@pytest.mark.parametrize(
    ("value", "varies_with", "witness", "named"),
    [
        (-4.2, "2.5-6 Hz", "standing_force", True),
        (-4.2, "Mx", "stride_force", True),
        (-4.2, "load", "standing_force", False),  # what the plates weigh grows with the load: a gain
        (-4.2, "0-0.04 Hz", "standing_force", False),
        (-1.0, "2.5-6 Hz", "standing_force", False),  # another size than the plates weigh
        (-4.2, "2.5-6 Hz", "force_onset", False),  # feet that lift see what is fast
    ],
)
def test_what_the_plates_weigh_stays_named_though_fast_bands_depart(
    value: float, varies_with: str, witness: str, named: bool
) -> None:
    limits = (Unobservable(*MASS, 0.5, "kg"),)
    simulation = Diagnosis("unexplained", (), limits=limits, resembles=(weighed(value, 0.4, varies_with),))
    said = observed(witness)
    one = combine_findings(simulation, WitnessFindings((weighed(-3.9, 0.8),), said), said, judged=True)
    assert [(f.effect, f.parameters[0].value) for f in one.findings] == ([("body_mass", -3.9)] if named else [])
    assert len(one.resembles) == (0 if named else 1)


def test_a_loud_person_makes_no_body_strange_and_a_strange_body_stays_strange() -> None:
    """Everything 2.4 times as loud as known pulls the body about; its deviations are then no news. A body three times
    as unlike the table as people are stays strange beside the usual noise.
    """
    found, _ = build_model(problem(body(), windows(3, trials=2)), known(), ("plate_offset",))
    rng = np.random.default_rng(7)
    loud, strange = redrawn(found, rng, unlike=2.0, loud=2.4), redrawn(found, rng, unlike=3.0)
    assert np.median(energies(loud)) > 2.0
    assert prior_data_conflict(loud) > CONFLICT_LIMIT
    assert conflict_at_own_noise(loud) < prior_data_conflict(loud)
    assert conflict_at_own_noise(strange) > CONFLICT_LIMIT
