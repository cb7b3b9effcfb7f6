"""The noise of the wrench residual, by frequency band: counting frames as independent makes intervals lie.

Slow bands carry soft tissue, marker placement and plate zeros; fast bands carry the instruments. Whitening every band
by its own covariance makes least squares the generalised least squares of the coloured noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.records import Array, freeze
from biodance.spatial import wrench_shift
from biodance.uncertainty.bands import WHITE, Bands


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
    def unit(cls, about: Array, bands: Bands) -> "Noise":
        """Return noise of unit covariance in all ``bands``: what whitens nothing, but knows bands and point."""
        return cls(np.tile(np.eye(6), (len(bands), 1, 1)), about, bands)

    @property
    def shift(self) -> Array:
        """(6, 6) matrix that moves a wrench from the lab origin to ``about``."""
        return wrench_shift(self.about)

    def at(self, rate: float) -> "Noise":
        """Return the same noise for a recording at ``rate`` Hz, at the rate that its thinned samples really have."""
        return replace(self, bands=self.bands.at(rate))

    def whiten(self, rows: Array) -> Array:
        """Return whitened rows (m, 6, n), m <= T, of consecutive samples ``rows`` (T, 6, n) of wrenches about the lab
        origin.
        """
        shifted = self.shift @ rows
        if self.bands.white:
            return np.asarray(np.linalg.solve(np.linalg.cholesky(self.covariance[0]), shifted))
        band = self.bands.of(len(rows))
        keep = band >= 0
        # L^-1 with S = L L' per band: L^-1 r has unit covariance, L^-T L^-1 = S^-1.
        inverse = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return inverse[band[keep]] @ self.bands.coefficients(shifted)[keep]

    def weighted(self, rows: Array) -> Array:
        """Return S^-1 rows (T, 6, n) for consecutive samples ``rows`` (T, 6, n) about the lab origin: ``whiten`` and
        its transpose.
        """
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
