"""The criterion of excitation (paper eq. 12) on matrices whose condition number is known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.limits import family
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import (
    condition,
    effort,
    excitation_blocks,
    smooth_condition,
    static_grams,
    total,
)
from biodance.dance.problem.stance import stance
from biodance.dance.problem.state import State
from biodance.dance.search.postures import KEPT, Exciting, Posture, exchange, initial_guess, posture_at, solve
from biodance.records import Array, Subject

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


# ---- Simplicity

BODY = human(Subject(65.0, 1.75, "F"))
CHAIN = Chain(BODY)
FEET = stance(BODY, "parallel")


def hard(x: Array, feet=FEET) -> float:
    return effort(State(CHAIN, feet, x, *np.zeros((2, *x.shape))))[0]


def posed(**angles: float) -> Array:
    x = np.zeros((1, CHAIN.size))
    for name, angle in angles.items():
        x[0, ROOT + BODY.joint_index(name)] = angle
    return x


def test_slopes_are_exact() -> None:
    rng = np.random.default_rng(2)
    x = np.zeros((3, CHAIN.size))
    x[:, ROOT:] = rng.uniform(BODY.limits.lower, BODY.limits.upper, (3, 23))
    for feet in (FEET, FEET.on(0)):
        _, slopes = effort(State(CHAIN, feet, x, *np.zeros((2, *x.shape))))
        turn = rng.normal(size=x.shape)
        step = 1e-6
        difference = (hard(x + step * turn, feet) - hard(x - step * turn, feet)) / (2 * step)
        np.testing.assert_allclose(np.sum(slopes[0] * turn), difference, rtol=1e-7)
        assert not slopes[1:].any()


def test_what_a_person_would_call_simpler_is_simpler() -> None:
    standing = hard(posed())
    one = hard(posed(right_shoulder_flexion=1.0))
    two = hard(posed(right_shoulder_flexion=1.0, trunk_flexion=0.5))
    both = hard(posed(right_shoulder_flexion=1.0, left_shoulder_flexion=1.0))
    mixed = hard(posed(right_shoulder_flexion=1.0, left_shoulder_flexion=-0.5))
    assert standing < one < two
    assert both < mixed
    assert hard(posed(right_elbow_flexion=2.45)) > 1.3 * hard(posed(right_elbow_flexion=2.0))


def test_planted_legs_are_not_counted_and_the_free_one_is() -> None:
    bent = posed(right_knee_flexion=1.0)
    assert hard(bent) == hard(posed())
    assert hard(bent, FEET.on(1)) > hard(posed(), FEET.on(1))


def test_who_asks_for_simple_postures_gets_simpler_ones() -> None:
    plain = excitation_blocks(BODY)
    others = static_grams(np.array([posture_at(CHAIN, FEET, begun(seed)).up for seed in range(3)]))
    found = {}
    for simplicity in (0.0, 2.0):
        objective = Exciting(replace(plain, simplicity=simplicity), others, 0.1 * 65.0 / 4, 8)
        found[simplicity] = [solve(CHAIN, FEET, begun(seed), objective, family(), iterations=30) for seed in (4, 5)]
    for usual, simple in zip(found[0.0], found[2.0], strict=True):
        assert usual.violation <= KEPT
        assert simple.violation <= KEPT
        assert simple.hard < 0.8 * usual.hard


def test_of_two_postures_that_tell_the_same_the_simpler_is_taken() -> None:
    up = np.tile([0.0, 1.0, 0.0], (12, 1))
    hard, easy = (Posture(np.full(1, k), up, hard=k) for k in (0.9, 0.1))
    for simplicity, kept in ((0.0, 0.9), (1.0, 0.1)):
        chosen = exchange(replace(excitation_blocks(BODY), simplicity=simplicity), (FEET,), [[hard, easy]])
        assert chosen[0].hard == kept


def begun(seed: int) -> Array:
    return initial_guess(CHAIN, FEET, np.random.default_rng(seed))
