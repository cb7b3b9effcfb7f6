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
from scipy.signal import butter, sosfiltfilt

from biodance.errors import BiodanceError
from biodance.records import Array, runs
from biodance.settings import FilterKind, FilterSettings, Settings

USUAL_CUTOFF = 10.0
"""Hz: the cut-off until a trial's own is known, and the highest that is chosen for one."""
_NAMES: dict[FilterKind, str] = {"butterworth": "Butterworth", "critically_damped": "critically damped"}


@dataclass(frozen=True)
class LowPass:
    """Low-pass of a ``kind``: ``order`` of one pass (both have twice that), ``cutoff`` Hz where both together are 3
    dB down.
    """

    order: int = FilterSettings.order
    cutoff: float = USUAL_CUTOFF
    kind: FilterKind = FilterSettings.kind

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 10:
            raise BiodanceError(f"The low-pass has the order {self.order}; legal is 1 to 10. Use 5.")
        if not (np.isfinite(self.cutoff) and self.cutoff > 0):
            raise BiodanceError(f"The low-pass has the cut-off {self.cutoff} Hz; it must be positive. Use 10 Hz.")

    def __str__(self) -> str:
        down = f"3 dB down at {self.cutoff:g} Hz in both passes together"
        return f"{_NAMES[self.kind]} low-pass of order {self.order}, forwards and backwards, {down}"

    def gain(self, frequency: Array, rate: float) -> Array:
        """Return the gain (n,) of both passes together at each ``frequency`` (n,) Hz below half the ``rate`` Hz."""
        relative = np.tan(np.pi * np.asarray(frequency) / rate) / self._raised(rate)
        if self.kind == "critically_damped":
            return np.asarray((1 + relative**2) ** -float(self.order))
        return np.asarray(1 / (1 + relative ** (2 * self.order)))

    def _raised(self, rate: float) -> float:
        """Return tan(pi f / rate) of the frequency f that one pass is designed for."""
        wanted = float(np.tan(np.pi * self.cutoff / rate))
        if self.kind == "critically_damped":
            return wanted / float(np.sqrt(2 ** (0.5 / self.order) - 1))
        return wanted * float((np.sqrt(2) - 1) ** (-0.5 / self.order))

    def shortest(self, rate: float) -> int:
        """Return the shortest run of samples that is filtered: one period of the cut-off frequency."""
        return int(np.ceil(rate / self.cutoff)) + 1


def motion_filter(settings: Settings) -> LowPass:
    """Return the low-pass of the joint coordinates: with the cut-off that an analyst or the trial chose, else the
    usual one.
    """
    chosen = settings.filter.cutoff
    return LowPass(settings.filter.order, USUAL_CUTOFF if chosen == "auto" else float(chosen), settings.filter.kind)


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
    designed = np.arctan(settings._raised(rate)) * rate / np.pi
    if settings.kind == "critically_damped":
        return np.tile(butter(1, designed, fs=rate, output="sos"), (settings.order, 1))
    return butter(settings.order, designed, fs=rate, output="sos")


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
            f"least {need} are needed. Record longer or leave the signal as it is."
        )
    columns = values.reshape(values.shape[0], -1)
    whole = ~np.isnan(columns).any(axis=0)
    if whole.all():
        return np.asarray(sosfiltfilt(sections, columns, axis=0, padlen=need - 1)).reshape(values.shape)
    out = columns.copy()
    if whole.any():
        out[:, whole] = sosfiltfilt(sections, columns[:, whole], axis=0, padlen=need - 1)
    for column in np.flatnonzero(~whole):
        for start, stop in runs(~np.isnan(columns[:, column])):
            if stop - start >= need:
                out[start:stop, column] = sosfiltfilt(sections, columns[start:stop, column], padlen=need - 1)
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
