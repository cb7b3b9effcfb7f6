"""Squats and rises told by depth, force share of the feet and rise of the force, on movements made by hand."""

import numpy as np
import pytest

from biodance.cycles.cut import Cycle
from biodance.cycles.strides import lift
from biodance.records import Wrench

TIME = np.linspace(0, 4, 401)
WEIGHT = 600.0
SURE = np.ones(TIME.size, dtype=bool)


def centre(start: float, lowest: float, end: float) -> np.ndarray:
    """The centre of mass goes down for 2 s and up for 2 s."""
    height = np.interp(TIME, [0, 2, 4], [start, lowest, end])
    return np.stack([0 * TIME, 0 * TIME, height], axis=1)


def feet(right: np.ndarray, left: np.ndarray) -> dict[str, Wrench]:
    return {
        f"{side}_foot": Wrench(TIME, np.stack([0 * TIME, 0 * TIME, force, *np.zeros((3, TIME.size))], axis=1))
        for side, force in (("right", right), ("left", left))
    }


def test_a_squat_is_as_deep_as_it_goes_down_and_comes_up_again() -> None:
    found = lift(Cycle("squat", "squat", "both", 0.0, 4.0, 2.0), centre(1.0, 0.6, 0.95), TIME, WEIGHT, None, SURE)
    assert found.values == {"duration": 4.0, "depth": pytest.approx(0.35)}


def test_a_rise_goes_up_from_the_seat() -> None:
    found = lift(
        Cycle("chair", "sit_to_stand", "both", 0.0, 4.0, 2.0), centre(0.7, 0.65, 0.95), TIME, WEIGHT, None, SURE
    )
    assert found.values["depth"] == pytest.approx(0.30)


def test_the_share_of_a_foot_and_the_rise_of_the_force_are_those_put_in() -> None:
    """The right foot carries 400 N throughout; the left one 200 N, and within 0.2 s from 2 s on 500 N: 1500 N/s."""
    left = np.interp(TIME, [0, 2, 2.2, 4], [200, 200, 500, 500])
    one = Cycle("squat", "squat", "both", 0.0, 4.0, 2.0)
    found = lift(one, centre(1.0, 0.6, 1.0), TIME, WEIGHT, feet(400 + 0 * TIME, left), SURE).values
    assert found["share_right"] == pytest.approx(100 * 400 / (400 + left.mean()), rel=1e-3)
    assert found["force_rise"] == pytest.approx(100 * 1500 / WEIGHT, rel=1e-6)


def test_forces_of_feet_that_share_a_plate_are_not_told() -> None:
    unsure = SURE.copy()
    unsure[150] = False
    one = Cycle("squat", "squat", "both", 0.0, 4.0, 2.0)
    found = lift(one, centre(1.0, 0.6, 1.0), TIME, WEIGHT, feet(300 + 0 * TIME, 300 + 0 * TIME), unsure).values
    assert "share_right" not in found
    assert "force_rise" not in found
