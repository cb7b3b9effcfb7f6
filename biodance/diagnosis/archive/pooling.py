"""Estimates of several visits or persons put together: what they share, by how much they differ, and what that leaves
of each.

A random-effects mean: value_i = mean + person_i + error_i, with the spread between persons by Paule and Mandel (1982,
doi:10.6028/jres.087.022) and the interval of the mean by Hartung and Knapp (2001, doi:10.1002/sim.1009), which keeps
its level with a handful of persons.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtr, stdtrit

from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Pooled:
    """What several estimates share.

    Parameters
    ----------
    mean, sd : float
        What all share, and its standard error.
    spread : float
        Standard deviation of what is each one's own.
    p : float
        Probability of so large a mean if there were none; 1 where it cannot be told.
    interval : tuple of float
        95 % of the mean.
    own, own_sd : numpy.ndarray
        (k,) each one's own value, drawn to the mean as far as its own error says, and its standard deviation.
    """

    mean: float
    sd: float
    spread: float
    p: float
    interval: tuple[float, float]
    own: Array
    own_sd: Array


def pool(value: Array, sd: Array) -> Pooled:
    """Return what estimates ``value`` (k,) with standard errors ``sd`` (k,) share; k >= 1."""
    value, variance = np.asarray(value, float), np.asarray(sd, float) ** 2
    spread2 = _between(value, variance)
    weight = 1 / (variance + spread2)
    mean = float(weight @ value / weight.sum())
    k = value.size
    if k > 1:  # the scatter that is there, never less than the errors that are known
        scatter = max(1.0, float(weight @ (value - mean) ** 2) / (k - 1))
        error, quantile = float(np.sqrt(scatter / weight.sum())), float(stdtrit(k - 1, 0.975))
        p = float(2 * stdtr(k - 1, -abs(mean) / error))
    else:
        error, quantile = float(np.sqrt(variance[0])), 1.96
        p = float(2 * stdtr(1e9, -abs(mean) / error))
    trust = spread2 / (spread2 + variance)
    own = mean + trust * (value - mean)
    own_sd = np.sqrt(trust * variance + (1 - trust) ** 2 * error**2)
    half = quantile * error
    return Pooled(mean, error, float(np.sqrt(spread2)), p, (mean - half, mean + half), own, own_sd)


def _between(value: Array, variance: Array) -> float:
    """Return the variance between persons at which the weighted scatter is what it should be; 0 where errors explain
    it.
    """

    def excess(between: float) -> float:
        weight = 1 / (variance + between)
        mean = weight @ value / weight.sum()
        return float(weight @ (value - mean) ** 2) - (value.size - 1)

    if value.size < 2 or excess(0.0) <= 0:
        return 0.0
    high = float(np.var(value) * value.size + variance.max())
    while excess(high) > 0:
        high *= 4
    return float(brentq(excess, 0.0, high))
