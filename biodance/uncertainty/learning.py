"""Learn the noise per band, and how large what disturbs is, from what sessions leave: expectation maximisation, the
one in the house.

The residual of a person is mostly not instrument noise, and its covariance cannot be known beforehand. It is
estimated at the current parameters, with the parameters' own uncertainty added (expectation), until both agree
(maximisation). Who holds the data - sums of second moments in `identify`, rows in `diagnose` - provides the
expectation; everything else is here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from biodance.body.tables.error_sizes import error_size
from biodance.records import Array

Learned = TypeVar("Learned")
"""Whatever is learned; its noise is looked at."""
MEAN_DOUBT = 1 / 3
"""Standard deviation of a mean, as a share of itself: one mean is believed to a third, as virtual persons are no
better known."""
AGREED = 4.0
"""Standard errors from which on a mean is kept; smaller ones are chance."""


@dataclass(frozen=True, eq=False)
class Moments:
    """What sessions leave: ``residual`` (B, 6, 6) sum over the coefficients of a band of r r' at the posterior mean,
    plus W C W' with the posterior covariance C of the parameters; ``count`` (B,) coefficients.
    """

    residual: Array
    count: Array

    def __add__(self, other: "Moments") -> "Moments":
        """Return the moments of both."""
        return Moments(self.residual + other.residual, self.count + other.count)


def moments_of(parts: Array, band: NDArray[np.intp], bands: int) -> Moments:
    """Return the moments of ``parts`` (m, 6, 1 + k): the residuals of m coefficients, and a square root of what the
    spread of the parameters adds; ``band`` (m,) of each.
    """
    residual = np.zeros((bands, 6, 6))
    for b in range(bands):
        # (6, m (1 + k)): sum of r r' and of the outer products of the square root's columns, in one product.
        here = parts[band == b].transpose(1, 0, 2).reshape(6, -1)
        residual[b] = here @ here.T
    return Moments(residual, np.bincount(band, minlength=bands)[:bands].astype(float))


def noise_of(found: Moments, *, start: Array | None = None, worth: float = 0.0) -> Array:
    """Return the covariance (B, 6, 6) of a coefficient: mean moments and the floor; bands of few coefficients keep
    ``worth`` coefficients of ``start`` (6, 6), as three coefficients cannot have a covariance of their own.
    """
    mean = found.residual / np.maximum(found.count, 1)[:, None, None]
    if start is not None:
        # Shrunk to `start` as if that had been seen in `worth` coefficients (conjugate prior mean).
        weight = (found.count / (found.count + worth))[:, None, None]
        mean = weight * mean + (1 - weight) * start
    # Symmetric again after rounding: Cholesky takes one half only, others do not.
    return np.asarray(0.5 * (mean + np.swapaxes(mean, 1, 2)) + floor())


def floor() -> Array:
    """Return (6, 6) N², N²·m²: no band claims less."""
    return np.diag([error_size("plate_floor", "force") ** 2] * 3 + [error_size("plate_floor", "moment") ** 2] * 3)


def maximise(
    start: Learned,
    improved: Callable[[Learned], Learned],
    covariance: Callable[[Learned], Array],
    *,
    rounds: int,
    tolerance: float = 0.0,
) -> Learned:
    """Return ``start`` after at most ``rounds`` of expectation and maximisation (``improved``), fewer once the
    log-determinants of all its noise covariances (B, 6, 6) change by less than ``tolerance``.
    """
    found = start
    for _ in range(rounds):
        fresh = improved(found)
        # Log-determinants do not depend on units: forces and moments count alike.
        change = np.abs(np.linalg.slogdet(covariance(fresh))[1] - np.linalg.slogdet(covariance(found))[1]).max()
        found = fresh
        if change < tolerance:
            break
    return found


def sizes_of(rows: Sequence[tuple[str, str, float, float]]) -> tuple[dict[str, float], dict[str, float]]:
    """Return means and sizes from rows of key, name of the mean ("" for none), posterior mean and posterior variance
    of a coefficient: size² = mean of (value - mean)² + variance + (`MEAN_DOUBT` mean)².
    """
    named: dict[str, list[tuple[float, float]]] = {}
    for _, name, value, variance in rows:
        if name:
            named.setdefault(name, []).append((value, variance))
    means = {name: mean for name, pairs in named.items() if (mean := _agreed(np.array(pairs)))}
    square: dict[str, list[float]] = {}
    for key, name, value, variance in rows:
        centre = means.get(name, 0.0)
        # E[(b - mean)²] under the posterior: square of its mean's distance plus its variance.
        square.setdefault(key, []).append((value - centre) ** 2 + variance + (MEAN_DOUBT * centre) ** 2)
    return means, {key: float(np.sqrt(np.mean(some))) for key, some in square.items()}


def _agreed(pairs: Array) -> float:
    """Return the mean of values with variances (n, 2); 0 where it may be chance."""
    value, variance = pairs.T
    mean = float(value.mean())
    # Standard error of the mean: scatter of the values and their own variance over n - 1.
    error = np.sqrt(np.mean((value - mean) ** 2 + variance) / max(len(value) - 1, 1))
    return mean if len(value) > 2 and abs(mean) > AGREED * error else 0.0
