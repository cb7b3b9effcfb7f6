"""Protocol files and persons' limits: what is read, what is refused, and that a person's limits only ever take away."""

import math
from pathlib import Path

import numpy as np
import pytest

from biodance import library
from biodance.body.human.human import human
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person, joints, limit_body
from biodance.dance.problem.person_file import read_person
from biodance.dance.problem.plan import Plan, read_plan
from biodance.errors import BiodanceError, UnknownName
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "given.toml"
    path.write_text(text)
    return path


def test_every_shipped_protocol_is_read_and_fits_the_human() -> None:
    names = library.names("protocols/dances")
    assert {"full", "short", "chair", "one_segment"} <= set(names)
    for name in names:
        plan = read_plan(name)
        assert plan.name == name
        assert plan.emphasis(BODY.segments).max() > 0


def test_the_full_protocol_is_the_papers() -> None:
    plan = read_plan("full")
    assert plan.blocks == (("parallel", 15), ("right_forward", 15), ("single_right", 15), ("single_left", 15))
    assert (plan.count, plan.move, plan.hold, plan.share, plan.forward) == (60, 2.0, 5.0, 0.6, 0.2)
    assert plan.budget == math.inf
    np.testing.assert_array_equal(plan.emphasis(BODY.segments), 1.0)


def test_one_segment_counts_alone() -> None:
    weights = read_plan("one_segment").emphasis(BODY.segments)
    assert np.flatnonzero(weights).tolist() == [BODY.segment_index("left_forearm_hand")]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[postures]\nhandstand = 3", "'handstand' is not a stance"),
        ("[postures]\nparallel = 2.5", "whole number"),
        ("[postures]\nparallel = 0", "1 posture or more"),
        ("name = 'x'", "at least one"),
        ("hold = 2\n[postures]\nparallel = 3", "Did you mean 'hold_s'"),
        ("hold_s = nan\n[postures]\nparallel = 3", "finite number"),
        ("move_s = 0.1\n[postures]\nparallel = 3", "move = 0.1"),
        ("share_of_support = 1.4\n[postures]\nparallel = 3", "share = 1.4"),
        ("budget_s = -3\n[postures]\nparallel = 3", "budget = -3"),
        ("other_weight = 0\n[postures]\nparallel = 3", "at least one of them positive"),
        ("postures = 3", "must be a table"),
        ("plate_m = 0.4\n[postures]\nparallel = 3", "plate_m = 0.4; expected two lengths in m"),
        ("plate_m = [0.4, 'x']\n[postures]\nparallel = 3", "plate_m = 'x'; expected a finite number"),
        ("plate_m = [0.1, 0.6]\n[postures]\nparallel = 3", "plate = 0.1 by 0.6 m; legal are 0.2 to 3 m"),
        ("ranges = 'all'\n[postures]\nparallel = 3", "Legal: anatomical, comfortable"),
    ],
)
def test_a_wrong_protocol_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BiodanceError, match=said.replace("[", r"\[")):
        read_plan(write(tmp_path, text))


def test_a_weight_of_no_segment_is_refused() -> None:
    plan = Plan("p", "", (("parallel", 3),), weights=(("left_tail", 2.0),))
    with pytest.raises(UnknownName, match="left_tail"):
        plan.emphasis(BODY.segments)


def test_keys_name_joints_from_coarse_to_fine() -> None:
    def named(key: str) -> set[str]:
        return {BODY.joints[j].name for j in joints(BODY, key)}

    assert len(named("all")) == 23
    assert len(named("left")) == 10
    assert named("knee") == {"right_knee_flexion", "left_knee_flexion"}
    assert named("left_shoulder") == {"left_shoulder_flexion", "left_shoulder_adduction", "left_shoulder_rotation"}
    assert named("right_hip_flexion") == {"right_hip_flexion"}
    with pytest.raises(UnknownName, match="elbov"):
        joints(BODY, "elbov")


def test_a_person_only_takes_away(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        'reason = "stroke"\nmax_speed_deg_s = 90\nstand_alone_on = ["right"]\n[range_deg]\nleft_shoulder_flexion = '
        "[-10, 70]\n"
        "[range_share]\nleft = 0.5\n[strength]\nall = 0.8\nleft_knee = 0.5\n",
    )
    person = read_person(path)
    own, usual = limit_body(BODY, person), BODY.limits
    assert (own.lower >= usual.lower).all()
    assert (own.upper <= usual.upper).all()
    np.testing.assert_allclose(own.velocity, np.radians(90.0))
    left_knee, right_knee = BODY.joint_index("left_knee_flexion"), BODY.joint_index("right_knee_flexion")
    np.testing.assert_allclose(own.torque_lower[left_knee], 0.4 * usual.torque_lower[left_knee])
    np.testing.assert_allclose(own.torque_upper[right_knee], 0.8 * usual.torque_upper[right_knee])
    np.testing.assert_allclose(own.upper[left_knee], 0.5 * usual.upper[left_knee])
    shoulder = BODY.joint_index("left_shoulder_flexion")
    np.testing.assert_allclose([own.lower[shoulder], own.upper[shoulder]], np.radians([-10.0, 70.0]))
    assert own.upper[right_knee] == usual.upper[right_knee]


def test_a_healthy_person_changes_nothing() -> None:
    body, plan, notes = fit_to_person(BODY, read_plan("full"), HEALTHY)
    for name in ("lower", "upper", "velocity", "torque_lower", "torque_upper"):
        np.testing.assert_array_equal(getattr(body.limits, name), getattr(BODY.limits, name))
    assert plan.count == 60
    assert notes == ()


def test_legs_that_may_not_carry_alone_leave_the_plan() -> None:
    _, plan, notes = fit_to_person(BODY, read_plan("full"), PersonLimits(stand_alone_on=("right",)))
    assert [name for name, _ in plan.blocks] == ["parallel", "right_forward", "single_right"]
    assert "single left" in notes[0]


def test_what_cannot_be_danced_is_refused_with_the_constraint() -> None:
    only = Plan("left", "", (("single_left", 4),))
    with pytest.raises(BiodanceError, match="neither leg"):
        fit_to_person(BODY, only, PersonLimits(stand_alone_on=()))
    with pytest.raises(BiodanceError, match="must sit"):
        fit_to_person(BODY, read_plan("full"), PersonLimits(seated=True))
    with pytest.raises(BiodanceError, match="right_knee_flexion from 150 to 160 degrees"):
        limit_body(BODY, PersonLimits(ranges=(("right_knee", np.radians(150.0), np.radians(160.0)),)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("strenght = 1", "Did you mean 'strength'"),
        ("[strength]\nleft = 1.2", "between 0 and 1"),
        ("[range_deg]\nleft_knee = 30", "lower, upper"),
        ("stand_alone_on = ['middle']", "'middle' is not a leg"),
        ("max_speed_deg_s = 0", "must be positive"),
        ("seated = 1", "true or false"),
    ],
)
def test_a_wrong_person_file_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BiodanceError, match=said):
        read_person(write(tmp_path, text))
