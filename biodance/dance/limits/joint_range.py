"""Every joint stays within its range (``Body.limits``)."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.state import State


@dataclass(frozen=True)
class JointRange(Limit):
    """``keep`` degrees of every joint's range that are left unused at both stops."""

    keep: float = bounded(0.0, 0.0, 20.0, "degrees")
    name, unit, scale, suspicion = "joint_range", "rad", 0.3, 20

    def margins(self, state: State) -> Margins:
        """Return distance to the lower and to the upper stop, (T, 2 joints) rad."""
        limits, angle = state.chain.body.limits, state.x[:, ROOT:]
        rows = np.eye(state.chain.size)[ROOT:]
        value = np.concatenate([angle - limits.lower, limits.upper - angle], axis=1) - np.radians(self.keep)
        # Constant slopes: the angle is a coordinate itself.
        slopes = np.broadcast_to(np.concatenate([rows, -rows]), (1, len(angle), 2 * len(rows), state.chain.size))
        return Margins(value, slopes)

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the distance to the nearer stop, (T, joints) rad."""
        limits, angle = motion.body.limits, motion.motion.q[:, -len(motion.joints) :]
        spare = np.minimum(angle - limits.lower, limits.upper - angle) - np.radians(self.keep)
        return Remaining(spare, motion.joints)


LIMIT = JointRange
