"""Running on a treadmill whose speed its laboratory set: what we tell of the belt, of contact and of flight."""

from pathlib import Path

import numpy as np
import pytest

from biodance.lab.session.read import read_session
from biodance.pipeline.movement import describe_movement

SET = {"runT25": 2.5, "runT35": 3.5}
"""m/s of the belt (Fukuchi, Fukuchi and Duarte 2017)."""


@pytest.fixture(scope="module")
def moved(data: Path):
    return describe_movement(data / "rbds" / "S001")


@pytest.mark.parametrize("trial", SET)
def test_the_speed_is_that_of_the_belt_and_runners_fly(moved, trial: str) -> None:
    found = moved[trial].spatiotemporal()
    assert found["speed"][0] == pytest.approx(SET[trial], rel=0.02)
    stride = found["stride_time"][0]
    assert 2 * (found["contact_time"][0] + found["flight_time"][0]) == pytest.approx(stride, rel=0.05)
    assert "double_support" not in found
    assert 10.0 < found["vertical_stiffness"][0] < 40.0  # Morin et al. 2005: 20 to 38 kN/m at 3.3 to 6.7 m/s


def test_two_speeds_in_one_mean_are_told(moved) -> None:
    assert moved.gait.runs
    slow, fast = moved.gait.speeds
    assert (slow, fast) == pytest.approx((2.5, 3.5), rel=0.02)


def test_no_strike_of_a_runner_comes_before_the_belt_carries_him(data: Path) -> None:
    """The low-passed force of S017 swings to 42 N between two steps, by which 22 of 81 strikes came 20 to 90 ms early;
    their cycles then looked like spikes, and both feet low in flight like two on one belt.
    """
    session = read_session(data / "rbds" / "S017")
    moved = describe_movement(session)
    for trial in session.trials:
        if trial.name in SET:
            wrench = trial.plates[0].wrench
            over = np.convolve(wrench.force[:, 2], np.ones(5) / 5, mode="same") > 100
            begins = wrench.time[1:][over[1:] & ~over[:-1]]
            strikes = np.array([one.time for one in moved[trial.name].events if one.down])
            late = strikes - begins[np.abs(begins[:, None] - strikes).argmin(axis=0)]
            assert late.size > 70
            assert np.abs(late + 0.01).max() < 0.015
    assert moved.gait is not None
    assert len(moved.gait.left_out) <= 3
