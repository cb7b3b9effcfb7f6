"""What one person can and may do, in the words of therapists: read, kept by whole limbs, corrected aloud."""

from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from limit_cases import BODY, CHAIN, feet, movements

from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.limits import Limit
from biodance.dance.limits._person import ArmLift, FootLoad
from biodance.dance.problem.feet import support_sequence, within_cards
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person, joints, read_person
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.problem.stance import seat
from biodance.dance.problem.state import State
from biodance.dance.search.known_postures import read_vocabulary, words_for, words_left_out
from biodance.errors import BiodanceError, UnknownName
from biodance.library import folder, names
from biodance.motion.kinematics import poses
from biodance.pipeline.dance import dancer, make_dance
from biodance.records import SIDES, Subject

LIFT, LOAD = ArmLift(70.0, 60.0, 100.0, 100.0, 90.0), FootLoad(0.55, 0.7)
each = pytest.mark.parametrize("limit", [LIFT, LOAD], ids=lambda limit: limit.name)


def written(folder: Path, text: str) -> PersonLimits:
    path = folder / "person.toml"
    path.write_text(text)
    return read_person(path)


# ---- limits that come with the person


@each
def test_margins_are_what_the_check_finds_and_slopes_are_differences(limit: Limit) -> None:
    rng, broken = np.random.default_rng(0), []
    for state, motion in movements(54):
        left, found = limit.margins(state), limit.check(motion).value
        if not left.value.size:
            assert not found.size
            continue
        np.testing.assert_allclose(found, left.value, rtol=1e-6, atol=1e-6)
        broken.append((found < 0).any())
        turn, step = rng.normal(size=state.x.shape), 1e-6
        ahead, back = (State(CHAIN, state.stance, state.x + h * turn, state.v, state.a) for h in (step, -step))
        difference = (limit.margins(ahead).value - limit.margins(back).value) / (2 * step)
        np.testing.assert_allclose(
            np.einsum("tkn,tn->tk", left.slopes[0], turn), difference, atol=1e-5 * (1 + np.abs(difference).max())
        )
    assert 0.01 < np.mean(broken) < 0.99


def still(**degrees: float) -> State:
    x = np.zeros((1, CHAIN.size))
    x[0, 2] = 0.88
    for name, value in degrees.items():
        x[0, 6 + BODY.joint_index(name)] = np.radians(value)
    return State(CHAIN, feet()[0], x, np.zeros_like(x), np.zeros_like(x))


@pytest.mark.parametrize(
    ("flexion", "adduction", "left"),
    [
        (65.0, 0.0, 5.0),
        (0.0, -65.0, 5.0),
        (-65.0, 0.0, 5.0),
        (90.0, -80.0, -20.0),  # the elbow points sideways, whatever the flexion is called
        (50.0, -50.0, 70.0 - np.degrees(np.arccos(np.cos(np.radians(50.0)) ** 2))),
    ],
)
def test_a_lift_is_the_angle_of_the_upper_arm_from_hanging(flexion: float, adduction: float, left: float) -> None:
    state = still(right_shoulder_flexion=flexion, right_shoulder_adduction=adduction)
    assert np.degrees(ArmLift(70.0, 70.0).margins(state).value[0, 0]) == pytest.approx(left, abs=1e-6)


