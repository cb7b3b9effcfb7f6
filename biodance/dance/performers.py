"""How imprecise people copy a dance - degrees off in every joint, late and early, swaying - and what that leaves of the
limits. A step by which a foot changes its place is everybody's own and not judged. The virtual laboratory performs
dances by other code.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from biodance.body.parts import UPRIGHT
from biodance.dance.dance import Dance
from biodance.dance.limits import ForImprecise, ImpreciseCopy, Limit, Margin
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.splines import path_in, phase_at
from biodance.records import Array
from biodance.threads import one_thread

_RATE, _PLAN_RATE = 5.0, 25.0  # Hz at which performances are judged, and the plan is laid out
_TRACKING, _PELVIS = float(np.radians(7.0)), 0.4
"""rad root mean square of a restless performer's error in every joint, and the share of it in turns of the pelvis."""
_PACE, _TIMING, _SWAYS = 1.2, 0.2, 0.006
"""Times the planned duration; root mean square of the tempo's wandering, and m of that of the centre of pressure."""
_WANDER, _TEMPO, _SWAY = 0.25, 0.2, 0.5  # Hz: how fast errors, tempo and sway change
_STRAIGHT, _SOFT = float(np.radians(5.0)), 80.0
"""rad of a knee that counts as straight; 1/m of the soft minimum over the legs."""
_LIFT = 1.0  # Share of a move in which a foot leaves the ground, or comes back
_FELT = 3.0
"""s beyond which no instant of the plan is felt in the spline through all of them: 75 instants, a fourth each."""
_ROUNDS = 2  # Corrections of the pelvis; what is left is a tenth of a millimetre a degree
_CARRIED = 0.85  # m that the centre of mass goes when the pelvis goes 1 m over planted feet


def _noise(
    rng: np.random.Generator, time: Array, columns: int, cutoff: float, *, slow: float = 0.0, part: slice = slice(None)
) -> Array:
    """Return smooth random curves (T, columns) of unit standard deviation, whose amplitudes fall with exp(-(f /
    cutoff)²); ``slow`` s²: divided by 1 + slow (2 pi f)², as the mass of a pendulum moves when its support sways;
    ``part`` of them.
    """
    frequency, ahead, aside = _waves(time.tobytes(), cutoff)
    weight = np.exp(-((frequency / cutoff) ** 2))
    # Cosine and sine together have the variance weight² at any time: the sum is one (without `slow`).
    weight /= np.sqrt(np.sum(weight**2)) * (1 + slow * (2 * np.pi * frequency) ** 2)
    cosine, sine = rng.normal(size=(2, frequency.size, columns)) * weight[None, :, None]
    return np.asarray(ahead[part] @ cosine + aside[part] @ sine)


@lru_cache(maxsize=16)
def _waves(instants: bytes, cutoff: float) -> tuple[Array, Array, Array]:
    """Return frequencies (F,) Hz, their cosines and sines (T, F) at ``instants`` (T,) s, the same for all."""
    time = np.frombuffer(instants)
    # Longer than the dance, so that no curve repeats itself in it.
    duration = 1.3 * (time[-1] - time[0]) + 1.0
    frequency = np.arange(1, int(np.ceil(2.5 * cutoff * duration)) + 1) / duration
    phase = 2 * np.pi * np.outer(time, frequency)
    return frequency, np.cos(phase), np.sin(phase)


