"""Every joint torque stays within the strength of the person (``Body.limits``)."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded
from biodance.dance.problem.state import State
from biodance.records import Array


@dataclass(frozen=True)
class JointTorque(Limit):
    """``share`` of every joint's strength that may be used."""

    share: float = bounded(1.0, 0.1, 1.0)
    name, unit, scale, suspicion = "joint_torque", "N m", 15.0, 10
    mended_by_slowness = True

    def margins(self, state: State) -> Margins:
        """Return distance to the lower and to the upper torque limit, (T, 2 joints) N m; with the weight over one foot
        of two, (T, 4 joints): as the feet share the load, and as that one bears all of it.
        """
        limits, value, slopes = state.chain.body.limits, list[Array](), list[Array]()
        low, high = self.share * limits.torque_lower, self.share * limits.torque_upper
        for one in (state, *([state.alone] if state.stance.over is not None else [])):
            value += [one.torque - low, high - one.torque]
            slopes += [one.torque_slopes, -one.torque_slopes]
        return Margins(np.concatenate(value, axis=1), np.concatenate(slopes, axis=2))

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the distance to the nearer torque limit, (T, joints) N m, whichever feet bear the load."""
        limits = motion.body.limits
        low, high = self.share * limits.torque_lower, self.share * limits.torque_upper
        torques = [motion.torques(base) for base in motion.bases]
        return Remaining(np.min([np.minimum(torque - low, high - torque) for torque in torques], axis=0), motion.joints)


LIMIT = JointTorque
