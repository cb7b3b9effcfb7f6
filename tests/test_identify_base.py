"""Base parameters: rank by theory, regrouping as an identity, least squares equal to the full problem."""

import numpy as np
import pytest
from direct_information import information
from random_bodies import random_body, random_motion

from biodance.identification.base_parameters import estimate_base, structural_base
from biodance.motion.dynamics import predict_wrench, regressor
from biodance.uncertainty.bands import Noise


@pytest.mark.parametrize("seed", range(4))
def test_regrouping_reproduces_the_wrench_of_any_parameters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = random_body(rng)
    base = structural_base(body)
    motion = random_motion(body, rng, frames=20)
    W = regressor(body, motion)
    phi = rng.normal(size=W.shape[2])
    np.testing.assert_allclose(W[:, :, list(base.columns)] @ (base.regroup @ phi), W @ phi, atol=1e-7)


def test_rank_is_what_theory_says_for_a_tree_of_revolute_joints() -> None:
    # one revolute joint loses 3 parameters; two or three with different axes lose 1 (the mass of the child)
    rng = np.random.default_rng(5)
    body = random_body(rng, n_segments=8)
    dofs = dict.fromkeys(range(1, 8), 0)
    for joint in body.joints:
        dofs[int(joint.name[1])] += 1
    expected = 80 - sum(3 if n == 1 else 1 for n in dofs.values())
    assert structural_base(body).count == expected


def test_same_base_whatever_the_seed_of_the_random_states() -> None:
    body = random_body(np.random.default_rng(2))
    assert structural_base(body, seed=0).columns == structural_base(body, seed=99).columns


def test_estimate_recovers_the_base_parameters_and_states_its_error() -> None:
    rng = np.random.default_rng(1)
    body = random_body(rng, n_segments=4)
    base = structural_base(body)
    about = np.array([0.3, -0.2, 0.0])
    noise = Noise.of_sd(2.0, 0.5, about)
    motion = random_motion(body, rng, frames=400)
    clean = predict_wrench(body, motion)
    truth = base.regroup @ body.sip.phi
    z = []
    for _ in range(40):
        error = rng.normal(size=(400, 6)) * [2, 2, 2, 0.5, 0.5, 0.5]
        error[:, 3:] += np.cross(about, error[:, :3])
        wrench = type(clean)(clean.time, clean.value + error)
        found = estimate_base(information(body, motion, wrench, noise), base)
        z.append((found.value - truth) / found.sd)
    assert np.std(z) == pytest.approx(1.0, abs=0.05)
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.02)


def test_blocks_give_the_triangle_of_the_whole() -> None:
    rng = np.random.default_rng(8)
    body = random_body(rng, n_segments=3)
    motion = random_motion(body, rng, frames=1100)
    wrench = predict_wrench(body, motion)
    noise = Noise.of_sd(1.0, 1.0, np.zeros(3))
    data = information(body, motion, wrench, noise)
    W = regressor(body, motion).reshape(-1, 30)
    np.testing.assert_allclose(data.triangle.T @ data.triangle, W.T @ W, rtol=1e-9, atol=1e-8)
    cost = [np.sum((data.triangle @ phi - data.target) ** 2) + data.misfit for phi in (body.sip.phi, 0 * body.sip.phi)]
    assert cost[0] == pytest.approx(0.0, abs=1e-12 * cost[1])


def test_still_posture_leaves_inertia_unknown_not_small() -> None:
    rng = np.random.default_rng(4)
    body = random_body(rng, n_segments=3)
    motion = random_motion(body, rng, frames=50)
    still = type(motion)(motion.time, motion.q, 0 * motion.v, 0 * motion.a)
    base = structural_base(body)
    found = estimate_base(information(body, still, predict_wrench(body, still), Noise.of_sd(1, 1, np.zeros(3))), base)
    assert found.rank < base.count
    assert np.all(np.isinf(found.sd[np.array(base.columns) % 10 >= 4]))
