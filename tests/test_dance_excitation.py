"""The criterion of excitation (paper eq. 12) on matrices whose condition number is known beforehand."""

import numpy as np
import pytest

from biodance.dance.problem.excitation import condition, smooth_condition, total

GRAMS = np.array([np.diag([4.0, 1.0, 2.0]), np.diag([9.0, 3.0, 1.0]), np.diag([1.0, 100.0, 1.0])])
"""W'W of columns of length 2, 1, sqrt(2); 3, sqrt(3), 1; 1, 10, 1."""


def test_the_condition_number_is_that_of_the_columns_and_not_of_their_products() -> None:
    assert condition(GRAMS)[0] == pytest.approx([2.0, 3.0, 10.0])
    W = np.random.default_rng(0).normal(size=(50, 4))
    assert condition(W.T @ W)[0] == pytest.approx(np.linalg.cond(W))


def test_the_smooth_one_comes_close_from_below() -> None:
    smooth = smooth_condition(GRAMS, sharpness=40)[0]
    assert np.all(smooth <= condition(GRAMS)[0])
    assert smooth == pytest.approx([2.0, 3.0, 10.0], rel=0.05)
    assert smooth_condition(np.eye(3), sharpness=8)[0] == pytest.approx(1.0)


def test_every_segment_counts_with_its_mass_and_its_own_columns() -> None:
    """2 kg of condition 2 and 5 kg of condition 3; the third weighs nothing, or has no columns."""
    every = ([0, 1, 2],) * 3
    assert total(np.array([2.0, 5.0, 0.0]), GRAMS, every)[0] == pytest.approx(2 * 2.0 + 5 * 3.0)
    some = ([0, 2], [0, 1, 2], [])
    assert total(np.array([2.0, 5.0, 7.0]), GRAMS, some)[0] == pytest.approx(2 * np.sqrt(2.0) + 5 * 3.0)
