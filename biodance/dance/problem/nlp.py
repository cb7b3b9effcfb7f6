"""Nonlinear programmes: one small design problem with exact slopes, and its solution by sequential quadratic
programming.

The problem: the points of some coordinates, through a spline, give objective and margins: min f(y) subject to c(y) >=
0. Every step solves a strictly convex quadratic programme with one common slack (so it always has a solution), as a
least-distance problem by non-negative least squares (Lawson & Hanson 1974, ch. 23); the Hessian is a damped BFGS
estimate, the merit function f + weight * largest violation, steps are bounded by a trust region.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.dance.limits import Limit
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import Closure, State, close_legs
from biodance.records import Array

Objective = Callable[[State], tuple[float, Array]]
"""Returns f and its slopes (3, T, n) by x, v, a, which are always computed together."""


def no_objective(state: State) -> tuple[float, Array]:
    """Objective of a problem that has none: any point that keeps the limits will do."""
    return 0.0, np.zeros((3, *state.x.shape))


def free_coordinates(chain: Chain, stance: Stance) -> list[int]:
    """Return the coordinates that are free when the planted legs follow the pelvis, and a seated pelvis rests."""
    # Planted legs follow the pelvis.
    held = {c for side in stance.planted for c in chain.leg_columns[side]} | set(range(ROOT if stance.seat else 0))
    return [c for c in range(chain.size) if c not in held]


@dataclass(frozen=True, eq=False)
class NonlinearProgramme:
    """``base`` (3, T, n) coordinates, rates and accelerations to which the points of the ``free`` coordinates add
    through ``basis`` (3, T, K); ``limits`` to keep, each by its column of ``reserve`` (T, limits) in its scale.
    """

    chain: Chain
    stance: Stance
    base: Array
    basis: Array
    free: list[int]
    limits: tuple[Limit, ...]
    objective: Objective
    reserve: Array

    def state(self, y: Array) -> State:
        """Return the motion of the points y (K * free,)."""
        samples = self.base.copy()
        # x, v and a are linear in the points: basis (T, K) times points (K, free).
        samples[:, :, self.free] += self.basis @ y.reshape(self.basis.shape[2], -1)
        return close_legs(self.chain, self.stance, *samples)

    def evaluate(self, y: Array) -> "Evaluation":
        """Return objective and margins at y."""
        return Evaluation(self, self.state(y))


class Evaluation:
    """Objective ``value`` and ``margins`` (m,) >= 0 at a point of a problem, slopes on demand."""

    def __init__(self, problem: NonlinearProgramme, state: State) -> None:
        self.problem, self.state = problem, state
        self.value, self._slope = problem.objective(state)
        self._found = [(limit.margins(state), limit.scale) for limit in problem.limits]
        # (limits, T, 1): the same reserve for all columns of a limit.
        spare = problem.reserve.T[:, :, None]
        self._spare = [m.value / scale - r for (m, scale), r in zip(self._found, spare, strict=True)]
        self.margins = np.concatenate([np.empty(0), *(spare.ravel() for spare in self._spare)])

    @property
    def worst(self) -> tuple[float, str]:
        """The largest violation in the scale of its limit (negative: room left), and the name of the limit."""
        least = [float(spare.min(initial=np.inf)) for spare in self._spare]
        k = int(np.argmin(least))
        return -least[k], self.problem.limits[k].name

    @property
    def least(self) -> Array:
        """(T,) what is left in each sample, in the scales of the limits."""
        return np.min([spare.min(axis=1, initial=np.inf) for spare in self._spare], axis=0)

    @cached_property
    def near(self) -> NDArray[np.intp]:
        """The margins that a step could reach: only they enter its programme."""
        return np.flatnonzero(self.margins < _NEAR)

    @cached_property
    def near_slopes(self) -> Array:
        """(len(near), K * free) slopes of these margins by the points."""
        return self.jacobian(self.near)

    @cached_property
    def _closure(self) -> Closure:
        return Closure(self.state)

    @cached_property
    def gradient(self) -> Array:
        """(K * free,) slope of the objective by the points."""
        # The objective is one number: its slopes by all samples add up.
        return self._chain(list(self._slope), np.arange(len(self.state.x))).sum(axis=0)

    def jacobian(self, rows: NDArray[np.intp]) -> Array:
        """Return the slopes (len(rows), K * free) of the chosen margins by the points."""
        first, parts = 0, [np.empty((0, self.problem.basis.shape[2] * len(self.problem.free)))]
        for margin, scale in self._found:
            size = margin.value.size
            inside = rows[(rows >= first) & (rows < first + size)] - first
            first += size
            if inside.size:
                # The margins lie sample after sample in the flat vector.
                time, which = np.unravel_index(inside, margin.value.shape)
                parts.append(self._chain([s[time, which] / scale for s in margin.slopes], time))
        return np.concatenate(parts)

    def _chain(self, slopes: list[Array], time: NDArray[np.intp]) -> Array:
        """Return slopes (R, K * free) by the points, of slopes (R, n) by x, v, a at the instants ``time`` (R,)."""
        free, basis, closure = self.problem.free, self.problem.basis, self._closure
        # Chain rule through the planted legs: x(root), v(root, v), a(root, v, a).
        by = [closure.followed(slopes[0], time)]
        if len(slopes) > 1 and basis[1].any():
            by[0] += closure.turned(slopes[1], "v", time)
            by.append(closure.followed(slopes[1], time))
        if len(slopes) > 2 and basis[2].any():
            by[0] += closure.turned(slopes[2], "ax", time)
            by[1] += closure.turned(slopes[2], "av", time)
            by.append(closure.followed(slopes[2], time))
        # d/dy_kf = sum over x, v, a of basis_tk times slope_f.
        out = sum(basis[k][time][:, :, None] * part[:, None, free] for k, part in enumerate(by))
        return np.asarray(out).reshape(len(time), basis.shape[2] * len(free))


WEIGHT = 100.0
_NEAR = 1.5  # Margins (in their scale) larger than this cannot become active within one step


def minimise(problem: NonlinearProgramme, start: Array, *, iterations: int) -> tuple[Array, float]:
    """Return a local minimum y (n,) from ``start`` and its violation, the largest -c (negative: room left); f and c
    should be scaled so that 1 is a large amount.
    """
    y, n = start.copy(), start.size
    point, hessian, radius = problem.evaluate(y), np.eye(n), 0.3
    for _ in range(iterations):
        step, price = quadratic_step(hessian, point.gradient, point.near_slopes, point.margins[point.near], radius)
        # Fall of the merit function that the linear model promises.
        left = point.margins[point.near] + point.near_slopes @ step
        predicted = -(point.gradient @ step) + WEIGHT * (worst(point.margins) - worst(left))
        trial = problem.evaluate(y + step)
        gained = point.value - trial.value + WEIGHT * (worst(point.margins) - worst(trial.margins))
        if gained < 0.05 * predicted or not np.isfinite(gained):
            radius *= 0.35
            if radius < 1e-3 or predicted < 1e-6:
                break
            if not gained > 0:
                continue
        elif gained > 0.7 * predicted:
            radius = min(2 * radius, 1.0)
        # Change of the gradient of the Lagrangian, f - price' c, with the prices of this step.
        bend = trial.gradient - point.gradient - price @ (trial.jacobian(point.near) - point.near_slopes)
        hessian = update(hessian, step, bend)
        y, point = y + step, trial
        if gained < 1e-3 and worst(point.margins) < 1e-4:
            break
    return y, float(-point.margins.min(initial=np.inf))


def worst(margins: Array) -> float:
    """Return the largest violation, 0 if there is none."""
    return max(0.0, -float(margins.min(initial=0.0)))


def quadratic_step(
    hessian: Array, gradient: Array, jacobian: Array, margins: Array, radius: float
) -> tuple[Array, Array]:
    """Return the step d (n,) and the prices (m,): min d'Hd/2 + g'd + t + t²/2, Jd + t/weight >= -c, |d| <= radius."""
    from scipy.optimize import nnls

    n, box, price = gradient.size, np.eye(gradient.size), np.zeros(len(jacobian))
    # The largest change of a linear margin in the box is radius times the sum of |slopes|.
    within = margins < radius * np.abs(jacobian).sum(axis=1) + 1 / WEIGHT  # the others cannot be reached by this step
    jacobian, margins = jacobian[within], margins[within]
    # H = L L', z = L'd + L^-1 g: the quadratic form becomes |z|² / 2.
    lower = np.linalg.cholesky(hessian)
    # Margins, and the trust region as two bounds of every variable.
    rows = np.concatenate([jacobian, box, -box])
    needed = np.concatenate([-margins, np.full(2 * n, -radius)])
    slack = np.concatenate([np.full(len(jacobian), 1 / WEIGHT), np.zeros(2 * n)])
    # Rows of J L^-T: J d = inner (z - shift).
    inner = np.linalg.solve(lower, rows.T).T
    shift = np.linalg.solve(lower, gradient)
    # t + t²/2 = (t + 1)²/2 - 1/2: the last variable is t + 1, at least 1.
    G = np.concatenate([np.column_stack([inner, slack]), np.eye(n + 1)[-1:]])
    h = np.concatenate([needed + inner @ shift + slack, [1.0]])
    try:
        # Least distance |u|, G u >= h, by NNLS (Lawson and Hanson): min |[G'; h'] m - (0, ..., 0, 1)|, m >= 0.
        multiplier, _ = nnls(np.vstack([G.T, h]), np.eye(n + 2)[-1], maxiter=20 * len(h))
    except RuntimeError:
        return np.zeros(n), price
    # u = G'm / (1 - h'm); m over the same number are the multipliers.
    rest = max(1.0 - float(h @ multiplier), 1e-12)
    # d = L^-T (z - shift).
    step = np.linalg.solve(lower.T, (G.T @ multiplier)[:n] / rest - shift)
    price[within] = np.minimum(multiplier[: len(jacobian)] / rest, WEIGHT)
    return np.clip(step, -radius, radius), price


def update(hessian: Array, step: Array, change: Array) -> Array:
    """Return the BFGS update, damped after Powell to stay positive definite; the identity where it would not."""
    curved = hessian @ step
    bend = float(step @ curved)
    if bend < 1e-14:
        return hessian
    along = float(step @ change)
    # Powell: mix y with H s so that s'y = 0.2 s'H s at least.
    mix = 1.0 if along >= 0.2 * bend else 0.8 * bend / (bend - along)
    change = mix * change + (1 - mix) * curved
    # BFGS: H - H s s'H / s'H s + y y' / s'y.
    out = hessian - np.outer(curved, curved) / bend + np.outer(change, change) / float(step @ change)
    out = (out + out.T) / 2
    sound = np.isfinite(out).all() and float(np.linalg.eigvalsh(out)[0]) > 1e-6 * max(float(np.abs(out).max()), 1e-6)
    return out if sound else np.eye(len(out))
