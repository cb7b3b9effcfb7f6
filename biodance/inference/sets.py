"""The posterior over sets of causes: spike and slab, up to three causes, each set fitted with all its curvature.

    log P(S | y) = log p(y | S) + sum over c in S of log odds of c (`Effect.prior` shared by its targets) + const

A cause has size 0 or N(0, (3 typical sizes)^2); of every hypothesis that holds a cause, the covariance holds what this
cause's model leaves of it (the share `unlike` of what it adds, per band). The unknown is excess noise in one band and
channel: one more member of every set.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from biodance.diagnosis.candidates import SCALE, Candidate, bases_of, log_priors
from biodance.effects import Effect, NamedCause
from biodance.inference.columns import VisibleColumns
from biodance.inference.hypotheses import UNKNOWN, Hypothesis, Posterior, Scored
from biodance.inference.rows import Rows
from biodance.inference.scales import (
    CONVERGED,
    TAIL,
    ScaledFit,
    Scales,
    as_anywhere,
    bare,
    fit,
    nearer,
    nominal,
    posterior,
    prior_sd,
    products,
)
from biodance.inference.unknown import energies, with_unknown
from biodance.records import CHANNELS, Array

MOST, _REFINED, _BRANCHES = 3, 6, 2
_ROUNDS = 12
_LEAST, _BEHIND = -3.0, 6.0
"""Log posterior gain below which no cause is fitted, and by how far a set may lie behind the best and be widened."""
_IGNORED = 0.05
"""Probability of an unknown cause below which it changes no name."""
_GROWN = 0.1
"""Logarithm of the scale from which tolerances are larger than anywhere."""


@dataclass(frozen=True, eq=False)
class Search:
    """What every hypothesis of a session shares: the ``rows``, their ``columns`` that are no fault, the ``causes`` with
    whitened columns ``Z`` (r, k) in ``cuts`` and their products with all others; ``prior`` log odds.
    """

    rows: Rows
    causes: tuple[Candidate, ...]
    prior: Mapping[tuple[str, str], float]
    columns: VisibleColumns
    Z: Array
    cuts: tuple[slice, ...]
    least: float = 0.0

    @classmethod
    def of(cls, rows: Rows, causes: Sequence[Candidate]) -> "Search":
        """Return the search for ``causes``."""
        Z, cuts = bases_of(causes) if causes else (np.zeros((rows.simulated, 0)), ())
        below = np.zeros((len(rows.y) - len(Z), Z.shape[1]))
        for one, cut in zip(causes, cuts, strict=True):
            loud = np.flatnonzero(~np.array(one.silent))
            if len(below) and loud.size:
                own = rows.observed(one.effect)[:, loud]
                # Columns are in units of SCALE typical sizes; what the simulation does not show
                # has no column (`silent`).
                below[:, cut.start : cut.start + loud.size] = own * SCALE * one.effect.typical[loud]
        Z = np.concatenate([rows.white(Z), below])
        return cls(rows, tuple(causes), log_priors(causes), VisibleColumns.of(rows), Z, cuts)

    @cached_property
    def crossed(self) -> Array:
        """(K, k) products of columns that are no fault with those of the causes in all rows of the plates."""
        n = self.rows.plates
        return np.asarray(self.columns.X[:n].T @ self.Z[:n])

    def crossed_at(self, weight: Array) -> Array:
        """Return (K, k) X' W Z where most rows of the plates have one weight, the largest."""
        n = self.rows.plates
        usual = float(weight[:n].max(initial=0.0))
        more = weight - np.where(np.arange(weight.size) < n, usual, 0.0)
        others = np.flatnonzero(more)
        # X' W Z = w X'Z in the plates + X' (W - w) Z: only rows of another weight are looked at again.
        return np.asarray(usual * self.crossed + self.columns.X[others].T @ (more[others, None] * self.Z[others]))

    @cached_property
    def sized(self) -> tuple[tuple[tuple[int, float], ...], Array]:
        """Causes and sizes, in typical ones, at which they are screened; the rows (r, m) that each adds there."""
        tried = tuple((k, share) for k, one in enumerate(self.causes) for share in one.effect.screened_at)
        pairs = ((self.causes[k].effect, share) for k, share in tried)
        rows = [self.rows.added(effect, share * effect.typical) for effect, share in pairs]
        return tried, np.stack(rows, axis=1) if rows else np.empty((len(self.rows.y), 0))

    def score(self, base: "Hypothesis", Z: Array) -> tuple[Array, Array]:
        """Return score (k,) and information (k, k) of further whitened columns ``Z`` (r, k) beside a hypothesis."""
        weight = self.weight(base)
        weighted = weight[:, None] * Z
        cross = np.concatenate([self.columns.X.T @ weighted, base.Z.T @ weighted])
        # Z'W X L over the Cholesky factor of A: Z'W Z - half' half is the Schur complement of A.
        half = solve_triangular(base.fit.lower, base.fit.size[:, None] * cross, lower=True, check_finite=False)
        # `left` holds `surety` once, `weight` holds its square: W (y - X u) needs the bare residual.
        return weighted.T @ (base.left / base.surety), Z.T @ weighted - half.T @ half

    def weight(self, base: "Hypothesis") -> Array:
        """Return (r,) the inverse variance of every row under a hypothesis."""
        found, n, r = base.fit, self.rows.plates, self.rows.simulated
        # Rows of the plates have variance s^2, those of markers 1; observations have Student's weights.
        loud = np.full(n, np.exp(-2 * found.scales.noise))
        return base.surety**2 * np.concatenate([loud, np.ones(r - n), found.scales.weights])

    @cached_property
    def start(self) -> ScaledFit:
        """The posterior without any cause."""
        return fit(bare(self.columns), prior_sd(self.rows), nominal(self.rows), least=self.least)


