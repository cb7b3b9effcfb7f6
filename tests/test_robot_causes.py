"""What is not as drawn about a robot is named with its size; causes are made by pinocchio alone, not by the formulas
that find them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
from robot_lab import RobotLab, write_robot_trial
from robot_recordings import FEET, RATE, SOLE_OVER_ANKLE, danced, drawing, real_robot

from biodance.body.body import Body
from biodance.body.urdf import read_urdf
from biodance.diagnosis.robot import robot_causes
from biodance.errors import SessionRefused, TrialRefused
from biodance.identification.robot import RobotMotion, robot_fit
from biodance.lab.robot import read_robot_recording
from biodance.motion.dynamics import predict_wrench
from biodance.motion.grounded import PlateFit, base_of_markers, from_plate, ground
from biodance.pipeline.robot import cause_words
from biodance.pipeline.robot_trials import bring_together
from biodance.records import Array, Markers

_SECONDS, _STEP = 16.0, 2
ANKLE, SOFT = "left_ankle_pitch", 60.0
"""The joint that gives, and its stiffness, N·m/rad."""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Body:
    return read_urdf(drawing(tmp_path_factory.mktemp("drawn")), feet=FEET)


@pytest.fixture(scope="module")
def truth() -> list[tuple[Array, Array, Array]]:
    return [danced(real_robot(), seed, _SECONDS) for seed in (0, 1)]


def seen(body: Body, angle: Array, wrench: Array) -> RobotMotion:
    """Return what encoders and a plate under the left sole show."""
    rng = np.random.default_rng(4)
    time = np.arange(0, len(angle), _STEP) / RATE
    shown = angle[::_STEP] + 0.0003 * rng.normal(size=angle[::_STEP].shape)
    pressed = wrench[::_STEP] + rng.normal(size=(time.size, 6)) * [0.1, 0.1, 0.1, 0.01, 0.01, 0.01]
    middle = np.mean(real_robot().feet["left"].outline, axis=0)
    place = PlateFit(0.0, (float(middle[2]), float(middle[1])), 0.0, 1.0, 1.0)
    found = ground(body, time, shown)
    return robot_fit("run", found, shown, from_plate(pressed, place.place, 0.0))


def ankle_torque(angle: Array, wrench: Array) -> Array:
    """Return the torque (T,) N·m of the standing ankle: what the foot, weighed alone, leaves of the ground's wrench."""
    body = real_robot()
    model, joint = body.model, body.segment_joint[body.feet["left"].segment] + 2
    data, column = model.createData(), [one.name for one in body.joints].index(ANKLE)
    planted = pin.SE3(np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]), np.array([0.0, 0.0, -SOLE_OVER_ANKLE]))
    out = []
    for one, pressed in zip(angle, wrench, strict=True):
        q = np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], one])
        pin.forwardKinematics(model, data, q)
        q[:7] = pin.SE3ToXYZQUAT(planted * data.oMi[joint].inverse())
        weight = pin.computeGeneralizedGravity(model, data, q)
        pin.computeJointJacobians(model, data, q)
        out.append((weight - pin.getJointJacobian(model, data, joint, pin.WORLD).T @ pressed)[6 + column])
    return np.array(out)


def test_nothing_is_named_where_only_a_cover_is_off(robot: Body, truth: list[tuple[Array, Array, Array]]) -> None:
    fit, kept = (seen(robot, angle, wrench) for _, angle, wrench in truth)
    found, (same, _) = robot_causes(robot, (fit,), (kept,))
    assert found == ()
    assert same is fit


def test_an_ankle_that_gives_is_named_with_its_stiffness(robot: Body, truth: list[tuple[Array, Array, Array]]) -> None:
    trials = []
    for _, angle, wrench in truth:
        shown = np.array(angle)
        column = [one.name for one in robot.joints].index(ANKLE)
        shown[:, column] += ankle_torque(angle, wrench) / SOFT
        trials.append((seen(robot, shown, wrench), angle[::_STEP, column], shown[::_STEP, column]))
    found, (fit, _) = robot_causes(robot, (trials[0][0],), (trials[1][0],))
    first = found[0]
    assert (first.cause.kind, first.cause.where) == ("flexible_joint", ANKLE)
    assert first.value == pytest.approx(1 / SOFT, rel=0.1)
    assert first.kept_gain > 10
    _, true, shown = trials[0]
    left = np.std(fit.angle[:, column] - true)
    assert left < 0.2 * np.std(shown - true)
    assert f"{ANKLE} gives under load" in cause_words(found)[0].text


