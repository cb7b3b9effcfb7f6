"""Ways to walk and run on a belt, by name."""

from dataclasses import dataclass

import numpy as np

from biodance.records import Array


@dataclass(frozen=True)
class Gait:
    """A way to walk or run on a treadmill.

    ``speed`` m/s of the belt; ``stride`` s; ``stance`` share of the stride in which a foot is on the belt (below 0.5:
    running, with flight); ``width`` m between the ankles; ``strike``, ``push`` rad: pitch of the foot, toes up, when it
    lands, heel up when it leaves; ``flat`` shares of stance between which it lies flat; ``clearance`` m by which the
    ankle is lifted in swing; ``dip`` of the vertical force in mid stance (0 = one peak); ``arm``, ``elbow`` rad: swing
    of the upper arms and mean flexion of the elbows; ``lean`` rad of the trunk; ``knee`` rad, their least
    flexion.
    """

    name: str
    speed: float
    stride: float
    stance: float
    width: float
    strike: float
    push: float
    flat: tuple[float, float]
    clearance: float
    dip: float
    arm: float
    elbow: float
    lean: float
    knee: float

    @property
    def contact(self) -> float:
        """Seconds of one stance."""
        return self.stance * self.stride

    @property
    def flight(self) -> float:
        """Seconds of one flight; 0 in walking."""
        return max(0.0, (0.5 - self.stance) * self.stride)

    def since_strike(self, time: Array, side: str) -> Array:
        """Return the seconds (T,) since a foot last landed; the right one lands at 0."""
        return np.mod(time - (0.0 if side == "right" else 0.5 * self.stride), self.stride)


GAITS = {
    "walk": Gait("walk", 0.9, 1.2, 0.62, 0.17, 0.2, 0.5, (0.24, 0.5), 0.03, 0.18, 0.4, 0.35, 0.03, 0.07),
    "run": Gait("run", 2.0, 0.7, 0.38, 0.09, 0.05, 0.5, (0.35, 0.5), 0.06, 0.0, 0.6, 1.4, 0.08, 0.15),
}
"""Ways to go, by the names that a protocol uses. Stance 62 and 38 % of the stride: Novacheck 1998,
doi:10.1016/S0966-6362(97)00038-6; all else assumed so that people of 1.35 to 1.95 m settle into even strides.
"""
