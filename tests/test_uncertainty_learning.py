"""Expectation maximisation against hand-made posteriors: the parameters' spread counts, few coefficients keep the
start."""

import numpy as np
import pytest
from identify_trials import noisy_fit, person, smooth_motion

from biodance.identification.statistics import statistics
from biodance.motion.dynamics import regressor
from biodance.uncertainty.bands import BANDS, Noise
from biodance.uncertainty.learning import Moments, floor, maximise, moments_of, noise_of, sizes_of


def test_the_expectation_counts_the_spread_of_the_parameters() -> None:
    body, truth, rng = person(0)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=800), truth, rng)
    layout = Noise.unit(np.array([0.1, 0.2, 0.0]))
    root = 0.05 * rng.normal(size=(truth.size, truth.size))
    covariance, phi = root @ root.T, truth + 0.1 * rng.normal(size=truth.size)
    found = statistics(body, (fit,), layout).moments(phi, covariance)
    W, expected, count = regressor(body, fit.motion), np.zeros((len(BANDS), 6, 6)), np.zeros(len(BANDS))
    for pick in layout.bands.runs(fit.use, fit.motion.rate):
        left = layout.bands.coefficients(layout.shift @ (fit.wrench.value[pick] - W[pick] @ phi)[..., None])[..., 0]
        shown = layout.bands.coefficients(layout.shift @ W[pick])
        for k, b in enumerate(layout.bands.at(fit.motion.rate).of(pick.size)):
            if b >= 0:
                expected[b] += np.outer(left[k], left[k]) + shown[k] @ covariance @ shown[k].T
                count[b] += 1
    np.testing.assert_allclose(found.residual, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_array_equal(found.count, count)


def test_one_parameter_with_a_posterior_by_hand() -> None:
    """One column w, prior 1, noise 1: posterior mean w y / (1 + w²), variance 1 / (1 + w²); the mean square left is
    r² + w² variance.
    """
    w, y = 3.0, 5.0
    mean, variance = w * y / (1 + w**2), 1 / (1 + w**2)
    parts = np.zeros((1, 6, 2))
    parts[0, 2] = [y - w * mean, w * np.sqrt(variance)]
    found = moments_of(parts, np.array([1]), 2)
    assert found.residual[1, 2, 2] == pytest.approx(0.5**2 + 0.9)
    assert not found.residual[0].any()
    np.testing.assert_array_equal(found.count, [0, 1])


def test_noise_keeps_the_start_where_few_coefficients_are() -> None:
    start = np.diag([4.0] * 6)
    found = noise_of(
        Moments(np.stack([12 * np.eye(6), np.zeros((6, 6))]), np.array([12.0, 0.0])), start=start, worth=6.0
    )
    np.testing.assert_allclose(found[0], (12 / 18 * 1 + 6 / 18 * 4) * np.eye(6) + floor())
    np.testing.assert_allclose(found[1], start + floor())
    np.testing.assert_allclose(np.sqrt(np.diag(floor())), [0.15] * 3 + [0.05] * 3)


def test_sizes_are_mean_squares_about_what_is_agreed_on() -> None:
    rows = [("skin", "", 2.0, 5.0), ("skin", "", -1.0, 2.0)]
    assert sizes_of(rows) == ({}, {"skin": pytest.approx(np.sqrt((4 + 5 + 1 + 2) / 2))})
    rng = np.random.default_rng(0)
    same = [("late", "late delay", 3.0 + 0.1 * x, 0.0) for x in rng.normal(size=30)]
    means, sizes = sizes_of(same)
    assert means["late delay"] == pytest.approx(3.0, abs=0.1)
    assert sizes["late"] == pytest.approx(np.hypot(0.1, 1.0), abs=0.1)


def test_learning_ends_once_nothing_changes() -> None:
    calls = []

    def improved(noise: np.ndarray) -> np.ndarray:
        calls.append(noise)
        return 0.5 * (noise + np.eye(6))

    first = np.tile(4 * np.eye(6), (2, 1, 1))
    found = maximise(first, improved, lambda noise: noise, rounds=100, tolerance=1e-3)
    assert 10 < len(calls) < 20
    np.testing.assert_allclose(found, np.tile(np.eye(6), (2, 1, 1)), atol=1e-3)
    calls.clear()
    maximise(first, improved, lambda noise: noise, rounds=3)
    assert len(calls) == 3
