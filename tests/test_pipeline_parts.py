"""The parts of the pipeline on data whose truth is known: steps, quiet standing, centre of mass, marker distances,
checks, the still.
"""

import numpy as np
import pinocchio as pin
import pytest
from example_results import comparison, trial
from random_bodies import random_body, random_motion

from biodance.body.human.human import human
from biodance.errors import TrialRefused
from biodance.lab.markers.signals import MarkerGaps
from biodance.lab.markers.upright import quiet_run
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.newton import QuietStanding, facing, quiet_standing
from biodance.pipeline.identification import mass_check, standing_check, trial_checks
from biodance.pipeline.still import bone_lines
from biodance.pipeline.trial import MarkerFit, Step, TrialResult, WeighedBy, Weighing, attempt, marker_fit
from biodance.records import Markers, Motion, Plate, Subject, Trial, Wrench
from biodance.settings import CheckLimits

SUBJECT = Subject(60.0, 1.7, "F")
SQUARE = np.array([[0.3, 0.3, 0.0], [-0.3, 0.3, 0.0], [-0.3, -0.3, 0.0], [0.3, -0.3, 0.0]])


def refuse():
    raise TrialRefused("Trial x: no plate. Record with the plates on.")


def test_a_refusal_and_a_fault_are_steps_and_the_next_step_goes_on():
    steps: list[Step] = []
    assert attempt(steps, "one", lambda: 7) == 7
    assert attempt(steps, "two", refuse) is None
    assert attempt(steps, "three", lambda: 1 / 0) is None
    assert [step.status for step in steps] == ["done", "refused", "failed"]
    assert steps[1].text == "Trial x: no plate. Record with the plates on."
    assert "biodance itself failed" in steps[2].text
    assert "ZeroDivisionError" in steps[2].text


def test_ctrl_c_is_no_step():
    def stop():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt([], "one", stop)


def quiet_force():
    """Vertical force at 100 Hz: 1 s of stepping, 2 s of standing with 1 N of noise, 1 s of stepping."""
    force = 600 + 200 * np.sin(np.arange(400) / 5)
    force[100:300] = 600 + np.random.default_rng(1).normal(0, 1, 200)
    return force


def test_the_longest_steady_run_is_found():
    run = quiet_run(quiet_force(), np.ones(400, dtype=bool), 100.0)
    assert abs(run.start - 100) <= 2
    assert abs(run.stop - 300) <= 2


def test_frames_that_are_not_fully_measured_are_no_standing():
    used = np.ones(400, dtype=bool)
    used[150:310] = False
    run = quiet_run(quiet_force(), used, 100.0)
    assert 98 <= run.start <= 102
    assert run.stop == 150


@pytest.mark.parametrize(
    ("force", "used"),
    [
        (np.full(400, 13.0), np.ones(400, dtype=bool)),
        (quiet_force(), np.zeros(400, dtype=bool)),
        (600 + 200 * np.sin(np.arange(400) / 5), np.ones(400, dtype=bool)),
        (np.full(30, 600.0), np.ones(30, dtype=bool)),
    ],
    ids=["nobody on the plates", "never measured", "stepping", "too short"],
)
def test_no_standing_is_none(force, used):
    assert quiet_run(force, used, 100.0) is None


def standing_trial(*, drift: float) -> Trial:
    """60 kg stand 2 s with the centre of pressure at (0.02, -0.05) m, on one plate; the markers move by ``drift`` m."""
    time = np.arange(200) / 100
    force = np.tile([0.0, 0.0, 60 * 9.80665], (200, 1))
    wrench = Wrench(time, np.hstack([force, np.cross([0.02, -0.05, 0.0], force)]))
    xyz = np.zeros((200, 2, 3)) + drift * np.arange(200)[:, None, None] / 199
    markers = Markers(("A", "B"), time, xyz)
    return Trial("s", "static", markers, (Plate("plate1", 2, SQUARE, wrench),), trial("s").source)


def test_mass_and_place_of_a_standing_are_measured():
    found = quiet_standing(standing_trial(drift=0.0), np.ones(200, dtype=bool), None, None)
    assert found.mass == pytest.approx(60.0)
    assert found.mass_sd == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(found.cop, np.tile([0.02, -0.05], (200, 1)))
    assert found.com.size == 0
    assert np.isnan(found.com_ahead)


def test_who_sways_stands_still_for_a_part():
    """Foreign statics sway by 40 mm in 5 s; of them it was said that nobody stands still for 0.4 s."""
    found = quiet_standing(standing_trial(drift=0.025), np.ones(200, dtype=bool), None, None)
    assert found.end - found.start == pytest.approx(0.99)
    assert found.mass == pytest.approx(60.0)
    short = standing_trial(drift=0.045)  # half of it sways by 39 mm, a quarter is shorter than one second
    assert quiet_standing(short, np.ones(200, dtype=bool), None, None) is None


def test_a_walker_with_even_force_does_not_stand():
    assert quiet_standing(standing_trial(drift=0.3), np.ones(200, dtype=bool), None, None) is None


def test_the_centre_of_mass_is_that_of_pinocchio():
    rng = np.random.default_rng(4)
    body = random_body(rng)
    motion = random_motion(body, rng)
    expected = [pin.centerOfMass(body.model, body.model.createData(), q) for q in motion.q]
    np.testing.assert_allclose(centre_of_mass(body, motion), expected, atol=1e-12)


