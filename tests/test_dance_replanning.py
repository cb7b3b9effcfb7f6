"""A move that cannot be made: another posture in place of one end, then one posture less, and a refusal only at
last.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.limits import family
from biodance.dance.postures.exchange import alike
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.postures.posture import KEPT, initial_guess, solve
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.plan import Plan
from biodance.dance.transitions import context
from biodance.dance.transitions import schedule as schedule_module
from biodance.dance.transitions.context import Checkpoint, Course, DesignContext
from biodance.dance.transitions.move import Move, Task
from biodance.dance.transitions.schedule import Way, replan
from biodance.dance.verify import Margin
from biodance.errors import BiodanceError
from biodance.records import Subject

BODY = human(Subject(60.0, 1.65, "F", 45.0))
CHAIN = Chain(BODY)
PLAN = Plan("small", "", (("parallel", 4),), hold=1.0)


@pytest.fixture(scope="module")
def course():
    rng, stances = np.random.default_rng(3), support_sequence(BODY, PLAN)
    return Course(
        np.array(
            [solve(CHAIN, s, initial_guess(CHAIN, s, rng), no_objective, family(), iterations=30).x for s in stances]
        ),
        stances,
    )


@pytest.fixture
def work():
    with ThreadPoolExecutor(1) as workers:
        yield DesignContext(
            CHAIN, excitation_blocks(BODY), PLAN, 1, Checkpoint(None, BODY, PLAN, 1), workers, lambda *_: None
        )


def forbidding(monkeypatch, forbidden):
    """Let the ways whose ends ``forbidden(first, second)`` break a limit; return the list of what was asked."""
    asked = []

    def asked_for(work, course, known, attempt=0):
        asked.append((attempt, sorted(known)))
        out = []
        for k in range(len(course.x) - 1):
            limit = "joint_range" if forbidden(course.x[k], course.x[k + 1]) else ""
            nothing = np.zeros((1, 2, CHAIN.size)), np.ones(1), np.zeros((0, CHAIN.size)), np.zeros((12, 6, 6))
            out.append(known.get(k, Way(*nothing, limit)))
        return out

    monkeypatch.setattr(schedule_module, "schedule", asked_for)
    return asked


def test_a_course_without_impossible_moves_stays_as_it_is(course, work, monkeypatch):
    asked = forbidding(monkeypatch, lambda first, second: False)
    found, between, notes = replan(work, course)
    assert found is course
    assert len(between) == 3
    assert notes == ()
    assert asked == [(0, [])]


@pytest.mark.parametrize("trap", [1, 2])
def test_the_posture_that_cannot_be_reached_or_left_is_exchanged_for_another_one(course, work, monkeypatch, trap):
    def forbidden(first, second):
        return (np.array_equal(first, course.x[1]) and trap == 1) or (np.array_equal(second, course.x[2]) and trap == 2)

    asked = forbidding(monkeypatch, forbidden)
    found, between, notes = replan(work, course)
    assert not any(way.limit for way in between)
    assert asked[1] == (1, [0])
    assert len(found.x) == 4
    assert not alike(np.array([course.x[trap], found.x[trap]]))[0, 1]
    again = solve(CHAIN, found.stances[trap], found.x[trap], no_objective, family(), iterations=0)
    assert again.violation <= KEPT
    assert f"Posture {trap + 1} (with both feet side by side) was exchanged for another one" in notes[-1]
    assert "joint range" in notes[-1]
    same = [k for k in range(4) if np.array_equal(found.x[k], course.x[k])]
    assert same == ([0, 1, 3] if trap == 2 else [0, 3])


def test_a_posture_that_no_exchange_helps_is_left_out(course, work, monkeypatch):
    last = course.x[3]
    forbidding(
        monkeypatch,
        lambda first, second: np.array_equal(first, last) or (len(work_x) == 4 and np.array_equal(second, last)),
    )
    work_x = course.x
    monkeypatch.setattr(schedule_module, "_ENDS", (0,))
    found, between, notes = replan(work, course)
    assert len(found.x) == len(between) + 1 == 3
    assert not any(np.array_equal(x, last) for x in found.x)
    assert "left out" in notes[-1]


def test_the_same_design_is_replanned_in_the_same_way(course, work, monkeypatch):
    forbidding(monkeypatch, lambda first, second: np.array_equal(second, course.x[2]))
    np.testing.assert_array_equal(replan(work, course)[0].x, replan(work, course)[0].x)


def test_feet_on_which_no_move_can_be_made_are_refused_with_the_limit(course, work, monkeypatch):
    forbidding(monkeypatch, lambda first, second: True)
    with pytest.raises(BiodanceError, match="joint range is exceeded even slowly"):
        replan(work, course)


@pytest.mark.parametrize(("left", "taken"), [(9e-10, True), (2e-10, False)])
def test_a_way_leaves_half_of_what_a_lifting_sole_may_press(course, monkeypatch, left, taken):
    tried = []

    def found(task, history, *, rng):
        tried.append(task.duration)
        return Move(task.straight(), task.duration, np.zeros((12, 6, 6)), 0.0, "")

    monkeypatch.setattr(schedule_module, "find_move", found)
    monkeypatch.setattr(schedule_module, "verify", lambda *_: (Margin("ground_clearance", left, 0.01, "m"),))
    task = Task(CHAIN, excitation_blocks(BODY), course.stances[0], course.x[:2], 2.0, family())
    way = schedule_module.find_way(task, np.zeros((12, 6, 6)), [1, 3, 0])
    assert (way.limit == "") is taken
    assert (tried == [2.0]) is taken


def test_parts_of_older_code_are_not_gone_on_with(tmp_path, monkeypatch):
    now = Checkpoint(tmp_path, BODY, PLAN, 1)
    now.put("postures", x=np.ones(3))
    assert Checkpoint(tmp_path, BODY, PLAN, 1).get("postures") is not None
    monkeypatch.setattr(context, "code", lambda: "of yesterday")
    assert Checkpoint(tmp_path, BODY, PLAN, 1).get("postures") is None
