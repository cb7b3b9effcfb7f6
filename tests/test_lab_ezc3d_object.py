"""Trials become objects of ezc3d and come back; a foreign object is read as the file that it would be."""

from pathlib import Path

import ezc3d
import numpy as np
import pytest

from biodance.errors import BiodanceError, FileRefused
from biodance.lab.readers.c3d import from_ezc3d, read_c3d, to_ezc3d
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


def test_a_trial_becomes_an_object_that_ezc3d_understands():
    one = trial()
    file = to_ezc3d(one)
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(points / 1000, one.markers.xyz, rtol=2e-7)
    assert file["header"]["points"]["first_frame"] == 6  # ezc3d counts from 0
    assert file["parameters"]["PROCESSING"]["LLegLength"]["value"] == pytest.approx([870.0])


def test_ezc3d_finds_the_reaction_of_the_ground_in_it(tmp_path):
    one = trial()
    to_ezc3d(one).write(str(tmp_path / "again.c3d"))
    platform = ezc3d.c3d(str(tmp_path / "again.c3d"), extract_forceplat_data=True)["data"]["platform"][0]
    np.testing.assert_allclose(platform["force"].T, one.wrench.force, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(platform["center_of_pressure"].T[:, :2] / 1000, one.wrench.cop()[:, :2], atol=1e-5)


def test_a_trial_comes_back():
    one = trial()
    back = from_ezc3d(to_ezc3d(one), name="walk")
    assert (back.name, back.markers.names, back.source.first_frame) == ("walk", one.markers.names, 7)
    np.testing.assert_allclose(back.markers.xyz, one.markers.xyz, rtol=2e-7)
    np.testing.assert_allclose(back.wrench.value, one.wrench.value, rtol=1e-5, atol=2e-3)
    assert back.measurements["LLegLength"] == pytest.approx(0.87)
    assert back.source.format == "ezc3d object"


def test_an_object_is_not_changed_by_reading_it():
    file = to_ezc3d(trial())
    labels = list(file["parameters"]["POINT"]["LABELS"]["value"])
    from_ezc3d(file)
    assert file["parameters"]["POINT"]["LABELS"]["value"] == labels


def test_what_ezc3d_cannot_write_is_refused():
    file = to_ezc3d(trial())
    file["data"]["points"] = file["data"]["points"][:, :3]
    with pytest.raises(FileRefused, match="ezc3d cannot write this object"):
        from_ezc3d(file)


def test_a_wrench_that_is_not_finite_has_no_object():
    one = trial()
    value = np.array(one.plates[0].wrench.value)
    value[3, 2] = np.nan
    broken = Plate("plate1", 2, DOWN, Wrench(one.plates[0].wrench.time, value))
    with pytest.raises(BiodanceError, match="not finite at sample 3"):
        to_ezc3d(Trial("walk", "fit", one.markers, (broken,), one.source))


def test_real_recordings_read_the_same_through_an_object(data):
    for name in ("biomechzoo/HC030A/HC030A05.c3d", "c3d_parser/dynamic/CB_Dynamic0003.c3d", "pycgm/Movement_trial.c3d"):
        path = data / name
        ours, theirs = read_c3d(path), from_ezc3d(ezc3d.c3d(str(path)))
        assert ours.markers.names == theirs.markers.names
        np.testing.assert_array_equal(theirs.markers.xyz, ours.markers.xyz)
        np.testing.assert_allclose(theirs.wrench.value, ours.wrench.value, rtol=1e-6, atol=1e-6)
