"""The scales of a session and its log evidence: against dense Gaussian densities, finite differences and draws."""

from dataclasses import replace

import numpy as np
import pytest
from inferred_rows import covariance, log_prior, rows, with_target
from scipy.stats import multivariate_normal
from scipy.stats import t as student

from biodance.inference.columns import VisibleColumns
from biodance.inference.hypotheses import Hypothesis
from biodance.inference.scales import (
    CONVERGED,
    EACH,
    FLESH,
    FLOOR,
    SPREAD,
    TAIL,
    TOLERANCE,
    Scales,
    bare,
    fit,
    nearer,
    nominal,
    posterior,
    prior_sd,
    products,
)

SCALES = (
    Scales(np.zeros(3), np.zeros(0), 0.0, np.zeros(0)),
    Scales(np.array([0.4, -0.2, 0.9]), np.zeros(0), 0.0, np.zeros(0)),
    Scales(np.array([0.1, 0.7, -0.3]), np.zeros(0), 0.6, np.zeros(0)),
)


def inner(drawn):
    return bare(VisibleColumns.of(drawn))


def sure(drawn):
    """Return that every row is as sure as its noise says."""
    return np.ones(drawn.noises + 1)


def starts(cell):
    """Return where columns of another cell begin."""
    return np.flatnonzero(np.diff(cell, prepend=-1))


def density(drawn, scales, *more):
    """Return the log density of the target, with the priors of the scales."""
    zero = np.zeros(len(drawn.y))
    return multivariate_normal(zero, covariance(drawn, scales, *more)).logpdf(drawn.y) + log_prior(drawn, scales)


@pytest.mark.parametrize("scales", SCALES)
def test_the_log_evidence_is_the_density_of_the_target(scales: Scales) -> None:
    """Up to the constant of so many standard normal rows."""
    drawn = rows(np.random.default_rng(1), observations=0)
    constant = -0.5 * len(drawn.y) * np.log(2 * np.pi)
    found = posterior(inner(drawn), prior_sd(drawn), scales).log_evidence
    assert found == pytest.approx(density(drawn, scales) - constant, rel=1e-10)


def test_columns_of_a_cause_widen_the_density() -> None:
    rng = np.random.default_rng(2)
    drawn, scales = rows(rng, observations=0), SCALES[2]
    Z, constant = rng.normal(size=(len(drawn.y), 2)), -0.5 * len(drawn.y) * np.log(2 * np.pi)
    found = posterior(products(VisibleColumns.of(drawn), Z, drawn.y, sure(drawn)), prior_sd(drawn), scales)
    assert found.log_evidence == pytest.approx(density(drawn, scales, Z) - constant, rel=1e-10)
    C = covariance(drawn, scales)
    known = Z.T @ np.linalg.solve(C, Z) + np.eye(2)
    mean, spread = found.last(2)
    np.testing.assert_allclose(spread, np.linalg.inv(known), rtol=1e-9)
    np.testing.assert_allclose(mean, spread @ Z.T @ np.linalg.solve(C, drawn.y), rtol=1e-9)


def test_products_are_those_of_all_columns_at_once_each_row_as_sure_as_its_band_and_channel() -> None:
    rng = np.random.default_rng(3)
    drawn = rows(rng)
    Z, y = rng.normal(size=(len(drawn.y), 3)), rng.normal(size=len(drawn.y))
    columns, unsure = VisibleColumns.of(drawn), sure(drawn)
    unsure[:12] = rng.uniform(0.3, 1.0, 12)
    found = products(columns, Z, y, unsure)
    both = unsure[drawn.block][:, None] * np.column_stack([drawn.X @ columns.turn, Z, y])
    n, r = drawn.plates, drawn.simulated
    np.testing.assert_allclose(found.plates, both[:n].T @ both[:n], atol=1e-11)
    np.testing.assert_allclose(found.markers, both[n:r].T @ both[n:r], atol=1e-11)
    np.testing.assert_allclose(found.observed, both[r:], atol=1e-12)
    np.testing.assert_array_equal(found.group, [*columns.group, -1, -1, -1])


