"""What one unit of a cause adds to what the plates measured: sign and size worked out by hand, because the advice of a
report follows the sign.
"""

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import CASES

from biodance.effects import effect
from biodance.records import CHANNELS
from biodance.spatial import wrench_about_origin, wrench_about_point

CASE = CASES[1]
CENTRE = np.array([0.4, 0.2, 0.0])
HERE = wrench_about_point(CASE.predicted, CENTRE)
"""(T, 6) the predicted wrench about the plate's centre: forces and moments along lab axes."""
TIME = CASE.motion.time / CASE.motion.time[-1]


def added(name: str, target: str, *theta: float) -> np.ndarray:
    """Return (T, 6) what a cause of size ``theta`` adds to the measured wrench, about the plate's centre."""
    cause = effect(name).at(target, CASE)
    return wrench_about_point(cause.transform(CASE, np.array(theta)).residual - CASE.residual, CENTRE)


def alone(channel: str, value: np.ndarray | float) -> np.ndarray:
    """Return (T, 6) ``value`` in one channel, zero in the others."""
    out = np.zeros_like(HERE)
    out[:, CHANNELS.index(channel)] = value
    return out


def assert_close(found: np.ndarray, expected: np.ndarray) -> None:
    """Compare to rounding, and see that there is something to compare."""
    assert np.abs(expected).max() > 1e-3
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(HERE).max())


@pytest.mark.parametrize(("axis", "first", "then"), [("x", 1, 2), ("y", 2, 0), ("z", 0, 1)])
def test_a_plate_turned_by_a_right_angle_records_what_points_forwards_as_sideways(
    axis: str, first: int, then: int
) -> None:
    """About z what acted along x is recorded along y, and what acted along y against x; about the others in turn."""
    recorded = HERE.copy()
    for start in (0, 3):
        recorded[:, start + then], recorded[:, start + first] = HERE[:, start + first], -HERE[:, start + then]
    assert_close(added("plate_rotation", f"plate1:{axis}", np.pi / 2), recorded - HERE)


def test_a_gain_reads_too_much() -> None:
    assert_close(added("plate_gain", "Fz", 0.04), alone("Fz", 0.04 * HERE[:, 2]))


def test_an_offset_is_added_at_the_centre() -> None:
    assert_close(added("plate_offset", "My", 5.0), alone("My", 5.0))


def test_crosstalk_goes_from_the_first_channel_into_the_second() -> None:
    assert_close(added("plate_crosstalk", "Fz->Mx", 0.01), alone("Mx", 0.01 * HERE[:, 2]))


def test_drift_is_negative_at_the_start_and_positive_at_the_end() -> None:
    assert_close(added("plate_drift", "Fz", 3.0), alone("Fz", 3.0 * (TIME - 0.5)))


@pytest.mark.parametrize("name", ["plate_offset", "plate_drift"])
def test_a_trial_that_saw_the_plate_empty_keeps_neither_its_zero_nor_its_drift(name: str) -> None:
    (plate,) = CASE.trial.plates
    seen = replace(plate, zero=np.array([0.4, -1.2, 3.0]))
    tared = replace(CASE, trial=replace(CASE.trial, plates=(seen,)))
    assert np.abs(effect(name).at("Fy", CASE).columns(CASE)).max() > 0
    assert not effect(name).at("Fy", CASE).columns(tared).any()


def test_a_body_mass_declared_too_small_is_positive() -> None:
    """All is in proportion: of a person who weighs as much again the plates measure as much again."""
    mass = float(CASE.phi[::10].sum())
    assert_close(wrench_about_origin(added("body_mass", "", mass), CENTRE), CASE.predicted)


def test_clothes_weigh_in_proportion_to_the_person() -> None:
    own = effect("body_mass").at("", CASE)
    weight = float(CASE.body.sip.mass.sum())
    for one in (own, *effect("body_mass").at_all_targets(CASE)):
        assert one.usual == pytest.approx(0.01 * weight)
        assert one.typical == pytest.approx([0.01 * weight])


def test_forces_of_a_clock_that_lags_are_late_at_the_end_and_early_at_the_start() -> None:
    """A stretch of 20 samples is 10 samples late at the end, nothing in the middle, 10 early at the start."""
    late = added("clock_drift", "", 20 * CASE.motion.time[1]) + HERE
    np.testing.assert_allclose(late[-1], HERE[-11], atol=1e-6 * np.abs(HERE).max())
    np.testing.assert_allclose(late[0], HERE[10], atol=1e-6 * np.abs(HERE).max())


@pytest.mark.parametrize(("axis", "channel", "sign"), [("x", "Fy", -1.0), ("y", "Fx", 1.0)])
def test_a_tilted_laboratory_sees_a_share_of_the_weight_sideways(axis: str, channel: str, sign: float) -> None:
    """Gravity (0, 0, -g) turned by a small angle about x points to +y, about y to -x; the ground pushes against it."""
    weight = 9.80665 * float(CASE.phi[::10].sum())
    found = added("lab_tilt", axis, 0.01)
    assert_close(found[:, :3], alone(channel, sign * 0.01 * weight)[:, :3])


def test_what_a_rope_carries_the_plates_miss() -> None:
    """A person beside the hook hangs at a slant: a little less than the tension is lift."""
    cause = effect("body_weight_support").targets(CASE)[0]
    lift = -added("body_weight_support", cause, 100.0, *np.zeros(5))[:, 2]
    assert np.all((lift > 95.0) & (lift <= 100.0))
