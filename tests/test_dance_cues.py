"""Cue sheet: only what moves, pairs together, planted legs by their knees, in words."""

from dataclasses import replace

import numpy as np
from small_dances import small_dance

from biodance.body.human.human import human
from biodance.dance.cues import _MOST, REST, _words, calls, cue_sheet, instructions, rests
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.stance import Stance
from biodance.records import Array, Subject

BODY = human(Subject(65.0, 1.75, "F"))
STRAIGHT = np.zeros(23)


def posture(**degrees: float) -> Array:
    out = np.zeros(23)
    for name, angle in degrees.items():
        out[BODY.joint_index(name)] = angle
    return out


def test_every_joint_of_the_human_has_words() -> None:
    movements = {joint.name.removeprefix("right_").removeprefix("left_") for joint in BODY.joints}
    assert movements == set(_words("joints"))


def test_direction_size_and_order() -> None:
    said = calls(BODY, STRAIGHT, posture(right_shoulder_flexion=88, trunk_rotation=-31, left_elbow_flexion=5))
    assert said == ("lift the right arm forward to shoulder height", "turn the trunk to the right by about 30°")


def test_pairs_are_called_together_and_only_when_alike() -> None:
    assert calls(BODY, STRAIGHT, posture(right_elbow_flexion=60, left_elbow_flexion=64)) == (
        "bend both elbows by about 60°",
    )
    assert len(calls(BODY, STRAIGHT, posture(right_elbow_flexion=60, left_elbow_flexion=100))) == 2


def test_an_arm_that_stays_out_to_the_side_is_not_let_down_when_its_forearm_turns() -> None:
    barrel = posture(left_shoulder_adduction=-85, left_elbow_flexion=75)
    goalpost = posture(left_shoulder_adduction=-80, left_elbow_flexion=75, left_shoulder_flexion=85)
    assert calls(BODY, barrel, goalpost) == ("turn the left forearm up to a right angle",)
    assert calls(BODY, goalpost, barrel) == ("turn the left forearm forward",)
    forward, down = posture(left_shoulder_flexion=90), STRAIGHT
    assert calls(BODY, forward, down) == ("let the left arm down to the front of the body",)
    assert calls(BODY, forward, posture(left_shoulder_adduction=-90)) == (
        "bring the left arm back from the front",
        "lift the left arm sideways to shoulder height",
    )


def test_going_back_is_said_as_the_place_not_as_zero() -> None:
    assert calls(BODY, posture(trunk_flexion=40), STRAIGHT) == ("bring the trunk upright",)


def test_coming_up_half_way_is_not_said_as_going_down() -> None:
    squat, half = (posture(right_knee_flexion=angle, left_knee_flexion=angle) for angle in (45.0, 15.0))
    assert calls(BODY, squat, half) == ("straighten both knees, all but about 15°",)
    deeper = posture(right_knee_flexion=90, left_knee_flexion=90)
    assert calls(BODY, deeper, squat) == ("bend both knees only by about 45°",)
    assert calls(BODY, half, squat) == ("bend both knees by about 45°",)


def test_of_a_standing_leg_only_the_knee_is_called() -> None:
    squat = posture(right_knee_flexion=45, right_hip_flexion=40, right_ankle_dorsiflexion=20)
    assert calls(BODY, STRAIGHT, squat, ("right", "left")) == ("bend the right knee by about 45°",)
    assert len(calls(BODY, STRAIGHT, squat, ("left",))) == 3


def test_a_planted_leg_is_never_half_of_a_pair() -> None:
    both = posture(right_hip_rotation=-45, left_hip_rotation=-45)
    assert calls(BODY, STRAIGHT, both, ("right",)) == ("turn the left leg outwards by about 45°",)


HIPS = np.zeros(3)
FEET = ("right", "left")


