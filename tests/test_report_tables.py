"""Tables hold the numbers of the records, in both files alike; no folder of the user's is written over."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from example_results import full_session
from identified_sessions import session_result

from biodance.diagnosis.accept import Gain
from biodance.diagnosis.consequence import Adequacy
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Unobservable
from biodance.errors import SessionRefused
from biodance.pipeline.movement import describe_movement
from biodance.report.files import tables_folder, write_tables
from biodance.report.tables.session import session_tables

GAIN = Gain(np.ones(6), np.full(6, 0.8), (0.1, 0.3), ("squat_1",))
DIAGNOSIS = Diagnosis(
    True,
    (
        Finding(
            "joint_centre",
            "right_hip",
            tuple(Estimate(f"shift_{a}", v, 0.001, "m") for a, v in zip("xyz", (0.02, 0.0, -0.01), strict=True)),
            (Alias("joint_centre", "right_hip", 12.5),),
            0.6,
            gain=GAIN,
            advice="Palpate again.",
        ),
    ),
    adequacy=(Adequacy("Fx", (0.5, 2.0), 3.2, "squat_1", 4.5),),
    unobservable=(Unobservable("lab_tilt", "", 0.05, "rad"),),
)


@pytest.fixture(scope="module")
def result():
    return session_result()


@pytest.fixture(scope="module")
def tables(result):
    return session_tables(result, DIAGNOSIS)


def test_angles_are_degrees_by_frame(result, tables):
    one, table = result.trials[0], tables["angles"]
    mine = table[table.trial == one.trial.name]
    np.testing.assert_array_equal(mine.time_s, one.motion.time)
    expected = 180 / np.pi * one.motion.q[:, 7 + result.body.joint_index("left_knee_flexion")]
    np.testing.assert_allclose(mine.left_knee_flexion_deg, expected, rtol=1e-14)
    assert len(table) == sum(trial.motion.time.size for trial in result.trials)


def test_the_wrench_stands_three_times_and_its_rms_is_the_records(result, tables):
    table = tables["wrench"]
    for one in result.trials:
        mine = table[(table.trial == one.trial.name) & table.used]
        left = (
            mine[[f"measured_{c}_N" for c in ("Fx", "Fy", "Fz")]].to_numpy()
            - mine[[f"table_{c}_N" for c in ("Fx", "Fy", "Fz")]].to_numpy()
        )
        np.testing.assert_allclose(np.sqrt(np.mean(left**2, axis=0)), one.comparison.rms[:3], rtol=1e-9)
    fitted, kept = result.identification.fitted[0], result.identification.validations[0]
    mine = table[(table.trial == fitted.name) & table.used]
    left = mine.measured_Fz_N - mine.identified_Fz_N
    assert np.sqrt(np.mean(left**2)) == pytest.approx(fitted.identified_agreement.rms[2], rel=1e-6)
    mine = table[table.trial == kept.name]  # beside it a kept trial is predicted with what the plates are known to read
    plates = kept.identified.value[:, 2] - mine.identified_Fz_N
    assert 0 < np.abs(plates).max() < 5


def test_segments_are_the_identified_ones(result, tables):
    table, sip = tables["segments"].set_index("segment"), result.identification.identification.sip
    np.testing.assert_allclose(table.mass_kg, sip.mass)
    np.testing.assert_allclose(table[["com_x_m", "com_y_m", "com_z_m"]], sip.com, atol=1e-12)
    assert table.mass_kg_table.sum() == pytest.approx(62.0)
    assert ((table.mass_kg_from_data >= 0) & (table.mass_kg_from_data <= 1)).all()


def test_findings_are_one_row_a_parameter(tables):
    table = tables["findings"]
    assert list(table.parameter) == ["shift_x", "shift_y", "shift_z"]
    np.testing.assert_array_equal(table.value, [0.02, 0.0, -0.01])
    assert set(table.gain_low) == {0.1}
    assert set(table.log_bayes_factor) == {12.5}
    assert tables["adequacy"].iloc[0].to_dict() == {
        "channel": "Fx",
        "band_low_hz": 0.5,
        "band_high_hz": 2.0,
        "z": 3.2,
        "trial": "squat_1",
        "second_s": 4.5,
    }
    assert list(tables["unobservable"].limit) == [0.05]


def test_markers_and_checks_of_a_full_session():
    session = full_session()
    tables = session_tables(session)
    fit = session.trials[0].fit
    mine = tables["markers"][tables["markers"].trial == session.trials[0].trial.name].set_index("marker")
    np.testing.assert_allclose(mine.rms_m[list(fit.names)], fit.rms)
    assert mine.gaps_percent["M06"] == 100.0
    assert len(tables["checks"]) == len(session.all_checks)
    assert not tables["checks"].inside.all()
    assert "findings" not in tables


def test_a_session_in_which_nothing_worked_has_tables_with_columns():
    session = full_session()
    nothing = replace(
        session,
        trials=tuple(replace(t, fit=None, motion=None, comparison=None, gaps=()) for t in session.trials),
        checks=(),
    )
    tables = session_tables(replace(nothing, identification=None))
    assert len(tables["angles"]) == 0
    assert list(tables["markers"].columns) == ["trial", "marker", "rms_m", "max_m", "gaps_percent", "longest_gap_s"]
    assert tables["trials"].marker_rms_m.isna().all()


def test_csv_and_parquet_hold_the_same(tables, tmp_path):
    paths = write_tables(tables, tmp_path)
    assert {path.stem for path in paths} == set(tables)
    for name, table in tables.items():
        parquet = pd.read_parquet(tmp_path / f"{name}.parquet")
        csv = pd.read_csv(tmp_path / f"{name}.csv")
        assert list(parquet.columns) == list(csv.columns) == list(table.columns)
        for column in table.select_dtypes("number"):
            np.testing.assert_array_equal(parquet[column], table[column])
            np.testing.assert_array_equal(csv[column], table[column])  # every digit is written
    assert not [path for path in tmp_path.iterdir() if path.suffix == ".part"]


def test_no_folder_of_the_users_is_written_over(tmp_path):
    session = tmp_path / "S01"
    session.mkdir()
    for folder, said in ((session, "among the recordings"), (tmp_path, "among the recordings")):
        with pytest.raises(SessionRefused, match=said):
            tables_folder(folder, session, force=True)
    (tmp_path / "file").write_text("x")
    with pytest.raises(SessionRefused, match="is a file"):
        tables_folder(tmp_path / "file", session, force=True)
    folder = tables_folder(tmp_path / "out" / "tables", session, force=False)
    (folder / "wrench.csv").write_text("mine")
    with pytest.raises(SessionRefused, match="--force"):
        tables_folder(folder, session, force=False)
    assert tables_folder(folder, session, force=True) == folder
    (folder / "thesis.docx").write_text("mine")
    with pytest.raises(SessionRefused, match=r"thesis\.docx"):
        tables_folder(folder, session, force=True)


def test_the_lines_of_the_guide_make_xarrays(result, tmp_path, monkeypatch):
    pytest.importorskip("xarray", reason="xarray is not installed")
    (tmp_path / "Session1-tables").mkdir()
    name = result.trials[0].trial.name
    movement = describe_movement(result)
    write_tables(session_tables(result, movement=movement), tmp_path / "Session1-tables")
    monkeypatch.chdir(tmp_path)
    guide = (Path(__file__).parents[1] / "docs" / "guide" / "movement.md").read_text()
    (lines,) = re.findall(r"```python\n(angles = .*?)```", guide, flags=re.DOTALL)
    made = {"pd": pd}
    exec(lines.replace("walk_1", name), made)
    motion = result.trials[0].motion
    np.testing.assert_array_equal(made["walk"].time_s, motion.time)
    flexion = 180 / np.pi * motion.q[:, 7 + result.body.joint_index("left_knee_flexion")]
    np.testing.assert_allclose(made["walk"].left_knee_flexion_deg, flexion, rtol=1e-12)
    moved = next(one for one in movement if one.cycles)
    group = moved.curve("knee_flexion", "left")
    held = made["repetitions"].sel(trial=moved.trial, quantity="knee_flexion", side="left")
    np.testing.assert_allclose(held.dropna("cycle", how="all"), group.values, rtol=1e-12)
