"""The ways between all postures of a dance: at once, slower, or by way of a comfortable posture in between; and what is
done where a move cannot be made.

They are found side by side in chains of those that excite the same segments. A way's random numbers and the information
before it do not depend on who was faster, so that any order of finishing gives the same dance. Where a move cannot be
made another posture takes the place of one of its ends, then one posture is left out; a refusal only at last.
"""

from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.postures.exchange import alike, criterion
from biodance.dance.postures.posture import KEPT, Exciting, initial_guess, intermediate_posture, posture_at, solve
from biodance.dance.problem.excitation import static_grams
from biodance.dance.problem.stance import stance_words, under
from biodance.dance.transitions.context import Course, DesignContext
from biodance.dance.transitions.move import Move, Task, find_move
from biodance.dance.verify import verify
from biodance.errors import BiodanceError
from biodance.records import Array

SLOWER = (1.0, 1.4)
"""Factors on the duration of a move, one after the other."""
DETOURS = 2
"""Postures in between that are tried."""
_SPARE = 0.5
"""Share of what a limit's check forgives (`Limit.rounding`) that a way leaves, because the check of the whole dance
sees other instants of the same way.
"""


@dataclass(frozen=True, eq=False)
class Way:
    """One or two moves: ``via`` (M, 2, n) points, ``duration`` (M,) s, ``stops`` (M - 1, n) the posture in between;
    ``gram`` (N, 6, 6) information on the inertias; ``limit`` that is broken all the same, "" if none.
    """

    via: Array
    duration: Array
    stops: Array
    gram: Array
    limit: str = ""


def find_way(task: Task, history: Array, seed: list[int]) -> Way:
    """Return a way that keeps all limits, by the design's own judgement and by `verify`; if there is none, the direct
    one that was tried last, with the limit it breaks.
    """
    for factor in SLOWER:
        move = find_move(replace(task, duration=task.duration * factor), history, rng=np.random.default_rng(seed))
        way = _way([move], task.ends[:0])
        wrong = move.limit or _doubted(task, way)
        if not wrong:
            return way
    for attempt in range(DETOURS):
        try:
            stop = intermediate_posture(task.chain, task.stance, task.ends, task.limits, seed=[*seed, attempt]).x
        except BiodanceError:
            continue
        parts = _through(task, history, stop, [*seed, attempt])
        if parts and not _doubted(task, detour := _way(parts, stop[None])):
            return detour
    return replace(way, limit=wrong)


def _doubted(task: Task, way: Way) -> str:
    """Return the limit that the way breaks by the independent check, "" if it breaks none."""
    rows = np.array([task.ends[0], *way.stops, task.ends[1]])
    feet, body = (task.stance,) * len(rows), task.chain.body
    margins = verify(
        body, Dance("way", body, rows, feet, np.zeros(len(rows)), way.via, way.duration, feet[1:], 0), task.limits
    )
    spare = {limit.name: _SPARE * limit.rounding for limit in task.limits}
    wrong = [margin.limit for margin in margins if not margin.worst >= spare.get(margin.limit, 0.0)]
    return wrong[0] if wrong else ""


def _through(task: Task, history: Array, stop: Array, seed: list[int]) -> list[Move]:
    """Return the two moves by way of ``stop`` (n,), slow ones as the direct way was impossible; none if one fails."""
    parts: list[Move] = []
    for ends in ((task.ends[0], stop), (stop, task.ends[1])):
        slow = replace(task, ends=np.array(ends), duration=task.duration * SLOWER[-1])
        move = find_move(slow, history, rng=np.random.default_rng(seed))
        if move.violation > 0:
            return []
        parts.append(move)
        history = history + move.gram
    return parts


def _way(moves: list[Move], stops: Array) -> Way:
    gram = np.sum([move.gram for move in moves], axis=0)
    return Way(np.array([move.via for move in moves]), np.array([move.duration for move in moves]), stops, gram)


_ENDS = (1, 0, 1)
"""Which end of a move that cannot be made is exchanged: where it goes to, comes from, the new one where it goes to."""
REST = (0.0, 0.6, 0.15)
"""Share of their neighbours' joint angles that postures in between keep in these attempts."""
STARTS, _SHARPNESS, _ITERATIONS = 6, 8, 20
"""Of the search for another posture: starts, sharpness of the condition number, iterations."""
FEWER = 4
"""Postures that may be left out, one after the other, as long as half of those on the same feet are left."""


