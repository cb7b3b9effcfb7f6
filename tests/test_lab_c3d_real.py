"""Real recordings: every number equal to another library's, every fact as measured on the files."""

import io
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from biodance.lab.c3d import raw as c3d
from biodance.lab.c3d import read_header
from biodance.lab.c3d.layout import read_layout
from biodance.lab.c3d.raw import read_raw
from biodance.lab.readers.c3d import read_c3d

ZOO = {"HC030A": ("01", "05", 45.8, 1.48), "HC032A": ("01", "03", 60.3, 1.58), "HC038A": ("01", "11", 56.8, 1.74)}


def opinion(file, raw):
    """What the judge says of a file."""
    content = file.read_bytes()
    layout = read_layout(content, read_header(content, str(file)), raw.parameters, str(file))
    return c3d.second_opinion(file, (raw.points, raw.analog), layout)


def test_the_judge_reads_in_a_process_of_its_own(data):
    for name in ("biomechzoo/HC030A/HC030A01", "biomdp/kistler_COP", "pycgm/Static_trial"):
        file = data / f"{name}.c3d"
        assert opinion(file, read_raw(file)) == "confirmed", name


def test_every_file_has_the_numbers_that_another_library_reads_and_the_judge_confirms_them(data, monkeypatch):
    """Each file is read once by each library: the judge's program runs in this process and takes what is read here."""
    import ezc3d

    other = {}

    def here(_, program, path, *, timeout):
        answer = io.BytesIO()
        with monkeypatch.context() as patch:
            patch.setattr(sys, "argv", ["-c", path])
            patch.setattr(sys, "stdout", SimpleNamespace(buffer=answer))
            patch.setattr(ezc3d, "c3d", lambda name: other[name])
            exec(program, {})
        return subprocess.CompletedProcess(path, 0, answer.getvalue(), b"")

    monkeypatch.setattr(c3d, "run_python", here)
    files = sorted(data.rglob("*.c3d"))
    assert len(files) >= 14
    for file in files:
        other = {str(file): ezc3d.c3d(str(file))}
        raw, second = read_raw(file), other[str(file)]["data"]
        points = second["points"][:3].transpose(2, 1, 0)
        seen = np.isfinite(raw.points)
        assert raw.points.shape == points.shape
        np.testing.assert_array_equal(raw.points[seen], points[seen], err_msg=str(file))
        assert not np.nan_to_num(points[~seen]).any(), file
        analog = second["analogs"][0].T if raw.analog.size else raw.analog
        np.testing.assert_allclose(raw.analog, analog, rtol=1e-12, err_msg=str(file))
        assert opinion(file, raw) == "confirmed", file


@pytest.mark.parametrize("subject", list(ZOO))
def test_walking_children(data, subject):
    static, walk, mass, height = ZOO[subject]
    for trial in (read_c3d(data / "biomechzoo" / subject / f"{subject}{n}.c3d") for n in (static, walk)):
        assert (trial.source.rate, trial.source.analog_rate) == (100.0, 1000.0)
        assert trial.measurements["Bodymass"] == pytest.approx(mass, abs=1e-5)
        assert trial.measurements["Height"] == pytest.approx(height, abs=1e-6)
        assert 0.7 < trial.measurements["LLegLength"] < 1.0
        assert trial.measurements["MarkerDiameter"] == pytest.approx(0.010, abs=0.005)
        assert trial.marker_set == "plug_in_gait"
        assert {"LASI", "SACR", "RTOE", "LFHD"} <= set(trial.markers.names)
        assert not {"LUPA", "RFRM", "LPSI", "LKneeAngles", "CentreOfMass", "PELO"} & set(trial.markers.names)
        assert [plate.type for plate in trial.plates] == [2, 2]
        sides = np.linalg.norm(trial.plates[0].corners[0] - trial.plates[0].corners[[1, 3]], axis=1)
        assert sorted(np.round(sides, 3)) == [0.464, 0.508]
    raw = read_raw(data / "biomechzoo" / subject / f"{subject}{static}.c3d")
    assert len(raw.labels) > 255
    assert "LABELS2" in raw.parameters["POINT"]


def test_stairs(data):
    static, movement = (read_c3d(data / "pycgm" / f"{name}_trial.c3d") for name in ("Static", "Movement"))
    for trial in (static, movement):
        assert (len(trial.markers.names), trial.marker_set) == (39, "plug_in_gait")
        assert trial.markers.seen.all()
        assert (trial.source.rate, trial.source.analog_rate) == (120.0, 1080.0)
        assert (trial.measurements["Bodymass"], trial.measurements["Height"]) == (85.0, 1.679)
        np.testing.assert_allclose([plate.height for plate in trial.plates], [0.0, 0.195, 0.389, 0.584], atol=0.001)
    assert (movement.source.first_frame, static.source.first_frame) == (695, 1)
    vertical = -read_raw(data / "pycgm" / "Movement_trial.c3d").analog[:, 2:24:6].sum(axis=1)
    assert (vertical.mean(), vertical.max()) == (pytest.approx(725, abs=1), pytest.approx(1424, abs=1))


def test_a_lab_with_its_own_labels(data):
    static, walk = (read_c3d(data / "adl_gait" / f"2014001_{name}.c3d") for name in ("ST", "C1_01"))
    assert (len(static.markers.names), len(static.markers.time), static.plates) == (52, 1, ())
    assert (walk.markers.names, len(walk.plates)) == (static.markers.names, 2)
    measures = walk.measurements
    assert (measures["Bodymass"], measures["age"], measures["gender"]) == (67.0, 30.0, 1.0)
    assert (measures["Height"], measures["RLegLength"]) == (pytest.approx(1.655), pytest.approx(0.7312, abs=1e-4))
    assert walk.wrench.force[:, 2].max() == pytest.approx(791, rel=0.02)


def test_a_lab_with_calibration_matrices(data):
    static = read_c3d(data / "c3d_parser" / "static" / "CB_Static0001.c3d")
    dynamic = read_c3d(data / "c3d_parser" / "dynamic" / "CB_Dynamic0003.c3d")
    assert (len(static.markers.names), len(dynamic.markers.names)) == (29, 23)
    assert [plate.type for plate in (*static.plates, *dynamic.plates)] == [4] * 4
    assert (static.source.rate, static.source.first_frame, dynamic.source.first_frame) == (120.0, 181, 102)
    assert static.wrench.force[:, 2].mean() / 9.81 == pytest.approx(36.3, abs=0.4)


def test_plates_without_markers_and_without_a_unit_of_length(data):
    trial = read_c3d(data / "biomdp" / "kistler_COP.c3d")
    assert trial.markers is None
    assert (len(trial.plates), trial.plates[0].type, trial.source.analog_rate) == (1, 3, 1000.0)
    assert any("can only be in mm" in line for line in trial.warnings)
    assert np.nanmean(trial.wrench.force[:, 2]) == pytest.approx(666, rel=0.01)
