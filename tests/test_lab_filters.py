"""The low-pass: gain at the cut-off, no delay, gaps, ends, and refusals."""

import numpy as np
import pytest

from biodance.errors import BiodanceError
from biodance.lab.prepare import LowPass, left_raw, low_pass
from biodance.records import runs


def tone(frequency: float, rate: float, seconds: float = 20.0) -> np.ndarray:
    return np.sin(2 * np.pi * frequency * np.arange(int(seconds * rate)) / rate)


def middle_gain(frequency: float, rate: float, settings: LowPass) -> float:
    signal = tone(frequency, rate)
    part = slice(len(signal) // 4, 3 * len(signal) // 4)
    out = low_pass(signal, rate, settings)[part]
    return float(out @ signal[part] / (signal[part] @ signal[part]))


@pytest.mark.parametrize("order", [1, 2, 4, 5])
@pytest.mark.parametrize("rate", [100.0, 120.0, 1000.0])
@pytest.mark.parametrize("cutoff", [6.0, 10.0, 20.0])
def test_both_passes_together_are_3_db_down_at_the_cutoff(order: int, rate: float, cutoff: float) -> None:
    assert middle_gain(cutoff, rate, LowPass(order, cutoff)) == pytest.approx(np.sqrt(0.5), abs=1e-4)


@pytest.mark.parametrize("kind", ["butterworth", "critically_damped"])
@pytest.mark.parametrize("frequency", [2.0, 6.0, 9.0])
def test_the_gain_is_that_of_a_tone(kind: str, frequency: float) -> None:
    settings = LowPass(2, 5.0, kind)
    assert settings.gain(np.array([frequency]), 30.0) == pytest.approx(middle_gain(frequency, 30.0, settings), abs=1e-4)


def test_slow_tones_pass_and_fast_ones_do_not() -> None:
    assert middle_gain(2.0, 1000.0, LowPass()) == pytest.approx(1.0, abs=1e-5)
    assert abs(middle_gain(40.0, 1000.0, LowPass())) < 1e-5


def test_forces_and_markers_get_the_same_filter() -> None:
    slow, fast = low_pass(tone(6.0, 100.0), 100.0, LowPass()), low_pass(tone(6.0, 1000.0), 1000.0, LowPass())
    assert slow[100:-100] == pytest.approx(fast[::10][100:-100], abs=1e-3)


def test_there_is_no_delay() -> None:
    pulse = np.zeros(401)
    pulse[200] = 1.0
    out = low_pass(pulse, 100.0, LowPass())
    assert out == pytest.approx(out[::-1], abs=1e-9)
    assert np.argmax(out) == 200


def test_constants_and_lines_pass_and_nothing_swings_at_the_ends() -> None:
    time = np.arange(300) / 100
    signal = np.stack([np.full(300, 700.0), 3 + 2 * time], axis=1)
    assert low_pass(signal, 100.0, LowPass()) == pytest.approx(signal, rel=1e-3)


def test_columns_are_filtered_alike_whatever_their_shape() -> None:
    signal = np.random.default_rng(1).normal(size=(200, 3, 2))
    out = low_pass(signal, 100.0, LowPass())
    assert out[:, 1, 1] == pytest.approx(low_pass(signal[:, 1, 1], 100.0, LowPass()))


def test_it_filters_between_gaps_and_leaves_short_runs_raw() -> None:
    signal = np.random.default_rng(2).normal(size=(200, 2))
    signal[80:90, 0] = np.nan
    signal[95, 0] = np.nan
    out = low_pass(signal, 100.0, LowPass())
    assert np.array_equal(np.isnan(out), np.isnan(signal))
    assert out[:80, 0] == pytest.approx(low_pass(signal[:80, 0], 100.0, LowPass()))
    assert out[96:, 0] == pytest.approx(low_pass(signal[96:, 0], 100.0, LowPass()))
    raw = left_raw(signal, 100.0, LowPass())
    assert np.flatnonzero(raw[:, 0]).tolist() == [90, 91, 92, 93, 94]
    assert np.array_equal(out[raw], signal[raw])
    assert not raw[:, 1].any()


@pytest.mark.parametrize(
    ("samples", "rate", "settings", "words"),
    [
        (100, 100.0, LowPass(cutoff=50.0), "not below half the sampling rate"),
        (100, 0.0, LowPass(), "sampling rate is 0.0"),
        (100, np.nan, LowPass(), "sampling rate is nan"),
        (10, 100.0, LowPass(), "at least 11 are needed"),
    ],
)
def test_impossible_filters_are_refused(samples: int, rate: float, settings: LowPass, words: str) -> None:
    with pytest.raises(BiodanceError, match=words):
        low_pass(np.zeros(samples), rate, settings)


@pytest.mark.parametrize(("order", "cutoff"), [(0, 10.0), (11, 10.0), (5, 0.0), (5, np.nan), (5, np.inf)])
def test_impossible_settings_are_refused(order: int, cutoff: float) -> None:
    with pytest.raises(BiodanceError, match="low-pass has the"):
        LowPass(order, cutoff)


def test_runs() -> None:
    assert runs(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert runs(np.zeros(3, dtype=bool)) == []
