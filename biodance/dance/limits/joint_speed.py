"""No joint turns faster than its limit (``Body.limits``)."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.state import State


@dataclass(frozen=True)
class JointSpeed(Limit):
    """``share`` of every joint's greatest speed that may be used."""

    share: float = bounded(1.0, 0.1, 1.0)
    name, unit, scale, at_rest = "joint_speed", "rad/s", 1.0, False
    mended_by_slowness = True

    def margins(self, state: State) -> Margins:
        """Return speed that is left, (T, joints) rad/s."""
        rate = state.v[:, ROOT:]
        slope = -np.sign(rate)[:, :, None] * np.eye(state.chain.size)[ROOT:]
        # Slopes by x are zero, by v the sign.
        return Margins(self.share * state.chain.body.limits.velocity - np.abs(rate), np.stack([0 * slope, slope]))

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return speed that is left, (T, joints) rad/s."""
        rate = np.abs(motion.motion.v[:, -len(motion.joints) :])
        return Remaining(self.share * motion.body.limits.velocity - rate, motion.joints)


LIMIT = JointSpeed
