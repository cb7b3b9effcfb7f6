"""A trial cut into what repeats: gait cycles of each foot, squats, rises from a chair; and the spatio-temporal values
of walking: cadence, speed, stride and step length, step width, stance and double support.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.cycles.events import FootEvent, heel_and_toe, thigh_and_shank
from biodance.motion.contact.soles import Soles
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.records import SIDES, Array, Motion, runs

CycleKind = Literal["gait", "squat", "sit_to_stand"]
PERCENT = np.linspace(0.0, 100.0, 101)
"""% of a cycle at which its curves are given."""
_SHORTEST_STRIDE, _LONGEST_STRIDE = 0.4, 2.5
"""s of a gait cycle."""
_DEEP = 0.15
"""Of the leg's length by which the pelvis goes down in a squat, at least."""
_UP = 0.1
"""Of a repetition's depth within which the pelvis counts as up."""
_SEATED = 0.03
"""m that the centre of mass lies behind the heels of somebody who sits: standing so, one falls."""
_MOVES = 0.05
"""m/s of the centre of mass from which a rise has begun."""
_SLIDES = 0.1
"""m that a foot may travel in a squat or a rise."""


@dataclass(frozen=True)
class Cycle:
    """One repetition in ``trial``: ``kind``; ``side`` of the foot whose gait cycle it is, "both" for squats and rises;
    ``start``, ``end`` s on the clock of the trial; ``off`` s when the foot leaves the ground (gait), when the seat is
    left (rise) or when the pelvis is lowest (squat); NaN = not known.
    """

    trial: str
    kind: CycleKind
    side: str
    start: float
    end: float
    off: float

    @property
    def duration(self) -> float:
        """Its length, s."""
        return self.end - self.start

    @property
    def off_percent(self) -> float:
        """``off`` in % of the cycle: of a gait cycle the stance."""
        return 100 * (self.off - self.start) / self.duration

    def overlaps(self, other: "Cycle") -> bool:
        """Return whether two repetitions share time: then nobody stood between them. Each overlaps itself."""
        return self.start < other.end and other.start < self.end

    def times(self) -> Array:
        """Return the times (101,) s of `PERCENT`."""
        return self.start + PERCENT / 100 * self.duration


def gait_cycles(trial: str, events: tuple[FootEvent, ...]) -> tuple[Cycle, ...]:
    """Return the cycles from each strike to the next of the same foot, with the other foot's strike between them."""
    cycles = []
    for side in SIDES:
        strikes = [e.time for e in events if e.down and e.side == side]
        others = [e.time for e in events if e.down and e.side != side]
        for start, end in pairwise(strikes):
            if not _SHORTEST_STRIDE < end - start < _LONGEST_STRIDE or not any(start < one < end for one in others):
                continue
            off = [e.time for e in events if not e.down and e.side == side and start < e.time < end]
            cycles.append(Cycle(trial, "gait", side, start, end, off[0] if len(off) == 1 else float("nan")))
    return tuple(sorted(cycles, key=lambda cycle: cycle.start))


def repetitions(trial: str, body: Body, motion: Motion, soles: Soles) -> tuple[Cycle, ...]:
    """Return the squats and the rises from a chair of a trial in which the feet stay where they are.

    A squat begins and ends standing and goes down by `_DEEP` of the leg's length at least. Whoever has the centre of
    mass `_SEATED` behind the heels sits on something: a rise begins with the centre of mass moving and ends standing.
    """
    height, time = poses(body, motion.q).position[:, 0, 2], motion.time
    top, centre = float(np.percentile(height, 98)), centre_of_mass(body, motion)
    seated, cycles = _seated(body, soles, centre), list[Cycle]()
    for first, stop in runs(height < top - _DEEP * thigh_and_shank(body)):
        lowest = first + int(np.argmin(height[first:stop]))
        up = np.flatnonzero(height >= top - _UP * (top - height[lowest]))
        before, after = up[up < first], up[up >= stop]
        if not after.size or not motion.determined[first : after[0] + 1].all():
            continue
        path = soles.centre[first : after[0] + 1, :, :2]
        if np.linalg.norm(path - path[0], axis=-1).max() > _SLIDES:
            continue
        if seated[first:stop].any():
            leaves = first + int(np.flatnonzero(seated[first:stop])[-1])
            instants = time[[_still_before(centre, motion, leaves), after[0], leaves]]
            cycles.append(Cycle(trial, "sit_to_stand", "both", *instants.tolist()))
        elif before.size:
            cycles.append(Cycle(trial, "squat", "both", *time[[before[-1], after[0], lowest]].tolist()))
    return tuple(one for one in cycles if sum(map(one.overlaps, cycles)) == 1)


def _seated(body: Body, soles: Soles, centre: Array) -> NDArray[np.bool_]:
    """Return (T,) True where the centre of mass (T, 3) m lies behind both heels, as the feet point."""
    heel, toe = (place[..., :2] for place in heel_and_toe(body, soles.outline))
    ahead = (toe - heel).mean(axis=1)
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    behind = np.einsum("tfk,tk->tf", heel - centre[:, None, :2], ahead).min(axis=1)
    return np.asarray(behind > _SEATED)


