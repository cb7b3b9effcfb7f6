"""What the data say, compressed: the R factor of the whitened regressor and wrench.

Least squares on any number of frames equals least squares on the small triangle R of [W y] = Q R; blocks are folded in
one by one, so that a trial of any length needs constant memory, trials merge, and a recursive estimator ends at the
batch result. The wrench is taken about a point near the feet, where its noise has the covariance that the whitening
assumes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.motion.dynamics import regressor
from biodance.records import Array, Motion, Wrench
from biodance.uncertainty.noise import Noise


@dataclass(frozen=True, eq=False)
class Information:
    """The triangle of [W y]: ``R`` (p + 1, p + 1) upper triangular, whitened (rows in units of noise sd).

    ``frames`` counts the samples or transform coefficients folded in.
    """

    R: Array
    frames: int

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
    stacked = rows if onto is None else np.concatenate([onto, rows])
    triangle: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
    missing = rows.shape[1] - triangle.shape[0]
    return np.pad(triangle, ((0, missing), (0, 0))) if missing > 0 else triangle


def information(
    body: Body, motion: Motion, wrench: Wrench, noise: Noise, *, use: NDArray[np.bool_] | None = None
) -> Information:
    """Return what one trial says about the 10N parameters of ``body``.

    ``wrench`` (T, 6) at the times of ``motion``, about the lab origin; ``use`` (T,) True for the frames that count (all
    by default).

    Raises
    ------
    TrialRefused
        Motion and wrench have different lengths, a used wrench is NaN, or no frame is to be used.
    """
    used = np.ones(motion.time.size, dtype=bool) if use is None else use
    if wrench.time.size != motion.time.size:
        raise TrialRefused(
            f"The wrench has {wrench.time.size} samples, the motion {motion.time.size}; prepare the trial first."
        )
    if not used.any():
        raise TrialRefused(
            "No frame of this trial may be used: all are masked (ground contact not measured, or markers hidden)."
        )
    if np.isnan(wrench.value[used]).any():
        raise TrialRefused("The wrench is NaN in a frame that is to be used; mask the frame.")
    count = 0
    R: Array | None = None
    for rows in whitened_rows(body, motion, wrench, noise, used):
        R = fold(rows.reshape(-1, rows.shape[2]), R)
        count += len(rows)
    assert R is not None
    return Information(R, count)


def whitened_rows(body: Body, motion: Motion, wrench: Wrench, noise: Noise, used: NDArray[np.bool_]) -> Iterator[Array]:
    """Yield whitened rows (m, 6, 10N + 1) of [W y], block by block."""
    for pick in noise.bands.runs(used, motion.rate):
        part = motion.at(pick)
        W = regressor(body, part)
        yield noise.at(motion.rate).whiten(np.concatenate([W, wrench.value[pick][:, :, None]], axis=2))
