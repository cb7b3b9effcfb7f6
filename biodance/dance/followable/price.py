"""What it costs that a dance can be followed: the same words, chosen freely."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.followable.walk import Walk
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import under
from biodance.dance.transitions.context import DesignContext
from biodance.dance.transitions.move import straight_way


def freer_dance(body: Body, plan: Plan, *, seed: int = 0) -> Dance:
    """Return the dance of as many postures on the same feet, of the same words, of which each may be anything and
    telling most is all that counts: no limit on instructions, no ``simplicity``. Its postures keep the limits and suit
    imprecise people; its moves go straight and nobody has looked at them, so that it is there to compare only.
    """
    free = replace(plan, instructions=np.inf, simplicity=0.0)
    stances = support_sequence(body, free)
    steps = Walk(DesignContext.alone(body, free, seed)).choose(stances)
    x, hold = np.array([step.x for step in steps]), np.full(len(steps), plan.hold)
    via, move = straight_way(x[:-1], x[1:]), np.full(len(x) - 1, plan.move)
    return Dance(plan.name, body, x, stances, hold, via, move, tuple(under(*pair) for pair in pairwise(stances)), seed)
