"""Moves that people can follow: straight from one posture to the next, slower where the straight way breaks a limit,
and at last with the pelvis and a lifted leg going round.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from biodance.dance.performers import deviations_of_copies
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.stance import Stance
from biodance.dance.search.move import Move, MoveObjective, Task, evaluate_move, improving_moves
from biodance.records import Array

_SLOWER = (1.0, 1.4, 1.8)
"""Factors on the duration of a straight move, one after the other."""
ENOUGH, AMPLE = 3.2, 4.0
"""Deviations of imprecise people that a posture or a move must leave, and that it leaves where there is a choice."""
_ITERATIONS = (12, 8)
_FROM_STOP = 0.08
"""rad that a lifted leg keeps from the stops of its joints."""
_LIFTS = ((0.5, -0.1, 0.0, 0.55, 0.0, 0.0), (0.5, -0.2, 0.0, 0.55, 0.0, 0.0), (0.8, -0.2, 0.0, 0.9, 0.0, 0.0))
"""rad by which hip, knee and ankle of a lifted leg bend on the way, and by which it goes away from the other one."""
_SAMPLED = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Fractions of a move at which imprecise people must have room, too."""
_STANDING = 0.2
"""s of standing still before and after a move that is looked at alone."""


def straight_move(task: Task, stances: tuple[Stance, Stance], enough: float = ENOUGH) -> tuple[Move, float]:
    """Return the move of ``task`` between postures on ``stances`` in which nothing goes out of its way that need not,
    and by how many deviations imprecise people keep its limits (fewer than ``enough``: it has the limit of which); if
    none keeps all limits, the one that violates least.
    """
    tried, eased = [], {limit.name for limit in task.limits if limit.mended_by_slowness}
    for factor in _SLOWER:
        slow = replace(task, duration=factor * task.duration)
        tried.append(_safest(slow, stances, (evaluate_move(slow, via)[0] for via in _vias(slow)), enough))
        if tried[-1][0].violation == 0 or tried[-1][0].limit not in eased:
            break
    best = min(tried, key=lambda one: one[0].violation)
    if best[0].violation == 0 or task.stance.seat:
        return best
    slow = replace(task, duration=best[0].seconds)
    return _safest(slow, stances, [_round_about(slow, best[0])], enough)


def other_moves(task: Task, last: Move, *, slower: bool) -> Iterator[Move]:
    """Yield moves of ``task`` that keep all limits and differ from the ``last`` one, which takes as long, or less where
    they are to be ``slower``.
    """
    for factor in (factor for factor in _SLOWER if (factor * task.duration > last.seconds + 1e-9) == slower):
        slow = replace(task, duration=factor * task.duration)
        for via in _vias(slow):
            move = evaluate_move(slow, via)[0]
            if not move.limit and (slower or not np.allclose(via, last.via[0])):
                yield move


def _vias(task: Task) -> list[Array]:
    """Return the via points (2, n) that are tried: straight on, on one leg also by lifts that are higher or wider."""
    lifts = _LIFTS if len(task.stance.planted) == 1 else ()
    return [task.straight(), *(_lifting(task, lift) for lift in lifts)]


def _safest(task: Task, stances: tuple[Stance, Stance], moves: Iterable[Move], enough: float) -> tuple[Move, float]:
    """Return the first move that keeps all limits and leaves imprecise people `AMPLE` deviations, or else the one that
    leaves them most, with the limit of which it is less than ``enough``, and how many; if none keeps all limits, the
    one that violates least.
    """
    tried, best, most = list[Move](), None, -np.inf
    for move in moves:
        tried.append(move)
        if not move.limit:
            alone = move.dance(task, stances, np.full(2, _STANDING))
            found, limit = deviations_of_copies(alone, task.limits, _STANDING + move.seconds * _SAMPLED)
            if best is None or found > most:
                best, most = replace(move, limit=limit if found < enough else ""), found
            if found > AMPLE:
                break
    return (best, most) if best is not None else (min(tried, key=lambda move: move.violation), -np.inf)


def _lifting(task: Task, lift: tuple[float, ...]) -> Array:
    """Return the via points (2, n) of a straight move on which the free leg does the ``lift`` within its ranges."""
    via, limits = task.straight(), task.chain.body.limits
    for side in {0, 1} - set(task.stance.planted):
        columns = np.array(task.chain.leg_columns[side])
        low, high = limits.lower[columns - ROOT] + _FROM_STOP, limits.upper[columns - ROOT] - _FROM_STOP
        via[:, columns] = np.clip(via[:, columns] + lift, np.minimum(low, via[:, columns]), high)
    return via


def _round_about(task: Task, best: Move) -> Move:
    """Return a move in which the pelvis and a lifted leg avoid what the straight one breaks."""
    up = [c for side in (0, 1) if side not in task.stance.planted for c in task.chain.leg_columns[side]]
    objective = MoveObjective(task, np.zeros((len(task.chain.body.segments), 6, 6)), 0.0)
    for found, _ in improving_moves(task, best.via[0], objective, _ITERATIONS, free=[*range(ROOT), *up]):
        best = min(best, found, key=lambda move: move.violation)
        if best.violation == 0:
            break
    return best
