"""A virtual person copies a dance: exactly when told to, degrees off and slower when not, always on feet that stay
where they are.
"""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from biodance.body.human.human import human
from biodance.body.human.skeleton import joint_limits
from biodance.dance.dance import Dance
from biodance.dance.limits import family
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import feet_in_move, seat
from biodance.dance.search.postures import KEPT, distance_from, initial_guess, solve
from biodance.errors import BiodanceError
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.pipeline.front_dance import simulate_dance, stretches
from biodance.records import SIDES, Subject
from biodance.virtual_lab.movement.performance import _JOINTS, PERFORMERS, Performer, copy_dance, true_wrench
from biodance.virtual_lab.person import make_person
from biodance.virtual_lab.person.skeleton import PERFECT

SUBJECT = Subject(65.0, 1.75, "F", 33.0)
BODY = replace(human(SUBJECT), limits=joint_limits(SUBJECT, within="comfortable"))
EXACT = Performer(tracking=0.0, pace=1.0)


@pytest.fixture(scope="module")
def dance() -> Dance:
    """Return two postures on both feet, one on the right leg, those in between included, straight ways between them."""
    chain, rng = Chain(BODY), np.random.default_rng(2)
    stances = support_sequence(BODY, Plan("test", (("parallel", 2), ("single_right", 1)), hold=1.0))
    rows = []
    for stance in stances:
        for _ in range(40):
            begin = initial_guess(chain, stance, rng)
            begin[3:] *= 0.3
            found = solve(chain, stance, begin, distance_from(begin), family(), iterations=40)
            if found.violation <= KEPT:
                break
        rows.append(found.x)
    x, feet = np.array(rows), tuple(feet_in_move(a, b) for a, b in pairwise(stances))
    via = x[:-1, None] + np.array([[0.21], [0.79]]) * np.diff(x, axis=0)[:, None]
    return Dance("test", BODY, x, stances, np.full(len(x), 1.0), via, np.full(len(x) - 1, 2.0), feet, 0)


def copied(dance: Dance, performer: Performer = EXACT):
    person = make_person(SUBJECT, 3, tolerances=PERFECT)
    (shown,) = stretches(dance)
    return person, shown, copy_dance(person, shown, 0, centre=np.zeros(2), performer=performer, tolerances=PERFECT)


def test_an_exact_copy_has_the_angles_of_the_plan_and_keeps_its_balance(dance: Dance) -> None:
    person, shown, done = copied(dance)
    motion = done.motion(shown.motion.time)
    for name in (*_JOINTS["right_arm"], *_JOINTS["left_arm"]):
        planned = shown.motion.q[:, 7 + shown.body.joint_index(name)]
        np.testing.assert_allclose(motion.q[:, 7 + person.body.joint_index(name)], planned, atol=0.03)
    assert done.balance_error < 0.005
    force = true_wrench(person, motion).force[:, 2]
    assert (force / (9.80665 * person.mass)).min() > 0.5
    assert (force / (9.80665 * person.mass)).max() < 1.5


def test_planted_feet_stay_and_a_free_foot_does_not(dance: Dance) -> None:
    person, _, done = copied(dance, Performer())
    time = np.arange(0.0, done.plan.duration, 0.02)
    pose = poses(person.body, done.motion(time).q)
    right, left = (pose.position[:, person.body.segment_index(f"{side}_foot")] for side in ("right", "left"))
    assert np.ptp(right, axis=0).max() < 2e-3
    up = done.curves.raised("left")[np.searchsorted(done.curves.time, time)]
    assert np.ptp(left[up == 0], axis=0).max() < 2e-3
    assert np.linalg.norm(np.ptp(left[up > 0.5], axis=0)) > 0.05


def test_the_usual_performer_is_five_to_ten_degrees_off_and_slower(dance: Dance) -> None:
    person, shown, done = copied(dance, Performer())
    assert done.plan.duration == pytest.approx(1.2 * (shown.motion.time[-1] - shown.motion.time[0]), abs=0.06)
    motion = done.motion(1.2 * shown.motion.time)
    arms = [name for field in ("right_arm", "left_arm") for name in _JOINTS[field]]
    planned = shown.motion.q[:, [7 + shown.body.joint_index(name) for name in arms]]
    off = motion.q[:, [7 + person.body.joint_index(name) for name in arms]] - planned
    assert 4.0 < np.degrees(np.sqrt(np.mean(np.square(off)))) < 10.0


def test_the_restless_one_keeps_the_zero_moment_point_in_the_support_and_the_tempo_wanders(dance: Dance) -> None:
    person = make_person(SUBJECT, 3)
    (shown,) = stretches(dance)
    restless = PERFORMERS["restless"]
    done = copy_dance(person, shown, 0, centre=np.zeros(2), performer=restless)
    time = np.arange(0.0, done.plan.duration, 0.05)
    motion = done.motion(time)
    point = true_wrench(person, motion).cop()[:, :2]
    pose, up = poses(person.body, motion.q), np.stack([done.curves.raised(side) for side in SIDES], axis=1)
    up = up[np.searchsorted(done.curves.time, time)]
    for k in range(time.size):
        corners = [
            pose.position[k, person.body.segment_index(f"{side}_foot"), :2]
            + BODY.feet[side].outline[:, [0, 2]] * [1, -1]
            for side, raised in zip(SIDES, up[k], strict=True)
            if raised < 0.02
        ]
        hull = ConvexHull(np.concatenate(corners))
        assert (hull.equations[:, :2] @ point[k] + hull.equations[:, 2]).max() < 0.0
    seconds, at, plan = restless.clock(np.random.default_rng(0), 60.0)
    tempo = np.gradient(plan, at) * restless.pace
    assert seconds == 72.0
    assert (plan[0], plan[-1]) == (0.0, 60.0)
    assert 0.1 < tempo.std() < 0.3


