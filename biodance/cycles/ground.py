"""What the ground does to a foot in its gait cycle: the reaction in % of body weight, and where it presses the sole."""

from collections.abc import Iterator, Mapping

import numpy as np

from biodance.body.body import Body
from biodance.cycles.curves import CycleCurve, direction_of, over_cycle
from biodance.cycles.cut import Cycle, heel_and_toe
from biodance.motion.kinematics import poses
from biodance.motion.soles import Soles
from biodance.records import SIDES, Array, Mask, Motion, Wrench
from biodance.settings import STANDARD_GRAVITY
from biodance.spatial import zero_moment_point

_PRESSES = 0.05
"""Share of body weight below which a centre of pressure is mostly noise."""


def ground_curves(
    cycle: Cycle, body: Body, motion: Motion, soles: Soles, feet: Mapping[str, Wrench], known: Mask
) -> Iterator[CycleCurve]:
    """Yield the ground reaction on the foot of a gait cycle (% of body weight) and its centre of pressure (m).

    The reaction forwards along the way of walking, inwards (towards the other foot) and up is positive; zero in the
    swing. The centre of pressure lies `pressure_ahead` of the heel along the sole and `pressure_outward` of its line
    from heel to toe; NaN where the foot carries less than `_PRESSES` of the weight. ``feet`` the wrenches on the right
    and the left foot, ``known`` (T, 2) where they are known: elsewhere all are NaN.
    """
    if cycle.side not in SIDES:
        return
    foot, outwards, part = SIDES.index(cycle.side), 1.0 if cycle.side == "right" else -1.0, cycle.frames(motion.time)
    wrench, weight = feet[f"{cycle.side}_foot"].value[part], STANDARD_GRAVITY * float(body.sip.mass.sum())
    time, told = motion.time[part], known[part, foot]
    x, y = direction_of(cycle, poses(body, motion.q[part]), time)
    carries = np.where(time > cycle.off, 0.0, 100 / weight)
    shown = np.where(told, carries, np.nan)
    inwards = -outwards * (wrench[:, :2] @ [y, -x])
    for name, force in (("forward", wrench[:, :2] @ [x, y]), ("inward", inwards), ("up", wrench[:, 2])):
        yield over_cycle(cycle, f"ground_reaction_{name}", cycle.side, "%", time, shown * force)
    ahead, aside = _on_sole(body, soles.outline[part], foot, wrench, threshold=_PRESSES * weight)
    inside = np.where(told, 1.0, np.nan)
    for name, place in (("ahead", ahead), ("outward", outwards * aside)):
        yield over_cycle(cycle, f"pressure_{name}", cycle.side, "m", time, inside * place)


def _on_sole(body: Body, outline: Array, foot: int, wrench: Array, *, threshold: float) -> tuple[Array, Array]:
    """Return where the pressure lies ahead of the heel along the sole of an ``outline`` (T, 2, P, 3) m and to the right
    of that line, (T,) m each.
    """
    heel, toe = (place[:, foot, :2] for place in heel_and_toe(body, outline))
    along = (toe - heel) / np.linalg.norm(toe - heel, axis=1, keepdims=True)
    height = outline[:, foot, :, 2].min(axis=1)
    from_heel = zero_moment_point(wrench, height=height, threshold=threshold)[:, :2] - heel
    ahead = np.einsum("tk,tk->t", from_heel, along)
    return ahead, from_heel[:, 0] * along[:, 1] - from_heel[:, 1] * along[:, 0]
