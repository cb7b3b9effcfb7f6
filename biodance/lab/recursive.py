"""Filters that run along time, in machine code: the digital Butterworth low-pass as second-order sections, forwards,
and forwards and backwards.

The same numbers as scipy's ``butter``, ``sosfilt`` and ``sosfiltfilt`` to rounding (tests/test_lab_filters.py); scipy's
package of signals alone takes a quarter of a second to load. A section is (b0, b1, b2, 1, a1, a2), its state that of
the transposed direct form II.
"""

import numpy as np
from numba import njit

from biodance.records import Array


def butterworth_sections(order: int, tangent: float) -> Array:
    """Return the sections (S, 6) of a Butterworth low-pass of an ``order``, by the bilinear map; ``tangent`` = tan(pi
    cut-off / rate), where one pass is 3 dB down.
    """
    angle = np.pi * (2 * np.arange(order // 2) + 1 + order % 2) / (2 * order)
    damping, square = 2 * np.cos(angle) * tangent, tangent**2
    whole = 1 + damping + square
    ones = np.ones_like(angle)
    b = square / whole
    pairs = np.stack([b, 2 * b, b, ones, 2 * (square - 1) / whole, (1 - damping + square) / whole], axis=1)
    return np.concatenate([first_order_section(tangent), pairs]) if order % 2 else pairs


def first_order_section(tangent: float) -> Array:
    """Return the section (1, 6) of a low-pass with one real pole; ``tangent`` as of `butterworth_sections`."""
    b = tangent / (1 + tangent)
    return np.array([[b, b, 0.0, 1.0, (tangent - 1) / (1 + tangent), 0.0]])


def run_forwards(sections: Array, values: Array) -> Array:
    """Return ``values`` (T, n) behind the ``sections`` (S, 6), which have long had the first one before."""
    out = np.array(values, dtype=float, order="C")
    _run(sections, _settled(sections), out, False)
    return out


def run_both_ways(sections: Array, values: Array, continued: int) -> Array:
    """Return ``values`` (T, n) behind the ``sections`` (S, 6) forwards, then backwards; both ends are continued by
    ``continued`` < T samples, reflected at the end point.
    """
    before = 2 * values[:1] - values[continued:0:-1]
    behind = 2 * values[-1:] - values[-2 : -continued - 2 : -1]
    longer = np.concatenate([before, values, behind])
    settled = _settled(sections)
    _run(sections, settled, longer, False)
    _run(sections, settled, longer, True)
    return longer[continued : continued + len(values)]


def _settled(sections: Array) -> Array:
    """Return the state (S, 2) of each section when the first one has long been given ones."""
    gain = sections[:, :3].sum(axis=1) / sections[:, 3:].sum(axis=1)
    state = np.stack([gain - sections[:, 0], sections[:, 2] - sections[:, 5] * gain], axis=1)
    return np.asarray(state * np.concatenate([[1.0], np.cumprod(gain)[:-1]])[:, None])


@njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)
def _run(sections, settled, values, backwards):  # type: ignore[no-untyped-def]
    """Pass ``values`` (T, n) through the sections in place."""
    frames, columns = values.shape
    state = np.empty((len(sections), 2, columns))
    first = frames - 1 if backwards else 0
    for s in range(len(sections)):
        for c in range(columns):
            state[s, 0, c] = settled[s, 0] * values[first, c]
            state[s, 1, c] = settled[s, 1] * values[first, c]
    for step in range(frames):
        t = frames - 1 - step if backwards else step
        for s in range(len(sections)):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            for c in range(columns):
                x = values[t, c]
                y = b0 * x + state[s, 0, c]
                state[s, 0, c] = b1 * x - a1 * y + state[s, 1, c]
                state[s, 1, c] = b2 * x - a2 * y
                values[t, c] = y
