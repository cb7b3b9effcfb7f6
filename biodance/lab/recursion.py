"""Recursive filters without the start-up of a signal library: a section that feeds back two samples is a triangular
system with two side diagonals, which LAPACK solves from the first sample to the last.

Every filter here starts as if the first sample had always been there.
"""

import numpy as np
from scipy.linalg.lapack import dtbtrs

from biodance.records import Array

_COLUMNS = 64
"""Columns filtered at once: little memory, however many there are."""


def butterworth_sections(order: int, cutoff: float, rate: float) -> Array:
    """Return the second-order sections (S, 6) [b0, b1, b2, 1, a1, a2] of a Butterworth low-pass, each of unit gain at
    rest; ``cutoff`` Hz where it is 3 dB down, ``rate`` Hz.

    Bilinear map of the poles exp(i pi (2k + order + 1) / (2 order)), warped so that the cut-off is exact.
    """
    warped = np.tan(np.pi * cutoff / rate)
    sections = []
    for k in range(order // 2):
        damping = -2 * np.cos(np.pi * (2 * k + order + 1) / (2 * order)) * warped
        rest = 1 + damping + warped**2
        gain = warped**2 / rest
        sections.append([gain, 2 * gain, gain, 1.0, 2 * (warped**2 - 1) / rest, (1 - damping + warped**2) / rest])
    if order % 2:
        gain = warped / (1 + warped)
        sections.append([gain, gain, 0.0, 1.0, (warped - 1) / (1 + warped), 0.0])
    return np.array(sections)


def run_section(section: Array, values: Array) -> Array:
    """Return ``values`` (T, n) through one section (6,) [b0, b1, b2, 1, a1, a2]."""
    b, a = section[:3], section[3:]
    moved = values - values[:1]
    fed = b[0] * moved
    fed[1:] += b[1] * moved[:-1]
    fed[2:] += b[2] * moved[:-2]
    band = np.repeat(a[:, None], len(values), axis=1)
    solved, _ = dtbtrs(band, fed, uplo="L", diag="U")
    return np.asarray(solved + values[:1] * (b.sum() / a.sum()))


def filter_both_ways(sections: Array, values: Array, *, pad: int) -> Array:
    """Return ``values`` (T, n) through all ``sections``, forwards and backwards; the ends are continued by point
    reflection over ``pad`` samples, fewer than T.
    """
    found = np.empty(values.shape)
    for start in range(0, values.shape[1], _COLUMNS):
        some = values[:, start : start + _COLUMNS]
        before, after = 2 * some[:1] - some[pad:0:-1], 2 * some[-1:] - some[-2 : -pad - 2 : -1]
        run = np.concatenate([before, some, after])
        for _ in range(2):
            for section in sections:
                run = run_section(section, run)
            run = run[::-1]
        found[:, start : start + _COLUMNS] = run[pad : pad + len(values)]
    return found
