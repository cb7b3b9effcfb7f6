"""Seven excitation criteria: each judges what a movement tells about the parameters of the chain; smaller is better.

A criterion judges the information G = R'R = W'W (p, p) of the whitened regressor over the SIP, accumulated over a whole
movement and given as its triangle R (or any rows with the same G). It returns (value, gradient) with ``gradient`` (p,
p) symmetric, dJ = <gradient, dG>. So every criterion works for every body and movement, and its derivative by a motion
is the chain rule through W.
"""

from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from target import Target, spectrum

from biodance.errors import UnknownName
from biodance.records import Array

Criterion = Callable[[Array, Target], tuple[float, Array]]


def block_condition(triangle: Array, columns: tuple[int, ...]) -> tuple[float, Array]:
    """Return cond = sqrt(largest / smallest eigenvalue of the block) and its gradient (p, p), zero outside the
    block.
    """
    value, vector = spectrum(triangle, columns)
    cond = float(np.sqrt(value[0] / value[-1]))
    high, low = vector[:, 0], vector[:, -1]
    gradient = np.zeros((triangle.shape[1],) * 2)
    gradient[np.ix_(columns, columns)] = 0.5 * cond * (np.outer(high, high) / value[0] - np.outer(low, low) / value[-1])
    return cond, gradient


def condition(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return cond(W_b), the classical criterion (paper III.B; Gautier & Khalil 1992), and its gradient."""
    return block_condition(triangle, target.columns)


def mass_weighted(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return the paper's sum_i M_i cond(W_bi), kg (eq. 12), and its gradient; a segment whose block is empty does not
    count.
    """
    total, slope = 0.0, np.zeros((triangle.shape[1],) * 2)
    for weight, block in zip(target.weights, target.blocks, strict=True):
        if block and weight > 0:
            value, gradient = block_condition(triangle, block)
            total += weight * value
            slope += weight * gradient
    return total, slope


def d_optimal(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return -log det(W_b'W_b), the volume of the confidence ellipsoid, and its gradient; floored at 1e-30 of the
    largest eigenvalue.
    """
    value, vector = spectrum(triangle, target.columns)
    gradient = np.zeros((triangle.shape[1],) * 2)
    gradient[np.ix_(target.columns, target.columns)] = -(vector / value) @ vector.T
    return -float(np.sum(np.log(value))), gradient


def a_optimal(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return log tr(D^-1 (W_b'W_b)^-1 D^-1), D the table's standard deviations (1 where the table fixes a parameter),
    and its gradient.
    """
    pick = np.ix_(target.columns, target.columns)
    sd = np.linalg.norm(target.prior_factor, axis=1)[list(target.columns)]
    scale = np.where(sd > 0, sd, 1.0)
    value, vector = spectrum(triangle[:, target.columns] * scale, tuple(range(len(scale))))
    trace = float(np.sum(1 / value))
    gradient = np.zeros((triangle.shape[1],) * 2)
    gradient[pick] = -((vector / value**2) @ vector.T) * np.outer(scale, scale) / trace
    return float(np.log(trace)), gradient


def posterior_variance(triangle: Array, target: Target) -> tuple[float, Array]:
    """Return log sum_k weight_k C_kk / P_kk over the parameters of the weighted blocks, and its gradient.

    Posterior covariance C = S (1 + S'GS)^-1 S' for a table covariance P = S S' and a G whitened by the noise of the
    lab.
    """
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


def log_of(criterion: Criterion) -> Criterion:
    """Return the logarithm of a criterion: the same optimum, but a slope that does not explode where the start is
    nearly singular.
    """

    def logarithm(triangle: Array, target: Target) -> tuple[float, Array]:
        value, gradient = criterion(triangle, target)
        return float(np.log(value)), gradient / value

    return logarithm


CRITERIA = MappingProxyType(
    {
        "a_optimal": a_optimal,
        "condition": condition,
        "d_optimal": d_optimal,
        "log_condition": log_of(condition),
        "log_mass_weighted": log_of(mass_weighted),
        "mass_weighted": mass_weighted,
        "posterior_variance": posterior_variance,
    }
)


def criterion(name: str) -> Criterion:
    """Return one criterion; UnknownName lists the legal ones."""
    if name not in CRITERIA:
        raise UnknownName.of("excitation criterion", name, tuple(CRITERIA))
    return CRITERIA[name]
