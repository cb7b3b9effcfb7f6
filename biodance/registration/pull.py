"""What a piece of evidence says of the pose of the plates: its information and where it pulls."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from biodance.records import Array


@dataclass(frozen=True, eq=False)
class PoseEvidence:
    """Information about four unknowns, x, y m, yaw rad about a common vertical, delay s, as changes of a pose:
    ``information`` (4, 4) = J' V^-1 J and ``vector`` (4,) = J' V^-1 y; ``misfit`` the mean square of its whitened rows,
    1 expected; ``rows`` how many.
    """

    information: Array
    vector: Array
    misfit: float
    rows: int

    def less_sure(self, added: Array) -> "PoseEvidence":
        """Return the same with the covariance ``added`` (4, 4) of what its model does not know."""
        covariance = np.linalg.pinv(self.information)
        change = covariance @ self.vector
        wider = np.linalg.inv(covariance + added)
        return PoseEvidence(np.asarray(wider), wider @ change, self.misfit, self.rows)


def together(pulls: Iterable[PoseEvidence]) -> tuple[Array, Array]:
    """Return the change (4,) of the pose that all evidence asks for, and its covariance (4, 4)."""
    some = tuple(pulls)
    covariance = np.linalg.inv(np.sum([one.information for one in some], axis=0))
    return covariance @ np.sum([one.vector for one in some], axis=0), covariance
