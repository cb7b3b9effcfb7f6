"""One contract for every limit of a dance: its margins are what its check finds, its slopes are differences, and what a
protocol says of it reaches both sides. Numbers that a person works out by hand are in test_dance_limit_numbers.py.
"""

from dataclasses import fields, replace

import numpy as np
import pytest
from limit_cases import BODY, CHAIN, feet, movements

from biodance.dance.limits import FAR, CheckedMotion, Limit, family
from biodance.dance.problem.excitation import dynamic_grams, dynamic_slopes, excitation_blocks, static_grams
from biodance.dance.problem.nlp import NonlinearProgramme, free_coordinates
from biodance.dance.problem.stance import Stance, stance
from biodance.dance.problem.state import State
from biodance.dance.search.posture import Exciting, initial_guess
from biodance.motion.dynamics import predict_wrench

BLOCKS = excitation_blocks(BODY)
STEP = 1e-6
MOVEMENTS = 198
NEVER, DEEP = 0.05, -0.02
"""m: coal gives bounds of distances above the first, and another measure of overlap (the way out, not the depth) below
the second.
"""
FAMILY = {limit.name: limit for limit in family()}
each_limit = pytest.mark.parametrize("limit", FAMILY.values(), ids=FAMILY.keys())


# ---- the contract


