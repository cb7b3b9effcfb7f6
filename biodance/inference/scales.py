"""The posterior of all coefficients under the most probable scales of a session.

With rows y = X u + e, u ~ N(0, diag lambda_g^2), e ~ N(0, s^2) in the plates' rows, unit normal in the markers' and
Student in the observations, the logarithms a of all scales have normal priors, and their posterior mode is found by
Fisher scoring. The logarithm of a column's scale is that of its group and, where each target is as it is (a marker),
the target's own. Columns of one group and target are a cell c. With A = 1 + L X' S^-2 X L (L the scales of the
columns), C = A^-1 and e what the posterior mean leaves:

    d log p(y) / d log lambda_c = |u_c|^2 + tr C_cc - n_c         information 2 |1 - C|^2 in cells c, d; or as observed
    d log p(y) / d log s        = |e|^2 / s^2 + t - n             information 2 (n - t)^2 / n,  t = tr X L C L X' / s^2

Of a group it is the sum over its cells. What is observed of a cell, its own second derivative, is
2 (|u_c|^2 - 2 u_c' C_cc u_c + tr C_cc - |C_cc|^2), whose expected value stands above. Where it is larger (coefficients
larger than their scale, which its prior holds back), a step by what is expected goes too far and back again: the larger
of both is taken.

Observations have Student's errors with four degrees of freedom (about one step in twenty is an outlier): their weights
are iterated (iteratively reweighted least squares). The log evidence is Laplace's approximation over all coefficients.

One scale holds for the noise of all bands and channels: where one of them is louder than the others, the simulation is
that far off everywhere.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.linalg.lapack import dpotri

from biodance.effects import Care
from biodance.inference.columns import VisibleColumns
from biodance.inference.rows import BODY, SOFT, Rows
from biodance.records import Array

TAIL = 4.0
"""Degrees of freedom of an observation's own error."""
LOUD = 0.5
"""Standard deviation of the logarithm of the noise, between laboratories and persons."""
SPREAD, FLESH, TOLERANCE = 0.25, 0.6, 0.35
"""Standard deviation of the logarithm of the size of a group of what is no fault, between persons and laboratories: of
the body, of soft tissue, and of tolerances.
"""
EACH = 0.5
"""The same of one target beside its group (`Effect.each_its_own`): 0.8 is more probable in faultless real sessions, and
would take a marker knocked by 20 mm for a usual one.
"""
FLOOR = -0.3
"""Logarithm below which no group is believed to be smaller than where its size was learned."""
CONVERGED = 0.02
"""Change of the logarithm of a scale below which its search ends."""
_STEPS, _FAR = 12, 0.7
_NONE = np.empty(0, dtype=np.intp)


@dataclass(frozen=True, eq=False)
class Scales:
    """Logarithms of the scales of the ``groups`` (G,) of columns, of their ``members`` (M,) beside them and of the
    ``noise``; ``weights`` (n,) of the observations.
    """

    groups: Array
    members: Array
    noise: float
    weights: Array

    def of(self, group: NDArray[np.intp], member: NDArray[np.intp]) -> Array:
        """Return the scales (k,) of columns of these groups and members, 1 for those of neither (-1)."""
        # The last entry is that of index -1.
        both = np.append(self.groups, 0.0)[group] + np.append(self.members, 0.0)[member]
        return np.asarray(np.exp(both))

    def far(self, other: "Scales") -> float:
        """Return how far the logarithms of scales of columns and noise, and the weights, lie from others."""
        here, there = (np.concatenate([one.groups, one.members, [one.noise], one.weights]) for one in (self, other))
        return float(np.abs(here - there).max())


@dataclass(frozen=True, eq=False)
class Products:
    """Inner products of columns and target, all that the posterior needs: ``plates`` and ``markers`` (K + 1, K + 1)
    with the target last, ``observed`` (n, K + 1) the observations' rows, of which only the columns ``used`` are not
    zero; ``count`` plates' rows; ``group`` and ``member`` (K,) of each column, -1: none; ``without`` indices of columns
    that do not count.
    """

    plates: Array
    markers: Array
    observed: Array
    used: NDArray[np.intp]
    count: int
    group: NDArray[np.intp]
    member: NDArray[np.intp]
    without: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Curvature:
    """What the data tell of the scales of cells: ``shares`` (C,) trace of the posterior covariance of each and
    ``known`` (C, C) the information on their scales, ``observed`` (C,) that of each in just these data; ``taken`` how
    many of the plates' rows the columns take.
    """

    shares: Array
    known: Array
    observed: Array
    taken: float


