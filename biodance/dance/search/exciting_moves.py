"""The moves of a course that excite the inertias, found side by side.

Moves that excite the same segments follow each other, as each is judged beside the information of those before it; all
others do not wait. A move's random numbers and the information before it do not depend on who was faster, so that any
order of finishing gives the same dance.
"""

from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import replace
from itertools import pairwise

import numpy as np

from biodance.dance.search.context import DesignContext
from biodance.dance.search.course import Course, PlainStep, move_task
from biodance.dance.search.move import Move, exciting_move
from biodance.records import Array

_KEPT = ("via", "duration", "gram", "violation", "limit", "stops")
"""What a checkpoint keeps of a move."""


def with_exciting_moves(work: DesignContext, course: Course[PlainStep], attempt: int = 0) -> Course[PlainStep]:
    """Return the course with those moves found that it lacks; ``attempt`` numbers the courses of one design. A move
    that breaks a limit says so (``Move.limit``); those after it are found all the same.
    """
    return replace(course, moves=_Chains(work, course, attempt).found())


class _Chains:
    """The open moves in one queue for each set of planted feet, and the information of those that are found."""

    def __init__(self, work: DesignContext, course: Course[PlainStep], attempt: int) -> None:
        self.work, self.attempt, self.moves = work, attempt, [*course.moves]
        self.tasks = [move_task(work, *pair) for pair in pairwise(course.steps)]
        nothing = np.zeros((len(work.chain.body.segments), 6, 6))
        self.queue: dict[tuple[int, ...], list[int]] = {task.stance.planted: [] for task in self.tasks}
        self.history: dict[tuple[int, ...], Array] = dict.fromkeys(self.queue, nothing)
        for k, (task, move) in enumerate(zip(self.tasks, self.moves, strict=True)):
            if move is None:
                self.queue[task.stance.planted].append(k)
            else:
                self.history[task.stance.planted] = self.history[task.stance.planted] + move.gram

    def found(self) -> tuple[Move | None, ...]:
        """Return all moves in the order of the course."""
        running: dict[Future[Move], int] = {}
        for planted in self.queue:
            self._advance(planted, running)
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                k, move = running.pop(future), future.result()
                self.work.checkpoint.put(self._name(k), **{one: np.array(getattr(move, one)) for one in _KEPT})
                self._accept(k, move)
                self._advance(self.tasks[k].stance.planted, running)
        return tuple(self.moves)

    def _advance(self, planted: tuple[int, ...], running: dict[Future[Move], int]) -> None:
        """Take up what is kept of this chain, then submit the next of its moves."""
        work, queue = self.work, self.queue[planted]
        while queue:
            k = queue[0]
            kept = work.checkpoint.get(self._name(k))
            if kept is None:
                seed = [work.seed, 3, k, *([self.attempt] if self.attempt else [])]
                running[work.workers.submit(exciting_move, self.tasks[k], self.history[planted], seed)] = k
                return
            via, duration, gram, violation, limit, stops = (kept[name] for name in _KEPT)
            self._accept(k, Move(via, duration, gram, float(violation), str(limit), stops))

    def _accept(self, k: int, move: Move) -> None:
        planted = self.tasks[k].stance.planted
        self.queue[planted].remove(k)
        self.moves[k] = move
        if not move.limit:
            self.history[planted] = self.history[planted] + move.gram
        self.work.tell("moves", sum(move is not None for move in self.moves), len(self.tasks))

    def _name(self, k: int) -> str:
        return f"move_{self.attempt}_{k:03d}"
