"""A trial that was written as a C3D file is what it was, for ezc3d as for our own reader."""

from pathlib import Path

import ezc3d
import numpy as np
import pytest

from biodance.errors import BiodanceError
from biodance.lab.c3d.write import write_trial
from biodance.lab.readers.c3d import read_c3d
from biodance.records import Markers, Plate, Source, Trial, Wrench

RATE, SAMPLES, FRAMES = 100.0, 10, 120
DOWN = np.array([[0.9, 0.6, 0.0], [0.9, 0.2, 0.0], [0.4, 0.2, 0.0], [0.4, 0.6, 0.0]])
"""Corners of a plate whose z points down."""


def trial():
    """Return somebody of 60 kg who shifts the weight on one plate; the first marker is not seen for three frames."""
    rng = np.random.default_rng(4)
    time, fine = np.arange(FRAMES) / RATE, np.arange(FRAMES * SAMPLES) / (RATE * SAMPLES)
    xyz = rng.uniform(0.1, 1.6, (1, 6, 3)) + 0.02 * np.sin(time)[:, None, None]
    xyz[5:8, 0] = np.nan
    force = np.stack([10 * np.sin(fine), 5 * np.cos(fine), 588 + 20 * np.sin(3 * fine)], axis=1)
    place = np.array([0.6, 0.35, 0.0]) + 0.03 * np.sin(fine)[:, None] * [1, 1, 0]
    moment = np.cross(place, force) + np.array([0, 0, 1.5])
    plate = Plate("plate1", 2, DOWN, Wrench(fine, np.hstack([force, moment])))
    source = Source(Path("walk.c3d"), "0" * 64, "C3D", RATE, RATE * SAMPLES, 7)
    names = tuple(f"LAB{i}" for i in range(6))
    return Trial(
        "walk", "fit", Markers(names, time, xyz), (plate,), source, measurements={"Bodymass": 60.0, "LLegLength": 0.87}
    )


def test_ezc3d_reads_what_was_written(tmp_path):
    one, path = trial(), tmp_path / "walk.c3d"
    write_trial(one, path)
    file = ezc3d.c3d(str(path), extract_forceplat_data=True)
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(points / 1000, one.markers.xyz, rtol=2e-7)
    assert file["header"]["points"]["first_frame"] == 6  # ezc3d counts from 0
    assert file["parameters"]["PROCESSING"]["LLegLength"]["value"] == pytest.approx([870.0])
    platform = file["data"]["platform"][0]
    np.testing.assert_allclose(platform["force"].T, one.wrench.force, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(platform["center_of_pressure"].T[:, :2] / 1000, one.wrench.cop()[:, :2], atol=1e-5)


def test_a_trial_comes_back(tmp_path):
    one, path = trial(), tmp_path / "walk.c3d"
    write_trial(one, path)
    back = read_c3d(path)
    assert (back.name, back.markers.names, back.source.first_frame) == ("walk", one.markers.names, 7)
    np.testing.assert_allclose(back.markers.xyz, one.markers.xyz, rtol=2e-7)
    np.testing.assert_allclose(back.wrench.value, one.wrench.value, rtol=1e-5, atol=2e-3)
    assert back.measurements["LLegLength"] == pytest.approx(0.87)


def test_a_wrench_that_is_not_finite_is_not_written(tmp_path):
    one = trial()
    value = np.array(one.plates[0].wrench.value)
    value[3, 2] = np.nan
    broken = Plate("plate1", 2, DOWN, Wrench(one.plates[0].wrench.time, value))
    with pytest.raises(BiodanceError, match="not finite at sample 3"):
        write_trial(Trial("walk", "fit", one.markers, (broken,), one.source), tmp_path / "walk.c3d")
