"""URDF files: what was written comes back as it was, what others wrote is what pinocchio reads, what is missing is
said.
"""

from pathlib import Path

import numpy as np
import pytest
from random_bodies import random_motion
from robots import biped

from biodance.body.body import Body
from biodance.body.export import write_model
from biodance.body.human.human import human
from biodance.body.parts import UPRIGHT
from biodance.body.similarity import hoap3
from biodance.body.urdf import read_urdf
from biodance.errors import BiodanceError, FileRefused, UnknownName
from biodance.motion.dynamics import regressor
from biodance.motion.kinematics import poses
from biodance.records import Subject

FEET = ("right_foot", "left_foot")
SOLES = ("r_sole", "l_sole")
ROBOT = biped()


@pytest.fixture(scope="module", params=["HOAP-3", "human"])
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Body, Body]:
    body = hoap3() if request.param == "HOAP-3" else human(Subject(58.3, 1.64, "F", 31.0))
    path = write_model(body, tmp_path_factory.mktemp("urdf") / "robot.urdf", format="urdf")
    return body, read_urdf(path, feet=FEET)


def made(tmp_path: Path, text: str) -> Body:
    (tmp_path / "robot.urdf").write_text(text)
    return read_urdf(tmp_path / "robot.urdf", feet=SOLES)


