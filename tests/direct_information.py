"""What one trial says of a body by the direct route: whitened rows, folded block by block. Statistics must equal it."""

import numpy as np

from biodance.body.body import Body
from biodance.identification.posterior import Information, fold
from biodance.motion.dynamics import regressor
from biodance.records import Motion, Wrench
from biodance.uncertainty.bands import Noise


def whiten(noise: Noise, rows: np.ndarray) -> np.ndarray:
    """Return whitened rows (m, 6, n), m <= T, of consecutive samples ``rows`` (T, 6, n) of wrenches about the lab
    origin.
    """
    shifted = noise.shift @ rows
    if noise.bands.white:
        return np.linalg.solve(np.linalg.cholesky(noise.covariance[0]), shifted)
    band = noise.bands.of(len(rows))
    keep = band >= 0
    # L^-1 with S = L L' per band: L^-1 r has unit covariance, L^-T L^-1 = S^-1.
    inverse = np.linalg.inv(np.linalg.cholesky(noise.covariance))
    return inverse[band[keep]] @ noise.bands.coefficients(shifted)[keep]


def information(body: Body, motion: Motion, wrench: Wrench, noise: Noise) -> Information:
    """Return what all frames of a trial say about the 10N parameters of ``body``."""
    used, R, count = np.ones(motion.time.size, dtype=bool), None, 0
    for pick in noise.bands.runs(used, motion.rate):
        both = np.concatenate([regressor(body, motion.at(pick)), wrench.value[pick][:, :, None]], axis=2)
        rows = whiten(noise.at(motion.rate), both)
        R, count = fold(rows.reshape(-1, rows.shape[2]), R), count + len(rows)
    assert R is not None
    return Information(R, count)
