"""The one low-pass filter of biodance: forwards and backwards, for forces and joint coordinates alike.

Two passes give zero phase, double the order and square the gain. A filter designed for the stated cut-off would
therefore damp by 6 dB there; the single pass is designed for a higher frequency, so that the two passes TOGETHER are 3
dB down (gain 1/sqrt(2)) at the stated cut-off. With the bilinear map the correction is exact: tan(pi f_design / rate) =
tan(pi f_cutoff / rate) c, for a Butterworth filter with c = (sqrt(2) - 1)^(-1 / (2 order)), for a critically damped one
(``order`` equal real poles) with c = (2^(1 / (2 order)) - 1)^(-1/2).
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

from biodance.errors import BiodanceError
from biodance.records import Array, runs
from biodance.settings import FilterKind, FilterSettings, Settings

_NAMES: dict[FilterKind, str] = {"butterworth": "Butterworth", "critically_damped": "critically damped"}


@dataclass(frozen=True)
class LowPass:
    """Low-pass of a ``kind``: ``order`` of one pass (both have twice that), ``cutoff`` Hz where both together are 3
    dB down.
    """

    order: int = FilterSettings.order
    cutoff: float = FilterSettings.cutoff
    kind: FilterKind = FilterSettings.kind

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 10:
            raise BiodanceError(f"The low-pass has the order {self.order}; legal is 1 to 10. Use 5.")
        if not (np.isfinite(self.cutoff) and self.cutoff > 0):
            raise BiodanceError(f"The low-pass has the cut-off {self.cutoff} Hz; it must be positive. Use 10 Hz.")

    def __str__(self) -> str:
        down = f"3 dB down at {self.cutoff:g} Hz in both passes together"
        return f"{_NAMES[self.kind]} low-pass of order {self.order}, forwards and backwards, {down}"

    def shortest(self, rate: float) -> int:
        """Return the shortest run of samples that is filtered: one period of the cut-off frequency."""
        return int(np.ceil(rate / self.cutoff)) + 1


def motion_filter(settings: Settings) -> LowPass:
    """Return the low-pass that an analyst chose for the joint coordinates."""
    return LowPass(settings.filter.order, settings.filter.cutoff, settings.filter.kind)


def force_filter(settings: Settings) -> LowPass:
    """Return the low-pass that an analyst chose for the forces: that of the joint coordinates, unless another
    cut-off was asked for.
    """
    chosen, same = settings.filter.force_cutoff, motion_filter(settings)
    return same if chosen == "same" else replace(same, cutoff=float(chosen))


@lru_cache(maxsize=32)
def design_low_pass(settings: LowPass, rate: float) -> Array:
    """Return the second-order sections (S, 6) of one of the two passes at the sampling ``rate`` in Hz.

    Raises
    ------
    BiodanceError
        The rate is not positive, or the cut-off is not below half of it.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise BiodanceError(f"The sampling rate is {rate} Hz, which must be positive. Correct the rate in the file.")
    if settings.cutoff >= rate / 2:
        raise BiodanceError(
            f"The cut-off {settings.cutoff:g} Hz is not below half the sampling rate ({rate:g} Hz). Choose a cut-off "
            f"below {rate / 2:g} Hz."
        )
    wanted, order = np.tan(np.pi * settings.cutoff / rate), settings.order
    if settings.kind == "critically_damped":
        return _sections(wanted / np.sqrt(2 ** (0.5 / order) - 1), np.zeros(0), order)
    return butterworth(order, wanted * (np.sqrt(2) - 1) ** (-0.5 / order))


