"""A dance of optimised postures, as in the paper: the most exciting set of postures, in an order in which each goes to
one that is near, so that moves are short and balanced, and the most exciting moves between them.

Where a move cannot be made another posture takes the place of one of its ends, then one posture is left out; a refusal
only at last.
"""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from biodance.dance.expectation import PostureInformation, standing_regressors, update_posterior
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import static_grams
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.search import postures
from biodance.dance.search.course import Course, DanceStep, DesignContext, with_exciting_moves
from biodance.dance.search.known_postures import PostureTable
from biodance.errors import BiodanceError
from biodance.records import Array

_ENDS = (1, 0, 1)
"""Which end of a move that cannot be made is exchanged: where it goes to, comes from, the new one where it goes to."""
_REST = (0.0, 0.6, 0.15)
"""Share of their neighbours' joint angles that postures in between keep in these attempts."""


def optimised_course(work: DesignContext) -> Course:
    """Return the postures and moves of a dance, all of which keep the limits.

    Raises
    ------
    BiodanceError
        There is no posture on some feet, or a move cannot be made whatever postures it joins; the message names the
        limit.
    """
    return feasible_course(work, _postures(work))


def _postures(work: DesignContext) -> Course:
    """Return all postures in the order of the dance, those in between included."""
    plan, chain = work.plan, work.chain
    counted = [s for s in support_sequence(chain.body, plan) if s.over is None]
    kept = work.checkpoint.get("postures")
    if kept is None:
        work.tell("postures", 0, len(counted))
        x = postures.find_postures(
            chain, work.blocks, tuple(counted), plan.limits, seed=work.seed, workers=work.workers
        )
        kept = {"x": x}
        work.checkpoint.put("postures", **kept)
    work.tell("postures", len(counted), len(counted))
    x, names = kept["x"], [s.name for s in counted]
    chosen = range(len(x)) if np.isinf(plan.budget) else affordable(chain, x, tuple(names), plan)
    groups = {name: group for name in dict.fromkeys(names) if (group := [p for p in chosen if names[p] == name])}
    blocks = tuple((name, len(group)) for name, group in groups.items())
    stances = support_sequence(chain.body, replace(plan, blocks=blocks))
    return _with_stops(work, stances, x[nearest_neighbours(x, [*groups.values()])])


def _with_stops(work: DesignContext, stances: tuple[Stance, ...], x: Array) -> Course:
    """Return the course of postures ``x`` on the ``stances`` that count, and of found ones on the others."""
    counted = [k for k, stance in enumerate(stances) if stance.over is None]
    rows = dict(zip(counted, x, strict=True))
    for k in (k for k, stance in enumerate(stances) if stance.over is not None):
        before, after = [p for p in counted if p < k][-1], [p for p in counted if p > k][:1]
        near = np.array([rows[p] for p in (before, *after)])
        seed = [work.seed, 2, k]
        rows[k] = postures.intermediate_posture(work.chain, stances[k], near, work.plan.limits, seed=seed).x
    steps = tuple(DanceStep(PostureTable(work.chain, stance, rows[k][None])) for k, stance in enumerate(stances))
    return Course(steps, (None,) * (len(steps) - 1))


def affordable(chain: Chain, x: Array, feet: tuple[str, ...], plan: Plan) -> list[int]:
    """Return which of the postures ``x`` (P, n), on ``feet`` (P), are danced within the plan's budget: one after the
    other the one that, with the straight way to it from the last one on its feet (at first: from any), tells most.
    """
    information, last = PostureInformation(chain, plan), dict[str, int]()
    still = information.white(standing_regressors(chain, x))
    posterior, picked, spent = information.beforehand, list[int](), 0.0

    def arriving(p: int) -> Array:
        """Rows (m, k) of the way to a posture and of standing in it."""
        other = next((q for q, name in enumerate(feet) if name == feet[p] and q != p), p)
        return np.concatenate([still[p], information.of_ways(x[[last.get(feet[p], other), p]][None])[0]])

    def seconds(p: int) -> float:
        """Feet not used yet cost two moves through postures in between."""
        return plan.move + plan.hold + (2 * plan.move if feet[p] not in last else 0.0)

    rows = {p: arriving(p) for p in range(len(x))}
    while payable := [p for p in sorted(rows) if spent + seconds(p) <= plan.budget]:
        best = max(payable, key=lambda p: float(information.gains(posterior, rows[p])))
        spent += seconds(best)
        posterior = update_posterior(posterior, rows.pop(best))
        last[feet[best]] = best
        picked.append(best)
        rows |= {p: arriving(p) for p in rows if feet[p] == feet[best]}
    return picked


def nearest_neighbours(x: Array, groups: list[list[int]]) -> list[int]:
    """Return the rows of ``x`` (P, n) in an order in which neighbours are near; groups stay together, in turn."""
    scaled = x.copy()
    # Metres and radians in one distance.
    scaled[:, :3] *= 3.0  # rad that a metre of the root counts
    apart = np.linalg.norm(scaled[:, None] - scaled[None], axis=2)
    out: list[int] = []
    # One row more, of zeros: a place at no distance from anywhere.
    apart, nowhere = np.pad(apart, ((0, 1), (0, 1))), len(x)
    for group in groups:
        before = out[-1] if out else nowhere
        starts = [_nearest(apart, before, group)] if out else group
        paths = [_shortened(_greedy(apart, group, first), apart, before) for first in starts]
        out += min(paths, key=lambda path: float(sum(apart[a, b] for a, b in pairwise(path))))
    return out


def _nearest(apart: Array, to: int, places: Iterable[int]) -> int:
    return min(sorted(places), key=lambda p: float(apart[to, p]))


