"""The .trc file: round trips, the quirks of real writers, refusals, and OpenSim as the second reader."""

import numpy as np
import pytest

from biodance.errors import FileRefused, TrialRefused
from biodance.lab.readers.trc import read_trc, write_trc
from biodance.records import Markers

NAMES = ("HEAD", "LASI", "RASI", "LTOE")


def walking(frames=50, rate=100.0, start=0.0):
    """Four markers (m, z up) of somebody who walks along x; the second one is hidden for three frames."""
    time = start + np.arange(frames) / rate
    still = np.array([[0.0, 0.0, 1.7], [0.05, 0.12, 1.0], [0.05, -0.12, 1.0], [0.1, 0.1, 0.02]])
    xyz = still + np.stack([1.2 * time, 0.02 * np.sin(5 * time), 0.01 * np.cos(7 * time)], axis=1)[:, None]
    if frames > 10:
        xyz[5:8, 1] = np.nan
    return Markers(NAMES, time, xyz)


def test_what_is_written_is_read_back(tmp_path):
    markers = walking(start=2.5)
    trial = read_trc(write_trc(tmp_path / "walk.trc", markers))
    np.testing.assert_allclose(trial.markers.xyz, markers.xyz, atol=1e-9)
    np.testing.assert_allclose(trial.markers.time, markers.time, atol=1e-9)
    assert trial.markers.names == NAMES
    assert not trial.markers.seen[5:8, 1].any()
    assert trial.markers.seen.sum() == markers.seen.sum()
    assert trial.name == "walk"
    assert trial.source.rate == pytest.approx(100.0)
    assert any("y up" in said for said in trial.history)
    assert trial.warnings == ()


def test_file_holds_millimetres_with_y_up(tmp_path):
    rows = write_trc(tmp_path / "walk.trc", walking()).read_text().splitlines()
    assert rows[2].split("\t")[4] == "mm"
    x, y, z = (float(v) for v in rows[6].split("\t")[2:5])
    assert (x, y, z) == pytest.approx((0.0, 1710.0, 0.0), abs=1e-6)


def test_opensim_reads_the_same_numbers(tmp_path):
    opensim = pytest.importorskip("opensim", reason="OpenSim, the second reader of .trc files, is not installed")
    markers = walking()
    table = opensim.TimeSeriesTableVec3(str(write_trc(tmp_path / "walk.trc", markers)))
    assert tuple(table.getColumnLabels()) == NAMES
    assert table.getTableMetaDataString("Units") == "mm"
    np.testing.assert_allclose(table.getIndependentColumn(), markers.time, atol=1e-9)
    for k, name in enumerate(NAMES):
        column = table.getDependentColumn(name)
        theirs = np.array([[column[t][i] for i in range(3)] for t in range(column.size())]) / 1000
        np.testing.assert_allclose(theirs, markers.xyz[:, k][:, [0, 2, 1]] * [1, 1, -1], atol=1e-9)


def handmade(tmp_path, rows, *, rate="100", unit="mm", names="A\t\t\tB\t\t", frames=None, encoding="utf-8", end="\n"):
    head = [
        "PathFileType\t4\t(X/Y/Z)\tx.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{len(rows) if frames is None else frames}\t2\t{unit}\t{rate}\t1\t{len(rows)}",
        f"Frame#\tTime\t{names}",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
    ]
    path = tmp_path / "hand.trc"
    path.write_bytes((end.join([*head, *rows]) + end).encode(encoding))
    return path


def test_metres_windows_line_ends_and_trailing_tabs(tmp_path):
    rows = ["1\t0.00\t1\t2\t3\t0.5\t0.1\t3\t", "2\t0.01\t1\t2\t3\t\t\t\t"]
    trial = read_trc(handmade(tmp_path, rows, unit="m", end="\r\n", encoding="utf-16"))
    np.testing.assert_allclose(trial.markers["A"][0], [1.0, -3.0, 2.0])
    assert np.isnan(trial.markers["B"][1]).all()


def test_header_values_between_two_tabs(tmp_path):
    path = handmade(tmp_path, ["1\t0\t10\t20\t30\t40\t50\t60"])
    rows = path.read_text().split("\n")
    rows[0], rows[2] = (
        "PathFileType  4\t(X/Y/Z) C:\\data\\",
        "  100.0\t\t  100.0\t\t    1\t\t     2\t\t mm\t  100.0\t      1\t    1",
    )
    path.write_text("\n".join(rows))
    trial = read_trc(path)
    np.testing.assert_allclose(trial.markers["A"][0], [0.01, -0.03, 0.02])
    assert trial.warnings == ()


def test_exact_zeros_are_a_missing_marker(tmp_path):
    trial = read_trc(handmade(tmp_path, ["1\t0\t10\t20\t30\t0\t0\t0"]))
    assert trial.markers.seen.tolist() == [[True, False]]


def test_left_out_frame_comes_back_as_unseen(tmp_path):
    rows = [f"{i + 1}\t{i / 100:.3f}\t{i}\t900\t0\t{i}\t10\t0" for i in range(20) if i not in (7, 8)]
    trial = read_trc(handmade(tmp_path, rows))
    assert trial.markers.time.size == 20
    assert np.flatnonzero(~trial.markers.seen[:, 0]).tolist() == [7, 8]
    np.testing.assert_allclose(np.diff(trial.markers.time), 0.01)
    assert "2 frames are left out" in " ".join(trial.warnings)