def butterworth(order: int, k: float) -> Array:
    """Return second-order sections (S, 6) of a Butterworth low-pass, ``k`` = tan(pi cut-off / rate)."""
    angles = np.pi * (2 * np.arange(order // 2) + 1) / (2 * order)
    return _sections(k, 2 * np.sin(angles), order % 2)


def _sections(k: float, pairs: Array, single: int) -> Array:
    """Return second-order sections (S, 6) of a low-pass by the bilinear map: of every pair of poles s² + ``pairs`` k s
    + k² and of ``single`` real poles s + k, where k is the tangent of half the digital frequency.
    """
    size = 1 + pairs * k + k**2
    fed, held = k**2 / size, np.ones_like(size)
    double = np.stack([fed, 2 * fed, fed, held, 2 * (k**2 - 1) / size, 2 * (1 + k**2) / size - 1], axis=1)
    one = np.array([k, k, 0.0, 1 + k, k - 1, 0.0]) / (1 + k)
    return np.concatenate([double, np.tile(one, (single, 1))])


def run_both_ways(sections: Array, values: Array, reach: int) -> Array:
    """Return ``values`` (T, n) run through ``sections`` (S, 6) of gain 1 at rest, forwards and then backwards, the ends
    continued by point reflection over ``reach`` < T samples; each pass starts at rest at its first sample.
    """
    before, after = 2 * values[:1] - values[reach:0:-1], 2 * values[-1:] - values[-2 : -2 - reach : -1]
    out = np.concatenate([before, values, after])
    for _ in range(2):
        out = _run(sections, out)[::-1]
    return np.asarray(out[reach : len(out) - reach])


def _run(sections: Array, values: Array) -> Array:
    """Return ``values`` (T, n) run through the sections once: each is a triangular system with two bands."""
    rest = values[0]
    out = np.asfortranarray(values - rest)
    for b0, b1, b2, _, a1, a2 in sections:
        fed = b0 * out
        fed[1:] += b1 * out[:-1]
        fed[2:] += b2 * out[:-2]
        band = np.repeat([[1.0], [a1], [a2]], len(out), axis=1)
        out = dtbtrs(band, fed, uplo="L", diag="U", overwrite_b=True)[0]
    return np.asarray(out + rest)


def low_pass(values: Array, rate: float, settings: LowPass) -> Array:
    """Return ``values`` (T, ...) low-passed along time without delay; NaN stay NaN.

    ``rate`` in Hz. Every column is filtered from gap to gap, never across one; a run shorter than
    ``settings.shortest(rate)`` samples is returned as it is (``left_raw`` tells which). The ends are continued by point
    reflection over one period of the cut-off.

    Raises
    ------
    BiodanceError
        The rate or the cut-off is not legal, or the whole signal is shorter than the shortest run.
    """
    sections = design_low_pass(settings, rate)
    values = np.asarray(values, dtype=float)
    need = settings.shortest(rate)
    if values.shape[0] < need:
        raise BiodanceError(
            f"{values.shape[0]} samples at {rate:g} Hz are too short for a low-pass at {settings.cutoff:g} Hz: at "
            f"least {need} are needed. "
            "Record longer or leave the signal as it is."
        )
    columns = values.reshape(values.shape[0], -1)
    out = columns.copy()
    whole = ~np.isnan(columns).any(axis=0)
    if whole.any():
        out[:, whole] = run_both_ways(sections, columns[:, whole], need - 1)
    for column in np.flatnonzero(~whole):
        for start, stop in runs(~np.isnan(columns[:, column])):
            if stop - start >= need:
                out[start:stop, [column]] = run_both_ways(sections, columns[start:stop, [column]], need - 1)
    return out.reshape(values.shape)


def left_raw(values: Array, rate: float, settings: LowPass) -> NDArray[np.bool_]:
    """Return where ``low_pass`` leaves a number as it is, because its run between two gaps is too short; shape of
    ``values``.
    """
    columns = np.asarray(values, dtype=float).reshape(len(values), -1)
    out = np.zeros(columns.shape, dtype=bool)
    for column in np.flatnonzero(np.isnan(columns).any(axis=0)):
        for start, stop in runs(~np.isnan(columns[:, column])):
            out[start:stop, column] = stop - start < settings.shortest(rate)
    return out.reshape(np.shape(values))
