"""When a plate changed, and which visit is unlike the others.

Every date between two visits at which one plate, or all together, may have stepped, and every visit or person who may
stand out, is a column; the one whose studentised effect is largest is believed if chance reaches it less often than
agreed, over all columns of its kind at once (the distribution of the largest is simulated for just these rows and
columns: Andrews 1993, doi:10.2307/2951764, without its asymptotics). Then it joins the model, and the search goes on.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import stdtrit

from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateVisit
from biodance.diagnosis.archive.series import Fitted, Series, fit_series
from biodance.records import Array

ALARM = 0.04
"""Probability that an archive without fault raises any alarm, each quantity with its share of it; measured 5 % at most
(docs/benchmarks/plates.md), as variances are known from the same few visits."""
_MOST = 8
"""Steps and strangers looked for in one series."""
_LEAST = 2
"""Visits on each side of a step."""
_FEWEST = 3
"""Rows beyond the columns without which nothing is looked for."""
_DRAWS = 6000
_DATE = 3.84
"""Fall of twice the log likelihood within which a date is not excluded (chi-square, 95 %)."""
ALL = "all plates"


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
                level[self.series.visits.index(one.visit) :] += self.fitted.beta[first + i]
        return level

    def _own(self, plate: str) -> int:
        return self.series.plates.index(plate)

    def level(self, plate: str) -> tuple[float, float]:
        """Return the level of a plate after its last change, and its standard deviation."""
        weight, first = np.zeros(self.fitted.beta.size), len(self.series.plates)
        weight[self._own(plate)] = 1.0
        weight[[first + i for i, one in enumerate(self.changes) if one.plate in (plate, ALL)]] = 1.0
        return float(weight @ self.fitted.beta), float(np.sqrt(weight @ self.fitted.covariance @ weight))


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A column that may explain something: of ``kind`` "step", "visit" or "person"; ``at`` the index of visit or
    person.
    """

    kind: str
    plate: str
    at: int
    column: Array


def history(series: Series) -> History:
    """Return what changed and who stands out in a series, each kind with a probability below the quantity's share of
    `ALARM` of being chance.
    """
    alarm = ALARM * PLATE_QUANTITIES[series.quantity].share
    chosen: list[_Candidate] = []
    while len(chosen) < _MOST and (best := _next(series, _columns(series, chosen), alarm)) is not None:
        chosen.append(best)
    chosen.sort(key=lambda one: (one.kind != "step", one.at))
    columns = _columns(series, chosen)
    return _told(series, columns, fit_series(series, columns), chosen)


def _next(series: Series, columns: Array, alarm: float) -> _Candidate | None:
    """Return what explains most of what ``columns`` (n, K) leave, of the kinds that chance does not explain; None where
    there is nothing.
    """
    possible = [
        one
        for one in possible_columns(series)
        if np.linalg.matrix_rank(np.column_stack([columns, one.column])) > columns.shape[1]
    ]
    if series.value.size - columns.shape[1] < _FEWEST:
        return None
    sure: list[tuple[float, _Candidate]] = []
    for kind in (True, False):
        rivals = [one for one in possible if (one.kind == "step") == kind]
        if rivals:
            first = rivals[int(np.argmax(_studentised(series, columns, rivals, fit_series(series, columns))))]
            known = fit_series(
                series, np.column_stack([columns, first.column])
            )  # variances that a step does not blow up
            size = _studentised(series, columns, rivals, known)
            if _chance(series, columns, rivals, known, float(size.max())) <= alarm:
                sure.append((float(size.max()), rivals[int(np.argmax(size))]))
    return max(sure, key=lambda pair: pair[0])[1] if sure else None


