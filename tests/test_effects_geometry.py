"""Effects in the body's geometry, against really tracking the trial again with the changed body."""

from dataclasses import replace

import numpy as np
import pytest
from human_cases import human_case

from biodance.body.changes import move_joint, move_marker, recentre_joint
from biodance.body.human.human import human
from biodance.body.parts import shift_matter
from biodance.effects import effect
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.motion.track import track
from biodance.records import Array, Markers, Subject
from biodance.spatial import point_mass

INSIDE = slice(60, -60)
"""The first and last half second depend on how the low-pass continues the ends."""
CAUSES = [
    ("joint_centre", "left_hip", 0),
    ("joint_centre", "right_knee", 1),
    ("joint_centre", "trunk", 0),
    ("joint_centre", "right_elbow", 0),
    ("segment_length", "right_thigh", 0),
    ("segment_length", "left_upper_arm", 0),
    ("marker_misplaced", "LKNE", 2),
    ("marker_misplaced", "RASI", 0),
]


def differences(name: str, target: str, component: int) -> tuple[Array, Array]:
    """Return the changes of the wrench (T, 6) and of the residual (K, 3) per metre, by tracking twice."""
    found = effect(name).at(target, human_case())
    step = 0.002 * np.eye(found.typical.size)[component]
    plus, minus = (found.corrected(human_case(), sign * step) for sign in (1, -1))
    wrench = (
        predict_wrench(plus.body, plus.motion, plus.phi).value
        - predict_wrench(minus.body, minus.motion, minus.phi).value
    )
    return wrench / 0.004, -(plus.marker_residual - minus.marker_residual) / 0.004


@pytest.mark.parametrize(("name", "target", "component"), CAUSES)
def test_columns_are_those_of_tracking_again(name: str, target: str, component: int) -> None:
    wrench, rows = differences(name, target, component)
    found = effect(name).at(target, human_case())
    error = found.columns(human_case())[INSIDE, :, component] - wrench[INSIDE]
    for part in (slice(0, 3), slice(3, 6)):
        assert np.linalg.norm(error[:, part]) < 0.05 * np.linalg.norm(wrench[INSIDE])
    predicted = found.marker_columns(human_case())
    assert predicted is not None
    np.testing.assert_allclose(predicted[:, :, component], rows, atol=0.015)


def test_true_marker_place_leaves_no_mean_residual() -> None:
    """A marker 20 mm off shows in its row; the corrected case has the residual of the marker put right."""
    found = effect("marker_misplaced").at("RTIB", human_case())
    shift = np.array([0.0, 0.02, 0.0])
    wrong = found.corrected(human_case(), -shift)
    right = found.corrected(wrong, shift)
    np.testing.assert_allclose(right.marker_residual, human_case().marker_residual, atol=1e-6)
    change = wrong.marker_residual - right.marker_residual
    row = human_case().marker_columns.index(human_case().body.markers.names.index("RTIB"))
    rows = found.marker_columns(human_case())
    assert rows is not None
    predicted = rows @ shift
    assert np.linalg.norm(change[row]) > 0.01
    np.testing.assert_allclose(change, predicted, atol=0.0015)


def test_a_moved_marker_is_measured_from_postures_that_do_not_follow_it() -> None:
    """A marker that sits 50 mm off in every frame: the tracked body follows it half the way."""
    shift, body = np.array([0.05, 0.0, 0.01]), human_case().body
    index = body.markers.names.index("RKNE")
    pose = poses(body, human_case().motion.q)
    xyz = np.array(pose.points(body.markers.segment, body.markers.position))
    xyz[:, index] += pose.rotation[:, body.markers.segment[index]] @ shift
    trial = replace(human_case().trial, markers=Markers(body.markers.names, human_case().motion.time, xyz))
    case = replace(human_case(), trial=trial, motion=track(body, trial))
    found = effect("marker_misplaced").at("RKNE", case)
    followed = case.marker_residual[case.marker_columns.index(index)]
    assert np.linalg.norm(followed) < 0.7 * np.linalg.norm(shift)
    np.testing.assert_allclose(found.measured(np.zeros(3), case), shift, atol=1e-3)
    blind = replace(case, trial=replace(trial, markers=trial.markers.select(body.markers.names[:3])))
    np.testing.assert_array_equal(found.measured(shift, blind), shift)


