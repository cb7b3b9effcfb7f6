"""Learn the noise of a session from its own residuals, together with the parameters (expectation maximisation).

The residual of a person is mostly not instrument noise: soft tissue, joint centres, muscles that move. Its covariance per band cannot be
known beforehand; it is estimated at the current parameters, with the parameters' own uncertainty added, until both agree.
"""

import numpy as np

from biodance.identify.noise import Noise
from biodance.identify.posterior import Posterior, posterior
from biodance.identify.statistics import Statistics
from biodance.records import Array, Sip

FLOOR = np.diag([0.3**2] * 3 + [0.1**2] * 3)
"""(6, 6) N², N²·m²: no laboratory plate is better than this; keeps a band of few coefficients from claiming certainty."""
START = np.diag([8.0**2] * 3 + [4.0**2] * 3)
"""(6, 6) N², N²·m²: where learning starts, the paper's own residual (7.8 N, 4.3 N·m)."""
SHRINK = 6.0
"""Coefficients' worth of the start that every band keeps: a band of three coefficients cannot have a (6, 6) covariance of its own."""


def learn(data: Statistics, prior: Sip, *, iterations: int = 12, tolerance: float = 1e-3) -> tuple[Noise, Posterior]:
    """Return the noise of the session and the posterior under it.

    Stops when the log-determinants of all bands change by less than ``tolerance``, or after ``iterations`` rounds.
    """
    layout = data.layout
    noise = Noise(np.tile(START, (len(data.count), 1, 1)), layout.about, layout.edges, layout.rate)
    belief = posterior(data.information(noise), prior)
    for _ in range(iterations):
        found = data.residual_covariance(belief.mean, belief.covariance)
        fresh = Noise(_settled(found, data), layout.about, layout.edges, layout.rate)
        change = np.abs(np.linalg.slogdet(fresh.covariance)[1] - np.linalg.slogdet(noise.covariance)[1])
        noise = fresh
        belief = posterior(data.information(noise), prior)
        if change.max() < tolerance:
            break
    return noise, belief


def _settled(found: Array, data: Statistics) -> Array:
    """Return the band covariances with the floor added and bands of few coefficients shrunk towards the start."""
    weight = (data.count / (data.count + SHRINK))[:, None, None]
    return weight * found + (1 - weight) * START + FLOOR