def test_between_forward_and_sideways_the_greatest_lift_is_an_ellipse() -> None:
    limit = ArmLift(right_forward=80.0, right_sideways=40.0)
    assert limit.margins(still(right_shoulder_flexion=80.0)).value[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert limit.margins(still(right_shoulder_adduction=-40.0)).value[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert limit.margins(still(right_shoulder_adduction=-41.0)).value[0, 0] < 0


def test_a_hand_over_its_shoulder_breaks_a_limit_that_the_upper_arm_keeps() -> None:
    goalposts = still(left_shoulder_flexion=85.0, left_shoulder_adduction=-80.0, left_elbow_flexion=90.0)
    left = LIFT.margins(goalposts).value[0]
    assert left[1] > 0 > left[3]


def test_the_feet_of_who_stands_upright_bear_half_each() -> None:
    weight = 65.0 * 9.80665
    np.testing.assert_allclose(LOAD.margins(still()).value[0], [0.05 * weight, 0.2 * weight], atol=1e-6)


def test_a_foot_that_may_bear_all_may_bear_all_alone_and_with_the_reserve_of_a_posture() -> None:
    upright, limit = still(), FootLoad(left=0.7)
    alone = State(CHAIN, upright.stance.on(0), upright.x, upright.v, upright.a)
    value = limit.margins(alone).value
    assert value.shape == (1, 1), "of the left foot only"
    assert value.min() > limit.hold_reserve(alone.stance) * limit.scale
    assert FootLoad().margins(alone).value.size == 0


# ---- the words of the file


def test_plain_english_and_names_of_the_isb_say_the_same(tmp_path: Path) -> None:
    plain = written(tmp_path, '[at_most_deg]\n"left arm lift forward" = 70\nleft_arm.sideways = 60\nhip_bend = 90\n')
    isb = written(
        tmp_path, "[at_most_deg]\nleft_shoulder_flexion = 70\nleft_shoulder_abduction = 60\nhip_flexion = 90\n"
    )
    assert plain == isb
    body, plan, notes = fit_to_person(BODY, read_plan("easy"), plain)
    assert notes == ("The left arm hangs and is asked for nothing: it is lifted by less than 65 degrees.",)
    (lift,) = (limit for limit in plan.limits if limit.name == "arm_lift")
    assert astuple(lift) == pytest.approx((180.0, 180.0, 70.0, 60.0, 180.0))
    assert np.degrees(body.limits.upper[BODY.joint_index("right_hip_flexion")]) == pytest.approx(90.0)


@pytest.mark.parametrize("key", ["left_arm_forward", "left_arm_sideways", "left_arm_lift", "left_shoulder_elevation"])
def test_one_direction_that_is_named_holds_for_all(tmp_path: Path, key: str) -> None:
    _, plan, _ = fit_to_person(BODY, read_plan("easy"), written(tmp_path, f"[at_most_deg]\n{key} = 70\n"))
    (lift,) = (limit for limit in plan.limits if limit.name == "arm_lift")
    assert astuple(lift) == pytest.approx((180.0, 180.0, 70.0, 70.0, 180.0))


def test_a_range_of_the_other_name_of_a_joint_has_the_other_sign(tmp_path: Path) -> None:
    told = written(tmp_path, "[range_deg]\nleft_shoulder_abduction = [0, 60]\n").ranges
    assert told == (("left_shoulder_adduction", -np.radians(60.0), -0.0),)


def test_what_a_person_cannot_do_is_said_in_words(tmp_path: Path) -> None:
    words = 'cannot = ["stand on left leg", "turn", "lift arms over shoulder height"]\n[weight_bearing]\nright = 0.7\n'
    person = written(tmp_path, words)
    body, plan, notes = fit_to_person(BODY, read_plan("easy"), person)
    assert person.alone == ()
    assert [name for name, _ in plan.blocks] == ["parallel", "right_forward"]
    assert np.degrees(body.limits.upper[BODY.joint_index("trunk_rotation")]) == pytest.approx(3.0)
    assert any("trunk rotation reaches -3 to 3 degrees" in note for note in notes)
    assert {limit.name for limit in plan.limits} >= {"arm_lift", "foot_load"}
    assert written(tmp_path, 'cannot = ["stand"]').seated


def test_who_stands_beside_and_when_to_rest_comes_from_protocol_and_person(tmp_path: Path) -> None:
    own = written(tmp_path, 'rest_after_s = 20\ncare = ["Stop when the shoulder hurts."]\n')
    for name, rest in (("patient", 20.0), ("easy", 20.0)):
        _, plan, _ = fit_to_person(BODY, read_plan(name), own)
        assert (plan.rest, plan.care[-1]) == (rest, "Stop when the shoulder hurts.")
    usual = read_plan("patient")
    assert (usual.rest, usual.count, read_plan("chair").count) == (25.0, 12, 12), "a card each, on one page"
    assert "helper" in usual.care[0]
    assert fit_to_person(BODY, usual, written(tmp_path, "rest_after_s = 60\n"))[1].rest == 25.0, "it only takes away"


def test_groups_of_joints_are_limbs(tmp_path: Path) -> None:
    assert {BODY.joints[j].name for j in joints(BODY, "left_arm")} == {
        *(f"left_shoulder_{way}" for way in ("flexion", "adduction", "rotation")),
        "left_elbow_flexion",
    }
    assert len(joints(BODY, "leg")) == 12


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[at_most_deg]\nleft_arm_foward = 70", "Did you mean '(left_)?arm_forward'"),
        ("[at_most_deg]\nleft_arm_lift = 200", "expected 0 to 180 degrees"),
        ("[range_deg]\narm_lift = [0, 70]", "Write arm_lift = 70 under"),
        ("cannot = ['walk']", "'walk' is not a movement in cannot"),
        ("cannot = 'stand'", "expected a list"),
        ("seat_height_m = 60", "between 0.3 and 1.2"),
        ("rest_after_s = 2", "between 10 and inf"),
        ("care = 'a helper'", "expected sentences in a list"),
        ("[weight_bearing]\nleft = 70", "between 0 and 1"),
        ("[weight_bearing]\nleg = 0.5", "'leg' is not a leg in weight_bearing"),
    ],
)
def test_a_wrong_word_is_refused_with_what_is_legal(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BiodanceError, match=said):
        written(tmp_path, text)


