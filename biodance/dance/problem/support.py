"""The feet of every posture of a dance, those in between included, on which the weight is carried (paper III.E).

Feet change in small steps only: weight is shifted with both feet down, then one foot is lifted, moved or set down while
the other bears everything. So between two foot configurations there are postures in between, both feet down, the weight
over one of them.
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.dance.problem.footprint import feet_on_plate
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import SINGLE, Stance, holding, seat, stance
from biodance.errors import BiodanceError
from biodance.records import SIDES

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
