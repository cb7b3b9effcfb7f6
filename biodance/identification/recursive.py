"""Recursive identification: Gaussian posterior of the parameters, updated sample by sample in constant memory."""

from dataclasses import dataclass, replace

import numpy as np

from biodance.identification.knowledge import KNOWN, PARTLY, Knowability
from biodance.identification.statistics import Fit
from biodance.records import Array, Sip


@dataclass(frozen=True, eq=False)
class RecursivePosterior:
    """Gaussian posterior: ``prior`` as given, ``mean`` (p,) and ``covariance`` (p, p) after the samples so far."""

    prior: Sip
    mean: Array
    covariance: Array

    def expected(self, W: Array) -> tuple[Array, Array]:
        """Return the expected wrench (..., 6) N, N·m for regressors ``W`` (..., 6, p), and its variance due to the
        uncertainty of the parameters.
        """
        # Diagonal of W C W' per sample: sum over j, k of W[i, j] C[j, k] W[i, k].
        return W @ self.mean, np.einsum("...ij,jk,...ik->...i", W, self.covariance, W, optimize=True)

    def updated(self, W: Array, wrench: Array, variance: Array) -> "RecursivePosterior":
        """Return the posterior after one sample: ``W`` (6, p), ``wrench`` (6,) N, N·m with noise of ``variance`` (6,).

        Source: Kalman 1960, doi:10.1115/1.3662552, with a state that stays.
        """
        seen = self.covariance @ W.T
        # K = C W'(W C W' + R)^-1; the innovation's covariance is symmetric, so K' solves it.
        gain = np.linalg.solve(W @ seen + np.diag(variance), seen.T).T
        # C - K W C; rounding makes it unsymmetric, mended below.
        covariance = self.covariance - gain @ seen.T
        return replace(
            self,
            mean=self.mean + gain @ (wrench - W @ self.mean),
            covariance=(covariance + covariance.T) / 2,
        )

    def verdicts(self) -> dict[str, Knowability]:
        """Return for every segment how well its mass is known, as `knowledge` has it."""
        first, now = np.diag(self.prior.covariance)[::10], np.diag(self.covariance)[::10]
        share = 1 - np.divide(now, first, out=np.ones_like(now), where=first > 0)
        return {
            name: "known" if part >= KNOWN else "partly known" if part >= PARTLY else "cannot be known"
            for name, part in zip(self.prior.segments, share, strict=True)
        }


def initial_posterior(prior: Sip) -> RecursivePosterior:
    """Return the posterior before the first sample, equal to ``prior``."""
    return RecursivePosterior(prior, np.array(prior.phi), np.array(prior.covariance))


def summed_pressure(fit: Fit) -> Array:
    """Return the summed centre of pressure (3,) m of the loaded used frames and their number."""
    points = fit.wrench.cop()[fit.use]
    loaded = points[np.isfinite(points).all(axis=1)]
    return np.append(loaded.sum(axis=0), len(loaded))
