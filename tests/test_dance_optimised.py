"""Selection: what it says is left unknown is the textbook posterior, budgets hold, greedy beats chance."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.expectation import (
    SAMPLE_ERROR,
    SAMPLE_RATE,
    PostureInformation,
    learned,
    standing_regressors,
    update_posterior,
)
from biodance.dance.limits import Margin, family
from biodance.dance.limits.ground_clearance import GroundClearance
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import rest_to_rest
from biodance.dance.problem.stance import feet_in_move, stance
from biodance.dance.search import course as course_module
from biodance.dance.search import move as move_module
from biodance.dance.search import optimised_course
from biodance.dance.search.course import Checkpoint, Course, DanceStep, DesignContext
from biodance.dance.search.known_postures import PostureTable
from biodance.dance.search.move import Move, Task
from biodance.dance.search.optimised_course import affordable, feasible_course, nearest_neighbours
from biodance.dance.search.postures import KEPT, alike, initial_guess, solve
from biodance.errors import BiodanceError
from biodance.identification.posterior import prior_factor
from biodance.motion.dynamics import regressor
from biodance.records import Array, Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)
STANCES = ("parallel",) * 6 + ("single_right",) * 6
PLAN = Plan("p", (("parallel", 6), ("single_right", 6)), hold=1.0)


def postures(seed: int) -> Array:
    """Return twelve random postures (12, n)."""
    rng = np.random.default_rng(seed)
    out = np.zeros((12, CHAIN.size))
    out[:, ROOT:] = rng.uniform(BODY.limits.lower, BODY.limits.upper, (12, 23)) * 0.8
    out[:, 2] = 0.9
    return out


@pytest.fixture(scope="module")
def x() -> Array:
    return postures(1)


def information(x: Array, order: Sequence[int]) -> Array:
    """Whitened rows of standing in each posture and of going there from the one before on the same feet (or from
    any, at first).
    """
    rows, last = [], {}
    basis = rest_to_rest(PLAN.move, via=0, rate=SAMPLE_RATE)
    for p in order:
        origin = last.get(STANCES[p], next(q for q in range(12) if STANCES[q] == STANCES[p] and q != p))
        ends = x[[origin, p]]
        parts = [part[1:-1] @ ends for part in (basis.position, basis.velocity, basis.acceleration)]
        for q, v, a in (parts, (x[p][None], *np.zeros((2, 1, CHAIN.size)))):
            rows.append(regressor(BODY, CHAIN.motion(np.arange(len(q)) / SAMPLE_RATE, q, v, a)).reshape(-1, 120))
        last[STANCES[p]] = p
    rows = np.concatenate(rows)
    return rows / np.tile(SAMPLE_ERROR, len(rows) // 6)[:, None]


def test_what_is_left_unknown_is_the_posterior_of_the_textbook(x: Array) -> None:
    known, table, order = PostureInformation(CHAIN, PLAN), BODY.sip.covariance, (3, 7, 0, 8)
    posterior, still = known.beforehand, known.white(standing_regressors(CHAIN, x))
    for p, before in zip(order, (0, 6, 3, 7), strict=True):
        way = known.of_ways(x[[before, p]][None])[0]
        posterior = update_posterior(posterior, np.concatenate([still[p], way]))
    rows = information(x, order)
    after = table - table @ rows.T @ np.linalg.solve(np.eye(len(rows)) + rows @ table @ rows.T, rows @ table)
    sd = np.sqrt(np.diag(table))
    sd[sd == 0] = 1.0
    np.testing.assert_allclose(
        known.factor @ posterior @ known.factor.T / sd / sd[:, None], after / sd / sd[:, None], atol=1e-6
    )


def test_every_pick_is_the_best_there_was(x: Array) -> None:
    picked = affordable(CHAIN, x, STANCES, PLAN)
    assert sorted(picked) == list(range(12))
    S = prior_factor(BODY.sip)
    before = np.sum(S**2, axis=1)

    def left(order: tuple[int, ...]) -> float:
        rows = information(x, order) @ S
        after = np.sum(S * np.linalg.solve(np.eye(S.shape[1]) + rows.T @ rows, S.T).T, axis=1)
        return float(np.sum(after[before > 0] / before[before > 0]))

    first = {p: left((p,)) for p in range(12)}
    assert min(first, key=first.__getitem__) == picked[0]
    second = {p: left((picked[0], p)) for p in range(12) if p != picked[0]}
    assert min(second, key=second.__getitem__) == picked[1]


def test_the_budget_is_kept(x: Array) -> None:
    whole = affordable(CHAIN, x, STANCES, PLAN)
    some = affordable(CHAIN, x, STANCES, replace(PLAN, budget=30.0))
    seconds = [3.0 + 4.0 * (STANCES[p] not in {STANCES[q] for q in some[:k]}) for k, p in enumerate(some)]
    assert sum(seconds) <= 30.0 < sum(seconds) + 3.0
    assert some == whole[: len(some)]


@pytest.mark.parametrize("segment", ["left_shank", "right_thigh", "trunk_head", "left_forearm_hand"])
def test_emphasis_is_on_the_segment_that_counts(segment: str) -> None:
    only = replace(PLAN, weights=((segment, 1.0),), other_weight=0.0)
    S = prior_factor(BODY.sip)
    own = slice(10 * BODY.segment_index(segment), 10 * BODY.segment_index(segment) + 10)

    def unknown(plan: Plan, x: Array) -> float:
        rows = information(x, affordable(CHAIN, x, STANCES, replace(plan, budget=24.0))) @ S
        after = np.sum(S * np.linalg.solve(np.eye(S.shape[1]) + rows.T @ rows, S.T).T, axis=1)
        return float(np.mean((after / np.maximum(np.sum(S**2, axis=1), 1e-30))[own]))

    choices = [postures(seed) for seed in range(1, 6)]  # a greedy choice is not the best one of every single set
    assert np.mean([unknown(only, x) for x in choices]) < np.mean([unknown(PLAN, x) for x in choices])


def test_learned_is_the_textbook_update() -> None:
    rng = np.random.default_rng(0)
    posterior, rows = np.diag(rng.uniform(0.5, 1.0, 5)), rng.normal(size=(3, 5))
    change = learned(posterior, rows)
    np.testing.assert_allclose(
        posterior - change.T @ change, np.linalg.inv(np.linalg.inv(posterior) + rows.T @ rows), atol=1e-12
    )


# ---- A move that cannot be made

WOMAN = human(Subject(60.0, 1.65, "F", 45.0))
WOMANS = Chain(WOMAN)
TWO_FEET = Plan("small", (("parallel", 4),), hold=1.0)


@pytest.fixture(scope="module")
def course():
    rng, stances = np.random.default_rng(3), support_sequence(WOMAN, TWO_FEET)
    found = [solve(WOMANS, s, initial_guess(WOMANS, s, rng), no_objective, family(), iterations=30) for s in stances]
    steps = tuple(DanceStep(PostureTable(CHAIN, s, one.x[None])) for one, s in zip(found, stances, strict=True))
    return Course(steps, (None,) * (len(steps) - 1))


@pytest.fixture
def work():
    with ThreadPoolExecutor(1) as workers:
        yield DesignContext(
            WOMANS,
            excitation_blocks(WOMAN),
            TWO_FEET,
            1,
            Checkpoint(None, WOMAN, TWO_FEET, 1),
            workers,
            lambda *_: None,
        )


def forbidding(monkeypatch, forbidden):
    """Let the moves whose ends ``forbidden(first, second)`` break a limit; return the list of what was asked."""
    asked = []

    def moved(first, second):
        broken = forbidden(first, second)
        points = np.zeros((1, 2, WOMANS.size))
        nothing = points, np.ones(1), np.zeros((12, 6, 6)), float(broken), "joint_range" * broken
        return Move(*nothing, np.zeros((0, WOMANS.size)))

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
    again = solve(WOMANS, found.stances[trap], found.x[trap], no_objective, family(), iterations=0)
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
        nothing = np.zeros((12, 6, 6)), 0.0, "", np.zeros((0, WOMANS.size))
        return Move(task.straight()[None], np.array([task.duration]), *nothing)

    monkeypatch.setattr(move_module, "find_move", found)
    monkeypatch.setattr(move_module, "verify", lambda *_: (Margin("ground_clearance", left, 0.01, "m"),))
    task = Task(WOMANS, excitation_blocks(WOMAN), course.stances[0], course.x[:2], 2.0, family())
    move = move_module.exciting_move(task, np.zeros((12, 6, 6)), [1, 3, 0])
    assert (move.limit == "") is taken
    assert (tried == [2.0]) is taken


def test_a_foot_on_its_way_is_designed_five_centimetres_over_the_floor_half_way() -> None:
    """Lower, it drags, and whoever is played in MuJoCo falls over it; at both ends it stands."""
    feet, limit, time = stance(BODY, "parallel").on(1), GroundClearance(), np.linspace(0.0, 2.0, 5)
    task = Task(CHAIN, excitation_blocks(BODY), feet, np.zeros((2, CHAIN.size)), 2.0, (limit,))
    asked = task.problem(task.straight(), [], time, reserve=move_module.RESERVE, objective=no_objective).reserve
    height = limit.scale * asked[:, 0]
    np.testing.assert_allclose(height[[0, 2, 4]], [0.0, 0.05, 0.0], atol=1e-12)
    assert height[1] == pytest.approx(height[3])
    assert 0.01 < height[1] < 0.05


def test_parts_of_older_code_are_not_gone_on_with(tmp_path, monkeypatch):
    now = Checkpoint(tmp_path, WOMAN, TWO_FEET, 1)
    now.put("postures", x=np.ones(3))
    assert Checkpoint(tmp_path, WOMAN, TWO_FEET, 1).get("postures") is not None
    monkeypatch.setattr(course_module, "code", lambda: "of yesterday")
    assert Checkpoint(tmp_path, WOMAN, TWO_FEET, 1).get("postures") is None


# ---- Postures in order

BLOCKS = ("parallel", "right_forward", "single_right", "single_left")


@pytest.mark.parametrize("names", list(permutations(BLOCKS)), ids="-".join)
def test_no_foot_moves_unless_the_other_bears_the_weight(names):
    stances = support_sequence(BODY, Plan("any", tuple((name, 2) for name in names)))
    assert [s.name for s in stances if s.over is None] == [name for name in names for _ in range(2)]
    assert stances[-1].planted == (0, 1)
    for before, after in pairwise(stances):
        bearing = feet_in_move(before, after).planted
        for one in (before, after):
            assert set(bearing) <= set(one.planted)
            if len(bearing) == 1 and len(one.planted) == 2:
                assert one.over == bearing[0]
        for side in bearing:
            np.testing.assert_array_equal(before.ankle[side], after.ankle[side])


def test_who_may_not_stand_on_the_left_leg_never_steps():
    stances = support_sequence(BODY, Plan("careful", (("parallel", 2), ("right_forward", 3)), alone=()))
    assert [(s.name, s.over) for s in stances] == [("parallel", None)] * 5


def test_sitting_and_standing_do_not_mix():
    with pytest.raises(BiodanceError, match="stool"):
        support_sequence(BODY, Plan("both", (("parallel", 2), ("seated", 3))))


def test_weight_over_one_foot_is_inside_both_bases():
    feet = support_sequence(BODY, Plan("one", (("parallel", 1), ("single_left", 1))))[1]
    normals, offsets = feet.reduced(0.6)
    assert (normals @ feet.centre + offsets).min() > 0
    for base in (feet.on(0, 1), feet.on(1)):
        inner, offset = base.reduced(0.6)
        assert (inner @ feet.centre + offset).min() > 0


def test_the_order_is_shorter_than_any_single_exchange():
    x = np.random.default_rng(0).normal(size=(9, 29))
    order = nearest_neighbours(x, [[0, 1, 2, 3], [4, 5, 6, 7, 8]])
    assert sorted(order[:4]) == [0, 1, 2, 3]
    assert sorted(order) == list(range(9))
    line = np.zeros((6, 29))
    line[:, 10] = [0.3, 0.1, 0.5, 0.0, 0.4, 0.2]
    assert list(np.diff(line[nearest_neighbours(line, [list(range(6))]), 10])) == pytest.approx([0.1] * 5) or list(
        np.diff(line[nearest_neighbours(line, [list(range(6))]), 10])
    ) == pytest.approx([-0.1] * 5)


def test_the_support_of_both_feet_is_wider_than_of_one():
    feet = stance(BODY, "parallel")
    assert np.ptp(feet.support[:, 1]) > 2 * np.ptp(feet.on(0).support[:, 1])
