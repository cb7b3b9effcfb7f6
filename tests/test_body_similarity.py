"""The same robot in other frames and in another size: wrenches and torques are those of physics, not of the
description.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from random_bodies import random_motion
from robots import biped

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.body.similarity import SimilarityScale, hoap3, reframed, similar_body, sole_normal, standing_frames
from biodance.body.urdf import read_urdf
from biodance.errors import BiodanceError
from biodance.motion.dynamics import joint_torques, predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Motion

HOAP = hoap3()


def made_up(tmp_path: Path) -> Body:
    (tmp_path / "robot.urdf").write_text(biped())
    return read_urdf(tmp_path / "robot.urdf", feet=("r_sole", "l_sole"))


def test_standing_frames_change_the_description_only(tmp_path: Path) -> None:
    for body in (HOAP, made_up(tmp_path)):
        other, motion = standing_frames(body), random_motion(body, np.random.default_rng(2), frames=5)
        np.testing.assert_allclose(
            predict_wrench(other, motion).value, predict_wrench(body, motion).value, rtol=0, atol=1e-9
        )
        np.testing.assert_allclose(
            joint_torques(other, motion, {}).torque, joint_torques(body, motion, {}).torque, rtol=0, atol=1e-9
        )
        before, after = poses(body, motion.q), poses(other, motion.q)
        for side in ("right", "left"):
            foot, new = body.feet[side], other.feet[side]
            index = [foot.segment] * len(foot.outline)
            np.testing.assert_allclose(after.points(index, new.outline), before.points(index, foot.outline), atol=1e-12)
            flat = poses(other, other.neutral[None]).rotation[0, new.segment]
            np.testing.assert_allclose(flat, UPRIGHT, atol=1e-12)
            np.testing.assert_allclose(sole_normal(new), [0, 1, 0], atol=1e-12)
            np.testing.assert_allclose(new.outline[:, 1], new.outline[0, 1], atol=1e-12)


def test_the_origin_of_a_foot_is_where_its_last_axes_meet(tmp_path: Path) -> None:
    body = made_up(tmp_path)
    lifted = [replace(j, translation=np.array([0.05, 0, 0])) if j.name == "r_ankle_roll" else j for j in body.joints]
    other = standing_frames(replace(body, joints=tuple(lifted)))
    pose = poses(other, other.neutral[None])
    ankle = pose.joint_position[0, other.joint_index("r_ankle_pitch")]
    np.testing.assert_allclose(pose.position[0, other.feet["right"].segment], ankle, atol=1e-12)  # not 0.05 m ahead


def test_a_frame_turned_and_back_is_the_old_one() -> None:
    turn, foot = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), HOAP.feet["right"].segment
    shift = 0.02 * HOAP.joints[HOAP.segment_joint[foot]].axis
    back = reframed(reframed(HOAP, foot, turn, shift), foot, turn.T, -turn.T @ shift)
    np.testing.assert_allclose(back.sip.phi, HOAP.sip.phi, atol=1e-15)
    np.testing.assert_allclose(back.sip.covariance, HOAP.sip.covariance, atol=1e-15)
    np.testing.assert_allclose(back.boxes, HOAP.boxes, atol=1e-12)
    np.testing.assert_allclose(back.feet["right"].outline, HOAP.feet["right"].outline, atol=1e-12)


def test_a_sole_that_faces_elsewhere_is_refused() -> None:
    foot = HOAP.feet["left"]
    tilted = replace(foot, outline=foot.outline[:, [2, 1, 0]])
    with pytest.raises(BiodanceError, match=r"the left sole faces .* degrees away from the ground"):
        standing_frames(replace(HOAP, feet={**HOAP.feet, "left": tilted}))


def test_a_likeness_moves_alike_under_the_same_gravity() -> None:
    to = SimilarityScale(3.6, 8.2)
    big, motion = similar_body(HOAP, to), random_motion(HOAP, np.random.default_rng(3), frames=5)
    units = np.concatenate([np.full(3, to.length), np.ones(HOAP.nv - 3)])
    q = motion.q.copy()
    q[:, :3] *= to.length
    slow = Motion(to.time * motion.time, q, motion.v * units / to.time, motion.a * units / to.time**2)
    force = np.repeat([to.mass, to.mass * to.length], 3)
    small, large = predict_wrench(HOAP, motion).value, predict_wrench(big, slow).value
    np.testing.assert_allclose(large, force * small, rtol=1e-9, atol=1e-9)
    torques = [joint_torques(body, one, {}).torque for body, one in ((HOAP, motion), (big, slow))]
    np.testing.assert_allclose(torques[1], to.mass * to.length * torques[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(big.limits.torque_upper / HOAP.limits.torque_upper, to.mass * to.length)
    np.testing.assert_allclose(big.limits.velocity * to.time, HOAP.limits.velocity)
    back = similar_body(big, SimilarityScale(1 / to.length, 1 / to.mass))
    np.testing.assert_allclose(back.sip.phi, HOAP.sip.phi, rtol=1e-12)
    np.testing.assert_allclose(back.sip.covariance, HOAP.sip.covariance, rtol=1e-9, atol=1e-18)