Further = Callable[[Search, Hypothesis], tuple[Hypothesis, ...]]
"""What else may be added to a hypothesis where the steady causes leave an unknown one."""


def infer(search: Search, further: Further = lambda _search, _base: ()) -> Posterior:
    """Return the posterior over sets of causes. Where an unknown cause is more probable than none, ``further`` causes
    are added to the best set and to none. Where one is left, the simulation is as far off everywhere as it is there:
    causes are sought at that noise, too, and are as probable as in both.
    """
    found = _searched(search)
    if found.unknown >= UNKNOWN:
        bare = next(one for one in found.hypotheses if not one.causes)
        bases = dict.fromkeys((bare, found.best))
        more = tuple(with_unknown(new) for base in bases for new in further(search, base))
        found = replace(found, hypotheses=(*found.hypotheses, *more))
    if found.unknown < _IGNORED:
        return found
    louder = replace(search, least=_as_loud_everywhere(search, found.best))
    return replace(found, louder=_searched(louder))


def _as_loud_everywhere(search: Search, one: Hypothesis) -> float:
    """Return the logarithm of the noise under which no band and channel leaves more beside a hypothesis."""
    loud = one.fit.scales.noise
    for _ in range(_ROUNDS):
        square, count = energies(one)
        # The loudest block of mean square m needs the logarithm of the noise raised by log(m) / 2.
        more = 0.5 * float(np.log(square[count > 0].max()))
        if more < CONVERGED:
            break
        loud = max(loud, one.fit.scales.noise) + more
        one = hypothesis(replace(search, least=loud), one.causes, one.fit.scales)
    return loud