def compared(limit: Limit, state: State, motion: CheckedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Return what is left in each sample by the margins and by the check, as far as both are exact."""
    margins, check = limit.margins(state).value, limit.check(motion).value
    assert (margins.size == 0) == (check.size == 0)
    left, found = (value.min(axis=1) if value.size else np.full(len(state.x), np.inf) for value in (margins, check))
    if limit.name == "self_collision" and margins.size:
        np.testing.assert_array_equal(left < DEEP, found < DEEP)
        left, found = (np.clip(value, DEEP, NEVER - limit.gap) for value in (left, found))
    return left, found


@each_limit
def test_margins_are_what_the_check_finds_on_movements_that_keep_the_limit_and_that_break_it(limit: Limit) -> None:
    pairs = [compared(limit, *movement) for movement in movements(MOVEMENTS)]
    left, found = (np.concatenate(one) for one in zip(*pairs, strict=True))
    np.testing.assert_allclose(found, left, rtol=1e-6, atol=1e-6)
    told = np.isfinite(left)
    broken = (left[told] < 0).mean()
    assert told.sum() >= 60
    assert 0.01 < broken < 0.99


NUMBERS = [(limit, one.name) for limit in FAMILY.values() for one in fields(limit) if not one.metadata["imprecise"]]
ASKED = [(limit, one.name) for limit in FAMILY.values() for one in fields(limit) if one.metadata["imprecise"]]


@pytest.mark.parametrize(("limit", "name"), NUMBERS, ids=[f"{limit.name}.{name}" for limit, name in NUMBERS])
def test_another_number_reaches_the_margins_and_the_check(limit: Limit, name: str) -> None:
    usual, legal = getattr(limit, name), {one.name: one.metadata for one in fields(limit)}[name]
    other = replace(limit, **{name: legal["high"] if usual < legal["high"] else (usual + legal["low"]) / 2})
    changed = 0
    for movement in movements(27, seed=1):
        left, found = compared(other, *movement)
        np.testing.assert_allclose(found, left, rtol=1e-6, atol=1e-6)
        changed += np.sum(left != compared(limit, *movement)[0])
    assert changed >= 6


@pytest.mark.parametrize(("limit", "name"), ASKED, ids=[f"{limit.name}.{name}" for limit, name in ASKED])
def test_what_imprecise_people_must_keep_is_a_number_of_the_limit(limit: Limit, name: str) -> None:
    asked = replace(limit, **{name: 0.031}).for_imprecise()
    assert asked is not None
    assert asked.least == 0.031


@pytest.mark.parametrize("where", feet(), ids=lambda one: f"{one.name}-{one.over}-{np.isfinite(one.hands).sum()}")
@each_limit
def test_slopes_equal_differences(limit: Limit, where: Stance) -> None:
    built, y, _ = problem(where, (limit,), nothing)
    point = built.evaluate(y)
    near = np.flatnonzero(point.margins < FAR)
    _, slopes = point.slopes(near)
    assert slopes.shape == (len(near), len(y))
    expected = differences(built.evaluate, y, lambda p: p.margins)[near]
    np.testing.assert_allclose(slopes, expected.reshape(slopes.shape), atol=3e-6 * (1 + np.abs(slopes).max(initial=0)))


@each_limit
def test_every_limit_says_what_it_is(limit: Limit) -> None:
    module = __import__(type(limit).__module__, fromlist=["LIMIT"])
    assert module.__doc__
    assert module.__name__.rsplit(".", 1)[1] == limit.name
    assert limit.unit
    assert limit.scale > 0
    assert all({"low", "high", "unit"} <= set(one.metadata) for one in fields(limit))


# ---- slopes of criteria and of the closure, with the same small problems


def problem(where, limits, objective, *, frames=5, still=False):
    rng = np.random.default_rng(len(where.planted) + sum(where.planted[:1]))
    base = np.zeros((3, frames, CHAIN.size))
    base[0] = initial_guess(CHAIN, where, rng)
    base[0, :, 2] -= 0.15
    base[0, :, 3:6] *= 0.3
    basis = rng.normal(0, 1, (3, frames, 1 if still else 2))
    if still:
        basis[:] = np.array([1.0, 0.0, 0.0])[:, None, None]
    built = NonlinearProgramme(
        CHAIN, where, base, basis, free_coordinates(CHAIN, where), limits, objective, np.zeros((frames, len(limits)))
    )
    return built, rng.normal(0, 0.04, basis.shape[2] * len(built.free)), rng


def differences(evaluate, y, what):
    return np.array(
        [(what(evaluate(y + STEP * e)) - what(evaluate(y - STEP * e))) / (2 * STEP) for e in np.eye(len(y))]
    ).T


def nothing(state):
    return 0.0, np.zeros((3, *state.x.shape))


def standing_on(planted):
    return stance(BODY, "parallel").on(*planted)


@pytest.mark.parametrize("planted", [(0, 1), (1,)])
def test_slopes_of_the_dynamic_criterion(planted):
    segments = list(range(12))
    weight = np.random.default_rng(0).normal(size=(12, 6, 6))
    weight = weight + np.swapaxes(weight, 1, 2)

    def objective(state):
        return float(np.sum(weight * dynamic_grams(state, segments))), dynamic_slopes(state, segments, weight)

    built, y, _ = problem(standing_on(planted), (), objective)
    expected = differences(built.evaluate, y, lambda p: p.value)
    got, _ = built.evaluate(y).slopes(np.arange(0))
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_slopes_of_the_static_criterion():
    up = np.random.default_rng(1).normal(size=(9, 12, 3))
    others = static_grams(up / np.linalg.norm(up, axis=2, keepdims=True))
    built, y, _ = problem(standing_on((0, 1)), (), Exciting(BLOCKS, others, 1.0, 8), frames=1, still=True)
    expected = differences(built.evaluate, y, lambda p: p.value)
    got, _ = built.evaluate(y).slopes(np.arange(0))
    np.testing.assert_allclose(got, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("planted", [(0, 1), (0,), (1,)])
def test_planted_feet_stand_still_and_forces_agree_with_the_regressor(planted):
    built, y, _ = problem(standing_on(planted), (), nothing)
    state = built.state(y)
    for side in planted:
        ankle = CHAIN.leg_columns[side][-1]
        assert np.abs(state.velocity[:, ankle]).max() < 1e-9
        assert np.abs(state.acceleration[:, ankle]).max() < 1e-8
    motion = CHAIN.motion(np.arange(len(state.x)) * 0.01, state.x, state.v, state.a)
    np.testing.assert_allclose(predict_wrench(BODY, motion).value, state.wrench, atol=1e-8)
