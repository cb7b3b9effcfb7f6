"""A cause that nobody described: more is left in one band and channel, in the whole session, or of what is no fault,
than laboratories have.
"""

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from biodance.inference.hypotheses import Hypothesis
from biodance.inference.scales import LOUD, prior_sd
from biodance.records import CHANNELS, Array

P_UNKNOWN = (0.06, 0.03, 0.01)
"""Probability of an unknown cause in a session, before any data: in one band and channel, in the whole noise, in body
or tolerances. Those of causes stand in their effects (`Effect.prior`)."""
OWN, EXCESS = 0.4, 1.4
"""Standard deviation of the logarithm of the noise of one band and channel beside that of the session: without fault,
and with an unknown cause.
"""


def energies(one: Hypothesis) -> tuple[Array, Array]:
    """Return the mean square (Q,) of what is left of the plates' rows in each band and channel in units of the
    session's noise, and the number (Q,) of rows.
    """
    n = one.rows.plates
    left = one.left[:n]
    count = np.bincount(one.rows.block[:n]).astype(float)
    # exp(2 noise): factor on the variance of the noise.
    loud = np.exp(2 * one.fit.scales.noise)
    return np.bincount(one.rows.block[:n], weights=left**2) / np.maximum(count, 1) / loud, count


def with_unknown(one: Hypothesis) -> Hypothesis:
    """Return a hypothesis with the log posterior of an unknown cause beside it: the noise of one band and channel, of
    the whole session, or the size of a group of what is no fault is larger than anywhere, its logarithm
    ~ N(0, `EXCESS`^2) in place of its usual spread.
    """
    square, count = energies(one)
    if not count.any():
        return one
    # Logarithm of the noise of each block: half that of its mean square.
    blocks = 0.5 * np.log(np.maximum(square[count > 0], 1e-12))
    kinds = (
        # The spread that blocks have anyway, and that of an estimate from n squares, 1 / (2 n).
        (blocks, np.sqrt(OWN**2 + 0.5 / count[count > 0])),
        (np.array([one.fit.scales.noise]), np.array([LOUD])),
        (one.fit.scales.groups, prior_sd(one.rows)),
    )
    each = [
        # Which scale of a kind is larger is not known: the mean of their Bayes factors.
        float(logsumexp(_excess(away, usual))) - np.log(len(away)) + np.log(p / (1 - p))
        for (away, usual), p in zip(kinds, P_UNKNOWN, strict=True)
    ]
    at = np.flatnonzero(count)[int(np.argmax(_excess(*kinds[0])))]
    told = one.log_posterior + float(logsumexp(each))
    return replace(one, log_unknown=told, where_unknown=divmod(int(at), len(CHANNELS)))


def _excess(away: Array, usual: Array) -> Array:
    """Return the log Bayes factors of scales whose logarithms are ``away`` from usual for being larger than anywhere:
    N(0, `EXCESS`^2) against N(0, ``usual``^2).
    """
    wide = np.hypot(EXCESS, usual)
    # Only larger than usual speaks for an unknown: below zero the quadratic term is left out.
    return np.asarray(0.5 * np.maximum(away, 0.0) ** 2 * (usual**-2 - wide**-2) - np.log(wide / usual))
