"""Refusals: a healthy person is let through; whoever lacks one thing hears which one, and that it is enough to give
it back.
"""

from dataclasses import replace

import numpy as np
import pytest

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.skeleton import joint_limits
from biodance.dance.design import safe_stretch
from biodance.dance.limits import family
from biodance.dance.performers import PerformersResult
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person, limit_body
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import Stance, stance
from biodance.dance.problem.state import State
from biodance.dance.search import word_course as word_search
from biodance.dance.search.course import Course, DanceStep, DesignContext
from biodance.dance.search.known_postures import PostureTable
from biodance.dance.search.postures import KEPT, describe, initial_guess, refuse, solve
from biodance.dance.search.word_course import NoNextPosture, WordSearch, word_course
from biodance.errors import BiodanceError
from biodance.records import Subject

SUBJECT = Subject(65.0, 1.75, "F", 33.0)
BODY = replace(human(SUBJECT), limits=joint_limits(SUBJECT, within="comfortable"))
FEET = stance(BODY, "parallel")
STIFF = PersonLimits(
    ranges=(("ankle_dorsiflexion", -np.inf, np.radians(9.0)), ("left_shoulder_flexion", -np.inf, np.radians(40.0)))
)


def limits_of(person: PersonLimits) -> Body:
    return replace(BODY, limits=limit_body(BODY, person))


def words(person: PersonLimits, feet: Stance) -> str:
    """Return why there is no posture; nothing if there is one."""
    chain, rng = Chain(limits_of(person)), np.random.default_rng(1)
    begin = [initial_guess(chain, feet, rng) for _ in range(4)]
    if any(solve(chain, feet, x, no_objective, family(), iterations=40).violation <= KEPT for x in begin):
        return ""
    with pytest.raises(BiodanceError) as said:
        refuse(chain, feet, begin, family())
    return str(said.value)


def test_a_healthy_person_can_stand_in_all_ways() -> None:
    for feet in (FEET, stance(BODY, "right_forward", right=0.2), FEET.on(0)):
        assert words(HEALTHY, feet) == ""


def test_a_bent_leg_without_strength_does_not_bear_the_body() -> None:
    weak = PersonLimits(
        strengths=(("right_knee", 0.02), ("right_hip", 0.02)),
        ranges=(("right_knee", np.radians(60.0), np.radians(90.0)),),
    )
    said = words(weak, FEET.on(0))
    assert "on the right leg alone" in said
    assert "joint torque of right" in said


def test_an_ankle_that_stays_pointed_cannot_stand() -> None:
    stiff = PersonLimits(ranges=(("ankle_dorsiflexion", np.radians(-35.0), np.radians(-30.0)),))
    said = words(stiff, FEET)
    assert "both feet side by side" in said
    assert "ankle dorsiflexion (short by about" in said


def test_a_posture_at_its_limit_lacks_the_reserve_and_not_minus_nothing() -> None:
    chain, ends, knee = Chain(BODY), BODY.limits, BODY.joint_index("left_knee_flexion")
    x = np.zeros((1, chain.size))
    x[0, ROOT:] = (ends.lower + ends.upper) / 2
    x[0, ROOT + knee] = ends.upper[knee]
    limit = next(one for one in family() if one.name == "joint_range")
    said = describe(State(chain, FEET, x, *np.zeros((2, 1, chain.size))), limit)
    assert said == "joint range of left knee flexion (0 degrees left, less than its reserve)"


# ---- known postures: what is not possible is left out, the rest is danced

PLAN = Plan("p", (("parallel", 4), ("single_right", 2)), hold=1.0, instructions=3.0, wide=1.35, gentle=True)


