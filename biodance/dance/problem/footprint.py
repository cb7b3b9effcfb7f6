"""How much of a force plate a dance stands on, and feet set so that they fit on the plate that is there."""

from collections.abc import Iterable

import numpy as np

from biodance.body.body import Body
from biodance.dance.problem.plan import LEAST_FORWARD, LEAST_WIDE, Plan
from biodance.dance.problem.stance import Stance, apart, seat, stance
from biodance.errors import BiodanceError
from biodance.records import Array

AROUND = 0.025
"""m of plate around the soles: nobody stands exactly on the marks, and soles are known to about 1 cm."""
_ROUNDING = 1e-9
"""m."""


def room_on_plates(stances: Iterable[Stance]) -> Array:
    """Return how much plate (2,) m, from side to side and ahead as the person faces, all these feet need together:
    their soles with `AROUND` on every side, and the legs of a stool.
    """
    low, high = _ends(stances)
    return np.asarray((high - low)[::-1])


def _ends(stances: Iterable[Stance]) -> tuple[Array, Array]:
    """Return the least and the greatest place (2,) m of what must lie on plates."""
    points = []
    for one in stances:
        soles = one.soles[list(one.planted), :, :2].reshape(-1, 2)
        points += [soles - AROUND, soles + AROUND, one.props]
    found = np.concatenate(points)
    return found.min(axis=0), found.max(axis=0)


def plate_corners(stances: Iterable[Stance], plate: tuple[float, float]) -> Array:
    """Return the corners (4, 2) m, in order, of a ``plate`` (m from side to side and ahead) with all these feet in its
    middle.
    """
    low, high = _ends(stances)
    half = np.array(plate[::-1]) / 2
    return (low + high) / 2 + half * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])


def room_in_words(room: Array, *, seated: bool = False) -> str:
    """Return in a phrase how much plate a dance needs (`room_on_plates`)."""
    size = f"{room[0]:.2f} m of force plate from side to side and {room[1]:.2f} m ahead"
    around = f"the feet need {size}, {100 * AROUND:g} cm around them included"
    return f"the stool's legs need {size}" if seated else around


def feet_on_plate(body: Body, plan: Plan) -> tuple[float, float]:
    """Return ``wide`` and ``forward`` of a plan, reduced where its plate asks for it: all feet fit on the plate.

    Raises
    ------
    BiodanceError
        The plate is too small for feet as near to each other as is legal, or for the stool.
    """
    if plan.plate is None:
        return plan.wide, plan.forward
    over = np.maximum(_room(body, plan, plan.wide, plan.forward) - plan.plate, 0.0)
    wide, forward = plan.wide, plan.forward
    if over[0] > 0:
        wide = max((apart(body, plan.share, wide=wide) - float(over[0])) / apart(body, 1.0), LEAST_WIDE)
    if over[1] > 0:
        forward = max(forward - float(over[1]), LEAST_FORWARD)
    least = _room(body, plan, wide, forward)
    if np.any(least > np.array(plan.plate) + _ROUNDING):
        raise BiodanceError(_too_small(plan, plan.plate, least))
    return wide, forward


def _room(body: Body, plan: Plan, wide: float, forward: float) -> Array:
    if plan.seated:
        return room_on_plates([seat(body, share=plan.share)])
    ahead = {0.0, *(forward for name, _ in plan.blocks if name == "right_forward")}
    return room_on_plates(stance(body, "parallel", right=right, share=plan.share, wide=wide) for right in ahead)


def _too_small(plan: Plan, plate: tuple[float, float], least: Array) -> str:
    side, ahead = plate
    turned = bool(np.all(least <= np.array([ahead, side]) + _ROUNDING))
    nearest = "" if plan.seated else ", as near together as is legal"
    remedy = f"Let the person face across it (--plate {ahead:g},{side:g})" if turned else "Use a larger plate"
    return (
        f"Plan {plan.name}: on a plate of {side:g} m from side to side and {ahead:g} m ahead "
        f"{room_in_words(least, seated=plan.seated)}{nearest}. {remedy}, or two plates side by "
        f"side that touch, a foot on each."
    )