def test_directions_that_the_rows_do_not_show_are_not_carried_and_miss_nowhere() -> None:
    """Twelve columns of which only the sums of pairs are seen: the density of the target is that of all of them."""
    drawn, scales = rows(np.random.default_rng(11), observations=0), SCALES[1]
    blind = replace(drawn, X=np.repeat(drawn.X[:, ::2], 2, axis=1))
    columns = VisibleColumns.of(blind)
    assert columns.X.shape[1] == 6
    constant = -0.5 * len(blind.y) * np.log(2 * np.pi)
    found = posterior(bare(columns), prior_sd(blind), scales)
    assert found.log_evidence == pytest.approx(density(blind, scales) - constant, rel=1e-10)
    X = blind.X * np.exp(scales.groups)[blind.group]
    every = np.exp(scales.groups)[blind.group] * (X.T @ np.linalg.solve(covariance(blind, scales), blind.y))
    np.testing.assert_allclose(columns.turn @ found.coefficients, every, atol=1e-10)


def test_observations_have_student_s_errors_and_their_weights_the_curvature() -> None:
    """Laplace's approximation over all coefficients, at the mean that weighted least squares gives."""
    drawn = rows(np.random.default_rng(4))
    at = Scales(np.array([0.2, 0.0, -0.1]), np.zeros(0), 0.3, np.array([1.0, 0.5, 0.2, 0.9, 1.1]))
    found = posterior(inner(drawn), prior_sd(drawn), at)
    X = (drawn.X @ VisibleColumns.of(drawn).turn) * np.exp(at.groups)[drawn.group]
    C = covariance(drawn, at)
    u = X.T @ np.linalg.solve(C, drawn.y)
    np.testing.assert_allclose(found.u, u, rtol=1e-9)
    left = drawn.y - X @ u
    n, r = drawn.plates, drawn.simulated
    normal = -0.5 * np.sum(left[:n] ** 2) * np.exp(-2 * at.noise) - 0.5 * np.sum(left[n:r] ** 2) - 0.5 * u @ u
    constant = student(TAIL).logpdf(0.0)
    tails = np.sum(student(TAIL).logpdf(left[r:]) - constant)
    weight = np.concatenate([np.full(n, np.exp(-2 * at.noise)), np.ones(r - n), at.weights])
    curvature = -0.5 * np.linalg.slogdet(np.eye(u.size) + X.T @ (weight[:, None] * X))[1] - n * at.noise
    assert found.log_evidence == pytest.approx(normal + tails + curvature + log_prior(drawn, at), rel=1e-10)


def test_scales_move_along_the_slope_of_the_evidence_by_fisher_s_information() -> None:
    """A step is slope over information; the slope by finite differences of the dense density."""
    drawn, at = rows(np.random.default_rng(5), observations=0), SCALES[1]
    found, sd, step = posterior(inner(drawn), prior_sd(drawn), at), prior_sd(drawn), 1e-4
    known = found.curvature(starts(found.products.group))
    moved = nearer(found, sd)
    ways = [[replace(at, groups=at.groups + way * step * np.eye(3)[g]) for way in (1, -1)] for g in range(3)]
    slope = np.array([(density(drawn, up) - density(drawn, down)) / (2 * step) for up, down in ways])
    information = known.known + np.diag(np.maximum(known.observed - np.diag(known.known), 0.0) + 1 / sd**2)
    expected = np.clip(np.linalg.solve(information, slope), -0.7, 0.7)
    np.testing.assert_allclose(moved.groups, np.maximum(at.groups + expected, FLOOR), atol=1e-5)
    there = [replace(at, noise=at.noise + way * step) for way in (1, -1)]
    slope = (density(drawn, there[0]) - density(drawn, there[1])) / (2 * step)
    assert (moved.noise > at.noise) == (slope > 0)


def test_what_is_observed_of_a_scale_is_the_second_derivative_of_the_evidence() -> None:
    drawn, at, step = rows(np.random.default_rng(12), observations=0), SCALES[1], 1e-3
    found, sd = posterior(inner(drawn), prior_sd(drawn), at), prior_sd(drawn)
    for g in range(3):
        here = [density(drawn, replace(at, groups=at.groups + way * step * np.eye(3)[g])) for way in (-1, 0, 1)]
        bent = -np.diff(here, 2)[0] / step**2
        told = found.curvature(starts(found.products.group)).observed[g]
        assert told + 1 / sd[g] ** 2 == pytest.approx(bent, rel=1e-5)


