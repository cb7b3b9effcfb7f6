"""No foot slips: the force stays inside the friction pyramid, mu F_z >= |F_x|, |F_y| (paper eq. 19, printed inverted).

Both feet's forces point the same way (`problem.stance.foot_forces`), so that the total decides for each of them.
Standing still needs no friction.
"""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded
from biodance.dance.problem.state import State


@dataclass(frozen=True)
class Friction(Limit):
    """``mu`` the coefficient of friction between soles and ground (paper: 0.5; socks on a smooth plate: 0.3 to 0.4)."""

    mu: float = bounded(0.5, 0.05, 1.5)
    name, unit, scale, at_rest = "friction", "N", 100.0, False
    mended_by_slowness = True

    def margins(self, state: State) -> Margins:
        """Return the horizontal force that is left along x and y, (T, 2) N."""
        force, slopes = state.wrench[:, :3], state.wrench_slopes
        # d|F| = sign(F) dF.
        sign = np.sign(force[:, :2])[None, :, :, None]
        return Margins(
            self.mu * force[:, 2:] - np.abs(force[:, :2]), self.mu * slopes[:, :, 2:3] - sign * slopes[:, :, :2]
        )

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the horizontal force that is left, (T, 2) N, of the regressor's wrench."""
        force = motion.wrench.force
        return Remaining(self.mu * force[:, 2:] - np.abs(force[:, :2]), ("forward", "sideways"))


LIMIT = Friction