def possible_columns(series: Series) -> list[_Candidate]:
    """Return all columns that are looked at: steps with at least two visits on each side, visits, persons with several
    visits; of one plate, and of all plates where there are several.
    """
    among = [(plate, series.design[:, i]) for i, plate in enumerate(series.plates)]
    if len(among) > 1:
        among.insert(0, (ALL, series.design.sum(axis=1)))
    seen, out = np.unique(series.visit), []
    for plate, share in among:
        out += [
            _Candidate("step", plate, int(v), share * (series.visit >= v))
            for v in seen[_LEAST : seen.size - _LEAST + 1]
        ]
        out += [_Candidate("visit", plate, int(v), share * (series.visit == v)) for v in seen]
        several = [p for p in np.unique(series.person) if np.unique(series.visit[series.person == p]).size > 1]
        out += [_Candidate("person", plate, int(p), share * (series.person == p)) for p in several]
    distinct: dict[bytes, _Candidate] = {}
    for one in out:
        distinct.setdefault(one.column.tobytes(), one)
    return [one for one in distinct.values() if one.column.any()]


def _columns(series: Series, chosen: list[_Candidate]) -> Array:
    return np.column_stack([series.design, *(one.column for one in chosen)])


def _white(series: Series, columns: Array, possible: list[_Candidate], known: Fitted) -> tuple[Array, Array, Array]:
    """Return in the space that ``columns`` do not explain (f = n - K dimensions): an orthonormal basis (n, f), unit
    directions of the candidates (f, m), and the data (f,), all white.
    """
    raw = np.column_stack([columns, *(one.column for one in possible), series.value])
    white = solve_triangular(known.lower, raw, lower=True)
    k = columns.shape[1]
    basis = np.linalg.qr(white[:, :k], mode="complete")[0][:, k:]
    rest = basis.T @ white[:, k:-1]
    return basis, rest / np.maximum(np.linalg.norm(rest, axis=0), 1e-12), basis.T @ white[:, -1]


def _largest(directions: Array, data: Array) -> Array:
    """Return the studentised effects (m, draws) of directions (f, m) in data (f, draws)."""
    along = directions.T @ data
    left = np.maximum((data**2).sum(axis=0) - along**2, 1e-12)
    return np.asarray(along / np.sqrt(left / (len(data) - 1)))


def _studentised(series: Series, columns: Array, possible: list[_Candidate], known: Fitted) -> Array:
    _, directions, data = _white(series, columns, possible, known)
    return np.abs(_largest(directions, data[:, None])[:, 0])


def _chance(series: Series, columns: Array, possible: list[_Candidate], known: Fitted, size: float) -> float:
    """Return how often pure chance makes any candidate as large as ``size``."""
    _, directions, data = _white(series, columns, possible, known)
    draws = np.random.default_rng(1).standard_normal((data.size, _DRAWS))
    largest = np.concatenate([np.abs(_largest(directions, part)).max(axis=0) for part in np.array_split(draws, 6, 1)])
    return float((1 + np.sum(largest >= size)) / (1 + _DRAWS))


def _told(series: Series, columns: Array, fitted: Fitted, chosen: list[_Candidate]) -> History:
    """Return the history with every chosen column as a change or a stranger."""
    changes, strangers = [], []
    first, sd = len(series.plates), np.sqrt(np.diag(fitted.covariance))
    for i, one in enumerate(chosen):
        value, error = float(fitted.beta[first + i]), float(sd[first + i])
        if one.kind == "step":
            changes.append(_change(series, columns, fitted, chosen, i))
        else:
            visit = series.visits[one.at] if one.kind == "visit" else None
            person = visit.person if visit else sorted({v.person for v in series.visits})[one.at]
            strangers.append(Stranger(person, visit.name if visit else "", one.plate, series.quantity, value, error))
    return History(series, columns, fitted, tuple(changes), tuple(strangers))


def _change(series: Series, columns: Array, fitted: Fitted, chosen: list[_Candidate], i: int) -> Change:
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
    dates = [other for other in possible_columns(series) if other.kind == "step" and other.plate == one.plate]
    _, directions, data = _white(series, others, dates, fitted)
    fall = (directions.T @ data) ** 2
    possible = [other.at for other, gain in zip(dates, fall, strict=True) if fall.max() - gain <= _DATE]
    first, last = (series.visits[v] for v in (min(possible), max(possible)))
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
