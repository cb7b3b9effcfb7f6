"""Played in MuJoCo: the same body, standing on its own feet; a balanced motion stays up, an unbalanced one falls."""

from dataclasses import replace

import numpy as np
import pytest
from random_bodies import random_body
from small_dances import small_dance

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.dance.playback import Playback, Rehearsal, borne_by_feet, floor_model, play
from biodance.dance.problem.splines import rest_to_rest
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Subject, Wrench

pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra peers)")
BODY = human(Subject(65.0, 1.75, "F", 33.0))


def plan(body: Body, degrees: dict[str, float], duration: float = 2.0) -> Motion:
    """Return the motion from upright to a posture, root and other joints at rest, soles on z = 0 at the start."""
    first = body.neutral.copy()
    pose = poses(body, first)
    first[2] = -min(
        pose.points([foot.segment] * len(foot.outline), foot.outline)[0, :, 2].min() for foot in body.feet.values()
    )
    change = np.zeros(len(body.joints))
    for name, angle in degrees.items():
        change[body.joint_index(name)] = np.radians(angle)
    basis = rest_to_rest(duration, via=0, rate=100)
    q = np.tile(first, (basis.time.size, 1))
    q[:, 7:] += np.outer(basis.position[:, 1], change)
    v, a = np.zeros((2, basis.time.size, body.nv))
    v[:, 6:], a[:, 6:] = np.outer(basis.velocity[:, 1], change), np.outer(basis.acceleration[:, 1], change)
    return Motion(basis.time, q, v, a)


def test_the_simulator_has_the_same_mass_and_friction() -> None:
    model = floor_model(BODY, friction=0.5)
    assert model.body_mass.sum() == pytest.approx(65.0)
    assert model.geom_friction[0, 0] == 0.5


@pytest.mark.parametrize(
    "degrees",
    [{"right_shoulder_flexion": 90, "left_shoulder_adduction": -80}, {"trunk_flexion": 30, "right_elbow_flexion": 90}],
)
def test_a_balanced_motion_stays_up_and_near_its_plan(degrees: dict[str, float]) -> None:
    found: Playback = play(BODY, plan(BODY, degrees))
    assert found.stays_up
    assert np.degrees(np.abs(found.angle_error).max()) < 1.0
    assert found.root_error.max() < 0.005
    assert np.degrees(found.tilt_error.max()) < 1.0
    assert np.nanmax(found.zmp_error) < 0.01
    np.testing.assert_allclose(found.wrench.force[-1], [0, 0, 65 * 9.80665], atol=2.0)


_FOOT = np.array([[-0.07, -0.05, 0.0], [-0.07, 0.05, 0.0], [0.2, 0.05, 0.0], [0.2, -0.05, 0.0]])
_STEP = np.array([[0.2, -0.11, 0.0], [0.0, 0.11, 0.0]])
"""Where the right foot, one in front, and the left one stand, m."""


def feet_of(point: Array, down: tuple[bool, bool] = (True, True)) -> tuple[list[Wrench], Wrench]:
    """Return what the feet bear of a push of 1000 N up and 40 N ahead, with a twist, at ``point`` m on the floor."""
    force, twist = np.array([40.0, -20.0, 1000.0]), np.array([0.0, 0.0, 5.0])
    total = Wrench(np.zeros(1), np.concatenate([force, np.cross(point, force) + twist])[None])
    return borne_by_feet(total, [(_FOOT + place)[None] for place in _STEP], np.array([down])), total


@pytest.mark.parametrize("point", [(0.14, -0.08), (0.16, 0.05), (0.05, 0.11), (0.39, -0.15), (-0.06, 0.15)])
def test_no_foot_presses_outside_its_own_sole_though_the_point_lies_beside_the_line_between_them(
    point: tuple[float, float],
) -> None:
    parts, total = feet_of(np.array([*point, 0.0]))
    np.testing.assert_allclose(sum(part.value for part in parts), total.value, atol=1e-9)
    for part, place in zip(parts, _STEP, strict=True):
        if part.force[0, 2] > 1.0:
            low, high = (_FOOT + place)[[0, 2], :2]
            assert np.all(part.cop()[0, :2] >= low - 0.001), point
            assert np.all(part.cop()[0, :2] <= high + 0.001), point


def test_a_foot_alone_bears_all_and_forces_add_up_outside_the_soles() -> None:
    (right, left), total = feet_of(np.array([0.05, 0.10, 0.0]), down=(False, True))
    np.testing.assert_allclose(left.value, total.value, atol=1e-9)
    assert np.abs(right.value).max() < 1e-9
    parts, total = feet_of(np.array([0.1, -0.4, 0.0]))
    np.testing.assert_allclose(sum(part.value for part in parts), total.value, atol=1e-9)


def test_lifting_a_foot_without_shifting_the_weight_falls() -> None:
    up = plan(BODY, {"right_hip_flexion": 60, "right_knee_flexion": 90}, duration=4.0)
    still = np.zeros((199, BODY.nv))
    time = np.concatenate([up.time, up.time[-1] + 0.01 * np.arange(1, 200)])
    q = np.concatenate([up.q, np.tile(up.q[-1], (199, 1))])
    hold = Motion(time, q, np.concatenate([up.v, still]), np.concatenate([up.a, still]))
    found = play(BODY, hold)
    assert not found.stays_up
    assert found.time[-1] == found.fell < hold.time[-1]


@pytest.mark.parametrize("part", ["right_forearm_hand", "left_forearm_hand"])
def test_a_hand_that_the_plan_sends_through_the_floor_stops_there_and_counts(part: str) -> None:
    """An arm 62 cm longer than a person's hangs 4 cm above the floor; the shoulder sinks by 12 as the trunk bows."""
    hand, boxes = BODY.segment_index(part), BODY.boxes.copy()
    boxes[hand, 0, 1] -= 0.62
    shoulder = part.replace("forearm_hand", "shoulder_flexion")
    body, bow = replace(BODY, boxes=boxes), plan(BODY, {"trunk_flexion": 40, shoulder: 40})
    fingertips = np.array([0.0, float(boxes[hand, 0, 1]), 0.0])
    planned = poses(body, bow.q).points([hand], fingertips[None])[:, 0, 2]
    assert planned.min() < -0.03
    found = play(body, bow)
    assert list(found.touched) == [part]
    assert planned[round(100 * found.touched[part])] == pytest.approx(0.0, abs=0.02)
    assert poses(body, found.q).points([hand], fingertips[None])[:, 0, 2].min() > -0.01
    said = Rehearsal(small_dance(), found, np.full(found.time.size, 0.05)).broken
    assert any(part.replace("_", " ") in one and "comes to the floor" in one for one in said)


@pytest.mark.parametrize(("inside", "told"), [(0.01, 0), (-0.128, 1)])
def test_pressure_outside_the_soles_counts(inside: float, told: int) -> None:
    still = play(BODY, plan(BODY, {"left_elbow_flexion": 20}, duration=1.0))
    left = np.full(still.time.size, 0.05)
    left[3] = inside
    said = Rehearsal(small_dance(), still, left).broken
    assert len(said) == told
    assert not told or "128 mm outside the soles at 0.0 s" in said[0]


def test_a_body_without_feet_is_refused() -> None:
    body = random_body(np.random.default_rng(0), n_segments=2, root="fixed")
    with pytest.raises(BiodanceError, match="right and a left foot"):
        play(body, Motion(np.arange(2.0), *np.zeros((3, 2, len(body.joints)))))
