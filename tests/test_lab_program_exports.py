"""What other programs export: Vicon Nexus, Qualisys QTM, OptiTrack Motive, Motek D-Flow, Cortex. The same squat in the
layout, units, axes and signs of each comes back as it was, and what cannot be trusted is refused in a sentence.
"""

from pathlib import Path

import numpy as np
import pytest
from tables import FORCES, SQUAT, about
from two_plates import CENTRES, HALF

from biodance.errors import FileRefused
from biodance.lab.inspect import inspect_file
from biodance.lab.program_tables import Y_UP_TO_Z_UP
from biodance.lab.readers import read_trial
from biodance.lab.readers.table import columns_in
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.recordings import find_recordings
from biodance.records import Markers, Trial

FRAMES, EACH = 100, 10
TIME = np.arange(FRAMES) / 100
XYZ = np.array(SQUAT.markers.xyz[:FRAMES])
XYZ[20:23, 4] = np.nan
NAMES = SQUAT.markers.names
WRENCHES = [plate.wrench.value[: FRAMES * EACH] for plate in SQUAT.plates]
PLATES = list(zip(CENTRES.values(), WRENCHES, strict=True))
LOCAL = np.diag([1.0, -1.0, -1.0])
"""lab_R_plate of plates whose z points down."""


def rows(values: np.ndarray, separator: str, digits: int = 6) -> list[str]:
    """Return lines of numbers, an empty cell for what was not seen."""
    return [separator.join("" if np.isnan(v) else f"{v:.{digits}f}" for v in row) for row in values]


