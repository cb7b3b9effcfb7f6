"""A whole small dance: continuous, allowed by independent code, the same when interrupted; what breaks a limit is
seen.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from small_dances import SHORT_SEARCH

from biodance.body.human.human import human
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.limits.balance import Balance
from biodance.dance.playback import bearing, rehearse
from biodance.dance.problem.plan import Plan
from biodance.dance.search import postures
from biodance.dance.search.course import Course
from biodance.dance.search.postures import alike
from biodance.dance.verify import broken, verify, verify_with
from biodance.errors import BiodanceError, FileRefused
from biodance.motion.kinematics import poses
from biodance.records import Subject
from biodance.spatial import quaternion_matrix

BODY = human(Subject(65.0, 1.75, "F", 33.0))
PLAN = Plan("small", (("parallel", 2), ("single_left", 2)), hold=1.0)


@pytest.fixture(scope="module", autouse=True)
def quick():
    with pytest.MonkeyPatch.context() as patch:
        for name, sweeps in SHORT_SEARCH.items():
            patch.setattr(postures, name, sweeps)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("resume")


@pytest.fixture(scope="module")
def dance(quick, folder):
    with ThreadPoolExecutor(1) as workers:
        return design(BODY, PLAN, seed=1, resume=folder, workers=workers)[0]


def test_the_dance_has_its_postures_its_feet_and_its_time(dance):
    assert [s.name for s in np.array(dance.stances)[dance.counted]] == ["parallel"] * 2 + ["single_left"] * 2
    assert dance.duration == dance.phases[-1].end
    assert dance.motion(50).time[-1] == pytest.approx(dance.duration, abs=0.02)
    for a, b in zip(dance.phases[:-1], dance.phases[1:], strict=True):
        assert a.end == b.start


def test_every_limit_holds(dance):
    margins = verify(BODY, dance, PLAN.limits)
    told = (
        "balance continuity floor foot_placement friction ground_clearance joint_range joint_speed joint_torque "
        "self_collision"
    )
    assert [m.limit for m in margins] == told.split()
    assert broken(margins) == ()


def test_two_workers_find_the_same_margins(dance):
    with ThreadPoolExecutor(2) as workers:
        assert verify_with(workers, BODY, dance, PLAN.limits) == verify(BODY, dance, PLAN.limits)


def test_a_margin_that_is_no_number_is_never_lost(dance, monkeypatch):
    judge, start = Balance.check, dance.phases[3].start

    def spoiled(self, motion):
        left = judge(self, motion)
        return replace(left, value=left.value * np.nan) if motion.motion.time[0] == start else left

    monkeypatch.setattr(Balance, "check", spoiled)
    assert {margin.limit for margin in broken(verify(BODY, dance, PLAN.limits))} == {"balance"}


def test_no_posture_comes_twice(dance):
    for name in ("parallel", "single_left"):
        same = [
            x
            for x, stance in zip(dance.postures, dance.stances, strict=True)
            if stance.name == name and stance.over is None
        ]
        assert not np.triu(alike(np.array(same)), 1).any()


def test_velocities_and_accelerations_are_the_derivatives_of_the_motion(dance):
    motion, step = dance.motion(1000), 0.001
    for high, low in ((motion.q[:, 7:], motion.v[:, 6:]), (motion.v[:, 6:], motion.a[:, 6:])):
        rate = (high[2:] - high[:-2]) / (2 * step)
        assert np.abs(rate - low[1:-1]).max() < 2e-3 * max(1.0, np.abs(low).max())
    turn = quaternion_matrix(motion.q[:, 3:7])
    linear = np.einsum("tij,tj->ti", turn, motion.v[:, :3])
    assert np.abs((motion.q[2:, :3] - motion.q[:-2, :3]) / (2 * step) - linear[1:-1]).max() < 1e-4


def test_planted_feet_stand_still(dance):
    motion = dance.motion(100)
    foot = BODY.segment_index("left_foot")
    place = poses(BODY, motion.q).position[:, foot]
    assert np.ptp(place, axis=0).max() < 1e-9  # the left foot bears the weight or stands beside the other all the time


def test_it_goes_on_where_it_was_interrupted(dance, folder):
    kept = next(folder.iterdir())
    for file in sorted(kept.glob("move_*.npz"))[1:]:
        file.unlink()
    told = []
    with ThreadPoolExecutor(2) as workers:
        again, _ = design(BODY, PLAN, seed=1, resume=folder, workers=workers, tell=lambda *what: told.append(what))
    np.testing.assert_array_equal(again.via, dance.via)
    np.testing.assert_array_equal(again.postures, dance.postures)
    assert [what for what in told if what[0] == "moves"][-1] == ("moves", len(dance.move), len(dance.move))


def test_a_dance_reads_back_exactly(dance, tmp_path):
    replace(dance, notes=("one thing", "another")).save(tmp_path / "dance.npz")
    back = Dance.load(tmp_path / "dance.npz")
    assert back.notes == ("one thing", "another")
    one, other = dance.motion(100), back.motion(100)
    for name in ("time", "q", "v", "a"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert back.stances[-1].over == dance.stances[-1].over
    (tmp_path / "no.npz").write_bytes(b"no dance")
    with pytest.raises(FileRefused, match="not a dance"):
        Dance.load(tmp_path / "no.npz")


def shifted(dance, name, column, by):
    changed = np.array(getattr(dance, name))
    changed[..., column] += by
    return replace(dance, **{name: changed})


def moved(stance):
    return replace(stance, ankle=stance.ankle + np.array([0.01, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("limit", "change"),
    [
        ("joint_range", lambda d: shifted(d, "via", 6 + BODY.joint_index("right_elbow_flexion"), -2.5)),
        ("joint_speed", lambda d: replace(d, move=0.2 * d.move)),
        ("joint_torque", lambda d: replace(d, move=0.2 * d.move)),
        ("friction", lambda d: replace(d, move=0.1 * d.move)),
        ("balance", lambda d: shifted(d, "postures", 0, 0.1)),
        ("foot_placement", lambda d: shifted(d, "postures", 2, 0.2)),
        ("ground_clearance", lambda d: shifted(d, "via", 6 + BODY.joint_index("right_ankle_dorsiflexion"), -2.0)),
        ("floor", lambda d: shifted(d, "via", 5, -1.5)),
        ("self_collision", lambda d: shifted(d, "via", 6 + BODY.joint_index("right_shoulder_adduction"), 2.0)),
        ("continuity", lambda d: replace(d, stances=(d.stances[0], moved(d.stances[1]), *d.stances[2:]))),
    ],
)
def test_what_breaks_a_limit_is_seen(dance, limit, change):
    assert limit in {m.limit for m in broken(verify(BODY, change(dance), PLAN.limits))}


def test_a_dance_that_fails_the_check_is_not_returned(dance, folder, monkeypatch):
    wrong = shifted(dance, "postures", 0, 0.1)
    monkeypatch.setattr(Course, "dance", lambda *_: wrong)
    with ThreadPoolExecutor(1) as workers, pytest.raises(BiodanceError, match=r"balance by .* m at "):
        design(BODY, PLAN, seed=1, resume=folder, workers=workers)


def test_played_on_its_own_feet_it_stays_up_near_the_plan(dance):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra peers)")
    found = rehearse(dance, hold=0.2)
    assert found.playback.stays_up
    assert found.playback.time[-1] == pytest.approx(found.dance.duration, abs=0.01)
    assert np.degrees(np.abs(found.playback.angle_error).max()) < 5.0
    assert np.nanquantile(found.inside, 0.01) > 0
    assert "stays up" in found.table()


def test_feet_are_planned_down_where_the_phases_say_so(dance):
    down = bearing(dance, dance.motion(20).time)
    assert down[:, 1].all()
    assert not down[:, 0].all()
    assert down[-1].all()
