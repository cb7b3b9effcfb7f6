"""The time of rows with stamps: equal steps stay, changing ones are resampled on their own stamps, and what that costs
is what it costs.
"""

from pathlib import Path

import numpy as np
import pytest
from tables import jittering

from biodance.errors import FileRefused
from biodance.lab.markers.time_axis import time_axis
from biodance.lab.readers import read_trial
from biodance.records import Trial


def wave(time):
    """A movement of 1 Hz and 0.3 m, in two columns."""
    return np.stack([0.3 * np.sin(2 * np.pi * time), 0.3 * np.cos(2 * np.pi * time)], axis=1)


def test_rounded_stamps_are_equal_steps():
    axis = time_axis(np.round(np.arange(200) / 60, 3), where="f")
    assert not axis.sampled
    assert axis.said == ""
    np.testing.assert_allclose(np.diff(axis.time), 1 / 60, rtol=1e-3)


def test_a_movement_comes_back_from_jittering_stamps_and_its_cost_is_no_less_than_its_error():
    stamps = jittering(400, 30.0)
    axis = time_axis(stamps, where="f")
    assert axis.sampled
    off = axis.at(wave(stamps)) - wave(axis.time)
    error = np.sqrt(np.mean(off**2))
    assert error < 1e-3
    assert error < axis.missed_by(wave(stamps)) < 0.01
    assert "steps are not equal" in axis.said


def test_the_factor_on_noise_is_that_of_noise():
    stamps = jittering(4000, 30.0)
    axis = time_axis(stamps, where="f")
    noise = np.random.default_rng(5).normal(size=(4000, 20))
    assert axis.at(noise).std() == pytest.approx(axis.noise, rel=0.03)


def test_nothing_is_told_in_a_hole_nor_beside_an_unseen_sample():
    stamps = np.delete(jittering(400, 30.0), slice(150, 165))
    values = wave(stamps)
    values[60] = np.nan
    axis = time_axis(stamps, where="f")
    lost = np.isnan(axis.at(values)).any(axis=1)
    hole = (axis.time > stamps[149]) & (axis.time < stamps[150])
    unseen = (axis.time > stamps[59]) & (axis.time < stamps[61])
    np.testing.assert_array_equal(lost, hole | unseen)
    assert hole.sum() > 10


def test_single_rows_apart_at_the_ends_are_left_out():
    stamps = jittering(100, 30.0)
    axis = time_axis(np.concatenate([[stamps[0] - 8.5], stamps, [stamps[-1] + 3.0]]), where="f")
    assert axis.time[0] == stamps[0]
    assert stamps[-1] - axis.time[-1] < np.median(np.diff(stamps))
    assert "2 rows apart" in axis.said


def test_rows_too_far_apart_are_postures():
    stamps = np.cumsum(np.random.default_rng(2).uniform(0.5, 1.4, 40))
    axis = time_axis(stamps, where="f")
    values = np.random.default_rng(3).normal(size=(40, 2))
    np.testing.assert_array_equal(axis.at(values), values)
    assert "kept as a posture" in axis.said


@pytest.mark.parametrize("stamps", [[0.0, 0.1, 0.1, 0.2], [0.0, 0.2, 0.1, 0.3], [0.0, np.nan, 0.2, 0.3]])
def test_time_that_does_not_increase_is_refused(stamps):
    with pytest.raises(FileRefused, match=r"the time does not increase at row [23]"):
        time_axis(np.array(stamps), where="f")


def markers_and_forces(folder: Path, stamps: np.ndarray) -> Trial:
    """Read a .trc and .mot of one marker cloud and one plate whose rows have these stamps."""
    labels = [f"M{k}" for k in range(6)]
    cloud = np.random.default_rng(1).uniform(-0.5, 0.5, (6, 3)) * [0.6, 1.8, 0.4] + [0, 1.0, 0]
    xyz = cloud[None] + 0.1 * wave(stamps)[:, [0]][:, :, None]
    rows = "\n".join(
        f"{k}\t{t:.6f}\t" + "\t".join(f"{v:.7f}" for v in frame.ravel())
        for k, (t, frame) in enumerate(zip(stamps, xyz, strict=True), start=1)
    )
    head = (
        "PathFileType\t4\t(X/Y/Z)\tw.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
        f"100\t100\t{len(stamps)}\t6\tm\nFrame#\tTime\t" + "\t\t\t".join(labels) + "\n\tX1\tY1\tZ1\n"
    )
    (folder / "w.trc").write_text(f"{head}{rows}\n")
    names = (
        [f"ground_force_v{a}" for a in "xyz"]
        + [f"ground_force_p{a}" for a in "xyz"]
        + [f"ground_torque_{a}" for a in "xyz"]
    )
    table = "\n".join(
        f"{t:.6f}\t0\t{700 + 100 * w:.7f}\t0\t0.1\t0\t0.2\t0\t0\t0"
        for t, w in zip(stamps, wave(stamps)[:, 0], strict=True)
    )
    (folder / "w.mot").write_text(
        f"w\nnRows={len(stamps)}\nnColumns=10\nendheader\ntime\t" + "\t".join(names) + f"\n{table}\n"
    )
    return read_trial(folder / "w.trc")


def test_trc_and_mot_with_changing_steps_are_treated_alike(tmp_path):
    stamps = np.round(jittering(300, 60.0), 6)
    trial = markers_and_forces(tmp_path, stamps)
    (plate,) = trial.plates
    assert trial.markers is not None
    np.testing.assert_array_equal(plate.wrench.time, trial.markers.time)
    truth = wave(trial.markers.time)
    np.testing.assert_allclose(plate.wrench.force[:, 2], 700 + 100 * truth[:, 0], atol=0.02)
    moved = trial.markers.xyz[:, 0, 0] - 0.1 * truth[:, 0]
    np.testing.assert_allclose(moved, moved[0], atol=1e-5)
    assert sum("steps are not equal" in one for one in (*trial.history, *trial.warnings)) == 2
