"""The noise of a session as it shows it: restricted maximum likelihood by band and channel, never louder than expected,
and together in its channels as what is left of them.

Tolerances say how loud a session of its movement and its markers may be. Most real ones are quieter, each in its own
bands: beside everything that is no fault, s_q^2 = |e_q|^2 / (n_q - t_q), e what the posterior mean leaves of the rows
of a band and channel, t the degrees of freedom that the columns take of them. Groups of tolerances are as large as
anywhere for this: what they share, stretched to excuse one fault, excuses noise of other channels as well; the scale
that a marker has for itself excuses that marker alone. A fault in these rows counts as their noise here, so that they
are as loud as it is, or as expected.

What pushes at a height h moves force and moment together, m_y = h f_x; h is that of the segment whose markers err most,
another one in every person. Of each band, with e whitened as expected and R the correlation that is left,

    noise = L D R_q D L',    D = diag(s_q),    R_q = (nu 1 + n R) / (nu + n),    n free rows of a channel

(L the Cholesky factor of what is expected; the mean of an inverse Wishart posterior worth nu rows before any data).
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
_QUIETEST = 0.5
"""Share of the expected noise below which none is believed: beside less, what is no fault has to be larger than it was
learned to be (flesh that sags, 4.6 times in simulated postures). At 0.2 real sessions give the same names.
"""
_WORTH = 10.0
"""Rows that the expected correlation of channels is worth. What half of the rows say of the other half is most probable
at 2 to 5 in 24 of 25 sessions, less probable than without at 5 in one of 17 rows, and nowhere noticeably at 10.
"""


def own_noise(rows: Rows) -> Tolerances:
    """Return the tolerances of ``rows`` with the noise that the session shows in every band and channel, in the
    channels in which they are whitened: at most as expected, its logarithm shrunk towards that by its prior
    ~ N(0, `LOUD`^2).
    """
    columns, scales, sd = VisibleColumns.of(rows), nominal(rows), prior_sd(rows)
    none, quiet = np.empty((len(rows.y), 0)), np.ones(rows.noises + 1)
    for _ in range(_ROUNDS):
        # Rows over `quiet` have unit variance where the noise is as this round believes.
        found = fit(products(columns, none, rows.y, 1 / quiet), sd, scales)
        before, scales = quiet, found.scales
        usual = posterior(found.products, sd, replace(as_anywhere(scales, rows), members=scales.members))
        quiet = _shown(rows, columns, usual, before)
        if np.abs(np.log(quiet / before)).max() < _NEAR:
            break
    share = quiet[: len(BANDS) * len(CHANNELS)].reshape(len(BANDS), len(CHANNELS))
    # Columns of the Cholesky factor times the shares: L D.
    root = np.linalg.cholesky(rows.tolerances.noise) * share[:, None]
    return replace(rows.tolerances, noise=root @ _together(rows, columns, usual, before) @ root.swapaxes(1, 2))


def _shown(rows: Rows, columns: VisibleColumns, found: ScaledFit, quiet: Array) -> Array:
    """Return (Q + 1,) the noise of each band and channel over what is expected, from the posterior at ``quiet``."""
    left, taken = _left(rows, columns, found, quiet)
    block = rows.block[: rows.plates]
    count, square, took = (np.bincount(block, weight, len(quiet)) for weight in (np.ones(block.size), left**2, taken))
    free = count - took
    there = (count > 0) & (free > 0)
    size = np.zeros(len(quiet))
    size[there] = 0.5 * np.log(np.maximum(square[there] / free[there], 1e-12))
    # 2 n is the information of n squares on the logarithm of their size, 1 / LOUD^2 that of its prior.
    size *= 2 * free / (2 * free + 1 / LOUD**2)
    return np.asarray(np.clip(np.exp(size), _QUIETEST, 1.0))


def _together(rows: Rows, columns: VisibleColumns, found: ScaledFit, quiet: Array) -> Array:
    """Return (B, 6, 6) the correlation of the channels' whitened noise in each band, from the same posterior."""
    width = len(CHANNELS)
    left, taken = (one.reshape(-1, width) for one in _left(rows, columns, found, quiet))
    band, out = rows.block[: rows.plates : width] // width, np.tile(np.eye(width), (len(BANDS), 1, 1))
    for b in np.unique(band):
        square = left[band == b].T @ left[band == b]
        size = np.sqrt(np.maximum(np.diag(square), 1e-12))
        # Rows of a channel that the columns leave free, in the mean of the channels.
        free = max(float(np.sum(1 - taken[band == b])) / width, 0.0)
        out[b] = (_WORTH * out[b] + free * square / np.outer(size, size)) / (_WORTH + free)
    return out


def _left(rows: Rows, columns: VisibleColumns, found: ScaledFit, quiet: Array) -> tuple[Array, Array]:
    """Return (n,) what the posterior mean leaves of the plates' rows, and the degrees of freedom that the columns take
    of each.
    """
    X = columns.X[: rows.plates] * found.size
    # Leverage x' C x = |L^-1 x|^2 with A = L L': no inverse of A; rows weigh exp(-2 noise) / quiet^2.
    leverage = np.sum(solve_triangular(found.lower, X.T, lower=True, check_finite=False) ** 2, axis=0)
    weight = np.exp(-2 * found.scales.noise) / quiet[rows.block[: rows.plates]] ** 2
    return rows.y[: rows.plates] - X @ found.u, leverage * weight
