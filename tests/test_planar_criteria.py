"""One contract for every criterion file: a value, a symmetric gradient equal to finite differences, better with more
data.
"""

import numpy as np
import pytest
from criteria import CRITERIA, criterion
from random_bodies import random_body, random_motion
from target import target

from biodance.errors import UnknownName
from biodance.identification.base_parameters import structural_base
from biodance.identification.posterior import fold
from biodance.motion.dynamics import regressor

BODY = random_body(np.random.default_rng(0), n_segments=3)
BASE = structural_base(BODY)


def rows(seed: int, frames: int = 40) -> np.ndarray:
    return regressor(BODY, random_motion(BODY, np.random.default_rng(seed), frames=frames)).reshape(-1, 30)


@pytest.mark.parametrize("name", sorted(CRITERIA))
@pytest.mark.parametrize("kind", ["static", "dynamic", "all"])
def test_gradient_agrees_with_finite_differences(name: str, kind: str) -> None:
    aim = target(BODY, BASE, kind=kind)
    evaluate, R = criterion(name), fold(rows(1))
    value, gradient = evaluate(R, aim)
    np.testing.assert_allclose(gradient, gradient.T, atol=1e-9 * np.abs(gradient).max())
    rng = np.random.default_rng(2)
    for _ in range(4):
        step = rng.normal(size=R.shape)
        h = 1e-6 * np.linalg.norm(R) / np.linalg.norm(step)
        slope = (evaluate(R + h * step, aim)[0] - evaluate(R - h * step, aim)[0]) / (2 * h)
        assert 2 * np.sum((R @ gradient) * step) == pytest.approx(slope, rel=2e-3, abs=1e-8 * abs(value))


def test_a_fold_is_judged_like_all_its_rows() -> None:
    aim = target(BODY, BASE)
    for name, evaluate in CRITERIA.items():
        whole = evaluate(rows(1), aim)[0]
        assert evaluate(fold(rows(1)), aim)[0] == pytest.approx(whole, rel=1e-6), name


@pytest.mark.parametrize("name", ["d_optimal", "a_optimal", "posterior_variance"])
def test_more_data_never_hurts_the_optimal_design_criteria(name: str) -> None:
    aim = target(BODY, BASE)
    assert criterion(name)(np.concatenate([rows(1), rows(2)]), aim)[0] < criterion(name)(rows(1), aim)[0]


def test_mass_weighted_sum_is_bounded_by_the_masses() -> None:
    aim = target(BODY, BASE, kind="static")
    assert criterion("mass_weighted")(rows(3), aim)[0] >= aim.bound
    assert aim.bound == pytest.approx(BODY.sip.mass.sum())


def test_emphasis_on_one_segment_ignores_the_others() -> None:
    aim = target(BODY, BASE, segments=("s1",))
    _, gradient = criterion("mass_weighted")(rows(4), aim)
    assert np.all(gradient[:10] == 0)
    assert np.all(gradient[20:] == 0)


def test_unknown_criterion_lists_the_legal_ones() -> None:
    with pytest.raises(UnknownName, match="mass_weighted"):
        criterion("condtion")
