"""What is danced while it is still designed: postures in order and the moves between them."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Generic, Protocol, TypeVar

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.stance import Stance, feet_in_move
from biodance.dance.search.context import DesignContext
from biodance.dance.search.move import Move, Task
from biodance.records import Array


class DanceStep(Protocol):
    """One posture of a course."""

    @property
    def x(self) -> Array:
        """(n,) coordinates of the chain."""

    @property
    def stance(self) -> Stance:
        """The feet on which it is held."""

    @property
    def name(self) -> str:
        """What people call it; "" where they have no words for it."""

    @property
    def mirror(self) -> bool:
        """Whether it is the posture before it with right and left exchanged."""


@dataclass(frozen=True, eq=False)
class PlainStep:
    """A `DanceStep` for which there are no words."""

    x: Array
    stance: Stance
    name: str = ""
    mirror: bool = False


S = TypeVar("S", bound=DanceStep)


@dataclass(frozen=True, eq=False)
class Course(Generic[S]):
    """The ``steps`` (P) of a dance, those in between included, the ``moves`` (P - 1) between them, None where they are
    not found yet, and in sentences what differs from the plan.
    """

    steps: tuple[S, ...]
    moves: tuple[Move | None, ...]
    notes: tuple[str, ...] = ()

    @property
    def x(self) -> Array:
        """(P, n) coordinates."""
        return np.array([step.x for step in self.steps])

    @property
    def stances(self) -> tuple[Stance, ...]:
        """(P,) feet."""
        return tuple(step.stance for step in self.steps)

    def spliced(
        self, first: int, last: int, steps: tuple[S, ...], moves: tuple[Move | None, ...] | None = None
    ) -> "Course[S]":
        """Return the course with ``steps`` in place of those from ``first`` up to ``last`` (not included), and with the
        ``moves`` to, between and from them; without these they are yet to be found.
        """
        every = (*self.steps[:first], *steps, *self.steps[last:])
        before, after = self.moves[: max(0, first - 1)], self.moves[last:]
        if moves is None:
            moves = (None,) * (len(every) - 1 - len(before) - len(after))
        return replace(self, steps=every, moves=(*before, *moves, *after))

    def dance(self, work: DesignContext) -> Dance:
        """Return the dance; stops on the way are not held."""
        plan, start = work.plan, self.steps[0]
        rows, stances, hold, feet = [start.x], [start.stance], [plan.hold_on(start.stance)], list[Stance]()
        via, seconds = [np.empty((0, 2, start.x.size))], [np.empty(0)]
        for (before, after), move in zip(pairwise(self.steps), self.moves, strict=True):
            assert move is not None
            ground, stops = feet_in_move(before.stance, after.stance), len(move.stops)
            rows += [*move.stops, after.x]
            stances += [*[ground] * stops, after.stance]
            hold += [*[0.0] * stops, plan.hold_on(after.stance)]
            feet += [ground] * len(move.via)
            via.append(move.via)
            seconds.append(move.duration)
        names = tuple(step.name for step in self.steps)
        return Dance(
            plan.name,
            work.chain.body,
            np.array(rows),
            tuple(stances),
            np.array(hold),
            np.concatenate(via),
            np.concatenate(seconds),
            tuple(feet),
            work.seed,
            self.notes,
            names=names if all(names) else (),
            mirrored=tuple(p for p, step in enumerate(self.steps) if step.mirror),
        )


def move_task(work: DesignContext, before: DanceStep, after: DanceStep, *, slower: float = 1.0) -> Task:
    """Return what the move between two steps must do, ``slower`` times as long as the plan's."""
    feet, ends = feet_in_move(before.stance, after.stance), np.array([before.x, after.x])
    return Task(work.chain, work.blocks, feet, ends, slower * work.plan.move, work.plan.limits)
