"""What trials of one kind read otherwise than those of another kind on the same day: a pad that nobody zeroed, a
shoe, a support.

Within a visit the person and the plate are the same, so that the difference between kinds of trial is neither; what all
persons share of it lies on the plate, what only one has is that person's.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtr, stdtrit

from biodance.diagnosis.archive.changes import ALARM
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateEvidence, PlateVisit
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Pooled:
    """What several estimates share.

    Parameters
    ----------
    mean, sd : float
        What all share, and its standard error.
    spread : float
        Standard deviation of what is each one's own.
    p : float
        Probability of so large a mean if there were none; 1 where it cannot be told.
    interval : tuple of float
        95 % of the mean.
    own, own_sd : numpy.ndarray
        (k,) each one's own value, drawn to the mean as far as its own error says, and its standard deviation.
    """

    mean: float
    sd: float
    spread: float
    p: float
    interval: tuple[float, float]
    own: Array
    own_sd: Array


def pool(value: Array, sd: Array) -> Pooled:
    """Return what estimates ``value`` (k,) with standard errors ``sd`` (k,) share; k >= 1."""
    value, variance = np.asarray(value, float), np.asarray(sd, float) ** 2
    spread2 = _between(value, variance)
    # Weights of a random-effects mean: own error and what differs between them.
    weight = 1 / (variance + spread2)
    mean = float(weight @ value / weight.sum())
    k = value.size
    if k > 1:  # the scatter that is there, never less than the errors that are known
        scatter = max(1.0, float(weight @ (value - mean) ** 2) / (k - 1))
        error, quantile = float(np.sqrt(scatter / weight.sum())), float(stdtrit(k - 1, 0.975))
        p = float(2 * stdtr(k - 1, -abs(mean) / error))
    else:
        error, quantile = float(np.sqrt(variance[0])), 1.96
        p = float(2 * stdtr(1e9, -abs(mean) / error))
    # Shrinkage towards the mean: share of the variance that is each one's own.
    trust = spread2 / (spread2 + variance)
    own = mean + trust * (value - mean)
    # Own error as far as it is trusted, the mean's as far as it is not.
    own_sd = np.sqrt(trust * variance + (1 - trust) ** 2 * error**2)
    half = quantile * error
    return Pooled(mean, error, float(np.sqrt(spread2)), p, (mean - half, mean + half), own, own_sd)


def _between(value: Array, variance: Array) -> float:
    """Return the variance between persons that makes the weighted scatter what it should be; 0 without any."""

    def excess(between: float) -> float:
        weight = 1 / (variance + between)
        mean = weight @ value / weight.sum()
        return float(weight @ (value - mean) ** 2) - (value.size - 1)

    if value.size < 2 or excess(0.0) <= 0:
        return 0.0
    # The excess falls with the variance between: a bracket of its zero.
    high = float(np.var(value) * value.size + variance.max())
    while excess(high) > 0:
        high *= 4
    return float(brentq(excess, 0.0, high))


_BORROWED = 4.0
"""Degrees of freedom that a visit borrows from the others' scatter."""


@dataclass(frozen=True, eq=False)
class ConditionEffect:
    """What trials with ``factor`` = ``level`` read more of ``quantity`` on ``plate`` than those with ``base``: in each
    of the ``visits``, and ``shared`` by them.
    """

    plate: str
    quantity: str
    factor: str
    level: str
    base: str
    visits: tuple[PlateVisit, ...]
    shared: Pooled

    @property
    def persons(self) -> Mapping[str, tuple[float, float]]:
        """Person -> value and standard deviation, of those whose 95 % interval keeps the sign of what all share."""
        sign = np.sign(self.shared.mean)
        return MappingProxyType(
            {
                visit.person: (float(value), float(sd))
                for visit, value, sd in zip(self.visits, self.shared.own, self.shared.own_sd, strict=True)
                if sign * value - 1.96 * sd > 0
            }
        )


def condition_effects(observations: Sequence[PlateEvidence]) -> tuple[ConditionEffect, ...]:
    """Return the effects of conditions that matter and that chance does not explain, each quantity, plate and level
    tested with its share of the alarm rate; one visit alone tells none, for its zero may have jumped in between.
    """
    # Apart by quantity and plates, where trials say in what they differ.
    kinds: dict[tuple[str, tuple[str, ...]], list[PlateEvidence]] = {}
    for one in observations:
        if one.conditions:
            kinds.setdefault((one.quantity, tuple(sorted(one.plates))), []).append(one)
    tested = [effect for some in kinds.values() for effect in _effects(some)]
    return tuple(
        one
        for one in tested
        if one.shared.p < ALARM / len(tested) and abs(one.shared.mean) >= PLATE_QUANTITIES[one.quantity].matters
    )


