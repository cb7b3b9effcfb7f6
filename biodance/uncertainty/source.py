"""What one kind of elementary error must be able to say of itself: what it adds to the wrench, forward and as the
transpose.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.motion.kinematics import chains
from biodance.records import Array
from biodance.uncertainty.response import Response


@dataclass(frozen=True, eq=False)
class ErrorSource(ABC):
    """One kind of error of ``body``: K elementary errors of unit size."""

    body: Body

    @property
    @abstractmethod
    def groups(self) -> tuple[str, ...]:
        """(K,) kind and place of every error, sides alike, as in the table of sizes: ``slide thigh``."""

    @property
    def joints(self) -> tuple[str, ...]:
        """(K,) the joint of the body that every error belongs to, ``right_hip``; "" for errors of skin and flesh."""
        return ("",) * len(self.groups)

    @abstractmethod
    def functional(self, trial: Response) -> Array:
        """Return the functionals (F, 18, K) of the wrench of every error in a trial."""

    @abstractmethod
    def residual(self, trial: Response) -> Array:
        """Return the mean residual (M, 3, K) m of every marker, model less measured, in segment axes."""

    def transpose(self, trial: Response, back: Array) -> Array:
        """Return (K, p): sum over time of what ``back`` (F, 18, p) weighs on functionals, times those of every
        error.
        """
        return np.tensordot(self.functional(trial), back, axes=((0, 1), (0, 1)))

    @abstractmethod
    def squares(self, trial: Response) -> Array:
        """Return (K,) mean square distance (m²) between markers and model that every error leaves."""


def neighbours(body: Body) -> Array:
    """Return (n, N) 1 where an anatomical joint (all its axes) is at an end of a segment."""
    table = np.zeros((len(body.joints), len(body.segments)))
    for chain in chains(body):
        child, above = body.joints[chain[-1]].segment, body.joints[chain[0]].parent
        table[np.ix_(chain, (child, 0 if above < 0 else body.joints[above].segment))] = 1.0
    return table


def mean_local(trial: Response, residual: Array, weight: Array) -> Array:
    """Return (M, 3, P * n): mean over time of residuals (F, 3M, P) in segment axes, times ``weight`` (F, n)."""
    frames, worn = len(residual), list(trial.body.markers.segment)
    local = np.swapaxes(trial.pose.rotation[:, worn], -1, -2) @ residual.reshape(frames, len(worn), 3, -1)
    return np.asarray(local.reshape(frames, -1).T @ weight / frames).reshape(len(worn), 3, -1)


def mean_squares(left: Array) -> Array:
    """Return (K,) mean square distance of markers that are ``left`` (F, 3M, K) m from the model."""
    return np.asarray(3 * np.mean(left**2, axis=(0, 1)))
