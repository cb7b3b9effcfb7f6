"""What a squat, a rise from a chair or a jump is told by: how deep and high, how much on which foot, how fast."""

from collections.abc import Mapping

import numpy as np

from biodance.cycles.cut import Cycle
from biodance.cycles.strides import Stride
from biodance.records import SIDES, Array, Mask, Wrench

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
        values["force_rise"] = float(100 * ((np.interp(later, at, total) - total) / _OVER).max() / weight)
    return Stride(cycle, values)
