"""Moves that people can follow: straight from one posture to the next, slower where the straight way breaks a limit,
and at last with the pelvis and a lifted leg going round.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from biodance.dance.problem.chain import ROOT
from biodance.dance.transitions.move import GRID, RESERVE, Move, MoveObjective, Task, evaluate_move, improved_way
from biodance.records import Array

_SLOWER = (1.0, 1.4, 1.8)
"""Factors on the duration of a straight move, one after the other."""
ENOUGH, AMPLE = 3.2, 4.0
"""Deviations of imprecise people that a posture or a move must leave, and that it leaves where there is a choice."""
_ITERATIONS = (12, 8)
_STOP = 0.08
"""rad that a lifted leg keeps from the stops of its joints."""
_STEPS = ((0.5, -0.1, 0.0, 0.55, 0.0, 0.0), (0.5, -0.2, 0.0, 0.55, 0.0, 0.0), (0.8, -0.2, 0.0, 0.9, 0.0, 0.0))
"""rad by which hip, knee and ankle of a leg bend on the way of a lifted foot, and it goes away from the other one."""


def plain_move(task: Task, room: Callable[[Move], tuple[float, str]]) -> tuple[Move, float]:
    """Return the move of ``task`` in which nothing goes out of its way that need not, and by how many deviations
    imprecise people keep its limits (``room``, and of which limit); if none keeps all limits, the one that violates
    least.
    """
    tried, eased = [], {limit.name for limit in task.limits if limit.mended_by_slowness}
    for factor in _SLOWER:
        slow = replace(task, duration=factor * task.duration)
        tried.append(_roomiest((evaluate_move(slow, way)[0] for way in _shapes(slow)), room))
        if tried[-1][0].violation == 0 or tried[-1][0].limit not in eased:
            break
    best = min(tried, key=lambda one: one[0].violation)
    if best[0].violation == 0 or task.stance.seat:
        return best
    return _roomiest([_round(replace(task, duration=best[0].duration), best[0])], room)


def other_ways(task: Task, last: Move, *, slower: bool) -> Iterator[Move]:
    """Yield moves of ``task`` that keep all limits and differ from the ``last`` one, which takes as long, or less where
    they are to be ``slower``.
    """
    for factor in (factor for factor in _SLOWER if (factor * task.duration > last.duration + 1e-9) == slower):
        slow = replace(task, duration=factor * task.duration)
        for via in _shapes(slow):
            move = evaluate_move(slow, via)[0]
            if not move.limit and (slower or not np.allclose(via, last.via)):
                yield move


def _shapes(task: Task) -> list[Array]:
    """Return the ways (2, n) that are tried: straight on, on one leg also by steps that are higher or wider."""
    steps = _STEPS if len(task.stance.planted) == 1 else ()
    return [task.straight(), *(_stepping(task, step) for step in steps)]


def _roomiest(moves: Iterable[Move], room: Callable[[Move], tuple[float, str]]) -> tuple[Move, float]:
    """Return the first move that keeps all limits and leaves imprecise people `AMPLE` deviations, or else the one that
    leaves them most, with the limit of which it is too little, and how many; if none keeps all limits, the one that
    violates least.
    """
    tried, best, most = list[Move](), None, -np.inf
    for move in moves:
        tried.append(move)
        if not move.limit:
            found, limit = room(move)
            if best is None or found > most:
                best, most = replace(move, limit=limit if found < ENOUGH else ""), found
            if found > AMPLE:
                break
    return (best, most) if best is not None else (min(tried, key=lambda move: move.violation), -np.inf)


def _stepping(task: Task, step: tuple[float, ...]) -> Array:
    """Return the via points (2, n) of a straight move on which the free leg takes the ``step`` within its ranges."""
    via, limits = task.straight(), task.chain.body.limits
    for side in {0, 1} - set(task.stance.planted):
        columns = np.array(task.chain.leg_columns[side])
        low, high = limits.lower[columns - ROOT] + _STOP, limits.upper[columns - ROOT] - _STOP
        via[:, columns] = np.clip(via[:, columns] + step, np.minimum(low, via[:, columns]), high)
    return via


def _round(task: Task, best: Move) -> Move:
    """Return a move in which the pelvis and a lifted leg avoid what the straight one breaks."""
    up = [c for side in (0, 1) if side not in task.stance.planted for c in task.chain.leg_columns[side]]
    objective = MoveObjective(task, np.zeros((len(task.chain.body.segments), 6, 6)), 0.0)
    via, time = best.via, task.grid(GRID)
    for k, iterations in enumerate(_ITERATIONS):
        via, _ = improved_way(task, via, time, objective, iterations, RESERVE * (1 + k / 4), free=[*range(ROOT), *up])
        found, worst = evaluate_move(task, via)
        best = min(best, found, key=lambda move: move.violation)
        if best.violation == 0:
            break
        time = np.union1d(time, worst)
    return best