def _searched(search: Search) -> Posterior:
    """Return the posterior by a search that widens the most probable sets."""
    bare = hypothesis(search, ())
    known: dict[frozenset[tuple[str, str]], Hypothesis] = {bare.names: bare}
    first, front = screen(search, bare), [bare]
    for depth in range(MOST):
        new = []
        for one in front:
            for scored in (first if depth == 0 else screen(search, one))[:_REFINED]:
                names = one.names | {(scored.effect.name, scored.effect.target)}
                if scored.gain >= _LEAST and names not in known:
                    known[names] = hypothesis(
                        search, (*one.causes, NamedCause(scored.effect, scored.start, np.empty((0, 0)))), one.fit.scales
                    )
                    new.append(known[names])
        best = max(one.log_posterior for one in known.values())
        new.sort(key=lambda one: -one.log_posterior)
        front = [one for one in new[:_BRANCHES] if one.log_posterior > best - _BEHIND]
    _without_each(search, known)
    return Posterior(tuple(with_unknown(one) for one in known.values()), tuple(first))


def _without_each(search: Search, known: dict[frozenset[tuple[str, str]], Hypothesis]) -> None:
    """Add sets that lack one cause of the best of ``known``: what was found first may stand for what came later."""
    while True:
        best = max(known.values(), key=lambda one: one.log_posterior)
        for gone in best.causes if len(best.causes) > 1 else ():
            rest = tuple(one for one in best.causes if one is not gone)
            names = frozenset(one.names for one in rest)
            if names not in known:
                known[names] = hypothesis(search, rest, best.fit.scales)
        if max(known.values(), key=lambda one: one.log_posterior) is best:
            return


def hypothesis(search: Search, causes: tuple[NamedCause, ...], start: Scales | None = None) -> Hypothesis:
    """Return a set of causes at its most probable sizes and scales, by Gauss-Newton steps of the sizes and Fisher
    scoring of the scales in turn; each cause may be unlike its model by up to its share (`unlike_models`).
    """
    rows, columns = search.rows, search.columns
    sure = np.ones(rows.noises + 1)
    if not causes:
        Z = np.empty((len(rows.y), 0))
        return Hypothesis((), columns, search.start, search.start.log_evidence, Z, rows.y, sure)
    u0 = np.concatenate([one.theta / (SCALE * one.effect.typical) for one in causes])
    at, effects = start or search.start.scales, tuple(one.effect for one in causes)
    without = _own_tolerances(search, effects)
    for _ in range(_ROUNDS):
        taken = [rows.added(one.effect, one.theta) for one in causes]
        slopes = [rows.slopes(one.effect, one.theta) * (SCALE * one.effect.typical) for one in causes]
        Z = np.concatenate(slopes, axis=1)
        # y - taken(u) is about y - taken(u0) - Z (u - u0): a linear problem in u with this target.
        y = rows.y - np.sum(taken, axis=0) + Z @ u0
        found = posterior(products(columns, Z, y, sure, without), prior_sd(rows), at)
        u, C = found.last(u0.size)
        causes, moved, u0 = _moved(causes, u, C), np.abs(u - u0).max(initial=0.0), u
        one = Hypothesis(causes, columns, found, -np.inf, Z, y, sure)
        sure, at = unlike_models(one, effects, taken), nearer(found, prior_sd(rows), search.least)
        if max(moved, at.far(found.scales), float(np.abs(sure - one.sure).max())) < CONVERGED:
            break
    # log_evidence is of scaled rows; `log_sure` is the Jacobian of that scaling.
    value = found.log_evidence + one.log_sure + sum(search.prior[c.names] for c in causes)
    possible = all(rows.possible(c.effect, c.theta) for c in causes)
    # A cause that cannot be in this session keeps a log posterior of minus infinity.
    return replace(one, log_posterior=value) if possible else one


def _own_tolerances(search: Search, effects: Sequence[Effect]) -> NDArray[np.intp]:
    """Return the columns that are tolerances of ``effects`` of which twice the size is not twice the change: the
    tolerance is written for sizes near none, and a cause of the opposite size beside it would be a filter of the
    forces. The slab of the cause, three times as wide at least, stands for both. A tolerance that was turned together
    with others stays: a plate turns by a degree, which is nearly in proportion.
    """
    curved = [one for one in effects if not one.linear]
    found = (search.rows.tolerated.get((one.name, one.target), (slice(0),))[0] for one in curved)
    return np.concatenate([np.empty(0, dtype=np.intp), *(search.columns.only(where) for where in found)])


