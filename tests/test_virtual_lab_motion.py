"""The true motion: feet stand still, the balance holds, and the wrench is the one that mechanics demands of the
motion.
"""

import numpy as np
import pytest

from biodance.body.parts import GRAVITY
from biodance.motion.dynamics import predict_wrench
from biodance.motion.ik.legs import Leg, soft_limit
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Subject
from biodance.virtual_lab.movement.choreography import septic
from biodance.virtual_lab.movement.performance import perform
from biodance.virtual_lab.movement.protocol import read_protocol
from biodance.virtual_lab.person.person import AddedLoad, make_person

CENTRE = np.array([0.3, 0.2])


@pytest.fixture(scope="module")
def person():
    load = AddedLoad("right_shank", 1.5, np.array([0.0, -0.2, 0.04]))
    return make_person(Subject(72, 1.68, "M"), 4, loads=(load,))


@pytest.fixture(scope="module")
def performances(person):
    plans = [*read_protocol("short").trials, read_protocol("dance").trials[7]]
    return [perform(person, plan, 0, centre=CENTRE, heading=0.4) for plan in plans]


def test_legs_hold_the_foot_exactly_where_it_is_wanted(person):
    rng = np.random.default_rng(2)
    body, frames = person.body, 40
    q = np.tile(body.neutral, (frames, 1))
    q[:, :3] = rng.normal(size=(frames, 3))
    for side in SIDES:
        leg = Leg.of(body, side)
        angles = np.radians(rng.uniform([-20, -30, -30, 15, -30, -15], [90, 20, 30, 110, 25, 15], (frames, 6)))
        q[:, [7 + c for c in leg.columns]] = angles
        pose, foot = poses(body, q), body.segment_index(f"{side}_foot")
        solved = leg.solve(pose.root_rotation, pose.root_position, pose.rotation[:, foot], pose.position[:, foot])
        np.testing.assert_allclose(solved, angles, atol=1e-9)


def test_a_foot_out_of_reach_is_drawn_in_smoothly():
    value = np.linspace(0.0, 2.0, 4001)
    limited = soft_limit(value, 1.0, 0.1)
    np.testing.assert_array_equal(limited[value <= 0.9], value[value <= 0.9])
    assert limited.max() < 1.0
    assert np.all(np.diff(limited) >= 0)
    assert np.abs(np.diff(limited, 2)).max() < 50 * 0.0005**2


def test_planted_feet_do_not_move_and_no_foot_enters_the_floor(performances):
    for act in performances:
        time = np.arange(0.0, act.plan.duration, 0.0137)
        pose = poses(act.person.body, act.motion(time).q)
        for side in SIDES:
            foot = act.person.body.feet[side]
            planted = np.interp(time, act.node_time, act.curves.raised(side)) == 0
            away = np.linalg.norm(pose.position[:, foot.segment] - act.stance.ankle[side], axis=1)
            assert away[planted].max() < 2e-5
            turned = pose.rotation[:, foot.segment] - act.stance.foot_turn[side]
            assert np.abs(turned[planted]).max() < 1e-4
            outline = pose.points([foot.segment] * len(foot.outline), np.array(foot.outline))
            assert outline[..., 2].min() > -0.003