def test_left_out_frame_is_found_although_the_frames_were_numbered_anew(tmp_path):
    kept = [i for i in range(30) if i != 11]
    rows = [f"{n + 1}\t{i / 100:.3f}\t{i}\t900\t0\t{i}\t10\t0" for n, i in enumerate(kept)]
    trial = read_trc(handmade(tmp_path, rows))
    assert np.flatnonzero(~trial.markers.seen[:, 0]).tolist() == [11]


def test_time_rounded_to_milliseconds_gives_the_exact_rate(tmp_path):
    rows = [f"{i + 1}\t{i / 120:.3f}\t{i}\t900\t0\t{i}\t10\t0" for i in range(200)]
    trial = read_trc(handmade(tmp_path, rows, rate="120"))
    np.testing.assert_allclose(trial.markers.time, np.arange(200) / 120, atol=1e-12)


def test_header_rate_that_contradicts_the_time_column_is_said(tmp_path):
    rows = [f"{i + 1}\t{i / 60:.6f}\t{i}\t900\t0\t{i}\t10\t0" for i in range(60)]
    trial = read_trc(handmade(tmp_path, rows, rate="100"))
    assert trial.markers.rate == pytest.approx(60.0, rel=1e-4)
    assert "time column was used" in " ".join(trial.warnings)


def test_z_up_file_is_recognised_by_the_person_in_it(tmp_path):
    rows = [f"{i + 1}\t{i / 100}\t{100 * i}\t50\t1750\t{100 * i}\t150\t20" for i in range(10)]
    trial = read_trc(handmade(tmp_path, rows))
    np.testing.assert_allclose(trial.markers["A"][0], [0.0, 0.05, 1.75])
    assert "z up" in " ".join(trial.warnings)


def test_labels_tell_which_axis_points_up(tmp_path):
    """Somebody with arms stretched sideways, in a file with z up: wider than high."""
    head = ["PathFileType\t4\t(X/Y/Z)\tx.trc", "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits"]
    at = {"C7": (0, 0, 1450), "RASI": (100, -120, 950), "LASI": (100, 120, 950), "RKNE": (0, -150, 480)}
    at |= {"LKNE": (0, 150, 480), "RANK": (0, -120, 90), "LANK": (0, 120, 90), "RWRA": (0, -800, 1400)}
    at |= {"LWRA": (0, 800, 1400), "RTOE": (150, -120, 40), "LTOE": (150, 120, 40)}
    numbers = "\t".join(str(x) for point in at.values() for x in point)
    rows = [f"100\t100\t2\t{len(at)}\tmm", "Frame#\tTime\t" + "\t\t\t".join(at), "", f"1\t0\t{numbers}"]
    path = tmp_path / "t_pose.trc"
    path.write_text("\n".join([*head, *rows, f"2\t0.01\t{numbers}"]) + "\n")
    np.testing.assert_allclose(read_trc(path).markers["C7"][0], [0.0, 0.0, 1.45])


def test_repeated_label_gets_a_number(tmp_path):
    trial = read_trc(handmade(tmp_path, ["1\t0\t1\t2\t3\t4\t5\t6"], names="A\t\t\tA\t\t"))
    assert trial.markers.names == ("A", "A_2")
    assert "occurs 2 times" in trial.warnings[0]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"rows": []}, "no frame"),
        ({"rows": ["1\t0\t1\t2\t3\t4\tx\t6"]}, "row 6: 'x' is not a number"),
        ({"rows": ["1\t0\t1\t2\t3\t4\t5\t6\t7"]}, "holds 9 cells, 8 are expected"),
        ({"rows": ["1\t0\t1\t2\t3\t4\t5\t6"], "rate": "0"}, "DataRate"),
        ({"rows": ["1\t0\t1\t2\t3\t4\t5\t6"], "unit": "inch"}, "legal are mm, cm, m"),
        ({"rows": ["1\t0\t1\t2\t3\t900\t5\t6"], "unit": "m"}, "Correct the unit"),
        (
            {"rows": ["1\t0" + "\t.1\t.2\t.3\t.9\t1.7\t.6" * 2], "names": "A\t\t\tB\t\t\tC\t\t\tD\t\t"},
            "lie 0.0015 m apart in the unit 'mm' of the header. Correct the unit",
        ),
        ({"rows": ["1\t0\t1\t2\t3\t4\t5\t6", "2\t0\t1\t2\t3\t4\t5\t6"]}, "does not increase at frame 2"),
        ({"rows": ["1\t0\t1\t2\t3\t4\t5\t6", "oops"]}, "row 7 does not begin with a frame number"),
        ({"rows": ["1\t0\t1\t2\t3\t4\t5\t6"], "names": ""}, "names no marker"),
    ],
)
def test_wrong_file_is_refused_in_a_sentence(tmp_path, change, sentence):
    with pytest.raises(FileRefused, match=sentence) as caught:
        read_trc(handmade(tmp_path, **change))
    assert "hand.trc" in str(caught.value)


def test_nothing_is_overwritten(tmp_path):
    write_trc(tmp_path / "a.trc", walking())
    before = (tmp_path / "a.trc").read_bytes()
    with pytest.raises(FileRefused, match="not overwritten"):
        write_trc(tmp_path / "a.trc", walking(frames=5))
    assert (tmp_path / "a.trc").read_bytes() == before


def test_unequal_steps_are_not_written(tmp_path):
    markers = Markers(("A",), [0.0, 0.01, 0.03], np.zeros((3, 1, 3)))
    with pytest.raises(TrialRefused, match="one rate"):
        write_trc(tmp_path / "a.trc", markers)