@dataclass(frozen=True, eq=False)
class ScaledFit:
    """Posterior of the coefficients: ``lower`` Cholesky factor of A; ``u`` (K,) posterior mean per scaled column;
    ``size`` (K,) of the columns; ``scales``; ``log_evidence`` up to a constant of the session; ``square`` of the
    plates' rows that is left.
    """

    lower: Array
    u: Array
    size: Array
    scales: Scales
    log_evidence: float
    square: float
    products: Products

    def last(self, count: int) -> tuple[Array, Array]:
        """Return mean (count,) and covariance (count, count) of the last coefficients."""
        # C = L^-T L^-1: the covariance of chosen coefficients is half' half, half = L^-1 (unit columns).
        unit = np.eye(len(self.u))[:, len(self.u) - count :]
        half = solve_triangular(self.lower, unit, lower=True, check_finite=False)
        return self.u[len(self.u) - count :], half.T @ half

    def variance(self, row: Array) -> float:
        """Return the posterior variance of ``row`` (K,) times the scaled coefficients."""
        half = solve_triangular(self.lower, row, lower=True, check_finite=False)
        return float(half @ half)

    @cached_property
    def coefficients(self) -> Array:
        """(K,) posterior mean per unit of the unscaled columns."""
        return np.asarray(self.size * self.u)

    def curvature(self, starts: NDArray[np.intp]) -> Curvature:
        """Return what the data tell of the scales of cells, whose columns lie side by side from ``starts`` (C,) on."""
        if not starts.size:
            return Curvature(np.empty(0), np.empty((0, 0)), np.empty(0), 0.0)
        # C above its diagonal, zero below: a sum over the whole is twice that over this half, less its diagonal.
        half = dpotri(self.lower, lower=True)[0].T

        def summed(upper: Array) -> Array:
            cells = np.add.reduceat(np.add.reduceat(upper, starts, axis=0), starts, axis=1)
            return np.asarray(cells + cells.T - np.diag(np.add.reduceat(np.diag(upper), starts)))

        shares, own = np.add.reduceat(np.diag(half), starts), np.add.reduceat(self.u**2, starts)
        count = np.diff(starts, append=len(self.u))
        # |C_cd|^2 (Frobenius) between all cells; |1 - C|^2 differs on the diagonal alone.
        square = summed(half**2)
        known = 2 * square + np.diag(2 * (count - 2 * shares))
        within = np.diag(summed(self.u[:, None] * half * self.u))  # u_c' C_cc u_c
        observed = 2 * (own - 2 * within + shares - np.diag(square))
        half *= self.products.plates[:-1, :-1]
        taken = self.size @ (2 * (half @ self.size) - np.diag(half) * self.size)  # tr(L C L X'X)
        return Curvature(shares, known, observed, float(taken * np.exp(-2 * self.scales.noise)))


def nominal(rows: Rows) -> Scales:
    """Return the scales of a session that is like those that everything was learned on."""
    members = int(rows.member.max(initial=-1)) + 1
    return Scales(np.zeros(len(rows.groups)), np.zeros(members), 0.0, np.ones(len(rows.y) - rows.simulated))


def products(columns: VisibleColumns, Z: Array, y: Array, sure: Array, without: NDArray[np.intp] = _NONE) -> Products:
    """Return the inner products of all ``columns`` but those ``without``, further ones ``Z`` (r, p) of fixed scale and
    the target ``y`` (r,), where rows of the plates are scaled by that of ``sure`` (Q + 1,) for their band and channel.
    """
    rows, X, square = columns.rows, columns.X, sure**2
    n, r, K = rows.plates, rows.simulated, X.shape[1]
    tail = np.concatenate([Z, y[:, None]], axis=1)
    heavy = square[rows.block][:, None] * tail

    def put(inner: Array, part: slice) -> Array:
        out = np.empty((K + tail.shape[1], K + tail.shape[1]))
        cross = X[part].T @ heavy[part]
        # X' W X is known; only the products with the tail are new for this hypothesis.
        out[:K, :K], out[:K, K:], out[K:, :K] = inner, cross, cross.T
        out[K:, K:] = tail[part].T @ heavy[part]
        return out

    plates = put(columns.scaled(square), slice(n))
    markers = put(columns.markers, slice(n, r))
    observed = np.concatenate([X[r:], tail[r:]], axis=1)
    used = np.flatnonzero(observed.any(axis=0))
    group, member = (np.append(one, np.full(Z.shape[1], -1)) for one in (columns.group, columns.member))
    return Products(plates, markers, observed, used, n, group, member, without)


def as_anywhere(scales: Scales, rows: Rows) -> Scales:
    """Return the scales with no tolerance larger than where it was learned: no fault hides in what then is left."""
    tolerated = np.isin(rows.groups, list(Care))
    groups = np.where(tolerated, np.minimum(scales.groups, 0.0), scales.groups)
    return replace(scales, groups=groups, members=np.minimum(scales.members, 0.0))


def bare(columns: VisibleColumns, y: Array | None = None) -> Products:
    """Return the inner products of the columns with a target ``y`` (r,), the session's by default, without causes."""
    y = columns.rows.y if y is None else y
    return products(columns, np.empty((len(y), 0)), y, np.ones(columns.rows.noises + 1))


