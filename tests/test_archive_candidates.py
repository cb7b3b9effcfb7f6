"""Steps and strangers of an archive, judged visit by visit, against the same written out with dense matrices."""

import tracemalloc

import numpy as np
import pytest
from scipy.linalg import null_space, sqrtm
from scipy.optimize import minimize

from biodance.diagnosis.archive.candidates import candidates_of
from biodance.diagnosis.archive.changes import Rivals
from biodance.diagnosis.archive.covariance import Projection, RowCovariance
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateVisit
from biodance.diagnosis.archive.series import Series, fit_series

PEOPLE = {
    "each person once": [0, 1, 2, 3, 4, 5, 6, 7],
    "one after the other": [0, 0, 0, 1, 1, 2, 2, 2],
    "interleaved": [2, 0, 1, 0, 2, 1, 1, 3, 0],
    "one person": [0, 0, 0, 0, 0, 0],
}


def archive(people: list[int], plates: int, seed: int = 0) -> Series:
    """Return one row a plate and visit, some missing, and where there are two plates some rows of both together."""
    chance = np.random.default_rng(seed)
    visits = tuple(PlateVisit(f"V{v:02d}", f"P{p}") for v, p in enumerate(people))
    shares = [np.eye(plates)[p] for p in range(plates)] + [np.full(plates, 1 / plates)] * (plates > 1)
    rows = [(v, share) for v in range(len(people)) for share in shares if chance.random() < 0.9]
    visit = np.array([row[0] for row in rows])
    person, n = np.array(people)[visit], len(rows)
    value = 0.6 * chance.normal(size=len(people))[visit] + 0.5 * chance.normal(size=99)[person] + chance.normal(size=n)
    names = tuple(f"plate{p}" for p in range(plates))
    return Series(
        "offset_x", names, visits, value, chance.uniform(0.2, 1, n), np.array([r[1] for r in rows]), visit, person
    )


def dense(series: Series, visits: float, alone: float, persons: float) -> np.ndarray:
    """Return the covariance of the rows, every entry from what two rows share."""
    n = series.value.size
    return np.array(
        [
            [
                (i == j) * (series.sd[i] ** 2 + alone)
                + (series.visit[i] == series.visit[j]) * visits
                + (series.person[i] == series.person[j]) * persons
                for j in range(n)
            ]
            for i in range(n)
        ]
    )


def written_out(series: Series) -> dict[tuple[str, str, int], np.ndarray]:
    """Return the columns by kind, plate and number, each once, by their definition."""
    among = {name: series.design[:, i] for i, name in enumerate(series.plates)}
    if len(among) > 1:
        among = {"all plates": series.design.sum(axis=1), **among}
    seen, out = sorted(set(series.visit)), {}
    for plate, share in among.items():
        for v in seen:
            if sum(u < v for u in seen) >= 2 and sum(u >= v for u in seen) >= 2:
                out["step", plate, v] = share * (series.visit >= v)
        out |= {("visit", plate, v): share * (series.visit == v) for v in seen}
        for p in sorted(set(series.person)):
            if len(set(series.visit[series.person == p])) > 1:
                out["person", plate, p] = share * (series.person == p)
    kept: dict[tuple[str, str, int], np.ndarray] = {}
    for key, column in out.items():
        if column.any() and not any(np.array_equal(column, other) for other in kept.values()):
            kept[key] = column
    return kept


