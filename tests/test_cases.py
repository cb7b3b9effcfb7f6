"""Sixteen small sessions made for one question each (the folder ``cases`` beside the real recordings): what is right of
each stands in its README.
"""

import json
from pathlib import Path

import pytest

from biodance.cli import run
from biodance.errors import BiodanceError
from biodance.lab.inspect import inspect_paths
from biodance.lab.session.read import read_session

FROZEN = {("frozen_markers", label, ()) for label in ("RASI", "LKNE", "RKNE", "C7")}
RIGHT: dict[str, set[tuple[str, str, tuple[str, ...]]]] = {
    "00_control": set(),
    "01_delay_200ms_one_trial": {("time_delay", "", ("squat_1",))},
    "03_delay_100ms_all": {("time_delay", "", ())},
    "04_gain_one_plate_all": {("plate_gain", "plate2", ())},
    "06_plates_exchanged": {("plates_exchanged", "plate1/plate2", ())},
    "08_marker_spikes": {("marker_spikes", label, ()) for label in ("LKNE", "RTIB")},
    "09_padded_start": {("padding", "", ()), ("time_delay", "", ())},  # 32 ms late by Newton, behind the padding
    "19_gap_filled_with_last_value": FROZEN,
    "20_stands_off_centre": set(),
}
"""What is named, by case."""
SAID = {
    "10_parameter_twice": ("ok", ""),
    "11_force_channels_no_plate_group": ("warning", "12 channels (AMTI_1.FX ... AMTI_2.MZ, in V) look like two force"),
    "14_force_file_not_joined": ("ok", ""),
    "15_torque_in_Nmm": ("warning", "The torque columns are 1000 times too large (N mm)"),
    "16_decimal_comma": ("ok", ""),
    "17_scale_applied_twice": ("warning", "Read with ANALOG:SCALE the plates carry 0.1 of the weight"),
}
"""Status and beginning of the reason that `inspect` gives; all but the second weigh the person."""


@pytest.fixture
def cases(data: Path) -> Path:
    folder = data.parent / "cases"
    if not folder.is_dir():
        pytest.skip(f"the folder {folder} with small sessions is missing")
    return folder


@pytest.mark.parametrize("name", RIGHT)
def test_a_session_made_for_one_question_gets_its_answer(name: str, cases: Path, tmp_path: Path) -> None:
    code = run(["diagnose", str(cases / name), "--out", str(tmp_path / "out")])
    found = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    named = {(one["effect"], one["target"], tuple(one.get("trials", ()))) for one in found["findings"]}
    assert named == RIGHT[name]
    assert code == (1 if named else 0)
    assert found["status"] == ("named" if named else "clean")
    assert len(found["attention"][0]["text"].split()) <= 30
    assert sum(row["seconds"] for row in found["judged"]) > 1.0


@pytest.mark.parametrize("name", SAID)
def test_an_odd_file_is_read_or_called_what_it_is(name: str, cases: Path) -> None:
    (record,) = inspect_paths([cases / name])
    status, reason = SAID[name]
    assert record["status"] == status
    assert (record["reason"] or "").startswith(reason)
    if record["plates"]:
        assert record["mass_on_plates_kg"] == pytest.approx(64.0, abs=0.3)


def test_segment_poses_are_no_broken_file(cases: Path) -> None:
    (record,) = inspect_paths([cases / "13_theia_rotations"])
    assert "holds 18 segment poses" in record["reason"]
    assert "The file is sound" in record["reason"]
    with pytest.raises(BiodanceError, match="The file is sound"):
        read_session(cases / "13_theia_rotations")
