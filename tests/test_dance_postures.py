import coal
import numpy as np
import pytest

from biodance.body.body import UPRIGHT
from biodance.body.human import human
from biodance.dance.chain import Chain
from biodance.dance.excitation import blocks
from biodance.dance.postures import find_postures
from biodance.dance.shapes import box_pairs, capsule, capsule_pairs
from biodance.dance.stance import stance
from biodance.motion.dynamics import distribute, joint_torques, zmp
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)


@pytest.fixture(scope="module")
def found():
    feet = stance(BODY, "parallel")
    stances = (feet, feet, stance(BODY, "right_forward", right=0.2), feet.on(0), feet.on(1))
    return find_postures(CHAIN, blocks(BODY), stances, rng=np.random.default_rng(3), sweeps=1)


def still(x):
    return CHAIN.motion(np.zeros(1), x[None], *np.zeros((2, 1, CHAIN.size)))


def test_every_posture_holds_its_limits_judged_by_other_code(found):
    for x, where in zip(found.x, found.stances, strict=True):
        motion = still(x)
        pose, wrench = poses(BODY, motion.q), predict_wrench(BODY, motion)
        for side, name in enumerate(("right_foot", "left_foot")):
            foot = BODY.segment_index(name)
            if side in where.planted:
                np.testing.assert_allclose(pose.position[0, foot], where.ankle[side], atol=1e-9)
                np.testing.assert_allclose(pose.rotation[0, foot], UPRIGHT, atol=1e-9)
        normals, offsets = where.edges
        assert (normals @ zmp(wrench)[0, :2] + offsets).min() >= 0
        touching = np.array([[0 in where.planted, 1 in where.planted]])
        right, left = distribute(wrench, where.sole_centres[:1], where.sole_centres[1:], touching)
        torque = joint_torques(BODY, motion, {"right_foot": right, "left_foot": left}).torque[0]
        assert (torque - BODY.limits.torque_lower).min() >= 0
        assert (BODY.limits.torque_upper - torque).min() >= 0
        assert (motion.q[0, 7:] - BODY.limits.lower).min() >= 0
        assert (BODY.limits.upper - motion.q[0, 7:]).min() >= 0
        assert gaps(pose).min() > 0


def gaps(pose):
    def solid(segment, box):
        turn, origin = pose.rotation[0, segment], pose.position[0, segment]
        if box:
            low, high = BODY.boxes[segment]
            return coal.Box(*(high - low)), coal.Transform3s(turn, origin + turn @ (low + high) / 2)
        ends, radius = capsule(BODY, segment)
        along = ends[1] - ends[0]
        axis = along / np.linalg.norm(along)
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        side /= np.linalg.norm(side)
        place = turn @ np.stack([side, np.cross(axis, side), axis], axis=1)
        return coal.Capsule(radius, np.linalg.norm(along)), coal.Transform3s(place, origin + turn @ ends.mean(axis=0))

    out = []
    for pairs, boxed in ((capsule_pairs(BODY), False), (box_pairs(BODY), True)):
        for i, j in pairs:
            a, b = solid(i, False), solid(j, boxed)
            out.append(coal.distance(*a, *b, coal.DistanceRequest(), coal.DistanceResult()))
    return np.array(out)


def test_the_criterion_is_over_its_bound_and_the_same_seed_gives_the_same_postures(found):
    assert found.bound == pytest.approx(65.0, abs=1e-6)
    assert found.criterion > found.bound
    again = find_postures(CHAIN, blocks(BODY), found.stances[:1], rng=np.random.default_rng(5), sweeps=1)
    twice = find_postures(CHAIN, blocks(BODY), found.stances[:1], rng=np.random.default_rng(5), sweeps=1)
    np.testing.assert_array_equal(again.x, twice.x)
