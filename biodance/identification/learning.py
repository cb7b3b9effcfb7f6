"""The noise of a session, learned from its own residuals together with the parameters (`uncertainty/learning`)."""

from dataclasses import replace

import numpy as np

from biodance.identification.posterior import BodyPosterior, find_posterior
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
def learn_noise(data: Statistics, prior: Sip, *, rounds: int = 12, start: Array = START) -> tuple[Noise, BodyPosterior]:
    """Return the noise of the session and the posterior under it, after at most ``rounds`` or once nothing changes
    beyond a thousandth; ``start`` (6, 6) N², N·m, N²·m² as for people by default.
    """
    data = replace(data)  # a copy of its own: what that keeps in order to learn (12 MB) goes with it

    def improved(noise: Noise) -> Noise:
        posterior = find_posterior(data.information(noise), prior)
        return replace(
            noise, covariance=noise_of(data.moments(posterior.mean, posterior.covariance), start=start, worth=WORTH)
        )

    first = Noise(np.tile(start, (len(data.count), 1, 1)), data.layout.about, data.layout.bands)
    noise = maximise(first, improved, lambda one: one.covariance, rounds=rounds, tolerance=_SETTLED)
    return noise, find_posterior(data.information(noise), prior)