def schedule(work: DesignContext, course: Course, known: Mapping[int, Way], attempt: int = 0) -> list[Way]:
    """Return the ways from each posture of ``course`` to the next: those ``known`` by their place, the others found
    now.

    ``attempt`` numbers the courses of one design. A way that breaks a limit says so (``Way.limit``); those after it are
    found all the same.
    """
    return _Search(work, course, known, attempt).run()


class _Search:
    """The open moves in one queue for each set of planted feet, and what was found."""

    def __init__(self, work: DesignContext, course: Course, known: Mapping[int, Way], attempt: int) -> None:
        chain, ends = work.chain, list(pairwise(course.x))
        feet = [under(first, second) for first, second in pairwise(course.stances)]
        self.work, self.attempt, self.found = work, attempt, dict(known)
        self.tasks = [
            Task(chain, work.blocks, f, np.array(e), work.plan.move, work.plan.limits)
            for f, e in zip(feet, ends, strict=True)
        ]
        nothing = np.zeros((len(chain.body.segments), 6, 6))
        self.queue: dict[tuple[int, ...], list[int]] = {task.stance.planted: [] for task in self.tasks}
        self.history: dict[tuple[int, ...], Array] = dict.fromkeys(self.queue, nothing)
        for k, task in enumerate(self.tasks):
            if k in known:
                self.history[task.stance.planted] = self.history[task.stance.planted] + known[k].gram
            else:
                self.queue[task.stance.planted].append(k)

    def run(self) -> list[Way]:
        """Return all ways in the order of the course."""
        running: dict[Future[Way], int] = {}
        for planted in self.queue:
            self._advance(planted, running)
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                k, way = running.pop(future), future.result()
                arrays = {one: np.array(getattr(way, one)) for one in ("via", "duration", "stops", "gram", "limit")}
                self.work.checkpoint.put(self._name(k), **arrays)
                self._accept(k, way)
                self._advance(self.tasks[k].stance.planted, running)
        return [self.found[k] for k in range(len(self.tasks))]

    def _advance(self, planted: tuple[int, ...], running: dict[Future[Way], int]) -> None:
        """Take up what is kept of this chain, then submit the next of its moves."""
        work, queue = self.work, self.queue[planted]
        while queue:
            k = queue[0]
            kept = work.checkpoint.get(self._name(k))
            if kept is None:
                seed = [work.seed, 3, k, *([self.attempt] if self.attempt else [])]
                running[work.workers.submit(find_way, self.tasks[k], self.history[planted], seed)] = k
                return
            self._accept(k, Way(kept["via"], kept["duration"], kept["stops"], kept["gram"], str(kept["limit"])))

    def _accept(self, k: int, way: Way) -> None:
        planted = self.tasks[k].stance.planted
        self.queue[planted].remove(k)
        self.found[k] = way
        if not way.limit:
            self.history[planted] = self.history[planted] + way.gram
        self.work.tell("moves", len(self.found), len(self.tasks))

    def _name(self, k: int) -> str:
        return f"move_{self.attempt}_{k:03d}"


def replan(work: DesignContext, course: Course) -> tuple[Course, list[Way], tuple[str, ...]]:
    """Return a course all of whose ways keep the limits, these ways, and in plain sentences what differs from
    ``course``.

    Raises
    ------
    BiodanceError
        A move cannot be made whatever postures it joins; the message names it and the limit it breaks.
    """
    found, notes, first = schedule(work, course, {}), list[str](), course
    for attempt in range(1, len(_ENDS) + FEWER + 1):
        bad = [k for k, way in enumerate(found) if way.limit]
        if not bad:
            break
        if attempt <= len(_ENDS):
            places = sorted({k + _ENDS[attempt - 1] for k in bad})
            course, known = (
                _exchanged(work, course, places, attempt),
                {k: w for k, w in enumerate(found) if not {k, k + 1} & {*places}},
            )
            notes += [_said(course, place, "exchanged for another one", _limit(found, place)) for place in places]
        else:
            place = _spare(course, bad[0], found[bad[0]], first)
            notes.append(_said(course, place, "left out", found[bad[0]].limit))
            course, known = (
                _without(course, place),
                {k - (k >= place): w for k, w in enumerate(found) if k not in (place - 1, place)},
            )
        found = schedule(work, course, {k: w for k, w in known.items() if not w.limit}, attempt)
    for k, way in enumerate(found):
        if way.limit:
            raise BiodanceError(_impossible(course, k, way))
    return course, found, tuple(notes)


