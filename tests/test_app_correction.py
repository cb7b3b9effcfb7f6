"""What a finding's button writes into session.toml, worked out beside the session, of which nothing is touched."""

import hashlib
import tomllib
from pathlib import Path

import pytest
from hidden_faults import hidden

from biodance.app.tasks import CORRECTIONS, proposed_correction
from biodance.effects import SessionEntry
from biodance.errors import BiodanceError
from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.results import write_exchanged


def contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def finding(entry: str, target: str, trials: list[str], **parameters: float) -> dict:
    return {
        "session_entry": entry,
        "target": target,
        "trials": trials,
        "parameters": {key: {"value": value} for key, value in parameters.items()},
    }


@pytest.fixture(scope="module")
def exchanged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session in whose squats the labels of the front of the pelvis are exchanged, left and right."""
    folder = hidden(tmp_path_factory.mktemp("archive") / "S01", trials=("static", "squat_1"))
    file, other = folder / "squat_1.c3d", folder.parent / "squat_1.c3d"
    write_exchanged(file, other, {("LASI", "RASI"): ((0, len(read_raw(file).points)),)})
    other.replace(file)
    return folder


def test_all_that_session_toml_takes_off_is_worked_out() -> None:
    assert set(CORRECTIONS) == set(SessionEntry)


def test_two_labels_are_exchanged_where_they_are_and_markers_and_forces_come_nearer(exchanged: Path) -> None:
    before = contents(exchanged)
    told = proposed_correction(exchanged, [finding("exchange", "LASI/RASI", ["squat_1"])])
    assert contents(exchanged) == before
    assert told["changes"] == [(["trials", "squat_1", "exchange"], [["LASI", "RASI"]])]
    row = next(one for one in told["residuals"] if one["trial"] == "squat_1")
    assert row["after"][6] < 0.5 * row["before"][6]  # mm, markers from the body
    assert row["after"][2] < row["before"][2]


def test_labels_that_are_right_are_not_exchanged(exchanged: Path) -> None:
    with pytest.raises(BiodanceError, match="carry each other's names no more"):
        proposed_correction(exchanged, [finding("exchange", "LKNE/RKNE", ["squat_1"])])


def test_a_mass_is_taken_as_the_plates_have_it(exchanged: Path) -> None:
    told = proposed_correction(exchanged, [finding("mass_kg", "", [], error=2.04)])
    declared = tomllib.loads((exchanged / "session.toml").read_text(encoding="utf-8"))["subject"]["mass_kg"]
    assert told["changes"] == [(["subject", "mass_kg"], pytest.approx(declared + 2.04, abs=0.06))]


def test_plates_that_are_not_there_are_not_exchanged(exchanged: Path) -> None:
    with pytest.raises(BiodanceError, match="no recording has both plates now"):
        proposed_correction(exchanged, [finding("channels", "plate1/plate9", [])])


def test_plates_exchanged_in_some_recordings_alone_are_left_to_copies(exchanged: Path) -> None:
    with pytest.raises(BiodanceError, match="for all recordings alike"):
        proposed_correction(exchanged, [finding("channels", "plate1/plate2", ["squat_1"])])
