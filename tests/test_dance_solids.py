"""Distances between solids: what the design uses equals what coal finds, and what is far is never said to be nearer
than it is.
"""

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.limits import self_collision
from biodance.dance.limits.self_collision import _ENOUGH, deepest, outside, solid_distances
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.stance import stance
from biodance.dance.problem.state import close_legs
from biodance.dance.search.posture import initial_guess
from biodance.motion.kinematics import poses
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)


def test_two_codes_find_the_same_distances():
    rng, feet = np.random.default_rng(0), stance(BODY, "parallel").on(0)
    x = np.array([initial_guess(CHAIN, feet, rng) for _ in range(60)])
    state = close_legs(CHAIN, feet, x, *np.zeros((2, *x.shape)))
    expected = self_collision.SelfCollision().margins(state).value
    motion = CHAIN.motion(np.arange(60.0), state.x, state.v, state.a)
    found, names = solid_distances(BODY, poses(BODY, motion.q))
    assert len(set(names)) == found.shape[1] == expected.shape[1]
    apart = (found < _ENOUGH) & (expected > 0)
    assert apart.sum() > 50
    np.testing.assert_allclose(found[apart], expected[apart], atol=2e-6)
    assert ((found < 0) == (expected < 0)).all()
    far = found >= _ENOUGH
    assert (found[far] <= expected[far] + 1e-9).all()


@pytest.mark.parametrize("place", [[0.3, 0.0, 0.0], [0.3, 0.4, 0.5], [0.05, 0.02, 0.01]])
def test_the_signed_distance_from_a_box(place):
    half = np.array([0.1, 0.2, 0.3])
    value, slope = outside(np.array(place), half)
    step = 1e-6 * np.eye(3)
    differences = [(outside(place + s, half)[0] - outside(place - s, half)[0]) / 2e-6 for s in step]
    np.testing.assert_allclose(slope, differences, atol=1e-6)
    assert (value < 0) == bool(np.all(np.array(place) < half))


def test_the_nearest_place_on_a_line_is_found():
    rng = np.random.default_rng(1)
    ends, half = rng.normal(0, 0.4, (50, 3, 2, 3)), rng.uniform(0.1, 0.3, (3, 3))
    share = deepest(ends, half)
    tight = np.linspace(0, 1, 2001)[:, None, None]
    along = ends[None, ..., 0, :] + tight[..., None] * (ends[..., 1, :] - ends[..., 0, :])
    best = outside(along, half)[0].min(axis=0)
    found = outside(ends[..., 0, :] + share[..., None] * (ends[..., 1, :] - ends[..., 0, :]), half)[0]
    assert (found <= best + 1e-7).all()
