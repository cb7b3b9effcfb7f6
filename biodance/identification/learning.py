"""The noise of a session, learned from its own residuals together with the parameters (`uncertainty/learning`)."""

from dataclasses import replace

import numpy as np

from biodance.identification.posterior import mean_and_covariance
from biodance.identification.statistics import Statistics
from biodance.records import Array, Sip
from biodance.threads import one_thread
from biodance.uncertainty.learning import maximise, noise_of
from biodance.uncertainty.noise import Noise

START = np.diag([8.0**2] * 3 + [4.0**2] * 3)
"""(6, 6) N², N²·m²: where learning starts, the paper's own residual (7.8 N, 4.3 N·m)."""
WORTH = 6.0
"""Coefficients' worth of the start that every band keeps."""


_SETTLED = 1e-3
"""Share by which a covariance may still change when learning ends."""


@one_thread()
def learn_noise(data: Statistics, prior: Sip, *, rounds: int = 12, start: Array = START) -> Noise:
    """Return the noise of the session, after at most ``rounds`` or once nothing changes beyond a thousandth; ``start``
    (6, 6) N², N·m, N²·m² as for people by default.
    """

    def improved(noise: Noise) -> Noise:
        moments = data.moments(*mean_and_covariance(data.normal_matrix(noise), prior))
        return replace(noise, covariance=noise_of(moments, start=start, worth=WORTH))

    first = Noise(np.tile(start, (len(data.count), 1, 1)), data.layout.about, data.layout.bands)
    return maximise(first, improved, lambda one: one.covariance, rounds=rounds, tolerance=_SETTLED)