def _moved(causes: tuple[NamedCause, ...], u: Array, C: Array) -> tuple[NamedCause, ...]:
    """Return the causes with new coefficients ``u`` and their covariance, in standard deviations of the slab."""
    out, start = [], 0
    for one in causes:
        cut, scale = slice(start, start + one.effect.typical.size), SCALE * one.effect.typical
        out.append(NamedCause(one.effect, scale * u[cut], C[cut, cut] * np.outer(scale, scale)))
        start = cut.stop
    return tuple(out)


def unlike_models(one: Hypothesis, effects: Sequence[Effect], taken: Sequence[Array]) -> Array:
    """Return (Q + 1,) by which rows are scaled because no cause is quite like its model: in each band and channel it
    leaves up to the share `unlike` of what it adds there (``taken`` (r,) of each), as much as the hypothesis leaves
    beyond the session's noise.
    """
    rows = one.rows
    loud = np.exp(-2 * one.fit.scales.noise)
    most = np.zeros(rows.noises + 1)
    for effect, added in zip(effects, taken, strict=True):
        # In units of the session's noise, like `left` below.
        most += effect.unlike**2 * loud * rows.mean_square(added)
    most[: len(CHANNELS)] = 0.0  # a mean is a size, and says nothing of a shape
    left = loud * rows.mean_square(one.left / one.surety)
    # Variance 1 + what is left beyond the noise, at most the share `unlike` of what the causes add; its root scales.
    return np.asarray(1 / np.sqrt(1 + np.clip(left - 1.0, 0.0, most)))


def at_scales(search: Search, base: Hypothesis, scales: Scales) -> Hypothesis:
    """Return a hypothesis under other scales."""
    found = posterior(base.fit.products, prior_sd(search.rows), scales)
    # The same sizes and prior: only the evidence of the coefficients changes.
    value = base.log_posterior - base.fit.log_evidence + found.log_evidence
    return replace(base, fit=found, log_posterior=value)


def screen(search: Search, one: Hypothesis) -> list[Scored]:
    """Return every further cause by the score test beside a hypothesis, most probable first: at its scales or, where
    its tolerances grew, with these as large as anywhere, so that no fault hides in its own tolerance.
    """
    found = {(s.effect.name, s.effect.target): s for s in _scored(search, one)}
    usual_scales = as_anywhere(one.fit.scales, search.rows)
    if usual_scales.far(one.fit.scales) > _GROWN:
        usual = at_scales(search, one, usual_scales)
        # Both gains count from `one`: the loss of evidence by the usual scales is charged.
        lost = usual.fit.log_evidence - one.fit.log_evidence
        for again in _scored(search, usual):
            key = again.effect.name, again.effect.target
            if again.gain + lost > found[key].gain:
                found[key] = replace(again, gain=again.gain + lost)
    return sorted(found.values(), key=lambda suspect: -suspect.gain)


def _scored(search: Search, one: Hypothesis) -> list[Scored]:
    """Return every further cause by the score test at the scales of a hypothesis."""
    r, found, weight = search.rows.simulated, one.fit, search.weight(one)
    left = one.left / one.surety
    cross = search.crossed_at(weight)
    if one.Z.shape[1]:
        cross = np.concatenate([cross, (one.Z * weight[:, None]).T @ search.Z])
    # L^-1 (L_size X' W Z) of all causes at once; the Schur complement of each is cut out of it below.
    half = solve_triangular(found.lower, found.size[:, None] * cross, lower=True, check_finite=False)
    values, means = _gained(search, half, weight, search.Z.T @ (weight * left))
    heard, sizes = _told_by_outliers(left[r:], search.Z[r:, [cut.start for cut in search.cuts]])
    at_sizes, scored = _at_sizes(search, one), []
    for k, (cause, told, size) in enumerate(zip(search.causes, heard, sizes, strict=True)):
        if cause.names in one.names:
            continue
        value, mean = values[k], means[k]
        if told > value:
            value, mean = float(told), np.append(size, np.zeros(len(mean) - 1))
        tried = [(value, cause.start(mean)), *at_sizes.get(k, ())]
        value, begin = max(tried, key=lambda pair: pair[0])
        scored.append(Scored(cause.effect, value + search.prior[cause.names], begin))
    return scored


