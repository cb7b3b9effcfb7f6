"""A stretch of any motion, as the check of every limit sees it: an ordinary Motion of the body, nothing of the design's
coordinates.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.dance.problem.stance import Stance
from biodance.motion.dynamics import distribute, joint_torques
from biodance.motion.kinematics import Poses, poses
from biodance.motion.regressor import predict_wrench
from biodance.records import SIDES, Array, Motion, Wrench


@dataclass(frozen=True, eq=False)
class Remaining:
    """What is left of a limit: ``value`` (T, m) in its unit, negative where it is broken; ``of`` (m) which joint, side
    or pair.
    """

    value: Array
    of: tuple[str, ...]


NOTHING = Remaining(np.empty((0, 0)), ())
"""Of a limit that has nothing to say about a motion."""


@dataclass(frozen=True, eq=False)
class CheckedMotion:
    """``motion`` of ``body`` on the feet of ``stance``, which do not change."""

    body: Body
    motion: Motion
    stance: Stance

    @cached_property
    def pose(self) -> Poses:
        """Where every segment is."""
        return poses(self.body, self.motion.q)

    @cached_property
    def wrench(self) -> Wrench:
        """What the motion needs from the ground, by the regressor."""
        return predict_wrench(self.body, self.motion)

    @cached_property
    def soles(self) -> tuple[Array, Array]:
        """Outlines (T, P, 3) m of the right and the left sole, lab frame, where they really are."""
        feet = (self.body.feet[side] for side in SIDES)
        right, left = (self.pose.points([foot.segment] * len(foot.outline), foot.outline) for foot in feet)
        return right, left

    @property
    def joints(self) -> tuple[str, ...]:
        """Names (n) of the joints."""
        return tuple(joint.name for joint in self.body.joints)

    @property
    def bases(self) -> tuple[tuple[int, ...], ...]:
        """Sets of feet (0 right, 1 left) each of which may be asked to bear everything."""
        return (self.stance.planted,) if self.stance.over is None else (self.stance.planted, (self.stance.over,))

    def torques(self, bearing: tuple[int, ...]) -> Array:
        """Return the torques (T, n) N·m of the joints, by pinocchio's inverse dynamics, when the feet ``bearing`` carry
        everything.
        """
        touching = np.tile([side in bearing for side in (0, 1)], (self.motion.time.size, 1))
        loads = {}
        if bearing:
            right, left = (sole.mean(axis=1) for sole in self.soles)
            parts = distribute(self.wrench, right, left, touching)
            names = [self.body.segments[self.body.feet[side].segment] for side in SIDES]
            loads = dict(zip(names, parts, strict=True))
        return joint_torques(self.body, self.motion, loads).torque
