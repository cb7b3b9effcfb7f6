"""Which joints a movement shows, and of which it contradicts the place that the static trial gave them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.human.skeleton import JOINTS
from biodance.body.human.static_centres import Centres
from biodance.motion.ik.joint_unknowns import HINGES, SIZE, JointUnknowns, own_centre, own_turn
from biodance.records import SIDES, Array, Index

EXCITED = 0.3
"""Share of a joint's prior standard deviation that the movement must remove; below it the static trial's answer is
kept, because what little the markers say of such a joint is soft tissue.
"""
_MORE_PROBABLE = 10.0
"""Natural logarithm by which freeing a kept joint must make the markers more probable: the movement then contradicts
the static trial's place, though it would hardly have shown a joint near it (26 sessions of 14 persons with hips and
ankles near their places: 1.8 at most; a hip 81 mm off, two persons: 53 and 61).
"""


def excited(centres: Centres, theta: Array, information: Array) -> NDArray[np.bool_]:
    """Return (37,) True for the unknowns of the joints of whose standard deviation the movement removes the share
    ``EXCITED``, from the ``information`` (37, 37) at ``theta``.

    A hinge is judged by its axis.
    """
    slope = JointUnknowns(centres).prior(theta)[1]
    before, after = (np.sqrt(np.diag(np.linalg.inv(known))) for known in (slope.T @ slope, information))
    out = np.zeros(SIZE, dtype=bool)
    for joint in JOINTS:
        judged = [own_turn(joint)] if joint in HINGES else list(range(SIZE))[own_centre(joint)]
        out[own_unknowns(joint)] = np.linalg.norm(after[judged]) < (1 - EXCITED) * np.linalg.norm(before[judged])
    return out


def doubted(centres: Centres, wrong: tuple[str, ...]) -> Centres:
    """Return the ``centres`` with the joints that are ``wrong``; one hip alone leaves the middle of the hips there."""
    hips = [centres.place[f"{side}_hip"] for side in SIDES]
    alone = sum(joint.endswith("_hip") for joint in wrong) == 1
    return replace(centres, contradicted=wrong, mid_hip=np.mean(hips, axis=0) if alone else None)


def own_unknowns(joint: str) -> list[int]:
    """Return the unknowns of a joint: its centre, of a hinge also its axis."""
    return [*range(SIZE)[own_centre(joint)], *([own_turn(joint)] if joint in HINGES else [])]


def contradicted(information: Array, gradient: Array, shown: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the joints kept in a fit of the ``shown`` (37,) unknowns that the markers contradict, from the
    ``information`` (37, 37) and ``gradient`` (37,) of the cost there: to first order, freeing one makes them more
    probable by `_MORE_PROBABLE` (natural logarithm) or more.

    A joint that lies far off makes the movement look poor in information about it, so that it would be kept and the
    joints beside it moved in its place.
    """
    free, found = np.flatnonzero(shown), []
    for joint in JOINTS:
        own: Index = np.array(own_unknowns(joint))
        if shown[own].any():
            continue
        across = information[np.ix_(free, own)]
        shared: Array = np.asarray(np.linalg.solve(information[np.ix_(free, free)], across), dtype=float)
        left: Array = information[np.ix_(own, own)] - across.T @ shared
        pull: Array = gradient[own] - shared.T @ gradient[free]
        if 0.5 * float(pull @ np.linalg.solve(left, pull)) >= _MORE_PROBABLE:
            found.append(joint)
    return tuple(found)
