"""Hide an effect in a session, write it as C3D files, and require that the public way finds it; full set:
`python -m benchmarks diagnosis`.

The hiding side (`biodance.virtual_lab`) knows nothing of the effects; the finding side sees files only.
"""

import json
from pathlib import Path

import pytest
from hidden_faults import MORE, examined, found, hidden
from inject import inject

from biodance.cli import run
from biodance.diagnosis.reasons import Reason
from biodance.identification.physical import FailedFit
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.virtual_lab.causes import fault_of, parse_cause


def test_a_session_without_fault_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    diagnosis = found(hidden(tmp_path / "s"), monkeypatch)
    assert diagnosis.verdict == "nothing wrong"
    assert not diagnosis.findings
    assert all(quality.ok for quality in diagnosis.checks)


def test_late_forces_are_named_by_the_command_also_where_no_body_can_be_identified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "biodance.identification.identification.physical_fit", lambda *_: FailedFit("No possible body, by force.")
    )
    folder = hidden(tmp_path / "s", "time_delay:delay=0.025", trials=("static", "move_1", "move_3"))
    assert run(["diagnose", str(folder), "--accept", "--out", str(tmp_path / "out"), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert set(document["failures"]) == {"segments", "what accepting changes"}
    assert all("by force" in cause for cause in document["failures"].values())
    assert document["masses"] == {"before": None, "accepted": None}
    assert (tmp_path / "out" / "report.html").read_text().count("by force") >= 2
    assert not (tmp_path / "out" / "body.json").exists()
    assert document["verdict"].startswith("named")
    assert any(one["cycles"] for one in document["movement"]["trials"])
    first = document["findings"][0]
    assert (first["effect"], first["target"]) == ("time_delay", "")
    assert first["parameters"]["delay"]["value"] == pytest.approx(0.025, rel=0.25)


def test_a_reference_session_shows_a_load_below_the_limit_of_one_session(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """0.6 kg on a forearm stay unseen against the table (limit 0.79 kg); an unloaded session of that person, another
    day, shows them.
    """
    reference = hidden(tmp_path / "unloaded", trials=MORE)
    session = hidden(tmp_path / "loaded", "added_mass:target=left_forearm_hand,mass=0.6", visit=1, trials=MORE)
    assert run(["diagnose", str(session), "--reference", str(reference), "--out", str(tmp_path / "out"), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    first = document["findings"][0]
    assert (document["verdict"], len(document["findings"])) == ("named, complete", 1)
    assert (first["effect"], first["target"]) == ("added_mass", "left_forearm_hand")
    assert first["parameters"]["mass"]["value"] == pytest.approx(0.6, abs=0.15)
    limits = {(row["effect"], row["target"]): row["limit"] for row in document["limits"]}
    assert limits["added_mass", "left_forearm_hand"] < 0.5


def test_what_no_file_describes_is_unexplained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    diagnosis = found(hidden(tmp_path / "s", "object_on_plate:weight=60"), monkeypatch)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.adequacy[0].z > 4.5


def test_without_the_culprit_nobody_else_is_called_the_whole_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = hidden(tmp_path / "s", "plate_drift:target=Mx,drift=15")
    assert found(folder, monkeypatch, without=("plate_drift",)).verdict in ("unexplained", "named, incomplete")


def test_a_clipped_channel_is_named_before_any_statistics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = hidden(tmp_path / "s", "clipping:target=Fz,limit=640")
    result = examined(folder, monkeypatch)
    diagnosis = diagnose_session(result, effects=("clipping", "plate_offset")).diagnosis
    assert diagnosis.findings[0].effect == "clipping"
    assert [quality.effect for quality in diagnosis.checks if not quality.ok] == ["clipping"]


def standing(data: Path, folder: Path, name: str, text: str = "") -> Path:
    """Write a session of a real person who stands on a plate, with a fault in the file if there is a ``text``."""
    source = data / "biomechzoo" / name / f"{name}01.c3d"
    folder.mkdir()
    inject(
        source,
        folder / "static.c3d",
        fault_of(parse_cause(text), {source.stem: (0.0, 1.0)}) if text else lambda recording: recording,
    )
    return folder


@pytest.mark.parametrize("name", ["HC030A", "HC032A"])
def test_real_standing_is_not_accused_of_a_plate_fault(
    name: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clean = found(standing(data, tmp_path / "clean", name), monkeypatch, without=("labels_swapped",))
    assert not clean.findings
    assert any("centre of mass lies" in note for note in clean.notes)


@pytest.mark.parametrize("name", ["HC030A", "HC032A"])
@pytest.mark.parametrize("text", ["plate_gain:target=plate1:Fz,gain=0.08", "plate_offset:target=plate1:Fz,offset=30"])
def test_a_fault_written_into_real_standing_is_told_as_what_weighing_can_see(
    name: str, text: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Standing shows nothing but weights: a wrong mass, a load, a gain or an offset, all with their right size, and it
    cannot tell which of them.
    """
    diagnosis = found(standing(data, tmp_path / "faulty", name, text), monkeypatch, without=("labels_swapped",))
    assert diagnosis.verdict == "named, incomplete"
    (finding,) = diagnosis.findings
    names = {one.effect for one in finding.set}
    assert (
        {"body_mass", "added_mass", "plate_gain"} <= names <= {"body_mass", "added_mass", "plate_gain", "plate_offset"}
    )
    static = read_session(data / "biomechzoo" / name)
    weight = {"plate_gain": 0.08 * static.subject.mass, "plate_offset": 30 / 9.81}[text.partition(":")[0]]
    size = {"body_mass": weight, "plate_gain": weight / static.subject.mass, "plate_offset": 9.81 * weight}
    assert finding.parameters[0].value == pytest.approx(size[finding.effect], abs=2.5 * finding.parameters[0].sd)
    assert Reason.ONLY_STANDING in diagnosis.why


def test_a_real_walk_gets_no_name_that_feet_and_clocks_exclude(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    diagnosis = found(data / "adl_gait", monkeypatch)
    assert diagnosis.verdict == "nothing wrong"
    assert not diagnosis.findings


def test_exchanged_wrist_labels_of_a_real_recording_are_told(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the static trial and the walk of HC030A the left wrist's bar points the mirrored right one's opposite way."""
    diagnosis = found(standing(data, tmp_path / "s", "HC030A"), monkeypatch)
    assert [(finding.effect, finding.target) for finding in diagnosis.findings] == [("labels_swapped", "LWRA/LWRB")]
    assert not any(
        finding.effect == "labels_swapped"
        for finding in found(standing(data, tmp_path / "t", "HC032A"), monkeypatch).findings
    )