def _greedy(apart: Array, group: list[int], first: int) -> list[int]:
    path = [first]
    while left := set(group) - set(path):
        path.append(_nearest(apart, path[-1], left))
    return path


def _shortened(path: list[int], table: Array, before: int) -> list[int]:
    """Return the path with stretches turned round (2-opt) until none helps; ``before`` is where it comes from, and the
    last row of the ``table`` of distances the place where it goes to.
    """
    ends = [before, *path, len(table) - 1]
    better = True
    while better:
        better = False
        for i in range(1, len(ends) - 1):
            for j in range(i + 1, len(ends) - 1):
                a, b, c, d = ends[i - 1], ends[i], ends[j], ends[j + 1]
                # 2-opt: turning b ... c round exchanges a-b and c-d for a-c and b-d.
                if table[a, c] + table[b, d] < table[a, b] + table[c, d] - 1e-9:
                    ends[i : j + 1] = ends[i : j + 1][::-1]
                    better = True
    return ends[1:-1]


def feasible_course(work: DesignContext, course: Course) -> Course:
    """Return the course with moves that keep all limits, and in sentences what of its postures had to change.

    Raises
    ------
    BiodanceError
        A move cannot be made whatever postures it joins; the message names it and the limit it breaks.
    """
    first, course = course, with_exciting_moves(work, course)
    for attempt in range(1, len(_ENDS) + 4 + 1):  # then up to four postures are left out
        limits = {k: move.limit for k, move in enumerate(course.moves) if move is not None and move.limit}
        if not limits:
            break
        exchange = attempt <= len(_ENDS)
        places = sorted({k + _ENDS[attempt - 1] for k in limits} if exchange else _spare(course, min(limits), first))
        if not places:
            break
        what = "exchanged for another one" if exchange else "left out"
        notes = tuple(_changed(course, place, what, limits) for place in places)
        for place in places:
            other = (_other_step(work, course, place, attempt),) if exchange else ()
            course = course.spliced(place, place + 1, other)
        known = tuple(None if move is None or move.limit else move for move in course.moves)
        course = with_exciting_moves(work, replace(course, moves=known, notes=(*course.notes, *notes)), attempt)
    for k, move in enumerate(course.moves):
        if move is not None and move.limit:
            raise BiodanceError(
                f"The move from posture {k + 1} to {k + 2} of {len(course.stances)} ({course.stances[k].name} to "
                f"{course.stances[k + 1].name}) cannot be made: {move.limit.replace('_', ' ')} is exceeded even "
                "slowly, by way of a posture in between, and with other postures at its ends. Leave these feet out of "
                "the protocol, or widen that limit."
            )
    return course


def _other_step(work: DesignContext, course: Course, place: int, attempt: int) -> DanceStep:
    """Return another posture for a place."""
    stance, limits = course.stances[place], work.plan.limits
    if stance.over is None:
        x = _other_posture(work, course, place, np.random.default_rng([work.seed, 4, attempt, place]))
    else:
        near = np.delete(course.x, place, axis=0)[max(0, place - 1) : place + 1]
        seed, mild = [work.seed, 5, attempt, place], _REST[attempt - 1]
        x = postures.intermediate_posture(work.chain, stance, near, limits, seed=seed, mild=mild).x
    return DanceStep(PostureTable(work.chain, stance, x[None]))


def _other_posture(work: DesignContext, course: Course, place: int, rng: np.random.Generator) -> Array:
    """Return the most exciting posture (n,) beside all others from a few fresh starts, or the old one."""
    chain, blocks, stance = work.chain, work.blocks, course.stances[place]
    counted = [step for k, step in enumerate(course.steps) if step.stance.over is None and k != place]
    others = [postures.posture_at(chain, step.stance, step.x) for step in counted]
    grams = static_grams(np.array([p.up for p in others]).reshape(-1, len(chain.body.segments), 3))
    objective = postures.Exciting(blocks, grams, 0.1 * float(blocks.weight.sum()) / (len(others) + 1), 8)
    starts = [postures.initial_guess(chain, stance, rng) for _ in range(6)]
    given = objective, work.plan.limits
    tasks = [work.workers.submit(postures.solve, chain, stance, one, *given, iterations=20) for one in starts]
    found = [task.result() for task in tasks]
    same = [step.x for k, step in enumerate(course.steps) if step.stance.name == stance.name and k != place]
    kept = [
        p for p in found if p.violation <= postures.KEPT and not postures.alike(np.array([p.x, *same]))[0, 1:].any()
    ]
    return min(kept, key=lambda p: postures.criterion(blocks, [*others, p])).x if kept else course.steps[place].x


def _spare(course: Course, k: int, first: Course) -> set[int]:
    """Return the end of move ``k`` that can be left out, of a kind of which half is left; none without such an end."""
    now, before = ([stance.name for stance in one.stances if stance.over is None] for one in (course, first))
    for place in (k + 1, k):
        stance = course.stances[place]
        if stance.over is None and 2 * (now.count(stance.name) - 1) >= before.count(stance.name):
            return {place}
    return set()


def _changed(course: Course, place: int, what: str, limits: dict[int, str]) -> str:
    """Return in a sentence what became of a posture, and which of the ``limits`` of moves (by index) is the reason."""
    number = sum(stance.over is None for stance in course.stances[: place + 1])
    stance, limit = course.stances[place], next(limits[k] for k in (place - 1, place) if k in limits)
    which = (
        f"Posture {number} ({stance_words(stance)})"
        if stance.over is None
        else f"The posture in between after posture {number}"
    )
    return f"{which} was {what}: a move to or from it would have exceeded the limit on {limit.replace('_', ' ')}."
