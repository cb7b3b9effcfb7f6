"""RMS and correlation per channel, and what is said where they are not defined."""

import numpy as np
import pytest

from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.dynamics import compare
from biodance.records import Wrench


def wrench(value: np.ndarray, shift: float = 0.0) -> Wrench:
    return Wrench(np.arange(len(value)) / 100 + shift, value)


def test_rms_and_correlation_of_known_signals() -> None:
    time = np.arange(400) / 100
    wave = np.sin(2 * np.pi * time)[:, None] * np.ones(6)
    scale, offset = np.array([1, 2, -1, 1, 1, 1]), np.array([0, 0, 0, 3, 0, 0])
    found = compare(wrench(wave), wrench(scale * wave + offset))
    assert found.frames == 400
    assert found.rms == pytest.approx(np.array([0, 1, 2, 3 * np.sqrt(2), 0, 0]) / np.sqrt(2))
    assert found.correlation == pytest.approx((1, 1, -1, 1, 1, 1))
    assert found.notes == ()


def test_correlation_agrees_with_numpy() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(2, 50, 6))
    mask = rng.random(50) > 0.3
    found = compare(wrench(first), wrench(second), mask)
    assert found.correlation == pytest.approx([np.corrcoef(first[mask, i], second[mask, i])[0, 1] for i in range(6)])
    assert found.frames == mask.sum()


def test_only_masked_frames_count() -> None:
    value = np.random.default_rng(1).normal(size=(50, 6))
    wrong = value.copy()
    wrong[20:] += 100
    assert compare(wrench(value), wrench(wrong), np.arange(50) < 20).rms == pytest.approx(np.zeros(6))


def test_an_undefined_correlation_is_none_and_said() -> None:
    value = np.random.default_rng(2).normal(size=(50, 6))
    flat = value.copy()
    flat[:, 2] = 650.0
    found = compare(wrench(value), wrench(flat))
    assert found.correlation[2] is None
    assert sum(c is None for c in found.correlation) == 1
    assert found.notes == ("No correlation of Fz: constant.",)
    few = compare(wrench(value), wrench(value), np.arange(50) < 2)
    assert few.correlation == (None,) * 6
    assert "only 2 frames" in few.notes[0]


def test_unknown_frames_are_left_out_and_said() -> None:
    value = np.random.default_rng(3).normal(size=(50, 6))
    holes = value.copy()
    holes[5:8] = np.nan
    found = compare(wrench(value), wrench(holes))
    assert found.frames == 47
    assert np.isfinite(found.rms).all()
    assert found.notes == ("3 frames left out: not known in both.",)


def test_nothing_to_compare_is_refused() -> None:
    value = np.zeros((5, 6))
    with pytest.raises(TrialRefused, match="No frame is left"):
        compare(wrench(value), wrench(value), np.zeros(5, dtype=bool))
    with pytest.raises(BiodanceError, match="different times"):
        compare(wrench(value), wrench(value, 0.005))
    with pytest.raises(BiodanceError, match="mask has 4"):
        compare(wrench(value), wrench(value), np.ones(4, dtype=bool))
