"""Jumps from both feet: when they begin, leave the ground and come down again, by the tracked body and the plates; and
what a squat, a rise from a chair or a jump is told by: how deep and high, how much on which foot, how fast.
"""

from collections.abc import Mapping

import numpy as np

from biodance.cycles.cut import FORCE_DOWN, Cycle
from biodance.cycles.strides import Stride
from biodance.motion.soles import Soles
from biodance.records import SIDES, Array, Mask, Motion, Wrench

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


_RISES = 0.05
"""m that the centre of mass comes down again on either side of the highest point of a jump, at least."""
_CLEAR = 0.04
"""m over its lowest place before and after at which a sole is in the air at the highest point of a jump."""
_LEAVES = 0.02
"""m over that place at which it has left the ground: toes press 1 to 2 cm into shoe and skin."""
_NEAR = 0.6
"""s before and after the highest point in which the feet stand: half the flight of a jump of 0.45 m, and a contact."""
_SHORTEST = 0.1  # s in the air: less is a hop in a march
_TOGETHER = 0.12
"""s within which both feet leave the ground: who runs has one in the air long before."""
_UP = 0.1
"""Of its way down within which a countermovement has not begun, as of squats."""


def jumps(
    trial: str,
    motion: Motion,
    soles: Soles,
    centre: Array,
    feet: Mapping[str, Wrench] | None,
    known: Mask,
) -> tuple[Cycle, ...]:
    """Return the jumps of a trial; ``centre`` (T, 3) m of mass.

    A jump leaves the ground with both feet and comes down as high as it left. It begins where the centre of mass starts
    to go down before it, or, after a flight (a drop, another jump), with that landing; ``off`` is the take-off;
    it ends with the landing. Both are where the force of both ``feet`` passes `FORCE_DOWN` in frames in which it is
    ``known`` (T, 2), else where the soles are `_LEAVES` over the ground.
    """
    from scipy.signal import find_peaks

    height, time = centre[:, 2], motion.time
    sole, near = soles.outline[..., 2].min(axis=2), max(1, round(_NEAR * motion.rate))
    # `_RISES` on either side of a top.
    tops, _ = find_peaks(height, prominence=_RISES)
    flights = [flight for top in tops if (flight := _flight(sole, int(top), near, motion.determined)) is not None]
    found = [_cycle(trial, time, height, one) for one in flights if time[one[2]] - time[one[1]] >= _SHORTEST]
    if feet is None:
        return tuple(found)
    total = feet["right_foot"].force[:, 2] + feet["left_foot"].force[:, 2]
    return tuple(_by_force(one, time, total, np.asarray(known.all(axis=1))) for one in found)


def _flight(sole: Array, top: int, near: int, determined: Mask) -> tuple[int, int, int] | None:
    """Return where the contact before a highest point begins, its last frame, and the first one on the ground again;
    None where both feet do not fly.

    ``sole`` (T, 2) m height of the lowest part of each.
    """
    before, after = sole[max(0, top - near) : top + 1], sole[top : top + near]
    ground = np.stack([before.min(axis=0), after.min(axis=0)])
    # Both soles are clear of the ground, and it is as high before as after.
    if not (sole[top] > ground + _CLEAR).all() or np.abs(ground[1] - ground[0]).max() > _CLEAR:
        return None
    # Backwards from the top: the last frame in which each foot is at the ground.
    left = [top - int(np.argmax((before[:, foot] < ground[0, foot] + _LEAVES)[::-1])) for foot in (0, 1)]
    down = [top + int(np.argmax(after[:, foot] < ground[1, foot] + _LEAVES)) for foot in (0, 1)]
    first, last = max(left), min(down)
    # `near` frames are `_NEAR` s: `_TOGETHER` s in frames.
    if not determined[first : last + 1].all() or first - min(left) > near * _TOGETHER / _NEAR:
        return None
    # Since when at least one foot has been on the ground: a flight before it is another one.
    above = np.flatnonzero((sole[:first] > ground[0] + _LEAVES).all(axis=1))
    return (int(above[-1]) + 1 if above.size else 0), first, last


def _cycle(trial: str, time: Array, height: Array, flight: tuple[int, int, int]) -> Cycle:
    """Return the jump with a ``flight`` (`_flight`)."""
    landed, off, down = flight
    # From the last sinking frame before take-off: all after it is the push.
    sinks = np.flatnonzero(np.diff(height[landed : off + 1]) < 0)
    lowest = landed + (int(sinks[-1]) + 1 if sinks.size else 0)  # where the last rise before the take-off begins
    way = height[landed : lowest + 1].max() - height[lowest]
    # The last frame that is within `_UP` of the way down from its top.
    high = np.flatnonzero(height[landed : lowest + 1] >= height[lowest] + (1 - _UP) * way)
    return Cycle(trial, "jump", "both", float(time[landed + high[-1]]), float(time[down]), float(time[off]))


def _by_force(cycle: Cycle, time: Array, total: Array, sure: Mask) -> Cycle:
    """Return a jump with take-off and landing where the force tells them."""
    ends = {}
    for name, at, falls in (("off", cycle.off, True), ("end", cycle.end, False)):
        near = np.flatnonzero(np.abs(time[:-1] - at) < _TOGETHER)
        down = total > FORCE_DOWN
        passes = [i for i in near if sure[i] and sure[i + 1] and down[i] == falls and down[i + 1] != falls]
        if passes:
            i = min(passes, key=lambda k: abs(time[k] - at))
            share = (FORCE_DOWN - total[i]) / (total[i + 1] - total[i])
            ends[name] = float(time[i] + share * (time[i + 1] - time[i]))
    off, end = ends.get("off", cycle.off), ends.get("end", cycle.end)
    return Cycle(cycle.trial, cycle.kind, cycle.side, cycle.start, end, off)
