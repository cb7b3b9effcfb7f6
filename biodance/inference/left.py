"""What is left of the forces in each band and channel beside the most probable causes, with where it is largest."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from biodance.diagnosis.consequence import Adequacy
from biodance.diagnosis.problem import Problem
from biodance.inference.hypotheses import Hypothesis
from biodance.inference.rows import Rows
from biodance.inference.unknown import OWN, energies
from biodance.records import CHANNELS, Array
from biodance.uncertainty.bands import BANDS

_TIE = 1e-9
"""Share by which powers may differ and still be equal: the first of them is told."""


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
    size = np.sqrt([np.sum(_newtons(rows, left)[where.band == b] ** 2, axis=0) / frames for b in range(len(BANDS))])
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


def _newtons(rows: Rows, left: Array) -> Array:
    """Return (m, 6) N, N·m: whitened rows of the plates as they were before."""
    assert rows.problem is not None
    mass = float(rows.problem.cases[0].body.sip.mass.sum())
    # Whitened = W y / loud per band, so y = W^-1 (whitened) loud.
    coloured, where = np.linalg.inv(rows.tolerances.whiteners(mass)), rows.problem.spectrum
    # [m, i] = sum_j W^-1[band(m), i, j] left[m, j].
    return np.asarray(np.einsum("mij,mj->mi", coloured[where.band], left * where.loud[:, None]))


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
