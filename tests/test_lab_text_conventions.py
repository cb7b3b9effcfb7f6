"""Text files as laboratories really write them: decimal commas, torques in N·mm, three numbers in a cell, forces under
another name, (0, 0, 0) for what was not seen, plates that read something while nobody is on them.
"""

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from c3d_files import File, text, whole
from lab_sessions import person, plate, table_of, write_trial

from biodance import read_c3d, read_session, read_trial
from biodance.errors import FileRefused
from biodance.lab.plain_text import with_points
from biodance.lab.program_tables import read_mot, write_mot
from biodance.lab.readers.mot import plates_of
from biodance.lab.readers.trc import beside, read_trc, write_trc
from biodance.observations import recording
from biodance.observations.empty_plate import EmptyPlate
from biodance.records import Markers, Source, Trial

WALK = "opensim_models/raj_walk/walk.mot"


def rewritten(file: Path, to: Path, change, *columns: str) -> Path:
    """Copy a tab-separated table with ``change`` applied to the numbers of some columns (or of all)."""
    rows = file.read_text().split("\n")
    start = rows.index("endheader") + 1
    labels = rows[start].split("\t")
    chosen = [k for k, label in enumerate(labels) if not columns or label in columns]
    for i in range(start + 1, len(rows)):
        row = rows[i].split("\t")
        if len(row) == len(labels):
            for k in chosen:
                row[k] = change(row[k])
            rows[i] = "\t".join(row)
    to.write_text("\n".join(rows))
    return to


def with_commas(path: Path) -> None:
    """Write every number of a file anew as a locale with decimal commas does."""
    head, *rows = path.read_text().split("\n")
    path.write_text("\n".join([head, *(row.replace(".", ",") for row in rows)]))


def test_decimal_commas_are_read_and_said_once(tmp_path: Path) -> None:
    for folder in ("points", "commas"):
        write_trial(tmp_path / folder, "static1")
    for file in (tmp_path / "commas").iterdir():
        with_commas(file)
    points, commas = (read_session(tmp_path / folder) for folder in ("points", "commas"))
    np.testing.assert_array_equal(commas.trials[0].markers.xyz, points.trials[0].markers.xyz)
    np.testing.assert_array_equal(commas.trials[0].wrench.value, points.trials[0].wrench.value)
    assert [note.count("decimal commas") for note in commas.notes].count(1) == 1
    assert "decimal commas" not in " ".join(points.notes)


@pytest.mark.parametrize(
    "rows",
    ["0,5\t1.5\n0,6\t2.5", "1,2,3\n4,5,6", "1, 2, 3\n4, 5, 6", "a,b\tc", "1,5\n2,5"],
    ids=["both in a row", "commas between cells", "commas and blanks", "words", "a single column may be two"],
)
def test_other_commas_stay(rows: str) -> None:
    assert with_points(rows) == (rows, False)


def test_torques_in_newton_millimetres_are_read_as_such_and_said(data: Path, tmp_path: Path) -> None:
    torques = [f"ground_torque_{side}_{axis}" for side in "rl" for axis in "xyz"]
    wrong = rewritten(data / WALK, tmp_path / "walk.mot", lambda cell: f"{1000 * float(cell):.3f}", *torques)
    right, _, silent = plates_of(read_mot(data / WALK), where="right")
    found, _, said = plates_of(read_mot(wrong), where="wrong")
    for one, other in zip(right, found, strict=True):
        np.testing.assert_allclose(other.wrench.value, one.wrench.value, atol=1e-5)
    assert silent == ()
    assert "torque columns are 1000 times too large (N mm)" in said[0]
    assert any(said[0] in read_trial(wrong).warnings for _ in said)


def test_pressure_far_from_the_point_is_no_unit(data: Path, tmp_path: Path) -> None:
    """Torques about the origin written beside the points, too: wrong by metres, but not by a factor."""
    table = read_mot(data / WALK)
    force, point = (np.stack([table[f"ground_force_r_{part}{axis}"] for axis in "xyz"], axis=1) for part in "vp")
    values = table.values.copy()
    columns = [table.columns.index(f"ground_torque_r_{axis}") for axis in "xyz"]
    values[:, columns] += np.cross(np.where(np.abs(force).max(axis=1)[:, None] > 0, point, 0.0), force)
    _, _, said = plates_of(type(table)(table.name, table.columns, table.time, values), where="twice")
    assert said == ()


def test_what_every_empty_row_reads_is_taken_off_and_told(data: Path, tmp_path: Path) -> None:
    true, _, _ = plates_of(read_mot(data / WALK), where="true")
    assert not true[0].tared
    for markers in ("walk.trc", "static.trc"):
        shutil.copy(data / "opensim_models/raj_walk" / markers, tmp_path / markers)
    rewritten(data / WALK, tmp_path / "walk.mot", lambda cell: f"{float(cell) + 15:.6f}", "ground_force_r_vx")
    trial = read_trial(tmp_path / "walk.trc")
    np.testing.assert_allclose(trial.plates[0].zero, [15, 0, 0], atol=1e-6)
    np.testing.assert_allclose(trial.plates[0].wrench.value, true[0].wrench.value, atol=1e-5)
    seen = [one for one in EmptyPlate().observe(recording(trial)) if "taken off" in one.what]
    assert {one.what: round(one.value, 3) for one in seen}["plate1 Fx, taken off"] == 15.0