def _exchanged(work: DesignContext, course: Course, places: list[int], attempt: int) -> Course:
    """Return the course with other postures at ``places``."""
    for place in places:
        x = course.x.copy()
        if course.stances[place].over is None:
            x[place] = _another(work, course, place, np.random.default_rng([work.seed, 4, attempt, place]))
        else:
            near, seed = x[[k for k in (place - 1, place + 1) if 0 <= k < len(x)]], [work.seed, 5, attempt, place]
            x[place] = intermediate_posture(
                work.chain, course.stances[place], near, work.plan.limits, seed=seed, mild=REST[attempt - 1]
            ).x
        course = replace(course, x=x)
    return course


def _another(work: DesignContext, course: Course, place: int, rng: np.random.Generator) -> Array:
    """Return the most exciting posture (n,) beside all others from a few fresh starts, or the old one."""
    chain, blocks, stance = work.chain, work.blocks, course.stances[place]
    places = [k for k, one in enumerate(course.stances) if one.over is None and k != place]
    others = [posture_at(chain, course.stances[k], course.x[k]) for k in places]
    grams = static_grams(np.array([p.up for p in others]).reshape(-1, len(chain.body.segments), 3))
    objective = Exciting(blocks, grams, 0.1 * float(blocks.weight.sum()) / (len(others) + 1), _SHARPNESS)
    starts = [initial_guess(chain, stance, rng) for _ in range(STARTS)]
    given = objective, work.plan.limits
    tasks = [work.workers.submit(solve, chain, stance, one, *given, iterations=_ITERATIONS) for one in starts]
    found = [task.result() for task in tasks]
    same = [x for k, x in enumerate(course.x) if course.stances[k].name == stance.name and k != place]
    kept = [p for p in found if p.violation <= KEPT and not alike(np.array([p.x, *same]))[0, 1:].any()]
    return min(kept, key=lambda posture: criterion(blocks, [*others, posture])).x if kept else course.x[place]


def _spare(course: Course, k: int, way: Way, first: Course) -> int:
    """Return the end of move ``k`` that can be left out: a posture that counts, of a kind of which half is left of the
    ``first`` course.
    """
    now, before = ([stance.name for stance in one.stances if stance.over is None] for one in (course, first))
    for place in (k + 1, k):
        stance = course.stances[place]
        if stance.over is None and 2 * (now.count(stance.name) - 1) >= before.count(stance.name):
            return place
    raise BiodanceError(_impossible(course, k, way))


def _without(course: Course, place: int) -> Course:
    return Course(np.delete(course.x, place, axis=0), course.stances[:place] + course.stances[place + 1 :])


def _limit(found: list[Way], place: int) -> str:
    """Return the limit that a way to or from ``place`` breaks."""
    return next(found[k].limit for k in (place - 1, place) if 0 <= k < len(found) and found[k].limit)


def _said(course: Course, place: int, what: str, limit: str) -> str:
    number = sum(stance.over is None for stance in course.stances[: place + 1])
    stance, limit = course.stances[place], limit.replace("_", " ")
    which = (
        f"Posture {number} ({stance_words(stance)})"
        if stance.over is None
        else f"The posture in between after posture {number}"
    )
    return f"{which} was {what}: a move to or from it would have exceeded the limit on {limit}."


def _impossible(course: Course, k: int, way: Way) -> str:
    feet = f"{course.stances[k].name} to {course.stances[k + 1].name}"
    return (
        f"The move from posture {k + 1} to {k + 2} of {len(course.stances)} ({feet}) cannot be "
        f"made: {way.limit.replace('_', ' ')} is exceeded even slowly, by way of a posture in between, and with other "
        "postures at its ends. Leave these feet out of the protocol, or widen that limit."
    )
