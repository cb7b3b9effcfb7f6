"""How an observation responds to what may be wrong with plates, clocks, the declared mass and the feet's markers.

Every fault of a plate that is told by its wrench is an affine map of it: w becomes w + B [w; 1] with a matrix B (6, 7).
The derivative of an observation with respect to B is all that any such fault needs (`_causes.plate_change`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of an observation's value less its expectation, unit of the observation over that of the change.

    ``plates`` by name (6, 7): with respect to the matrix B of a plate whose wrench w (6,) N, N·m about the lab origin
    becomes w + B [w; 1]; ``zero`` by plate (3,) 1/N: of the force that its reader took off; ``delay`` 1/s: of all
    forces, late = positive; ``mass`` 1/kg: of what the person weighs more than declared; ``landmarks`` 1/m by side and
    direction: of toe markers that lie ``inwards``, of heel markers that lie ``backwards`` of where they are expected.
    ``linear``: ``plates`` holds for changes of any size that leave the vertical force as it is.
    """

    plates: Mapping[str, Array] = field(default_factory=dict)
    zero: Mapping[str, Array] = field(default_factory=dict)
    delay: float = 0.0
    mass: float = 0.0
    landmarks: Mapping[tuple[str, str], float] = field(default_factory=dict)
    linear: bool = True

    def __sub__(self, other: "Sensitivity") -> "Sensitivity":
        """Return the sensitivity of the difference of two observations' values."""
        plates = {
            name: self.plates.get(name, np.zeros((6, 7))) - other.plates.get(name, np.zeros((6, 7)))
            for name in (*self.plates, *other.plates)
        }
        return Sensitivity(plates, delay=self.delay - other.delay, mass=self.mass - other.mass)

    def to(self, plate: str, change: Array) -> float:
        """Return the derivative with respect to the size of a ``change`` B (6, 7) of a plate."""
        # <gradient, change>: chain rule, summed over all elements.
        return float(np.sum(self.plates[plate] * change)) if plate in self.plates else 0.0


def by_plate(gradient: Array, plates: Mapping[str, Array]) -> dict[str, Array]:
    """Return by plate the derivative (6, 7) with respect to B of a function of the sum of their wrenches (n, 6) about
    the lab origin, whose derivatives with respect to its samples are ``gradient`` (n, 6).
    """
    # d/dB_ij is the derivative with respect to channel i times w_j (last column: 1), summed over the samples.
    return {name: np.column_stack([gradient.T @ wrench, gradient.sum(axis=0)]) for name, wrench in plates.items()}


def of_mean(wrench: Array, channel: int, weights: Array | None = None) -> Array:
    """Return the derivative (6, 7) with respect to B of the mean of one channel of a wrench (n, 6); ``weights`` (n,)
    by default all the same.
    """
    out = np.zeros((6, 7))
    mean = wrench.mean(axis=0) if weights is None else weights @ wrench
    # d(mean of channel i) / dB_ij: mean of w_j, and 1 for the constant.
    out[channel] = np.append(mean, 1.0 if weights is None else weights.sum())
    return out


def pressure_gradient(wrench: Array, direction: Array, height: float) -> Array:
    """Return the derivatives (n, 6) of ``direction`` (n, 2) @ centre of pressure with respect to the wrench (n, 6)
    about the lab origin; the pressure x = (Fx h - My) / Fz, y = (Fy h + Mx) / Fz at ``height`` h m.
    """
    fx, fy, fz, mx, my, _ = wrench.T
    # u / Fz: dx/dMy = -1 / Fz, dy/dMx = 1 / Fz, d(place)/dFz = -place / Fz.
    along_x, along_y = direction.T / fz
    place = (along_x * (fx * height - my) + along_y * (fy * height + mx)) / fz
    none = np.zeros_like(fz)
    return np.stack([along_x * height, along_y * height, -place, along_y, -along_x, none], axis=1)