def vectors(path: Path, labels: list[str], rows: list[list[str]], kind: str = "Vec3") -> Path:
    head = f"DataRate=100\nDataType={kind}\nversion=3\nendheader\n"
    body = "\n".join("\t".join([f"{k / 100:g}", *row]) for k, row in enumerate(rows))
    path.write_text(f"{head}{chr(9).join(['time', *labels])}\n{body}\n")
    return path


@pytest.mark.parametrize("form", ["{},{},{}", "({},{},{})", "~[{},{},{}]"])
def test_three_numbers_in_a_cell_are_a_plate(tmp_path: Path, form: str) -> None:
    row = [form.format(*three) for three in ((10, 700, 5), (0.4, 0, 0.1), (0, 2, 0))]
    table = read_mot(vectors(tmp_path / "forces.sto", ["f1", "p1", "m1"], [row] * 3))
    (found,), said, _ = plates_of(table, where="forces.sto")
    np.testing.assert_allclose(found.wrench.force[0], [10, -5, 700])
    np.testing.assert_allclose(found.wrench.cop()[0], [0.4, -0.1, 0])
    assert any("Vec3" in sentence for sentence in said)


def test_cells_that_are_no_plate_are_called_what_they_are(tmp_path: Path) -> None:
    markers = vectors(tmp_path / "markers.sto", ["LASI", "RASI"], [["0.1,1.0,0.1", "0.1,1.0,-0.1"]] * 3)
    with pytest.raises(FileRefused, match=r"2 quantities of three numbers each .*LASI, RASI.*TRCFileAdapter"):
        read_trial(markers)
    turns = vectors(tmp_path / "turns.sto", ["pelvis_imu"], [["1,0,0,0"]] * 3, "Quaternion")
    with pytest.raises(FileRefused, match=r"orientations \(quaternions\) of 4 numbers in a cell \(pelvis_imu\)"):
        read_trial(turns)


def forces(path: Path) -> Path:
    return write_mot(path, table_of((plate(),)))


def test_forces_whose_stem_goes_on_are_joined(tmp_path: Path) -> None:
    for name in ("walk", "walk_2"):
        write_trc(tmp_path / f"{name}.trc", person())
    first, second = forces(tmp_path / "walk_GRF_2plates.mot"), forces(tmp_path / "walk_2 forces.mot")
    forces(tmp_path / "walk21.mot")
    assert beside(tmp_path / "walk.trc") == first
    assert beside(tmp_path / "walk_2.trc") == second
    assert read_trial(tmp_path / "walk.trc").plates[0].wrench.rate == pytest.approx(1000)
    forces(tmp_path / "walk_GRF_raw.mot")
    assert beside(tmp_path / "walk.trc") is None


def test_forces_under_another_name_are_told_how_to_be_called(tmp_path: Path) -> None:
    write_trc(tmp_path / "static.trc", person())
    forces(tmp_path / "plates_0007.mot")
    said = " ".join(read_session(tmp_path).notes)
    assert "plates_0007.mot looks like the forces of static.trc" in said
    assert "Rename it static_grf.mot" in said
    write_trc(tmp_path / "another.trc", person())
    assert "looks like the forces" not in " ".join(read_session(tmp_path).notes)


def test_origin_is_not_seen_whoever_read_the_file(tmp_path: Path) -> None:
    """Three samples of exact zeros, as 44 of 62,650 are in the recordings of LAAS."""
    markers = person(frames=20)
    xyz = np.array(markers.xyz)
    xyz[[3, 4, 9], [0, 0, 5]] = 0.0
    write_trc(tmp_path / "a.trc", Markers(markers.names, markers.time, xyz))
    stored = np.concatenate([1000 * xyz, np.zeros((*xyz.shape[:2], 1))], axis=2)
    labels = {"LABELS": text(*markers.names), "UNITS": text("mm"), "USED": whole(len(markers.names))}
    (tmp_path / "b.c3d").write_bytes(File(stored, parameters={"POINT": labels}).bytes())
    (tmp_path / "c.zeros").write_text("zeros")
    stick = SimpleNamespace(
        NAME="zeros", EXTENSIONS=(".zeros",), PREFERENCE=1, sniff=lambda head: head == b"zeros",
        read=lambda path, role, subject: Trial(
            "c", role, Markers(markers.names, markers.time, xyz), (), Source(path, "", "zeros", rate=100.0)
        ),
    )  # fmt: skip
    others = read_trial(tmp_path / "c.zeros", readers=[stick])
    for trial in (read_trc(tmp_path / "a.trc"), read_c3d(tmp_path / "b.c3d"), others):
        unseen = {(int(frame), trial.markers.names[marker]) for frame, marker in np.argwhere(~trial.markers.seen)}
        assert unseen == {(3, markers.names[0]), (4, markers.names[0]), (9, markers.names[5])}
    assert any("3 of" in line and "(0, 0, 0)" in line for line in others.history)
