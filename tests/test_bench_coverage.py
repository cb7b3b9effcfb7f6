"""What the benchmark of coverage counts (benchmarks/bench_coverage.py), and about which truth CoM are judged."""

import json

import numpy as np
import pytest
from bench_chain import covered
from bench_coverage import held, range_in_bar, rows_of, spread, standard_errors

SEGMENTS = 12


def worth_row() -> dict:
    """Return a row of `bench_worth.py`: masses 2 sd too heavy, CoM right about the true centres alone."""
    own = np.full((SEGMENTS, 3), 0.05)
    return {
        "true": {"mass": np.full((SEGMENTS, 1), 4.0), "com": own + 0.02, "own_com": own},
        "identified": {"mass": np.full((SEGMENTS, 1), 5.0), "com": own},
        "sd": {"mass": np.full((SEGMENTS, 1), 0.5), "com": np.full((SEGMENTS, 3), 0.004)},
    }


def people_row() -> dict:
    """Return a row of `bench_people.py` of the same person."""
    row = worth_row()
    true, found = row["true"], row["identified"]
    words = {"mass": true["mass"][:, 0], "com": true["com"], "own_com": true["own_com"]}
    words |= {"found_mass": found["mass"][:, 0], "found_com": found["com"]}
    return words | {"sd": np.hstack([row["sd"]["mass"], row["sd"]["com"]])}


@pytest.mark.parametrize("row", [worth_row(), people_row(), {"person": people_row()}])
def test_rows_of_every_benchmark_are_in_units_of_what_is_stated(row):
    assert standard_errors(row) == pytest.approx(np.tile([2.0, 0.0, 0.0, 0.0], (SEGMENTS, 1)))


def test_a_danced_centre_of_mass_is_judged_about_the_true_joint_centres():
    row = worth_row()
    assert covered(row, "com").all()
    row["true"]["own_com"] = row["true"]["com"]
    assert not covered(row, "com").any()
    assert not covered(row, "mass").any()


def test_wider_intervals_hold_more_and_the_bar_lies_between_two_factors():
    z = np.tile(np.linspace(0.0, 1.0, 100) * 1.96, (7, 1)) * 1.25  # uniform: a factor f holds the share f / 1.25
    assert held(z, 1.0) == pytest.approx(np.full(7, 0.8), abs=0.011)
    low, high = (float(word) for word in range_in_bar(z).split(" to "))
    assert (low, high) == pytest.approx((0.93 * 1.25, 0.97 * 1.25), abs=0.02)
    assert range_in_bar(np.full((7, 3), 2.5)) == "none"


def test_the_interval_is_over_people_not_over_values():
    assert spread(np.full(9, 0.9)) == pytest.approx([0.9, 0.9])
    low, high = spread(np.repeat([0.8, 1.0], 50))
    assert (low, high) == pytest.approx((0.88, 0.92), abs=0.006)  # 0.9 -+ 1.96 * 0.1 / 10


def test_files_of_lines_and_of_one_row_are_read_alike(tmp_path):
    (tmp_path / "people.jsonl").write_text('{"seed": 1}\n{"seed": 2}\n')
    for number in (1, 2):
        (tmp_path / f"own_{number}.json").write_text(json.dumps({"seed": number}))
    assert rows_of(f"{tmp_path}/own_*.json") == rows_of(f"{tmp_path}/people.jsonl") == [{"seed": 1}, {"seed": 2}]
