"""A cause that nobody described: more is left in one band and channel, in the whole session, or of what is no fault,
than laboratories have; and where what is left of the forces beside the most probable causes is largest.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import logsumexp

from biodance.diagnosis.consequence import Adequacy
from biodance.diagnosis.problem import Problem
from biodance.inference.hypotheses import Hypothesis
from biodance.inference.rows import Rows
from biodance.inference.scales import LOUD, prior_sd
from biodance.records import CHANNELS, Array
from biodance.uncertainty.bands import BANDS

P_UNKNOWN = (0.06, 0.03, 0.01)
"""Probability of an unknown cause in a session, before any data: in one band and channel, in the whole noise, in body
or tolerances. Those of causes stand in their effects (`Effect.prior`)."""
OWN, EXCESS = 0.4, 1.4
"""Standard deviation of the logarithm of the noise of one band and channel beside that of the session: without fault,
and with an unknown cause.
"""
_TIE = 1e-9
"""Share by which powers may differ and still be equal: the first of them is told."""


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
    """Return the log Bayes factors of logarithms ``away`` for N(0, `EXCESS`^2) against N(0, ``usual``^2)."""
    wide = np.hypot(EXCESS, usual)
    # Only larger than usual speaks for an unknown: below zero the quadratic term is left out.
    return np.asarray(0.5 * np.maximum(away, 0.0) ** 2 * (usual**-2 - wide**-2) - np.log(wide / usual))


def adequacy(one: Hypothesis, rows: Rows) -> tuple[Adequacy, ...]:
    """Return how far what is left in every band of every channel is from what laboratories leave, in standard
    deviations of the logarithm of its size, worst first; the worst, and the worst that matters, with its second; ()
    where no forces were compared with a body.
    """
    if rows.problem is None:
        return ()
    where, names = rows.problem.spectrum, [case.trial.name for case in rows.problem.cases]
    square, count = energies(one)
    # Half the logarithm of a mean of n squares has variance 1 / (2 n); its spread between bands is `OWN`.
    z = 0.5 * np.log(np.maximum(square, 1e-12)) / np.sqrt(OWN**2 + 0.5 / np.maximum(count, 1))
    left = one.left[: rows.plates].reshape(-1, 6)
    frames = max(1, sum(pick.size for picks in where.picks for pick in picks))
    # Parseval (orthonormal cosines): squares of the coefficients over the frames are a mean square over time.
    # Whitened = W y / loud, so y = W^-1 (whitened) loud: [m, i] = sum_j W^-1[band(m), i, j] left[m, j] loud[m].
    coloured = np.linalg.inv(rows.tolerances.whiteners(rows.problem.mass))
    newtons = np.einsum("mij,mj->mi", coloured[where.band], left * where.loud[:, None])
    size = np.sqrt([np.sum(newtons[where.band == b] ** 2, axis=0) / frames for b in range(len(BANDS))])
    found = []
    for b in np.unique(where.band):
        here = where.band == b
        total = np.array([np.sum(left[here & (where.trial == t)] ** 2, axis=0) for t in range(len(names))])
        found += [
            Adequacy(
                channel,
                (BANDS.edges[b], BANDS.edges[b + 1]),
                float(z[6 * b + c]),
                names[int(np.argmax(total[:, c]))],
                size=float(size[b, c]),
            )
            for c, channel in enumerate(CHANNELS)
        ]
    found.sort(key=lambda row: -row.z)
    told = {0, next((i for i, row in enumerate(found) if row.matters), 0)}
    return tuple(
        replace(row, second=_second(rows.problem, left, row)) if i in told else row for i, row in enumerate(found)
    )


def _second(problem: Problem, left: Array, row: Adequacy) -> float:
    """Return the second of the trial's recording around which what is left in ``row`` is largest."""
    spectrum = problem.spectrum
    index = [case.trial.name for case in problem.cases].index(row.trial)
    own = left[spectrum.trial == index, CHANNELS.index(row.channel)]
    bands, time = spectrum.bands(index), problem.cases[index].motion.time
    best, second, start = -1.0, float("nan"), 0
    for pick in spectrum.picks[index]:
        band = bands.of(pick.size)
        full, kept = np.zeros(pick.size), int(np.sum(band >= 0))
        full[band >= 0] = own[start : start + kept]
        start += kept
        # Only this band's coefficients: `samples` then gives the part of the residual in this band over time.
        full[band != BANDS.edges.index(row.band_hz[0])] = 0.0
        power = uniform_filter1d(bands.samples(full) ** 2, max(1, round(bands.rate)))
        largest = float(power.max())
        if largest > best * (1 + _TIE):
            best, second = largest, float(time[pick[int(np.argmax(power >= largest * (1 - _TIE)))]])
    return second
