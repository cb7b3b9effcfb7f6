"""The posterior of a load: closed forms; "no load" and the interval of its mass are two views of the same numbers."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from biodance.identification.added_mass import (
    MASSES,
    LoadCandidate,
    LoadPosterior,
    LoadSearch,
    LoadView,
    inflate_prior,
    log_mass_prior,
    scaled_to_mass,
    unloaded_bodies,
)
from biodance.pipeline.words import say_load
from biodance.records import Sip

NAN = np.full(3, np.nan)


WELL_SEEN = -0.5 * ((MASSES - 2.4) / 0.2) ** 2 + 72.0
"""Log likelihood ratio of a load of 2.4 ± 0.2 kg against none."""


def find_posterior(ratio: np.ndarray, *, odds: float = 1.0) -> LoadPosterior:
    """Return the posterior of a log likelihood ratio (n,) over `MASSES`, at prior odds of a load."""
    load = odds * np.exp(ratio + log_mass_prior(MASSES))
    return LoadPosterior(float(1 / (1 + load.sum())), load / (1 + load.sum()))


def search(found: LoadPosterior, *, smallest: float = 0.1, doubts: tuple[str, ...] = ()) -> LoadSearch:
    place = NAN if found.interval[0] == 0 else np.array([0.01, -0.2, 0.0])
    one = LoadCandidate("left_shank", found, place, place, 0.0, 1 - found.none, smallest)
    return LoadSearch((one,), found.none, "the table", doubts)


def view(seed: int, load: float, *, rows: int = 30) -> tuple[LoadView, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a view of random data with a load in it, and the columns, mean, factor and data that it was made of."""
    rng = np.random.default_rng(seed)
    columns, mean, factor = rng.normal(size=(rows, 10)), rng.normal(size=10), 0.3 * rng.normal(size=(10, 4))
    y = load * columns @ (mean + factor @ rng.normal(size=4)) + rng.normal(size=rows)
    return LoadView.of(columns, y, (mean, factor), np.zeros(rows)), columns, mean, factor, y


@pytest.mark.parametrize("seed", range(4))
def test_the_likelihood_ratio_is_that_of_two_normal_densities(seed: int) -> None:
    one, columns, mean, factor, y = view(seed, 1.0)
    for m in (0.01, 0.7, 4.0):
        spread = np.eye(len(y)) + m**2 * columns @ factor @ factor.T @ columns.T
        expected = multivariate_normal(m * columns @ mean, spread).logpdf(y) - multivariate_normal(
            np.zeros(len(y)), np.eye(len(y))
        ).logpdf(y)
        assert one.log_ratio(np.array([m]))[0] == pytest.approx(expected, rel=1e-9, abs=1e-8)


def test_the_mass_of_a_load_near_the_middle_of_its_segment_is_right_in_the_mean() -> None:
    """The data tell 2.4 kg to 0.3 kg and its first moments to 1 g·m."""
    rng, factor, middle = np.random.default_rng(5), np.zeros((10, 3)), np.eye(10)[0]
    factor[1:4] = 0.15 * np.eye(3)
    columns, errors = np.diag([1 / 0.3, *np.full(3, 1e3), *np.zeros(6)]), []
    for _ in range(200):
        shown = columns @ (2.4 * (middle + 0.4 * factor @ rng.normal(size=3))) + rng.normal(size=10)
        one = LoadView.of(columns, shown, (middle, factor), np.zeros(10))
        evidence = one.log_ratio(MASSES) + log_mass_prior(MASSES)
        weights = [np.exp(log - log.max()) for log in (evidence, evidence + one.log_place_information(MASSES))]
        errors.append([weight @ MASSES / weight.sum() - 2.4 for weight in weights])
    by_evidence, size = np.mean(errors, axis=0)
    assert abs(size) < 0.05
    assert by_evidence < -0.05


def test_no_load_and_the_interval_never_contradict_each_other() -> None:
    rng, announced = np.random.default_rng(7), 0
    for _ in range(400):
        true, strength = rng.choice([0.0, 0.2, 1.0, 3.0]), 10 ** rng.uniform(-1, 2)
        shown = true * strength + np.sqrt(strength) * rng.normal() + rng.normal() * rng.choice([0.0, 3.0])
        one = find_posterior(MASSES * shown - 0.5 * MASSES**2 * strength, odds=10 ** rng.uniform(-2, 2))
        low, high = one.interval
        assert 0 <= low <= high
        assert (low > 0) == (one.none < 0.025)
        assert one.none + one.weight.sum() == pytest.approx(1.0)
        told = search(one, smallest=10 ** rng.uniform(-1, 0.5))
        if told.found:
            announced += 1
            assert one.none < 0.01
            assert low > 0
            assert one.mass >= told.best.smallest
        if told.status == "none":
            assert low == 0
    assert announced > 50


