"""T-optimality as an excitation criterion: how well a movement tells on WHICH segment a load sits.

After Atkinson & Fedorov 1975, doi 10.1093/biomet/62.1.57.

With H = R'R the information over the parameters, P their prior covariance and M = (1 + H P)^-1 H, a load d on segment i
is expected to beat a load on segment j (prior U_j U_j') by

    D_ij = 1/2 (d'M d - a' (1 + B)^-1 a),  a = U_j'M d,  B = U_j'M U_j,     dD_ij = 1/2 e' dM e,  e = d - U_j (1 + B)^-1
    a.

The criterion is log sum_ij 1 / D_ij: the worst confused pairs decide; smaller is better. Its signature is that of
examples/planar/criteria.py.
"""

from typing import Protocol

import numpy as np

from biodance.records import Array

_NAME = "load_separation"
_PLACE = 0.1
"""m: standard deviation of a load's place along each axis of its segment."""
LOAD = 2.0
"""kg: standard deviation of a load."""


class Aim(Protocol):
    """What the criterion needs of a target: ``prior_factor`` (p, k) with the prior covariance S S'."""

    @property
    def prior_factor(self) -> Array:
        """(p, k)."""


def evaluate(triangle: Array, target: Aim) -> tuple[float, Array]:
    """Return log sum 1 / D over all ordered pairs of segments, and its gradient (p, p) by H = R'R for the triangle R
    (or rows).
    """
    H = triangle.T @ triangle
    size = len(H)
    prior = target.prior_factor @ target.prior_factor.T
    inner = np.linalg.inv(np.eye(size) + prior @ H)
    M = H @ inner
    total, pull = 0.0, np.zeros((size, size))
    for i in range(0, size, 10):
        load = np.eye(size)[i]
        for j in range(0, size, 10):
            if i == j:
                continue
            U = np.eye(size)[:, j : j + 4] * np.array([LOAD, *(3 * [LOAD * _PLACE])])
            along, across = U.T @ M @ load, np.eye(4) + U.T @ M @ U
            left = load - U @ np.linalg.solve(across, along)
            gap = 0.5 * float(load @ M @ load - along @ np.linalg.solve(across, along))
            total += 1 / gap
            pull -= 0.5 / gap**2 * np.outer(left, left)
    gradient = inner @ (pull / total) @ inner.T
    return float(np.log(total)), 0.5 * (gradient + gradient.T)