def _gained(search: Search, half: Array, weight: Array, score: Array) -> tuple[dict[int, float], dict[int, Array]]:
    """Return by cause what it gains beside a hypothesis and the mean of its coefficients: of rows of one ``weight``
    (r,), the ``score`` (k,) of all columns, and ``half`` (K, k) of what the hypothesis holds of them.
    """
    width = np.array([cut.stop - cut.start for cut in search.cuts])
    values: dict[int, float] = {}
    means: dict[int, Array] = {}
    for count in np.unique(width):  # causes with as many columns together
        some = np.flatnonzero(width == count).tolist()
        at = np.array([search.cuts[k].start for k in some])[:, None] + np.arange(count)
        Z, held, s = search.Z[:, at], half[:, at], score[at]
        G = np.einsum("rci,rcj->cij", weight[:, None, None] * Z, Z) - np.einsum("rci,rcj->cij", held, held)
        inner = np.linalg.inv(np.eye(count) + G)
        mean = np.einsum("cij,cj->ci", inner, s)
        # `inner` is (1 + G)^-1: + 1/2 log|inner| is - 1/2 log|1 + G|.
        value = 0.5 * np.sum(s * mean, axis=1) + 0.5 * np.linalg.slogdet(inner)[1]
        values |= zip(some, value.tolist(), strict=True)
        means |= zip(some, mean, strict=True)
    return values, means


def _at_sizes(search: Search, one: Hypothesis) -> dict[int, list[tuple[float, Array]]]:
    """Return by cause what it gains (Laplace) near each size at which it is screened, prior included, and the size."""
    tried, rows = search.sized
    score, information = search.score(one, rows)
    out: dict[int, list[tuple[float, Array]]] = {}
    # One column each, the whole of what the cause adds at that size: coefficient 1.
    for (cause, share), s, G in zip(tried, score, np.diag(information), strict=True):
        u = share / SCALE
        # log p(y | u) / p(y | 0) = s - G / 2; -u^2 / 2 of the slab; G / u^2: information per
        # slab's standard deviation.
        value = s - 0.5 * G - 0.5 * u**2 - 0.5 * np.log1p(G / u**2)
        out.setdefault(cause, []).append((float(value), share * search.causes[cause].effect.typical))
    return out


def _told_by_outliers(left: Array, z: Array) -> tuple[Array, Array]:
    """Return what each column of ``z`` (n, k) gains where it explains outliers of ``left`` (n,), and its size."""
    size, weight = np.zeros(z.shape[1]), np.ones(z.shape)
    for _ in range(_ROUNDS):
        # One size per column (ridge with unit-normal prior), then Student's weights at its residuals.
        size = left @ (weight * z) / (1 + (weight * z**2).sum(axis=0))
        weight = (TAIL + 1) / (TAIL + (left[:, None] - z * size) ** 2)
    gained = np.log1p(left**2 / TAIL)[:, None] - np.log1p((left[:, None] - z * size) ** 2 / TAIL)
    told = 0.5 * (TAIL + 1) * gained.sum(axis=0) - 0.5 * size**2
    # Laplace: half the logarithm of 1 + information.
    return told - 0.5 * np.log1p((weight * z**2).sum(axis=0)), size
