"""When a plate changed, and which visit is unlike the others.

Every date between two visits at which one plate, or all together, may have stepped, and every visit or person who may
stand out, is a column; the one whose studentised effect is largest is believed if chance reaches it less often than
agreed, over all columns of its kind at once (the distribution of the largest is simulated for just these rows and
columns: Andrews 1993, doi:10.2307/2951764, without its asymptotics). Then it joins the model, and the search goes on.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from biodance.diagnosis.archive.candidates import ALL, Candidates, PlateCandidate, candidates_of
from biodance.diagnosis.archive.covariance import Projection
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateVisit
from biodance.diagnosis.archive.series import Fitted, Series, fit_series
from biodance.records import Array

ALARM = 0.04
"""Probability that an archive without fault raises any alarm, each quantity with its share of it; measured 5 % at most
(docs/benchmarks/plates.md), as variances are known from the same few visits."""
_MOST = 8
"""Steps and strangers looked for in one series."""
_FEWEST = 3
"""Rows beyond the columns without which nothing is looked for."""
_DRAWS, _AT_ONCE, _NUMBERS = 6000, 500, 4_000_000
"""Draws of the largest effect; at most so many at once, and so many numbers of one kind in memory."""
_DATE = 3.84
"""Fall of twice the log likelihood within which a date is not excluded (chi-square, 95 %)."""


@dataclass(frozen=True)
class Change:
    """A step of one ``quantity`` of one ``plate``: ``visit`` the first after it; ``earliest`` and ``latest`` the first
    and last visit that it may have been (95 %); level ``before`` and ``after``; ``interval`` of the step (95 %).
    """

    plate: str
    quantity: str
    visit: PlateVisit
    earliest: PlateVisit
    latest: PlateVisit
    before: float
    after: float
    interval: tuple[float, float]

    @property
    def matters(self) -> bool:
        """Whether it is large enough to be a finding."""
        return abs(self.after - self.before) >= PLATE_QUANTITIES[self.quantity].matters


@dataclass(frozen=True)
class Stranger:
    """A person, or one visit (``visit`` not "") of a person, who is unlike the others in one ``quantity`` of ``plate``
    by ``value`` with ``sd``.
    """

    person: str
    visit: str
    plate: str
    quantity: str
    value: float
    sd: float


@dataclass(frozen=True, eq=False)
class History:
    """A ``series`` explained: ``fitted`` to levels and all that was found (its last columns), ``changes``,
    ``strangers``.
    """

    series: Series
    columns: Array
    fitted: Fitted
    changes: tuple[Change, ...]
    strangers: tuple[Stranger, ...]

    def level_over_time(self, plate: str) -> Array:
        """Return (V,) the level of a plate at every visit."""
        first, level = len(self.series.plates), np.full(len(self.series.visits), self.fitted.beta[self._own(plate)])
        for i, one in enumerate(self.changes):
            if one.plate in (plate, ALL):
                # A step lifts every visit from its own on.
                level[self.series.visits.index(one.visit) :] += self.fitted.beta[first + i]
        return level

    def _own(self, plate: str) -> int:
        return self.series.plates.index(plate)

    def level(self, plate: str) -> tuple[float, float]:
        """Return the level of a plate after its last change, and its standard deviation."""
        weight, first = np.zeros(self.fitted.beta.size), len(self.series.plates)
        weight[self._own(plate)] = 1.0
        weight[[first + i for i, one in enumerate(self.changes) if one.plate in (plate, ALL)]] = 1.0
        # Variance of a sum of coefficients: w'C w.
        return float(weight @ self.fitted.beta), float(np.sqrt(weight @ self.fitted.covariance @ weight))


def history(series: Series) -> History:
    """Return what changed and who stands out in a series, each kind with a probability below the quantity's share of
    `ALARM` of being chance.
    """
    alarm = ALARM * PLATE_QUANTITIES[series.quantity].share
    possible, chosen = candidates_of(series), list[PlateCandidate]()
    while len(chosen) < _MOST:
        best = _next(series, possible, _columns(series, possible, chosen), alarm)
        if best is None:
            break
        chosen.append(best)
    chosen.sort(key=lambda one: (one.kind != "step", one.at))
    columns = _columns(series, possible, chosen)
    return _told(series, possible, columns, fit_series(series, columns), chosen)


def _next(series: Series, possible: Candidates, columns: Array, alarm: float) -> PlateCandidate | None:
    """Return what explains most of what ``columns`` (n, K) leave and chance does not; None where there is nothing."""
    if series.value.size - columns.shape[1] < _FEWEST or np.linalg.matrix_rank(columns) < columns.shape[1]:
        return None
    fitted = fit_series(series, columns)
    sure: list[tuple[float, PlateCandidate]] = []
    for kinds in (("step",), ("visit", "person")):
        rivals = Rivals(possible, Projection(fitted.rows, columns), possible.where(*kinds))
        if not rivals.index.size:
            continue
        first = possible.every[_best(rivals, series.value)[1]]
        again = fit_series(series, np.column_stack([columns, possible.column(first)]))
        rivals = Rivals(possible, Projection(again.rows, columns), rivals.index)  # variances not blown up by a step
        size, best = _best(rivals, series.value)
        if rivals.chance(size, enough=alarm) <= alarm:
            sure.append((size, possible.every[best]))
    return max(sure, key=lambda pair: pair[0])[1] if sure else None


class Rivals:
    """Candidates ``index`` (m,) of one kind beside the columns of a model (``known``): only those that these columns do
    not hold already.
    """

    def __init__(self, possible: Candidates, known: Projection, index: NDArray[np.intp]) -> None:
        free = possible.free(known)[index]
        self.possible, self.known, self.index, self.free = possible, known, index[free > 0], free[free > 0]
        self._degrees = known.columns.shape[0] - known.columns.shape[1]

    def effects(self, value: Array) -> Array:
        """Return c' P y / sqrt(c' P c) (m, draws) of ``value`` y (n, draws), each with variance 1 if V is right: the
        square is the fall of twice the log likelihood, were the candidate in the model.
        """
        return self._along(self.known.left(value)[0])

    def studentised(self, value: Array) -> Array:
        """Return (m, draws) effects over the root mean square of what each leaves of ``value`` (n, draws)."""
        weighted, square = self.known.left(value)
        along = self._along(weighted)
        left = np.maximum(square - along**2, 1e-12)
        # One degree of freedom goes to the candidate itself.
        return np.asarray(along / np.sqrt(left / (self._degrees - 1)))

    def _along(self, weighted: Array) -> Array:
        return np.asarray(self.possible.sums(weighted)[self.index] / np.sqrt(self.free)[:, None])

    def chance(self, size: float, *, enough: float = 1.0) -> float:
        """Return how often pure chance makes any candidate as large as ``size``: of 6,000 draws, which end as soon as
        it is sure that it is more often than ``enough``.
        """
        chance, larger, drawn = np.random.default_rng(1), 0, 0
        while drawn < _DRAWS and 1 + larger <= enough * (1 + _DRAWS):
            count = min(_AT_ONCE, _DRAWS - drawn, 1 + _NUMBERS // (len(self.possible.every) + self._degrees))
            largest = np.abs(self.studentised(self.known.rows.draw(chance, count))).max(axis=0)
            larger, drawn = larger + int(np.sum(largest >= size)), drawn + count
        # The archive itself counts as one of the draws: no probability is zero.
        return (1 + larger) / (1 + _DRAWS)


def _best(rivals: Rivals, value: Array) -> tuple[float, int]:
    """Return the largest studentised effect in ``value`` (n,), and which candidate it is; the first of equals."""
    size = np.abs(rivals.studentised(value[:, None])[:, 0])
    return float(size.max()), int(rivals.index[np.argmax(size >= (1 - 1e-9) * size.max())])


def _columns(series: Series, possible: Candidates, chosen: list[PlateCandidate]) -> Array:
    return np.column_stack([series.design, *(possible.column(one) for one in chosen)])


def _told(
    series: Series, possible: Candidates, columns: Array, fitted: Fitted, chosen: list[PlateCandidate]
) -> History:
    """Return the history with every chosen column as a change or a stranger."""
    changes, strangers = [], []
    first, sd = len(series.plates), np.sqrt(np.diag(fitted.covariance))
    for i, one in enumerate(chosen):
        value, error = float(fitted.beta[first + i]), float(sd[first + i])
        if one.kind == "step":
            changes.append(_change(series, possible, columns, fitted, chosen, i))
        else:
            visit = series.visits[one.at] if one.kind == "visit" else None
            person = visit.person if visit else sorted({v.person for v in series.visits})[one.at]
            strangers.append(Stranger(person, visit.name if visit else "", one.plate, series.quantity, value, error))
    return History(series, columns, fitted, tuple(changes), tuple(strangers))


def _change(
    series: Series, possible: Candidates, columns: Array, fitted: Fitted, chosen: list[PlateCandidate], i: int
) -> Change:
    """Return step ``i`` of those chosen, with the levels beside it and the dates that it may have."""
    one, k = chosen[i], len(series.plates) + i
    size, error = float(fitted.beta[k]), float(np.sqrt(fitted.covariance[k, k]))
    plate = one.plate if one.plate != ALL else series.plates[0]
    earlier = [
        j
        for j, other in enumerate(chosen)
        if other.kind == "step" and other.plate in (plate, ALL) and other.at < one.at
    ]
    before = float(fitted.beta[series.plates.index(plate)] + sum(fitted.beta[len(series.plates) + j] for j in earlier))
    others = np.delete(columns, k, axis=1)
    dates = Rivals(possible, Projection(fitted.rows, others), possible.where("step", plate=one.plate))
    fall = dates.effects(series.value[:, None])[:, 0] ** 2
    # Dates within `_DATE` of the largest fall of twice the log likelihood.
    near = [possible.every[k].at for k in dates.index[fall.max() - fall <= _DATE]]
    first, last = (series.visits[v] for v in (min(near), max(near)))
    free = max(1, np.unique(series.visit).size - columns.shape[1])  # visits that tell how much visits differ
    half = float(stdtrit(free, 0.975)) * error
    return Change(
        one.plate,
        series.quantity,
        series.visits[one.at],
        first,
        last,
        before,
        before + size,
        (size - half, size + half),
    )
