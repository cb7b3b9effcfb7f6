"""The ways between all postures of a course, found side by side in chains of those that excite the same segments.

A way's random numbers and the information before it do not depend on who was faster, so that any order of finishing gives the same dance.
"""

from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import pairwise

import numpy as np

from biodance.dance.sequence import under
from biodance.dance.transitions import Task
from biodance.dance.ways import Way, find_way
from biodance.dance.work import Course, Work
from biodance.records import Array


def ways(work: Work, course: Course, known: Mapping[int, Way], attempt: int = 0) -> list[Way]:
    """Return the ways from each posture of ``course`` to the next: those ``known`` by their place, the others found now.

    ``attempt`` numbers the courses of one design. A way that breaks a limit says so (``Way.limit``); those after it are found all the same.
    """
    return _Search(work, course, known, attempt).run()


class _Search:
    """The open moves in one queue for each set of planted feet, and what was found."""

    def __init__(self, work: Work, course: Course, known: Mapping[int, Way], attempt: int) -> None:
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
