"""Sufficient statistics and learned noise: equal to the direct route, additive, and true about coloured noise."""

import numpy as np
import pytest
from direct_information import information
from random_bodies import random_body
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.posterior import find_posterior
from biodance.identification.statistics import PAIRS, Fit, Statistics, learn_noise, statistics
from biodance.motion.dynamics import predict_wrench
from biodance.records import Motion, Sip, Wrench
from biodance.uncertainty.bands import Bands, Noise

ABOUT = np.array([0.1, 0.2, 0.0])
LAYOUT = Noise.unit(ABOUT)


def smooth_fit(seed: int, *, frames: int = 3000, noise=None):
    """Return body, truth and a smooth trial at 100 Hz whose wrench carries ``noise`` (frames, 6)."""
    rng = np.random.default_rng(seed)
    body = random_body(rng, n_segments=4)
    time = np.arange(frames) / 100
    knots = np.arange(0, time[-1] + 1.5, 0.5)
    curve = CubicSpline(knots, rng.normal(0, 0.5, (knots.size, len(body.joints))))
    q = np.tile(body.neutral, (frames, 1))
    v, a = np.zeros((frames, body.nv)), np.zeros((frames, body.nv))
    q[:, 7:], v[:, 6:], a[:, 6:] = curve(time), curve(time, 1), curve(time, 2)
    motion = Motion(time, q, v, a)
    clean = predict_wrench(body, motion).value
    error = np.zeros((frames, 6)) if noise is None else noise(rng, frames)
    error[:, 3:] += np.cross(ABOUT, error[:, :3])
    return body, Fit("t", motion, Wrench(time, clean + error), np.ones(frames, dtype=bool))


def coloured(rng: np.random.Generator, frames: int) -> np.ndarray:
    slow = lfilter([1.0], [1.0, -0.99], rng.normal(size=(frames + 2000, 6)), axis=0)[2000:]
    return (0.3 * slow + rng.normal(size=(frames, 6))) * [2, 2, 2, 0.5, 0.5, 0.5]


def test_information_equals_the_direct_triangle() -> None:
    body, fit = smooth_fit(0, noise=coloured)
    rng = np.random.default_rng(1)
    root = rng.normal(size=(len(LAYOUT.bands), 6, 6))
    noise = Noise(root @ np.swapaxes(root, 1, 2) + np.eye(6), ABOUT, LAYOUT.bands)
    direct = information(body, fit.motion, fit.wrench, noise)
    through = statistics(body, (fit,), LAYOUT).information(noise)
    scale = np.maximum(np.linalg.norm(direct.R, axis=0), 1e-9)
    a, b = through.R / scale, direct.R / scale
    np.testing.assert_allclose(a.T @ a, b.T @ b, atol=1e-10)


def test_trials_add_up() -> None:
    body, fit = smooth_fit(2, noise=coloured)
    first = np.arange(3000) < 1500
    parts = [statistics(body, (Fit("t", fit.motion, fit.wrench, use),), LAYOUT) for use in (first, ~first)]
    assert (parts[0] + parts[1]).count.sum() == parts[0].count.sum() + parts[1].count.sum()
    with pytest.raises(BiodanceError, match="layout"):
        parts[0] + statistics(body, (fit,), Noise.unit(np.zeros(3)))


def test_learned_noise_gives_intervals_that_cover() -> None:
    z = []
    for seed in range(12):
        body, fit = smooth_fit(seed, noise=coloured)
        truth = body.sip.phi
        rng = np.random.default_rng(100 + seed)
        sd = 0.15 * np.abs(truth) + 1e-2
        prior = Sip(body.segments, truth + sd * rng.normal(size=sd.size), np.diag(sd**2))
        total = statistics(body, (fit,), LAYOUT)
        posterior = find_posterior(total.information(learn_noise(total, prior)), prior)
        z.append((posterior.mean - truth) / np.sqrt(np.diag(posterior.covariance)))
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.025)


def test_slow_noise_is_found_to_be_slow() -> None:
    body, fit = smooth_fit(5, frames=12000, noise=coloured)
    noise = learn_noise(statistics(body, (fit,), LAYOUT), body.sip)
    sd = np.sqrt(np.diagonal(noise.covariance, axis1=1, axis2=2))[:, 0]
    assert sd[0] > 5 * sd[-1]
    assert sd[-1] == pytest.approx(2.0, rel=0.25)


def test_nothing_to_use_is_refused() -> None:
    body, fit = smooth_fit(0, frames=200)
    with pytest.raises(TrialRefused, match="no frame"):
        statistics(body, (Fit("t", fit.motion, fit.wrench, np.zeros(200, dtype=bool)),), LAYOUT)


def test_what_the_parameters_leave_open_counts_as_noise() -> None:
    """One force of 5 N of which a kilogram explains 2 N: at 2 +- 0.5 kg there are 1 N left and 1 N unknown, 2 N²."""
    gram = np.zeros((1, 21, 2, 2))
    gram[0, [pair == (2, 2) for pair in zip(*PAIRS, strict=True)]] = np.outer([2.0, 5.0], [2.0, 5.0])
    one = Statistics(gram, np.array([1]), Noise.unit(ABOUT, Bands((0.0, np.inf), np.inf)))
    sure, unsure = (one.moments(np.array([2.0]), np.array([[sd**2]])) for sd in (0.0, 0.5))
    np.testing.assert_allclose(np.diag(sure.residual[0]), [0, 0, 1.0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.diag(unsure.residual[0]), [0, 0, 2.0, 0, 0, 0], atol=1e-12)
    assert unsure.count.tolist() == [1.0]
