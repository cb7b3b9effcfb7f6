"""Moves that people can follow: straight from one posture to the next, slower where the straight way breaks a limit, and
at last with the pelvis and a lifted leg going round.
"""

from dataclasses import replace

import numpy as np

from biodance.dance.problem.chain import ROOT
from biodance.dance.transitions.move import GRID, RESERVE, Move, MoveObjective, Task, evaluate_move, improved_way

_SLOWER = (1.0, 1.4, 1.8)
"""Factors on the duration of a straight move, one after the other."""
_ITERATIONS = (12, 8)


def plain_move(task: Task) -> Move:
    """Return the move of ``task`` in which nothing goes out of its way that need not; if none keeps all limits, the one
    that violates least.
    """
    tried = []
    for factor in _SLOWER:
        slow = replace(task, duration=factor * task.duration)
        tried.append(evaluate_move(slow, slow.straight())[0])
        if tried[-1].violation == 0 or tried[-1].limit not in ("balance", "friction", "joint_speed", "joint_torque"):
            break
    best = min(tried, key=lambda move: move.violation)
    return best if best.violation == 0 or task.stance.seat else _round(replace(task, duration=best.duration), best)


def _round(task: Task, best: Move) -> Move:
    """Return a move in which the pelvis and a lifted leg avoid what the straight one breaks."""
    up = [c for side in (0, 1) if side not in task.stance.planted for c in task.chain.leg_columns[side]]
    objective = MoveObjective(task, np.zeros((len(task.chain.body.segments), 6, 6)), 0.0)
    via, time = task.straight(), task.grid(GRID)
    for k, iterations in enumerate(_ITERATIONS):
        via, _ = improved_way(task, via, time, objective, iterations, RESERVE * (1 + k / 4), free=[*range(ROOT), *up])
        found, worst = evaluate_move(task, via)
        best = min(best, found, key=lambda move: move.violation)
        if best.violation == 0:
            break
        time = np.union1d(time, worst)
    return best
