"""Moves that people can follow: straight from one posture to the next, slower where the straight way breaks a limit,
and at last with the pelvis and a lifted leg going round.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from biodance.dance.problem.chain import ROOT
from biodance.dance.transitions.move import GRID, RESERVE, Move, MoveObjective, Task, evaluate_move, improved_way
from biodance.records import Array

_SLOWER = (1.0, 1.4, 1.8)
"""Factors on the duration of a straight move, one after the other."""
_ITERATIONS = (12, 8)
_STOP = 0.08
"""rad that a lifted leg keeps from the stops of its joints."""
_STEP = (0.5, -0.1, 0.0, 0.55, 0.0, 0.0)
"""rad by which hip, knee and ankle of a leg bend on the way of a lifted foot, and it goes away from the other one."""


def plain_move(task: Task, lost: Callable[[Move], str]) -> Move:
    """Return the move of ``task`` in which nothing goes out of its way that need not, and of which imprecise people do
    not lose a limit (``lost`` names it, "" if none); if none keeps all limits, the one that violates least.
    """
    tried, eased = [], {limit.name for limit in task.limits if limit.mended_by_slowness}
    for factor in _SLOWER:
        slow = replace(task, duration=factor * task.duration)
        ways = [slow.straight(), *([_stepping(slow)] if len(task.stance.planted) == 1 else [])]
        tried.append(min((_copied(evaluate_move(slow, way)[0], lost) for way in ways), key=_badness))
        if tried[-1].violation == 0 or tried[-1].limit not in eased:
            break
    best = min(tried, key=_badness)
    if best.violation == 0 or task.stance.seat:
        return best
    return _copied(_round(replace(task, duration=best.duration), best), lost)


def _badness(move: Move) -> tuple[float, bool]:
    return move.violation, bool(move.limit)


def _copied(move: Move, lost: Callable[[Move], str]) -> Move:
    """Return the move with the limit of which imprecise people leave too little, where the exact one keeps all."""
    return move if move.limit else replace(move, limit=lost(move))


def _stepping(task: Task) -> Array:
    """Return the via points (2, n) of a straight move on which the free leg is lifted, within its joints' ranges."""
    via, limits = task.straight(), task.chain.body.limits
    for side in {0, 1} - set(task.stance.planted):
        columns = np.array(task.chain.leg_columns[side])
        low, high = limits.lower[columns - ROOT] + _STOP, limits.upper[columns - ROOT] - _STOP
        via[:, columns] = np.clip(via[:, columns] + _STEP, np.minimum(low, via[:, columns]), high)
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
