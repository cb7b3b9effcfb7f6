"""What a squat or a rise from a chair is told by: how deep, how much on which foot, how fast the force rises."""

from collections.abc import Mapping

import numpy as np

from biodance.cycles.cut import Cycle
from biodance.cycles.strides import Stride
from biodance.records import SIDES, Array, Mask, Wrench

LIFT_UNITS: Mapping[str, str] = {"duration": "s", "depth": "m", "share_right": "%", "force_rise": "%/s"}
"""Quantity of a squat or a rise -> unit."""
_OVER = 0.1
"""s over which the force rises that its rate is told of."""


def lift(
    cycle: Cycle, centre: Array, time: Array, weight: float, feet: Mapping[str, Wrench] | None, sure: Mask
) -> Stride:
    """Return the values of one squat or rise.

    ``depth`` by how much the ``centre`` (T, 3) m of mass goes down and comes up again, the smaller of both for a squat,
    the way up for a rise; ``share_right`` of the vertical force over the repetition; ``force_rise`` the fastest rise of
    the force of both feet over `_OVER` s, % of the ``weight`` N per s. The last two where ``sure`` (T,): both ``feet``
    are known, each on a plate of its own, throughout.
    """
    inside = (time >= cycle.start) & (time <= cycle.end)
    height = centre[inside, 2]
    down, up = height[0] - height.min(), height[-1] - height.min()
    values = {"duration": cycle.duration, "depth": float(min(down, up) if cycle.kind == "squat" else up)}
    if feet is not None and sure[inside].all():
        right, left = (feet[f"{side}_foot"].force[inside, 2] for side in SIDES)
        total, at = right + left, time[inside]
        later = np.minimum(at + _OVER, at[-1])
        values["share_right"] = float(100 * right.sum() / total.sum())
        values["force_rise"] = float(100 * ((np.interp(later, at, total) - total) / _OVER).max() / weight)
    return Stride(cycle, values)
