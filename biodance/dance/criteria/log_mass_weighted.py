"""Logarithm of the paper's criterion (eq. 12), for starts that are nearly singular."""

import numpy as np

from biodance.dance.criteria import mass_weighted
from biodance.dance.target import Target
from biodance.records import Array

NAME = "log_mass_weighted"


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return log(sum_i M_i cond(W_bi)) and its gradient."""
    value, gradient = mass_weighted.evaluate(triangle, target)
    return float(np.log(value)), gradient / value
