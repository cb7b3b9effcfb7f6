"""The feet of every posture of a dance (paper III.E), set so that they fit on the force plate that is there. They
change in small steps: weight is shifted with both feet down, then one foot is lifted, moved or set down.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.dance.problem.plan import LEAST_FORWARD, LEAST_WIDE, Plan
from biodance.dance.problem.stance import SINGLE, Stance, apart, holding, seat, stance
from biodance.errors import BiodanceError
from biodance.records import SIDES, Array

AROUND = 0.025
"""m of plate around the soles: nobody stands exactly on the marks, and soles are known to about 1 cm."""


def room_on_plates(stances: Iterable[Stance]) -> Array:
    """Return how much plate (2,) m, from side to side and ahead as the person faces, all these feet need together:
    their soles with `AROUND` on every side, and the legs of a stool.
    """
    low, high = _ends(stances)
    # Lab axes are (ahead, left); room is told from side to side first.
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
    # Plate sizes are (from side to side, ahead), the lab's x is ahead.
    half = np.array(plate[::-1]) / 2
    return (low + high) / 2 + half * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])


def feet_on_plate(body: Body, plan: Plan) -> tuple[float, float]:
    """Return ``wide`` and ``forward`` of a plan, reduced where its plate asks for it: all feet fit on the plate.

    Raises
    ------
    BiodanceError
        The plate is too small for feet as near to each other as is legal, or for the stool.
    """
    if plan.plate is None:
        return plan.wide, plan.forward
    wide, forward, least = _nearer(body, plan, plan.plate)
    if not _fits(least, plan.plate):
        turned = plan.plate[::-1]
        raise BiodanceError(_too_small(plan, plan.plate, least, turned=_fits(_nearer(body, plan, turned)[2], turned)))
    return wide, forward


def _nearer(body: Body, plan: Plan, plate: tuple[float, float]) -> tuple[float, float, Array]:
    """Return ``wide`` and ``forward`` as near to the plan's as a ``plate`` asks for, and the room (2,) m."""
    over = np.maximum(_room(body, plan, plan.wide, plan.forward) - plate, 0.0)
    wide, forward = plan.wide, plan.forward
    if over[0] > 0:
        # apart(body, 1) is the distance at wide = 1.
        wide = max((apart(body, plan.share, wide=wide) - float(over[0])) / apart(body, 1.0), LEAST_WIDE)
    if over[1] > 0:
        forward = max(forward - float(over[1]), LEAST_FORWARD)
    return wide, forward, _room(body, plan, wide, forward)


def _fits(room: Array, plate: tuple[float, float]) -> bool:
    return bool(np.all(room <= np.array(plate) + 1e-9))


def _room(body: Body, plan: Plan, wide: float, forward: float) -> Array:
    if plan.seated:
        return room_on_plates([seat(body, share=plan.share)])
    ahead = {0.0, *(forward for name, _ in plan.blocks if name == "right_forward")}
    return room_on_plates(stance(body, "parallel", right=right, share=plan.share, wide=wide) for right in ahead)


def _too_small(plan: Plan, plate: tuple[float, float], least: Array, *, turned: bool) -> str:
    side, ahead = plate
    nearest = "" if plan.seated else ", as near together as is legal"
    remedy = f"Let the person face across it (--plate {ahead:g},{side:g})" if turned else "Use a larger plate"
    size = f"{least[0]:.2f} m of force plate from side to side and {least[1]:.2f} m ahead"
    around = f"the feet need {size}, {100 * AROUND:g} cm around them included"
    needed = f"the stool's legs need {size}" if plan.seated else around
    return (
        f"Plan {plan.name}: on a plate of {side:g} m from side to side and {ahead:g} m ahead "
        f"{needed}{nearest}. {remedy}, or two plates side by side that touch, a foot on each."
    )


RIGHT, LEFT = 0, 1


def support_sequence(body: Body, plan: Plan) -> tuple[Stance, ...]:
    """Return the stance of every posture of a plan in order, those in between (``over`` one foot) included; it ends on
    both feet.

    Where the person may not stand alone on the left leg nobody steps: all double support is danced on the first pair of
    feet.

    Raises
    ------
    BiodanceError
        The plan changes between standing and sitting.
    """
    names = [name for name, _ in plan.blocks]
    if "seated" in names and len(names) > 1:
        raise BiodanceError(
            f"Plan {plan.name}: blocks {', '.join(names)} mix sitting and standing, and nobody can be planned onto a "
            "stool; make two plans, one seated and one standing."
        )
    doubles = [name for name in names if name in ("parallel", "right_forward")] or ["parallel"]
    feet, out = _double(body, plan, doubles[0]), list[Stance]()
    for name, count in plan.blocks:
        if name in doubles and "left" in plan.alone:
            feet = _double(body, plan, name)
        if name == "seated":
            target = _quiet(seat(body, share=plan.share, height=plan.seat_height), plan)
        else:
            target = feet.on(*SINGLE[name]) if name in SINGLE else feet
        out += [*(weight_shifts(out[-1], target) if out else ()), *[target] * count]
    if len(out[-1].planted) == 1:
        out.append(_over(out[-1], out[-1].planted[0]))
    return tuple(out)


def within_cards(body: Body, plan: Plan) -> Plan:
    """Return the plan with at most so many postures as it has ``cards``, those in between among them: one after the
    other of the feet with most is left out.
    """
    while len(support_sequence(body, plan)) > plan.cards:
        most = max(plan.blocks, key=lambda block: block[1])
        fewer = [(name, count - ((name, count) == most)) for name, count in plan.blocks]
        plan = replace(plan, blocks=tuple((name, count) for name, count in fewer if count))
    return plan


def _double(body: Body, plan: Plan, name: str) -> Stance:
    wide, forward = feet_on_plate(body, plan)
    feet = stance(body, name, right=forward if name == "right_forward" else 0.0, share=plan.share, wide=wide)
    return _quiet(holding(feet, body, plan.holds), plan)


def _quiet(feet: Stance, plan: Plan) -> Stance:
    return replace(feet, hanging=tuple(side for side in (RIGHT, LEFT) if SIDES[side] in plan.hanging))


def _over(feet: Stance, side: int) -> Stance:
    """Return the stance with both feet down and the weight over one."""
    return replace(feet.on(RIGHT, LEFT), over=side)


def weight_shifts(last: Stance, goal: Stance) -> list[Stance]:
    """Return the postures in between from one stance to another: set down, shift, step with the right foot, shift."""
    over = last.planted[0] if len(last.planted) == 1 else None
    out = [_over(last, over)] if over is not None and goal.planted != last.planted else []
    if not np.array_equal(last.ankle, goal.ankle):
        out += [_over(last, LEFT)] if over != LEFT else []
        out.append(_over(goal, over := LEFT))
    if len(goal.planted) == 1 and goal.planted != last.planted and over != goal.planted[0]:
        out.append(_over(goal, goal.planted[0]))
    return out
