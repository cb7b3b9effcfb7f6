"""What is left of the limits when imprecise people dance a dance (`imprecision`). A step by which a foot changes its
place is everybody's own and not judged.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from biodance.dance.dance import Dance
from biodance.dance.imprecision import USUAL_IMPRECISION, Imprecision, PlannedDance, draw_clock
from biodance.dance.limits import ForImprecise, Limit
from biodance.dance.problem.stance import phase_at
from biodance.dance.verify import Margin
from biodance.records import Array
from biodance.threads import one_thread

OF_PERFORMERS = "of_performers"
"""End of the names of their margins."""
PERFORMER_COUNT = 200
"""Performers that a dance is tried on."""
_DRAWN = 96
"""Imprecise copies of an instant that are looked at."""
_TOGETHER = 1000
"""Frames of performers that are looked at together."""
_STILL = 1e-4
"""Least deviation, in the limit's unit."""


@dataclass(frozen=True)
class PerformersMargin:
    """The least that performers left of the ``limit``, of which at least ``least`` is demanded: ``worst``, both in its
    ``unit``; the ``posture`` (index) to or in which, the pair or support ``what``, and ``failing``, the share of
    performers without enough.
    """

    limit: str
    unit: str
    least: float
    worst: float
    posture: int
    what: str
    failing: float


@dataclass(frozen=True)
class Rehearsed:
    """What ``count`` imprecise performers leave of every limit that they must keep: ``least_margins``; ``bad`` postures
    (indices) at which somebody had too little, with the limit; ``failed`` the numbers of those people.
    """

    count: int
    least_margins: tuple[PerformersMargin, ...]
    bad: tuple[tuple[int, str], ...]
    failed: tuple[int, ...] = ()

    def __getitem__(self, limit: str) -> PerformersMargin:
        return next(room for room in self.least_margins if room.limit == limit)

    def margins(self, dance: Dance) -> tuple[Margin, ...]:
        """Return what the performers leave beyond the least as margins of a dance."""
        starts = {phase.posture: phase.start for phase in reversed(dance.phases)}
        return tuple(
            Margin(f"{r.limit}_{OF_PERFORMERS}", r.worst - r.least, starts[r.posture], r.unit, r.what)
            for r in self.least_margins
        )

    @property
    def safe(self) -> bool:
        """True where everybody keeps every limit."""
        return all(room.worst >= room.least for room in self.least_margins)


def for_imprecise(limits: Iterable[Limit]) -> dict[Limit, ForImprecise]:
    """Return what imprecise people must keep, limit by limit."""
    found = ((limit, limit.for_imprecise()) for limit in limits)
    return {limit: asked for limit, asked in found if asked is not None}


@one_thread()
def rehearse_imprecisely(
    dance: Dance,
    limits: tuple[Limit, ...],
    *,
    who: Sequence[int] = range(PERFORMER_COUNT),
    only: tuple[int, ...] = (),
    how: Imprecision = USUAL_IMPRECISION,
) -> Rehearsed:
    """Return what performers leave of the ``limits`` in ``dance``; ``who`` are their numbers, and each is the same
    whoever else dances. ``only``: neighbouring postures (indices) to or in which they are looked at.
    """
    people = [_person(dance, k, only, how) for k in who]
    when = np.concatenate([when[part] for _, _, when, part in people])
    plan, postures = PlannedDance(dance, (when.min(), when.max())), len(dance.postures)
    asked = for_imprecise(limits)
    found: dict[Limit, list[_Least]] = {limit: [] for limit in asked}
    for some in _groups(people):
        copy, end = plan.performed_by(some, how), np.cumsum([when[part].size for _, _, when, part in some])
        posture, inside = plan.posture[copy.on], [slice(a + 2, b - 2) for a, b in pairwise([0, *end])]
        for limit, one in asked.items():
            left = one.left(copy)
            value = np.where(plan.stepping[copy.on][:, None], np.inf, left.value)
            for own in inside:
                what = left.of[int(value[own].min(axis=0).argmin())]
                found[limit].append(_Least.of(value[own].min(axis=1), posture[own], postures, what))
    least_margins = tuple(_joined(limit, asked[limit].least, least) for limit, least in found.items())
    bad = {
        (int(p), limit.name)
        for limit, parts in found.items()
        for one in parts
        for p in np.flatnonzero(one.each < asked[limit].least)
    }
    failed = {
        k for limit, parts in found.items() for k, one in zip(who, parts, strict=True) if one.room < asked[limit].least
    }
    return Rehearsed(len(who), least_margins, tuple(sorted(bad)), tuple(sorted(failed)))


