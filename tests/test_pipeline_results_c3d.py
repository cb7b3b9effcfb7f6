"""What a session found for a trial stands in the copy of its recording: angles, moments, wrenches and centre of mass
agree.
"""

import numpy as np
import pytest

from biodance.cli import run
from biodance.cli.shared import DONE, NOT_DONE
from biodance.errors import TrialRefused
from biodance.identification.torques import ground_torques, torque_regressor
from biodance.lab.c3d.raw import read_raw
from biodance.lab.session.read import read_session
from biodance.motion.contact import foot_wrenches, ground_contact
from biodance.motion.soles import soles_from_body
from biodance.pipeline.export import results_into_c3d
from biodance.pipeline.session import examine
from biodance.records import Subject
from biodance.virtual_lab.movement import Protocol, read_protocol
from biodance.virtual_lab.simulate import simulate_session


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    short = read_protocol("short")
    protocol = Protocol("shorter", (short.trials[0], short.trials[2]))
    return simulate_session(
        Subject(58.0, 1.66, "F", 28.0, "S07"), protocol, tmp_path_factory.mktemp("lab") / "S07", seed=11
    )


@pytest.fixture(scope="module")
def result(session):
    return examine(read_session(session))


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    squat = next(one for one in result.trials if one.trial.name == "squat_1")
    path, sentence = results_into_c3d(
        squat, result.body, tmp_path_factory.mktemp("out") / "out.c3d", source="The table."
    )
    assert "squat_1 with 38 results" in sentence
    return squat, read_raw(path)


def of(raw, label):
    return raw.points[:, raw.labels.index(label)]


def test_angles_are_those_of_the_motion_in_degrees(result, written):
    squat, raw = written
    for label, joints in {
        "RightHipAngles": ("right_hip_flexion", "right_hip_adduction", "right_hip_rotation"),
        "LeftKneeAngles": ("left_knee_flexion",),
        "TrunkAngles": ("trunk_flexion", "trunk_bending", "trunk_rotation"),
    }.items():
        for k, joint in enumerate(joints):
            expected = np.degrees(squat.motion.q[:, 7 + result.body.joint_index(joint)])
            np.testing.assert_allclose(of(raw, label)[:, k], expected, rtol=1e-5, atol=1e-5)
        assert not of(raw, label)[:, len(joints) :].any()
    assert of(raw, "LeftKneeAngles")[:, 0].max() > 60  # somebody squats


def test_moments_are_those_of_another_formula(result, written):
    squat, raw = written
    body, soles = result.body, soles_from_body(result.body, squat.motion)
    ground = foot_wrenches(squat.trial, ground_contact(squat.trial, soles, mass=body.sip.mass.sum()), soles)
    torque = torque_regressor(body, squat.motion) @ body.sip.phi - ground_torques(body, squat.motion, ground)
    used, j = squat.comparison.used, body.joint_index("right_knee_flexion")
    knee, power = of(raw, "RightKneeMoments")[:, 0], of(raw, "RightKneePower")[:, 0]
    np.testing.assert_allclose(knee[used], torque[used, j], rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(power[used], torque[used, j] * squat.motion.v[used, 6 + j], rtol=1e-4, atol=1e-3)


def test_predicted_force_is_what_moves_the_centre_of_mass(result, written):
    _, raw = written
    com, force = of(raw, "BodyCentreOfMass") / 1000, of(raw, "PredictedGroundForce")
    acceleration = np.gradient(np.gradient(com, 1 / raw.rate, axis=0), 1 / raw.rate, axis=0)
    expected = result.body.sip.mass.sum() * (acceleration + np.array([0, 0, 9.80665]))
    inner = np.isfinite(force).all(axis=1)
    inner[:30] = inner[-30:] = False
    assert inner.sum() > 100
    np.testing.assert_allclose(force[inner], expected[inner], atol=6.0)


def test_measured_wrench_and_masses_are_there(result, written):
    squat, raw = written
    used = squat.comparison.used
    measured = np.hstack([of(raw, "MeasuredGroundForce"), of(raw, "MeasuredGroundMoment")])
    np.testing.assert_allclose(measured[used], squat.comparison.measured[used], rtol=1e-5, atol=1e-3)
    assert raw.parameters["BIODANCE"]["SEGMENTS"] == list(result.body.segments)
    np.testing.assert_allclose(raw.parameters["BIODANCE"]["MASS"], result.body.sip.mass, rtol=1e-6)


def test_without_a_motion_or_a_c3d_file_it_is_refused(result, tmp_path):
    from dataclasses import replace

    squat = next(one for one in result.trials if one.trial.name == "squat_1")
    with pytest.raises(TrialRefused, match="no motion"):
        results_into_c3d(replace(squat, motion=None), result.body, tmp_path / "a.c3d", source="")
    text = replace(squat, trial=replace(squat.trial, source=replace(squat.trial.source, format="TRC + MOT")))
    with pytest.raises(TrialRefused, match="Only a C3D file"):
        results_into_c3d(text, result.body, tmp_path / "a.c3d", source="")


def test_the_command(session, tmp_path, capsys):
    out = tmp_path / "results.c3d"
    words = ["export", str(session), "--format", "c3d", "--trial", "squat_1", "--out", str(out)]
    assert run(words) == DONE
    assert "RightHipAngles" in read_raw(out).labels
    assert run(words) == NOT_DONE
    assert "not overwritten" in capsys.readouterr().err
    assert run([*words, "--force"]) == DONE
