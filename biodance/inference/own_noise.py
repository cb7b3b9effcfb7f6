"""The noise of a session as it shows it: restricted maximum likelihood by band and channel, never louder than expected.

Tolerances say how loud a session of its movement and its markers may be. Most real ones are quieter, each in its own
bands: beside everything that is no fault, s_q^2 = |e_q|^2 / (n_q - t_q), e what the posterior mean leaves of the rows
of a band and channel, t the degrees of freedom that the columns take of them. Groups of tolerances are as large as
anywhere for this: what they share, stretched to excuse one fault, excuses noise of other channels as well; the scale
that a marker has for itself excuses that marker alone. A fault in these rows counts as their noise here, so that they
are as loud as it is, or as expected.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from biodance.inference.columns import VisibleColumns
from biodance.inference.rows import Rows
from biodance.inference.scales import LOUD, ScaledFit, as_anywhere, fit, nominal, posterior, prior_sd, products
from biodance.records import CHANNELS, Array
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import Tolerances

_ROUNDS, _NEAR = 10, 0.03
_SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
_LEAST_FREE = 0.05
"""Share of its variance that is left of a row at least."""
_QUIETEST = 0.5
"""Share of the expected noise below which none is believed: beside less, what is no fault has to be larger than it was
learned to be (flesh that sags, 4.6 times in simulated postures). At 0.2 real sessions give the same names.
"""


def own_noise(rows: Rows, power: Array | None = None) -> tuple[Tolerances, float]:
    """Return the tolerances of ``rows`` with the noise that the session shows in every band and channel, in the
    channels in which they are whitened: at most as expected, its logarithm shrunk towards that by its prior
    ~ N(0, `LOUD`^2); and which share of it goes within its band with the ``power`` (m,) of the coefficients
    (`power_about`).
    """
    columns, scales, sd = VisibleColumns.of(rows), nominal(rows), prior_sd(rows)
    none, quiet = np.empty((len(rows.y), 0)), np.ones(rows.noises + 1)
    for _ in range(_ROUNDS):
        # Rows over `quiet` have unit variance where the noise is as this round believes.
        found = fit(products(columns, none, rows.y, 1 / quiet), sd, scales)
        before, scales = quiet, found.scales
        usual = posterior(found.products, sd, replace(as_anywhere(scales, rows), members=scales.members))
        left = _left(rows, columns, usual)
        quiet = _shown(rows, usual, before, *left)
        if np.abs(np.log(quiet / before)).max() < _NEAR:
            break
    share = quiet[: len(BANDS) * len(CHANNELS)].reshape(len(BANDS), 1, len(CHANNELS))
    # Columns of the Cholesky factor times the shares: L diag(share)^2 L'.
    root = np.linalg.cholesky(rows.tolerances.noise) * share
    moving = 0.0 if power is None else _moving(rows, np.repeat(power, len(CHANNELS)), usual, before, *left)
    return replace(rows.tolerances, noise=root @ root.swapaxes(1, 2)), moving


def _left(rows: Rows, columns: VisibleColumns, found: ScaledFit) -> tuple[Array, Array]:
    """Return (n,) what the posterior mean leaves of the plates' rows, and the leverage of each at unit noise."""
    X = columns.X[: rows.plates] * found.size
    # x' C x = |L^-1 x|^2 with A = L L': no inverse of A.
    taken = np.sum(solve_triangular(found.lower, X.T, lower=True, check_finite=False) ** 2, axis=0)
    return rows.y[: rows.plates] - X @ found.u, taken


def _moving(rows: Rows, power: Array, found: ScaledFit, quiet: Array, left: Array, taken: Array) -> float:
    """Return the share of the noise that goes with ``power`` (n,), the most probable of `_SHARES`: what is ``left``
    (n,) has the variance s_q^2 (1 - share + share power), and each s_q is free. Bands and channels that are louder than
    expected hold a fault, and do not tell how noise is spread.
    """
    block = rows.block[: rows.plates]
    # E[e^2] = s^2 (1 - h): rows that columns have taken tell less than they seem to.
    free = 1 - taken * np.exp(-2 * found.scales.noise) / quiet[block] ** 2
    square, count = left**2 / np.maximum(free, _LEAST_FREE), np.maximum(np.bincount(block), 1)
    # The sum of n squares is n +- sqrt(2 n): louder by two standard deviations is louder.
    usual = (np.bincount(block, square) <= count + 2 * np.sqrt(2 * count))[block]
    block, square, power = block[usual], square[usual], power[usual]

    def log_density(share: float) -> float:
        variance = 1 - share + share * power
        # Rows of a block share the mean of its squares; blocks without rows have none.
        level = (np.bincount(block, square / variance, len(count)) / count)[block]
        return -0.5 * float(np.log(np.maximum(level * variance, 1e-12)).sum())

    return max(_SHARES, key=log_density)


def _shown(rows: Rows, found: ScaledFit, quiet: Array, left: Array, taken: Array) -> Array:
    """Return (Q + 1,) the noise of each band and channel over what is expected, from the posterior at ``quiet`` and
    what it leaves (`_left`).
    """
    n = rows.plates
    count, square, took = (np.bincount(rows.block[:n], weight, len(quiet)) for weight in (np.ones(n), left**2, taken))
    # Degrees of freedom taken at the noise of this round: rows weigh exp(-2 noise) / quiet^2.
    free = count - took * np.exp(-2 * found.scales.noise) / quiet**2
    there = (count > 0) & (free > 0)
    size = np.zeros(len(quiet))
    size[there] = 0.5 * np.log(np.maximum(square[there] / free[there], 1e-12))
    # 2 n is the information of n squares on the logarithm of their size, 1 / LOUD^2 that of its prior.
    size *= 2 * free / (2 * free + 1 / LOUD**2)
    return np.asarray(np.clip(np.exp(size), _QUIETEST, 1.0))