_Person = tuple[np.random.Generator, Array, Array, slice]
"""What a performer's errors are drawn from, instants s of the performance and of the plan, and which of them count."""


def _person(dance: Dance, k: int, only: tuple[int, ...], how: Imprecision) -> _Person:
    """Return performer ``k``, and the instants at which he or she dances to or in the postures ``only``, and two beyond
    for differences.
    """
    time, when = draw_clock(np.random.default_rng([0, 7, k]), dance.duration, how)
    part = slice(None)
    if only:
        posture = np.array([phase.posture for phase in dance.phases])[phase_at(dance.phases, when)]
        inside = np.flatnonzero(np.isin(posture, only))
        part = slice(max(0, inside[0] - 2), inside[-1] + 3)
    return np.random.default_rng([0, 8, k]), time, when, part


def _groups(people: list[_Person]) -> Iterator[list[_Person]]:
    """Yield people who are looked at together: calls cost more than a few frames, and many frames need memory."""
    frames = np.cumsum([when[part].size for _, _, when, part in people])
    for _, some in groupby(zip(frames // _TOGETHER, people, strict=True), key=itemgetter(0)):
        yield [one for _, one in some]


def deviations_of_copies(dance: Dance, limits: tuple[Limit, ...], when: Array) -> tuple[float, str]:
    """Return by how many deviations people who stop at one of the instants ``when`` s of a ``dance``, and are off as
    performers are, stay within what is demanded, and the limit of which that is least; infinite and "" if nothing is
    demanded there. Deviations are those towards the limit: an arm beside the head errs farther towards it than away.
    """
    plan = PlannedDance(dance)
    when = when[~plan.stepping[plan.phase_at(when)]]
    if not when.size:
        return np.inf, ""
    copy, found = plan.held_by(_DRAWN, when), [(np.inf, "")]
    for limit, one in for_imprecise(limits).items():
        left = one.left(copy).value.reshape(len(when), _DRAWN, -1)
        left = left[:, :, np.isfinite(left).all(axis=(0, 1))]
        usual = np.median(left, axis=1)
        below = np.sqrt(2 * np.mean(np.minimum(left - usual[:, None], 0.0) ** 2, axis=1))
        found.append((float(((usual - one.least) / np.maximum(below, _STILL)).min(initial=np.inf)), limit.name))
    return min(found)


def perform_with(
    workers: Executor,
    dance: Dance,
    limits: tuple[Limit, ...],
    *,
    who: Sequence[int] = range(PERFORMER_COUNT),
    only: tuple[int, ...] = (),
) -> Rehearsed:
    """Return what `rehearse_imprecisely` does, found by two ``workers`` side by side."""
    half = (len(who) + 1) // 2
    tasks = [
        workers.submit(rehearse_imprecisely, dance, limits, who=part, only=only)
        for part in (who[:half], who[half:])
        if part
    ]
    parts = [task.result() for task in tasks]
    count = sum(part.count for part in parts)

    def together(least_margins: tuple[PerformersMargin, ...]) -> PerformersMargin:
        failing = sum(part.count * room.failing for part, room in zip(parts, least_margins, strict=True)) / count
        return replace(min(least_margins, key=lambda room: room.worst), failing=failing)

    least_margins = tuple(together(some) for some in zip(*(part.least_margins for part in parts), strict=True))
    bad = tuple(sorted({bad for part in parts for bad in part.bad}))
    return Rehearsed(count, least_margins, bad, tuple(k for part in parts for k in part.failed))


def _joined(limit: Limit, least: float, found: list["_Least"]) -> PerformersMargin:
    """Return the worst of all performers."""
    worst = min(found, key=lambda one: one.room)
    failing = float(np.mean([one.room < least for one in found]))
    return PerformersMargin(limit.name, limit.unit, least, worst.room, worst.posture, worst.what, failing)


@dataclass(frozen=True, eq=False)
class _Least:
    """The least ``room`` of one performer, at which ``posture``, of ``what``; ``each`` (P,) that of every posture."""

    room: float
    posture: int
    what: str
    each: Array

    @classmethod
    def of(cls, left: Array, posture: NDArray[np.intp], count: int, what: str) -> "_Least":
        """Return the least of ``left`` (T,), on the way to and in each ``posture`` (T,) of ``count``."""
        each, worst = np.full(count, np.inf), int(left.argmin())
        np.minimum.at(each, posture, left)
        return cls(float(left[worst]), int(posture[worst]), what, each)