def test_what_was_written_comes_back(pair: tuple[Body, Body]) -> None:
    pin = pytest.importorskip("pinocchio")
    body, back = pair
    motion = random_motion(body, np.random.default_rng(0), frames=6)
    assert (back.name, back.segments) == (body.name, body.segments)
    assert [(j.name, j.parent, j.segment) for j in back.joints] == [(j.name, j.parent, j.segment) for j in body.joints]
    np.testing.assert_allclose(regressor(back, motion), regressor(body, motion), rtol=0, atol=1e-9)
    masses = [pin.crba(one.model, one.model.createData(), motion.q[0]) for one in (body, back)]
    np.testing.assert_allclose(masses[1], masses[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(back.sip.phi, body.sip.phi, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.boxes, body.boxes, rtol=0, atol=1e-12)
    for name in ("lower", "upper", "velocity"):
        np.testing.assert_array_equal(getattr(back.limits, name), getattr(body.limits, name))
    np.testing.assert_array_equal(
        back.limits.torque_upper, np.maximum(body.limits.torque_upper, -body.limits.torque_lower)
    )


def test_soles_are_under_the_feet_and_counter_clockwise(pair: tuple[Body, Body]) -> None:
    _, back = pair
    pose = poses(back, back.neutral[None])
    for side, sign in (("right", -1), ("left", 1)):
        foot = back.feet[side]
        corners = pose.points([foot.segment] * len(foot.outline), foot.outline)[0]
        assert len(corners) == 4
        np.testing.assert_allclose(corners[:, 2], corners[0, 2], atol=1e-9)
        assert corners[0, 2] == pytest.approx(
            pose.position[0, :, 2].min() - (0.040 if back.name == "HOAP-3" else 0.0735 * 1.64 / 1.75), abs=2e-3
        )
        assert np.sign(corners[:, 1].mean()) == sign
        edges = np.roll(corners, -1, axis=0) - corners
        assert np.all(np.cross(edges, np.roll(edges, -1, axis=0))[:, 2] > 0)


def test_the_soles_of_hoap3_are_the_manuals(pair: tuple[Body, Body]) -> None:
    body, back = pair
    if body.name != "HOAP-3":
        pytest.skip("the human's sole is a hexagon, its box a rectangle")
    for side in ("right", "left"):
        ours, theirs = (np.sort(one.feet[side].outline, axis=0) for one in (back, body))
        np.testing.assert_allclose(
            ours, theirs, atol=6e-4
        )  # the manual's table of links and its drawing differ by half a millimetre


def test_a_file_with_z_up_is_the_same_robot_as_pinocchio_reads(tmp_path: Path) -> None:
    pin = pytest.importorskip("pinocchio")
    body = made(tmp_path, ROBOT)
    model = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf"), pin.JointModelFreeFlyer())
    assert (len(body.segments), len(body.joints)) == (18, 21)
    assert body.sip.mass.sum() == pytest.approx(sum(inertia.mass for inertia in model.inertias), abs=1e-12)
    motion = random_motion(body, np.random.default_rng(1), frames=1)
    place = [model.idx_qs[model.getJointId(joint.name)] for joint in body.joints]
    speed = [model.idx_vs[model.getJointId(joint.name)] for joint in body.joints]
    q = pin.neutral(model)
    q[place] = motion.q[0, 7:]
    ours = pin.crba(body.model, body.model.createData(), motion.q[0])
    theirs = pin.crba(model, model.createData(), q)
    theirs = np.triu(theirs) + np.triu(theirs, 1).T
    ours = np.triu(ours) + np.triu(ours, 1).T
    np.testing.assert_allclose(ours[6:, 6:], theirs[np.ix_(speed, speed)], rtol=0, atol=1e-12)
    turn = np.kron(np.eye(2), UPRIGHT)  # file's root axes <- ours
    np.testing.assert_allclose(turn @ ours[:6, 6:], theirs[:6][:, speed], rtol=0, atol=1e-12)


def test_what_is_guessed_is_said(tmp_path: Path) -> None:
    (note,) = made(tmp_path, ROBOT).notes
    assert "r_hip1" in note
    assert "r_femur" not in note
    turning = ROBOT.replace('name="waist" type="revolute"', 'name="waist" type="continuous"')
    body = made(tmp_path, turning)
    assert "waist" in body.notes[1]
    assert body.limits.upper[body.joint_index("waist")] == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("</robot>", "", "is not XML"),
        ("<robot name", '<!DOCTYPE robot [<!ENTITY a "b">]><robot name', "XML entities"),
        ('<robot name="made up">', "<sdf>", "<sdf>"),
        ('name="waist" type="revolute"', 'name="waist" type="prismatic"', "'waist' is of type 'prismatic'"),
        ('<link name="base"/>', '<link name="pelvis"/>', "pelvis occurs twice"),
        ('<parent link="chest"/><child link="r_clavicle"/>', '<parent link="torso"/><child link="r_clavicle"/>',
        "'torso'"),
        ('<mass value="6.0"/>', "", "'chest' lacks <mass>"),
        ('<mass value="6.0"/>', '<mass value="-6.0"/>', "-6 kg"),
        ('<mass value="6.0"/>', '<mass value="six"/>', "'six'"),
        ('ixx="0.006"', 'ixx="0.6"', "chest"),
        ('ixx="0.006" ixy="0" ixz="0" iyy="0.006"', 'ixx="-0.6" ixy="0" ixz="0" iyy="-0.6"', "chest"),
        ('effort="40.0"/>', 'effort="0"/>', "effort of joint 'r_shoulder1' is 0"),
        ('lower="-0.3" upper="1.2"', 'lower="1.3" upper="1.2"', "1.3 to 1.2"),
        ('<axis xyz="0 1 0"/><limit lower="-0.3"', '<axis xyz="0 0 0"/><limit lower="-0.3"', "has no direction"),
        ('xyz="0 0 0.08"', 'xyz="0 0"', "three finite numbers"),
        ('<parent link="base"/>', '<parent link="l_ulna"/>', "does not hang on the root"),
        ('<child link="r_clavicle"/>', '<child link="l_clavicle"/>', "2 links have no parent"),
        ("<box size=\"0.22 0.1 0.02\"/>", '<mesh filename="sole.stl"/>', "since of its meshes the mesh 'sole.stl' is "
                                                                         "not where"),
        ("<box size=\"0.22 0.1 0.02\"/>", "<capsule/>", "<capsule>"),
    ],
)  # fmt: skip
def test_what_a_body_cannot_be_is_refused_by_name(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in ROBOT
    text = ROBOT.replace(old, new, 1)
    with pytest.raises(FileRefused, match=r"robot\.urdf") as error:
        made(tmp_path, text if new != "<sdf>" else text.replace("</robot>", "</sdf>"))
    assert said in str(error.value)


def test_limits_are_needed(tmp_path: Path) -> None:
    first = ROBOT.index("<limit")
    without = ROBOT[:first] + ROBOT[ROBOT.index("/>", first) + 2 :]
    with pytest.raises(FileRefused, match="'waist' has no <limit>"):
        made(tmp_path, without)


def test_a_joint_without_speed_and_torque_is_held_and_said(tmp_path: Path) -> None:
    first = ROBOT.index("<limit")
    end = ROBOT.index("/>", first)
    held = made(tmp_path, ROBOT[:first] + '<limit lower="-1" upper="1" velocity="0" effort="0"' + ROBOT[end:])
    assert "waist" not in {joint.name for joint in held.joints}
    assert "Joints without speed and torque are held at zero: waist." in held.notes


def test_a_joint_that_mimics_another_is_held_and_said(tmp_path: Path) -> None:
    first = ROBOT.index("<limit")
    whole = made(tmp_path, ROBOT)
    held = made(tmp_path, ROBOT[:first] + '<mimic joint="r_knee" offset="0.5"/>' + ROBOT[first:])
    assert {j.name for j in whole.joints} - {j.name for j in held.joints} == {"waist"}
    assert held.sip.mass.sum() == pytest.approx(whole.sip.mass.sum())
    assert "Joints that mimic others are held where these are at zero: waist." in held.notes
    q = np.zeros((2, whole.nq))
    q[:, 6], q[1, whole.nq - len(whole.joints) + whole.joint_index("waist")] = 1.0, 0.5
    at, chest, mass = poses(whole, q), whole.segments.index("chest"), whole.sip.mass
    centre = at.position[1, chest] + at.rotation[1, chest] @ whole.sip.com[chest]
    both = mass[0] * whole.sip.com[0] + mass[chest] * centre
    np.testing.assert_allclose(held.sip.of(held.segments[0])[1:4], both, atol=1e-9)


def test_feet_are_named_right_first(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(ROBOT)
    with pytest.raises(FileRefused, match="l_pad stands left of r_pad; name the right foot first"):
        read_urdf(tmp_path / "robot.urdf", feet=("l_sole", "r_sole"))
    with pytest.raises(UnknownName, match="Did you mean 'r_sole'"):
        read_urdf(tmp_path / "robot.urdf", feet=("r_soles", "l_sole"))
    with pytest.raises(FileRefused, match="belongs to the root"):
        read_urdf(tmp_path / "robot.urdf", feet=("pelvis", "l_sole"))
    with pytest.raises(BiodanceError, match="cannot be read"):
        read_urdf(tmp_path / "nowhere.urdf", feet=SOLES)
