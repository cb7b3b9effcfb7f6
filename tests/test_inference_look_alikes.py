"""A cause that is not quite what happened does not stand for it: a look-alike leaves what an unknown cause explains."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, windows
from inferred_sessions import inferred
from scipy.signal import butter, sosfiltfilt

from biodance.diagnosis.consequence import matters
from biodance.effects import NamedCause, effects
from biodance.inference.decision import _is_large

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
    right, wrong = (inferred(body(), some, tolerances=known(), effects=(name,)) for name, _ in (guilty, innocent))
    assert [(f.effect, f.target) for f in right.diagnosis.findings] == [guilty]
    assert (wrong.diagnosis.verdict, wrong.diagnosis.findings) == ("unexplained", ())


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
    untold, told = (inferred(body(), those, tolerances=known(), effects=("plate_offset",)) for those in (some, tared))
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
    found = inferred(body(), tuple(some), tolerances=replace(known(), noise=noise), effects=("plate_gain",))
    assert found.diagnosis.verdict == "named, complete"
    assert [(f.effect, f.target) for f in found.diagnosis.findings] == [("plate_gain", "Mx")]
    assert found.diagnosis.findings[0].parameters[0].value == pytest.approx(0.07, abs=0.005)


def test_the_movement_errs_by_what_the_session_shows() -> None:
    """The pelvis shakes at 2.5 to 6 Hz, more than the tolerances say: the size of a true gain is 5.6 standard
    deviations too small there, by which it would be resembled, and none once what was measured is the regressor.
    """
    rng, some = np.random.default_rng(3), []
    for window in windows(1, trials=3, hidden=about_plate(lambda local, session: local * [1, 1, 1, 1.07, 1, 1])):
        band = butter(4, (2.5, 6.0), "bandpass", fs=window.motion.rate, output="sos")
        shaken = sosfiltfilt(band, rng.normal(size=len(window.motion.a)))
        wrong = window.motion.a + 0.025 * (shaken / shaken.std())[:, None] * np.eye(window.motion.a.shape[1])[3]
        some.append(replace(window, motion=replace(window.motion, a=wrong)))
    found = inferred(body(), tuple(some), tolerances=known(), effects=("plate_gain",)).diagnosis
    assert [one.effect for one in found.findings] == ["plate_gain"]
    low, high = found.findings[0].parameters[0].interval
    assert low < 0.07 < high


def test_what_is_told_must_move_something_that_matters() -> None:
    """A leak of 1 % of a shear of some newtons is large for a plate, and a tenth of a newton."""
    some = windows(1, trials=1, hidden=about_plate(zero))
    found = inferred(body(), some, tolerances=known(), effects=("plate_offset",))
    (named,), rows = found.named, found.search.rows
    leak = NamedCause(effects()["plate_crosstalk"].at("Fy->Fz", rows.problem.cases[0]), np.array([0.01]), np.eye(1))
    assert _is_large(rows, named)
    assert not _is_large(rows, replace(named, theta=np.array([0.2])))
    assert matters(leak.effect, leak.theta)
    assert not _is_large(rows, leak)
    assert _is_large(rows, replace(leak, course={"some trial": np.ones(3)}))
