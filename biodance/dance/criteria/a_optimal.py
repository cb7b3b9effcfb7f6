"""A-optimality: logarithm of the summed relative variances of the base parameters, scaled by the table's standard deviations."""

import numpy as np

from biodance.dance.target import Target, spectrum
from biodance.records import Array

NAME = "a_optimal"


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return log tr(D^-1 (W_b'W_b)^-1 D^-1), D the table's standard deviations (1 where the table fixes a parameter), and its gradient."""
    pick = np.ix_(target.columns, target.columns)
    sd = np.linalg.norm(target.prior_factor, axis=1)[list(target.columns)]
    scale = np.where(sd > 0, sd, 1.0)
    value, vector = spectrum(triangle[:, target.columns] * scale, tuple(range(len(scale))))
    trace = float(np.sum(1 / value))
    gradient = np.zeros((triangle.shape[1],) * 2)
    gradient[pick] = -((vector / value**2) @ vector.T) * np.outer(scale, scale) / trace
    return float(np.log(trace)), gradient
