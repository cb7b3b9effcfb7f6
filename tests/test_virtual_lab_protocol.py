"""Protocol files: the shipped ones are sound, a wrong one is refused with a sentence that says what to write
instead.
"""

import numpy as np
import pytest

from biodance.body.parts import GRAVITY
from biodance.errors import BiodanceError, UnknownName
from biodance.library import names
from biodance.motion.dynamics import predict_wrench
from biodance.motion.ik.compiled.legs import Leg, soft_limit
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Subject
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.movement.performance import perform
from biodance.virtual_lab.movement.posing import septic
from biodance.virtual_lab.person import AddedLoad, make_person

HEAD = """
name = "mine"
[postures.up]
left_leg = [60, 0, 0, 80, 0]
[postures.other]
right_leg = [60, 0, 0, 80, 0]
[postures.arms]
right_arm = [90, 0, 0, 0]
"""


@pytest.mark.parametrize("name", names("protocols"))
def test_shipped_protocols_have_a_static_trial_and_something_to_validate(name):
    protocol = read_protocol(name)
    assert protocol.name == name
    assert [t.role for t in protocol.trials].count("static") == 1
    assert {"fit", "validate"} <= {t.role for t in protocol.trials}
    assert all(2 <= t.duration <= 30 for t in protocol.trials)


def test_the_dance_uses_the_four_foot_configurations_and_keeps_squats_for_validation():
    protocol = read_protocol("dance")
    fit = [t for t in protocol.trials if t.role == "fit"]
    assert 120 <= sum(t.duration for t in fit) <= 180
    assert {t.stance for t in fit} == {"parallel", "right_forward"}
    raised = {frozenset(side for step in t.steps for side in step.to.raised) for t in fit}
    assert raised == {frozenset(), frozenset({"right"}), frozenset({"left"})}
    squats = [t for t in protocol.trials if t.role == "validate"]
    assert [t.steps[0].cycles for t in squats] == [10, 10]


def test_a_trial_returns_to_standing(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + '[[trials]]\nname = "a"\nsteps = [{to = "arms", move = 1.0, hold = 0.5}]\n')
    trial = read_protocol(path).trials[0]
    assert trial.steps[-1].to.name == "stand"
    assert trial.duration == pytest.approx(2 * 1.0 + 1.5 + trial.steps[-1].duration)


def test_the_weight_goes_to_the_foot_that_stands(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + '[[trials]]\nname = "a"\nsteps = [{to = "up", move = 1.0}]\n')
    posture = read_protocol(path).trials[0].steps[0].to
    assert posture.raised == {"left"}
    assert posture.values["shift"] == (1.0,)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "mine"\n', r"no \[\[trials\]\]"),
        (HEAD + "[[trials]]\nrole = 'fit'\n", "trial number 1 needs a name"),
        (HEAD + "[[trials]]\nname = 'a'\nrole = 'fitt'\n", "Did you mean 'fit'"),
        (HEAD + "[[trials]]\nname = 'a'\nstance = 'tandem'\n", "parallel, right_forward"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arm'}]\n", "Did you mean 'arms'"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', speed = 3}]\n", "'speed'"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', move = 0.1}]\n", "at least 0.25 s"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', move = 'slow'}]\n", "expected 1 finite number"),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'arms', cycles = -1}]\n", "whole number"),
        (
            HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'up'}, {to = 'other'}]\n",
            "without putting the other one down",
        ),
        (HEAD + "[[trials]]\nname = 'a'\nsteps = [{to = 'up', cycles = 3}]\n", "within a cycle"),
        (HEAD + "[[trials]]\nname = 'a'\nlead = 0.0\n", "lasts no time"),
        (HEAD + "[[trials]]\nname = 'a'\n[[trials]]\nname = 'a'\n", "occur twice"),
        (
            HEAD
            + "[postures.fly]\nleft_leg = [0, 0, 0, 90, 0]\nright_leg = [0, 0, 0, 90, 0]\n[[trials]]\nname = 'a'\n",
            "both feet",
        ),
        (HEAD + "[postures.b]\ndepth = 0.9\n[[trials]]\nname = 'a'\n", "depth in 0..0.6"),
        (HEAD + "[postures.b]\ntrunk = [1, 2]\n[[trials]]\nname = 'a'\n", "expected 3 finite numbers"),
        (HEAD + "[postures.b]\ntrunck = [1, 2, 3]\n[[trials]]\nname = 'a'\n", "Did you mean 'trunk'"),
        (HEAD + "[postures.b]\nbased_on = 'c'\n[[trials]]\nname = 'a'\n", "written before"),
    ],
)
def test_a_wrong_file_is_refused_with_the_remedy(tmp_path, text, said):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(BiodanceError, match=said):
        read_protocol(path)


def test_an_unknown_protocol_lists_the_known_ones():
    with pytest.raises(UnknownName, match="dance"):
        read_protocol("danse")


# ---- The true motion

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