def test_somebody_who_turns_left_by_90_degrees_faces_lab_y():
    body = human(SUBJECT)
    q = np.tile(body.neutral, (3, 1))
    still = np.zeros((3, body.nv))
    np.testing.assert_allclose(facing(body, Motion(np.arange(3.0), q, still, still)), [1, 0], atol=1e-12)
    turn = pin.Quaternion(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])) * pin.Quaternion(q[0, 6], *q[0, 3:6])
    q[:, 3:7] = turn.coeffs()
    np.testing.assert_allclose(facing(body, Motion(np.arange(3.0), q, still, still)), [0, 1], atol=1e-12)


def test_marker_distances_leave_out_what_was_not_seen():
    still = np.zeros((2, 6))
    residual = np.array([[0.003, np.nan, np.nan], [0.004, 0.010, np.nan]])
    fit = marker_fit(Motion(np.arange(2.0), np.zeros((2, 7)), still, still, residual, ("A", "B", "C")))
    np.testing.assert_allclose(fit.rms, [np.sqrt(12.5e-6), 0.010, np.nan])
    np.testing.assert_allclose(fit.max, [0.004, 0.010, np.nan])
    assert fit.total_rms == pytest.approx(np.sqrt((9e-6 + 16e-6 + 100e-6) / 3))
    assert fit.total_max == 0.010


def test_every_segment_is_drawn_and_left_mirrors_right():
    body = human(SUBJECT)
    (lines,), sides = bone_lines(body, poses(body, body.neutral))
    assert {"left", "right", "middle"} == set(sides)
    height = lines[:, :, 2] - lines[:, :, 2].min()
    assert 1.55 < height.max() < 1.85
    mirrored = {tuple(np.round(line.ravel(), 6)) for line in lines * [1, -1, 1]}
    assert {
        tuple(np.round(line.ravel(), 6)) for line, side in zip(lines, sides, strict=True) if side == "left"
    } <= mirrored
    assert len(lines) == 12 + 4


def standing(mass: float, ahead: float = 0.0) -> QuietStanding:
    nothing = np.empty((0, 2))
    return QuietStanding(
        "s",
        0,
        1,
        mass,
        0.1,
        np.zeros((5, 2)),
        np.ones((5, 2)),
        np.array([1.0, 0]),
        ahead,
        0.0,
        nothing,
        (),
        np.empty((0, 4, 2)),
    )


def weighing(mass: float, sd: float = 0.1) -> Weighing:
    return Weighing(mass, sd, WeighedBy.STANDING, ("s",))


@pytest.mark.parametrize(
    ("mass", "sd", "inside"),
    [(60, 0.1, True), (61.1, 0.1, True), (61.3, 0.1, True), (61.3, 0.04, False), (58.5, 0.1, False), (62.7, 1.5, True)],
)
def test_the_mass_check_allows_two_percent_and_what_the_weighing_is_unsure_by(mass, sd, inside):
    (check,) = mass_check(SUBJECT, weighing(mass, sd), CheckLimits())
    assert check.inside is inside
    assert check.advice.startswith(f"{mass:.1f} ± {1.96 * sd:.1f} kg by ")


def test_what_is_not_known_is_not_checked():
    assert mass_check(Subject(float("nan"), 1.7, "F"), weighing(60.0), CheckLimits()) == []
    assert mass_check(Subject(60.0, 1.7, "F", guessed=("mass",)), weighing(60.0), CheckLimits()) == []
    assert mass_check(SUBJECT, None, CheckLimits()) == []
    assert standing_check(None, CheckLimits()) == []


def test_the_standing_check_is_in_millimetres():
    (check,) = standing_check(standing(60.0, ahead=-0.06), CheckLimits())
    assert (check.value, check.inside) == ("60.0 mm", False)


def test_the_checks_of_a_trial_name_what_is_outside():
    rng = np.random.default_rng(3)
    fit = MarkerFit(("A",), np.array([0.01]), np.array([0.12]), 0.01, 0.12)
    gaps = (MarkerGaps("A", 4.0, 0.1), MarkerGaps("B", 8.0, 0.1))
    result = TrialResult(trial("walk"), (Step("compare", "done"),), gaps, fit, None, comparison(rng))
    rows = {check.what: check for check in trial_checks(result, 60.0)}
    assert [name for name, check in rows.items() if not check.inside] == [
        "marker distance, largest",
        "markers not seen",
    ]
    assert rows["markers not seen"].value == "6.0 %"
    assert rows["fully measured"].value == "2.09 s"


def test_markers_calibrated_on_a_frame_of_movement_may_lie_a_root_of_two_farther():
    fit = MarkerFit(("A",), np.array([0.025]), np.array([0.12]), 0.025, 0.12)
    result = TrialResult(trial("walk"), (Step("compare", "done"),), (), fit, None, None)
    rows = {on: {check.what: check for check in trial_checks(result, 60.0, on_a_frame=on)} for on in (False, True)}
    assert [rows[on]["marker distance, RMS"].inside for on in (False, True)] == [False, True]
    assert rows[True]["marker distance, RMS"].limit == "at most 28.28 mm"
    assert rows[True]["marker distance, largest"].inside
