"""Mending a dance where imprecise performers have too little room.

All performers dance it (`performers`). Where one of them comes too near a limit, another way to that posture is taken,
another posture in its place or before it, or it is left out. The same people dance the mended place again, before it is
taken; as everybody dances the rest as before, mending one place spoils no other.
"""

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.followable.plain import other_ways
from biodance.dance.followable.reach import DanceStep, name_of
from biodance.dance.followable.walk import Walk, walked_dance
from biodance.dance.performers import PERFORMER_COUNT, Rehearsed, perform_with
from biodance.dance.transitions.move import Move

_ROUNDS = 6
"""Times that all performers dance the whole dance at most."""
_OTHERS = 6
"""Postures that are tried in the place of one."""
_FEW = 40
"""Performers of a first look."""


@dataclass(frozen=True, eq=False)
class Walked:
    """The ``steps`` of a dance and the ``moves`` between them; ``left_out`` sentences about postures that are."""

    steps: tuple[DanceStep, ...]
    moves: tuple[Move, ...]
    left_out: tuple[str, ...] = ()

    def dance(self, walk: Walk) -> Dance:
        """Return the dance."""
        return replace(walked_dance(walk.work, [*self.steps], [*self.moves]), notes=self.left_out)


def mended_dance(walk: Walk, steps: list[DanceStep], moves: list[Move], workers: Executor) -> tuple[Dance, Rehearsed]:
    """Return the dance of a walk as all performers can dance it, and what they leave of the limits; if it could not be
    mended, as well as it could be.
    """
    course, limits, tell = Walked(tuple(steps), tuple(moves)), walk.work.plan.limits, walk.work.tell
    for number in range(_ROUNDS):
        tell("performers", number, 0)
        dance = course.dance(walk)
        found = perform_with(workers, dance, limits)
        mended = course
        for p in sorted({p for p, _ in found.bad}, reverse=True):  # what is left out moves no earlier place
            mended = _mended_at(walk, mended, p, found, workers)
        if found.safe or mended is course:
            break
        course = mended
    return dance, found


def _mended_at(walk: Walk, course: Walked, p: int, found: Rehearsed, workers: Executor) -> Walked:
    """Return the course with another way to posture ``p`` or another posture there that is safe or nearest to it."""
    best, least = course, _room(walk, course, (p,), found.failed, workers)
    for other, only in _others(walk, course, p, found):
        room = _room(walk, other, only, found.failed, workers)
        if room >= 0:
            return other
        if room > least:
            best, least = other, room
    return best


def _room(walk: Walk, course: Walked, only: tuple[int, ...], first: tuple[int, ...], workers: Executor) -> float:
    """Return how far the worst performer stays from what is demanded to and in the postures ``only``, in scales of the
    limits; those who came too near before dance ``first``, the others only if these have room.
    """
    limits, dance, room = walk.work.plan.limits, course.dance(walk), np.inf
    scale = {limit.name: limit.scale for limit in limits}
    others = tuple(k for k in range(PERFORMER_COUNT) if k not in first)
    for who in (first, others[:_FEW], others[_FEW:]):
        found = perform_with(workers, dance, limits, who=who, only=only)
        room = min(room, *((one.worst - one.least) / scale[one.limit] for one in found.least_margins))
        if room < 0:
            break
    return room


def _others(walk: Walk, course: Walked, p: int, found: Rehearsed) -> Iterator[tuple[Walked, tuple[int, ...]]]:
    """Yield what else may be done at posture ``p`` or just before, what changes least first, and the postures where it
    differs: another way of the same time, another posture, a slower way, another posture before, none at all.
    """
    ways = [((one, (p,)) for one in _on_other_ways(walk, course, p, slower=slow)) for slow in (False, True)]
    here, before = (islice(_exchanged(walk, course, q), _OTHERS) if q >= 0 else () for q in (p, p - 1))
    last = min(p + 1, len(course.steps) - 1)
    yield from ways[0]
    yield from ((one, tuple(range(p, last + 1))) for one in here)
    yield from ways[1]
    yield from ((one, (p - 1, p)) for one in before)
    without = _without(walk, course, p, found)
    if without is not None:
        yield without, (p,)


def _on_other_ways(walk: Walk, course: Walked, p: int, *, slower: bool) -> Iterator[Walked]:
    """Yield courses that go to posture ``p`` on another way."""
    steps, moves = course.steps, course.moves
    for move in other_ways(walk.task(steps[p - 1], steps[p]), moves[p - 1], slower=slower) if p else ():
        yield replace(course, moves=(*moves[: p - 1], move, *moves[p:]))


def _exchanged(walk: Walk, course: Walked, q: int) -> Iterator[Walked]:
    """Yield courses with another posture in place ``q``, the best first."""
    steps, moves = course.steps, course.moves
    before, after = [*steps[:q]], steps[q + 1] if q + 1 < len(steps) else None
    stances, posterior = tuple(step.catalogue.stance for step in steps), walk.information.beforehand
    for number, step in enumerate(before):
        posterior = walk.posterior_after(posterior, before[:number], step)
    taken = {step.key for step in steps}

    def on_from(step: DanceStep) -> DanceStep | None:
        return None if after is None else walk.reach.link(step, after.catalogue, after.s)

    def fits(step: DanceStep) -> bool:
        return step.key not in taken and (after is None or on_from(step) is not None)

    for step, move in walk.possible(before, stances, posterior, {}, wanted=fits):
        to, on = () if move is None else (move,), on_from(step)
        if on is None:
            yield replace(course, steps=(*before, step), moves=(*moves[: q - 1], *to))
        elif not (way := walk.move(step, on)).limit:
            way_on = (*to, way, *moves[q + 1 :])
            yield replace(course, steps=(*before, step, on, *steps[q + 2 :]), moves=(*moves[: max(0, q - 1)], *way_on))


def _without(walk: Walk, course: Walked, p: int, found: Rehearsed) -> Walked | None:
    """Return the course without posture ``p``, None where its neighbours need it."""
    steps, moves = course.steps, course.moves
    if not 0 < p < len(steps) - 1 or steps[p].catalogue.stance.over is not None:
        return None
    on = walk.reach.link(steps[p - 1], steps[p + 1].catalogue, steps[p + 1].s)
    if on is None or (way := walk.move(steps[p - 1], on)).limit:
        return None
    limits = " and ".join(limit.replace("_", " ") for at, limit in found.bad if at == p)
    words = f"Left out: {name_of(steps[p])}; whoever copies it imprecisely comes too near the limit on {limits}."
    return Walked((*steps[:p], on, *steps[p + 2 :]), (*moves[: p - 1], way, *moves[p + 1 :]), (*course.left_out, words))
