"""Condition number of the whole base regressor, cond(W_b): the classical criterion (paper III.B; Gautier & Khalil 1992)."""

import numpy as np

from biodance.dance.target import Target, spectrum
from biodance.records import Array

NAME = "condition"


def block_condition(gram: Array, columns: tuple[int, ...]) -> tuple[float, Array]:
    """Return cond = sqrt(largest / smallest eigenvalue of the block) and its gradient (p, p), zero outside the block."""
    value, vector = spectrum(gram, columns)
    condition = float(np.sqrt(value[-1] / value[0]))
    high, low = vector[:, -1], vector[:, 0]
    gradient = np.zeros_like(gram)
    gradient[np.ix_(columns, columns)] = 0.5 * condition * (np.outer(high, high) / value[-1] - np.outer(low, low) / value[0])
    return condition, gradient


def evaluate(gram: Array, target: Target) -> tuple[float, Array]:
    """Return cond(W_b) and its gradient."""
    return block_condition(gram, target.columns)
