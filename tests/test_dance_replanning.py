"""A move that cannot be made: another posture in place of one end, then one posture less, and a refusal only at
last.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.limits import family
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.plan import Plan
from biodance.dance.search import course as course_module
from biodance.dance.search import move as move_module
from biodance.dance.search import optimised_course
from biodance.dance.search.course import Checkpoint, Course, DesignContext, PlainStep
from biodance.dance.search.move import Move, Task
from biodance.dance.search.optimised_course import feasible_course
from biodance.dance.search.posture import KEPT, initial_guess, solve
from biodance.dance.search.posture_set import alike
from biodance.dance.verify import Margin
from biodance.errors import BiodanceError
from biodance.records import Subject

BODY = human(Subject(60.0, 1.65, "F", 45.0))
CHAIN = Chain(BODY)
PLAN = Plan("small", "", (("parallel", 4),), hold=1.0)


@pytest.fixture(scope="module")
def course():
    rng, stances = np.random.default_rng(3), support_sequence(BODY, PLAN)
    found = [solve(CHAIN, s, initial_guess(CHAIN, s, rng), no_objective, family(), iterations=30) for s in stances]
    steps = tuple(PlainStep(one.x, s) for one, s in zip(found, stances, strict=True))
    return Course(steps, (None,) * (len(steps) - 1))


@pytest.fixture
def work():
    with ThreadPoolExecutor(1) as workers:
        yield DesignContext(
            CHAIN, excitation_blocks(BODY), PLAN, 1, Checkpoint(None, BODY, PLAN, 1), workers, lambda *_: None
        )


def forbidding(monkeypatch, forbidden):
    """Let the moves whose ends ``forbidden(first, second)`` break a limit; return the list of what was asked."""
    asked = []

    def moved(first, second):
        broken = forbidden(first, second)
        points = np.zeros((1, 2, CHAIN.size))
        nothing = points, np.ones(1), np.zeros((12, 6, 6)), float(broken), "joint_range" * broken
        return Move(*nothing, np.zeros((0, CHAIN.size)))

    def asked_for(work, course, attempt=0):
        asked.append((attempt, [k for k, known in enumerate(course.moves) if known is not None]))
        pairs = zip(course.moves, pairwise(course.x), strict=True)
        return replace(course, moves=tuple(known or moved(*ends) for known, ends in pairs))

    monkeypatch.setattr(optimised_course, "with_exciting_moves", asked_for)
    return asked


def test_a_course_without_impossible_moves_stays_as_it_is(course, work, monkeypatch):
    asked = forbidding(monkeypatch, lambda first, second: False)
    found = feasible_course(work, course)
    assert found.steps is course.steps
    assert len(found.moves) == 3
    assert found.notes == ()
    assert asked == [(0, [])]


@pytest.mark.parametrize("trap", [1, 2])
def test_the_posture_that_cannot_be_reached_or_left_is_exchanged_for_another_one(course, work, monkeypatch, trap):
    def forbidden(first, second):
        return (np.array_equal(first, course.x[1]) and trap == 1) or (np.array_equal(second, course.x[2]) and trap == 2)

    asked = forbidding(monkeypatch, forbidden)
    found = feasible_course(work, course)
    assert not any(move.limit for move in found.moves)
    assert asked[1] == (1, [0])
    assert len(found.x) == 4
    assert not alike(np.array([course.x[trap], found.x[trap]]))[0, 1]
    again = solve(CHAIN, found.stances[trap], found.x[trap], no_objective, family(), iterations=0)
    assert again.violation <= KEPT
    assert f"Posture {trap + 1} (with both feet side by side) was exchanged for another one" in found.notes[-1]
    assert "joint range" in found.notes[-1]
    same = [k for k in range(4) if np.array_equal(found.x[k], course.x[k])]
    assert same == ([0, 1, 3] if trap == 2 else [0, 3])


def test_a_posture_that_no_exchange_helps_is_left_out(course, work, monkeypatch):
    last = course.x[3]
    forbidding(
        monkeypatch,
        lambda first, second: np.array_equal(first, last) or (len(work_x) == 4 and np.array_equal(second, last)),
    )
    work_x = course.x
    monkeypatch.setattr(optimised_course, "_ENDS", (0,))
    found = feasible_course(work, course)
    assert len(found.x) == len(found.moves) + 1 == 3
    assert not any(np.array_equal(x, last) for x in found.x)
    assert "left out" in found.notes[-1]


def test_the_same_design_is_replanned_in_the_same_way(course, work, monkeypatch):
    forbidding(monkeypatch, lambda first, second: np.array_equal(second, course.x[2]))
    np.testing.assert_array_equal(feasible_course(work, course).x, feasible_course(work, course).x)


def test_feet_on_which_no_move_can_be_made_are_refused_with_the_limit(course, work, monkeypatch):
    forbidding(monkeypatch, lambda first, second: True)
    with pytest.raises(BiodanceError, match="joint range is exceeded even slowly"):
        feasible_course(work, course)


@pytest.mark.parametrize(("left", "taken"), [(9e-10, True), (2e-10, False)])
def test_a_way_leaves_half_of_what_a_lifting_sole_may_press(course, monkeypatch, left, taken):
    tried = []

    def found(task, history, *, rng):
        tried.append(task.duration)
        nothing = np.zeros((12, 6, 6)), 0.0, "", np.zeros((0, CHAIN.size))
        return Move(task.straight()[None], np.array([task.duration]), *nothing)

    monkeypatch.setattr(move_module, "find_move", found)
    monkeypatch.setattr(move_module, "verify", lambda *_: (Margin("ground_clearance", left, 0.01, "m"),))
    task = Task(CHAIN, excitation_blocks(BODY), course.stances[0], course.x[:2], 2.0, family())
    move = move_module.exciting_move(task, np.zeros((12, 6, 6)), [1, 3, 0])
    assert (move.limit == "") is taken
    assert (tried == [2.0]) is taken


def test_parts_of_older_code_are_not_gone_on_with(tmp_path, monkeypatch):
    now = Checkpoint(tmp_path, BODY, PLAN, 1)
    now.put("postures", x=np.ones(3))
    assert Checkpoint(tmp_path, BODY, PLAN, 1).get("postures") is not None
    monkeypatch.setattr(course_module, "code", lambda: "of yesterday")
    assert Checkpoint(tmp_path, BODY, PLAN, 1).get("postures") is None