def test_what_is_not_possible_is_left_out_and_the_rest_is_kept() -> None:
    stances = support_sequence(BODY, PLAN)
    on = [(one.name, one.over) for one in stances]
    third, single = NoNextPosture("too weak", stances, 2), on.index(("single_right", None))
    assert third.possible(PLAN.blocks, PLAN.blocks) == (("parallel", 2), ("single_right", 2))
    assert third.note(PLAN.blocks) == "Left out: 2 of the 4 postures parallel; too weak."
    lifted = NoNextPosture("too weak", stances, single)
    assert lifted.possible(PLAN.blocks, PLAN.blocks) == (("parallel", 4),)
    assert lifted.note(PLAN.blocks) == "Left out: all 2 postures single right; too weak."
    assert NoNextPosture("", stances, single + 1).possible(PLAN.blocks, PLAN.blocks) == (
        ("parallel", 4),
        ("single_right", 1),
    )
    assert NoNextPosture("", stances, 0).possible(PLAN.blocks, PLAN.blocks) == (("single_right", 2),)


def test_postures_that_whoever_cannot_step_dances_on_the_first_feet_are_left_out_by_themselves() -> None:
    """Of ten postures side by side three are danced, so that the cards are few; four of the other foot ahead follow."""
    blocks = (("parallel", 3), ("single_right", 3), ("right_forward", 4))
    stances = support_sequence(BODY, replace(PLAN, blocks=blocks, alone=("right",)))
    assert {one.name for one in stances} == {"parallel", "single_right"}
    planned, (*_, last) = (("parallel", 10), *blocks[1:]), range(len(stances))
    stuck, later = NoNextPosture("too near", stances, last - 3), NoNextPosture("too near", stances, last)
    assert stuck.possible(planned, blocks) == planned[:2]
    assert stuck.note(blocks) == "Left out: all 4 postures right forward; too near."
    assert later.possible(planned, blocks) == (*planned[:2], ("right_forward", 3))


def test_a_dance_of_more_postures_than_there_are_is_shorter_and_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(word_search, "_TRIES", 40)
    body, plan, _ = fit_to_person(BODY, replace(PLAN, blocks=(("parallel", 30),)), STIFF)
    course = word_course(WordSearch(DesignContext.alone(body, plan, 0)))
    assert 2 <= len(course.steps) < 30
    assert course.notes[0].startswith(f"Left out: {30 - len(course.steps)} of the 30 postures parallel; ")
    assert any(
        "lean to the right; it would break the limit on joint range of left ankle" in note for note in course.notes
    )


def test_only_where_nothing_is_left_a_dance_is_refused_with_joint_and_number() -> None:
    body, plan, _ = fit_to_person(BODY, PLAN, PersonLimits(strengths=(("all", 0.05),)))
    with pytest.raises(NoNextPosture, match=r"joint torque of (left|right) [a-z ]+ \(short by about \d+ N m\)"):
        word_course(WordSearch(DesignContext.alone(body, plan, 0)))


@pytest.mark.parametrize(("bad", "kept"), [((4,), (5, 9)), ((0, 8), (1, 7)), ((1, 3, 5, 7, 9), None)])
def test_the_longest_stretch_at_which_nobody_errs_is_left(bad: tuple[int, ...], kept: tuple[int, int] | None) -> None:
    steps = tuple(DanceStep(PostureTable(Chain(BODY), FEET, np.full((1, 3), float(p))), mirror=True) for p in range(10))
    found = PerformersResult(1, (), tuple((p, "balance") for p in bad))
    shorter = safe_stretch(Course(steps, (None,) * 9), found)
    if kept is None:
        assert shorter is None
        return
    assert shorter is not None
    assert [int(step.x[0]) for step in shorter.steps] == list(range(kept[0], kept[1] + 1))
    assert len(shorter.moves) == len(shorter.steps) - 1
    assert [step.mirror for step in shorter.steps] == [False] + [True] * (len(shorter.steps) - 1)
    assert shorter.notes[0].startswith(f"Left out: {10 - len(shorter.steps)} of 10 postures")


def test_a_stretch_begins_and_ends_on_both_feet() -> None:
    feet = (FEET, FEET, replace(FEET, over=0), FEET.on(0), FEET.on(0), replace(FEET, over=0), FEET, FEET)
    steps = tuple(DanceStep(PostureTable(Chain(BODY), one, np.full((1, 3), float(p)))) for p, one in enumerate(feet))
    shorter = safe_stretch(Course(steps, (None,) * 7), PerformersResult(1, (), ((0, "balance"), (4, "balance"))))
    assert shorter is not None
    assert [int(step.x[0]) for step in shorter.steps] == [6, 7]