def test_trial_without_the_marker_says_nothing_about_it() -> None:
    assert human_case().trial.markers is not None
    fewer = human_case().trial.markers.select(name for name in human_case().trial.markers.names if name != "LTIB")
    blind = replace(human_case(), trial=replace(human_case().trial, markers=fewer))
    found = replace(effect("marker_misplaced"), target="LTIB")
    assert not found.columns(blind).any()
    rows = found.marker_columns(blind)
    assert rows is not None
    assert rows.shape == (len(blind.marker_columns), 3, 3)
    assert not rows.any()


def test_recentred_joint_keeps_the_neutral_body() -> None:
    body = human(Subject(60, 1.65, "F", 30))
    joint = [j.name for j in body.joints].index("left_knee_flexion")
    other = recentre_joint(body, joint, np.array([0.01, 0.02, -0.03]))
    neutral = body.neutral[None]
    before, after = (poses(b, neutral).points(b.markers.segment, b.markers.position) for b in (body, other))
    np.testing.assert_allclose(after, before, atol=1e-12)
    np.testing.assert_allclose(other.sip.mass, body.sip.mass, atol=1e-12)
    everywhere = list(range(len(body.segments)))
    com = [poses(b, neutral).points(everywhere, b.sip.com) for b in (body, other)]
    np.testing.assert_allclose(com[1], com[0], atol=1e-12)
    bent = np.array(neutral)
    bent[0, 7 + joint] = 1.0
    moved = [poses(b, bent).points(b.markers.segment, b.markers.position) for b in (body, other)]
    assert np.abs(moved[1] - moved[0]).max() > 0.01


def test_displaced_matter_is_a_point_mass_elsewhere() -> None:
    place, shift = np.array([0.1, -0.2, 0.3]), np.array([0.05, 0.02, -0.07])
    np.testing.assert_allclose(shift_matter(shift) @ point_mass(2.0, place), point_mass(2.0, place + shift), atol=1e-12)


def test_moved_joint_and_marker_move_only_what_they_should() -> None:
    body = human(Subject(60, 1.65, "F", 30))
    neutral = body.neutral[None]
    joint = [j.name for j in body.joints].index("right_knee_flexion")
    longer = move_joint(body, joint, np.array([0, -0.02, 0]))
    lower = poses(longer, neutral).position - poses(body, neutral).position
    for segment, name in enumerate(body.segments):
        expected = [0, 0, -0.02] if name in ("right_shank", "right_foot") else [0, 0, 0]
        np.testing.assert_allclose(lower[0, segment], expected, atol=1e-12)
    other = move_marker(body, "C7", np.array([0.01, 0, 0]))
    change = other.markers.position - body.markers.position
    assert np.count_nonzero(change) == 1
    assert change[body.markers.names.index("C7"), 0] == pytest.approx(0.01)


def test_joint_at_its_limit_does_not_answer() -> None:
    """A knee that its markers push beyond straight for most of the trial stays where it is; one that is pulled off
    the limit does not.
    """
    names = [j.name for j in human_case().body.joints]
    knee = names.index("right_knee_flexion")
    answer = human_case().body_geometry().sensitivity
    straight = np.array(answer.angles)
    straight[:, knee] = human_case().body.limits.lower[knee]
    coordinate = human_case().body.n_root + knee
    push = answer.tangent[..., coordinate]
    for sign, answers in ((1.0, False), (-1.0, True)):
        at_limit = replace(answer, angles=straight, apart=0.01 * sign * push)
        assert at_limit.inverse[:, coordinate].any() == answers
