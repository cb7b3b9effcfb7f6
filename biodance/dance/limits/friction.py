"""No foot slips: the force stays inside the friction pyramid, mu F_z >= |F_x|, |F_y| with mu = 0.5 (paper eq. 19, printed inverted).

Both feet's forces point the same way (``feet.foot_forces``), so that the total decides for each of them.
"""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "friction", "N", 100.0
MU = 0.5


def margins(state: State) -> Margins:
    """Return the horizontal force that is left along x and y, (T, 2) N."""
    force, slopes = state.wrench[:, :3], state.wrench_slopes
    sign = np.sign(force[:, :2])[None, :, :, None]
    return Margins(MU * force[:, 2:] - np.abs(force[:, :2]), MU * slopes[:, :, 2:3] - sign * slopes[:, :, :2])