def prior_sd(rows: Rows) -> Array:
    """Return (G,) the standard deviations of the logarithms of the groups' scales."""
    known = {BODY: SPREAD} | dict.fromkeys(SOFT, FLESH)
    return np.array([known.get(name, TOLERANCE) for name in rows.groups])


def fit(found: Products, sd: Array, start: Scales, *, least: float = 0.0) -> ScaledFit:
    """Return the posterior at the most probable scales, whose logarithms have prior standard deviations ``sd`` (G,),
    searched for from ``start``; the noise is at least ``least``.
    """
    at = replace(start, noise=max(start.noise, least))
    for _ in range(_STEPS):
        one = posterior(found, sd, at)
        at = nearer(one, sd, least)
        if at.far(one.scales) < CONVERGED:
            break
    return one


def posterior(found: Products, sd: Array, at: Scales) -> ScaledFit:
    """Return the posterior under given scales, with its evidence."""
    K = found.group.size
    size = at.of(found.group, found.member)
    # A column of size zero leaves A = 1 there: coefficient zero, prior variance, no part in log |A|.
    size[found.without] = 0.0
    loud = np.exp(-2 * at.noise)
    whole = found.plates * loud
    whole += found.markers
    seen = found.observed[:, found.used]
    # Only the columns that observations have: the sum of w_i x_i x_i' has zeros elsewhere.
    whole[np.ix_(found.used, found.used)] += (seen * at.weights[:, None]).T @ seen
    # A = 1 + L X' S^-2 X L: rows, then columns times their sizes.
    A = size[:, None] * whole[:K, :K]
    A *= size
    A.flat[:: K + 1] += 1.0
    # A is symmetric: its transpose is the same matrix in LAPACK's order, so that nothing is copied.
    lower = cholesky(A.T, lower=True, overwrite_a=True, check_finite=False)
    u = cho_solve((lower, True), size * whole[:K, K], check_finite=False)
    # [X y] w = y - X L u: the residual's squares come from the products alone.
    w = np.append(-size * u, 1.0)
    square, markers = float(w @ found.plates @ w), float(w @ found.markers @ w)
    # Student's log density of the observations' residuals, without its constants.
    tails = -0.5 * (TAIL + 1) * float(np.log1p((found.observed @ w) ** 2 / TAIL).sum())
    # - log|A| / 2 is - sum log L_kk; a noise of s costs log s for each of the plates' rows.
    value = tails - 0.5 * (square * loud + markers + u @ u) - np.log(np.diag(lower)).sum() - found.count * at.noise
    # Normal priors of the logarithms of the scales.
    value -= 0.5 * (np.sum((at.groups / sd) ** 2) + np.sum((at.members / EACH) ** 2) + (at.noise / LOUD) ** 2)
    return ScaledFit(lower, u, size, at, float(value), square, found)


def nearer(one: ScaledFit, sd: Array, least: float = 0.0) -> Scales:
    """Return the scales after one step of Fisher scoring; no group is believed to be smaller than `FLOOR`, and no noise
    than ``least``.
    """
    at, found = one.scales, one.products
    starts, parts = _cells(found, at)
    known = one.curvature(starts)
    slope = np.add.reduceat(one.u**2 - 1.0, starts) + known.shares
    logs, precision = np.append(at.groups, at.members), np.append(1 / sd**2, np.full(at.members.size, 1 / EACH**2))
    # The larger information, with the prior's: what is expected, raised to what is observed of each cell.
    information = known.known + np.diag(np.maximum(known.observed - np.diag(known.known), 0.0))
    step = np.linalg.solve(parts.T @ information @ parts + np.diag(precision), slope @ parts - precision * logs)
    groups, members = np.split(logs + np.clip(step, -_FAR, _FAR), [sd.size])
    free_rows = max(found.count - known.taken, 0.0)
    louder = one.square * np.exp(-2 * at.noise) + known.taken - found.count - at.noise / LOUD**2
    noise = float(np.clip(louder / (2 * free_rows**2 / max(found.count, 1) + 1 / LOUD**2), -_FAR, _FAR))
    w = np.append(-one.coefficients, 1.0)
    # Weights of Student's errors, (nu + 1) / (nu + r^2): positive also for outliers, as A needs.
    weights = (TAIL + 1) / (TAIL + (found.observed @ w) ** 2)
    return Scales(np.maximum(groups, FLOOR), members, max(at.noise + noise, least), weights)


def _cells(found: Products, at: Scales) -> tuple[NDArray[np.intp], Array]:
    """Return where each cell (C,) begins, and (C, G + M) 1 for the logarithms that its scale sums; of a fixed one 0."""
    changed = np.diff([found.group, found.member], axis=1, prepend=-2).any(axis=0)
    starts = np.flatnonzero(changed)
    # Index -1, of neither, is none of those counted here.
    pairs = (found.group[starts], at.groups), (found.member[starts], at.members)
    parts = [index[:, None] == np.arange(some.size) for index, some in pairs]
    return starts, np.concatenate(parts, axis=1).astype(float)
