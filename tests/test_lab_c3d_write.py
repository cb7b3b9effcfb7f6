"""Written C3D files read back in three readers; nothing is overwritten."""

import warnings
from dataclasses import replace

import c3d
import ezc3d
import numpy as np
import pytest

from biodance.errors import BiodanceError
from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.lab.readers.c3d import read_c3d
from biodance.records import Markers

RATE, SAMPLES, FRAMES = 100.0, 10, 30
CORNERS = np.array([[0.4, 0.6, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])


def cloud(count=5, frames=FRAMES):
    generator = np.random.default_rng(3)
    places = generator.uniform(0.1, 1.6, (1, count, 3))
    xyz = places + 0.05 * np.sin(np.arange(frames) / 9)[:, None, None]
    xyz[3:5, 1] = np.nan
    return Markers(tuple(f"POINT{i}" for i in range(count)), np.arange(frames) / RATE, xyz)


def plate(kind, frames=FRAMES):
    generator = np.random.default_rng(kind)
    channels = generator.normal(0, 100, (frames * SAMPLES, 8 if kind == 3 else 6))
    matrix = generator.normal(0, 100, (6, 6)) if kind == 4 else None
    return PlateRecording(kind, CORNERS, [0.12, 0.2, -0.04], channels, calibration=matrix)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "written.c3d"


@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_numbers_come_back_in_three_readers(path, kind):
    markers, recording = cloud(), plate(kind)
    write_c3d(path, markers=markers, plates=[recording], analog_rate=1000.0)
    factors = {1: [1, 1, 1, 1000, 1000, 1000], 2: [1, 1, 1, 1000, 1000, 1000], 3: [1] * 8, 4: [1] * 6}[kind]
    analog = recording.channels * factors
    raw = read_raw(path)
    np.testing.assert_allclose(raw.points / 1000, markers.xyz, rtol=2e-7)
    np.testing.assert_allclose(raw.analog, analog, rtol=2e-7)
    assert (raw.rate, raw.analog_rate, raw.warnings) == (RATE, 1000.0, ())
    units = {
        1: ("N", "N", "N", "mm", "mm", "Nmm"),
        2: ("N", "N", "N", "Nmm", "Nmm", "Nmm"),
        3: ("N",) * 8,
        4: ("V",) * 6,
    }
    assert raw.analog_units == units[kind]
    one = ezc3d.c3d(str(path))["data"]
    np.testing.assert_allclose(one["points"][:3].transpose(2, 1, 0), raw.points)
    np.testing.assert_allclose(one["analogs"][0].T, raw.analog)
    with open(path, "rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        frames = list(c3d.Reader(stream).read_frames())
    np.testing.assert_allclose(np.concatenate([a.T for _, _, a in frames]), raw.analog)
    np.testing.assert_allclose([p[:, :3] for _, p, _ in frames], np.nan_to_num(raw.points))


@pytest.mark.parametrize("kind", [2, 3, 4])
def test_another_program_computes_the_same_plates(path, kind):
    recording = plate(kind)
    write_c3d(path, markers=cloud(), plates=[recording, recording], analog_rate=1000.0)
    platform = ezc3d.c3d(str(path), extract_forceplat_data=True)["data"]["platform"]
    assert len(platform) == 2
    np.testing.assert_allclose(platform[1]["corners"], 1000 * CORNERS.T, rtol=1e-6)
    np.testing.assert_allclose(platform[1]["origin"], [120, 200, -40], rtol=1e-6)
    assert platform[0]["unit_moment"] == "Nmm"
    if kind == 4:
        matrix = recording.calibration * np.repeat([1, 1000], 3)[:, None]
        np.testing.assert_allclose(platform[1]["cal_matrix"], matrix, rtol=1e-6)
        turned = platform[0]["force"].T
        expected = (recording.channels @ recording.calibration.T)[:, :3]
        np.testing.assert_allclose(np.linalg.norm(turned, axis=1), np.linalg.norm(expected, axis=1), rtol=1e-5)


def test_parameters_labels_prefix_and_first_frame(path):
    markers = cloud(300, 4)
    said = {
        "PROCESSING": {"Bodymass": 65.0, "Height": 1750.0},
        "SUBJECTS": {"NAMES": ["Anna"]},
        "FORCE_PLATFORM": {"ZERO": [1, 20]},
    }
    write_c3d(
        path,
        markers=replace(markers, names=tuple(f"Anna:{name}" for name in markers.names)),
        plates=[plate(2, 4)],
        analog_rate=1000.0,
        parameters=said,
        first_frame=695,
    )
    raw = read_raw(path)
    assert raw.first_frame == 695
    assert raw.labels == tuple(f"Anna:POINT{i}" for i in range(300))
    assert len(raw.parameters["POINT"]["LABELS2"]) == 45
    assert raw.parameters["FORCE_PLATFORM"]["ZERO"].tolist() == [1, 20]
    assert len(ezc3d.c3d(str(path))["parameters"]["POINT"]["LABELS2"]["value"]) == 45
    trial = read_c3d(path)
    assert trial.markers.names == markers.names
    assert trial.measurements == {"Bodymass": 65.0, "Height": 1.75}


@pytest.mark.parametrize(("frames", "first"), [(1, 1), (40000, 1), (70000, 3)])
def test_short_and_very_long_recordings(path, frames, first):
    markers = Markers(("A", "B"), np.arange(frames) / RATE, np.tile([[1.0, 0.5, 0.2], [0.9, 0.4, 1.5]], (frames, 1, 1)))
    write_c3d(path, markers=markers, analog_rate=RATE if frames == 1 else 0.0, first_frame=first)
    raw = read_raw(path)
    assert (len(raw.points), raw.first_frame, raw.rate, raw.warnings) == (frames, first, RATE, ())
    assert ezc3d.c3d(str(path))["data"]["points"].shape[2] == frames


def test_plates_alone(path):
    write_c3d(path, markers=None, plates=[plate(3)], analog_rate=1000.0)
    raw = read_raw(path)
    assert (raw.points.shape, raw.analog.shape, raw.analog_rate) == (
        (FRAMES * SAMPLES, 0, 3),
        (FRAMES * SAMPLES, 8),
        1000.0,
    )


def test_an_existing_file_is_never_overwritten(path):
    path.write_bytes(b"precious")
    with pytest.raises(BiodanceError, match="exists already"):
        write_c3d(path, markers=cloud())
    assert path.read_bytes() == b"precious"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"plates": [plate(2)], "analog_rate": 900.0}, "do not fit the markers' rate 100"),
        ({"plates": [plate(2, FRAMES + 1)], "analog_rate": 1000.0}, "a whole number per frame"),
        ({"plates": [plate(2), plate(2, 2 * FRAMES)], "analog_rate": 1000.0}, "300, 600"),
        ({"parameters": {"X": {"Y": {"no": "number"}}}}, "X:Y"),
        ({"markers": None}, "nothing to write"),
    ],
)
def test_what_does_not_fit_is_refused(path, options, reason):
    with pytest.raises(BiodanceError, match=reason):
        write_c3d(path, **({"markers": cloud()} | options))
    assert not path.exists()


def test_a_channel_that_is_not_finite_is_refused(path):
    channels = np.zeros((FRAMES, 6))
    channels[7, 2] = np.inf
    with pytest.raises(BiodanceError, match="channel 3 is not finite at sample 7"):
        write_c3d(path, markers=cloud(), plates=[PlateRecording(2, CORNERS, [0, 0, 0], channels)], analog_rate=RATE)


@pytest.mark.parametrize(("kind", "matrix"), [(5, None), (4, None), (2, np.eye(6))])
def test_a_plate_that_cannot_be_written_is_refused(kind, matrix):
    with pytest.raises(BiodanceError, match=f"TYPE {kind}"):
        PlateRecording(kind, CORNERS, [0, 0, 0], np.zeros((5, 6)), calibration=matrix)
