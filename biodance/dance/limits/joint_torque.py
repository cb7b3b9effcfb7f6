"""Every joint torque stays within the strength of the person."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "joint_torque", "N m", 15.0


def margins(state: State) -> Margins:
    """Return distance to the lower and to the upper torque limit, (T, 2 joints) N m."""
    limits, torque = state.chain.body.limits, state.torque
    value = np.concatenate([torque - limits.torque_lower, limits.torque_upper - torque], axis=1)
    return Margins(value, np.concatenate([state.torque_slopes, -state.torque_slopes], axis=2))
