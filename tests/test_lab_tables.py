"""Tables of markers and forces: whatever the spelling, the same person and the same wrench come out, and what was done
is said. The truth is a squat whose wrench the tables were written from.
"""

import numpy as np
import pandas as pd
import pytest
from tables import FORCES, SQUAT, Style, about, jittering, of_both, places, wrenches, write_table
from two_plates import CENTRES, HALF

import biodance
from biodance.errors import FileRefused
from biodance.lab.inspect import init_session, inspect_file
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.plates import Told, ToldPlate
from biodance.lab.readers import read_trial, reader_of
from biodance.lab.readers.table import Load, table_plates

EVEN = 0.2 + np.arange(100) / 60
POINT = np.array([0.9, 0.47, 0.0])
"""m, where the sensor of a plate is about which it gives its moments."""


def one_load(stamps):
    """TableColumns of one plate that carries everything: the load on it, about its own point."""
    value = -about(sum(wrenches(stamps)), POINT)
    return {f"{name}0": value[:, k] for k, name in enumerate(FORCES)}


def strange_quotes(column, cell):
    return ("'" + cell + "''", "'" + cell + "’", "‘" + cell + "’", "'" + cell + "'")[min(column, 3)]


def worst(found, wanted, part):
    return float(np.abs(found[:, part] - wanted[:, part]).max())


def test_three_kinds_of_quotes_and_jittering_seconds_are_read_on_their_own_stamps(tmp_path):
    stamps = jittering(60, 40.0)
    path = write_table(tmp_path / "squat.csv", stamps, one_load(stamps), Style(quoted=strange_quotes))
    trial = read_trial(path)
    assert trial.markers is not None
    assert trial.marker_set == "plug_in_gait"
    at = trial.markers.time + stamps[0]
    np.testing.assert_allclose(np.diff(at), np.median(np.diff(stamps)), rtol=1e-9)
    np.testing.assert_allclose(trial.markers.xyz, places(at), atol=1.5e-3)  # noise of a sample is 0.2 mm
    said = " ".join(trial.history)
    for sentence in ("time in s", "read in mm", "read in N, moments in N·m", "steps are not equal", "noise of single"):
        assert sentence in said
    (plate,) = trial.plates
    assert np.linalg.norm(plate.put - POINT[:2]) < 0.05  # the drawn squat presses behind its feet; people: below
    truth = sum(wrenches(at))
    moved = np.hstack([truth[:, :3], truth[:, 3:] + np.cross([*(plate.put - POINT[:2]), 0.0], truth[:, :3])])
    assert worst(plate.wrench.value, truth, slice(0, 3)) < 4.0
    assert worst(plate.wrench.value, moved, slice(3, 6)) < 2.0
    assert "all of it was turned" in " ".join(plate.decisions)