@pytest.mark.parametrize("plates", [1, 2, 3])
@pytest.mark.parametrize("people", PEOPLE.values(), ids=PEOPLE)
def test_columns_and_what_they_explain_are_those_of_dense_matrices(people: list[int], plates: int) -> None:
    series = archive(people, plates)
    sizes = (0.8, 0.3 * (plates > 1), 0.5 * (len(set(people)) > 1))
    rows = RowCovariance(series.groups, series.sd**2 + sizes[1], sizes[0], sizes[2])
    v, columns = dense(series, *sizes), written_out(series)
    possible = candidates_of(series)
    kept = [possible.every[k] for k in possible.kept]
    assert [(one.kind, one.plate, one.at) for one in kept] == list(columns)
    for one, column in zip(kept, columns.values(), strict=True):
        np.testing.assert_array_equal(possible.column(one), column)
    y = np.column_stack([series.value, np.arange(series.value.size)])
    np.testing.assert_allclose(rows.solve(y), np.linalg.solve(v, y), rtol=1e-9, atol=1e-12)
    assert rows.log_determinant == pytest.approx(np.linalg.slogdet(v)[1], rel=1e-10)
    for model in (series.design, np.column_stack([series.design, columns["visit", kept[-1].plate, 3]])):
        basis = null_space((np.linalg.inv(sqrtm(v).real) @ model).T)  # white, in what the model does not explain
        white = basis.T @ np.linalg.inv(sqrtm(v).real)
        data, found = white @ series.value, []
        for key, column in columns.items():
            if np.linalg.matrix_rank(np.column_stack([model, column])) > model.shape[1]:
                along = white @ column / np.linalg.norm(white @ column)
                left = data - along * (along @ data)
                found.append((key, along @ data, np.sqrt(left @ left / (data.size - 1))))
        rivals = Rivals(possible, Projection(rows, model), possible.kept)
        names = [possible.every[k] for k in rivals.index]
        assert [(one.kind, one.plate, one.at) for one in names] == [row[0] for row in found]
        effect, scale = np.array([row[1] for row in found]), np.array([row[2] for row in found])
        np.testing.assert_allclose(rivals.effects(series.value[:, None])[:, 0], effect, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(
            rivals.studentised(series.value[:, None])[:, 0], effect / scale, rtol=1e-8, atol=1e-9
        )


@pytest.mark.parametrize("plates", [1, 2])
@pytest.mark.parametrize("people", PEOPLE.values(), ids=PEOPLE)
def test_the_fit_is_where_the_dense_restricted_likelihood_is_highest(people: list[int], plates: int) -> None:
    series = archive(people, plates, 3)
    typical = PLATE_QUANTITIES[series.quantity].typical
    start = np.log([typical, *[typical / 2] * (plates > 1), *[typical] * (1 < len(set(people)) < len(people))])

    def sizes(logs: np.ndarray) -> tuple[float, float, float]:
        own = list(np.exp(2 * logs))
        return own.pop(0), own.pop(0) if plates > 1 else 0.0, own.pop(0) if own else 0.0

    def cost(logs: np.ndarray) -> float:
        v, x = dense(series, *sizes(logs)), series.design
        contrasts = null_space(x.T)  # restricted likelihood is that of contrasts, whichever (Patterson and Thompson)
        spread, z = contrasts.T @ v @ contrasts, contrasts.T @ series.value
        return float(np.linalg.slogdet(spread)[1] + z @ np.linalg.solve(spread, z) + np.sum((logs - start) ** 2)) / 2

    best = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9, "maxiter": 2000}).x
    fitted = fit_series(series, series.design)
    visits, alone, _ = sizes(best)
    assert (fitted.between, fitted.alone) == pytest.approx((visits**0.5, alone**0.5), rel=2e-3)
    inverse = np.linalg.inv(dense(series, *sizes(best)))
    known = series.design.T @ inverse @ series.design
    np.testing.assert_allclose(fitted.covariance, np.linalg.inv(known), rtol=5e-3, atol=1e-6)
    beta = np.linalg.solve(known, series.design.T @ inverse @ series.value)
    np.testing.assert_allclose(fitted.beta, beta, rtol=5e-3, atol=1e-4)


def test_the_largest_by_chance_is_that_of_dense_draws() -> None:
    series = archive(PEOPLE["interleaved"], 2, 1)
    rows = RowCovariance(series.groups, series.sd**2 + 0.3, 0.8, 0.5)
    possible = candidates_of(series)
    rivals = Rivals(possible, Projection(rows, series.design), possible.where("step"))
    root = np.linalg.inv(sqrtm(dense(series, 0.8, 0.3, 0.5)).real)
    white = null_space((root @ series.design).T).T @ root
    along = np.array([white @ possible.column(possible.every[k]) for k in rivals.index])
    along /= np.linalg.norm(along, axis=1)[:, None]
    drawn = np.random.default_rng(8).normal(size=(len(white), 20_000))
    effect = along @ drawn
    left = (drawn**2).sum(axis=0) - effect**2
    largest = np.abs(effect / np.sqrt(left / (len(white) - 1))).max(axis=0)
    for share in (0.5, 0.1, 0.01):
        assert rivals.chance(float(np.quantile(largest, 1 - share))) == pytest.approx(
            share, abs=4 * (share / 4500) ** 0.5
        )
    assert rivals.chance(float(np.median(largest)), enough=0.01) > 0.01


def test_plates_that_always_stand_together_are_not_told_apart() -> None:
    series = archive(PEOPLE["each person once"], 2, 2)
    both = np.full((series.value.size, 2), 0.5)
    series = Series("gain", series.plates, series.visits, series.value, series.sd, both, series.visit, series.person)
    fitted = fit_series(series, both)
    assert np.sqrt(fitted.covariance[0, 0]) > 1e3
    assert np.isfinite(fitted.beta).all()


def test_twice_the_visits_take_no_more_than_three_times_the_memory() -> None:
    peaks = []
    for count in (300, 600):
        series = archive([v * 7 % 90 for v in range(count)], 2, 5)
        tracemalloc.start()
        possible = candidates_of(series)
        rows = RowCovariance(series.groups, series.sd**2, 1.0, 1.0)
        Rivals(possible, Projection(rows, series.design), possible.kept).studentised(series.value[:, None])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 3 * peaks[0]