def without_conditions(
    observations: Sequence[PlateEvidence], effects: Sequence[ConditionEffect]
) -> tuple[PlateEvidence, ...]:
    """Return the observations of the base conditions: the others read what is not the plate's."""
    odd = {(one.quantity, one.factor, one.level) for one in effects}
    return tuple(
        one
        for one in observations
        if not any((one.quantity, factor, level) in odd for factor, level in one.conditions.items())
    )


def _effects(some: list[PlateEvidence]) -> list[ConditionEffect]:
    """Return what every level of every factor changes, pooled over the visits that have it beside the base."""
    bases = {factor: _base(some, factor) for factor in sorted({name for one in some for name in one.conditions})}
    visits: dict[PlateVisit, list[PlateEvidence]] = {}
    for one in sorted(some, key=lambda one: str(one.visit)):  # stable: trials of a visit stay in their order
        visits.setdefault(one.visit, []).append(one)
    # The variance of one trial about its visit and conditions, over all visits.
    rows = [_left(own, _dummies(own, bases)[0])[1:] for own in visits.values()]
    free, spread = sum(row[1] for row in rows), float(np.median([one.sd**2 for one in some]))
    spread = max(spread, sum(row[0] for row in rows) / free) if free else spread
    found: dict[tuple[str, str], list[tuple[PlateVisit, float, float]]] = {}
    for visit, own in visits.items():
        for key, value, sd in _differences(own, bases, spread):
            found.setdefault(key, []).append((visit, value, sd))
    return [
        ConditionEffect(
            "+".join(sorted(some[0].plates)),
            some[0].quantity,
            factor,
            level,
            bases[factor],
            tuple(row[0] for row in told),
            pool(np.array([row[1] for row in told]), np.array([row[2] for row in told])),
        )
        for (factor, level), told in sorted(found.items())
        if len({row[0].person for row in told}) > 1
    ]


def _base(some: list[PlateEvidence], factor: str) -> str:
    """Return the level that most trials have; of equally frequent ones that which reads nearest to nothing wrong."""
    count = Counter(one.conditions[factor] for one in some if factor in one.conditions)
    most = [level for level, n in count.items() if n >= 0.9 * max(count.values())]
    middle = {
        level: abs(float(np.median([one.value for one in some if one.conditions.get(factor) == level])))
        for level in most
    }
    return min(most, key=lambda level: (middle[level], level))


def _dummies(own: list[PlateEvidence], bases: Mapping[str, str]) -> tuple[Array, list[tuple[str, str]]]:
    """Return the columns (n, 1 + m) of a visit's mean and levels, and which level each of the m is."""
    levels = sorted(
        {(f, one.conditions[f]) for one in own for f in bases if f in one.conditions and one.conditions[f] != bases[f]}
    )
    columns = [np.ones(len(own))]
    kept = []
    for factor, level in levels:
        column = np.array([float(one.conditions.get(factor) == level) for one in own])
        # A level whose column the others span already cannot be told.
        if np.linalg.matrix_rank(np.column_stack([*columns, column])) > len(columns):
            columns.append(column)
            kept.append((factor, level))
    return np.column_stack(columns), kept


def _left(own: list[PlateEvidence], columns: Array) -> tuple[Array, float, int]:
    """Return least squares of a visit: coefficients, residual sum of squares, degrees of freedom."""
    value = np.array([one.value for one in own])
    beta = np.linalg.lstsq(columns, value, rcond=None)[0]
    return beta, float(np.sum((value - columns @ beta) ** 2)), len(own) - columns.shape[1]


def _differences(
    own: list[PlateEvidence], bases: Mapping[str, str], spread: float
) -> list[tuple[tuple[str, str], float, float]]:
    """Return (factor, level), value and standard error of every difference that one visit knows."""
    columns, levels = _dummies(own, bases)
    beta, square, free = _left(own, columns)
    # Scatter of the other visits as a prior of so many degrees of freedom.
    variance = (square + _BORROWED * spread) / (free + _BORROWED)
    error = np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
    return [(level, float(beta[i]), float(error[i])) for i, level in enumerate(levels, start=1)]
