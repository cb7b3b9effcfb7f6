"""What the benchmark of coverage counts (benchmarks/coverage.py), and about which truth CoM are judged."""

import json

import numpy as np
import pytest

from benchmarks.coverage import held, rows_of, spread
from benchmarks.people import covered, standard_errors

SEGMENTS = 12


def row() -> dict:
    """Return a row of `people.identified`: masses 2 sd too heavy, CoM right about the true centres alone."""
    own = np.full((SEGMENTS, 3), 0.05)
    return {
        "true": {"mass": np.full(SEGMENTS, 4.0), "com": own + 0.02, "own_com": own},
        "identified": {"mass": np.full(SEGMENTS, 5.0), "com": own},
        "sd": np.tile([0.5, 0.004, 0.004, 0.004], (SEGMENTS, 1)),
    }


def test_errors_are_in_units_of_what_is_stated():
    assert standard_errors(row()) == pytest.approx(np.tile([2.0, 0.0, 0.0, 0.0], (SEGMENTS, 1)))


def test_a_centre_of_mass_is_judged_about_the_true_joint_centres():
    one = row()
    assert covered(one) == (0.0, 1.0)
    one["true"]["own_com"] = one["true"]["com"]
    assert covered(one) == (0.0, 0.0)


def test_an_interval_holds_what_is_nearer_than_its_half():
    z = np.tile(np.linspace(0.0, 1.0, 100) * 1.96, (7, 1)) * 1.25  # uniform: the share 1 / 1.25 is held
    assert held(z) == pytest.approx(np.full(7, 0.8), abs=0.011)
    assert held(np.full((7, 3), 2.5)) == pytest.approx(np.zeros(7))


def test_the_interval_is_over_people_not_over_values():
    assert spread(np.full(9, 0.9)) == pytest.approx([0.9, 0.9])
    low, high = spread(np.repeat([0.8, 1.0], 50))
    assert (low, high) == pytest.approx((0.88, 0.92), abs=0.006)  # 0.9 -+ 1.96 * 0.1 / 10


def test_rows_of_all_files_of_a_pattern_are_read(tmp_path):
    for number in (1, 2):
        (tmp_path / f"own_{number}.json").write_text(json.dumps({"seed": number}))
    assert rows_of(f"{tmp_path}/own_*.json") == [{"seed": 1}, {"seed": 2}]