def _inside(points, polygon):
    """Signed distance (T,) by which points (T, 2) lie inside a convex counter-clockwise polygon (P, 2)."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    normal = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1, keepdims=True)
    return np.min(np.einsum("pk,tpk->tp", normal, points[:, None] - polygon), axis=1)


def test_the_centre_of_pressure_stays_under_the_feet_that_stand(performances):
    from scipy.spatial import ConvexHull

    for act in performances:
        time = np.arange(0.0, act.plan.duration, 0.02)
        cop = act.wrench(time).cop()[:, :2]
        body = act.person.body
        sole = {
            s: (act.stance.foot_turn[s] @ np.array(body.feet[s].outline).T).T[:, :2] + act.stance.ankle[s][:2]
            for s in SIDES
        }
        up = {s: np.interp(time, act.node_time, act.curves.raised(s)) > 0 for s in SIDES}
        for frames, sides in ((~up["right"] & ~up["left"], SIDES), (up["right"], ("left",)), (up["left"], ("right",))):
            corners = np.concatenate([sole[s] for s in sides])
            hull = corners[ConvexHull(corners).vertices]
            if frames.any():
                assert _inside(cop[frames], hull).min() > 0.005
        assert act.balance_error < 0.005


def test_joint_limits_hold_and_knees_never_overextend(performances):
    for act in performances:
        q = act.motion(np.arange(0.0, act.plan.duration, 0.01)).q[:, 7:]
        limits = act.person.body.limits
        assert np.all(q > limits.lower - 1e-6)
        assert np.all(q < limits.upper + 1e-6)
        for side in SIDES:
            assert np.degrees(q[:, act.person.body.joint_index(f"{side}_knee_flexion")]).min() > 2


def test_velocity_and_acceleration_are_derivatives_of_the_motion(performances):
    import pinocchio as pin

    act, step = performances[1], 1e-4
    model = act.person.body.model
    for t in (2.1, 5.03, 9.7):
        before, now, after = (act.motion(np.array([t + k * step])) for k in (-1, 0, 1))
        slope = pin.difference(model, before.q[0], after.q[0]) / (2 * step)
        np.testing.assert_allclose(slope, now.v[0], atol=2e-5)
        np.testing.assert_allclose((after.v[0] - before.v[0]) / (2 * step), now.a[0], atol=2e-4)


def test_the_wrench_is_the_rate_of_momentum(performances):
    import pinocchio as pin

    for act, t in ((performances[1], 3.34), (performances[1], 12.5), (performances[2], 2.9)):
        model, step = act.person.loaded_body.model, 1e-4
        data = model.createData()
        rate = []
        for k in (-1, 1):
            motion = act.motion(np.array([t + k * step]))
            pin.computeCentroidalMomentum(model, data, motion.q[0], motion.v[0])
            rate.append(np.concatenate([data.hg.linear, data.hg.angular + np.cross(data.com[0], data.hg.linear)]))
        motion = act.motion(np.array([t]))
        com = pin.centerOfMass(model, data, motion.q[0]).copy()
        weight = act.person.mass * np.array(GRAVITY)
        wanted = (rate[1] - rate[0]) / (2 * step) - np.concatenate([weight, np.cross(com, weight)])
        np.testing.assert_allclose(act.wrench(np.array([t])).value[0], wanted, atol=0.05)


def test_the_true_wrench_equals_the_regressor_of_the_true_body(performances):
    act = performances[2]
    time = np.arange(1.0, 3.0, 0.05)
    np.testing.assert_allclose(
        predict_wrench(act.person.loaded_body, act.motion(time)).value, act.wrench(time).value, atol=0.05
    )


def test_standing_still_weighs_the_person_and_the_load(performances):
    static = performances[0]
    force = static.wrench(np.arange(0.0, 3.0, 0.01)).force
    assert force[:, 2].mean() / 9.80665 == pytest.approx(73.5, rel=2e-4)
    assert np.abs(force[:, :2]).max() < 5


def test_a_second_day_is_danced_differently_by_the_same_body(person):
    plan = read_protocol("short").trials[2]
    one, same, other = (perform(person, plan, day, centre=CENTRE) for day in (0, 0, 1))
    np.testing.assert_array_equal(one.nodes, same.nodes)
    assert np.abs(one.nodes - other.nodes).max() > 0.02


def test_fast_squats_are_fast_but_stay_on_the_ground():
    person = make_person(Subject(65, 1.75, "F"), 1)
    squat = next(t for t in read_protocol("dance").trials if t.name == "squat_1")
    act = perform(person, squat, 0, centre=CENTRE)
    time = np.arange(0.0, squat.duration, 0.01)
    vertical = act.wrench(time).force[:, 2] / (65 * 9.80665)
    assert 0.15 < vertical.min() < 0.6
    assert 1.5 < vertical.max() < 2.6
    height = act.motion(time).q[:, 2]
    low = (height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]) & (height[1:-1] < height[0] - 0.05)
    assert low.sum() == 10


def test_rest_to_rest_curve_has_still_ends():
    assert septic(np.array([-1.0, 0.0, 0.5, 1.0, 3.0])) == pytest.approx([0, 0, 0.5, 1, 1])
    assert septic(np.array([0.01, 0.99])) == pytest.approx([0, 1], abs=4e-7)
