"""One quantity over an archive as a small mixed model.

A row is what one visit says of one plate (or of several together). value = level of the plate + steps + what the
visit has on all its plates (how markers sit, what the scale said) + what it has on one plate + error; where persons
came more than once, what stays with a person is apart from the visit. The variances are those of highest restricted
likelihood (Patterson and Thompson 1971, doi:10.1093/biomet/58.3.545) times a weak prior about their typical size, which
matters for archives of a few visits only.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from biodance.diagnosis.archive.covariance import Groups, Projection, RowCovariance
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateEvidence, PlateVisit
from biodance.records import Array
from biodance.uncertainty.session_noise import NORMAL_OVER_MEDIAN

_DOUBT = 1.0
"""Standard deviation of the logarithm of a typical size."""
_ONE_PLATE = 0.5
"""Share of the typical size that one plate has for itself."""
_QUIETEST = 0.02
"""Share of the typical size below which no error is believed: files may hold forces that software set to zero."""


@dataclass(frozen=True, eq=False)
class Series:
    """One ``quantity`` of ``plates`` (P) over ``visits`` (V, in order): ``value``, ``sd`` (n,) of the rows, ``design``
    (n, P) which plates each row is about, ``visit``, ``person`` (n,) indices.
    """

    quantity: str
    plates: tuple[str, ...]
    visits: tuple[PlateVisit, ...]
    value: Array
    sd: Array
    design: Array
    visit: NDArray[np.intp]
    person: NDArray[np.intp]

    @cached_property
    def groups(self) -> Groups:
        """Which rows belong together; a visit is of one person."""
        visits, first, own = np.unique(self.visit, return_index=True, return_inverse=True)
        persons, whose = np.unique(self.person[first], return_inverse=True)
        return Groups(own, whose, visits, persons)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A series fitted with columns: ``beta`` (K,) with ``covariance`` (K, K), the covariance of the ``rows``, the
    standard deviations ``between`` visits and of one plate in a visit ``alone``.
    """

    beta: Array
    covariance: Array
    rows: RowCovariance
    between: float
    alone: float


def series_of(quantity: str, observations: Sequence[PlateEvidence], visits: tuple[PlateVisit, ...]) -> Series:
    """Return the ``quantity`` over the visits: trials of one visit about the same plates become one row, their weighted
    mean; its error follows from how much trials of one visit differ in this archive.
    """
    seen = [one for one in observations if one.quantity == quantity]
    plates = tuple(sorted({plate for one in seen for plate in one.plates}))
    groups: dict[tuple[int, tuple[tuple[str, float], ...]], list[PlateEvidence]] = {}
    place = {visit: v for v, visit in enumerate(visits)}
    for one in seen:
        share = tuple(sorted((plate, round(part, 1)) for plate, part in one.plates.items()))
        groups.setdefault((place[one.visit], share), []).append(one)
    persons = {name: p for p, name in enumerate(sorted({visit.person for visit in visits}))}
    scatter = _scatter(list(groups.values()))
    rows = [
        (*_mean(some, scatter, quantity), dict(share), v, persons[visits[v].person])
        for (v, share), some in sorted(groups.items())
    ]
    design = np.array([[row[2].get(plate, 0.0) for plate in plates] for row in rows]).reshape(-1, len(plates))
    return Series(
        quantity,
        plates,
        visits,
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        design,
        np.array([row[3] for row in rows], dtype=np.intp),
        np.array([row[4] for row in rows], dtype=np.intp),
    )


def _scatter(groups: list[list[PlateEvidence]]) -> float:
    """Return by how many of its standard deviations a trial differs from its visit's others (median), at least 1."""
    found = [np.empty(0)]
    for some in groups:
        if len(some) > 1:
            value, sd = np.array([one.value for one in some]), np.array([one.sd for one in some])
            # A deviation from the mean of n has the variance (n - 1) / n.
            found.append((value - np.average(value, weights=sd**-2)) / sd * np.sqrt(len(some) / (len(some) - 1)))
    each = np.abs(np.concatenate(found))
    return max(1.0, NORMAL_OVER_MEDIAN * float(np.median(each))) if each.size else 1.0


def _mean(some: list[PlateEvidence], scatter: float, quantity: str) -> tuple[float, float]:
    """Return the mean of the trials of one visit and its standard error; trials beyond two standard deviations count
    less (Huber 1964, doi:10.1214/aoms/1177703732).
    """
    value, sd = np.array([one.value for one in some]), scatter * np.array([one.sd for one in some])
    mean, weight = float(np.median(value)), sd**-2
    for _ in range(8):
        # Huber's weight: falls with 1 / |r| beyond two standard deviations.
        weight = sd**-2 * np.minimum(1.0, 2.0 / np.maximum(np.abs(value - mean) / sd, 1e-12))
        mean = float(weight @ value / weight.sum())
    return mean, max(float(weight.sum() ** -0.5), _QUIETEST * PLATE_QUANTITIES[quantity].typical)


def fit_series(series: Series, columns: Array) -> Fitted:
    """Return the generalised least squares of a series on ``columns`` (n, K) at the best variances."""
    groups = series.groups
    several = series.design.shape[1] > 1
    again = 1 < groups.persons.size < groups.visits.size
    shares = [1.0, *[_ONE_PLATE] * several, *[1.0] * again]  # visits, one plate in a visit, persons
    start = np.log(PLATE_QUANTITIES[series.quantity].typical * np.array(shares))

    def explained(log_sd: Array) -> Projection:
        variance = [float(one) for one in np.exp(2 * log_sd)]
        alone = series.sd**2 + (variance[1] if several else 0.0)
        return Projection(RowCovariance(groups, alone, variance[0], variance[-1] if again else 0.0), columns)

    def cost(log_sd: Array) -> float:
        # Lognormal prior of every deviation about its typical size.
        return explained(log_sd).restricted(series.value) + float(np.sum(((log_sd - start) / _DOUBT) ** 2) / 2)

    best = minimize(cost, start, method="L-BFGS-B", bounds=[(low - 4, low + 8) for low in start]).x
    found = explained(best)
    beta = found.fit(series.value[:, None])[:, 0]
    between, alone = float(np.exp(best[0])), float(np.exp(best[1])) if several else 0.0
    return Fitted(beta, found.covariance, found.rows, between, alone)
