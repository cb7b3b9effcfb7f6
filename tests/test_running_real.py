"""Running on a treadmill whose speed its laboratory set: what we tell of the belt, of contact and of flight."""

from pathlib import Path

import pytest

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
