"""The commands identify and export: files, JSON, exit codes, nothing overwritten; the session comes from memory, not
from disk.
"""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from identified_sessions import body, session_result

from biodance.body.export.csv import STANDARD
from biodance.cli import run
from biodance.cli.shared import DONE, NEEDS_A_PERSON, NOT_DONE
from biodance.effects import QualityCheck
from biodance.lab.program_tables import read_mot
from biodance.lab.session.results_folder import check_results
from biodance.pipeline.export import MOTION_FORMATS, legal_formats

SAID = "A and B carry each other's names. Exchange them, or accept the correction."
SWAPPED = QualityCheck(
    "labels of the markers", False, "A and B carry each other's names in fit_0.", "labels_swapped", "A/B"
)


@pytest.fixture
def lab(monkeypatch, tmp_path):
    """Let folder names stand for sessions: ``S01`` and ``bare`` unloaded, ``idle`` without a trial to fit."""
    results = {"S01": session_result(), "bare": session_result(), "idle": session_result(roles=("validate",))}
    for name in results:
        (tmp_path / name).mkdir()
    for room in ("biodance.lab.session.read", "biodance.pipeline.export"):
        monkeypatch.setattr(
            f"{room}.read_session", lambda folder, **_: replace(results[folder.name].session, folder=folder)
        )
    for stages in ("session.followed", "front.followed", "export.examine"):
        monkeypatch.setattr(f"biodance.pipeline.{stages}", lambda session, **_: results[session.folder.name])
    monkeypatch.setattr("biodance.report.write.failed_checks", lambda _: (SWAPPED,))  # it holds no raw plates
    return tmp_path


@pytest.fixture
def no_page(monkeypatch):
    """Spare the drawing of the page."""
    monkeypatch.setattr("biodance.report.write.page", lambda *_, **__: "a page")


