"""Joint centres and axes from movement: found where the movement shows them, left alone where it does not,
derivatives exact.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joint_cases import displaced, hidden, moving, scaling
from scipy.stats import multivariate_normal

from biodance.body.human.scaling import measure_static
from biodance.body.human.skeleton import JOINTS
from biodance.body.tables.error_sizes import error_size
from biodance.errors import TrialRefused
from biodance.inference.observability import placing_leaves
from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.motion.ik.functional_joints import functional_joints
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.ik.joint_fit import MarkerSlopes, elsewhere, evaluate_joints, spread_postures
from biodance.motion.ik.joint_unknowns import (
    FAULTY,
    HINGES,
    SIZE,
    JointUnknowns,
    centre_sd,
    doubted,
    own_centre,
    own_unknowns,
)
from biodance.motion.kinematics import poses
from biodance.records import Markers, Subject
from biodance.virtual_lab.simulate import simulate_session


def test_every_choice_of_the_joints_stands_exactly_under_the_static_markers() -> None:
    body, q = displaced(hidden()).body()
    found = poses(body, q[None]).points(body.markers.segment, body.markers.position)[0]
    expected = np.stack([scaling().posture.points[name] for name in body.markers.names])
    np.testing.assert_allclose(found, expected, atol=1e-12)


def scattered(markers: Markers) -> Markers:
    """Return the markers flung about by metres, as where a recording went wrong."""
    flung = np.random.default_rng(3).normal(0.0, 2.0, markers.xyz.shape)
    return replace(markers, xyz=markers.xyz + flung)


def test_frames_that_show_no_person_place_no_joint() -> None:
    true = displaced(hidden())
    good = moving(true)
    found = functional_joints(scaling(), [good, scattered(good)])
    for joint in ("right_elbow", "trunk", "right_hip", "left_shoulder"):
        error = np.linalg.norm(found.scaling.centres.place[joint] - true.centres.place[joint])
        assert error < 0.01, (joint, error)
    assert any("75 of 150 frames did not count" in note for note in found.scaling.notes)
    with pytest.raises(TrialRefused, match="stay where the static trial puts them"):
        functional_joints(scaling(), [scattered(good)])


def test_hidden_joints_are_found_from_movement() -> None:
    theta = hidden()
    found = functional_joints(scaling(), [moving(displaced(theta))])
    true = displaced(theta).centres
    for joint in ("right_elbow", "left_elbow", "trunk", "right_hip", "right_knee", "left_shoulder"):
        error = np.linalg.norm(found.scaling.centres.place[joint] - true.place[joint])
        assert error < 0.006, (joint, error)
    for elbow, angle in (("right_elbow", 0.7), ("left_elbow", -0.6)):
        assert found.turned[elbow] == pytest.approx(angle, abs=np.radians(4)), elbow
    errors = {error.joint: error for error in found.scaling.body()[0].joint_errors}
    assert set(errors) == set(JOINTS) - set(found.kept)
    assert errors["right_elbow"].axis == pytest.approx(0.1, abs=0.08)
    assert errors["right_hip"].axis == 0.0
    assert found.rms[1] < 0.25 * found.rms[0]
    assert any(note.startswith("Joints placed by movement") for note in found.scaling.notes)


def test_the_mass_above_the_cut_stays_where_it_is_when_the_trunk_joint_moves() -> None:
    before, q = scaling().body()
    after, moved_q = displaced(hidden()).body()
    places = []
    for body, posture in ((before, q), (after, moved_q)):
        pose, trunk = poses(body, posture[None]), body.segment_index("trunk_head")
        places.append(pose.position[0, trunk] + pose.rotation[0, trunk] @ body.sip.com[trunk])
    assert before.sip.mass == pytest.approx(after.sip.mass, abs=1e-12)
    assert np.linalg.norm(places[0] - places[1]) < 0.006  # the hip that moved turns the line on which the cut lies


@pytest.mark.parametrize(("share", "seconds"), [(0.0, 120.0), (0.1, 2.0)], ids=["quiet standing", "two seconds"])
def test_what_the_movement_does_not_show_stays(share: float, seconds: float) -> None:
    found = functional_joints(scaling(), [moving(displaced(hidden()), share=share, seconds=seconds)])
    assert set(found.kept) >= {"trunk", "right_hip", "right_shoulder", "right_elbow"}
    for joint in found.kept:
        np.testing.assert_array_equal(found.scaling.centres.place[joint], scaling().centres.place[joint])
    assert any("kept where the static trial puts them" in note for note in found.notes)


def test_the_gradient_is_that_of_the_cost() -> None:
    rng = np.random.default_rng(1)
    theta = np.concatenate([0.005 * rng.normal(size=SIZE - len(HINGES)), 0.1 * rng.normal(size=len(HINGES))])
    postures = spread_postures(
        [moving(displaced(hidden()), share=0.3, seconds=12.0)], scaling().body()[0].markers.names
    )
    at = evaluate_joints(scaling(), postures, theta, None, noise=0.008)
    left_out = [i for joint in JOINTS if joint.endswith(("knee", "ankle")) for i in range(SIZE)[own_centre(joint)]]
    for k in rng.choice(np.setdiff1d(np.arange(SIZE), left_out), 8, replace=False):
        step = 1e-5 * np.eye(SIZE)[k]
        up, down = (
            evaluate_joints(scaling(), postures, theta + sign * step, at.q, noise=0.008).cost for sign in (1, -1)
        )
        assert (up - down) / 2e-5 == pytest.approx(at.gradient[k], rel=1e-3, abs=0.05), k


def test_trials_without_the_body_s_markers_are_refused() -> None:
    other = Markers(("HEAD",), np.arange(10) / 100, np.zeros((10, 1, 3)))
    with pytest.raises(TrialRefused, match="stay where the static trial puts them"):
        functional_joints(scaling(), [other])


def test_a_virtual_person_s_trunk_and_left_elbow_come_nearer_to_the_truth(tmp_path: Path) -> None:
    session = read_session(simulate_session(Subject(71.6, 1.704, "M"), "short", tmp_path / "short", seed=101))
    truth = json.loads((tmp_path / "short" / "truth" / "truth.json").read_text())
    true = {one["name"]: np.array(one["position_m"]) for one in truth["static_pose"]["segments_12"]}
    (static,), fits = session.of_role("static"), session.of_role("fit")
    before = measure_static(session.subject, prepare(static))
    after = functional_joints(before, [prepare(fit).markers for fit in fits]).scaling
    for joint, segment, share in (("trunk", "trunk_head", 0.7), ("left_elbow", "left_forearm_hand", 0.7)):
        old, new = (np.linalg.norm(one.centres.place[joint] - true[segment]) for one in (before, after))
        assert new < share * old, (joint, old, new)


@pytest.mark.parametrize("folder", ["adl_gait", "biomechzoo/HC032A"])
def test_a_real_walk_of_two_seconds_leaves_the_joints_alone(folder: str, data: Path) -> None:
    session = read_session(data / folder)
    (static,), (walk, *_) = session.of_role("static"), session.of_role("fit")
    before = measure_static(session.subject, prepare(static))
    found = functional_joints(before, [prepare(walk).markers])
    assert {"trunk", "right_hip", "left_hip", "right_elbow", "left_elbow"} <= set(found.kept)
    assert max(found.moved.values(), default=0.0) < 0.005


def test_a_marker_that_moved_since_the_static_trial_does_not_pull_the_joints_along() -> None:
    true = displaced(hidden())
    markers = moving(true, seconds=80.0)
    clean = functional_joints(scaling(), (markers,))
    xyz = np.array(markers.xyz)
    body, _ = true.body()
    pose = poses(body, solve_ik(body, markers).q)
    k = markers.names.index("RKNE")
    xyz[:, k] += pose.rotation[:, body.segment_index("right_thigh"), :, 0] * 0.08
    pulled = functional_joints(scaling(), (replace(markers, xyz=xyz),))
    assert pulled.notes[-1].startswith("Warning: the marker RKNE does not count")
    assert "right knee would lie" in pulled.notes[-1]
    knee = next(one for one in pulled.scaling.body()[0].joint_errors if one.joint == "right_knee")
    assert knee.spared == "RKNE"
    assert f"{1e3 * knee.moved:.0f} mm" in pulled.notes[-1]
    for joint in ("right_hip", "right_knee"):
        assert abs(pulled.moved[joint] - clean.moved[joint]) < 0.008
    assert not any("does not count" in note for note in clean.notes)


@pytest.mark.parametrize("far", [0.0, 0.08], ids=["where the static trial puts it", "80 mm off"])
def test_a_hip_that_the_movement_hardly_shows_is_placed_only_where_it_is_contradicted(far: float) -> None:
    theta = np.zeros(SIZE)
    theta[own_centre("right_hip")] = [far, 0, 0]
    found = functional_joints(scaling(), [moving(displaced(theta), share=0.3, seconds=40.0)])
    off = found.scaling.centres.place["right_hip"] - scaling().centres.place["right_hip"]
    warned = [note for note in found.notes if "contradicts the static trial about the right hip" in note]
    errors = {error.joint: error for error in found.scaling.body()[0].joint_errors}
    if far:
        np.testing.assert_allclose(off, [far, 0, 0], atol=0.007)
        assert max(size for joint, size in found.moved.items() if joint != "right_hip") < 0.002
        assert len(warned) == 1
        assert "Warning" in warned[0]
        assert f"{1e3 * found.moved['right_hip']:.0f} mm" in warned[0]
        assert errors["right_hip"].contradicted
        assert not errors["right_knee"].contradicted
        assert found.moved["right_hip"] <= errors["right_hip"].reach
        assert abs(errors["right_hip"].reach - far) < 2 * errors["right_hip"].reach_sd < 0.04
        assert placing_leaves(errors["right_hip"]) < 0.5 * (errors["right_hip"].centre / centre_sd("right_hip")) ** 2
    else:
        assert not off.any()
        assert not warned
        assert "right_hip" in found.kept


def test_one_hip_that_is_contradicted_leaves_the_matter_of_the_pelvis_where_it_is() -> None:
    theta = np.zeros(SIZE)
    theta[own_centre("right_hip")] = [0.08, 0, 0]
    before, q = scaling().body()
    places = []
    for wrong in ((), ("right_hip",), ("right_hip", "left_hip")):
        centres = JointUnknowns(doubted(scaling().centres, wrong)).moved(theta)
        body, posture = replace(scaling(), centres=centres).body()
        pose = poses(body, posture[None])
        places.append(pose.position[0, 0] + pose.rotation[0, 0] @ body.sip.com[0])
    pose = poses(before, q[None])
    still = pose.position[0, 0] + pose.rotation[0, 0] @ before.sip.com[0]
    assert np.linalg.norm(places[1] - still) < 1e-6
    assert places[0][0] - still[0] > 0.02  # without a doubt the middle of the hips moves, by 40 mm
    np.testing.assert_allclose(places[2], places[0], atol=1e-12)


def test_what_lies_elsewhere_is_what_makes_the_data_most_probable() -> None:
    """Linear data on the unknowns and on two markers: against the marginal density of the data, written out."""
    rng, shown = np.random.default_rng(5), ("trunk", "right_knee", "left_knee")
    usual = replace(scaling().centres, unshown=tuple(joint for joint in JOINTS if joint not in shown))
    A, B = 40 * rng.normal(size=(60, SIZE)), 40 * rng.normal(size=(60, 2, 3))
    sits, wide = error_size("marker_misplaced", "other") ** 2, (FAULTY * error_size("soft_tissue", "marker")) ** 2

    def density(y, wrong, free, places=(0.0, 0.0)):
        """``places`` variance of where each marker sits."""
        slope = JointUnknowns(replace(usual, contradicted=wrong, unshown=())).prior(np.zeros(SIZE))[1]
        # A joint that the movement does not show is anywhere where static trials put it: integrated out.
        spread = np.eye(60) + A[:, free] @ np.linalg.inv(slope.T @ slope)[np.ix_(free, free)] @ A[:, free].T
        for marker, own in enumerate(places):
            spread += own * B[:, marker] @ B[:, marker].T
        return multivariate_normal(np.zeros(60), spread).logpdf(y)

    def found(y):
        residual, slope = JointUnknowns(usual).prior(np.zeros(SIZE))
        np.testing.assert_allclose(residual, 0.0, atol=1e-9)
        known = MarkerSlopes(
            ("LKNE", "RKNE"),
            -B.reshape(60, 6).T @ y,
            B.reshape(60, 6).T @ B.reshape(60, 6),
            B.reshape(60, 6).T @ A,
        )
        placed = replace(scaling(), centres=usual)
        return elsewhere(placed, np.zeros(SIZE), (-A.T @ y, A.T @ A + slope.T @ slope), known)

    noise, free = rng.normal(size=60), sorted(i for joint in shown for i in own_unknowns(joint))
    for joint in ("right_hip", "right_knee"):
        y = noise + A[:, own_centre(joint)] @ [0.2, 0.1, 0.0]
        more = density(y, (joint,), sorted({*free, *own_unknowns(joint)})) - density(y, (), free)
        one = found(y)
        assert (one.joint, one.log_bayes_factor) == (joint, pytest.approx(more, rel=1e-6))
    y = noise + B[:, 1] @ [0.0, 0.2, 0.1]
    one = found(y)
    more = density(y, (), free, (sits, wide)) - density(y, (), free, (sits, sits))
    assert (one.marker, one.log_bayes_factor) == ("RKNE", pytest.approx(more, rel=1e-6))
    assert found(noise) is None


def test_a_leg_that_the_static_trial_has_longer_accuses_no_knee() -> None:
    """Hips and ankles lie one standard deviation from where the static trial puts them; the movement shows neither."""
    theta = np.zeros(SIZE)
    for side, up in (("left", 1), ("right", -1)):
        for joint, way in (("hip", up), ("ankle", -up)):
            theta[own_centre(f"{side}_{joint}")] = [0, 0, way * centre_sd(f"{side}_{joint}")]
    found = functional_joints(displaced(theta), [moving(scaling(), share=0.3, seconds=40.0)])
    assert {"left_hip", "right_hip", "left_ankle", "right_ankle"} <= set(found.kept)
    assert not any("contradicts" in note or "bends about" in note for note in found.notes)


@pytest.mark.parametrize(("label", "off", "moved"), [("RHEE", 0.006, False), ("RTOE", 0.03, True)])
def test_a_marker_that_sits_as_all_do_accuses_no_other(label: str, off: float, moved: bool) -> None:
    """A foot of two markers turns by the one that is 6 mm off: then neither it nor the other has moved."""
    true = moving(displaced(hidden()))
    xyz = np.array(true.xyz)
    xyz[:, true.names.index(label)] += [off, 0.0, 0.0]
    said = [note for note in functional_joints(scaling(), [replace(true, xyz=xyz)]).notes if "does not count" in note]
    assert [f"the marker {label} " in note for note in said] == [True] * moved
