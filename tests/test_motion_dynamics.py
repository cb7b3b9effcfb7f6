"""Joint torques against pinocchio and finite work, and the distribution between the feet."""

from dataclasses import replace

import numpy as np
import pytest
from random_bodies import random_body, random_motion

from biodance.body.parts import GRAVITY
from biodance.errors import BiodanceError, UnknownName
from biodance.motion.dynamics import distribute, joint_torques, predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Wrench

pin = pytest.importorskip("pinocchio")


def random_wrench(time: np.ndarray, rng: np.random.Generator) -> Wrench:
    return Wrench(time, rng.normal(0, 100, (time.size, 6)))


@pytest.mark.parametrize("root", ["free_flyer", "fixed"])
@pytest.mark.parametrize("seed", range(3))
def test_torques_agree_with_pinocchio_jacobians(seed: int, root: str) -> None:
    rng = np.random.default_rng(seed)
    body = random_body(rng, root=root)
    motion = random_motion(body, rng)
    contacts = {name: random_wrench(motion.time, rng) for name in body.segments[2:4]}
    found = joint_torques(body, motion, contacts)
    model = pin.Model(body.model)
    model.gravity.linear = GRAVITY
    data = model.createData()
    for t in range(motion.time.size):
        expected = pin.rnea(model, data, motion.q[t], motion.v[t], motion.a[t])
        pin.computeJointJacobians(model, data, motion.q[t])
        for name, wrench in contacts.items():
            joint = body.segment_joint[body.segment_index(name)] + (2 if body.n_root else 1)
            jacobian = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.WORLD)
            expected = expected - jacobian.T @ wrench.value[t]
        assert found.torque[t] == pytest.approx(expected[body.n_root :], abs=1e-9)
    assert found.residual.shape == (motion.time.size, body.n_root)


def test_the_residual_is_zero_under_the_predicted_wrench_wherever_it_acts() -> None:
    rng = np.random.default_rng(4)
    body = random_body(rng)
    motion = random_motion(body, rng)
    needed = predict_wrench(body, motion)
    one = random_wrench(motion.time, rng)
    other = Wrench(motion.time, needed.value - one.value)
    found = joint_torques(body, motion, {body.segments[1]: one, body.segments[-1]: other})
    assert np.abs(found.residual).max() < 1e-9
    assert joint_torques(body, motion, {}).residual == pytest.approx(needed.value)


def test_a_static_force_needs_the_torque_of_its_virtual_work() -> None:
    rng = np.random.default_rng(5)
    body = replace(random_body(rng), gravity=np.zeros(3))
    q = random_motion(body, rng, frames=1).q
    still = np.zeros((1, body.nv))
    motion = type(random_motion(body, rng))(np.zeros(1), q, still, still)
    segment, local, force = len(body.segments) - 1, np.array([[0.1, -0.2, 0.3]]), np.array([10.0, -20.0, 300.0])
    point = poses(body, q).points([segment], local)[0, 0]
    contact = Wrench(motion.time, np.concatenate([force, np.cross(point, force)])[None])
    torque = joint_torques(body, motion, {body.segments[segment]: contact}).torque[0]
    step = 1e-6
    for joint in range(len(body.joints)):
        moved = q.copy()
        moved[0, 7 + joint] += step
        work = force @ (poses(body, moved).points([segment], local)[0, 0] - point) / step
        assert torque[joint] == pytest.approx(-work, abs=1e-3)


def test_the_shared_model_is_not_written_to() -> None:
    rng = np.random.default_rng(6)
    body = random_body(rng)
    before = body.model.gravity.linear.copy()
    joint_torques(body, random_motion(body, rng), {})
    assert np.array_equal(body.model.gravity.linear, before)


def test_wrong_contacts_are_refused() -> None:
    rng = np.random.default_rng(7)
    body = random_body(rng)
    motion = random_motion(body, rng)
    with pytest.raises(BiodanceError, match="other times"):
        joint_torques(body, motion, {body.segments[1]: random_wrench(np.arange(3.0), rng)})
    with pytest.raises(UnknownName, match="s1"):
        joint_torques(body, motion, {"right_foot": random_wrench(motion.time, rng)})


def standing(frames: int = 40) -> tuple[Wrench, np.ndarray, np.ndarray]:
    """Return a total wrench whose zero-moment point goes from the right to the left foot, and the two centres."""
    time = np.arange(frames) / 100
    rng = np.random.default_rng(8)
    right, left = np.tile([0.5, 0.2, 0.0], (frames, 1)), np.tile([0.55, 0.45, 0.2], (frames, 1))
    part = np.linspace(0, 1, frames)[:, None]
    point = (1 - part) * right + part * left + np.array([0.02, 0, 0]) * rng.normal(size=(frames, 1))
    force = np.stack([rng.normal(0, 40, frames), rng.normal(0, 40, frames), np.full(frames, 650.0)], axis=1)
    twist = np.array([0, 0, 1.0]) * rng.normal(0, 5, (frames, 1))
    return Wrench(time, np.concatenate([force, np.cross(point, force) + twist], axis=1)), right, left


def test_shares_add_up_exactly() -> None:
    total, right, left = standing()
    rng = np.random.default_rng(9)
    touching = rng.random((total.time.size, 2)) > 0.4
    feet = distribute(total, right, left, touching)
    assert feet[0].value + feet[1].value == pytest.approx(total.value, abs=1e-9)
    alone = touching[:, 0] & ~touching[:, 1]
    assert feet[0].value[alone] == pytest.approx(total.value[alone])
    assert np.all(feet[1].value[alone] == 0)


def test_the_nearer_foot_carries_more_and_its_force_acts_at_it() -> None:
    total, right, left = standing()
    both = np.ones((total.time.size, 2), dtype=bool)
    feet = distribute(total, right, left, both)
    assert feet[0].force[0, 2] > 500
    assert feet[1].force[-1, 2] > 500
    assert np.all(feet[0].force[:15, 2] > feet[1].force[:15, 2])
    assert np.all(feet[0].force[-15:, 2] < feet[1].force[-15:, 2])
    middle = slice(8, -8)
    for foot, centre in zip(feet, (right, left), strict=True):
        acts = foot.cop(height=float(centre[0, 2]))
        assert np.linalg.norm(acts - centre, axis=1)[middle].max() < 0.08


def test_on_level_ground_the_shares_are_eq_2_with_the_feet_exchanged() -> None:
    total, right, left = standing()
    left[:, 2] = 0
    point = total.cop()
    d_right, d_left = (np.linalg.norm((point - centre)[:, :2], axis=1) for centre in (right, left))
    feet = distribute(total, right, left, np.ones((total.time.size, 2), dtype=bool))
    assert feet[0].force[:, 2] == pytest.approx(total.force[:, 2] * d_left / (d_right + d_left))


def test_without_load_the_total_is_halved() -> None:
    time = np.arange(3) / 100
    total = Wrench(time, np.tile([1.0, 2, 3, 4, 5, 6], (3, 1)))
    feet = distribute(total, np.zeros((3, 3)), np.ones((3, 3)), np.zeros((3, 2), dtype=bool))
    assert feet[0].value == pytest.approx(total.value / 2)
    with pytest.raises(BiodanceError, match="touching has shape"):
        distribute(total, np.zeros((3, 3)), np.ones((3, 3)), np.zeros((2, 2), dtype=bool))


def test_the_zero_moment_point_moves_with_height_along_the_force() -> None:
    total, *_ = standing()
    low, high = total.cop(), total.cop(height=0.1)
    assert (high - low)[:, :2] == pytest.approx(0.1 * total.force[:, :2] / total.force[:, 2:3])