class PlannedDance:
    """The dance laid out in time: coordinates, place of the centre of mass and of the pelvis, feet of the phases; with
    ``between``, two instants s of the dance, no more of it than can be felt there.
    """

    def __init__(self, dance: Dance, between: tuple[float, float] = (-np.inf, np.inf)) -> None:
        self.dance, self.chain, phases = dance, dance.chain, dance.phases
        self.start, self.end = (np.array([getattr(phase, name) for phase in phases]) for name in ("start", "end"))
        self.posture = np.array([phase.posture for phase in phases])
        self.stances = tuple(phase.stance for phase in phases)
        before = [dance.stances[max(0, phase.posture - (phase.kind == "move"))] for phase in phases]
        after = [dance.stances[phase.posture] for phase in phases]
        self.down = np.array(
            [
                [[side in stance.planted for side in (0, 1)] for stance in row]
                for row in zip(before, self.stances, after, strict=True)
            ]
        )
        self.ankles = np.array([[s.ankle for s in row] for row in zip(before, after, strict=True)])
        self.stepping = np.ptp(self.ankles, axis=1).any(axis=(1, 2))
        first, last = between[0] - _FELT, between[1] + _FELT
        near = [phase for phase in phases if phase.end >= first and phase.start <= last]
        counts = [max(2, round((phase.end - phase.start) * _PLAN_RATE)) for phase in near]
        spread = [np.linspace(p.start, p.end, n, endpoint=False) for p, n in zip(near, counts, strict=True)]
        time: Array = np.unique(np.round(np.concatenate(spread), 9))
        rows, parts = phase_at(phases, time), list[Array]()
        for p in np.unique(rows):
            x = path_in(phases[p], dance.postures, dance.via, time[rows == p])[0]
            parts.append(self.chain.plant(x, self.stances[p].planted, self.stances[p].ankle))  # they hold their feet
        x = np.concatenate(parts)
        up, ankle = self._feet(rows, time)
        # What the plan keeps below (or above) straight legs; performers keep it, too.
        over = x[:, 2] - self._tops(x, up, ankle)
        self.spline = CubicSpline(time, np.column_stack([x, self.chain.mass_centre(x)[:, :2], over]))

    def _feet(self, rows: NDArray[np.intp], when: Array) -> tuple[Array, Array]:
        """Return how far each foot is up (T, 2), 0 on the ground to 1, and where its ankle stands (T, 2, 3) m."""
        way = ((when - self.start[rows]) / np.maximum(self.end[rows] - self.start[rows], 1e-9))[:, None]
        before, during, after = np.moveaxis(self.down[rows], 1, 0)
        # Leaves the ground after the beginning of a move, returns before its end; whichever is less far.
        rise = np.where(before, _eased(way / _LIFT), 1.0) * np.where(after, _eased((1 - way) / _LIFT), 1.0)
        ankle = np.where(way[..., None] < 0.5, self.ankles[rows, 0], self.ankles[rows, 1])
        return np.where(during, 0.0, rise), ankle

    def _tops(self, x: Array, up: Array, ankle: Array) -> Array:
        """Return the height (T,) m of the pelvis at which planted legs are nearly straight; a raised foot yields."""
        tops = self.chain.root_heights(x, ankle, _STRAIGHT) + up.T
        # Soft minimum of both: -log(sum of exp(-k h)) / k, without a kink where the leg changes.
        return np.asarray(-np.log(np.exp(-_SOFT * tops).sum(axis=0)) / _SOFT)

    def held_by(self, when: Array) -> ImpreciseCopy:
        """Return what imprecise people do who stop at each of the instants ``when`` (W,) s of the plan: the same
        `_DRAWN` at every one, instant by instant.
        """
        rng = np.random.default_rng(0)
        # Orthogonal columns and their negatives: mean and covariance are those of the population. Independent draws
        # told the left side from the right one by chance (deviations of a mirrored posture: 3.4 and 4.4).
        half = np.linalg.qr(rng.normal(size=(_DRAWN // 2, self.chain.size - 1)))[0] * np.sqrt(_DRAWN / 2)
        drawn = np.tile(np.concatenate([half, -half]), (len(when), 1))
        places = np.repeat(when, _DRAWN)
        return replace(self.copied(np.arange(places.size, dtype=float), places, drawn), still=True)

    def copied(self, time: Array, when: Array, drawn: Array) -> ImpreciseCopy:
        """Return the plan at instants ``when`` (T,) s as copied at ``time`` (T,) s with ``drawn`` errors (T, n - 1) of
        unit standard deviation: of the pelvis' turns, of all joints, of the centre of pressure.
        """
        error, sway = _TRACKING * drawn[:, :-2], _SWAYS * drawn[:, -2:]
        chain, rows, told, feet = self.chain, phase_at(self.dance.phases, when), self.spline(when), self.stances[0]
        x, com, over = told[:, : chain.size], told[:, chain.size : chain.size + 2] + sway, told[:, -1]
        moved = error[:, 3:].copy()
        for side in feet.quiet:  # the frame holds the hand where it is, or the arm hangs
            moved[:, np.array(chain.arm_columns[side]) - ROOT] = 0.0
        x[:, ROOT:] += moved
        if not feet.seat:
            x[:, 3:ROOT] += _PELVIS * error[:, :3]
            (up, ankle), wanted = self._feet(rows, when), x.copy()
            for k in range(_ROUNDS + 1):
                x[:, 2] = self._tops(x, up, ankle) + over
                x = self._standing(x, wanted, up, ankle)
                if k < _ROUNDS:
                    # Newton: the centre of mass goes `_CARRIED` times as far as the pelvis.
                    x[:, :2] += (com - chain.mass_centre(x)[:, :2]) / _CARRIED
        return ImpreciseCopy(chain.body, time, chain.positions(x), self.stances, rows)

    def _standing(self, x: Array, wanted: Array, up: Array, ankle: Array) -> Array:
        """Return x (T, n) with legs that hold their feet, as far as these are not up; then they do as ``wanted``."""
        out, turn = x.copy(), self.chain.root_rotation(x)
        for side, columns in enumerate(self.chain.leg_columns):
            own, meant = np.flatnonzero(up[:, side] < 1), wanted[:, columns]
            flat = np.broadcast_to(UPRIGHT, (own.size, 3, 3))
            held = self.chain.legs[side].solve(turn[own], x[own, :3], flat, ankle[own, side])
            # From the held leg to the meant one as the foot rises.
            meant[own] = held + up[own, side, None] * (meant[own] - held)
            out[:, columns] = meant
        return out


def _eased(way: Array) -> Array:
    s = np.clip(way, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


OF_PERFORMERS = "of_performers"
"""End of the names of their margins."""
PERFORMER_COUNT = 200
"""Performers that a dance is tried on."""
_DRAWN = 96  # Imprecise copies of an instant that are looked at
_STILL = 1e-4  # Least deviation, in the limit's unit


@dataclass(frozen=True)
class PerformersResult:
    """What ``count`` imprecise performers leave beyond the least of every limit that they must keep: ``margins``, at
    the start of the posture to or in which that is least; ``bad`` postures (indices) at which somebody had too little,
    with the limit; ``failed`` the numbers of those people.
    """

    count: int
    margins: tuple[Margin, ...]
    bad: tuple[tuple[int, str], ...]
    failed: tuple[int, ...] = ()

    @property
    def safe(self) -> bool:
        """True where everybody keeps every limit."""
        return not self.bad


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
    workers: Executor | None = None,
) -> PerformersResult:
    """Return what performers leave of the ``limits`` in ``dance``; ``who`` are their numbers, and each is the same
    whoever else dances. ``only``: neighbouring postures (indices) to or in which they are looked at. ``workers``: two
    of them look at half of the performers each.
    """
    if workers is None:
        parts = [_rooms(dance, limits, who, only)]
    else:
        half = (len(who) + 1) // 2
        halves = [some for some in (who[:half], who[half:]) if some]
        tasks = [workers.submit(_rooms, dance, limits, some, only) for some in halves]
        parts = [task.result() for task in tasks]
    margins, bad, failed = list[Margin](), set[tuple[int, str]](), set[int]()
    starts = {phase.posture: phase.start for phase in reversed(dance.phases)}
    for limit, asked in for_imprecise(limits).items():
        room = np.concatenate([part[limit.name][0] for part in parts])
        what = [name for part in parts for name in part[limit.name][1]]
        short = room < asked.least
        k, p = np.unravel_index(int(room.argmin()), room.shape)
        worst, name = float(room[k, p]) - asked.least, f"{limit.name}_{OF_PERFORMERS}"
        margins.append(Margin(name, worst, starts[int(p)], limit.unit, what[k]))
        bad |= {(int(posture), limit.name) for posture in np.flatnonzero(short.any(axis=0))}
        failed |= {who[int(one)] for one in np.flatnonzero(short.any(axis=1))}
    return PerformersResult(len(who), tuple(margins), tuple(sorted(bad)), tuple(sorted(failed)))


@one_thread()
def _rooms(
    dance: Dance, limits: tuple[Limit, ...], who: Sequence[int], only: tuple[int, ...]
) -> dict[str, tuple[Array, list[str]]]:
    """Return the least that each performer leaves of every limit by posture (K, P), and where (K)."""
    people, asked = [_person(dance, k, only) for k in who], for_imprecise(limits)
    when = np.concatenate([when[part] for _, _, when, part in people])
    plan, room = PlannedDance(dance, (when.min(), when.max())), {limit.name: list[Array]() for limit in asked}
    what = {limit.name: list[str]() for limit in asked}
    for some in _groups(people):
        parts = [
            (
                time[part],
                when[part],
                _noise(rng, time, plan.chain.size - 3, _WANDER, part=part),
                _noise(rng, time, 2, _SWAY, slow=0.1, part=part),
            )
            for rng, time, when, part in some
        ]
        times, places, error, sway = (np.concatenate(one) for one in zip(*parts, strict=True))
        # One performance behind the other: the first and the last two frames of each have differences to another's.
        copy = plan.copied(times, places, np.hstack([error, sway]))
        end = np.cumsum([when[part].size for _, _, when, part in some])
        posture = plan.posture[copy.on]
        for limit, one in asked.items():
            left = one.left(copy)
            # A step to another place is not judged.
            value = np.where(plan.stepping[copy.on][:, None], np.inf, left.value)
            for first, last in pairwise([0, *end]):
                own, each = slice(first + 2, last - 2), np.full(len(dance.postures), np.inf)
                # Several frames belong to one posture: an unbuffered minimum.
                np.minimum.at(each, posture[own], value[own].min(axis=1))
                room[limit.name].append(each)
                what[limit.name].append(left.of[int(value[own].min(axis=0).argmin())])
    return {name: (np.array(rows), what[name]) for name, rows in room.items()}


_Person = tuple[np.random.Generator, Array, Array, slice]
"""What a performer's errors are drawn from, instants s of the performance and of the plan, and which of them count."""


def _person(dance: Dance, k: int, only: tuple[int, ...]) -> _Person:
    """Return performer ``k``, and the instants of the dance to or in the postures ``only``."""
    time, part = np.arange(round(dance.duration * _PACE * _RATE) + 1) / _RATE, slice(None)
    # Lognormal: the tempo is never negative.
    tempo = np.exp(_TIMING * _noise(np.random.default_rng([0, 7, k]), time, 1, _TEMPO)[:, 0])
    # Trapezoidal rule: how much is done by every instant, in any unit.
    done = np.concatenate([[0.0], np.cumsum((tempo[1:] + tempo[:-1]) / 2)])
    when = dance.duration * done / done[-1]
    if only:
        posture = np.array([phase.posture for phase in dance.phases])[phase_at(dance.phases, when)]
        inside = np.flatnonzero(np.isin(posture, only))
        part = slice(max(0, inside[0] - 2), inside[-1] + 3)
    return np.random.default_rng([0, 8, k]), time, when, part


def _groups(people: list[_Person]) -> Iterator[list[_Person]]:
    """Yield people who are looked at together: calls cost more than a few frames, and many frames need memory."""
    frames = np.cumsum([when[part].size for _, _, when, part in people])
    for _, some in groupby(zip(frames // 1000, people, strict=True), key=itemgetter(0)):
        yield [one for _, one in some]


def deviations_of_copies(dance: Dance, limits: tuple[Limit, ...], when: Array) -> tuple[float, str]:
    """Return by how many deviations people who stop at one of the instants ``when`` s of a ``dance``, and are off as
    performers are, stay within what is demanded, and the limit of which that is least; infinite and "" if nothing is
    demanded there. Deviations are those towards the limit: an arm beside the head errs farther towards it than away.
    """
    plan = PlannedDance(dance)
    when = when[~plan.stepping[phase_at(dance.phases, when)]]
    if not when.size:
        return np.inf, ""
    copy, found = plan.held_by(when), [(np.inf, "")]
    for limit, one in for_imprecise(limits).items():
        left = one.left(copy).value.reshape(len(when), _DRAWN, -1)
        left = left[:, :, np.isfinite(left).all(axis=(0, 1))]
        # Over the copies of each instant.
        usual = np.median(left, axis=1)
        # Root mean square of what lies below the median; the half is made whole: sd of a symmetric error.
        below = np.sqrt(2 * np.mean(np.minimum(left - usual[:, None], 0.0) ** 2, axis=1))
        found.append((float(((usual - one.least) / np.maximum(below, _STILL)).min(initial=np.inf)), limit.name))
    return min(found)
