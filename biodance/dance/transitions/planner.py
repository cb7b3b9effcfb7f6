"""From each posture to the next, by all means: at once, slower, or by way of a comfortable posture in between."""

from dataclasses import dataclass, replace

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.postures.posture import intermediate_posture
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
    """Return the two moves by way of ``stop`` (n,), slow ones since the direct way was impossible even so, none if one
    is not possible.
    """
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