@pytest.mark.parametrize("size", [4.0, 8.0, 30.0])
def test_a_coefficient_larger_than_its_scale_does_not_throw_it_to_and_fro(size: float) -> None:
    """One coefficient a group, known well: what is expected of its scale, 2, is a third of what is observed."""
    drawn = rows(np.random.default_rng(13), observations=0, width=1)
    found = fit(inner(with_target(drawn, drawn.X @ np.full(3, size))), prior_sd(drawn), nominal(drawn))
    assert nearer(found, prior_sd(drawn)).far(found.scales) < CONVERGED


@pytest.mark.parametrize(("plates", "markers"), [(60, 12), (12, 3)])
def test_the_information_on_scales_is_that_of_many_draws(plates: int, markers: int) -> None:
    """The covariance of the slopes over bodies drawn; where rows are fewer than columns, scales share what is told."""
    rng = np.random.default_rng(6)
    drawn, at, slopes = rows(rng, plates=plates, markers=markers, observations=0, width=8), SCALES[0], []
    root, columns = np.linalg.cholesky(covariance(drawn, at)), VisibleColumns.of(drawn)
    group, none = columns.group, np.empty((len(drawn.y), 0))
    for _ in range(1500):
        target = root @ rng.normal(size=len(drawn.y))
        one = posterior(products(columns, none, target, sure(drawn)), prior_sd(drawn), at)
        slopes.append(np.bincount(group, weights=one.u**2) + one.curvature(starts(group)).shares - np.bincount(group))
    known = posterior(inner(drawn), prior_sd(drawn), at).curvature(starts(group)).known
    own = np.diag(known)
    np.testing.assert_allclose(np.mean(slopes, axis=0), 0.0, atol=0.35)
    # Standard deviation of a covariance of 1500 draws: the root of the product of both variances over that of 1500.
    np.testing.assert_allclose(np.cov(np.transpose(slopes)), known, atol=4 * np.sqrt(own.max() ** 2 / 1500))
    assert (known[0, 1] > 0.5) == (plates < 20)


def test_a_member_s_scale_moves_with_its_group_s_along_both_slopes() -> None:
    """Two members of two columns each in the last group: a step solves for groups and members at once, and beside a
    member of eight standard deviations the group and the other member stay near usual.
    """
    drawn, step = rows(np.random.default_rng(14), observations=0, each=2), 1e-4
    at, sd = Scales(np.array([0.1, 0.2, 0.4]), np.array([0.3, -0.2]), 0.0, np.zeros(0)), prior_sd(drawn)
    found = posterior(inner(drawn), sd, at)
    constant = -0.5 * len(drawn.y) * np.log(2 * np.pi)
    assert found.log_evidence == pytest.approx(density(drawn, at) - constant, rel=1e-10)
    parts = np.array([[1.0, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 1, 1, 0], [0, 0, 1, 0, 1]])

    def moved(logs):
        return density(drawn, replace(at, groups=logs[:3], members=logs[3:]))

    logs = np.concatenate([at.groups, at.members])
    slope = np.array([moved(logs + step * one) - moved(logs - step * one) for one in np.eye(5)]) / (2 * step)
    known = found.curvature(starts(np.where(drawn.group < 2, drawn.group, 2 + drawn.member)))
    information = known.known + np.diag(np.maximum(known.observed - np.diag(known.known), 0.0))
    prior = np.diag(np.concatenate([1 / sd**2, np.full(2, 1 / EACH**2)]))
    expected = logs + np.clip(np.linalg.solve(parts.T @ information @ parts + prior, slope), -0.7, 0.7)
    one = nearer(found, sd)
    np.testing.assert_allclose(one.groups, np.maximum(expected[:3], FLOOR), atol=1e-5)
    np.testing.assert_allclose(one.members, expected[3:], atol=1e-5)
    far = with_target(drawn, drawn.X @ np.where(drawn.member == 0, 8.0, 0.0))
    told, alone = (fit(inner(some), sd, nominal(some)).scales for some in (far, replace(far, member=np.full(12, -1))))
    assert told.members[0] > 0.6 > told.groups[2] + 0.2
    assert told.members[1] < 0.1
    assert alone.groups[2] > told.groups[2] + 0.2, "without a scale of its own it makes all others as large"