def test_identify_writes_page_numbers_and_body(lab, no_page, capsys):
    code = run(["identify", str(lab / "S01"), "--out", str(lab / "out"), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == NEEDS_A_PERSON
    files = ["body.json", "manifest.json", "methods.md", "motions.npz", "report.html", "results.json"]
    assert sorted(path.name for path in (lab / "out").glob("[!.]*")) == files
    assert told == json.loads((lab / "out" / "results.json").read_text())
    assert told["status"] == "solved"
    assert told["attention"][0]["text"] == SAID
    assert run(["identify", str(lab / "S01"), "--out", str(lab / "out")]) == NOT_DONE
    assert "--force" in capsys.readouterr().err
    assert (
        run(["identify", str(lab / "S01"), "--out", str(lab / "out"), "--force", "--reference", str(lab / "bare")])
        == NEEDS_A_PERSON
    )
    out = capsys.readouterr().out
    assert " ".join(out.split()).startswith(SAID)
    assert "trunk with head" in out


def test_nothing_to_identify_is_one_sentence(lab, capsys):
    assert run(["identify", str(lab / "idle"), "--out", str(lab / "out")]) == NOT_DONE
    sentence = capsys.readouterr().err
    assert "role fit" in sentence
    assert "Traceback" not in sentence


def parameters_in(path):
    """Return the standard parameters of an exported table, segment by segment."""
    table = pd.read_csv(path, dtype=str)
    return table[table["quantity"].isin(STANDARD)]["value"].astype(float)


@pytest.mark.parametrize("format", [f for f in legal_formats() if f not in MOTION_FORMATS])
def test_the_identified_body_is_exported_from_session_and_from_results(format, lab, no_page, capsys):
    run(["identify", str(lab / "S01"), "--out", str(lab / "out")])
    files = [lab / f"{name}.{format}" for name in ("S01", "out")]
    for file in files:
        assert run(["export", str(lab / file.stem), "--format", format, "--out", str(file)]) == DONE
    assert files[0].read_bytes() == files[1].read_bytes()
    assert "identified from fit_0" in capsys.readouterr().err
    if format == "csv":
        assert np.array_equal(parameters_in(files[0]), session_result().identification.identification.sip.phi)


def test_a_changed_file_beside_what_is_exported_is_said(lab, no_page, capsys):
    """The body is as the run wrote it and goes; results.json is not. The manifest has the settings of results.json."""
    run(["identify", str(lab / "S01"), "--out", str(lab / "out")])
    found = check_results(lab / "out")
    assert found.whole
    provenance = json.loads((lab / "out" / "results.json").read_text())["provenance"]
    assert found.manifest.settings == provenance["settings"]
    assert found.manifest.commit == provenance["commit"]
    assert run(["export", str(lab / "out"), "--format", "csv", "--out", str(lab / "a.csv")]) == DONE
    assert "not as its run wrote it" not in capsys.readouterr().err
    (lab / "out" / "results.json").write_text((lab / "out" / "results.json").read_text() + " ")
    assert run(["export", str(lab / "out"), "--format", "csv", "--out", str(lab / "b.csv")]) == DONE
    assert "not as its run wrote it: results.json (see biodance verify)" in " ".join(capsys.readouterr().err.split())
    assert (lab / "a.csv").read_bytes() == (lab / "b.csv").read_bytes()


def test_without_identification_the_table_is_exported_and_that_is_said(lab, capsys):
    assert run(["export", str(lab / "idle"), "--format", "csv", "--out", str(lab / "a.csv")]) == DONE
    assert "nothing identified" in capsys.readouterr().err
    assert np.array_equal(parameters_in(lab / "a.csv"), body().sip.phi)


def test_where_to_write_is_checked_before_the_work(lab, monkeypatch, capsys):
    (lab / "old.csv").write_text("mine")
    monkeypatch.setattr("biodance.pipeline.export.export", None)
    for out, said in (("nowhere/a.csv", "there is no such folder. Make it"), ("old.csv", "is not overwritten")):
        assert run(["export", str(lab / "S01"), "--format", "csv", "--out", str(lab / out)]) == NOT_DONE
        assert said in capsys.readouterr().err
    assert (lab / "old.csv").read_text() == "mine"


def test_motion_is_exported_by_trial(lab, capsys):
    out = lab / "a.mot"
    assert run(["export", str(lab / "S01"), "--format", "mot", "--out", str(out)]) == NOT_DONE
    assert "--trial" in capsys.readouterr().err
    assert run(["export", str(lab / "S01"), "--format", "mot", "--trial", "walk", "--out", str(out)]) == NOT_DONE
    assert "Legal: fit_0, validate_1" in capsys.readouterr().err
    assert run(["export", str(lab / "S01"), "--format", "mot", "--trial", "fit_0", "--out", str(out)]) == DONE
    swung = read_mot(out)["left_knee_flexion"]
    assert swung == pytest.approx(
        session_result().trials[0].motion.q[:, 7 + body().joint_index("left_knee_flexion")], abs=1e-8
    )
    assert (
        run(["export", str(lab / "S01"), "--format", "trc", "--trial", "fit_0", "--out", str(lab / "a.trc")])
        == NOT_DONE
    )
    assert "no markers" in capsys.readouterr().err


def test_a_results_folder_is_exported_without_computing_again(lab, no_page, monkeypatch, capsys):
    results, session = str(lab / "kept"), str(lab / "S01")
    assert run(["identify", session, "--out", results]) in (DONE, NEEDS_A_PERSON)
    for name in ("a", "b"):
        source = session if name == "a" else results
        words = ["export", source, "--format", "mot", "--trial", "fit_0", "--out", str(lab / f"{name}.mot")]
        assert run(words) == DONE
        monkeypatch.setattr("biodance.pipeline.export.examine", None)
    assert (lab / "a.mot").read_text() == (lab / "b.mot").read_text()
    assert run(["export", results, "--format", "urdf", "--out", str(lab / "kept.urdf")]) == DONE
    capsys.readouterr()
    assert run(["export", results, "--format", "mot", "--trial", "x", "--out", str(lab / "x.mot")]) == NOT_DONE
    assert "Legal: fit_0, validate_1" in capsys.readouterr().err
    assert run(["export", results, "--format", "c3d", "--trial", "fit_0", "--out", str(lab / "x.c3d")]) == NOT_DONE
    assert "are not there" in capsys.readouterr().err


def test_an_existing_file_is_replaced_only_by_force_and_only_by_a_whole_one(lab, capsys):
    out = lab / "a.urdf"
    out.write_text("old")
    assert run(["export", str(lab / "S01"), "--format", "urdf", "--out", str(out)]) == NOT_DONE
    assert run(["export", str(lab / "S01"), "--format", "obj", "--out", str(out), "--force"]) == NOT_DONE
    assert "Legal: bids, biomod, c3d, csv, glb" in capsys.readouterr().err
    assert out.read_text() == "old"
    assert run(["export", str(lab / "S01"), "--format", "urdf", "--out", str(out), "--force"]) == DONE
    assert out.read_text().startswith("<?xml")
    assert [path.name for path in lab.glob(".*")] == []


def test_tables_lie_beside_the_page(lab, no_page, capsys):
    words = ["identify", str(lab / "S01"), "--out", str(lab / "out"), "--tables", str(lab / "tables")]
    assert run(words) in (DONE, NEEDS_A_PERSON)
    assert {"segments.csv", "segments.parquet", "wrench.csv", "angles.parquet"} <= {
        path.name for path in (lab / "tables").iterdir()
    }
    assert run([*words[:3], str(lab / "more"), *words[4:]]) == NOT_DONE
    assert "--force" in capsys.readouterr().err
