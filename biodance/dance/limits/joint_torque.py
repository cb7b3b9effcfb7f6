"""Every joint torque stays within the strength of the person."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "joint_torque", "N m", 15.0


def margins(state: State) -> Margins:
    """Return distance to the lower and to the upper torque limit, (T, 2 joints) N m; with the weight over one foot of two, (T, 4 joints):
    as the feet share the load, and as that one bears all of it.
    """
    parts = [_margins(state)] + ([_margins(state.alone)] if state.stance.over is not None else [])
    return Margins(np.concatenate([part.value for part in parts], axis=1), np.concatenate([part.slopes for part in parts], axis=2))


def _margins(state: State) -> Margins:
    limits, torque = state.chain.body.limits, state.torque
    value = np.concatenate([torque - limits.torque_lower, limits.torque_upper - torque], axis=1)
    return Margins(value, np.concatenate([state.torque_slopes, -state.torque_slopes], axis=2))
