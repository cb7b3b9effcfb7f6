"""The zero of a plate: the window that the file names, one that is found, or none - and never a loaded one."""

import numpy as np
import pytest
from plate_emulator import RATE, Emulated, channels, raw_file, step

from biodance.lab.plates.decode import find_baseline, is_unloaded
from biodance.lab.plates.read import read_plates

OFFSET = np.array([3.0, -5.0, 40.0, 2.0, -1.0, 0.5])


def recorded(*, zero, noise=1.0, offset=OFFSET, seed=0, **arguments):
    """A plate that somebody steps on, with an offset (N, N·m) on every channel and noise; returns what was read, and
    the truth.
    """
    rng = np.random.default_rng(seed)
    plate = Emulated(**arguments)
    truth, _ = step(rng, plate)
    signals = channels(plate, truth) + offset + noise * rng.normal(size=truth.shape) * [1, 1, 1, 0.1, 0.1, 0.1]
    plates, warnings, *_ = read_plates(raw_file([plate], [signals], zero=zero), metres=0.001)
    return plates[0], truth, warnings


def mean_error(plate, truth):
    return np.abs((plate.wrench.value - truth).mean(axis=0)).max()


@pytest.mark.parametrize("zero", [(1, 400), (1, 0), (0, 0), (0, 10), (1, 2), (-3, 9000), (900, 1200)])
@pytest.mark.parametrize("reaction", [True, False])
def test_the_offset_is_taken_off(zero, reaction):
    plate, truth, _ = recorded(zero=zero, reaction=reaction)
    assert mean_error(plate, truth) < 0.3
    said = next(text for text in plate.decisions if text.startswith("Zero"))
    assert ("as the file says" in said) == (zero == (1, 400))
    if zero == (900, 1200):
        assert "loaded there" in said


@pytest.mark.parametrize(("zero", "window"), [((1, 400), (0, 400)), ((3, 14), (2, 14)), ((391, 400), (390, 400))])
def test_samples_are_counted_from_one_and_the_last_one_counts(zero, window):
    vertical = np.concatenate([np.full(400, 3.0), np.full(400, 700.0)])
    found = find_baseline(vertical, zero=zero, rate=RATE)
    assert (found.start, found.stop) == window


@pytest.mark.parametrize("level", [-200.0, 150.0, 60.0])
def test_a_large_offset_of_either_sign_is_found(level):
    plate, truth, _ = recorded(zero=(1, 0), offset=np.array([0, 0, level, 0, 0, 0]))
    assert mean_error(plate, truth) < 0.3


def test_a_noisy_plate_is_still_zeroed():
    plate, truth, _ = recorded(zero=(1, 0), noise=15.0)
    assert mean_error(plate, truth) < 2.0


def test_a_person_who_stands_all_the_time_is_not_subtracted():
    rng = np.random.default_rng(2)
    for sway in (0.5, 5.0, 40.0):
        vertical = -666 + sway * np.sin(np.arange(3000) / 300) + rng.normal(0, 0.3, 3000)
        found = find_baseline(vertical, zero=(1, 10), rate=RATE)
        assert (found.start, found.stop) == (0, 0)
        assert "never seen unloaded" in found.said
        assert "loaded there" in found.said


def test_a_jump_is_zeroed_in_the_air():
    time = np.arange(0, 4, 1 / RATE)
    vertical = np.where((time > 2) & (time < 2.4), 7.0, 760 + 900 * np.exp(-(((time - 1.8) / 0.1) ** 2)))
    found = find_baseline(vertical, zero=(1, 10), rate=RATE)
    assert 2.0 < found.start / RATE < found.stop / RATE <= 2.4
    assert "loaded there" in found.said


def test_an_empty_plate_is_zeroed():
    rng = np.random.default_rng(3)
    vertical = -4 + rng.normal(0, 2.5, 3000)
    found = find_baseline(vertical, zero=None, rate=RATE)
    assert found.stop - found.start > 2000
    assert "missing" in found.said


def test_lifting_one_foot_halfway_is_no_zero():
    """The lowest plateau of a standing person is a load, not an offset."""
    sway = 3 * np.sin(np.arange(1000) / 150)
    for low in (330.0, 120.0, 60.0):
        vertical = np.concatenate([700 + sway, low + sway, 700 + sway])
        found = find_baseline(vertical, zero=(1, 0), rate=RATE)
        assert (found.start, found.stop) == (0, 0), low
    found = find_baseline(np.concatenate([700 + sway, 330 + sway, 700 + sway]), zero=(1100, 1200), rate=RATE)
    assert "loaded there" in found.said


def test_unloaded_is_an_end_of_the_range():
    assert is_unloaded(2.0, np.array([0.0, 2, 3, 700]))
    assert is_unloaded(-2.0, np.array([-700.0, -2, 1]))
    assert not is_unloaded(350.0, np.array([0.0, 350, 700]))
    assert not is_unloaded(28.0, np.array([-300.0, 28, 300]))
