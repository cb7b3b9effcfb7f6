"""The .mot/.sto table and the force plates in it: round trips, column names of real writers, refusals, OpenSim as
the second reader.
"""

import numpy as np
import pytest
from lab_sessions import table_of

from biodance.errors import FileRefused, TrialRefused, UnknownName
from biodance.lab.program_tables import TimeTable, read_mot, write_mot
from biodance.lab.readers.mot import has_plates, plates_of
from biodance.records import Plate, Wrench

G = 9.81


def plates(frames=200, rate=1000.0):
    """Two plates (m, z up) under somebody of 70 kg who shifts his weight."""
    time = np.arange(frames) / rate
    share = 0.5 + 0.4 * np.sin(2 * np.pi * time / time[-1])
    made = []
    for number, (part, x) in enumerate(((share, 0.2), (1 - share, 0.8)), start=1):
        force = np.stack([20 * np.sin(9 * time), 15 * np.cos(5 * time), 70 * G * part], axis=1)
        cop = np.stack(
            [x + 0.05 * np.sin(3 * time), 0.3 + 0.02 * np.cos(4 * time), np.full(frames, 0.1 * number)], axis=1
        )
        moment = np.cross(cop, force) + np.stack([0 * time, 0 * time, 3 * np.sin(time)], axis=1)
        corners = np.array(
            [
                [x + 0.2, 0.6, 0.1 * number],
                [x - 0.2, 0.6, 0.1 * number],
                [x - 0.2, 0, 0.1 * number],
                [x + 0.2, 0, 0.1 * number],
            ]
        )
        made.append(Plate(f"plate{number}", 2, corners, Wrench(time, np.hstack([force, moment]))))
    return tuple(made)


def test_wrench_survives_the_table_and_the_file(tmp_path):
    truth = plates()
    table = read_mot(write_mot(tmp_path / "f.mot", table_of(truth)))
    read, _, _ = plates_of(table, where="f.mot")
    assert [p.name for p in read] == ["plate1", "plate2"]
    for plate, true in zip(read, truth, strict=True):
        np.testing.assert_allclose(plate.wrench.value, true.wrench.value, atol=1e-6)
        np.testing.assert_allclose(plate.wrench.time, true.wrench.time, atol=1e-12)
        assert plate.height == pytest.approx(true.height, abs=1e-9)
        assert any("corners enclose" in said for said in plate.decisions)


def test_opensim_reads_the_same_table(tmp_path):
    opensim = pytest.importorskip("opensim", reason="OpenSim, the second reader of .mot files, is not installed")
    table = table_of(plates())
    theirs = opensim.TimeSeriesTable(str(write_mot(tmp_path / "f.mot", table)))
    assert tuple(theirs.getColumnLabels()) == table.columns
    np.testing.assert_allclose(theirs.getIndependentColumn(), table.time, atol=1e-12)
    np.testing.assert_allclose(theirs.getMatrix().to_numpy(), table.values, rtol=1e-9, atol=1e-9)


def test_opensim_writes_what_we_read(tmp_path):
    opensim = pytest.importorskip("opensim", reason="OpenSim, the second writer of .sto files, is not installed")
    theirs = opensim.TimeSeriesTable(
        [0.0, 0.01, 0.03], opensim.Matrix.createFromMat(np.arange(6.0).reshape(3, 2)), ["hip_flexion_r", "pelvis_tx"]
    )
    theirs.addTableMetaDataString("inDegrees", "yes")
    opensim.STOFileAdapter.write(theirs, str(tmp_path / "q.sto"))
    table = read_mot(tmp_path / "q.sto")
    assert table.columns == ("hip_flexion_r", "pelvis_tx")
    assert table.in_degrees
    assert table.name == "q"
    np.testing.assert_allclose(table.time, [0.0, 0.01, 0.03])
    np.testing.assert_allclose(table["pelvis_tx"], [1.0, 3.0, 5.0])


def test_force_goes_up_along_y_in_the_file():
    table = table_of(plates())
    assert table["ground_force_1_vy"].mean() > 300
    assert table["ground_force_1_py"] == pytest.approx(0.1)
    assert table["ground_force_1_pz"] == pytest.approx(-0.3)


@pytest.mark.parametrize(
    "columns",
    [
        ("ground_force_v{a}", "ground_force_p{a}", "ground_torque_{a}"),
        ("1_ground_force_v{a}", "1_ground_force_p{a}", "1_ground_torque_{a}"),
        ("R_ground_force_v{a}", "R_ground_force_p{a}", "R_ground_torque_{a}"),
        ("ground_force_right_v{a}", "ground_force_right_p{a}", "ground_moment_right_m{a}"),
        ("ground_force_1_v{a}", "ground_force_1_p{a}", "ground_force_1_m{a}"),
    ],
)
def test_column_names_of_real_writers(columns):
    labels = tuple(part.format(a=a) for part in columns for a in "xyz")
    row = [10.0, 700.0, 5.0, 0.4, 0.0, 0.1, 0.0, 2.0, 0.0]
    (plate,), said, _ = plates_of(TimeTable("t", labels, [0.0, 0.01], [row, row]), where="f")
    np.testing.assert_allclose(plate.wrench.force[0], [10, -5, 700])
    np.testing.assert_allclose(plate.wrench.cop()[0], [0.4, -0.1, 0.0])
    assert plate.wrench.moment[0, 2] == pytest.approx(0.4 * -5 - -0.1 * 10 + 2.0)
    assert any("y up" in sentence for sentence in said)


LABELS = tuple(part + a for part in ("ground_force_v", "ground_force_p", "ground_torque_") for a in "xyz")


def one_plate(row, time=(0.0, 0.01, 0.02, 0.03)):
    return TimeTable("t", LABELS, time, [row] * len(time))


