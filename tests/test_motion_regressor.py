"""Batched kinematics and regressor against pinocchio, for random trees."""

import numpy as np
import pytest
from random_bodies import random_body, random_motion

from biodance.motion.dynamics import predict_wrench, regressor
from biodance.motion.kinematics import poses, segment_motion

pin = pytest.importorskip("pinocchio")


@pytest.mark.parametrize("seed", range(5))
def test_regressor_agrees_with_pinocchio_rnea(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = random_body(rng)
    motion = random_motion(body, rng)
    wrench, linear = predict_wrench(body, motion), regressor(body, motion) @ body.sip.phi
    data = body.model.createData()
    for t in range(motion.time.size):
        tau = pin.rnea(body.model, data, motion.q[t], motion.v[t], motion.a[t])
        pin.forwardKinematics(body.model, data, motion.q[t], motion.v[t], motion.a[t])
        lab = data.oMi[1].toDualActionMatrix() @ tau[:6]
        np.testing.assert_allclose(wrench.value[t], lab, atol=1e-10)
        np.testing.assert_allclose(linear[t], lab, atol=1e-10)


def test_poses_agree_with_pinocchio_for_both_roots() -> None:
    for root in ("free_flyer", "fixed"):
        rng = np.random.default_rng(3)
        body = random_body(rng, root=root)
        motion = random_motion(body, rng)
        found = poses(body, motion.q)
        data = body.model.createData()
        shift = 2 if root == "free_flyer" else 1
        for t in range(motion.time.size):
            pin.forwardKinematics(body.model, data, motion.q[t])
            for i in range(len(body.joints)):
                np.testing.assert_allclose(found.joint_rotation[t, i], data.oMi[i + shift].rotation, atol=1e-12)
                np.testing.assert_allclose(found.joint_position[t, i], data.oMi[i + shift].translation, atol=1e-12)


def test_segment_motion_agrees_with_finite_differences() -> None:
    rng = np.random.default_rng(7)
    body = random_body(rng)
    motion = random_motion(body, rng, frames=1)
    q, v, a = motion.q[0], motion.v[0], motion.a[0]
    h = 1e-4

    def at(t: float) -> np.ndarray:
        return poses(body, pin.integrate(body.model, q, v * t + 0.5 * a * t * t)[None]).position[0]

    # pinocchio integrates body twists: the curve q(t) = q (+) (v t + a t²/2) has velocity v and acceleration a at t = 0
    acceleration = (at(h) - 2 * at(0.0) + at(-h)) / h**2
    np.testing.assert_allclose(segment_motion(body, motion).acceleration[0], acceleration, atol=1e-5)


def test_regressor_columns_are_linear() -> None:
    rng = np.random.default_rng(11)
    body = random_body(rng, n_segments=4)
    motion = random_motion(body, rng)
    W = regressor(body, motion)
    assert W.shape == (5, 6, 40)
    np.testing.assert_allclose(W @ (2 * body.sip.phi), 2 * predict_wrench(body, motion).value, rtol=1e-12)
