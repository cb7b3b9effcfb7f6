"""Recursive filters beside scipy.signal's; the turning points of a foot beside its peaks."""

import numpy as np
import pytest
from scipy import signal

from biodance.cycles.events import _tops
from biodance.effects._base.oscillator import relative_motion
from biodance.lab.recursion import butterworth_sections, filter_both_ways

RATE = 100.0


def path(seed: int, columns: int = 3) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=(400, columns)), axis=0)


@pytest.mark.parametrize("order", range(1, 11))
@pytest.mark.parametrize("cutoff", [1.0, 6.0, 45.0])
def test_a_low_pass_is_that_of_scipy(order: int, cutoff: float) -> None:
    theirs = signal.sosfiltfilt(signal.butter(order, cutoff, fs=RATE, output="sos"), path(order, 70), axis=0, padlen=30)
    ours = filter_both_ways(butterworth_sections(order, cutoff, RATE), path(order, 70), pad=30)
    np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize(("frequency", "damping"), [(3.0, 0.2), (12.0, 0.05), (1.5, 0.7)])
def test_a_mass_on_a_spring_is_that_of_scipy(frequency: float, damping: float) -> None:
    w, acceleration = 2 * np.pi * frequency, path(3)
    system = signal.StateSpace([[0, 1], [-w * w, -2 * damping * w]], [[0], [-1]], np.eye(2), np.zeros((2, 1)))
    start = np.array([-acceleration[0, 1] / w**2, 0.0])
    _, moved, _ = signal.lsim(system, acceleration[:, 1], np.arange(400) / RATE, X0=start)
    place, beyond = relative_motion(acceleration, RATE, frequency=frequency, damping=damping)
    np.testing.assert_allclose(place[:, 1], moved[:, 0], atol=1e-9 * np.abs(moved[:, 0]).max())
    asked = -acceleration[:, 1] - w * w * moved[:, 0] - 2 * damping * w * moved[:, 1]
    np.testing.assert_allclose(beyond[:, 1], asked, atol=1e-9 * np.abs(asked).max())


@pytest.mark.parametrize("seed", range(20))
def test_turning_points_are_the_peaks_of_scipy(seed: int) -> None:
    smooth = filter_both_ways(butterworth_sections(2, 8.0, RATE), path(seed, 1), pad=20)[:, 0]
    peaks, _ = signal.find_peaks(smooth, prominence=0.8, distance=20)
    assert peaks.size
    assert _tops(smooth, prominence=0.8, apart=20).tolist() == peaks.tolist()
