"""Intervals from blocks hold what they say, few blocks or many."""

import numpy as np
import pytest

from biodance.identification.validation import block_interval


@pytest.mark.parametrize("count", [3, 6, 40])
def test_nineteen_of_twenty_intervals_hold_the_truth(count: int) -> None:
    rng, sessions, truth = np.random.default_rng(7), 400, 5.0
    held = 0
    for _ in range(sessions):
        low, high = block_interval(lambda sums: sums / count, rng.normal(truth, 1.0, count))
        held += low <= truth <= high
    assert 0.90 < held / sessions < 0.99
