"""What `inspect` says: all keys of the contract, plain JSON, the right numbers, on text files and on the real
recordings.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from lab_sessions import GRAVITY, MASS, table_of, write_trial

from biodance.errors import BiodanceError
from biodance.lab.inspect import inspect_file, inspect_paths
from biodance.lab.program_tables import write_mot
from biodance.lab.readers import read_trial
from biodance.lab.readers.trc import write_trc

KEYS = {
    "file", "status", "reason", "format", "frames", "rate_hz", "analog_rate_hz", "markers", "marker_set",
    "gaps_percent", "subjects",
    "plates", "mean_vertical_n", "mass_on_plates_kg", "declared_mass_kg", "declared_height_m", "warnings",
}  # fmt: skip
PLATE_KEYS = {"type", "corners_m", "mean_force_n", "mean_vertical_n", "zero_n", "cop_m", "decisions"}


def test_standing_person_on_one_plate(tmp_path):
    record = inspect_file(write_trial(tmp_path, "static"))
    assert record.keys() >= KEYS
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert (record["status"], record["reason"], record["format"]) == ("ok", None, "TRC + MOT")
    assert (record["frames"], record["rate_hz"], record["analog_rate_hz"]) == (
        100,
        pytest.approx(100),
        pytest.approx(1000),
    )
    assert record["marker_set"] == "plug_in_gait"
    assert record["gaps_percent"] == 0
    assert record["mass_on_plates_kg"] == pytest.approx(MASS, rel=1e-3)
    assert record["mean_vertical_n"] == pytest.approx(MASS * GRAVITY, rel=1e-3)
    (plate,) = record["plates"]
    assert plate.keys() >= PLATE_KEYS
    np.testing.assert_allclose(plate["cop_m"], [0.02, 0.01], atol=1e-4)
    assert np.shape(plate["corners_m"]) == (4, 3)
    assert plate["decisions"]


def test_gaps_are_counted_over_the_markers_of_the_set(tmp_path):
    path = write_trial(tmp_path, "walk", mass=None)
    rows = path.read_text().split("\n")
    cells = rows[6].split("\t")
    rows[6] = "\t".join(cells[:2] + [""] * 3 + cells[5:])
    path.write_text("\n".join(rows))
    assert inspect_file(path)["gaps_percent"] == pytest.approx(100 / (100 * 34))


def test_refused_file_has_all_keys_and_a_reason(tmp_path):
    (tmp_path / "empty.c3d").write_bytes(b"")
    record = inspect_file(tmp_path / "empty.c3d")
    assert record.keys() >= KEYS
    assert record["status"] == "refused"
    assert "is empty" in record["reason"]
    assert json.loads(json.dumps(record, allow_nan=False)) == record


def test_warning_is_the_reason(tmp_path):
    path = write_trial(tmp_path, "walk", mass=None)
    path.write_text(path.read_text().replace("\t100\t34\tmm", "\t101\t34\tmm"))
    record = inspect_file(path)
    assert record["status"] == "warning"
    assert record["reason"] == record["warnings"][0] == "The header announces 101 frames, the file holds 100."


def test_folders_are_searched_through_and_nothing_is_read_twice(tmp_path):
    write_trial(tmp_path / "a" / "b", "static")
    write_trial(tmp_path, "walk", speed=1.0)
    (tmp_path / "notes.txt").write_text("a note")
    (tmp_path / "c").mkdir()
    told = []
    records = inspect_paths([tmp_path, tmp_path / "c", tmp_path / "absent.trc"], tell=told.append)
    assert [Path(r["file"]).name for r in records] == ["static.trc", "walk.trc", "c", "absent.trc"]
    assert [r["status"] for r in records] == ["ok", "ok", "refused", "refused"]
    assert told == ["static.trc", "walk.trc", "absent.trc"]
    with pytest.raises(BiodanceError, match="nothing to inspect"):
        inspect_paths([])


# the real recordings: the expected values are those measured by other means, see the README beside the data


@pytest.mark.parametrize(
    ("subject", "mass", "declared", "stature"),
    [("HC030A", 45.84, 45.8, 1.48), ("HC032A", 60.32, 60.3, 1.58), ("HC038A", 56.77, 56.8, 1.74)],
)
def test_biomechzoo_static(data, subject, mass, declared, stature):
    record = inspect_file(data / "biomechzoo" / subject / f"{subject}01.c3d")
    assert record["mass_on_plates_kg"] == pytest.approx(mass, rel=1e-3)
    assert record["mass_on_plates_kg"] == pytest.approx(declared, rel=3e-3)
    assert record["declared_mass_kg"] == pytest.approx(declared)
    assert record["declared_height_m"] == pytest.approx(stature)
    assert record["subjects"] == [subject]
    assert record["marker_set"] == "plug_in_gait"
    assert (record["rate_hz"], record["analog_rate_hz"]) == (pytest.approx(100), pytest.approx(1000))
    assert [plate["type"] for plate in record["plates"]] == [2, 2]


def test_pycgm_stairs(data):
    record = inspect_file(data / "pycgm" / "Movement_trial.c3d")
    assert record["mean_vertical_n"] == pytest.approx(725, abs=2)  # as stored
    # the four empty plates read 36 N, which every step after this one takes off
    assert sum(plate["zero_n"][2] for plate in record["plates"]) == pytest.approx(36, abs=1)
    assert sum(plate["mean_vertical_n"] for plate in record["plates"]) == pytest.approx(725 - 36, abs=2)
    heights = [np.mean([corner[2] for corner in plate["corners_m"]]) for plate in record["plates"]]
    np.testing.assert_allclose(sorted(heights), [0, 0.195, 0.389, 0.584], atol=1e-3)
    static = inspect_file(data / "pycgm" / "Static_trial.c3d")
    assert abs(static["mean_vertical_n"]) < 20
    assert [plate["cop_m"] for plate in static["plates"]] == [None] * 4
    assert static["mass_on_plates_kg"] is None
    assert static["declared_mass_kg"] == pytest.approx(85)


def test_plates_without_markers(data):
    record = inspect_file(data / "biomdp" / "kistler_COP.c3d")
    assert record["mean_vertical_n"] == pytest.approx(666, abs=2)
    assert record["mass_on_plates_kg"] == pytest.approx(666 / GRAVITY, rel=3e-3)
    assert record["markers"] == []
    assert record["gaps_percent"] is None
    assert record["plates"][0]["type"] == 3


def test_every_real_recording_gives_plain_json(data):
    records = inspect_paths([data])
    assert len(records) >= 16
    for record in records:
        json.dumps(record, allow_nan=False)
        assert record["status"] in ("ok", "warning") or record["reason"]
    refused = [Path(record["file"]).name for record in records if record["status"] == "refused"]
    assert not [name for name in refused if name.endswith(".c3d")]
    assert "Trial1-FxFyFzMxMyMz.asc" in refused  # says neither order nor units nor rate; a TOML beside it must


def test_amti_file(data):
    record = inspect_file(data / "amti" / "AMTIdata.bsf")
    assert record["analog_rate_hz"] == pytest.approx(500)
    assert record["mean_vertical_n"] == pytest.approx(211.8, abs=0.5)


def test_real_recording_survives_the_text_formats(data, tmp_path):
    """Markers and wrench of a walk, through .trc and .mot and back."""
    real = read_trial(data / "biomechzoo" / "HC030A" / "HC030A05.c3d")
    path = write_trc(tmp_path / "walk.trc", real.markers)
    write_mot(tmp_path / "walk.mot", table_of(real.plates))
    again = read_trial(path)
    assert again.marker_set == real.marker_set
    np.testing.assert_allclose(again.markers.xyz, real.markers.xyz, atol=1e-9)
    for plate, original in zip(again.plates, real.plates, strict=True):
        np.testing.assert_allclose(plate.wrench.value, original.wrench.value, atol=1e-5)
        np.testing.assert_allclose(plate.wrench.time, original.wrench.time, atol=1e-8)
