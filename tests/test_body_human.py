"""The 12-segment, 23-joint human: names, axes, ranges, posture and size."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
JOINTS = (
    *(f"{side}_{joint}" for side in ("right", "left") for joint in (
        "hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion", "ankle_inversion")),
    "trunk_flexion", "trunk_bending", "trunk_rotation",
    *(f"{side}_{joint}" for side in ("right", "left") for joint in (
        "shoulder_flexion", "shoulder_adduction", "shoulder_rotation", "elbow_flexion")),
)  # fmt: skip


def moved(joint: str, angle: float, segment: str, point: tuple[float, float, float]) -> np.ndarray:
    """Return how a point of a segment moves (lab axes) when one joint turns from the neutral posture."""
    q = np.stack([BODY.neutral, BODY.neutral])
    q[1, 7 + BODY.joint_index(joint)] = angle
    place = poses(BODY, q).points([BODY.segment_index(segment)], np.array([point]))[:, 0]
    return place[1] - place[0]


def test_joints_have_the_names_and_order_of_the_house() -> None:
    assert tuple(joint.name for joint in BODY.joints) == JOINTS
    assert (BODY.nq, BODY.nv) == (30, 29)


# facing lab x, z up, left = +y: where does the far end go for a positive angle?
ANATOMY = [
    ("right_hip_flexion", "right_foot", (0, 0, 0), [1, 0, 0]),
    ("left_hip_flexion", "left_foot", (0, 0, 0), [1, 0, 0]),
    ("right_hip_adduction", "right_foot", (0, 0, 0), [0, 1, 0]),
    ("left_hip_adduction", "left_foot", (0, 0, 0), [0, -1, 0]),
    ("right_hip_rotation", "right_foot", (0.2, 0, 0), [0, 1, 0]),
    ("left_hip_rotation", "left_foot", (0.2, 0, 0), [0, -1, 0]),
    ("right_knee_flexion", "right_foot", (0, 0, 0), [-1, 0, 0]),
    ("left_knee_flexion", "left_foot", (0, 0, 0), [-1, 0, 0]),
    ("right_ankle_dorsiflexion", "right_foot", (0.2, 0, 0), [0, 0, 1]),
    ("left_ankle_inversion", "left_foot", (0, -0.1, 0), [0, -1, 0]),
    ("right_ankle_inversion", "right_foot", (0, -0.1, 0), [0, 1, 0]),
    ("trunk_flexion", "trunk_head", (0, 0.5, 0), [1, 0, 0]),
    ("trunk_bending", "trunk_head", (0, 0.5, 0), [0, -1, 0]),
    ("trunk_rotation", "trunk_head", (0.2, 0.5, 0), [0, 1, 0]),
    ("right_shoulder_flexion", "right_forearm_hand", (0, 0, 0), [1, 0, 0]),
    ("left_shoulder_adduction", "left_forearm_hand", (0, 0, 0), [0, -1, 0]),
    ("right_shoulder_adduction", "right_forearm_hand", (0, 0, 0), [0, 1, 0]),
    ("left_elbow_flexion", "left_forearm_hand", (0, -0.25, 0), [1, 0, 0]),
]


@pytest.mark.parametrize(("joint", "segment", "point", "direction"), ANATOMY)
def test_positive_is_the_anatomical_direction(
    joint: str, segment: str, point: tuple[float, float, float], direction: list[int]
) -> None:
    step = moved(joint, 0.1, segment, point)
    assert step @ np.array(direction) > 0.8 * np.linalg.norm(step)


def test_a_person_stands_as_tall_as_declared() -> None:
    pose = poses(BODY, BODY.neutral[None])
    soles = [pose.points([foot.segment], foot.outline[:1])[0, 0, 2] for foot in BODY.feet.values()]
    trunk = BODY.segment_index("trunk_head")
    top = pose.points([trunk], np.array([[0, BODY.boxes[trunk, 1, 1], 0]]))[0, 0, 2]
    assert soles[0] == pytest.approx(soles[1], abs=1e-9)
    assert top - soles[0] == pytest.approx(1.75, abs=0.06)


def test_strength_follows_sex_and_age() -> None:
    woman, man, old = (human(Subject(70.0, 1.72, sex, age)) for sex, age in (("F", 25.0), ("M", 25.0), ("M", 75.0)))
    knee = BODY.joint_index("right_knee_flexion")
    assert man.limits.torque_upper[knee] > woman.limits.torque_upper[knee]
    assert man.limits.torque_upper[knee] > old.limits.torque_upper[knee]
    assert np.all(BODY.limits.torque_lower < 0)
    assert np.all(BODY.limits.velocity > 0)


def test_feet_lie_on_the_floor_and_have_the_usual_size() -> None:
    for side, foot in BODY.feet.items():
        assert BODY.segments[foot.segment] == f"{side}_foot"
        length, width = np.ptp(foot.outline[:, 0]), np.ptp(foot.outline[:, 2])
        assert 0.22 < length < 0.28
        assert 0.06 < width < 0.11
        assert np.ptp(foot.outline[:, 1]) == pytest.approx(0.0, abs=1e-9)


def test_an_impossible_subject_is_refused() -> None:
    with pytest.raises(BiodanceError):
        human(Subject(65.0, float("nan"), "F", 33.0))
    with pytest.raises(BiodanceError):
        human(Subject(float("nan"), 1.7, "F", 33.0))


@pytest.mark.parametrize(
    ("subject", "child"),
    [
        (Subject(45.0, 1.48, "F"), True),
        (Subject(60.0, 1.70, "M", 14.0), True),
        (Subject(45.0, 1.48, "F", 40.0), False),
        (Subject(62.0, 1.60, "F"), False),
    ],
)
def test_the_tables_of_adults_are_believed_half_as_much_for_a_child(subject: Subject, child: bool) -> None:
    wide, adult = (human(person).sip for person in (subject, replace(subject, age=30.0)))
    np.testing.assert_allclose(wide.mass, adult.mass)
    ratio = np.sqrt(wide.covariance[10, 10] / adult.covariance[10, 10])
    assert 1.8 < ratio < 2.4 if child else ratio == pytest.approx(1.0)
    assert any("A child" in note for note in human(subject).notes) == child