def _still_before(centre: Array, motion: Motion, leaves: int) -> int:
    """Return the last frame before ``leaves`` at which the centre of mass was at rest; the first of the trial without
    one.
    """
    speed = np.linalg.norm(np.gradient(centre, motion.time, axis=0), axis=1)
    rest = np.flatnonzero(speed[: leaves + 1] < _MOVES)
    return int(rest[-1]) if rest.size else 0


_BELT = 0.15
"""m/s of a standing foot from which the ground is a belt."""
_FLAT = (20.0, 40.0)
"""% of a cycle in which the foot stands flat and tells how fast the ground moves."""
STRIDE_UNITS: Mapping[str, str] = {
    "cadence": "steps/min",
    "speed": "m/s",
    "stride_length": "m",
    "stride_time": "s",
    "step_length": "m",
    "step_time": "s",
    "step_width": "m",
    "stance": "%",
    "double_support": "%",
}
"""Spatio-temporal quantity -> unit."""


@dataclass(frozen=True)
class Stride:
    """The spatio-temporal values of one gait ``cycle`` by name (`STRIDE_UNITS`); one that is not known is missing."""

    cycle: Cycle
    values: Mapping[str, float]


def strides(cycles: Sequence[Cycle], events: Sequence[FootEvent], body: Body, soles: Soles) -> tuple[Stride, ...]:
    """Return the values of all gait cycles.

    Lengths are horizontal: a stride from a heel's place at one strike to its next, relative to the ground, which on a
    treadmill is as fast as the foot that stands on it. A step goes from the other foot's strike to this foot's, its
    length along the stride, its width across it, negative where the feet cross.
    """
    heel = heel_and_toe(body, soles.outline)[0][..., :2]
    gait = [one for one in cycles if one.kind == "gait"]
    return tuple(Stride(one, _values(one, *_other_foot(one, events), heel, soles.time)) for one in gait)


def mean_values(strides: Sequence[Stride], side: str = "both") -> dict[str, tuple[float, float, int]]:
    """Return mean, standard deviation (NaN for one stride) and number of every value that the strides have."""
    out = {}
    for name in STRIDE_UNITS:
        some = [s.values[name] for s in strides if name in s.values and side in ("both", s.cycle.side)]
        if some:
            out[name] = (float(np.mean(some)), float(np.std(some, ddof=1)) if len(some) > 1 else np.nan, len(some))
    return out


def _other_foot(cycle: Cycle, events: Sequence[FootEvent]) -> tuple[float, float]:
    """Return when, s, the other foot leaves and strikes the ground in a cycle; NaN = not known."""
    inside = [one for one in events if one.side != cycle.side and cycle.start < one.time < cycle.end]
    strikes, offs = ([one.time for one in inside if one.down is down] for down in (True, False))
    strike = strikes[0] if len(strikes) == 1 else np.nan
    before = [time for time in offs if time < strike]
    return before[0] if len(before) == 1 else np.nan, strike


def _values(cycle: Cycle, other_off: float, other_strike: float, heel: Array, time: Array) -> dict[str, float]:
    foot = SIDES.index(cycle.side)
    ground = _ground(cycle, heel[:, foot], time)
    start, end = (place_at(heel[:, foot], time, t) for t in (cycle.start, cycle.end))
    stride = end - start - ground * cycle.duration
    length = float(np.linalg.norm(stride))
    values = {
        "cadence": 120.0 / cycle.duration,
        "speed": length / cycle.duration,
        "stride_length": length,
        "stride_time": cycle.duration,
    }
    if np.isfinite(cycle.off):
        values["stance"] = cycle.off_percent
    if np.isfinite(other_strike) and length > 0:
        across = end - place_at(heel[:, 1 - foot], time, other_strike) - ground * (cycle.end - other_strike)
        along = stride / length
        values["step_time"] = cycle.end - other_strike
        values["step_length"] = float(across @ along)
        to_right = float(across[0] * along[1] - across[1] * along[0])
        values["step_width"] = to_right if cycle.side == "right" else -to_right
    double = other_off - cycle.start + max(0.0, cycle.off - other_strike)
    return values | ({"double_support": 100 * double / cycle.duration} if np.isfinite(double) else {})


def _ground(cycle: Cycle, heel: Array, time: Array) -> Array:
    """Return the velocity (2,) m/s of what the foot stands on; zero for a floor."""
    first, last = (cycle.start + share / 100 * cycle.duration for share in _FLAT)
    velocity = (place_at(heel, time, last) - place_at(heel, time, first)) / (last - first)
    return velocity if np.linalg.norm(velocity) > _BELT else np.zeros(2)


def place_at(path: Array, time: Array, when: float) -> Array:
    """Return the place (k,) at an instant s of a path (T, k)."""
    return np.array([np.interp(when, time, column) for column in path.T])
