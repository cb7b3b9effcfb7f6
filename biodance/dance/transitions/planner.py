"""From each posture to the next, by all means: at once, slower, or by way of a comfortable posture in between.

The ways between all postures of a course are found side by side in chains of those that excite the same segments. A way's random numbers
and the information before it do not depend on who was faster, so that any order of finishing gives the same dance.
"""

from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.postures.ordering import under
from biodance.dance.postures.posture import intermediate_posture
from biodance.dance.problem.plan import Plan
from biodance.dance.transitions.context import Course, DesignContext
from biodance.dance.transitions.move import Move, Task, find_move
from biodance.dance.verify import verify
from biodance.errors import BiodanceError
from biodance.records import Array

SLOWER = (1.0, 1.4)
"""Factors on the duration of a move, one after the other."""
DETOURS = 2
"""Postures in between that are tried."""
SPARE = 0.5
"""Share of what a limit's check forgives (`Limit.rounding`) that a way leaves, because the check of the whole dance sees other instants of
the same way."""


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


def find_way(task: Task, plan: Plan, history: Array, seed: list[int]) -> Way:
    """Return a way that keeps all limits, by the design's own judgement and by `verify`; if there is none, the direct one that was tried
    last, with the limit it breaks.
    """
    for factor in SLOWER:
        move = find_move(replace(task, duration=task.duration * factor), history, rng=np.random.default_rng(seed))
        way = _way([move], task.ends[:0])
        wrong = move.limit or _doubted(task, plan, way)
        if not wrong:
            return way
    for attempt in range(DETOURS):
        try:
            stop = intermediate_posture(task.chain, task.stance, task.ends, task.limits, seed=[*seed, attempt]).x
        except BiodanceError:
            continue
        parts = _through(task, history, stop, [*seed, attempt])
        if parts and not _doubted(task, plan, detour := _way(parts, stop[None])):
            return detour
    return replace(way, limit=wrong)


def _doubted(task: Task, plan: Plan, way: Way) -> str:
    """Return the limit that the way breaks by the independent check, "" if it breaks none."""
    rows = np.array([task.ends[0], *way.stops, task.ends[1]])
    feet, body = (task.stance,) * len(rows), task.chain.body
    margins = verify(body, Dance("way", body, rows, feet, np.zeros(len(rows)), way.via, way.duration, feet[1:], 0), plan)
    spare = {limit.name: SPARE * limit.rounding for limit in plan.limits}
    wrong = [margin.limit for margin in margins if not margin.worst >= spare.get(margin.limit, 0.0)]
    return wrong[0] if wrong else ""


def _through(task: Task, history: Array, stop: Array, seed: list[int]) -> list[Move]:
    """Return the two moves by way of ``stop`` (n,), slow ones since the direct way was impossible even so, none if one is not possible."""
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


def schedule(work: DesignContext, course: Course, known: Mapping[int, Way], attempt: int = 0) -> list[Way]:
    """Return the ways from each posture of ``course`` to the next: those ``known`` by their place, the others found now.

    ``attempt`` numbers the courses of one design. A way that breaks a limit says so (``Way.limit``); those after it are found all the same.
    """
    return _Search(work, course, known, attempt).run()


class _Search:
    """The open moves in one queue for each set of planted feet, and what was found."""

    def __init__(self, work: DesignContext, course: Course, known: Mapping[int, Way], attempt: int) -> None:
        chain, ends = work.chain, list(pairwise(course.x))
        feet = [under(first, second) for first, second in pairwise(course.stances)]
        self.work, self.attempt, self.found = work, attempt, dict(known)
        self.tasks = [Task(chain, work.blocks, f, np.array(e), work.plan.move, work.plan.limits) for f, e in zip(feet, ends, strict=True)]
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
                self.work.ledger.put(
                    self._name(k), via=way.via, duration=way.duration, stops=way.stops, gram=way.gram, limit=np.array(way.limit)
                )
                self._accept(k, way)
                self._advance(self.tasks[k].stance.planted, running)
        return [self.found[k] for k in range(len(self.tasks))]

    def _advance(self, planted: tuple[int, ...], running: dict[Future[Way], int]) -> None:
        """Take up what is kept of this chain, then submit the next of its moves."""
        work, queue = self.work, self.queue[planted]
        while queue:
            k = queue[0]
            kept = work.ledger.get(self._name(k))
            if kept is None:
                seed = [work.seed, 3, k, *([self.attempt] if self.attempt else [])]
                running[work.workers.submit(find_way, self.tasks[k], work.plan, self.history[planted], seed)] = k
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
