"""Evidence for every cause at once: the generalised score test under one linear Gaussian model.

With whitened rows y = X u + Z b + noise, u and b unit normal (X everything that is no fault, Z the basis of one cause):
A = 1 + X'X, G = Z'Z - Z'X A^-1 X'Z, s = Z'y - Z'X A^-1 X'y, and

    log Bayes factor = -1/2 log |1 + G| + 1/2 s' (1 + G)^-1 s,      b ~ N((1 + G)^-1 s, (1 + G)^-1).

One factorisation of A serves all causes. What hides in the body's own parameters or in a tolerance leaves no trace in
G.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor
from scipy.linalg.lapack import dpotrs, dtrtrs

from biodance.records import Array

_BELOW = 1.645
"""Standard deviations below its mean that a normal variable passes with 95 %."""


@dataclass(frozen=True, eq=False)
class LinearPosterior:
    """Posterior of everything that is not a fault, in a linear Gaussian model.

    ``X`` (r, K) whitened columns of coefficients with unit normal priors; ``y`` (r,) whitened target; ``factor``
    Cholesky factor of A; ``mean`` (K,) posterior mean of the coefficients.
    """

    X: Array
    y: Array
    factor: tuple[Array, bool]
    mean: Array

    @cached_property
    def residual(self) -> Array:
        """(r,) whitened residual at the posterior mean."""
        return self.y - self.X @ self.mean

    @classmethod
    def for_target(cls, X: Array, factor: tuple[Array, bool], y: Array) -> "LinearPosterior":
        """Return the posterior for another target ``y`` (r,) with the same columns."""
        return cls(X, y, factor, _solved(factor, X.T @ y))

    def score(self, Z: Array) -> tuple[Array, Array]:
        """Return s (k,) and G (k, k) of whitened columns ``Z`` (r, k)."""
        half = self.X.T @ Z
        if half.size:
            # half = L^-1 X'Z: Z'Z - half'half is the Schur complement of A.
            half = np.asarray(dtrtrs(self.factor[0], half, lower=self.factor[1])[0])
        return Z.T @ self.residual, Z.T @ Z - half.T @ half

    def free(self, Z: Array) -> Array:
        """Return the part of whitened columns ``Z`` (r, k) that no tolerance can explain; the score of any target is
        its product with this part.
        """
        # (1 - X A^-1 X') Z.
        return np.asarray(Z - self.X @ _solved(self.factor, self.X.T @ Z))


def _solved(factor: tuple[Array, bool], b: Array) -> Array:
    """Return A^-1 b (K, ...) from the Cholesky factor of A; LAPACK at once, for it is asked a thousand times."""
    return np.asarray(dpotrs(factor[0], b, lower=factor[1])[0]) if len(b) else b


def linear_posterior(X: Array, y: Array) -> LinearPosterior:
    """Return the posterior from whitened columns ``X`` (r, K) and target ``y`` (r,)."""
    # A = 1 + X'X: data and unit-normal prior.
    factor = cho_factor(X.T @ X + np.eye(X.shape[1]), lower=True)
    return LinearPosterior.for_target(X, factor, y)


def surely_reached(G: Array, shift: Array) -> float:
    """Return the log Bayes factor that a cause passes in 95 % of all recordings if it adds ``shift`` (k,) to the score.

    With s ~ N(shift, G) and W = (1 + G)^-1 the factor has mean m and variance v, and is taken as normal:

        m = 1/2 shift' W shift + 1/2 tr(W G) - 1/2 log |1 + G|,   v = shift' W G W shift + 1/2 tr(W G W G).
    """
    growth, bend, chance, spread = _moments(G, shift)
    return growth + chance - _BELOW * float(np.sqrt(bend + spread))


def _moments(G: Array, shift: Array) -> tuple[float, float, float, float]:
    """Return what the shift adds to mean and variance of `surely_reached`, and what chance does."""
    inner = np.linalg.inv(np.eye(len(G)) + G)
    pull, share = inner @ shift, inner @ G
    # At size zero E[s s'] = G: mean of the log factor 1/2 tr(G (1 + G)^-1) - 1/2 log|1 + G|.
    chance = 0.5 * float(np.trace(share) - np.linalg.slogdet(np.eye(len(G)) + G)[1])
    return 0.5 * float(shift @ pull), float(pull @ G @ pull), chance, 0.5 * float(np.trace(share @ share))


def smallest_detectable(G: Array, direction: Array, need: float) -> float:
    """Return the multiple a of ``direction`` (k,) from which a cause passes ``need`` in 95 % of all recordings
    (`surely_reached` with the shift a G direction, solved for a^2); infinite if it never does.
    """
    growth, bend, chance, spread = _moments(G, G @ direction)
    if growth <= 1e-12:
        return float("inf")
    # growth a^2 - lack = below sqrt(bend a^2 + spread), squared: the larger root
    lack, below = need - chance, _BELOW**2
    # In x = a²: (growth x - lack)² = below (bend x + spread), a quadratic equation.
    half = growth * lack + 0.5 * below * bend
    root = half**2 - growth**2 * (lack**2 - below * spread)
    return float(np.sqrt(max(half + np.sqrt(max(root, 0.0)), 0.0))) / growth
