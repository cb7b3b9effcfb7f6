"""What the data say, compressed: the R factor of the whitened regressor and wrench.

Least squares on any number of frames equals least squares on the small triangle R of [W y] = Q R; blocks are folded in one by one, so
that a trial of any length needs constant memory, trials merge, and a recursive estimator ends at the batch result.
The wrench is taken about a point near the feet, where its noise has the covariance that the whitening assumes.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.kinematics import segment_motion
from biodance.motion.regressor import regressor_of
from biodance.records import Array, Motion, Wrench, frozen_array

BLOCK = 512
"""Frames folded in at once: small enough for the cache, large enough for LAPACK."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of the wrench residual: ``covariance`` (6, 6) N², N²·m, N²·m² of one frame about ``about`` (3,) m (lab frame).

    ``inflation`` >= 1 is the number of consecutive frames that say one thing (the integrated autocorrelation time in frames): rows are
    divided by its root, so that coloured residuals do not count as independent.
    """

    covariance: Array
    about: Array
    inflation: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, (6, 6), "Noise.covariance"))
        object.__setattr__(self, "about", frozen_array(self.about, (3,), "Noise.about"))
        if self.inflation < 1:
            raise BiodanceError(f"Noise.inflation is {self.inflation:g}; it counts frames and must be at least 1.")

    @classmethod
    def of_sd(cls, force: float, moment: float, about: Array) -> "Noise":
        """Return white noise with standard deviations ``force`` N and ``moment`` N·m, the same on all axes."""
        return cls(np.diag([force**2] * 3 + [moment**2] * 3), about)

    @property
    def whitener(self) -> Array:
        """(6, 6) L with ``L @ covariance @ L.T * inflation = 1``, to be applied to a wrench about the lab origin (shift included)."""
        x, y, z = self.about
        shift = np.eye(6)
        shift[3:, :3] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.linalg.solve(np.linalg.cholesky(self.covariance * self.inflation), shift)


@dataclass(frozen=True, eq=False)
class Information:
    """The triangle of [W y]: ``R`` (p + 1, p + 1) upper triangular, whitened (rows in units of noise sd); ``frames`` folded in."""

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


def information(body: Body, motion: Motion, wrench: Wrench, noise: Noise, *, use: NDArray[np.bool_] | None = None) -> Information:
    """Return what one trial says about the 10N parameters of ``body``.

    ``wrench`` (T, 6) at the times of ``motion``, about the lab origin; ``use`` (T,) True for the frames that count (all by default).

    Raises
    ------
    TrialRefused
        Motion and wrench have different lengths, a used wrench is NaN, or no frame is to be used.
    """
    frames = np.arange(motion.time.size) if use is None else np.flatnonzero(use)
    if wrench.time.size != motion.time.size:
        raise TrialRefused(f"The wrench has {wrench.time.size} samples, the motion {motion.time.size}; prepare the trial first.")
    if frames.size == 0:
        raise TrialRefused("No frame of this trial may be used: all are masked (ground contact not measured, or markers hidden).")
    if np.isnan(wrench.value[frames]).any():
        raise TrialRefused("The wrench is NaN in a frame that is to be used; mask the frame.")
    whiten = noise.whitener
    R: Array | None = None
    for start in range(0, frames.size, BLOCK):
        pick = frames[start : start + BLOCK]
        part = Motion(motion.time[pick], motion.q[pick], motion.v[pick], motion.a[pick])
        W = whiten @ regressor_of(segment_motion(body, part))
        y = wrench.value[pick] @ whiten.T
        R = fold(np.concatenate([W.reshape(-1, W.shape[2]), y.reshape(-1, 1)], axis=1), R)
    assert R is not None
    return Information(R, int(frames.size))


def merge(parts: Iterable[Information]) -> Information:
    """Return the information of several trials together."""
    parts = tuple(parts)
    if not parts:
        raise BiodanceError("There is no trial to identify from: give at least one trial with role fit.")
    return Information(fold(np.concatenate([part.R for part in parts])), sum(part.frames for part in parts))