VARIANTS = {
    "semicolons, decimal commas, points in labels, m, ms": Style(
        ";", ",", "Time [ms]", lambda n, a: f"{n}.{a.upper()}", metres=1.0, seconds=1000.0, digits=5
    ),
    "tabs, blanks in labels, cm": Style("\t", ".", "Timestamp", lambda n, a: f'"{n} {a.upper()} (cm)"', metres=100.0),
    "axes before names, dashes": Style(",", ".", "t (s)", lambda n, a: f"{a}_{n}"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_other_spellings_say_the_same(tmp_path, name):
    columns = of_both(EVEN, lambda part, plate: f"{part}{plate}", own=False)
    trial = read_trial(write_table(tmp_path / "squat.tsv", EVEN, columns, VARIANTS[name]))
    assert trial.markers is not None
    assert trial.markers.names == SQUAT.markers.names
    np.testing.assert_allclose(trial.markers.time, EVEN - EVEN[0], atol=1e-5)
    np.testing.assert_allclose(trial.markers.xyz, places(EVEN), atol=2e-5)
    assert [plate.name for plate in trial.plates] == ["plate1", "plate2"]
    for plate, truth in zip(trial.plates, wrenches(EVEN), strict=True):
        np.testing.assert_allclose(plate.wrench.value, truth, atol=2e-2)
        assert plate.put is None


@pytest.mark.parametrize(
    "label",
    [
        lambda part, plate: f"FP{plate}_{part}",
        lambda part, plate: f"{'Force' if part[0] == 'F' else 'Torque'}_{part[1].upper()}_{plate}",
        lambda part, plate: f"plate{plate}.{part.replace('M', 'T')} [{'N' if part[0] == 'F' else 'N·mm'}]",
    ],
)
def test_plates_by_any_name(tmp_path, label):
    columns = of_both(EVEN, label, own=False)
    factor = 1000 if "[" in label("Fx", 1) else 1
    columns = {name: value * (factor if "mm" in name else 1) for name, value in columns.items()}
    trial = read_trial(write_table(tmp_path / "squat.csv", EVEN, columns, Style()))
    for plate, truth in zip(trial.plates, wrenches(EVEN), strict=True):
        np.testing.assert_allclose(plate.wrench.value, truth, atol=1e-3)


def test_two_plates_of_unknown_place_are_asked_for_and_followed(tmp_path):
    columns = of_both(EVEN, lambda part, plate: f"{part}{plate}", own=True)
    path = write_table(tmp_path / "squat.csv", EVEN, columns, Style())
    shifted = {
        name: c + (0.9 * columns["Fz" + name[-1]] if name.startswith("Mx") else 0) for name, c in columns.items()
    }
    lost = read_trial(write_table(tmp_path / "lost.csv", EVEN, shifted, Style()))
    assert lost.plates == ()
    (said,) = lost.warnings
    assert "does not say where plate1, plate2 lie" in said
    assert "[plates.plate1] corners_m = " in said
    told = Told({name: ToldPlate(corners=HALF + centre) for name, centre in CENTRES.items()})
    trial = read_trial(path, told=told)
    for plate, truth in zip(trial.plates, wrenches(EVEN), strict=True):
        np.testing.assert_allclose(plate.wrench.value, truth, atol=1e-3)
        assert plate.placed


def test_moments_in_millimetres_are_known_by_their_arm(tmp_path):
    columns = of_both(EVEN, lambda part, plate: f"{part}{plate}", own=False)
    columns = {name: value * (1000 if name.startswith("M") else 1) for name, value in columns.items()}
    trial = read_trial(write_table(tmp_path / "squat.csv", EVEN, columns, Style()))
    assert "moments in N·mm" in " ".join(trial.history)
    np.testing.assert_allclose(trial.plates[1].wrench.value, wrenches(EVEN)[1], atol=1e-3)


def test_a_person_lying_along_y_is_turned_up_with_the_forces(tmp_path):
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # y up, as OpenSim has it
    columns = of_both(EVEN, lambda part, plate: f"{part}{plate}", own=False)
    turned = dict(columns)
    for plate in "12":
        for kind in "FM":
            value = np.stack([columns[f"{kind}{axis}{plate}"] for axis in "xyz"], axis=1) @ turn.T
            turned |= {f"{kind}{axis}{plate}": value[:, k] for k, axis in enumerate("xyz")}
    path = write_table(tmp_path / "squat.csv", EVEN, turned, Style(), places(EVEN) @ turn.T)
    trial = read_trial(path)
    np.testing.assert_allclose(trial.markers.xyz, places(EVEN), atol=1e-6)
    np.testing.assert_allclose(trial.plates[0].wrench.value, wrenches(EVEN)[0], atol=1e-3)


def test_parquet_says_the_same(tmp_path):
    csv = write_table(tmp_path / "squat.csv", EVEN, one_load(EVEN), Style())
    pd.read_csv(csv).to_parquet(tmp_path / "squat.parquet")
    one, other = read_trial(csv), read_trial(tmp_path / "squat.parquet")
    np.testing.assert_array_equal(one.markers.xyz, other.markers.xyz)
    np.testing.assert_array_equal(one.plates[0].wrench.value, other.plates[0].wrench.value)


def test_parquet_without_its_library_is_refused_with_its_name(tmp_path, monkeypatch):
    def missing(_):
        raise ImportError("no engine")

    pd.DataFrame({"time": [0.0]}).to_parquet(tmp_path / "a.parquet")
    monkeypatch.setattr(pd, "read_parquet", missing)
    with pytest.raises(FileRefused, match=r"needs pyarrow\. Install it \(pip install pyarrow\)"):
        read_trial(tmp_path / "a.parquet")


def test_unseen_and_impossible_samples_do_not_spread(tmp_path):
    stamps = jittering(60, 40.0)
    xyz = places(stamps)
    xyz[20, 3] = 0.0
    xyz[40, 7] += [0.4, 0.0, 0.0]
    trial = read_trial(write_table(tmp_path / "squat.csv", stamps, one_load(stamps), Style(), xyz))
    at = trial.markers.time + stamps[0]
    seen = np.isfinite(trial.markers.xyz)
    np.testing.assert_allclose(trial.markers.xyz[seen], places(at)[seen], atol=1.5e-3)
    for marker, row in ((3, 20), (7, 40)):
        lost = ~trial.markers.seen[:, marker]
        assert lost[(at > stamps[row - 1]) & (at < stamps[row + 1])].all()
        assert 1 <= lost.sum() <= 4
    said = " ".join(trial.history)
    assert "1 of 2340 samples of markers are (0, 0, 0)" in said
    assert f"{trial.markers.names[7]} jumps by up to 4" in said


def test_a_table_as_a_session_is_begun_without_a_word(tmp_path):
    folder = tmp_path / "visit"
    folder.mkdir()
    still = np.arange(300) / 100
    standing = np.broadcast_to(places(np.array([0.2])), (300, *places(np.array([0.2])).shape[1:]))
    rng = np.random.default_rng(1)
    first = {name: np.full(300, value[0]) for name, value in one_load(np.array([0.2])).items()}
    write_table(folder / "static.csv", still, first, Style(), standing + rng.normal(0, 2e-4, standing.shape))
    stamps = jittering(60, 40.0)
    write_table(folder / "squat.csv", stamps, one_load(stamps), Style())
    session = biodance.read_session(folder)
    assert {trial.name: trial.role for trial in session} == {"static": "static", "squat": "validate"}
    puts = {tuple(trial.plates[0].put) for trial in session}
    assert len(puts) == 1
    assert any("in all trials" in note for note in session.notes)
    weight = -first["Fz0"][0]  # of one moment of the squat, held
    assert session.subject.mass == pytest.approx(weight / 9.80665, abs=0.1)
    found = init_session(folder)
    assert found["marker_set"] == "plug_in_gait"
    assert f"# mass_kg = {weight / 9.80665:.4g}" in (folder / "session.toml").read_text()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda text: text.replace("time,", "frame,", 1), "has no column of time"),
        (lambda text: text.replace("0.233333,", "0.200000,", 1), "the time does not increase at row 3"),
        (lambda text: text.replace("0.233333,", "0.233333,oops", 1), "is not a number"),
        (lambda text: text.replace("\n0.233333,", "\n0.233333,1,", 1), r"row 4 holds \d+ cells"),
    ],
)
def test_wrong_tables_are_refused_in_a_sentence(tmp_path, change, sentence):
    path = write_table(tmp_path / "squat.csv", EVEN, {}, Style())
    path.write_text(change(path.read_text()))
    from biodance.lab.readers.table import read as read_marker_table

    with pytest.raises(FileRefused, match=sentence):
        read_marker_table(path, role="fit")