def test_load_on_the_plate_is_turned_to_reaction_and_said():
    (plate,), said, _ = plates_of(one_plate([0.0, -700.0, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0, 0.0]), where="f")
    assert plate.wrench.force[0, 2] == pytest.approx(700)
    assert plate.wrench.cop()[0, 0] == pytest.approx(0.4)
    assert any("sign was turned" in sentence for sentence in said)


def test_z_up_table_is_taken_as_it_is():
    (plate,), _, _ = plates_of(one_plate([0.0, 0.0, 700.0, 0.4, 0.1, 0.0, 0.0, 0.0, 0.0]), where="f")
    np.testing.assert_allclose(plate.wrench.force[0], [0, 0, 700])


def test_nan_point_without_force_is_no_fault():
    (plate,), _, _ = plates_of(
        TimeTable("t", LABELS, [0.0, 0.01], [[0, 700, 0, 0.4, 0, 0.1, 0, 0, 0], [0, 0, 0, *[np.nan] * 3, 0, 0, 0]]),
        where="f",
    )
    assert np.isfinite(plate.wrench.value).all()
    assert plate.wrench.value[1] == pytest.approx(0)


def test_plate_that_is_never_loaded_is_left_out_and_said():
    found, said, _ = plates_of(one_plate([0.0, 3.0, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0, 0.0]), where="f")
    assert found == ()
    assert any("never loaded" in sentence for sentence in said)


def test_unequal_steps_are_interpolated_and_said():
    (plate,), said, _ = plates_of(
        one_plate([0.0, 700.0, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0, 0.0], time=(0.0, 0.01, 0.02, 0.05, 0.06)), where="f"
    )
    np.testing.assert_allclose(np.diff(plate.wrench.time), 0.01)
    assert plate.wrench.time[-1] == pytest.approx(0.06)
    np.testing.assert_array_equal(np.isnan(plate.wrench.force[:, 2]), [False, False, False, True, True, False, False])
    assert any("not equal" in sentence for sentence in said)


def test_time_that_is_rounded_still_has_equal_steps():
    time = np.round(np.arange(600) / 600, 4)
    (plate,), said, _ = plates_of(
        one_plate([0.0, 700.0, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0, 0.0], time=tuple(time)), where="f"
    )
    assert plate.wrench.rate == pytest.approx(600, rel=1e-4)
    np.testing.assert_allclose(np.diff(plate.wrench.time), 1 / 600, rtol=1e-3)
    assert not any("not equal" in sentence for sentence in said)


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ([0.0, np.nan, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0, 0.0], "force or torque is NaN at 0 s"),
        ([0.0, 700.0, 0.0, np.nan, 0.0, 0.1, 0.0, 0.0, 0.0], "point of application is NaN at 0 s although"),
        ([0.0, 700.0, 0.0, 400.0, 0.0, 100.0, 0.0, 0.0, 0.0], "must be in metres"),
    ],
)
def test_untrustworthy_forces_are_refused(row, sentence):
    with pytest.raises(FileRefused, match=sentence):
        plates_of(one_plate(row), where="f.mot")


def test_coordinates_are_no_plates():
    table = TimeTable("t", ("hip_flexion_r", "pelvis_tx"), [0.0], [[1.0, 2.0]])
    assert not has_plates(table.columns)
    with pytest.raises(FileRefused, match="no force plate"):
        plates_of(table, where="q.mot")
    with pytest.raises(UnknownName, match="hip_flexion_r"):
        table["hip_flexion_l"]


def test_old_header_and_blank_separated_columns(tmp_path):
    path = tmp_path / "old.sto"
    path.write_text(
        "old\ndatacolumns 3\ndatarows 3\notherdata 1\nrange 0 1\nendheader\ntime a b\n0 1 2\n0.5 3 4\n1 nan 6\n"
    )
    table = read_mot(path)
    np.testing.assert_array_equal(table["a"], [1, 3, np.nan])
    assert not table.in_degrees
    assert table.warnings == ()


def test_cut_file_is_said(tmp_path):
    path = tmp_path / "cut.mot"
    path.write_text("x\nnRows=3\nendheader\ntime\ta\n0\t1\n1\t2\n")
    assert read_mot(path).warnings == ("The header announces 3 rows, the file holds 2.",)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time\ta\n0\t1\n", "no row 'endheader'"),
        ("x\nendheader\ntime\ta\n", "no row of numbers"),
        ("x\nendheader\n", "the first column is missing"),
        ("x\nendheader\nframe\ta\n0\t1\n", "must be 'time'"),
        ("x\nendheader\ntime\ta\n0\t1\t2\n", "row 4: holds 3 cells, 2 are expected"),
        ("x\nendheader\ntime\ta\n0\tone\n", "row 4: 'one' is not a number"),
        ("x\nendheader\ntime\ta\n0\t1\n0\t1\n", "does not increase at row 5"),
        ("", "is empty"),
    ],
)
def test_wrong_file_is_refused_in_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "bad.mot"
    path.write_text(text)
    with pytest.raises(FileRefused, match=sentence):
        read_mot(path)


def test_nan_is_not_written(tmp_path):
    with pytest.raises(TrialRefused, match="column b is nan at"):
        write_mot(tmp_path / "f.sto", TimeTable("t", ("a", "b"), [0.0, 0.5], [[1, 2], [3, np.nan]]))
    assert not (tmp_path / "f.sto").exists()


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "f.sto").write_text("mine")
    with pytest.raises(FileRefused, match="not overwritten"):
        write_mot(tmp_path / "f.sto", TimeTable("t", ("a",), [0.0], [[1.0]]))
    assert (tmp_path / "f.sto").read_text() == "mine"
