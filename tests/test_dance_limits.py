import numpy as np
import pytest

from biodance.body.human import human
from biodance.dance import limits as family
from biodance.dance.chain import Chain
from biodance.dance.excitation import blocks, dynamic_grams, dynamic_slopes, static_grams
from biodance.dance.postures import Exciting, free_coordinates, start
from biodance.dance.programme import Programme
from biodance.dance.stance import seat, stance
from biodance.motion.regressor import predict_wrench
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)
BLOCKS = blocks(BODY)
STEP = 1e-6


def programme(planted, limits, objective, *, frames=5, still=False):
    rng = np.random.default_rng(len(planted) + sum(planted[:1]))
    where = stance(BODY, "parallel").on(*planted) if planted else seat(BODY)
    base = np.zeros((3, frames, CHAIN.size))
    base[0] = start(CHAIN, where, rng)
    base[0, :, 2] -= 0.15
    base[0, :, 3:6] *= 0.3
    basis = rng.normal(0, 1, (3, frames, 1 if still else 2))
    if still:
        basis[:] = np.array([1.0, 0.0, 0.0])[:, None, None]
    built = Programme(CHAIN, where, base, basis, free_coordinates(CHAIN, where), limits, objective, np.zeros((frames, len(limits))))
    return built, rng.normal(0, 0.04, basis.shape[2] * len(built.free)), rng


def differences(judge, y, what):
    return np.array([(what(judge(y + STEP * e)) - what(judge(y - STEP * e))) / (2 * STEP) for e in np.eye(len(y))]).T


def nothing(state):
    return 0.0, np.zeros((3, *state.x.shape))


@pytest.mark.parametrize("planted", [(0, 1), (0,), (1,), ()])
@pytest.mark.parametrize("limit", family.limits(), ids=lambda limit: limit.NAME)
def test_slopes_of_every_limit_equal_differences(limit, planted):
    built, y, _ = programme(planted, (limit,), nothing)
    point = built.judge(y)
    near = np.flatnonzero(point.margins < family.FAR)
    _, slopes = point.slopes(near)
    assert slopes.shape == (len(near), len(y))
    expected = differences(built.judge, y, lambda p: p.margins)[near]
    np.testing.assert_allclose(slopes, expected.reshape(slopes.shape), atol=3e-6 * (1 + np.abs(slopes).max(initial=0)))


def test_every_limit_says_what_it_is():
    for limit in family.limits():
        assert limit.__doc__
        assert limit.UNIT
        assert limit.SCALE > 0
        assert limit.__name__.rsplit(".", 1)[1] == limit.NAME


@pytest.mark.parametrize("planted", [(0, 1), (1,)])
def test_slopes_of_the_dynamic_criterion(planted):
    segments = list(range(12))
    weight = np.random.default_rng(0).normal(size=(12, 6, 6))
    weight = weight + np.swapaxes(weight, 1, 2)

    def objective(state):
        return float(np.sum(weight * dynamic_grams(state, segments))), dynamic_slopes(state, segments, weight)

    built, y, _ = programme(planted, (), objective)
    expected = differences(built.judge, y, lambda p: p.value)
    got, _ = built.judge(y).slopes(np.arange(0))
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_slopes_of_the_static_criterion():
    up = np.random.default_rng(1).normal(size=(9, 12, 3))
    others = static_grams(up / np.linalg.norm(up, axis=2, keepdims=True))
    built, y, _ = programme((0, 1), (), Exciting(BLOCKS, others, 1.0, 8), frames=1, still=True)
    expected = differences(built.judge, y, lambda p: p.value)
    got, _ = built.judge(y).slopes(np.arange(0))
    np.testing.assert_allclose(got, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("planted", [(0, 1), (0,), (1,)])
def test_planted_feet_stand_still_and_forces_agree_with_the_regressor(planted):
    built, y, _ = programme(planted, (), nothing)
    state = built.state(y)
    for side in planted:
        ankle = CHAIN.leg_columns[side][-1]
        assert np.abs(state.velocity[:, ankle]).max() < 1e-9
        assert np.abs(state.acceleration[:, ankle]).max() < 1e-8
    motion = CHAIN.motion(np.arange(len(state.x)) * 0.01, state.x, state.v, state.a)
    np.testing.assert_allclose(predict_wrench(BODY, motion).value, state.wrench, atol=1e-8)