def test_a_danced_session_is_read_like_any_other(dance: Dance, tmp_path: Path) -> None:
    folder = simulate_dance(SUBJECT, dance, tmp_path / "session", seed=3)
    session = read_session(folder)
    assert sorted(trial.name for trial in session.trials) == ["dance_1", "squat_1", "squat_2", "static"]
    assert len(session.of_role("fit")) == 1
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    assert truth["protocol"] == "test"
    assert max(trial["balance_error_m"] for trial in truth["trials"]) < 0.01
    with pytest.raises(BiodanceError, match="not an empty folder"):
        simulate_dance(SUBJECT, dance, folder, seed=3)


def test_what_cannot_be_copied_is_refused(dance: Dance) -> None:
    with pytest.raises(BiodanceError, match=r"0 to 0\.6 rad"):
        Performer(tracking=1.0)
    with pytest.raises(BiodanceError, match=r"timing = 0\.9"):
        Performer(timing=0.9)


@pytest.fixture(scope="module")
def seated() -> Dance:
    """Return three postures on a stool: at rest, an arm and a shank lifted, both thighs off the seat."""
    stool, x = seat(BODY), np.zeros((3, Chain(BODY).size))
    place = {joint.name: 6 + j for j, joint in enumerate(BODY.joints)}
    x[:, 2] = stool.seat
    for side in SIDES:
        x[:, place[f"{side}_hip_flexion"]] = np.radians([92.0, 92.0, 105.0])
        x[:, place[f"{side}_knee_flexion"]] = np.radians(80.0)
        x[:, place[f"{side}_shoulder_adduction"]] = np.radians([-20.0, -20.0, -60.0])
    x[1, [place["right_shoulder_flexion"], place["left_knee_flexion"]]] = np.radians([70.0, 20.0])
    via = x[:-1, None] + np.array([[0.21], [0.79]]) * np.diff(x, axis=0)[:, None]
    hold, move, feet = np.full(3, 1.0), np.full(2, 2.0), (stool,) * 3
    return Dance("test", BODY, x, feet, hold, via, move, feet[:2], 0)


def test_who_sits_stays_on_the_seat_and_moves_as_planned(seated: Dance) -> None:
    person, shown, done = copied(seated)
    motion, seat_height = done.motion(shown.motion.time), seated.stances[0].seat
    for name in (*_JOINTS["right_arm"], *_JOINTS["left_leg"]):
        planned = shown.motion.q[:, 7 + shown.body.joint_index(name)]
        np.testing.assert_allclose(motion.q[:, 7 + person.body.joint_index(name)], planned, atol=0.03)
    hips = poses(person.body, motion.q).position[:, [person.body.segment_index(f"{side}_thigh") for side in SIDES]]
    assert np.ptp(hips, axis=0).max() < 1e-9
    np.testing.assert_allclose(hips[..., 2], seat_height, atol=1e-9)


def test_who_sits_restlessly_rocks_within_the_stool_and_sinks_no_thigh_into_it(seated: Dance) -> None:
    person, (shown,) = make_person(SUBJECT, 3), stretches(seated)
    done = copy_dance(person, shown, 0, centre=np.array([1.0, 0.0]), performer=PERFORMERS["restless"])
    motion = done.motion(np.arange(0.0, done.plan.duration, 0.05))
    pose = poses(person.body, motion.q)
    hips, knees = (
        pose.position[:, [person.body.segment_index(f"{side}_{part}") for side in SIDES]] for part in ("thigh", "shank")
    )
    assert 0.001 < np.ptp(hips.mean(axis=1), axis=0).max() < 0.03
    assert (hips[..., 2] - knees[..., 2]).max() < 0.04
    wrench = done.wrench(motion.time)
    pressure = wrench.cop()[:, :2] - [1.0, 0.0]
    assert np.abs(pressure).max() < 0.2
    assert wrench.force[:, 2].mean() == pytest.approx(9.80665 * person.mass, rel=0.01)
    parts = [done.foot_wrench(motion.time, side) for side in SIDES]
    np.testing.assert_allclose(sum(parts), wrench.value, atol=1e-6)


def test_a_session_on_the_stool_has_a_seated_static_trial_and_a_second_round(seated: Dance, tmp_path: Path) -> None:
    folder = simulate_dance(SUBJECT, seated, tmp_path / "session", seed=3)
    session = read_session(folder)
    assert {trial.name: trial.role for trial in session.trials} == {
        "static": "static",
        "dance_1": "fit",
        "again_dance_1": "validate",
    }
    assert not any("from the feet that the markers show" in text for trial in session.trials for text in trial.warnings)
    height = {name: session["static"].markers.xyz[:, k, 2] for k, name in enumerate(session["static"].markers.names)}
    assert np.ptp(height["RASI"]) < 0.01
    assert abs(np.mean(height["RKNE"]) - seated.stances[0].seat) < 0.06  # markers were glued on the bent knee
