"""The spatio-temporal values of walking: cadence, speed, stride and step length, step width, stance, double support."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.cycles.cut import Cycle, FootEvent, heel_and_toe
from biodance.motion.soles import Soles
from biodance.records import SIDES, Array

_BELT = 0.15  # m/s of a standing foot from which the ground is a belt
_FLAT = (20.0, 40.0)  # % of a cycle in which the foot stands flat and tells how fast the ground moves
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
