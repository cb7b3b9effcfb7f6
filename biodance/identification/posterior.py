"""What the data say, compressed, and with the table before them: maximum a posteriori.

Least squares on any number of frames equals least squares on the small triangle R of [W y] = Q R; trials of any length
need constant memory, and merge. The wrench is taken about a point near the feet, where its noise has the covariance
that the whitening assumes.

With phi = phi0 + S u, S S' = prior covariance and u standard normal, the whitened data R phi = r become A u = b with A
= R S, b = r - R phi0. One QR of [A; 1] gives the posterior: nothing is inverted that may be singular (a pinned total
mass, a parameter that the prior fixes), and no weight is tuned by hand - the tables' standard deviations and the noise
of the data decide.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from biodance.records import Array, Sip


@dataclass(frozen=True, eq=False)
class Information:
    """The triangle of [W y]: ``R`` (p + 1, p + 1) upper triangular, whitened (rows in units of noise sd).

    ``frames`` counts the samples or transform coefficients folded in.
    """

    R: Array
    frames: int

    @classmethod
    def of_normal(cls, H: Array, frames: int) -> "Information":
        """Return the information of ``frames`` whitened samples with the normal matrix ``H`` = [W y]'[W y] (p + 1,
        p + 1).
        """
        scale = np.sqrt(np.maximum(np.diag(H), 1e-300))  # a square root of H in units of its diagonal, then R of it
        value, vector = np.linalg.eigh(H / np.outer(scale, scale))
        # D^-1 H D^-1 = V E V' with D = diag(scale): rows E^1/2 V' D have rows'rows = H, also
        # where H is nearly singular.
        rows = np.sqrt(np.maximum(value, 0.0))[:, None] * vector.T * scale
        return cls(np.asarray(np.linalg.qr(rows, mode="r")), frames)

    @property
    def triangle(self) -> Array:
        """(p, p) R factor of the whitened regressor."""
        return self.R[:-1, :-1]

    @property
    def target(self) -> Array:
        """(p,) rotated, whitened wrench that belongs to ``triangle``."""
        return self.R[:-1, -1]

    @property
    def misfit(self) -> float:
        """Whitened sum of squares that no parameter can explain."""
        return float(self.R[-1, -1] ** 2)


def fold(rows: Array, onto: Array | None = None) -> Array:
    """Return the upper triangle (n, n) of the QR factorisation of ``onto`` stacked over ``rows`` (m, n)."""
    # R'R = onto'onto + rows'rows: the triangle holds all that least squares needs of both.
    stacked = rows if onto is None else np.concatenate([onto, rows])
    triangle: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
    # Fewer rows than columns: zero rows make the triangle square.
    missing = rows.shape[1] - triangle.shape[0]
    return np.pad(triangle, ((0, missing), (0, 0))) if missing > 0 else triangle


@dataclass(frozen=True, eq=False)
class BodyPosterior:
    """Gaussian posterior about the 10N SIP after the data.

    ``mean`` (p,), ``factor`` (p, k) with ``covariance = factor @ factor.T``; ``prior`` as given; ``log_evidence`` of
    the data under prior and noise (up to a constant of the data alone); ``chi2`` whitened misfit at the mean;
    ``frames`` used.
    """

    prior: Sip
    mean: Array
    factor: Array
    log_evidence: float
    chi2: float
    frames: int

    @property
    def covariance(self) -> Array:
        """(p, p) posterior covariance."""
        return self.factor @ self.factor.T

    @property
    def sip(self) -> Sip:
        """The posterior as a Sip record."""
        return Sip(self.prior.segments, self.mean, self.covariance)

    @property
    def information(self) -> Array:
        """(p,) share of each parameter that comes from the data: 1 - variance after / before; 0 for a parameter the
        prior fixes.
        """
        before = np.diag(self.prior.covariance)
        after = np.sum(self.factor**2, axis=1)
        return np.where(before > 0, 1 - after / np.where(before > 0, before, 1.0), 0.0).clip(0.0, 1.0)


def prior_factor(prior: Sip) -> Array:
    """Return S (p, k), read-only, with S S' = the prior covariance; directions without variance are dropped."""
    return _factor_of(prior.covariance.tobytes())


@lru_cache(maxsize=8)
def _factor_of(covariance: bytes) -> Array:
    """Return the factor of a covariance by its bytes: learning asks for that of one prior some twenty times."""
    table = np.frombuffer(covariance)
    table = table.reshape(math.isqrt(table.size), -1)
    scale = np.sqrt(np.diag(table))
    safe = np.where(scale > 0, scale, 1.0)
    value, vector = np.linalg.eigh(table / np.outer(safe, safe))
    keep = value > 1e-12 * value.max(initial=0.0)
    # S = D V E^1/2 with D^-1 P D^-1 = V E V'.
    factor = scale[:, None] * vector[:, keep] * np.sqrt(value[keep])
    factor.setflags(write=False)
    return np.asarray(factor)


def mean_and_covariance(normal: Array, prior: Sip) -> tuple[Array, Array]:
    """Return posterior mean (p,) and covariance (p, p) after whitened data of the ``normal`` matrix [W y]'[W y] (p + 1,
    p + 1): what `find_posterior` returns, as exact as that matrix is.
    """
    S = prior_factor(prior)
    # 1 + S'HS = L L': the posterior precision of u, never singular.
    lower = cholesky(S.T @ normal[:-1, :-1] @ S + np.eye(S.shape[1]), lower=True, check_finite=False)
    # S'W'(y - W phi0) from the normal matrix alone.
    told = S.T @ (normal[:-1, -1] - normal[:-1, :-1] @ prior.phi)
    # half'half = S (L L')^-1 S'.
    half = solve_triangular(lower, S.T, lower=True, check_finite=False)
    return prior.phi + S @ cho_solve((lower, True), told, check_finite=False), half.T @ half


def find_posterior(data: Information, prior: Sip) -> BodyPosterior:
    """Return the maximum a posteriori estimate and its covariance for whitened ``data`` and a table ``prior``."""
    S = prior_factor(prior)
    A = data.triangle @ S
    b = data.target - data.triangle @ prior.phi
    k = S.shape[1]
    # Rows [A b; 1 0]: |A u - b|² + |u|² as one least-squares problem.
    stacked = np.zeros((A.shape[0] + k, k + 1))
    stacked[: A.shape[0], :k], stacked[: A.shape[0], k], stacked[A.shape[0] :, :k] = A, b, np.eye(k)
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    U, target = triangle[:k, :k], triangle[:k, k]
    u = solve_triangular(U, target)
    # Rest of the stacked target: the misfit at the minimum, penalty included; `data.misfit` is outside all columns.
    penalised = float(np.sum(triangle[k:, k] ** 2)) + data.misfit
    # |A'A + 1|^1/2 = product of |U_kk|: Gaussian evidence with unit-normal u.
    log_evidence = -0.5 * penalised - float(np.sum(np.log(np.abs(np.diag(U)))))
    # Covariance of phi = S U^-1 U^-T S'.
    factor = S @ solve_triangular(U, np.eye(k))
    chi2 = float(np.sum((A @ u - b) ** 2)) + data.misfit
    return BodyPosterior(prior, prior.phi + S @ u, factor, log_evidence, chi2, data.frames)
