"""Every joint stays within its range."""

import numpy as np

from biodance.dance.chain import ROOT
from biodance.dance.limits import Margins, repeated
from biodance.dance.state import State

NAME, UNIT, SCALE = "joint_range", "rad", 0.3


def margins(state: State) -> Margins:
    """Return distance to the lower and to the upper stop, (T, 2 joints) rad."""
    limits, angle = state.chain.body.limits, state.x[:, ROOT:]
    rows = np.eye(state.chain.size)[ROOT:]
    value = np.concatenate([angle - limits.lower, limits.upper - angle], axis=1)
    return Margins(value, repeated(np.concatenate([rows, -rows]), len(angle)))
