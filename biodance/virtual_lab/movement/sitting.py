"""A virtual person sits on a stool that stands on a force plate: the pelvis stays on its seat and rocks there, thighs
do not sink into it, legs hang. What the seat does to the person goes through the stool into the plate, which was set to
zero with the stool on it.
"""

import numpy as np

from biodance.body.parts import UPRIGHT
from biodance.motion.ik.legs import Leg, soft_limit
from biodance.records import SIDES, Array
from biodance.virtual_lab.movement.posing import Curves, FootStance, Pose, Z, turn_about
from biodance.virtual_lab.person.person import Person

_FLESH = 0.08
"""m from the seat up to the hip centres: half a thigh."""
LEGS_APART, AHEAD = 0.4, 0.05
"""m between the legs of the stool, and from the hips forward to its middle."""
_SINKS = 0.03
"""m by which the flesh of a thigh lets the knee down below the hip."""
_SOFT = 0.1
"""rad within which a thigh comes to rest on the seat."""


def take_seat(centre: Array, heading: float, rng: np.random.Generator) -> FootStance:
    """Return how somebody sits with the middle of the stool at ``centre`` (2,) m, facing ``heading`` rad: of each side
    the hip's place on the ground where a foot would be, and where the legs of the stool press.
    """
    heading = heading + float(np.radians(1.0) * rng.normal())
    turn = turn_about(Z, np.array([heading]))[0]
    middle = centre + 0.005 * rng.normal(size=2)
    hips, rows = {}, {}
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        row = sign * LEGS_APART / 2
        rows[side] = middle + turn[:2, :2] @ np.array([0.0, row])
        hips[side] = np.array([*(middle + turn[:2, :2] @ np.array([-AHEAD, 0.0])), 0.0])
    return FootStance(heading, hips, dict.fromkeys(SIDES, turn @ UPRIGHT), rows)


def sit(person: Person, pose: Pose, curves: Curves, place: FootStance, hips: float) -> Array:
    """Return q (T, 46) of a ``person`` whose hip centres are ``hips`` m high on the seat at ``place``: the pelvis turns
    about the point under them on which it sits, and the legs do as the ``curves`` say, as far as the seat lets them.
    """
    legs = [Leg.of(person.body, side) for side in SIDES]
    under = np.mean([leg.hip for leg in legs], axis=0) - np.array([0.0, _FLESH, 0.0])
    seat = np.array([*place.ankle["right"][:2], hips - _FLESH])
    q = pose.q.copy()
    q[:, :3] = seat - pose.pelvis_turn @ under
    for side, leg in zip(SIDES, legs, strict=True):
        angle = np.radians(curves[f"{side}_leg"])
        raised = np.arcsin(np.clip(pose.pelvis_turn[:, 2, 0], -1.0, 1.0))
        least = (
            np.arccos(np.clip(_SINKS / (person.size["thigh"] * np.maximum(np.cos(angle[:, 1]), 0.5)), -1.0, 1.0))
            - raised
        )
        angle[:, 0] = np.asarray(-soft_limit(-angle[:, 0], -least, _SOFT))
        angle = np.column_stack([angle, np.zeros(len(angle))])
        own, limits = list(leg.columns), person.body.limits
        below = soft_limit(angle, limits.upper[own], _SOFT)
        q[:, [7 + c for c in own]] = -soft_limit(-below, -limits.lower[own], _SOFT)
    return q
