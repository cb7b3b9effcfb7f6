"""Condition number of the whole base regressor, cond(W_b): the classical criterion (paper III.B; Gautier & Khalil 1992)."""

import numpy as np

from biodance.dance.target import Target, spectrum
from biodance.records import Array

NAME = "condition"


def block_condition(triangle: Array, columns: tuple[int, ...]) -> tuple[float, Array]:
    """Return cond = sqrt(largest / smallest eigenvalue of the block) and its gradient (p, p), zero outside the block."""
    value, vector = spectrum(triangle, columns)
    condition = float(np.sqrt(value[0] / value[-1]))
    high, low = vector[:, 0], vector[:, -1]
    gradient = np.zeros((triangle.shape[1],) * 2)
    gradient[np.ix_(columns, columns)] = 0.5 * condition * (np.outer(high, high) / value[0] - np.outer(low, low) / value[-1])
    return condition, gradient


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return cond(W_b) and its gradient."""
    return block_condition(triangle, target.columns)
