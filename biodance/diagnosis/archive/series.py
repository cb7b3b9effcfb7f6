"""One quantity over an archive as a small mixed model.

A row is what one visit says of one plate (or of several together). value = level of the plate + steps + what the
visit has on all its plates (how markers sit, what the scale said) + what it has on one plate + error; where persons
came more than once, what stays with a person is apart from the visit. The variances are those of highest restricted
likelihood (Patterson and Thompson 1971, doi:10.1093/biomet/58.3.545) times a weak prior about their typical size, which
matters for archives of a few visits only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateEvidence, PlateVisit
from biodance.records import Array
from biodance.uncertainty.session_noise import NORMAL_OVER_MEDIAN

_DOUBT = 1.0
"""Standard deviation of the logarithm of a typical size."""
_ONE_PLATE = 0.5
"""Share of the typical size that one plate has for itself."""
_FAR, _ROUNDS = 2.0, 8
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


@dataclass(frozen=True, eq=False)
class Fitted:
    """A series fitted with columns: ``beta`` (K,) with ``covariance`` (K, K), the Cholesky factor ``lower`` (n, n) of
    the rows' covariance, the standard deviations ``between`` visits and of one plate in a visit ``alone``.
    """

    beta: Array
    covariance: Array
    lower: Array
    between: float
    alone: float


def series_of(quantity: str, observations: Sequence[PlateEvidence], visits: tuple[PlateVisit, ...]) -> Series:
    """Return the ``quantity`` over the visits: trials of one visit about the same plates become one row, their weighted
    mean; its error follows from how much trials of one visit differ in this archive.
    """
    seen = [one for one in observations if one.quantity == quantity]
    plates = tuple(sorted({plate for one in seen for plate in one.plates}))
    groups: dict[tuple[int, tuple[tuple[str, float], ...]], list[PlateEvidence]] = {}
    for one in seen:
        share = tuple(sorted((plate, round(part, 1)) for plate, part in one.plates.items()))
        groups.setdefault((visits.index(one.visit), share), []).append(one)
    persons = sorted({visit.person for visit in visits})
    scatter = _scatter(list(groups.values()))
    rows = [
        (*_mean(some, scatter, quantity), dict(share), v, persons.index(visits[v].person))
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
    """Return by how many of its own standard deviations a trial differs from its visit's others, at least 1; a few
    trials that are plainly wrong do not count.
    """
    found = [np.empty(0)]
    for some in groups:
        if len(some) > 1:
            value, sd = np.array([one.value for one in some]), np.array([one.sd for one in some])
            found.append((value - np.average(value, weights=sd**-2)) / sd * np.sqrt(len(some) / (len(some) - 1)))
    each = np.abs(np.concatenate(found))
    return max(1.0, NORMAL_OVER_MEDIAN * float(np.median(each))) if each.size else 1.0


def _mean(some: list[PlateEvidence], scatter: float, quantity: str) -> tuple[float, float]:
    """Return the mean of the trials of one visit and its standard error; trials beyond two standard deviations count
    less (Huber 1964, doi:10.1214/aoms/1177703732).
    """
    value, sd = np.array([one.value for one in some]), scatter * np.array([one.sd for one in some])
    mean, weight = float(np.median(value)), sd**-2
    for _ in range(_ROUNDS):
        weight = sd**-2 * np.minimum(1.0, _FAR / np.maximum(np.abs(value - mean) / sd, 1e-12))
        mean = float(weight @ value / weight.sum())
    return mean, max(float(weight.sum() ** -0.5), _QUIETEST * PLATE_QUANTITIES[quantity].typical)


def fit_series(series: Series, columns: Array) -> Fitted:
    """Return the generalised least squares of a series on ``columns`` (n, K) at the best variances."""
    shared = [_alike(series.visit)]
    several = series.design.shape[1] > 1
    typical = [PLATE_QUANTITIES[series.quantity].typical]
    if several:
        shared.append(np.eye(series.value.size))
        typical.append(_ONE_PLATE * typical[0])
    if np.unique(series.person).size < np.unique(series.visit).size and np.unique(series.person).size > 1:
        shared.append(_alike(series.person))
        typical.append(typical[0])
    start = np.log(typical)

    def cost(log_sd: Array) -> float:
        lower = np.asarray(np.linalg.cholesky(_covariance(series, shared, log_sd)))
        return _restricted(lower, series.value, columns) + float(np.sum(((log_sd - start) / _DOUBT) ** 2) / 2)

    best = minimize(cost, start, method="L-BFGS-B", bounds=[(low - 4, low + 8) for low in start]).x
    lower = np.asarray(np.linalg.cholesky(_covariance(series, shared, best)))
    white = solve_triangular(lower, np.column_stack([columns, series.value]), lower=True)
    factor = cho_factor(white[:, :-1].T @ white[:, :-1] + 1e-12 * np.eye(columns.shape[1]))
    beta = cho_solve(factor, white[:, :-1].T @ white[:, -1])
    return Fitted(
        beta,
        cho_solve(factor, np.eye(beta.size)),
        lower,
        float(np.exp(best[0])),
        float(np.exp(best[1])) if several else 0.0,
    )


def _alike(index: NDArray[np.intp]) -> Array:
    """Return (n, n) ones where two rows have the same index."""
    return (index[:, None] == index[None, :]).astype(float)


def _covariance(series: Series, shared: list[Array], log_sd: Array) -> Array:
    out = np.diag(series.sd**2)
    for same, size in zip(shared, log_sd, strict=True):
        out += np.exp(2 * size) * same
    return out


def _restricted(lower: Array, value: Array, columns: Array) -> float:
    """Return minus the restricted log likelihood, up to a constant."""
    white = solve_triangular(lower, np.column_stack([columns, value]), lower=True)
    orthogonal, triangle = np.linalg.qr(white[:, :-1])
    left = white[:, -1] - orthogonal @ (orthogonal.T @ white[:, -1])
    return float(np.log(np.diag(lower)).sum() + np.log(np.abs(np.diag(triangle)) + 1e-300).sum() + left @ left / 2)
