"""The planar example: the printed base parameters, the paper's picture from its start, and better from starts that
are not singular.
"""

import numpy as np
import pytest
from planar_chain import RANGES, planar_chain
from series import VIA, paper_series, planar_base, planar_problem, seeded_series

from biodance.errors import UnknownName
from biodance.motion.dynamics import regressor
from biodance.records import Motion

PRINTED = (
    "M head_trunk + M arm + M hand",
    "MX head_trunk + 0.8 M arm + 0.8 M hand",
    "MY head_trunk",
    "ZZ head_trunk + 0.64 M arm + 0.64 M hand",
    "MX arm + 0.2 M hand",
    "MY arm",
    "ZZ arm + 0.04 M hand",
    "MX hand",
    "MY hand",
    "ZZ hand",
)


def test_base_parameters_are_the_ten_of_equation_13() -> None:
    assert planar_base(planar_chain()).relations() == PRINTED


def test_three_channels_carry_the_whole_wrench_of_a_planar_motion() -> None:
    body, rng = planar_chain(), np.random.default_rng(0)
    motion = Motion(np.arange(9.0), *rng.normal(size=(3, 9, 3)))
    wrench = regressor(body, motion) @ body.sip.phi
    np.testing.assert_allclose(wrench[:, [2, 3, 4]], 0, atol=1e-12)
    assert np.abs(wrench[:, [0, 1, 5]]).max() > 1


def test_from_the_papers_start_only_the_sum_of_blocks_can_move() -> None:
    assert paper_series(planar_chain(), "condition", motions=1).condition[0] > 1e12
    assert (
        paper_series(planar_chain(), "mass_weighted", motions=1).condition[0] < 105
    )  # printed: 62, and 105 for cond(W_b)


@pytest.mark.parametrize("ranges", RANGES)
def test_condition_at_most_5_after_one_motion_and_3_after_six(ranges: str) -> None:
    body = planar_chain(ranges=ranges)
    found = seeded_series(body, "log_condition", starts=1)
    assert found.condition[0] <= 5
    assert found.condition[-1] <= 3
    q = planar_problem(body, "condition", rate=3000).basis.position @ found.points
    assert np.all(q >= body.limits.lower - 1e-5)
    assert np.all(q <= body.limits.upper + 1e-5)


def test_same_seed_same_motions() -> None:
    one, two = (seeded_series(planar_chain(), "log_condition", motions=1, starts=1) for _ in range(2))
    np.testing.assert_array_equal(one.points, two.points)
    assert one.points.shape == (1, VIA + 2, 3)


def test_unknown_ranges_list_the_legal_ones() -> None:
    with pytest.raises(UnknownName, match="frontal"):
        planar_chain(ranges="frontl")
