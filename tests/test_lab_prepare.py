"""Preparing a trial: gaps, filter and sampling against signals whose truth is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biodance.errors import TrialRefused
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.prepare import prepare
from biodance.records import Markers, Plate, Source, Trial, Wrench
from biodance.settings import Settings

CORNERS = np.array([[0.4, 0.6, 0], [0, 0.6, 0], [0, 0, 0], [0.4, 0, 0]])
LABELS = (
    *(marker.label for marker in read_marker_set("plug_in_gait").markers if marker.offset is not None),
    "*115",
)


def slow(time: np.ndarray) -> np.ndarray:
    """Return a wrench (T, 6) far below the cut-off."""
    return np.stack([(k + 1) * 10 * np.sin(2 * np.pi * 0.7 * time + k) + 100 * k for k in range(6)], axis=1)


def trial(
    *, rate: float = 100.0, analog: float = 1000.0, frames: int = 200, hum: float = 0.0, start: float = 0.0
) -> Trial:
    time = np.arange(frames) / rate
    fast = start + np.arange(round(frames * analog / rate)) / analog
    value = slow(fast) + hum * np.sin(2 * np.pi * 50 * fast)[:, None]
    rng = np.random.default_rng(5)
    xyz = rng.normal(size=(1, len(LABELS), 3)) + np.stack([time, 0 * time, 0 * time], axis=1)[:, None]
    markers = Markers(LABELS, time, xyz)
    plate = Plate("plate1", 2, CORNERS, Wrench(fast, value), ("Sign kept.",))
    return Trial(
        "walk",
        "fit",
        markers,
        (plate,),
        Source(Path("walk.c3d"), "0", "C3D", rate, analog),
        "plug_in_gait",
        history=("Read.",),
    )


@pytest.mark.parametrize(
    ("rate", "analog"), [(100.0, 1000.0), (120.0, 1080.0), (100.0, 960.0), (60.0, 1000.0), (100.0, 100.0)]
)
def test_forces_are_filtered_and_sampled_at_marker_times(rate: float, analog: float) -> None:
    given = trial(rate=rate, analog=analog, hum=20.0 if analog > 120 else 0.0)
    ready = prepare(given)
    assert np.array_equal(ready.wrench.time, given.markers.time)
    inner = slice(30, -30)
    assert ready.wrench.value[inner] == pytest.approx(slow(given.markers.time)[inner], abs=0.02)
    word = "sampled" if analog % rate == 0 else "interpolated"
    assert word in ready.history[-1]
    assert "10 Hz" in ready.history[-1]
    assert ready.plates[0].decisions[0] == "Sign kept."


def test_markers_are_selected_but_not_filtered() -> None:
    given = trial()
    ready = prepare(given)
    assert "*115" not in ready.markers
    assert np.array_equal(ready.markers["LASI"], given.markers["LASI"])
    assert ready.history[0] == "Read."
    assert any("39 markers of the set plug_in_gait kept, 1 other points left out" in line for line in ready.history)
    assert "No marker has a gap." in ready.history


def test_gaps_are_said() -> None:
    given = trial()
    xyz = given.markers.xyz.copy()
    xyz[50:55, LABELS.index("C7")] = np.nan
    xyz[100:160, LABELS.index("LTOE")] = np.nan
    ready = prepare(replace(given, markers=Markers(LABELS, given.markers.time, xyz)))
    assert "Short gaps bridged by a spline (1): C7." in ready.history
    assert any(line.startswith("LTOE 1.00 to 1.59 s left unseen: fewer than three") for line in ready.history)
    assert ready.warnings == ("LTOE was not seen in 30 % of the frames (longest gap 0.60 s).",)
    assert ready.markers["C7"] == pytest.approx(given.markers["C7"], abs=1e-9)


def test_a_prepared_trial_is_not_filtered_twice() -> None:
    ready = prepare(trial())
    assert prepare(ready) is ready


def test_markers_outside_the_plates_time_are_cut_off() -> None:
    ready = prepare(trial(start=0.5))
    assert ready.markers.time[0] == pytest.approx(0.5)
    assert any("50 of 200 frames were cut off" in line for line in ready.history)
    with pytest.raises(TrialRefused, match=r"Trial walk: .* share no time"):
        prepare(trial(start=5.0))


def test_one_frame_takes_the_mean_of_its_samples() -> None:
    given = trial(frames=1)
    ready = prepare(given)
    assert ready.wrench.value[0] == pytest.approx(given.wrench.value.mean(axis=0))
    assert "mean of 10 samples" in ready.history[-1]


def test_plates_alone_keep_their_times_and_markers_alone_are_fine() -> None:
    given = trial()
    plates = prepare(replace(given, markers=None))
    assert np.array_equal(plates.wrench.time, given.wrench.time)
    assert not np.array_equal(plates.wrench.value, given.wrench.value)
    assert prepare(replace(given, plates=())).markers is not None


def test_unknown_samples_stay_unknown() -> None:
    given = trial(analog=960.0)
    value = given.wrench.value.copy()
    value[500:600] = np.nan
    plate = replace(given.plates[0], wrench=Wrench(given.wrench.time, value))
    ready = prepare(replace(given, plates=(plate,)))
    unknown = np.isnan(ready.wrench.value).any(axis=1)
    assert 10 <= unknown.sum() <= 12
    assert np.array_equal(unknown, np.isnan(ready.wrench.value).all(axis=1))


def test_no_force_is_told_between_the_last_known_sample_and_the_next() -> None:
    """Samples 500 to 599 are lost: whatever was pressed between samples 499 and 600 nobody measured."""
    given = trial(analog=960.0)
    value = given.wrench.value.copy()
    value[500:600] = np.nan
    plate = replace(given.plates[0], wrench=Wrench(given.wrench.time, value))
    ready = prepare(replace(given, plates=(plate,)))
    lost = (given.markers.time > 499 / 960) & (given.markers.time < 600 / 960)
    assert np.array_equal(np.isnan(ready.wrench.value).all(axis=1), lost)


def test_the_chosen_cutoff_is_that_of_the_forces() -> None:
    """A hum at the cut-off keeps 1 / sqrt(2) of its amplitude of 20 N; at the usual 10 Hz nothing of it is left."""
    given = trial(rate=200.0, frames=400, hum=20.0)
    chosen = prepare(replace(given, settings=Settings().changed({"filter.cutoff": 50})))
    left = [(one.wrench.value - slow(given.markers.time))[100:-100].std() for one in (chosen, prepare(given))]
    assert left[0] == pytest.approx(10.0, rel=0.01)
    assert left[1] < 0.05


def test_a_cutoff_above_half_the_marker_rate_is_refused() -> None:
    with pytest.raises(TrialRefused, match=r"Trial walk: The cut-off 60 Hz is not below half"):
        prepare(replace(trial(), settings=Settings().changed({"filter.cutoff": 60})))


def test_a_plate_says_when_it_was_loaded_though_the_low_pass_smears_it() -> None:
    """A heel strikes with 250 N in 5 ms at 0.7 s; a flicker at 1 s is none, and what goes on at the end has no end."""
    given = trial()
    plate, time = given.plates[0], given.plates[0].wrench.time
    force = np.interp(time, [0.7, 0.705, 1.2, 1.3, 1.6, 1.605], [0, 250, 700, 0, 0, 250], left=0)
    force[(time > 1.0) & (time < 1.02)] = 0
    value = np.zeros((time.size, 6))
    value[:, 2] = force
    (ready,) = prepare(replace(given, plates=(replace(plate, wrench=Wrench(time, value)),))).plates
    steps = [[0.7004, 1.3 - 0.1 * 20 / 700], [1.6004, np.nan]]
    np.testing.assert_allclose(ready.loaded, steps, atol=1e-4)
    # what the low-pass takes from the first peak of 250 N, and swings beyond it, stays in the peaks
    near = (ready.wrench.time > 0.705) & (ready.wrench.time < 0.75)
    true = np.interp(ready.wrench.time, time, force)[near]
    assert np.abs(ready.peaks.force[near, 2] - true).max() < 0.1 * np.abs(ready.wrench.force[near, 2] - true).max()
    smeared = ready.wrench.force[:, 2] > 20
    assert ready.wrench.time[smeared][0] < 0.695
