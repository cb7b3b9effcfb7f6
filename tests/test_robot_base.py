"""What sees a robot's base tells of a wrong ankle what the joints alone cannot: markers in the plate's file, an IMU."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
from robot_lab import RobotLab, write_robot_trial
from robot_recordings import FEET, SOLE_OVER_ANKLE, danced, drawing, real_robot

from biodance.body.body import Body
from biodance.body.robot.urdf import read_urdf
from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.robot import read_robot_recording
from biodance.motion.dynamics import predict_wrench
from biodance.motion.grounded import base_of_markers
from biodance.pipeline.robot_trials import bring_together
from biodance.records import Array, Markers

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
    fit, truth = one.motion.fit, replace(body, sip=real_robot().sip)
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
