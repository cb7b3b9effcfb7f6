"""Rows stamped on arrival: frames of cameras at a known rate, some of them missing, whose stamps are late by chance."""

import re

import numpy as np
import pytest

from biodance.lab.markers.time_axis import camera_instants

CAMERAS = 100.0


def walkers(time: np.ndarray) -> np.ndarray:
    """Return where ten markers of somebody who bends and sways are, (S, 10, 3) m, with 0.2 mm of noise."""
    rng = np.random.default_rng(1)
    phase, size = rng.uniform(0, 6, (2, 10, 3)), 0.02 * rng.normal(size=(3, 10, 3))
    waves = (
        np.sin(2 * np.pi * f * time[:, None, None] + k * phase[0] + phase[1]) for k, f in enumerate((0.4, 0.9, 2.0))
    )
    path = sum(wave * part / (k + 1) for k, (wave, part) in enumerate(zip(waves, 8 * size, strict=True)))
    return path + rng.normal(0, 0.0002, path.shape)


def frames(count: int = 900, seed: int = 0) -> np.ndarray:
    """Return the instants of frames of which most are missing: two to five steps of the cameras apart."""
    return np.cumsum(np.random.default_rng(seed).choice([2, 3, 3, 4, 5], count)) / CAMERAS


def test_the_instants_of_the_cameras_are_found_behind_late_stamps() -> None:
    true = frames()
    stamps = true + np.random.default_rng(2).uniform(0.001, 0.009, true.size)
    found, said = camera_instants(stamps, walkers(true))
    late = found - true  # what is common to all is the mean delay, which markers cannot tell
    assert np.mean(np.abs(late - np.median(late)) < 0.0005) > 0.98
    assert np.std(stamps - true) > 0.002
    assert re.search(r"cameras at (99\.99\d*|100(\.0\d*)?) Hz, 2", said)


def test_rows_around_a_hole_keep_their_stamps() -> None:
    true = np.concatenate([[-9.0], frames()])
    stamps = true + np.random.default_rng(2).uniform(0.001, 0.009, true.size)
    found, said = camera_instants(stamps, walkers(true))
    assert found[0] == stamps[0]
    assert "cameras at" in said


@pytest.mark.parametrize("late", [0.0, 0.002])
def test_stamps_without_a_grid_stay(late: float) -> None:
    rng = np.random.default_rng(5)
    true = np.cumsum(rng.uniform(0.02, 0.05, 900))
    stamps = true + rng.normal(0, late, true.size)
    found, said = camera_instants(stamps, walkers(true))
    np.testing.assert_array_equal(found, stamps)
    assert said == ""


def test_even_steps_few_rows_and_stillness_tell_nothing() -> None:
    true = frames()
    stamps = true + np.random.default_rng(2).uniform(0.001, 0.009, true.size)
    still = np.random.default_rng(3).normal(0, 0.0002, (true.size, 10, 3))
    even = np.arange(900) / 30.0
    for time, xyz in ((stamps[:60], walkers(true[:60])), (stamps, still), (even, walkers(even))):
        found, said = camera_instants(time, xyz)
        np.testing.assert_array_equal(found, time)
        assert said == ""