def test_notes_and_results_are_no_recordings(tmp_path):
    path = tmp_path / "results.csv"
    path.write_text("segment,mass_kg,com_x,com_y,com_z\nthigh,8.1,0,0,-0.2\n")
    with pytest.raises(FileRefused):
        reader_of(tmp_path / "results.csv").read(path, role="fit", subject=None)


def test_the_published_tables_of_a_man_are_read_without_a_word(data):
    trial = read_trial(data / "laas_human" / "raw" / "Trial03.csv")
    assert len(trial.markers.names) == 35
    assert trial.marker_set == "plug_in_gait"
    assert trial.markers.time[-1] == pytest.approx(60.7, abs=0.1)  # one row lies 8.5 s before the others
    said = " ".join(trial.history)
    assert "44 of 62650 samples of markers are (0, 0, 0)" in said
    assert "10 to 7" in said
    assert "1 row apart" in said
    (plate,) = trial.plates
    assert np.nanmean(plate.wrench.force[:, 2]) / 9.81 == pytest.approx(94.4, abs=0.2)
    np.testing.assert_allclose(plate.put, [0.895, 0.475], atol=0.026)  # by hand; twice what standing leaves open
    fx, fy, fz, mx, my, mz = about(plate.wrench.value, np.array([*plate.put, 0.0])).T
    twist = {sign: np.std(mz - (-my / fz * sign * fy - mx / fz * fx)) for sign in (1, -1)}
    assert twist[1] > 30
    assert twist[-1] < 4  # the table's Fy has the wrong sign: told by `diagnose`, not mended when it is read


@pytest.mark.parametrize("name", ["HC032A", "HC044A", "HC055A"])
def test_a_plate_of_known_place_is_found_by_the_feet(data, name):
    """The wrench about the lab's origin is the truth: a plate put by the feet would have to be moved by nothing."""
    trial = read_trial(data / "biomechzoo" / name / f"{name}01.c3d", role="static")
    total = sum(plate.wrench.value for plate in trial.plates)
    time = trial.plates[0].wrench.time
    load = Load("Fx ... Mz", about(total, POINT))
    found = table_plates([load], time, np.eye(3), trial.markers, read_marker_set(trial.marker_set), Told())
    assert np.linalg.norm(found.plates[0].put - POINT[:2]) < 0.03


def test_inspect_says_how_a_table_was_read(data):
    record = inspect_file(data / "laas_human" / "raw" / "Calib01.csv")
    assert record["status"] == "warning"
    said = " ".join(record["history"])
    assert "too far apart to tell a movement between rows" in said
    assert "known to 13 mm" in " ".join(record["plates"][0]["decisions"])
    assert record["mass_on_plates_kg"] is None or record["mass_on_plates_kg"] == pytest.approx(94.4, abs=0.3)
