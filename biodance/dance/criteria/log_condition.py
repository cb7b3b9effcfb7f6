"""Logarithm of cond(W_b): the same optimum as cond, but a slope that does not explode where the start is nearly singular."""

import numpy as np

from biodance.dance.criteria.condition import block_condition
from biodance.dance.target import Target
from biodance.records import Array

NAME = "log_condition"


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return log cond(W_b) and its gradient."""
    value, gradient = block_condition(triangle, target.columns)
    return float(np.log(value)), gradient / value
