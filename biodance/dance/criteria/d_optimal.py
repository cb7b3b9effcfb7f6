"""D-optimality: minus the log-determinant of the information of the base parameters (volume of their confidence ellipsoid)."""

import numpy as np

from biodance.dance.target import Target, spectrum
from biodance.records import Array

NAME = "d_optimal"


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return -log det(W_b'W_b) and its gradient; a singular block is floored at 1e-30 of its largest eigenvalue."""
    value, vector = spectrum(triangle, target.columns)
    gradient = np.zeros((triangle.shape[1],) * 2)
    gradient[np.ix_(target.columns, target.columns)] = -(vector / value) @ vector.T
    return -float(np.sum(np.log(value))), gradient