def test_scales_that_were_drawn_are_found() -> None:
    """Sizes and noise up to 1.6 times the nominal ones: in the mean over sessions, but for what their priors take."""
    truth, noise, found = np.array([0.25, 0.5, 0.3]), 0.47, []
    for seed in range(25):
        rng = np.random.default_rng(100 + seed)
        drawn = rows(rng, plates=600, observations=0, width=40)
        root = np.linalg.cholesky(covariance(drawn, Scales(truth, np.zeros(0), noise, np.zeros(0))))
        drawn = with_target(drawn, root @ rng.normal(size=len(drawn.y)))
        one = fit(inner(drawn), prior_sd(drawn), nominal(drawn)).scales
        found.append([*one.groups, one.noise])
    np.testing.assert_allclose(np.mean(found, axis=0), [*truth, noise], atol=0.08)


def test_soft_tissue_may_be_farther_from_usual_than_body_and_plates() -> None:
    drawn = rows(np.random.default_rng(7))
    np.testing.assert_array_equal(prior_sd(drawn), [SPREAD, FLESH, TOLERANCE])
    assert max(SPREAD, TOLERANCE) < FLESH


@pytest.mark.parametrize("loud", [0.0, 0.3])
def test_no_session_is_quieter_than_what_was_learned_or_than_asked(loud: float) -> None:
    drawn = rows(np.random.default_rng(8), plates=300)
    silent = with_target(drawn, 0.1 * drawn.y)
    one = fit(inner(silent), prior_sd(silent), nominal(silent), least=loud)
    assert one.scales.noise == loud
    assert one.scales.groups.min() >= FLOOR


def test_one_outlier_among_observations_moves_nothing_and_stays_one() -> None:
    """Five observations of one number, of which the last is 25 standard deviations off."""
    drawn = rows(np.random.default_rng(9), plates=0, markers=0, observations=5, width=1)
    X = np.zeros_like(drawn.X)
    X[:, 2] = 3.0
    value = np.array([1.1, 0.9, 1.0, 1.2, 26.0])
    alone = replace(drawn, X=X, y=value)
    one = fit(inner(alone), prior_sd(alone), nominal(alone))
    told = float((alone.X @ VisibleColumns.of(alone).turn @ one.coefficients)[0])
    assert told == pytest.approx(1.05, abs=0.2)
    assert one.scales.weights[-1] < 0.02
    assert one.scales.weights[:-1].min() > 1.0
    normal = 3.0 * (X[:, 2] @ value) / (1 + X[:, 2] @ X[:, 2])
    assert normal > 5.0, "which least squares would say"


@pytest.mark.parametrize("scale", [0.0, 0.7])
def test_of_columns_that_do_the_same_the_rows_show_the_sum_alone(scale: float) -> None:
    """Each keeps half of its variance, and a bit; of a Gaussian with these rows in full the same."""
    drawn = rows(np.random.default_rng(5), observations=0)
    alike = np.array(drawn.X)
    here = np.flatnonzero(drawn.group == 0)[:2]
    alike[:, here[1]] = alike[:, here[0]]
    drawn = replace(drawn, X=alike)
    scales = Scales(np.array([scale, 0.2, -0.1]), np.zeros(0), 0.3, np.zeros(0))
    columns = VisibleColumns.of(drawn)
    found = posterior(bare(columns), prior_sd(drawn), scales)
    one = Hypothesis((), columns, found, 0.0, np.zeros((len(drawn.y), 0)), drawn.y, sure(drawn))
    sizes = np.where(drawn.group < 0, 1.0, np.exp(scales.groups[drawn.group]))
    whole = covariance(drawn, scales)
    shown = (alike * sizes**2).T
    exact = np.diag(sizes**2) - shown @ np.linalg.solve(whole, shown.T)
    for unit in (np.array([1.0, 0.0]), np.array([2.0, 1.0]), np.array([1.0, 1.0])):
        got = one.variance(slice(int(here[0]), int(here[0]) + 2), unit)
        assert got == pytest.approx(float(unit @ exact[np.ix_(here, here)] @ unit), rel=2e-3)
