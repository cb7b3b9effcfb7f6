"""The noise of the wrench residual, by frequency band: residuals of people are coloured, and counting frames as independent makes
intervals lie.

A stationary noise is nearly independent between the coefficients of an orthonormal cosine transform (DCT-II) along time; within one
frequency band its six channels have a covariance. Slow bands carry soft tissue, marker placement and plate zeros; fast bands carry the
instruments. Whitening every band by its own covariance makes least squares the generalised least squares of the coloured noise.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from biodance.errors import BiodanceError
from biodance.records import Array, frozen_array

BLOCK = 1024
"""Samples transformed and folded in at once: constant memory, and cache-sized."""
BANDS = (0.0, 0.05, 0.15, 0.4, 1.0, 2.0, 3.5, 6.0, 10.0)
"""Hz, edges of the bands; nothing above the last one counts (the recordings are low-passed there)."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Covariance (B, 6, 6) N², N²·m, N²·m² of one transform coefficient in each of B bands with ``edges`` (B + 1,) Hz, for wrenches about
    ``about`` (3,) m in the lab frame, sampled at ``rate`` Hz. One band with edges (0, inf) is white noise per sample at any rate.
    """

    covariance: Array
    about: Array
    edges: tuple[float, ...] = (0.0, np.inf)
    rate: float = np.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, (len(self.edges) - 1, 6, 6), "Noise.covariance"))
        object.__setattr__(self, "about", frozen_array(self.about, (3,), "Noise.about"))
        if np.any(np.diff(self.edges) <= 0):
            raise BiodanceError(f"Noise.edges must increase, got {self.edges}.")

    @classmethod
    def of_sd(cls, force: float, moment: float, about: Array) -> "Noise":
        """Return white noise with standard deviations ``force`` N and ``moment`` N·m, the same on all axes."""
        return cls(np.diag([force**2] * 3 + [moment**2] * 3)[None], about)

    @property
    def is_white(self) -> bool:
        """True for one band that holds all frequencies."""
        return len(self.edges) == 2 and np.isinf(self.edges[1])

    @property
    def shift(self) -> Array:
        """(6, 6) matrix that moves a wrench from the lab origin to ``about``."""
        x, y, z = self.about
        out = np.eye(6)
        out[3:, :3] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return out

    def stride(self, rate: float) -> int:
        """Return how many samples of a recording at ``rate`` Hz make one sample of this noise."""
        return 1 if np.isinf(self.rate) else max(1, round(rate / self.rate))

    def at(self, rate: float) -> "Noise":
        """Return the same noise for a recording at ``rate`` Hz, at the rate that its thinned samples really have (120 Hz: 24 Hz)."""
        return self if np.isinf(self.rate) else replace(self, rate=rate / self.stride(rate))

    def bands_of(self, count: int) -> NDArray[np.intp]:
        """Return the band (count,) of every coefficient of a run of ``count`` samples; -1 for those that do not count."""
        if self.is_white:
            return np.zeros(count, dtype=np.intp)
        frequency = np.arange(count) * self.rate / (2 * count)
        band = np.searchsorted(self.edges, frequency, side="right") - 1
        return np.where(frequency < self.edges[-1], band, -1)

    def whiten(self, rows: Array) -> Array:
        """Return whitened rows (m, 6, n), m <= T, of consecutive samples ``rows`` (T, 6, n) of wrenches about the lab origin."""
        shifted = self.shift @ rows
        if self.is_white:
            return np.asarray(np.linalg.solve(np.linalg.cholesky(self.covariance[0]), shifted))
        band = self.bands_of(len(rows))
        keep = band >= 0
        inverse = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return inverse[band[keep]] @ self.coefficients(shifted)[keep]

    def weighted(self, rows: Array) -> Array:
        """Return S^-1 rows (T, 6, n) for consecutive samples ``rows`` (T, 6, n) about the lab origin: ``whiten`` and its transpose."""
        white = self.whiten(rows)
        if self.is_white:
            return np.asarray(self.shift.T @ np.linalg.solve(np.linalg.cholesky(self.covariance[0]).T, white))
        band = self.bands_of(len(rows))
        keep = band >= 0
        spectrum = np.zeros_like(rows)
        spectrum[keep] = np.swapaxes(np.linalg.inv(np.linalg.cholesky(self.covariance)), 1, 2)[band[keep]] @ white
        return np.asarray(self.shift.T @ idct(spectrum, type=2, norm="ortho", axis=0))

    def coefficients(self, shifted: Array) -> Array:
        """Return the cosine transform (T, 6, n) along time of samples about ``about``; the samples themselves for white noise."""
        return shifted if self.is_white else dct(shifted, type=2, norm="ortho", axis=0)


def blocks(use: NDArray[np.bool_], rate: float, noise: Noise) -> Iterator[NDArray[np.intp]]:
    """Yield the frames (indices) of every consecutive run of used frames, thinned to the noise's rate, at most BLOCK at a time.

    Recordings are low-passed far below half the noise's rate, so that thinning loses nothing.
    """
    edge = np.flatnonzero(np.diff(np.concatenate([[False], use, [False]]).astype(int)))
    for start, stop in zip(edge[::2], edge[1::2], strict=True):
        frames = np.arange(start, stop, noise.stride(rate))
        for piece in range(0, frames.size, BLOCK):
            yield frames[piece : piece + BLOCK]