def test_hips_that_go_with_the_trunk_are_one_call_and_alone_another() -> None:
    twist = posture(trunk_rotation=-30)
    assert calls(BODY, STRAIGHT, twist, FEET, (HIPS, np.array([-28.0, 0, 0]))) == (
        "turn the trunk to the right by about 30°, hips too",
    )
    assert calls(BODY, STRAIGHT, twist, FEET, (HIPS, np.array([28.0, 0, 0]))) == (
        "turn the trunk to the right by about 30°",
        "turn the hips to the left by about 30°",
    )
    assert calls(BODY, STRAIGHT, STRAIGHT, FEET, (HIPS, np.array([0, 0, 40.0]))) == (
        "bow forward from the hips by about 45°",
    )
    low = np.array([0.0, 0.0, 60.0])
    assert calls(BODY, STRAIGHT, posture(trunk_flexion=30), FEET, (HIPS, low)) == (
        "lean the trunk forward by about 30°, hips too, by about 60°",
    )
    assert calls(BODY, posture(trunk_flexion=30), STRAIGHT, FEET, (low, HIPS)) == ("bring the trunk upright, hips too",)


def test_hips_that_lean_with_bending_knees_are_not_called() -> None:
    squat, tilt = posture(right_knee_flexion=50, left_knee_flexion=50), np.array([0.0, 0.0, 25.0])
    assert calls(BODY, STRAIGHT, squat, FEET, (HIPS, tilt)) == ("bend both knees by about 45°",)
    assert len(calls(BODY, STRAIGHT, squat, FEET, (HIPS, 2 * tilt))) == 2
    assert len(calls(BODY, STRAIGHT, squat, (), (HIPS, tilt))) == 2, "legs that hang hold nobody up"


def test_the_hips_of_a_dance_are_called_by_their_sides() -> None:
    upright, bowed, turned = np.zeros((3, ROOT + len(BODY.joints)))
    bowed[ROOT - 1], turned[ROOT - 3] = np.radians([-40.0, 30.0])  # tilt backward, turn to the left
    chain = Chain(BODY)
    assert chain.root_rotation(bowed[None])[0, 2, 0] < -0.5, "what was ahead points down"
    assert chain.root_rotation(turned[None])[0, 1, 0] > 0.4, "what was ahead points to the left"
    stance = Stance("parallel", np.array([[0.0, -0.1, 0.07], [0.0, 0.1, 0.07]]), (0, 1), np.zeros((2, 4, 3)))
    assert instructions(BODY, upright, bowed, stance, stance) == ("bow forward from the hips by about 45°",)
    assert instructions(BODY, upright, turned, stance, stance) == ("turn the hips to the left by about 30°",)


def test_what_is_more_than_a_person_can_begin_at_once_is_said_after() -> None:
    moved = posture(**{joint.name: 20.0 + i for i, joint in enumerate(BODY.joints)})
    text = cue_sheet((calls(BODY, STRAIGHT, moved),), ("free",))
    first, rest = text.split("**1.** ")[1].split(" And also: ")
    assert len(first.split(";")) == _MOST
    assert len(first.split(";")) + len(rest.split(";")) == len(calls(BODY, STRAIGHT, moved)) >= 13


def test_sheet_counts_postures_and_names_each_stance_once() -> None:
    bowed, lifted = posture(trunk_flexion=30), posture(right_hip_flexion=45)
    said = calls(BODY, STRAIGHT, bowed, FEET), calls(BODY, bowed, bowed, FEET), calls(BODY, bowed, lifted, ("left",))
    text = cue_sheet(said, ("feet side by side", "feet side by side", "on the left foot"))
    assert text.count("## ") == 2
    assert "**2.** Stay as you are." in text
    assert "**3.** Lift the right thigh forward by about 45°; bring the trunk upright." in text


def test_a_person_rests_after_so_many_seconds_and_not_at_last() -> None:
    dance = small_dance()
    assert rests(dance) == (False, False)
    assert rests(replace(dance, rest=1.0)) == (True, False)
    assert rests(replace(dance, rest=1.5)) == (False, False), "after the last posture the dance is over"
    sheet = cue_sheet((("stand",), ("bow",)), ("on the stool",) * 2, rests=(True, False))
    assert sheet.count(REST) == 1
    assert sheet.index("Stand") < sheet.index(REST) < sheet.index("Bow")
