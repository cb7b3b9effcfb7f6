"""The paper's criterion: sum of segment mass times the condition number of the segment's sub-regressor (eq. 12)."""

import numpy as np

from biodance.dance.criteria.condition import block_condition
from biodance.dance.target import Target
from biodance.records import Array

NAME = "mass_weighted"


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return sum_i M_i cond(W_bi), kg, and its gradient; a segment whose block is empty does not count."""
    total, slope = 0.0, np.zeros((triangle.shape[1],) * 2)
    for weight, block in zip(target.weights, target.blocks, strict=True):
        if block and weight > 0:
            value, gradient = block_condition(triangle, block)
            total += weight * value
            slope += weight * gradient
    return total, slope
