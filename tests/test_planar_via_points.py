"""Via-point design: the gradient is right, the ranges hold, the criterion falls."""

import numpy as np
import pytest
from criteria import criterion
from random_bodies import random_body
from target import target
from via_points import Excitation, design

from biodance.body.parts import GRAVITY
from biodance.dance.problem.splines import rest_to_rest
from biodance.identification.base_parameters import structural_base


def problem(name: str) -> Excitation:
    body = random_body(np.random.default_rng(0), n_segments=2, root="fixed")
    return Excitation(
        body, rest_to_rest(2.0, rate=20), tuple(range(6)), target(body, structural_base(body)), criterion(name), GRAVITY
    )


@pytest.mark.parametrize("name", ["log_condition", "mass_weighted", "d_optimal"])
def test_gradient_agrees_with_finite_differences(name: str) -> None:
    case, rng = problem(name), np.random.default_rng(1)
    points = rng.uniform(-1, 1, (4, len(case.body.joints)))
    history = case.extend(np.zeros((20, 20)), rng.uniform(-1, 1, points.shape))
    value, gradient = case.value_and_gradient(points, history)
    for k in range(points.size):
        step = 1e-5 * np.eye(points.size)[k].reshape(points.shape)
        up, down = (case.value_and_gradient(points + s, history)[0] for s in (step, -step))
        assert gradient.flat[k] == pytest.approx((up - down) / 2e-5, rel=1e-3, abs=1e-5 * abs(value))


def test_design_lowers_the_criterion_within_the_ranges() -> None:
    case, rng = problem("log_condition"), np.random.default_rng(2)
    start = rng.uniform(-0.5, 0.5, (4, len(case.body.joints)))
    empty = np.zeros((20, 20))
    found = design(case, start, empty, iterations=40)
    assert case.value_and_gradient(found, empty)[0] < case.value_and_gradient(start, empty)[0]
    q = case.basis.position @ found
    assert np.all(q >= case.body.limits.lower - 1e-6)
    assert np.all(q <= case.body.limits.upper + 1e-6)
