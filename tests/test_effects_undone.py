"""A cause that distorts time or frequency is undone in what was measured, with all that the prediction lacks."""

from dataclasses import replace

import numpy as np
import pytest
from human_cases import human_case
from scipy.signal import butter, filtfilt

from biodance.effects import Case, effect
from biodance.effects.filter_mismatch import REFERENCE, STRENGTH
from biodance.effects.sloshing_load import _FREQUENCY
from biodance.effects.time_delay import moved_in_time
from biodance.records import Array, Wrench

INSIDE = slice(30, -30)


def unmodelled(case: Case) -> Array:
    """Return (T, 6) what no parameter explains: an unknown load that swings."""
    time = case.motion.time[:, None]
    return np.array([20.0, 10.0, 40.0, 5.0, 8.0, 3.0]) * np.sin(2 * np.pi * 1.5 * time + np.arange(6))


def with_measured(case: Case, value: Array) -> Case:
    plate = replace(case.trial.plates[0], wrench=Wrench(case.motion.time, value))
    return replace(case, trial=replace(case.trial, plates=(plate,)))


@pytest.mark.parametrize(("name", "size"), [("time_delay", 0.02), ("clock_drift", 0.03)])
def test_a_delay_is_undone_with_what_the_prediction_lacks(name: str, size: float) -> None:
    case = human_case(300)
    right = case.predicted + unmodelled(case)
    share = 1.0 if name == "time_delay" else case.session_time - 0.5
    late = moved_in_time(case.motion.time, right, size * share * np.ones(len(right)))
    wrong = with_measured(case, late)
    found = effect(name)
    mended = found.corrected(wrong, np.array([size])).trial.wrench.value
    np.testing.assert_allclose(mended[INSIDE], right[INSIDE], atol=0.02 * np.abs(late - right)[INSIDE].max())
    predicted_only = late - found.added(wrong, np.array([size]))
    assert np.abs(predicted_only - right)[INSIDE].max() > 3 * np.abs(mended - right)[INSIDE].max()


def test_a_lower_filter_gives_back_what_the_movement_lost() -> None:
    """Noise comes in after the filter: undone in what was measured, it would be many times as loud."""
    case = human_case(300)
    low = butter(2, 4.0 / (case.motion.rate / 2))
    passed = filtfilt(*low, case.predicted, axis=0, padlen=100)
    noise = np.random.default_rng(1).normal(size=passed.shape)
    size = np.array([(4.0**-4 - REFERENCE**-4) / STRENGTH])
    mended = effect("filter_mismatch").corrected(with_measured(case, passed + noise), size).trial.wrench.value
    left, lost = mended - noise - case.predicted, passed - case.predicted
    assert np.abs(left[INSIDE]).max() < 0.2 * np.abs(lost[INSIDE]).max()


@pytest.mark.parametrize("name", ["added_mass", "sloshing_load", "plate_gain", "time_delay"])
def test_added_is_what_transform_adds(name: str) -> None:
    case = human_case(120)
    found = effect(name).at(effect(name).targets(case)[-1], case)
    theta = found.typical
    np.testing.assert_allclose(
        found.added(case, theta), found.transform(case, theta).residual - case.residual, atol=1e-8
    )


@pytest.mark.parametrize(
    ("carried", "sloshing", "possible"), [(6.0, 4.5, True), (2.0, 2.0, True), (0.1, 4.3, False), (4.0, -1.0, False)]
)
def test_no_more_sloshes_than_is_carried(carried: float, sloshing: float, possible: bool) -> None:
    """What swings with a walker without weighing anything is the walker's own flesh."""
    theta = np.array([carried, sloshing, 0.0, 0.0])
    assert replace(effect("sloshing_load"), target="trunk_head").possible_in(human_case(120), theta) is possible


def test_a_load_sloshes_at_the_frequency_that_is_reported() -> None:
    found = replace(effect("sloshing_load"), target="trunk_head")
    case = human_case(300)
    rows = found.reported(case, np.array([2.0, 1.0, 0.5, 0.0]), np.array([0.1, 0.1, 0.05, 0.02]))
    assert rows[2] == ("frequency", _FREQUENCY + 0.5, 0.05, "Hz")
    slow, quick = (found.added(case, np.array([0.0, 1.0, step, 0.0])) for step in (-0.4, 0.4))
    assert np.linalg.norm(slow - quick) > 0.1 * np.linalg.norm(slow)
