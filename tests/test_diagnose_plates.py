"""Plates as they are installed: what every maker and every calibration in place leaves is no fault, what is clearly
more is.
"""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, windows
from inferred_sessions import inferred

from biodance.uncertainty.tolerances import Tolerances, table_sizes

LEFT = np.block([[np.full((3, 3), 0.002), np.full((3, 3), 0.01)], [np.full((3, 3), 0.001), np.full((3, 3), 0.002)]])
"""What one channel (column) leaves in another (row): 0.2 %, 1 mm, 0.01 1/m."""


def installed() -> Tolerances:
    """Return tolerances of installed plates with the cross-talk of the one table."""
    leaks = {key: size for key, size in table_sizes().items() if key.startswith("plate_crosstalk ")}
    return replace(known(), sizes={**known().sizes, **leaks})


def leaking(seed: int, *, clear: float = 0.0):
    """Return a hiding of cross-talk between all channels, and of ``clear`` of Fz in Fx."""
    mixing = LEFT * np.random.default_rng(seed).normal(size=(6, 6)) * (1 - np.eye(6))
    mixing[0, 2] += clear
    return about_plate(lambda local, session: local + local @ mixing.T)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_crosstalk_that_calibrated_plates_keep_is_no_finding(seed: int) -> None:
    some = windows(seed, trials=2, hidden=leaking(seed))
    one = inferred(body(), some, tolerances=installed(), effects=("plate_crosstalk",)).diagnosis
    assert (one.verdict, one.findings, one.resembles) == ("nothing wrong", (), ())


def test_a_clear_crosstalk_beside_them_is_named_with_its_size() -> None:
    some = windows(1, trials=2, hidden=leaking(1, clear=0.025))
    one = inferred(body(), some, tolerances=installed(), effects=("plate_crosstalk",)).diagnosis
    (found,) = one.findings
    assert (found.effect, found.target) == ("plate_crosstalk", "Fz->Fx")
    assert found.parameters[0].value == pytest.approx(0.025, abs=0.006)
