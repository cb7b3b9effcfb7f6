"""Legs closed numerically: the human's closed form comes out, feet stay where they are, and the same knee bends in
every frame.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from robots import biped
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.parts import UPRIGHT
from biodance.body.similarity import SimilarityScale, hoap3, similar_body, standing_frames
from biodance.body.urdf import read_urdf
from biodance.errors import BiodanceError
from biodance.motion.ik.compiled.legs import GeneralLeg, Leg
from biodance.motion.kinematics import poses
from biodance.records import Array, Subject

HUMAN = human(Subject(65.0, 1.75, "F", 33.0))
HOAP = standing_frames(hoap3())
STRAIGHT = np.radians(9.0)
Poses = tuple[Array, Array, Array, Array]


def offset_robot(tmp_path: Path) -> Body:
    """A robot whose hip axes are 30 mm apart."""
    (tmp_path / "robot.urdf").write_text(biped(hip_offset=0.03))
    return standing_frames(read_urdf(tmp_path / "robot.urdf", feet=("r_sole", "l_sole")))


def stands(leg: GeneralLeg, frames: int = 100, seed: int = 0) -> Poses:
    """Poses of a pelvis that turns and leans over a flat foot, the leg from deeply bent to nearly straight."""
    rng = np.random.default_rng(seed)
    turn = UPRIGHT @ Rotation.from_euler("yxz", rng.normal(0, [0.2, 0.2, 0.35], (frames, 3))).as_matrix()
    up = rng.normal([0, 0, 1], [0.2, 0.15, 0], (frames, 3))
    distance = rng.uniform(0.5, 1.0, frames) * float(leg.length(STRAIGHT))
    ankle = np.tile([0.02, -0.1, 0.08], (frames, 1))
    pelvis = ankle + up * (distance / np.linalg.norm(up, axis=1))[:, None] - turn @ leg.hip
    return turn, pelvis, np.tile(UPRIGHT, (frames, 1, 1)), ankle


def foot_of(body: Body, side: str, leg: GeneralLeg, angles: Array, given: Poses) -> tuple[Array, Array]:
    """Turn and place of a foot by forward kinematics."""
    q = np.tile(body.neutral, (len(angles), 1))
    q[:, :3], q[:, 3:7] = given[1], Rotation.from_matrix(given[0]).as_quat()
    q[:, 7 + np.array(leg.columns)] = angles
    pose, foot = poses(body, q), body.feet[side].segment
    return pose.rotation[:, foot], pose.position[:, foot]


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_closed_form_comes_out_for_a_person(side: str) -> None:
    general, closed = GeneralLeg.of(HUMAN, side), Leg.of(HUMAN, side)
    assert Leg.fits(HUMAN, side)
    assert general.columns == closed.columns
    np.testing.assert_allclose(general.hip, closed.hip, atol=1e-12)
    bends = np.linspace(0.05, 2.0, 9)
    straight = float(closed.length(np.linspace(-0.3, 0.3, 6001)).max())
    assert float(general.length(0.0)) == pytest.approx(straight, abs=1e-7)
    given = stands(general)
    np.testing.assert_allclose(general.solve(*given), closed.solve(*given), rtol=0, atol=1e-9)
    assert np.all(np.diff(general.length(bends)) < 0)


@pytest.mark.parametrize("side", ["right", "left"])
def test_feet_are_where_they_should_be(side: str, tmp_path: Path) -> None:
    for body in (HOAP, offset_robot(tmp_path)):
        assert not Leg.fits(body, side)
        leg = GeneralLeg.of(body, side)
        given = stands(leg, seed=1)
        angles = leg.solve(*given)
        turn, place = foot_of(body, side, leg, angles, given)
        np.testing.assert_allclose(turn, given[2], rtol=0, atol=1e-10)
        np.testing.assert_allclose(place, given[3], rtol=0, atol=1e-10)
        assert np.all(leg.sense * (angles[:, 3] - leg.straight) > 0)


def test_the_order_of_the_frames_does_not_matter() -> None:
    leg = GeneralLeg.of(HOAP, "right")
    given, order = stands(leg), np.random.default_rng(5).permutation(100)
    angles = leg.solve(*given)
    np.testing.assert_allclose(leg.solve(*(part[order] for part in given)), angles[order], rtol=0, atol=1e-9)
    alone = np.concatenate([leg.solve(*(part[k : k + 1] for part in given)) for k in range(5)])
    np.testing.assert_allclose(alone, angles[:5], rtol=0, atol=1e-9)


def test_a_foot_out_of_reach_is_drawn_towards_the_hip() -> None:
    leg = GeneralLeg.of(HOAP, "left")
    turn, pelvis, flat, ankle = stands(leg, frames=3, seed=2)
    far = (
        ankle
        + 1.3
        * (pelvis + turn @ leg.hip - ankle)
        * (leg.length(0.0) / np.linalg.norm(pelvis + turn @ leg.hip - ankle, axis=1))[:, None]
    )
    lifted = (turn, far - turn @ leg.hip, flat, ankle)
    _, place = foot_of(HOAP, "left", leg, leg.solve(*lifted), lifted)
    hip = lifted[1] + turn @ leg.hip
    np.testing.assert_allclose(np.cross(hip - place, hip - ankle), 0.0, atol=1e-9)
    assert np.all(np.linalg.norm(hip - place, axis=1) < leg.length(0.0))


def test_a_likeness_has_the_same_angles() -> None:
    leg, big = GeneralLeg.of(HOAP, "right"), GeneralLeg.of(similar_body(HOAP, SimilarityScale(3.6, 8.0)), "right")
    turn, pelvis, flat, ankle = stands(leg)
    np.testing.assert_allclose(
        big.solve(turn, 3.6 * pelvis, flat, 3.6 * ankle), leg.solve(turn, pelvis, flat, ankle), rtol=0, atol=1e-9
    )


def test_other_legs_are_refused() -> None:
    foot = HOAP.feet["right"]
    with pytest.raises(BiodanceError, match=r"the right leg has 4 joints .*exactly six"):
        GeneralLeg.of(
            replace(HOAP, feet={**HOAP.feet, "right": replace(foot, segment=HOAP.segment_index("right_shank"))}),
            "right",
        )
    waist = [replace(j, axis=np.array([1.0, 0.0, 0.0])) if j.name == "left_knee_pitch" else j for j in HOAP.joints]
    with pytest.raises(BiodanceError, match=r"the left leg does not squat.*left_knee_pitch"):
        GeneralLeg.of(replace(HOAP, joints=tuple(waist)), "left")
