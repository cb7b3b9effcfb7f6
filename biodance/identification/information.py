"""What the data say, compressed: the R factor of the whitened regressor and wrench.

Least squares on any number of frames equals least squares on the small triangle R of [W y] = Q R; blocks are folded in
one by one, so that a trial of any length needs constant memory, trials merge, and a recursive estimator ends at the
batch result. The wrench is taken about a point near the feet, where its noise has the covariance that the whitening
assumes.
"""

from dataclasses import dataclass

import numpy as np

from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Information:
    """The triangle of [W y]: ``R`` (p + 1, p + 1) upper triangular, whitened (rows in units of noise sd).

    ``frames`` counts the samples or transform coefficients folded in.
    """

    R: Array
    frames: int

    @classmethod
    def of_normal(cls, H: Array, frames: int) -> "Information":
        """Return the information of ``frames`` whitened samples with the normal matrix ``H`` = [W y]'[W y] (p + 1,
        p + 1).
        """
        scale = np.sqrt(np.maximum(np.diag(H), 1e-300))  # a square root of H in units of its diagonal, then R of it
        value, vector = np.linalg.eigh(H / np.outer(scale, scale))
        # D^-1 H D^-1 = V E V' with D = diag(scale): rows E^1/2 V' D have rows'rows = H, also
        # where H is nearly singular.
        rows = np.sqrt(np.maximum(value, 0.0))[:, None] * vector.T * scale
        return cls(np.asarray(np.linalg.qr(rows, mode="r")), frames)

    @property
    def triangle(self) -> Array:
        """(p, p) R factor of the whitened regressor."""
        return self.R[:-1, :-1]

    @property
    def target(self) -> Array:
        """(p,) rotated, whitened wrench that belongs to ``triangle``."""
        return self.R[:-1, -1]

    @property
    def misfit(self) -> float:
        """Whitened sum of squares that no parameter can explain."""
        return float(self.R[-1, -1] ** 2)

    def cost(self, phi: Array) -> float:
        """Return the whitened sum of squared residuals at parameters ``phi`` (p,)."""
        return float(np.sum((self.triangle @ phi - self.target) ** 2)) + self.misfit


def fold(rows: Array, onto: Array | None = None) -> Array:
    """Return the upper triangle (n, n) of the QR factorisation of ``onto`` stacked over ``rows`` (m, n)."""
    # R'R = onto'onto + rows'rows: the triangle holds all that least squares needs of both.
    stacked = rows if onto is None else np.concatenate([onto, rows])
    triangle: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
    # Fewer rows than columns: zero rows make the triangle square.
    missing = rows.shape[1] - triangle.shape[0]
    return np.pad(triangle, ((0, missing), (0, 0))) if missing > 0 else triangle
