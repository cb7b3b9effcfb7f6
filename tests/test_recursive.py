"""Filters and tops against scipy's."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, median_filter, uniform_filter1d
from scipy.signal import butter, cont2discrete, find_peaks, lfilter, lfilter_zi, sosfiltfilt, ss2tf

from biodance.cycles.tops import find_tops
from biodance.effects._base.oscillator import relative_motion
from biodance.lab.recursive import butterworth_sections, first_order_section, run_both_ways, run_forwards
from biodance.records.moving import any_near, moving_mean, moving_median

WALK = np.random.default_rng(0).normal(size=(400, 3)).cumsum(axis=0)


@pytest.mark.parametrize("order", range(1, 11))
def test_a_butterworth_low_pass_is_scipys(order: int) -> None:
    expected = sosfiltfilt(butter(order, 6.0, fs=100, output="sos"), WALK, axis=0, padlen=30)
    found = run_both_ways(butterworth_sections(order, float(np.tan(np.pi * 0.06))), WALK, 30)
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_one_real_pole_is_the_butterworth_of_order_one() -> None:
    np.testing.assert_allclose(first_order_section(0.2), butterworth_sections(1, 0.2), rtol=1e-14)


@pytest.mark.parametrize(("frequency", "damping"), [(2.0, 0.1), (8.0, 0.5), (1.0, 1.0)])
def test_a_mass_on_a_spring_moves_as_scipys_first_order_hold_says(frequency: float, damping: float) -> None:
    w = 2 * np.pi * frequency
    system = (np.array([[0, 1], [-w * w, -2 * damping * w]]), np.array([[0], [-1]]), np.eye(2), np.zeros((2, 1)))
    A, B, C, D, _ = cont2discrete(system, 0.02, method="foh")
    tops, pole = ss2tf(A, B, C, D)
    place, _ = lfilter(tops[0], pole, WALK, axis=0, zi=lfilter_zi(tops[0], pole)[:, None] * WALK[:1])
    found, acceleration = relative_motion(WALK, 50.0, frequency=frequency, damping=damping)
    np.testing.assert_allclose(found, place, atol=1e-9 * np.abs(place).max())
    inside = (place[2:] - 2 * place[1:-1] + place[:-2]) / 0.02**2
    assert frequency > 1 or np.corrcoef(inside[:, 0], acceleration[1:-1, 0])[0, 1] > 0.9


def test_a_section_alone_runs_forwards_from_rest() -> None:
    section = butterworth_sections(2, 0.3)
    constant = np.full((20, 2), 3.0)
    np.testing.assert_allclose(run_forwards(section, constant), constant, rtol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_tops_are_scipys_peaks(seed: int) -> None:
    curve = np.round(np.random.default_rng(seed).normal(size=300).cumsum(), 1)
    for prominence, apart in ((0.1, 1), (1.0, 10), (3.0, 40)):
        expected, _ = find_peaks(curve + 1e-9 * np.arange(300), prominence=prominence, distance=apart)
        found = find_tops(curve + 1e-9 * np.arange(300), prominence=prominence, apart=apart)
        np.testing.assert_array_equal(found, expected)
    flat = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 2.0, 0.0])
    np.testing.assert_array_equal(find_tops(flat, prominence=0.5, apart=1), find_peaks(flat, prominence=0.5)[0])


@pytest.mark.parametrize("width", [1, 4, 11])
def test_what_lies_around_a_sample_is_as_scipy_has_it(width: int) -> None:
    curve = WALK[:60, 0]
    for ends, mode in (("symmetric", "reflect"), ("edge", "nearest")):
        found = moving_mean(curve, width, ends=ends)
        np.testing.assert_allclose(found, uniform_filter1d(curve, width, mode=mode), atol=1e-12)
    np.testing.assert_array_equal(moving_median(curve, width), median_filter(curve, width, mode="mirror"))
    rare = curve > np.sort(curve)[-4]
    np.testing.assert_array_equal(any_near(rare, width), binary_dilation(rare, iterations=width))