# ---- corrected aloud, or left out


def test_a_range_without_the_hanging_arm_is_widened_and_this_is_said() -> None:
    person = PersonLimits(ranges=(("left_shoulder_flexion", np.radians(20.0), np.radians(70.0)),))
    body, _, (note,) = fit_to_person(BODY, read_plan("patient"), person)
    assert body.limits.lower[BODY.joint_index("left_shoulder_flexion")] == 0.0
    assert (
        note == "An arm must be able to hang: left shoulder flexion reaches 0 to 70 degrees here instead of 20 to 70."
    )


def test_an_arm_that_is_hardly_lifted_hangs_and_is_asked_for_nothing(tmp_path: Path) -> None:
    # 58 degrees is where arms rest in a dance, and who copies it errs by 7: 64 would be held at its limit throughout.
    for most, asked in ((40, False), (64, False), (66, True)):
        person = written(tmp_path, f"[at_most_deg]\nleft_arm_lift = {most}\n")
        body, plan, notes = fit_to_person(BODY, replace(read_plan("patient"), blocks=(("parallel", 1),)), person)
        assert any("The left arm hangs" in note for note in notes) != asked
        (stance,) = support_sequence(body, plan)
        words = words_for(body, plan, stance, read_vocabulary(), np.random.default_rng(0))
        assert ([word.key for word in words["left_arm"]] == ["hang"]) != asked
        assert len(words["right_arm"]) > 1


def test_a_seat_on_which_the_feet_would_not_hang_is_raised(tmp_path: Path) -> None:
    plan = replace(read_plan("chair"), blocks=(("seated", 1),))
    for given, raised in ((0.35, True), (0.9, False)):
        body, fitted, notes = fit_to_person(BODY, plan, written(tmp_path, f"seat_height_m = {given}"))
        (stance,) = support_sequence(body, fitted)
        assert stance.seat == pytest.approx(seat(BODY).seat if raised else given + 0.08)
        assert any("The seat must be" in note for note in notes) == raised


@pytest.mark.parametrize(
    ("text", "protocol", "widened"),
    [
        ("[range_deg]\nleft_shoulder_flexion = [20, 70]\n", "patient", True),  # the arm must hang
        ("[at_most_deg]\nhip_bend = 60\n", "chair", True),  # nobody sits with less
        ("seat_height_m = 0.35\n", "chair", True),
        ("seat_height_m = 0.35\n", "patient", False),  # there is no seat
        ("seat_height_m = 0.9\n", "chair", False),
        ('cannot = ["turn", "stand on left leg"]\n', "patient", False),  # a few degrees, as joints are read
        (None, "patient", False),
    ],
)
def test_a_limit_that_is_not_kept_needs_somebody_and_what_is_left_out_nobody(
    text: str | None, protocol: str, widened: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*_: object, **__: object) -> None:
        raise BiodanceError("not designed here")

    monkeypatch.setattr("biodance.pipeline.dance.design", none)
    subject, plan = Subject(65.0, 1.75, "F", 33.0), read_plan(protocol)
    person = read_person(folder("protocols") / "limits" / "stroke.toml") if text is None else written(tmp_path, text)
    made = make_dance(dancer(subject, plan), plan, person, subject=subject)
    assert made.widened == widened
    assert not made.settled, "there is no dance"


@pytest.mark.parametrize("alone", [SIDES, ("right",), ("left",), ()])
def test_a_person_with_limits_gets_twelve_cards_of_easy_and_everybody_else_all(alone: tuple[str, ...]) -> None:
    person = PersonLimits(stand_alone_on=alone, max_speed=2.0)
    body, plan, _ = fit_to_person(BODY, read_plan("easy"), person)
    cards = support_sequence(body, within_cards(body, plan))
    assert len(cards) == 12
    assert {one.name for one in cards} == {one.name for one in support_sequence(body, plan)}
    usual = fit_to_person(BODY, read_plan("easy"), HEALTHY)[1]
    assert within_cards(BODY, usual).blocks == read_plan("easy").blocks


def test_a_leg_that_bears_less_than_half_asks_for_the_chair(tmp_path: Path) -> None:
    person = written(tmp_path, "[weight_bearing]\nleft = 0.3\n")
    with pytest.raises(BiodanceError, match="Use --protocol chair"):
        fit_to_person(BODY, read_plan("patient"), person)
    fit_to_person(BODY, read_plan("chair"), person)


