"""The healthy reference of a laboratory: bands over its people, and what the gait deviation index is told against."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from biodance.cycles.beside import EMG
from biodance.cycles.curves import CurveGroup, NormalCurve, normal_curves
from biodance.cycles.scores import FEATURES, DeviationReference, deviation_reference, gait_vectors
from biodance.pipeline.movement import session_movement
from biodance.pipeline.results import SessionResult
from biodance.records import SIDES, Array

_FEWEST_LEGS = 6
"""Healthy legs without which nothing is said of how far healthy people lie apart: both of three people."""


@dataclass(frozen=True, eq=False)
class MeasuredWalk:
    """How one ``person`` moved in a ``session``: ``curves`` over all good repetitions, ``beside`` those of plug-in
    gait in the same files, gait ``vectors`` by side (n, 459) deg.
    """

    session: str
    person: str
    curves: tuple[CurveGroup, ...]
    beside: tuple[CurveGroup, ...]
    vectors: dict[str, Array]


@dataclass(frozen=True, eq=False)
class HealthyReference:
    """``normal`` bands, those of plug-in gait's own angles ``beside``, and ``deviation`` of the gait deviation index,
    None where too few people or strides tell it.
    """

    normal: tuple[NormalCurve, ...] = ()
    beside: tuple[NormalCurve, ...] = ()
    deviation: DeviationReference | None = None


def measured_walk(result: SessionResult, session: str) -> MeasuredWalk:
    """Return how the person of an examined ``session`` moved; without EMG, whose size hangs on skin and electrodes."""
    moved = session_movement(result)
    groups = (group for one in moved.repetitions.values() for group in one.groups)
    curves = tuple(group for group in groups if not group.quantity.endswith(EMG))
    found = gait_vectors(moved.gait.curves) if moved.gait else {}
    by_side = {side: [vector for cycle, vector in found.items() if cycle.side == side] for side in SIDES}
    vectors = {side: np.stack(rows) for side, rows in by_side.items() if rows}
    beside = moved.gait.file_groups if moved.gait else ()
    return MeasuredWalk(session, result.subject.name or session, curves, beside, vectors)


def healthy_reference(healthy: Sequence[MeasuredWalk], everybody: Sequence[MeasuredWalk]) -> HealthyReference:
    """Return the reference of ``healthy`` people; ``everybody`` who was measured, patients too, gives the features of
    the deviation index. A person counts once, over all sessions.
    """
    people, beside = dict[str, list[CurveGroup]](), dict[str, list[CurveGroup]]()
    legs: dict[tuple[str, str], list[Array]] = {}
    for one in healthy:
        people.setdefault(one.person, []).extend(one.curves)
        beside.setdefault(one.person, []).extend(one.beside)
        for side, rows in one.vectors.items():
            legs.setdefault((one.person, side), []).extend(rows)
    strides = [row for one in everybody for rows in one.vectors.values() for row in rows]
    enough = len(strides) >= FEATURES and len(legs) >= _FEWEST_LEGS
    means = [np.mean(rows, axis=0) for rows in legs.values()]
    deviation = deviation_reference(np.stack(strides), np.stack(means)) if enough else None
    return HealthyReference(normal_curves(people), normal_curves(beside), deviation)
