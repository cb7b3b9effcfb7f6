"""No joint turns faster than its limit."""

import numpy as np

from biodance.dance.chain import ROOT
from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "joint_speed", "rad/s", 1.0


def margins(state: State) -> Margins:
    """Return speed that is left, (T, joints) rad/s."""
    rate = state.v[:, ROOT:]
    slope = -np.sign(rate)[:, :, None] * np.eye(state.chain.size)[ROOT:]
    return Margins(state.chain.body.limits.velocity - np.abs(rate), np.stack([0 * slope, slope]))