def test_words_beyond_a_lift_are_left_out_or_say_that_they_are_cut_short(tmp_path: Path) -> None:
    plan = replace(read_plan("patient"), blocks=(("parallel", 1),))
    body, plan, _ = fit_to_person(BODY, plan, written(tmp_path, "[at_most_deg]\nleft_arm_lift = 66\n"))
    (stance,) = support_sequence(body, plan)
    words = words_for(body, plan, stance, read_vocabulary(), np.random.default_rng(0))
    texts = {word.key: word.text for word in words["left_arm"]}
    assert texts["side_in_part"] == "{} arms out to the side (a T), as far as you may"
    assert "side" in {word.key for word in words["right_arm"]}
    assert words_left_out(body, plan, (stance,), read_vocabulary()) == ()
    plan = replace(read_plan("easy"), blocks=(("parallel", 1),))
    body, plan, _ = fit_to_person(BODY, plan, written(tmp_path, "[at_most_deg]\nleft_arm_lift = 66\n"))
    (said,) = words_left_out(body, plan, (stance,), read_vocabulary())
    assert said.startswith("Left out for the left arm: the left arm up (a V)")


@pytest.mark.parametrize(("most", "asked"), [(None, False), (5, False), (10, False), (20, True)])
def test_whoever_cannot_turn_is_not_asked_to_twist_as_far_as_may_be(
    tmp_path: Path, most: int | None, asked: bool
) -> None:
    text = 'cannot = ["turn"]' if most is None else f"[at_most_deg]\ntrunk_turn = {most}\n"
    plan = replace(read_plan("patient"), blocks=(("parallel", 1),))
    body, plan, _ = fit_to_person(BODY, plan, written(tmp_path, text))
    (stance,) = support_sequence(body, plan)
    trunk = words_for(body, plan, stance, read_vocabulary(), np.random.default_rng(0))["trunk"]
    assert any(word.key.startswith("turn") for word in trunk) == asked
    said = words_left_out(body, plan, (stance,), read_vocabulary())
    assert any("twist to the left" in one and "trunk rotation" in one for one in said) != asked


def lifts(dance: Dance) -> float:
    """Return the greatest angle, degrees, of the left upper arm from the trunk's down axis over a whole dance."""
    pose = poses(dance.body, dance.motion(100.0).q)
    trunk, arm = (pose.rotation[:, dance.body.segment_index(name)] for name in ("trunk_head", "left_upper_arm"))
    return float(np.degrees(np.arccos(np.einsum("tc,tc->t", trunk[:, :, 1], arm[:, :, 1]))).max())


def test_an_arm_that_is_lifted_by_70_degrees_comes_no_farther_by_any_way(tmp_path: Path) -> None:
    subject = Subject(65.0, 1.75, "F", 33.0)
    plan = replace(read_plan("patient"), blocks=(("parallel", 4),))
    body = dancer(subject, plan)
    person = written(tmp_path, "[at_most_deg]\nleft_arm_lift = 70\n")
    seen = {}
    for who in (HEALTHY, person):
        own, fitted, _ = fit_to_person(body, plan, who)
        dance, margins = design(own, fitted)
        assert not dance.unsafe
        seen[who] = lifts(dance)
    assert seen[person] <= 71.0
    assert seen[HEALTHY] > 71.0
    assert any(margin.limit == "arm_lift" and margin.worst >= 0 for margin in margins)


# ---- templates


@pytest.mark.parametrize("name", names("protocols/limits"))
def test_every_template_is_read_as_it_is_and_explains_itself(name: str) -> None:
    path = folder("protocols") / "limits" / f"{name}.toml"
    person, text = read_person(path), path.read_text()
    plan = read_plan("easy" if name == "child" else "patient")
    fit_to_person(BODY, plan, person)
    assert person not in (HEALTHY, replace(HEALTHY, reason=person.reason))
    assert text.count("#") > 6


def test_the_command_writes_a_template_and_never_over_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "person.toml"
    words = ["limits", "--template", "stroke", "--out", str(out)]
    assert run(words) == 0
    assert read_person(out).stand_alone_on == ("right",)
    out.write_text("reason = 'mine'")
    assert run(words) == 2
    assert out.read_text() == "reason = 'mine'"
    assert run([*words, "--force"]) == 0
    assert "at_most_deg" in out.read_text()
    capsys.readouterr()
    assert run(["limits", "--template", "strok", "--out", str(tmp_path / "other.toml")]) == 2
    said = capsys.readouterr().err
    assert "Did you mean 'stroke'" in said
    assert all(name in said for name in names("protocols/limits"))


def test_a_joint_that_a_body_does_not_have_is_named() -> None:
    with pytest.raises(UnknownName, match="elbov"):
        fit_to_person(BODY, Plan("p", (("parallel", 2),)), PersonLimits(strengths=(("elbov", 0.5),)))