def loads(centre: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the load on a plate (T, 6) about its centre, and the point of pressure (T, 3) m, in the lab frame."""
    load = -about(value, centre)
    x, y = -load[:, 4] / load[:, 2], load[:, 3] / load[:, 2]
    return load, centre + np.stack([x, y, 0 * x], axis=1)


def nexus(folder: Path, *, change=lambda load: load, moved=0.0, trajectories: bool = True, people=("S01",)) -> Path:
    """Forces in N, N·mm about the plate's centre, ten sub frames a frame, from frame 121 on; pressures ``moved`` m."""
    frames = 121 + np.arange(FRAMES)
    fine = np.column_stack([np.repeat(frames, EACH), np.tile(np.arange(EACH), FRAMES)])
    table = [
        np.hstack([change(one) * [1, 1, 1, 1e3, 1e3, 1e3], 1e3 * (at + moved)])
        for one, at in (loads(*p) for p in PLATES)
    ]
    devices = "".join(f"AMTI #{k} - Force,,,AMTI #{k} - Moment,,,AMTI #{k} - CoP,,," for k in (1, 2))
    axes, units = ",Fx,Fy,Fz,Mx,My,Mz,Cx,Cy,Cz" * 2, ",N,N,N,N.mm,N.mm,N.mm,mm,mm,mm" * 2
    lines = ["Devices", "1000", f",,{devices}EMG - Voltage", f"Frame,Sub Frame{axes},EMG1", f",{units},V"]
    lines += [f"{line},0.01" for line in rows(np.hstack([fine, *table]), ",")]
    lines += ["", "Model Outputs", "100", ",,S01:LHipAngles,,", "Frame,Sub Frame,X,Y,Z", ",,deg,deg,deg", "121,0,1,2,3"]
    if trajectories:
        count = len(NAMES) * len(people)
        names = "".join(f"{one}:{name},,," for one in people for name in NAMES)
        lines += ["", "Trajectories", "100", f",,{names}*17,,", "Frame,Sub Frame" + ",X,Y,Z" * (count + 1)]
        lines += ["," + ",mm" * 3 * (count + 1)]
        values = np.column_stack([frames, 0 * frames, *[1e3 * XYZ.reshape(FRAMES, -1)] * len(people)])
        lines += [f"{line},,," for line in rows(values, ",")]
    (folder / "squat.csv").write_bytes(("\ufeff" + "\r\n".join(lines) + "\r\n").encode())
    return folder / "squat.csv"


def qtm(folder: Path, *, labelled: bool = True, frame: str = "local (force plate)", change=lambda load: load) -> Path:
    """Markers in mm; a file of the load on each plate, along its axes (z down) in N, N·m and mm, with its corners."""
    head = [f"NO_OF_FRAMES\t{FRAMES}", f"NO_OF_MARKERS\t{len(NAMES)}", "FREQUENCY\t100", "TIME_STAMP\t2026-01-05\t9.5"]
    head += ["DATA_INCLUDED\t3D", "EVENT\tstart\t3\t0.02", "MARKER_NAMES\t" + "\t".join(NAMES)]
    head += ["TRAJECTORY_TYPES" + "\tMeasured" * len(NAMES)]
    head += ["Frame\tTime\t" + "\t".join(f"{n} {a}" for n in NAMES for a in "XYZ")] * labelled
    columns = [np.column_stack([np.arange(FRAMES) + 1, TIME])] * labelled
    values = rows(np.hstack([*columns, 1e3 * XYZ.reshape(FRAMES, -1)]), "\t")
    (folder / "squat.tsv").write_text("\n".join([*head, *values]) + "\n")
    for k, (centre, value) in enumerate(PLATES, start=1):
        load, at = loads(centre, value)
        load = np.hstack([load[:, :3] @ LOCAL, load[:, 3:] @ LOCAL, 1e3 * (at - centre) @ LOCAL])
        head = [f"NO_OF_SAMPLES\t{len(load)}", "FREQUENCY\t1000", f"DESCRIPTION\tForce data in {frame} coordinates"]
        head += ["DATA_INCLUDED\tForce", f"FORCE_PLATE_NAME\tForce-plate {k}"]
        places = ("POSX_POSY", "NEGX_POSY", "NEGX_NEGY", "POSX_NEGY")
        for place, corner in zip(places, 1e3 * (HALF @ LOCAL + centre), strict=True):
            head += [f"FORCE_PLATE_CORNER_{place}_{axis}\t{v:.3f}" for axis, v in zip("XYZ", corner, strict=True)]
        names = [f"{part}_{axis}" for part in ("Force", "Moment", "COP") for axis in "XYZ"]
        head += ["SAMPLE\tTIME\t" + "\t".join(names)] * labelled
        fine = np.arange(len(load))
        columns = [np.column_stack([fine + 1, fine / 1000])] * labelled
        lines = [*head, *rows(np.hstack([*columns, change(load)]), "\t")]
        (folder / f"squat_f_{k}.tsv").write_text("\n".join(lines) + "\n")
    return folder / "squat.tsv"


def motive(folder: Path, unit: str = "Meters", metres: float = 1.0) -> Path:
    """Markers y up, beside the pose of a rigid body and the markers that were solved from it; no forces."""
    head = [
        f"Format Version,1.23,Take Name,squat,Export Frame Rate,100,Length Units,{unit},Coordinate Space,Global",
        "",
    ]
    body, many = ["Rigid Body"] * 7 + ["Rigid Body Marker"] * 3, len(NAMES)
    head += [",".join(["", "Type", *body, *["Marker"] * 3 * (many + 1)])]
    head += [",".join(["", "Name", *["Box"] * 10, *(f"S01:{n}" for n in NAMES for _ in "xyz"), *["Unlabeled 9"] * 3])]
    head += [",".join(["", "ID", *["9F"] * (13 + 3 * many)])]
    head += [",".join(["", "", *["Rotation"] * 4, *["Position"] * (9 + 3 * many)])]
    head += ["Frame,Time (Seconds),X,Y,Z,W" + ",X,Y,Z" * (many + 3)]
    values = [
        np.arange(FRAMES),
        TIME,
        *np.full((10, FRAMES), 0.5),
        *(metres * (XYZ @ Y_UP_TO_Z_UP)).reshape(FRAMES, -1).T,
    ]
    lines = [*head, *(f"{line},,," for line in rows(np.column_stack(values), ","))]
    (folder / "squat.csv").write_text("\n".join(lines) + "\n")
    return folder / "squat.csv"


def d_flow(folder: Path) -> Path:
    """Everything at the rate of the cameras, in m, N, N·m, y up: what the ground does, about the lab's origin."""
    labels = ["TimeStamp", "FrameNumber", *(f"{name}.Pos{axis}" for name in NAMES for axis in "XYZ")]
    values = [881.5 + TIME, np.arange(FRAMES), *np.nan_to_num(XYZ @ Y_UP_TO_Z_UP).reshape(FRAMES, -1).T]
    for k, (centre, value) in enumerate(PLATES, start=1):
        parts = (value[::EACH, :3], value[::EACH, 3:], loads(centre, value)[1][::EACH])
        labels += [f"FP{k}.{part}{axis}" for part in ("For", "Mom", "Cop") for axis in "XYZ"]
        values += [column for part in parts for column in (part @ Y_UP_TO_Z_UP).T]
    labels += ["LFoot.RotX", "LFoot.RotY", "LFoot.RotZ", "LHip.Ang"]
    values += [0 * TIME] * 4
    lines = ["\t".join(labels), *rows(np.column_stack(values), "\t")]
    (folder / "squat.txt").write_text("\n".join(lines) + "\n")
    return folder / "squat.txt"


def cortex(folder: Path) -> Path:
    """Markers as .trc; beside them the force of the ground, its point in mm and the moment about it in N·mm."""
    write_trc(folder / "squat.trc", Markers(NAMES, TIME, XYZ))
    head = ["[Force Data]", "NumberOfForcePlates=2", "SampleRate=1000.000000", f"NumberOfSamples={FRAMES * EACH}"]
    head += ["#Sample\t" + "\t".join(f"{c}{k}" for k in (1, 2) for c in ("FX", "FY", "FZ", "X", "Y", "Z", "MZ"))]
    values = [np.arange(FRAMES * EACH) + 1]
    for centre, value in PLATES:
        at = loads(centre, value)[1]
        free = value[:, 5] - (at[:, 0] * value[:, 1] - at[:, 1] * value[:, 0])
        values += [*value[:, :3].T, *1e3 * at.T, 1e3 * free]
    (folder / "squat.forces").write_text("\n".join([*head, *rows(np.column_stack(values), "\t")]) + "\n")
    return folder / "squat.trc"


def check(trial: Trial, *, forces: bool = True) -> None:
    """Check labels, places, gaps, rates and wrenches against what was written."""
    assert trial.markers.names == NAMES
    assert trial.marker_set == "plug_in_gait"
    np.testing.assert_allclose(trial.markers.xyz, XYZ, atol=2e-6)
    np.testing.assert_allclose(trial.markers.time - trial.markers.time[0], TIME, atol=1e-9)
    assert [plate.name for plate in trial.plates] == ["plate1", "plate2"] * forces
    for plate, truth in zip(trial.plates, WRENCHES, strict=False):
        step = round(1000 / plate.wrench.rate)
        np.testing.assert_allclose(plate.wrench.time, np.arange(0, FRAMES * EACH, step) / 1000, atol=1e-9)
        np.testing.assert_allclose(plate.wrench.value, truth[::step], atol=0.02)


WRITERS = {
    "nexus": nexus,
    "qtm": qtm,
    "qtm without labels": lambda folder: qtm(folder, labelled=False),
    "d_flow": d_flow,
    "cortex": cortex,
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_squat_comes_back_from_the_layout_of_each_program(tmp_path, name):
    path = WRITERS[name](tmp_path)
    trial = read_trial(path)
    check(trial)
    assert trial.warnings == ()
    assert trial.source.analog_rate == pytest.approx(100 if name == "d_flow" else 1000)
    assert find_recordings(tmp_path)[0] == [path]


@pytest.mark.parametrize(("unit", "metres"), [("Meters", 1.0), ("Millimeters", 1000.0), ("Centimeters", 100.0)])
def test_motive_gives_the_measured_markers_of_the_person(tmp_path, unit, metres):
    trial = read_trial(motive(tmp_path, unit, metres))
    check(trial, forces=False)
    assert "as the labels say" in " ".join(trial.history)


def test_qtm_says_where_plates_are_and_that_their_load_was_turned(tmp_path):
    trial = read_trial(qtm(tmp_path))
    for plate, centre in zip(trial.plates, CENTRES.values(), strict=True):
        np.testing.assert_allclose(plate.corners, HALF @ LOCAL + centre, atol=1e-9)
        assert plate.placed
        assert "plate's own axes" in plate.decisions[0]
        assert "load on the plate; all of it was turned" in " ".join(plate.decisions)
    with pytest.raises(FileRefused, match="the forces beside it do not say along which axes"):
        read_trial(qtm(tmp_path, frame="unheard-of"))


@pytest.mark.parametrize("signs", [(1, 1, 1, 1, -1, 1), (-1, -1, -1, 1, 1, 1)])
def test_forces_that_contradict_their_own_pressure_are_left_out(tmp_path, signs):
    """A sign or an axis of its own: what the table says of the pressure does not follow from force and moment."""
    trial = read_trial(nexus(tmp_path, change=lambda load: load * np.array(signs)))
    assert trial.plates == ()
    assert len(trial.warnings) == 2
    assert "points of pressure beside it do not follow from its force and moment" in trial.warnings[0]


def test_pressures_that_lie_beside_the_feet_are_in_another_frame(tmp_path):
    trial = read_trial(nexus(tmp_path, moved=np.array([0.9, -0.4, 0.0])))
    assert trial.plates == ()
    assert "m beside the feet, so in another frame than the markers. Export all in the frame" in trial.warnings[1]


@pytest.mark.parametrize("point", [np.array([0.4, -0.3, -0.05]), None], ids=["any point", "each about its pressure"])
def test_moments_are_moved_from_where_the_pressure_says_they_are(tmp_path, point):
    def moved(load):
        centre, value = next(p for p in PLATES if np.allclose(-about(p[1], p[0]), load))
        return -about(value, point) if point is not None else -np.stack(
            [about(one[None], at)[0] for one, at in zip(value, loads(centre, value)[1], strict=True)]
        )  # fmt: skip

    check(read_trial(nexus(tmp_path, change=moved)))


def test_forces_and_pressures_are_no_markers(tmp_path):
    columns = columns_in(["time", *(f"{n}{a}" for n in ("LASI", "RASI", "SACR", "F", "COP") for a in "xyz")])
    assert list(columns.markers) == ["LASI", "RASI", "SACR"]
    assert columns.lone == ("Fx", "Fy", "Fz", "COPx", "COPy", "COPz")
    lines = d_flow(tmp_path).read_text().split("\n")
    lines[0] = lines[0].replace("FP1.MomX", "torque?").replace("FP2.MomX", "torque!")
    (tmp_path / "squat.txt").write_text("\n".join(lines))
    trial = read_trial(tmp_path / "squat.txt")
    assert trial.markers.names == NAMES
    assert "no force was read" in " ".join(trial.warnings)


def test_files_that_cannot_be_read_say_what_they_are(tmp_path):
    visual3d = "\n".join(["\tC:\\walk.c3d" * 6, "\tLASI" * 6, "\tTARGET" * 6, "\tORIGINAL" * 6, "ITEM" + "\tX" * 6])
    for name, text, sentence in (
        ("walk.txt", visual3d + "\n1" + "\t0.5" * 6, "is an export of Visual3D, which says no rate"),
        ("walk.qtm", "QTM\x01", "is a file of Qualisys QTM's own. Export the C3D file"),
        ("walk.tak", "\x02", "is a file of OptiTrack Motive's own"),
    ):
        (tmp_path / name).write_text(text)
        assert sentence in inspect_file(tmp_path / name)["reason"]
    with pytest.raises(FileRefused, match="holds markers of 2 subjects \\(S01, S02\\) and none was chosen"):
        read_trial(nexus(tmp_path, people=("S01", "S02")))
    check(read_trial(tmp_path / "squat.csv", subject="S02"))
    with pytest.raises(FileRefused, match="holds 0 markers"):
        read_trial(nexus(tmp_path, trajectories=False))
    lines = nexus(tmp_path).read_text(encoding="utf-8-sig").split("\n")
    (tmp_path / "squat.csv").write_text("\n".join(lines[:9] + lines[10:]))
    with pytest.raises(FileRefused, match="after frame 121 rows are missing or repeated"):
        read_trial(tmp_path / "squat.csv")


def test_the_order_of_force_columns_is_that_of_their_labels():
    labels = ["time", *(f"FP1_{name}" for name in reversed(FORCES)), *(f"FP1_CoP_{axis}" for axis in "zyx")]
    assert columns_in(labels).plates == ((6, 5, 4, 3, 2, 1, 9, 8, 7),)
