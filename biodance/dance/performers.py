"""What is left of the limits when imprecise people dance a dance (`imprecision`). A step by which a foot changes its
place is everybody's own and not judged.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

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
class PerformersResult:
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


def try_performers(
    dance: Dance,
    limits: tuple[Limit, ...],
    *,
    who: Sequence[int] = range(PERFORMER_COUNT),
    only: tuple[int, ...] = (),
    how: Imprecision = USUAL_IMPRECISION,
    workers: Executor | None = None,
) -> PerformersResult:
    """Return what performers leave of the ``limits`` in ``dance``; ``who`` are their numbers, and each is the same
    whoever else dances. ``only``: neighbouring postures (indices) to or in which they are looked at. ``workers``: two
    of them look at half of the performers each.
    """
    if workers is None:
        parts = [_rooms(dance, limits, who, only, how)]
    else:
        half = (len(who) + 1) // 2
        halves = [some for some in (who[:half], who[half:]) if some]
        tasks = [workers.submit(_rooms, dance, limits, some, only, how) for some in halves]
        parts = [task.result() for task in tasks]
    margins, bad, failed = list[PerformersMargin](), set[tuple[int, str]](), set[int]()
    for limit, asked in for_imprecise(limits).items():
        room = np.concatenate([part[limit.name][0] for part in parts])
        what = [name for part in parts for name in part[limit.name][1]]
        short = room < asked.least
        k, p = np.unravel_index(int(room.argmin()), room.shape)
        share = float(short.any(axis=1).mean())
        margins.append(PerformersMargin(limit.name, limit.unit, asked.least, float(room[k, p]), int(p), what[k], share))
        bad |= {(int(posture), limit.name) for posture in np.flatnonzero(short.any(axis=0))}
        failed |= {who[int(one)] for one in np.flatnonzero(short.any(axis=1))}
    return PerformersResult(len(who), tuple(margins), tuple(sorted(bad)), tuple(sorted(failed)))


@one_thread()
def _rooms(
    dance: Dance, limits: tuple[Limit, ...], who: Sequence[int], only: tuple[int, ...], how: Imprecision
) -> dict[str, tuple[Array, list[str]]]:
    """Return for every limit the least that each performer leaves on the way to and in every posture (K, P), infinite
    where nobody looked, and where in the body that is least (K).
    """
    people, asked = [_person(dance, k, only, how) for k in who], for_imprecise(limits)
    when = np.concatenate([when[part] for _, _, when, part in people])
    plan, room = PlannedDance(dance, (when.min(), when.max())), {limit.name: list[Array]() for limit in asked}
    what = {limit.name: list[str]() for limit in asked}
    for some in _groups(people):
        copy, end = plan.performed_by(some, how), np.cumsum([when[part].size for _, _, when, part in some])
        posture = plan.posture[copy.on]
        for limit, one in asked.items():
            left = one.left(copy)
            value = np.where(plan.stepping[copy.on][:, None], np.inf, left.value)
            for first, last in pairwise([0, *end]):
                own, each = slice(first + 2, last - 2), np.full(len(dance.postures), np.inf)
                np.minimum.at(each, posture[own], value[own].min(axis=1))
                room[limit.name].append(each)
                what[limit.name].append(left.of[int(value[own].min(axis=0).argmin())])
    return {name: (np.array(rows), what[name]) for name, rows in room.items()}


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
