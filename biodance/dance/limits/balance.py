"""The zero-moment point (at rest: the projected centre of mass) stays inside the reduced base of support (paper eq. 16)."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "balance", "m", 0.03


def margins(state: State) -> Margins:
    """Return distance inside every edge of the reduced support, (T, edges) m."""
    normals, offsets = state.stance.edges
    wrench, slopes = state.wrench, state.wrench_slopes
    lift = wrench[:, 2]
    point = np.stack([-wrench[:, 4] / lift, wrench[:, 3] / lift], axis=1)
    turned = np.stack([-slopes[:, :, 4], slopes[:, :, 3]], axis=2)
    moved = (turned - point[None, :, :, None] * slopes[:, :, None, 2]) / lift[None, :, None, None]
    return Margins(point @ normals.T + offsets, normals @ moved)