def test_a_well_seen_load_has_the_interval_of_a_normal_quantity() -> None:
    one = find_posterior(WELL_SEEN)
    assert one.mass == pytest.approx(2.4, abs=0.02)
    assert one.sd == pytest.approx(0.2, rel=0.03)
    assert one.interval == pytest.approx((2.4 - 1.96 * 0.2, 2.4 + 1.96 * 0.2), abs=0.02)


def test_without_information_the_prior_odds_stay() -> None:
    one = find_posterior(np.zeros(MASSES.size))
    assert one.none == pytest.approx(0.5)
    assert search(one).status == "none"


@pytest.mark.parametrize(("smallest", "status"), [(1.0, "found"), (3.0, "cannot tell")])
def test_a_load_is_announced_only_where_the_session_can_see_its_size(smallest: float, status: str) -> None:
    told = search(find_posterior(WELL_SEEN), smallest=smallest)
    assert told.status == status
    size = "2.40 kg on the left shank (95 % interval 2.00 to 2.79 kg; probability of no load below 0.001)"
    assert size in say_load(told)


def test_doubts_silence_every_load() -> None:
    told = search(find_posterior(WELL_SEEN), doubts=("Markers, dance_1: 31 mm.",))
    assert told.status == "cannot tell"
    assert not told.found
    assert say_load(told).endswith("cannot be told: Markers, dance_1: 31 mm.")


def table(masses: tuple[float, ...], sd: float) -> Sip:
    """Return a table of segments whose first parameters alone are uncertain, each by ``sd``."""
    phi = np.concatenate([[m, *np.full(9, 0.1 * m)] for m in masses])
    spread = np.kron(np.eye(len(masses)), np.outer(*[np.eye(10)[0]] * 2)) * sd**2
    return Sip(tuple(f"s{i}" for i in range(len(masses))), phi, spread)


def total_sd(sip: Sip) -> float:
    return float(np.sqrt(sip.covariance[::10, ::10].sum()))


def test_an_odder_body_is_less_known_in_its_parts_and_as_well_in_all() -> None:
    before = table((10.0, 20.0, 30.0), 0.5)
    odd, wrong = inflate_prior(before, 3.0), inflate_prior(before, 1.0, 2.0)
    apart = np.array([1.0, -1.0, 0.0])
    parts = odd.covariance[::10, ::10]
    assert total_sd(odd) == pytest.approx(total_sd(before)) == pytest.approx(0.5 * np.sqrt(3))
    assert np.sqrt(apart @ parts @ apart) == pytest.approx(3 * 0.5 * np.sqrt(2))
    assert total_sd(wrong) == pytest.approx(np.hypot(total_sd(before), 2.0))
    added = wrong.covariance - before.covariance
    assert added[0, 20] / added[10, 20] == pytest.approx(0.5), "a wrong scale moves all segments in proportion"
    np.testing.assert_array_equal(odd.phi, before.phi)


def test_rivals_are_probabilities_and_a_weighed_person_has_no_wrong_scale() -> None:
    tables = ((table((10.0, 20.0), 0.5), float(np.log(0.75))), (table((10.0, 20.0), 0.6), float(np.log(0.25))))
    for weighed in (True, False):
        some = unloaded_bodies(tables, weighed=weighed)
        assert sum(np.exp(one.log_prior) for one in some) == pytest.approx(1.0)
        assert (max(total_sd(one.before) for one in some) > 2.0) is not weighed
        assert any(one.holds for one in some) is not weighed


def test_a_body_whose_scale_weighed_the_load_is_lighter_by_it() -> None:
    """A load of m kg then changes the session by m (load - a kilogram of the body), and no mass in all."""
    rng = np.random.default_rng(3)
    body, unit = table((10.0, 20.0), 0.5), np.append(1.0, 0.2 * rng.normal(size=9))
    rows = np.vstack([np.tile(np.eye(10)[0], 2), rng.normal(size=(25, 20))])
    shown = 2.0 * (rows[:, :10] @ unit - rows @ body.phi / 30.0)
    less = rows @ body.phi / 30.0
    assert shown[0] == pytest.approx(0.0)
    ratio = {
        holds: LoadView.of(rows[:, :10], shown, (unit, np.zeros((10, 1))), holds * less).log_ratio(MASSES)
        for holds in (True, False)
    }
    assert MASSES[np.argmax(ratio[True])] == pytest.approx(2.0, rel=0.01)
    assert ratio[True].max() > ratio[False].max() + 1.0


def test_a_table_of_another_mass_keeps_its_shape() -> None:
    before = table((10.0, 20.0), 0.5)
    after = scaled_to_mass(before, 33.0)
    np.testing.assert_allclose(after.phi, 1.1 * before.phi)
    np.testing.assert_allclose(after.covariance, 1.21 * before.covariance)