def test_a_sole_that_gives_is_named_with_the_ankle_above_it(
    robot: Body, truth: list[tuple[Array, Array, Array]]
) -> None:
    give, (_, angle, wrench) = 0.005, truth[0]
    middle = np.mean(real_robot().feet["left"].outline, axis=0)[2]
    nod = np.pad(-give * (wrench[:, 4] + middle * wrench[:, 2]), 1, mode="edge")
    _, _, tilted = danced(real_robot(), 0, _SECONDS, nod=nod)
    found, _ = robot_causes(robot, (seen(robot, angle, tilted),))
    first = found[0]
    named = [(one.kind, one.where) for one in (first.cause, *first.rivals)]
    assert ("soft_sole", "forwards") in named
    assert first.value == pytest.approx(give, rel=0.4)
    assert ("flexible_joint", ANKLE) in named
    assert any("standing foot" in said.text or "soft sole" in said.text for said in cause_words(found))


# ---- What sees a robot's base tells of a wrong ankle what the joints alone cannot

PLACES = {"T1": (0.05, 0.04, 0.10), "T2": (-0.06, 0.05, 0.08), "T3": (0.0, -0.07, 0.12), "T4": (0.02, 0.0, -0.05)}
SAID = "[base]\nmarkers = {" + ", ".join(f"{name} = {list(xyz)}" for name, xyz in PLACES.items()) + "}\n"


def root_poses(angle: Array) -> tuple[Array, Array]:
    """Return turn (T, 3, 3) and place (T, 3) m of the pelvis of a robot that stands on its left foot."""
    body = real_robot()
    model, joint = body.model, body.segment_joint[body.feet["left"].segment] + 2
    data = model.createData()
    planted = pin.SE3(np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]), np.array([0.0, 0.0, -SOLE_OVER_ANKLE]))
    turn, place = [], []
    for one in angle:
        pin.forwardKinematics(model, data, np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], one]))
        root = planted * data.oMi[joint].inverse()
        turn.append(root.rotation)
        place.append(root.translation)
    return np.array(turn), np.array(place)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which the left ankle's encoder lies by two degrees, to and fro, with markers and IMU."""
    folder = tmp_path_factory.mktemp("base")
    drawing(folder)
    time, angle, wrench = danced(real_robot(), 0, 11.0)
    turn, origin = root_poses(angle)
    local = np.array([[x, z, -y] for x, y, z in PLACES.values()])
    markers = origin[:, None] + np.einsum("tij,kj->tki", turn, local)
    names = [joint.name for joint in real_robot().joints]
    shown = np.array(angle)
    shown[:, names.index("left_ankle_pitch")] += 0.035 * np.sin(2 * np.pi * 0.3 * time)
    standard = turn @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    pitch, roll = -np.arcsin(standard[:, 2, 0]), np.arctan2(standard[:, 2, 1], standard[:, 2, 2])
    write_robot_trial(
        folder / "run" / "run",
        (*names, "imu_roll", "imu_pitch"),
        time,
        np.column_stack([shown, roll, pitch]),
        wrench,
        lab=RobotLab(),
        seed=3,
        markers=(tuple(PLACES), markers),
    )
    return folder


def unexplained(folder: Path, said: str) -> Array:
    """Return the RMS (6,) of what the real robot's masses leave of the wrench."""
    body: Body = read_urdf(folder / "hoap3.urdf", feet=FEET)
    (folder / "run" / "recording.toml").write_text(said)
    found = read_robot_recording(folder / "run", tuple(joint.name for joint in body.joints))
    (one,), lost = bring_together(body, found)
    assert not lost
    fit, truth = one.fit, replace(body, sip=real_robot().sip)
    left = fit.wrench.value - predict_wrench(truth, fit.motion).value
    return np.asarray(left[fit.use].std(axis=0))


def test_markers_and_an_imu_see_what_an_ankle_hides(place: Path) -> None:
    blind = unexplained(place, "")
    marked = unexplained(place, SAID)
    inclined = unexplained(place, '[base]\nimu = {roll = "imu_roll", pitch = "imu_pitch"}\n')
    assert blind[4] > 0.5
    assert marked[4] < 0.5 * blind[4]
    assert inclined[4] < 0.5 * blind[4]


def test_what_sees_the_base_must_be_there_and_legal(place: Path, tmp_path: Path) -> None:
    with pytest.raises(SessionRefused, match="forwards, left, up"):
        unexplained(place, "[base]\nmarkers = {T1 = [1, 2]}\n")
    seen = Markers(("T1", "T2", "T3"), np.arange(2.0), np.tile(np.eye(3), (2, 1, 1)))
    with pytest.raises(TrialRefused, match="markers T4 are missing"):
        base_of_markers(seen, PLACES, "file")
    with pytest.raises(TrialRefused, match="mm RMS from where"):
        base_of_markers(seen, {name: PLACES[name] for name in seen.names}, "file")
    assert pd.read_csv(place / "run" / "run_joints.csv").shape[1] == 24
