"""What will we know afterwards: logarithm of the summed posterior variances, each in units of its variance in the table.

Posterior covariance C = S (1 + S'GS)^-1 S' for a table covariance S S' and a Gram matrix G = R'R whitened by the noise of the lab.
"""

import numpy as np

from biodance.dance.target import Target
from biodance.records import Array

NAME = "posterior_variance"


def evaluate(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return log sum_k weight_k C_kk / P_kk over the parameters of the weighted blocks, and its gradient."""
    S = target.prior_factor
    before = np.sum(S**2, axis=1)
    weight = np.zeros(len(S))
    for segment, block in zip(target.weights, target.blocks, strict=True):
        weight[list(block)] = segment
    relative = np.where(before > 0, weight / np.where(before > 0, before, 1.0), 0.0)
    known = triangle @ S
    after = S @ np.linalg.solve(np.eye(S.shape[1]) + known.T @ known, S.T)
    total = float(relative @ np.diag(after))
    return float(np.log(total)), -(after * relative) @ after / total
