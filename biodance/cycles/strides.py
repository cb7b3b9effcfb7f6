"""The values of every repetition: of walking and running cadence, speed, lengths and times of steps, contact and
flight, margin of stability, vertical stiffness; of a squat, a rise or a jump how deep and high, how much on which foot,
how fast.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.cycles.cut import Cycle, heel_and_toe
from biodance.motion.soles import Soles
from biodance.records import SIDES, Array, FootEvent, Mask, Wrench
from biodance.settings import STANDARD_GRAVITY

_FLAT = (10.0, 25.0)
"""% of a cycle in which the foot stands flat, of runners too, and tells how fast the ground moves: after the loading
response (to 12 %) and before the heel leaves (31 %; Perry and Burnfield 2010, ISBN 978-1-55642-766-4).
"""
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
    "margin_aside": "m",
    "margin_ahead": "m",
    "contact_time": "s",
    "flight_time": "s",
    "vertical_stiffness": "kN/m",
}
"""Spatio-temporal quantity -> unit."""


_RESTS = 0.1
"""s after its strike in which a heel comes to rest: until then it slides by up to 6 cm, by what told the strike."""


@dataclass(frozen=True)
class Stride:
    """The spatio-temporal values of one gait ``cycle`` by name (`STRIDE_UNITS`); one that is not known is missing."""

    cycle: Cycle
    values: Mapping[str, float]


def strides(
    cycles: Sequence[Cycle], events: Sequence[FootEvent], body: Body, soles: Soles, centre: Array
) -> tuple[Stride, ...]:
    """Return the values of all gait cycles; ``centre`` (T, 3) m of mass at the times of the soles.

    Lengths are horizontal: a stride from where a heel comes to rest (`_RESTS`) to its next such place, relative to the
    ground, which on a treadmill is as fast as the foot that stands on it. A step goes from the other foot's place to
    this foot's, its length along the stride, its width across it, negative where the feet cross. Margins: `_margins`.
    Flight, from leaving the ground to the other foot's strike, and stiffness (`vertical_stiffness`) are of running.
    """
    heel, mass, found = heel_and_toe(body, soles.outline)[0][..., :2], float(body.sip.mass.sum()), []
    velocity = np.gradient(centre[:, :2], soles.time, axis=0)
    for one in (one for one in cycles if one.kind == "gait"):
        other_off, other_strike = _other_foot(one, events)
        own, first, last = heel[:, SIDES.index(one.side)], *(one.start + p / 100 * one.duration for p in _FLAT)
        # While it stands the foot goes as the ground does: on a belt backwards.
        ground = (place_at(own, soles.time, last) - place_at(own, soles.time, first)) / (last - first)
        # 0.15 m/s of a standing foot from which the ground is a belt
        ground = ground if np.linalg.norm(ground) > 0.15 else np.zeros(2)  # m/s of what the foot stands on
        # Way of the heel relative to the ground.
        rests = min(_RESTS, soles.time[-1] - one.end)
        start, end = (place_at(own, soles.time, when + rests) for when in (one.start, one.end))
        stride = end - start - ground * one.duration
        values = _values(one, other_off, other_strike, heel, soles.time, ground, stride, rests)
        values |= _margins(one, other_off, other_strike, own, soles, centre, velocity - ground, stride)
        contact, flight = one.off - one.start, other_strike - one.off
        if flight > 0:
            stiffness = 1e-3 * vertical_stiffness(mass, contact, flight)
            values |= {"contact_time": contact, "flight_time": flight, "vertical_stiffness": stiffness}
        found.append(Stride(one, values))
    return tuple(found)


def vertical_stiffness(mass: float, contact: float, flight: float) -> float:
    """Return the stiffness, N/m, of the spring on which a runner of ``mass`` kg bounces who is on the ground for
    ``contact`` s and in the air for ``flight`` s: a half sine of force, over the way that the body goes down in it
    (Morin et al. 2005, doi:10.1123/jab.21.2.167).
    """
    # Impulse over a step: mean force = m g (1 + flight / contact), and a half sine has 2/pi of its peak as its mean.
    largest = mass * STANDARD_GRAVITY * np.pi / 2 * (flight / contact + 1)
    # F sin(pi t / T) / m - g, integrated twice over half the contact to the middle, where the body is lowest.
    down = largest * contact**2 / (mass * np.pi**2) - STANDARD_GRAVITY * contact**2 / 8
    return float(largest / down)


def _margins(
    cycle: Cycle,
    other_off: float,
    other_strike: float,
    heel: Array,
    soles: Soles,
    centre: Array,
    velocity: Array,
    stride: Array,
) -> dict[str, float]:
    """Return by how much the sole reaches beyond the extrapolated centre of mass, m (Hof et al. 2005,
    doi:10.1016/j.jbiomech.2004.03.025): ``margin_aside`` outwards, the least of single support; ``margin_ahead`` along
    the stride, at the strike.

    The extrapolated centre is where centre + velocity / root(g / l) lies over the ground, with l the mean distance of
    the centre of mass from the ``heel`` (T, 2) m while the foot stands; ``velocity`` (T, 2) m/s of the centre and the
    ``stride`` (2,) m are relative to the ground.
    """
    foot, time = SIDES.index(cycle.side), soles.time
    stands = (time >= cycle.start) & (time <= cycle.off)
    if not stands.any() or not np.linalg.norm(stride) > 0:
        return {}
    along = stride / np.linalg.norm(stride)
    # (along_y, -along_x) is to the right.
    outwards = np.array([along[1], -along[0]]) * (1.0 if cycle.side == "right" else -1.0)
    from_heel = centre[stands] - np.column_stack([heel[stands], soles.outline[stands, foot, :, 2].min(axis=1)])
    # 1 / omega of the inverted pendulum: root(l / g).
    pendulum = np.sqrt(np.linalg.norm(from_heel, axis=1).mean() / STANDARD_GRAVITY)
    near = cycle.frames(time)
    beyond = centre[near, :2] + pendulum * velocity[near]
    # Farthest part of the sole along each way, less the extrapolated centre.
    aside, ahead = ((soles.outline[near, foot, :, :2] @ way).max(axis=1) - beyond @ way for way in (outwards, along))
    margins = {"margin_ahead": float(np.interp(cycle.start, time[near], ahead))}
    single = (time[near] >= other_off) & (time[near] <= other_strike)
    return margins | ({"margin_aside": float(aside[single].min())} if single.any() else {})


def mean_values(
    strides: Sequence[Stride], side: str = "both", *, units: Mapping[str, str] = STRIDE_UNITS
) -> dict[str, tuple[float, float, int]]:
    """Return mean, standard deviation (NaN for one stride) and number of every value of ``units`` that they have."""
    out = {}
    for name in units:
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


def _values(
    cycle: Cycle,
    other_off: float,
    other_strike: float,
    heel: Array,
    time: Array,
    ground: Array,
    stride: Array,
    rests: float,
) -> dict[str, float]:
    foot, length = SIDES.index(cycle.side), float(np.linalg.norm(stride))
    values = {
        # Two steps in a stride, 60 s in a minute.
        "cadence": 120.0 / cycle.duration,
        "speed": length / cycle.duration,
        "stride_length": length,
        "stride_time": cycle.duration,
    }
    if np.isfinite(cycle.off):
        values["stance"] = cycle.off_percent
    if np.isfinite(other_strike) and length > 0:
        # From the other foot's place to this one's, at their strikes and at rest; the ground has moved on between them.
        across, between = (
            place_at(heel[:, foot], time, cycle.end + later)
            - place_at(heel[:, 1 - foot], time, other_strike + later)
            - ground * (cycle.end - other_strike)
            for later in (0.0, rests)
        )
        along = stride / length
        values["step_time"] = cycle.end - other_strike
        values["step_length"] = float(between @ along)
        # Cross product with the direction of the stride; soles that roll outwards after the strike widen no step.
        to_right = float(across[0] * along[1] - across[1] * along[0])
        values["step_width"] = to_right if cycle.side == "right" else -to_right
    # Both feet stand from this strike to the other's leaving, and from the other's strike to this leaving.
    double = other_off - cycle.start + float(np.maximum(cycle.off - other_strike, 0.0))  # unknown where either is
    return values | ({"double_support": 100 * double / cycle.duration} if np.isfinite(double) else {})


def place_at(path: Array, time: Array, when: float) -> Array:
    """Return the place (k,) at an instant s of a path (T, k)."""
    return np.array([np.interp(when, time, column) for column in path.T])


LIFT_UNITS: Mapping[str, str] = {
    "duration": "s",
    "depth": "m",
    "height": "m",
    "flight_time": "s",
    "share_right": "%",
    "force_rise": "%/s",
}
"""Quantity of a squat, a rise or a jump -> unit."""
_OVER = 0.1
"""s over which the force rises that its rate is told of: one of the windows of Maffiuletti et al. 2016,
doi:10.1007/s00421-016-3346-6.
"""


def lift(
    cycle: Cycle,
    centre: Array,
    time: Array,
    weight: float,
    feet: Mapping[str, Wrench] | None,
    sure: Mask,
    whole: Mask | None = None,
) -> Stride:
    """Return the values of one squat, rise or jump.

    ``depth`` by how much the ``centre`` (T, 3) m of mass goes down and comes up again, the smaller of both for a squat,
    the way up for a rise, the way down for a jump; ``height`` by how much it rises after a take-off, ``flight_time``
    until the landing. ``share_right`` of the vertical force while the feet push (of a jump until take-off);
    ``force_rise`` the fastest rise of the force of both feet over `_OVER` s, % of the ``weight`` N per s. Shares where
    both ``feet`` are known, each on a plate of its own (``sure`` (T,)), the rise where their sum is (``whole`` (T,), by
    default the same), throughout.
    """
    jump = cycle.kind == "jump"
    inside = (time >= cycle.start) & (time <= (cycle.off if jump else cycle.end))
    height, whole = centre[inside, 2], sure if whole is None else whole
    down, up = height[0] - height.min(), height[-1] - height.min()
    depth = {"squat": min(down, up), "sit_to_stand": up, "jump": down}[cycle.kind]
    values = {"duration": cycle.duration, "depth": float(depth)}
    if jump:
        flies = (time >= cycle.off) & (time <= cycle.end)
        left = float(np.interp(cycle.off, time, centre[:, 2]))
        values |= {"height": float(centre[flies, 2].max()) - left, "flight_time": cycle.end - cycle.off}
    if feet is not None and whole[inside].all():
        right, left_foot = (feet[f"{side}_foot"].force[inside, 2] for side in SIDES)
        total, at = right + left_foot, time[inside]
        later = np.minimum(at + _OVER, at[-1])
        if sure[inside].all():
            values["share_right"] = float(100 * right.sum() / total.sum())
        # Largest gain over `_OVER` s from any instant; near the end the window is shorter, its divisor is not.
        values["force_rise"] = float(100 * ((np.interp(later, at, total) - total) / _OVER).max() / weight)
    return Stride(cycle, values)
