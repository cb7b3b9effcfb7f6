"""Planted feet stay where they are: the legs, solved in closed form, reach them with the knee not quite straight."""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded, unconcerned
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State
from biodance.motion.kinematics import poses
from biodance.records import SIDES

_STILL = 1e-6  # m, rad: how far a planted foot may be from where it stands: rounding


@dataclass(frozen=True)
class FootPlacement(Limit):
    """``least_knee`` degrees of flexion: the closed-form legs bend reach smoothly over the last 2 mm, and nobody is
    asked to lock the knees.
    """

    least_knee: float = bounded(9.0, 3.0, 60.0, "degrees")
    name, unit, scale, suspicion = "foot_placement", "m", 0.03, 80
    move_reserve = 0.3  # legs are singular when straight

    def hold_reserve(self, stance: Stance) -> float:
        """More than others': straight legs are singular."""
        return 0.4

    def straight_reserve(self, stance: Stance) -> float:
        """Less: nothing is sought on a straight way."""
        return 0.05

    def margins(self, state: State) -> Margins:
        """Return how much longer each planted leg could be, (T, planted feet) m; none for hanging legs."""
        if not state.stance.planted:
            return unconcerned(state)
        hips = [state.chain.legs[side] for side in state.stance.planted]
        place, slope = state.points([0] * len(hips), np.array([leg.hip for leg in hips]))
        away = place - state.stance.ankle[list(state.stance.planted)]
        distance = np.linalg.norm(away, axis=2)
        longest = np.array([float(leg.length(np.radians(self.least_knee))) for leg in hips])
        # d|r| = r dr / |r|.
        return Margins(longest - distance, -np.einsum("tkc,tkcn->tkn", away / distance[..., None], slope)[None])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return how much longer each planted leg could be, or how far its foot is from where it stands, negative, (T,
        planted feet) m.

        The reach of legs whose hip is no single point (some robots') is not judged, only their feet.
        """
        sides = list(motion.stance.planted)
        segments = [motion.body.feet[SIDES[side]].segment for side in sides]
        moved = np.linalg.norm(motion.pose.position[:, segments] - motion.stance.ankle[sides], axis=2)
        # Largest element of R - R_upright: a small angle, rad.
        turned = np.abs(motion.pose.rotation[:, segments] - UPRIGHT).max(axis=(2, 3), initial=0.0)
        off = np.maximum(moved, turned)
        left = _STILL - off
        for k, side in enumerate(sides):
            if leg := _measured(motion.body, SIDES[side], np.radians(self.least_knee)):
                thigh, longest = leg
                reach = longest - np.linalg.norm(motion.pose.position[:, thigh] - motion.stance.ankle[side], axis=1)
                left[:, k] = np.where(off[:, k] > _STILL, np.minimum(left[:, k], reach), reach)
        return Remaining(left, tuple(SIDES[side] for side in sides))


LIMIT = FootPlacement


def _measured(body: Body, side: str, knee: float) -> tuple[int, float] | None:
    """Return the thigh and the hip-ankle distance m with the ``knee`` bent; None where axes do not meet."""
    foot = body.feet[side].segment
    path = body.path_to(foot)
    spread = [body.joints[j].translation for j in (*path[1:3], *path[5:])]
    if not np.allclose(spread, 0.0, atol=1e-12):
        return None
    q = body.neutral.copy()
    q[len(q) - len(body.joints) + path[3]] = knee
    pose, thigh = poses(body, q[None]), body.segment_joint.index(path[2])
    return thigh, float(np.linalg.norm(pose.position[0, thigh] - pose.position[0, foot]))
