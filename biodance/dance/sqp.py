"""Sequential quadratic programming for small smooth problems with many inequalities: min f(y) subject to c(y) >= 0.

Every step solves a strictly convex quadratic programme with one common slack (so it always has a solution), as a least-distance problem by
non-negative least squares (Lawson & Hanson 1974, ch. 23); the Hessian is a damped BFGS estimate, the merit function f + weight * largest
violation, steps are bounded by a trust region.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from biodance.records import Array


class Point(Protocol):
    """What a programme says about one y: ``value`` f, ``margins`` c (m,), and, only when asked, the slopes."""

    value: float
    margins: Array

    def slopes(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return df/dy (n,) and dc/dy (len(rows), n) of the chosen margins."""
        ...


@dataclass(frozen=True, eq=False)
class Solution:
    """``y`` (n,), ``value`` f, ``violation`` = largest -c (negative: room left), ``iterations``."""

    y: Array
    value: float
    violation: float
    iterations: int


WEIGHT = 100.0
NEAR = 1.5
"""Margins (in their scale) larger than this cannot become active within one step."""


def minimise(
    judge: Callable[[Array], Point], start: Array, *, iterations: int = 30, radius: float = 0.3, tolerance: float = 1e-3
) -> Solution:
    """Return a local minimum from ``start``; f and c should be scaled so that 1 is a large amount."""
    y, n = start.copy(), start.size
    point, hessian = judge(y), np.eye(n)
    count = 0
    for count in range(1, iterations + 1):  # noqa: B007
        rows = np.flatnonzero(point.margins < NEAR)
        gradient, jacobian = point.slopes(rows)
        step, price = quadratic_step(hessian, gradient, jacobian, point.margins[rows], radius)
        predicted = -(gradient @ step) + WEIGHT * (worst(point.margins) - worst(point.margins[rows] + jacobian @ step))
        trial = judge(y + step)
        gained = point.value - trial.value + WEIGHT * (worst(point.margins) - worst(trial.margins))
        if gained < 0.05 * predicted or not np.isfinite(gained):
            radius *= 0.35
            if radius < 1e-3 or predicted < 1e-6:
                break
            if not gained > 0:
                continue
        elif gained > 0.7 * predicted:
            radius = min(2 * radius, 1.0)
        new_gradient, new_jacobian = trial.slopes(rows)
        hessian = update(hessian, step, new_gradient - gradient - price @ (new_jacobian - jacobian))
        y, point = y + step, trial
        if gained < tolerance and worst(point.margins) < 1e-4:
            break
    return Solution(y, point.value, float(-point.margins.min(initial=np.inf)), count)


def worst(margins: Array) -> float:
    """Return the largest violation, 0 if there is none."""
    return max(0.0, -float(margins.min(initial=0.0)))


def quadratic_step(hessian: Array, gradient: Array, jacobian: Array, margins: Array, radius: float) -> tuple[Array, Array]:
    """Return the step d (n,) and the prices (m,) of the margins: min d'Hd/2 + g'd + t + t²/2, Jd + t/weight >= -c, |d| <= radius."""
    from scipy.optimize import nnls

    n, box, price = gradient.size, np.eye(gradient.size), np.zeros(len(jacobian))
    within = margins < radius * np.abs(jacobian).sum(axis=1) + 1 / WEIGHT  # the others cannot be reached by this step
    jacobian, margins = jacobian[within], margins[within]
    lower = np.linalg.cholesky(hessian)
    rows = np.concatenate([jacobian, box, -box])
    needed = np.concatenate([-margins, np.full(2 * n, -radius)])
    slack = np.concatenate([np.full(len(jacobian), 1 / WEIGHT), np.zeros(2 * n)])
    inner = np.linalg.solve(lower, rows.T).T
    shift = np.linalg.solve(lower, gradient)
    G = np.concatenate([np.column_stack([inner, slack]), np.eye(n + 1)[-1:]])
    h = np.concatenate([needed + inner @ shift + slack, [1.0]])
    try:
        multiplier, _ = nnls(np.vstack([G.T, h]), np.eye(n + 2)[-1], maxiter=20 * len(h))
    except RuntimeError:
        return np.zeros(n), price
    rest = max(1.0 - float(h @ multiplier), 1e-12)
    step = np.linalg.solve(lower.T, (G.T @ multiplier)[:n] / rest - shift)
    price[within] = np.minimum(multiplier[: len(jacobian)] / rest, WEIGHT)
    return np.clip(step, -radius, radius), price


def update(hessian: Array, step: Array, change: Array) -> Array:
    """Return the BFGS update, damped after Powell so that it stays positive definite; the identity where it would not."""
    curved = hessian @ step
    bend = float(step @ curved)
    if bend < 1e-14:
        return hessian
    along = float(step @ change)
    mix = 1.0 if along >= 0.2 * bend else 0.8 * bend / (bend - along)
    change = mix * change + (1 - mix) * curved
    out = hessian - np.outer(curved, curved) / bend + np.outer(change, change) / float(step @ change)
    out = (out + out.T) / 2
    sound = np.isfinite(out).all() and float(np.linalg.eigvalsh(out)[0]) > 1e-6 * max(float(np.abs(out).max()), 1e-6)
    return out if sound else np.eye(len(out))
