"""Band-wise whitening: orthonormal, lossless for white noise, and it makes coloured noise white."""

import numpy as np
import pytest
from direct_information import whiten
from scipy.signal import lfilter

from biodance.errors import BiodanceError
from biodance.uncertainty.bands import BLOCK_SAMPLES, WHITE, Bands, Noise

ABOUT = np.array([0.2, -0.1, 0.0])


def test_one_white_band_at_a_rate_gives_the_sums_of_the_samples() -> None:
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(200, 6, 4))
    covariance = np.diag([4.0, 4, 4, 0.25, 0.25, 0.25])
    white = Noise(covariance[None], ABOUT)
    banded = Noise(np.stack([covariance] * 2), ABOUT, Bands((0.0, 5.0, 1e9), 100.0))
    a, b = whiten(white, rows).reshape(-1, 4), whiten(banded, rows).reshape(-1, 4)
    np.testing.assert_allclose(a.T @ a, b.T @ b, rtol=1e-10)


def test_shift_moves_the_moment_to_the_point() -> None:
    force = np.array([1.0, 2.0, 3.0])
    at_point = Noise.of_sd(1, 1, ABOUT).shift @ np.concatenate([force, np.cross(ABOUT, force)])
    np.testing.assert_allclose(at_point, [1, 2, 3, 0, 0, 0], atol=1e-12)


def test_coloured_noise_becomes_white() -> None:
    rng = np.random.default_rng(1)
    edges = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 12.6)
    draws = [lfilter([1.0], [1.0, -0.9], rng.normal(size=(900, 6)), axis=0)[300:, :, None] for _ in range(40)]
    bands = Bands(edges, 25.0)
    power = [np.concatenate([bands.coefficients(d)[bands.of(600) == b, :, 0] for d in draws]) for b in range(6)]
    noise = Noise(np.stack([p.T @ p / len(p) for p in power]), np.zeros(3), bands)
    fresh = [lfilter([1.0], [1.0, -0.9], rng.normal(size=(900, 6)), axis=0)[300:, :, None] for _ in range(40)]
    white = np.stack([whiten(noise, d)[:, :, 0] for d in fresh])
    assert np.var(white) == pytest.approx(1.0, abs=0.05)
    neighbours = np.mean(white[:, 1:] * white[:, :-1])
    assert abs(neighbours) < 0.05


def test_blocks_follow_the_runs_and_thin_to_the_rate() -> None:
    use = np.ones(5000, dtype=bool)
    use[1000:1100] = False
    pieces = list(Bands((0.0, 10.0), 25.0).runs(use, 100.0))
    assert [p[0] for p in pieces] == [0, 1100]
    assert all(np.all(np.diff(p) == 4) for p in pieces)
    assert not any((p >= 1000).any() and (p < 1100).any() for p in pieces)
    white = list(WHITE.runs(use, 100.0))
    assert sum(p.size for p in white) == 4900
    assert max(p.size for p in white) <= BLOCK_SAMPLES


def test_coefficients_above_the_last_edge_do_not_count() -> None:
    noise = Noise(np.eye(6)[None], ABOUT, Bands((0.0, 5.0), 25.0))
    assert whiten(noise, np.ones((100, 6, 1))).shape[0] == 40


def test_edges_must_increase() -> None:
    with pytest.raises(BiodanceError, match="increase"):
        Bands((0.0, 2.0, 1.0), 25.0)


@pytest.mark.parametrize(("rate", "stride"), [(100.0, 4), (99.9999, 4), (120.0, 5), (50.0, 2), (24.0, 1)])
def test_thinning_knows_the_rate_it_makes(rate: float, stride: int) -> None:
    bands = Bands((0.0, 10.0), 25.0)
    first = next(bands.runs(np.ones(1000, dtype=bool), rate))
    assert np.all(np.diff(first) == stride)
    thin = bands.at(rate)
    assert thin.rate == pytest.approx(rate / stride)
    wave = np.cos(2 * np.pi * 4.0 * (np.arange(400) + 0.5) / thin.rate)  # 4 Hz in a band of 3.5 to 4.5 Hz
    narrow = Bands((0.0, 3.5, 4.5, 10.0), 25.0).at(rate)
    power = narrow.coefficients(np.repeat(wave[:, None, None], 6, axis=1))[:, 0, 0] ** 2
    assert power[narrow.of(400) == 1].sum() > 0.95 * power.sum()
