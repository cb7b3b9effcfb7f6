"""Frequency bands, and the noise of the wrench residual in each: counting frames as independent makes intervals lie.

Residuals of people are coloured, so every run of frames is looked at by orthonormal cosine transform (DCT-II), band by
band; a stationary error is nearly independent between coefficients, and within a band its six channels share a
covariance. Slow bands carry soft tissue, marker placement and plate zeros; fast bands carry the instruments. Whitening
every band by its own covariance makes least squares the generalised least squares of the coloured noise.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from biodance.errors import BiodanceError
from biodance.records import Array, freeze, runs
from biodance.spatial import wrench_shift

BLOCK_SAMPLES = 1024
"""Samples transformed and folded in at once: constant memory, and cache-sized."""


@dataclass(frozen=True)
class Bands:
    """Bands between ``edges`` (B + 1,) Hz of samples at ``rate`` Hz; what lies above the last edge does not count.

    One band with edges (0, inf) is white: samples count one by one, at any rate.
    """

    edges: tuple[float, ...]
    rate: float

    def __post_init__(self) -> None:
        if len(self.edges) < 2 or np.any(np.diff(self.edges) <= 0):
            raise BiodanceError(f"Bands: the edges must be two or more and increase, got {self.edges} Hz.")

    def __len__(self) -> int:
        """Return the number of bands."""
        return len(self.edges) - 1

    @property
    def white(self) -> bool:
        """True for one band that holds all frequencies."""
        return len(self) == 1 and np.isinf(self.edges[1])

    def stride(self, rate: float) -> int:
        """Return how many samples of a recording at ``rate`` Hz make one sample here."""
        return 1 if np.isinf(self.rate) else max(1, round(rate / self.rate))

    def at(self, rate: float) -> "Bands":
        """Return the same bands for a recording at ``rate`` Hz, at the rate that its thinned samples really have (120
        Hz: 24 Hz).
        """
        return self if np.isinf(self.rate) else replace(self, rate=rate / self.stride(rate))

    def below(self, highest: float) -> "Bands":
        """Return the same bands as far as ``highest`` Hz: what a low-pass has taken out does not count."""
        if self.white or highest >= self.edges[-1]:
            return self
        return replace(self, edges=(*(edge for edge in self.edges if edge < highest), highest))

    def of(self, count: int) -> NDArray[np.intp]:
        """Return the band (count,) of every coefficient of a run of ``count`` samples; -1 for those that do not
        count.
        """
        if self.white:
            return np.zeros(count, dtype=np.intp)
        # Coefficient k of the DCT-II of n samples is a cosine of k half periods in n / rate seconds.
        frequency = np.arange(count) * self.rate / (2 * count)
        band = np.searchsorted(self.edges, frequency, side="right") - 1
        return np.where(frequency < self.edges[-1], band, -1)

    def coefficients(self, samples: Array) -> Array:
        """Return the cosine transform (T, ...) of ``samples`` along time; the samples themselves where white."""
        return samples if self.white else np.asarray(dct(samples, type=2, norm="ortho", axis=0))

    def samples(self, coefficients: Array) -> Array:
        """Return the samples (T, ...) of coefficients (T, ...): the transpose, and the inverse, of `coefficients`."""
        return coefficients if self.white else np.asarray(idct(coefficients, type=2, norm="ortho", axis=0))

    def runs(self, use: NDArray[np.bool_], rate: float) -> Iterator[NDArray[np.intp]]:
        """Yield the frames (indices) of every consecutive run of used frames ``use`` (T,) of a recording at ``rate``
        Hz, thinned to the rate of these bands, at most `BLOCK_SAMPLES` at a time. Recordings are low-passed far below
        half that rate: thinning loses nothing.
        """
        for start, stop in runs(use):
            frames = np.arange(start, stop, self.stride(rate))
            for piece in range(0, frames.size, BLOCK_SAMPLES):
                yield frames[piece : piece + BLOCK_SAMPLES]


WHITE = Bands((0.0, np.inf), np.inf)
"""White noise per sample."""
BANDS = Bands((0.0, 0.04, 0.3, 1.0, 2.5, 6.0), 25.0)
"""The bands of identification and diagnosis, Hz: rest (the mean of a trial alone), slow, and three of movement. Above
6 Hz soft tissue and filters rule: with bands up to 10 Hz identification errs more
(docs/decisions/2026-11-22-frequency-bands.md). 25 Hz: more than twice the last edge."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Covariance (B, 6, 6) N², N²·m, N²·m² of one transform coefficient in each of B ``bands``, for wrenches about
    ``about`` (3,) m in the lab frame.
    """

    covariance: Array
    about: Array
    bands: Bands = WHITE

    def __post_init__(self) -> None:
        freeze(self, "Noise", covariance=(len(self.bands), 6, 6), about=(3,))

    @classmethod
    def of_sd(cls, force: float, moment: float, about: Array) -> "Noise":
        """Return white noise with standard deviations ``force`` N and ``moment`` N·m, the same on all axes."""
        return cls(np.diag([force**2] * 3 + [moment**2] * 3)[None], about)

    @classmethod
    def unit(cls, about: Array, bands: Bands = BANDS) -> "Noise":
        """Return noise of unit covariance in all ``bands`` about a point (3,) m: what whitens nothing, the layout that
        statistics are built on.
        """
        return cls(np.tile(np.eye(6), (len(bands), 1, 1)), about, bands)

    @property
    def shift(self) -> Array:
        """(6, 6) matrix that moves a wrench from the lab origin to ``about``."""
        return wrench_shift(self.about)

    def at(self, rate: float) -> "Noise":
        """Return the same noise for a recording at ``rate`` Hz, at the rate that its thinned samples really have."""
        return replace(self, bands=self.bands.at(rate))

    def weighted(self, rows: Array) -> Array:
        """Return S^-1 rows (T, 6, n) for consecutive samples ``rows`` (T, 6, n) about the lab origin."""
        inverse, band = np.linalg.inv(self.covariance), self.bands.of(len(rows))
        if self.bands.white:
            return np.asarray(self.shift.T @ (inverse[0] @ (self.shift @ rows)))
        spectrum = self.bands.coefficients(self.shift @ rows)
        # Bands that do not count have no information: S^-1 = 0 there.
        spectrum[band < 0] = 0.0
        for one in np.unique(band[band >= 0]):
            spectrum[band == one] = inverse[one] @ spectrum[band == one]
        # Transposes of shift and transform (the inverse transform, as it is orthonormal), in reverse order.
        return np.asarray(self.shift.T @ self.bands.samples(spectrum))
