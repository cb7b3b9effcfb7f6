"""Protocol files and persons' limits: what is read, what is refused, and that a person's limits only ever take away."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_dances import small_dance
from walkers import Stand, plate, walker

from biodance import library
from biodance.body.human.human import human
from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person, joints, limit_body, read_person
from biodance.dance.problem.plan import Plan, read_plan
from biodance.errors import BiodanceError, UnknownName
from biodance.pipeline.dance import plate_sentence, plates_too_small
from biodance.records import Session, Subject
from biodance.report.pages.feedback import scene_of

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
    plan = Plan("p", (("parallel", 3),), weights=(("left_tail", 2.0),))
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
    only = Plan("left", (("single_left", 4),))
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


# ---- The feet of a dance and the force plate

TALL = human(Subject(110.0, 1.80, "M", 40.0))


def occupied(plan: Plan) -> np.ndarray:
    """Return the sides (2,) m, side to side and ahead, of the box around all soles that stand."""
    soles = [stance.soles[side] for stance in support_sequence(TALL, plan) for side in stance.planted]
    return np.ptp(np.concatenate(soles)[:, :2], axis=0)[::-1]


def test_every_dance_of_people_is_made_for_the_usual_plate_unless_it_says_otherwise(tmp_path: Path) -> None:
    assert read_plan("short").plate == read_plan("full").plate == (0.40, 0.60)
    own = tmp_path / "own.toml"
    own.write_text('name = "own"\nplate_m = [0.464, 0.508]\n[postures]\nparallel = 3\n')
    assert read_plan(own).plate == (0.464, 0.508)


def test_a_tall_mans_feet_fit_on_the_usual_plate_and_did_not_without_it() -> None:
    plan = read_plan("short")
    side, ahead = occupied(plan)
    assert side == pytest.approx(0.40 - 2 * 0.025)
    assert ahead < 0.60 - 2 * 0.025
    assert occupied(replace(plan, plate=None))[0] > 0.40


def test_a_plate_that_is_large_enough_moves_no_foot() -> None:
    plan = read_plan("short")
    free, large = (support_sequence(TALL, replace(plan, plate=size)) for size in (None, (0.6, 0.6)))
    for one, other in zip(free, large, strict=True):
        np.testing.assert_array_equal(one.ankle, other.ankle)


def test_across_the_plate_the_front_foot_steps_less_far() -> None:
    plan = replace(read_plan("short"), plate=(0.60, 0.40))
    side, ahead = occupied(plan)
    assert side == pytest.approx(occupied(replace(plan, plate=None))[0])
    assert ahead == pytest.approx(0.40 - 2 * 0.025)


@pytest.mark.parametrize(
    ("name", "size", "said"),
    [
        ("short", (0.3, 0.6), r"on a plate of 0.3 m from side to side .* the feet need 0.33 m .*Use a larger plate"),
        ("full", (0.6, 0.3), r"the feet need .* and 0.37 m ahead, .*Use a larger plate"),
        ("patient", (0.6, 0.31), r"Use a larger plate"),
        ("patient", (0.325, 0.42), r"Let the person face across it \(--plate 0.42,0.325\)"),
        ("chair", (0.3, 0.6), r"the stool's legs need 0.40 m of force plate from side to side and 0.40 m ahead\. Use"),
    ],
)
def test_a_plate_that_is_too_small_is_refused(name: str, size: tuple[float, float], said: str) -> None:
    with pytest.raises(BiodanceError, match=said):
        support_sequence(TALL, replace(read_plan(name), plate=size))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.4", "expected two lengths in m"),
        ("0.4,wide", "expected two lengths in m"),
        ("400,600", "plate = 400 by 600 m; legal are 0.2 to 3 m"),
        ("0.4,nan", "legal are 0.2 to 3 m"),
    ],
)
def test_a_wrong_plate_on_the_command_line_is_one_sentence(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    who = ["--sex", "M", "--height", "1.8", "--mass", "110"]
    assert run(["dance", *who, "--plate", text, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_robots_feet_are_not_set_by_a_plate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = ["--urdf", "robot.urdf", "--feet", "r,l"]
    assert run(["dance", *robot, "--plate", "0.4,0.6", "--out", str(tmp_path / "out")]) == 2
    assert "--plate is for people" in capsys.readouterr().err


def test_the_plate_is_kept_with_the_dance(tmp_path: Path) -> None:
    for size in (None, (0.4, 0.6)):
        replace(small_dance(), plate=size).save(tmp_path / "dance.npz")
        assert Dance.load(tmp_path / "dance.npz").plate == size
    careful = replace(small_dance(), care=("A helper stands beside.",), rest=20.0)
    careful.save(tmp_path / "dance.npz")
    again = Dance.load(tmp_path / "dance.npz")
    assert (again.care, again.rest) == (careful.care, careful.rest)


def test_the_page_draws_the_plate_with_the_feet_in_its_middle() -> None:
    dance = replace(small_dance(), plate=(0.4, 0.6))
    corners = np.array(scene_of(dance)["plate"])
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.6, 0.4], atol=2e-4)
    soles = dance.stances[0].soles.reshape(-1, 3)[:, :2]
    np.testing.assert_allclose(corners.mean(axis=0), (soles.min(axis=0) + soles.max(axis=0)) / 2, atol=2e-4)
    np.testing.assert_allclose(np.ptp(scene_of(small_dance())["plate"], axis=0), 0.6, atol=2e-4)


def session(*sides: tuple[tuple[float, float], tuple[float, float]]) -> Session:
    """Return a session with a trial to fit on plates from x to x and from y to y, m."""
    plates = [plate(f"plate{k}", *one) for k, one in enumerate(sides)]
    trial, *_ = walker([Stand(0, 1, (0.1, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], plates, duration=1.0)
    return Session(Subject(65.0, 1.75, "F"), (replace(trial, role="fit"),), Path("visit"))


def test_identify_says_beforehand_which_plates_are_too_small() -> None:
    dance = small_dance()  # its feet take 0.36 m by 0.32 m with the room around them
    assert plates_too_small(dance, session(((0.0, 0.6), (0.0, 0.4)))) == ""
    assert plates_too_small(dance, session(((0.0, 0.33), (0.0, 0.4)))) == "", "the person may face across it"
    assert plates_too_small(dance, session(((0.0, 0.6), (0.0, 0.25)), ((0.0, 0.6), (0.25, 0.5)))) == ""
    said = plates_too_small(dance, session(((0.0, 0.6), (0.0, 0.3))))
    assert said.startswith(plate_sentence(dance))
    assert "The plates of visit cover 0.60 m by 0.30 m" in said or "0.30 m by 0.60 m" in said
    assert "--plate" in said


def test_how_much_plate_it_takes_is_said_of_feet_and_stool() -> None:
    assert plate_sentence(small_dance()) == (
        "The feet need 0.36 m of force plate from side to side and 0.32 m ahead, 2.5 cm around them included; mark "
        "their outlines."
    )
    made = plate_sentence(replace(small_dance(), plate=(0.4, 0.6)))
    assert made.endswith("It is made for a plate of 0.40 m by 0.60 m (--plate).")
