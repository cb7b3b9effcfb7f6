"""From rest to the first posture of a robot's dance without anybody's hand: one more move in front (paper Fig. 11).

At rest the robot stands on the feet of the first posture, all joints as near to their zeros as its limits allow. The
way from there keeps all limits as every other move does; the posture at rest is not held and does not count.
"""

from dataclasses import replace

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.postures.posture import intermediate_posture
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.plan import Plan
from biodance.dance.transitions.move import Task
from biodance.dance.transitions.planner import find_way
from biodance.errors import BiodanceError
from biodance.records import Array

_WHERE = 4
"""Beside the seed: what is searched for at random here."""


def rest_posture(dance: Dance, plan: Plan) -> Array:
    """Return the coordinates (n,) of a posture at rest on the feet of the first posture.

    Raises
    ------
    BiodanceError
        There is none within the limits.
    """
    chain, stance = dance.chain, replace(dance.stances[0], over=None)
    zeros = np.zeros((1, chain.size))
    return intermediate_posture(chain, stance, zeros, plan.limits, seed=[dance.seed, _WHERE], mild=1.0).x


def reposition(dance: Dance, plan: Plan) -> Dance:
    """Return the dance with the move from rest in front; where there is none, the dance with a note that says so."""
    try:
        rest = rest_posture(dance, plan)
        ends, feet = np.array([rest, dance.postures[0]]), replace(dance.stances[0], over=None)
        task = Task(dance.chain, excitation_blocks(dance.body), feet, ends, plan.move, plan.limits)
        way = find_way(task, np.zeros((len(dance.body.segments), 6, 6)), [dance.seed, _WHERE])
    except BiodanceError as why:
        return _without(dance, str(why))
    if way.limit:
        return _without(dance, f"the limit {way.limit.replace('_', ' ')} forbids it")
    more = 1 + len(way.stops)
    return replace(
        dance,
        postures=np.concatenate([rest[None], way.stops, dance.postures]),
        stances=(*(feet,) * more, *dance.stances),
        hold=np.concatenate([np.zeros(more), dance.hold]),
        via=np.concatenate([way.via, dance.via]),
        move=np.concatenate([way.duration, dance.move]),
        under=(*(feet,) * more, *dance.under),
    )


def _without(dance: Dance, why: str) -> Dance:
    words = f"The robot must be put into its first posture by hand: there is no way from rest ({why})."
    return replace(dance, notes=(*dance.notes, words))
