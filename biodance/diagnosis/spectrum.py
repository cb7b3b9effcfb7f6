"""From the samples of a session's trials to rows by frequency: orthonormal cosine transform per run of used frames, low
bands only.

A stationary error is nearly independent between coefficients; within a band its six channels share a covariance.
What lies above the last of `BANDS`, or above the cut-off at which a trial was low-passed, is not looked at: nothing is
left there of anything, and it would say that the band is quiet in trials that have it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from biodance.effects import Case
from biodance.errors import TrialRefused
from biodance.lab.prepare import highest_frequency
from biodance.records import Array, Markers, Motion, Wrench
from biodance.uncertainty.bands import BANDS, Bands, Noise
from biodance.uncertainty.tolerances import REFERENCE_PERSON

_RATE = 50.0
"""Hz at which trials are looked at: derivatives of columns are still good to 7 % at the upper edge."""
SHORTEST_RUN = 0.4
"""s: a walker stands on one plate alone for as long; shorter runs of used frames are left out."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Where the rows of a session come from.

    ``layout`` bands and the point (3,) m about which moments are taken; ``picks`` per trial the runs of frames
    (indices); ``rates`` and ``cutoffs`` Hz per trial; ``band``, ``trial`` (m,) of every row; ``seconds`` of all runs
    together; ``loud`` (m,) how many times as loud as its band is each row expected to be.
    """

    layout: Noise
    picks: tuple[tuple[NDArray[np.intp], ...], ...]
    rates: tuple[float, ...]
    cutoffs: tuple[float, ...]
    band: NDArray[np.intp]
    trial: NDArray[np.intp]
    seconds: float
    loud: Array

    def bands(self, index: int) -> Bands:
        """Return the bands of one trial, as far as its low-pass leaves them."""
        return _bands(self.rates[index], self.cutoffs[index])

    def rows(self, samples: Iterable[Array]) -> Array:
        """Return the coefficients (m, 6, n) of per-trial ``samples`` (T, 6, n) of wrenches about the lab origin, taken
        one trial after the other.
        """
        out: Array | None = None
        for index, one in enumerate(samples):
            found = self.of_trial(index, one)
            out = np.empty((self.band.size, *found.shape[1:])) if out is None else out
            out[self.trial == index] = found
        assert out is not None
        return out

    def of_trial(self, index: int, samples: Array) -> Array:
        """Return the coefficients (m_i, 6, n) of one trial's ``samples`` (T, 6, n)."""
        bands = self.bands(index)
        parts = []
        for pick in self.picks[index]:
            kept = bands.of(pick.size) >= 0
            # Moments about the standing point first, then the transform along time.
            parts.append(bands.coefficients(self.layout.shift @ samples[pick])[kept])
        return np.concatenate(parts) if parts else np.empty((0, 6, samples.shape[2]))


def needed(cases: tuple[Case, ...], where: Spectrum) -> Array:
    """Return (B, 6) N², N²·m²: mean square of a coefficient of the wrench that the movement of ``cases`` needs, at
    `REFERENCE_PERSON`; 0 in a band without any.
    """
    heavier = float(cases[0].body.sip.mass.sum()) / REFERENCE_PERSON
    rows = where.rows(case.predicted[:, :, None] for case in cases)[:, :, 0] / heavier
    square = [np.bincount(where.band, rows[:, c] ** 2, len(BANDS)) for c in range(rows.shape[1])]
    return np.stack(square, axis=1) / np.maximum(np.bincount(where.band, minlength=len(BANDS)), 1)[:, None]


_ABOUT = np.array([1.0, 2.0, 3.0, 2.0, 1.0])
"""Weights of neighbouring coefficients: a cosine of any phase and frequency lies in some of them."""


def power_about(where: Spectrum, cases: tuple[Case, ...], whiteners: Array) -> Array:
    """Return (m,): power of the wrench that the movement of ``cases`` needs about every row, mean of the channels in
    units of their noise (``whiteners`` (B, 6, 6) of each band), over its mean in the band; 1 where the band is that of
    means, or nothing is needed.
    """
    rows = where.rows(case.predicted[:, :, None] for case in cases)[:, :, 0]
    power = np.mean(np.einsum("mij,mj->mi", whiteners[where.band], rows) ** 2, axis=1)
    # A run begins where the frequency falls or another trial begins.
    first = np.flatnonzero((np.diff(where.band, prepend=len(BANDS)) < 0) | (np.diff(where.trial, prepend=-1) != 0))
    for run in np.split(np.arange(power.size), first[1:]):
        around, weight = (convolve1d(some, _ABOUT, mode="constant") for some in (power[run], np.ones(run.size)))
        power[run] = around / weight
    mean = np.bincount(where.band, power, len(BANDS)) / np.maximum(np.bincount(where.band, minlength=len(BANDS)), 1)
    there = (where.band > 0) & (mean[where.band] > 0)
    return np.where(there, power / np.where(there, mean[where.band], 1.0), 1.0)


def spectrum(
    cases: tuple[Case, ...], uses: tuple[NDArray[np.bool_], ...], about: Array, *, shortest: float = SHORTEST_RUN
) -> Spectrum:
    """Return the rows of ``cases`` whose frames ``uses`` (T,) may be compared, moments about ``about`` (3,) m, from
    runs of at least ``shortest`` s.

    Raises
    ------
    TrialRefused
        No trial has such a run.
    """
    picks, band, trial, seconds = [], [], [], 0.0
    rates = tuple(case.motion.rate for case in cases)
    cutoffs = tuple(highest_frequency(case.trial.settings) for case in cases)
    for index, (rate, cutoff, use) in enumerate(zip(rates, cutoffs, uses, strict=True)):
        there = _bands(rate, cutoff)
        runs = tuple(pick for pick in BANDS.runs(use, rate) if pick.size >= shortest * there.rate)
        picks.append(runs)
        for pick in runs:
            own = there.of(pick.size)
            band.append(own[own >= 0])
            trial.append(np.full(band[-1].size, index))
            seconds += pick.size / there.rate
    if not band:
        names = ", ".join(case.trial.name for case in cases)
        raise TrialRefused(
            f"No trial of {names} has {shortest:g} s of fully measured ground contact, so there is nothing to diagnose."
        )
    where = np.concatenate(band), np.concatenate(trial)
    return Spectrum(Noise.unit(about, BANDS), tuple(picks), rates, cutoffs, *where, seconds, np.ones(where[0].size))


def _bands(rate: float, cutoff: float) -> Bands:
    return BANDS.at(rate).below(cutoff)


def thinned(case: Case, use: NDArray[np.bool_]) -> tuple[Case, NDArray[np.bool_]]:
    """Return the case and its mask (T,) at about `RATE`."""
    step = max(1, round(case.motion.rate / _RATE))
    if step == 1:
        return case, use
    old = case.motion
    time, q, v, a, residual = (array[::step] for array in (old.time, old.q, old.v, old.a, old.residual))
    known, state = old.determined[::step], old.state[::step]
    motion = Motion(time, q, v, a, residual, old.marker_names, known, old.notes, state=state)
    plates = tuple(replace(p, wrench=Wrench(p.wrench.time[::step], p.wrench.value[::step])) for p in case.trial.plates)
    markers = case.trial.markers
    seen = None if markers is None else Markers(markers.names, markers.time[::step], markers.xyz[::step])
    trial = replace(case.trial, plates=plates, markers=seen)
    return Case(case.body, trial, motion, case.phi, case.session_time[::step]), use[::step]
