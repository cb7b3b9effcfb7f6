"""The command line: exit codes, one sentence instead of a traceback, JSON alone on stdout, nothing overwritten,
nothing heavy imported.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bad_sessions import UNREADABLE, bad_session

from biodance.cli import run
from biodance.cli.shared import DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED
from biodance.errors import BiodanceError
from biodance.lab.session.archive import archive_folders
from biodance.lab.session.read import read_session

KEPT = ("methods.md", "motions.npz", "scaled_body.json", "body.json")
"""Files beside page and numbers that export and a paper need."""

COMPARED = 100 - 2 * 17
"""Frames of one second at 100 Hz away from its ends: half a period of a cut-off of 3 Hz."""


def biodance(*words):
    """Run the command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "biodance", *map(str, words)], capture_output=True, text=True, timeout=120, check=False
    )


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return bad_session(tmp_path_factory.mktemp("lab") / "bad")


@pytest.fixture(scope="module")
def reported(session):
    """Return the process that reported the bad session, and the folder it wrote to."""
    out = session.parent / "report"
    return biodance("report", session, "--out", out, "--json"), out


def test_help_names_every_command_and_imports_nothing_heavy():
    heavy = "{'numpy', 'scipy', 'ezc3d', 'matplotlib', 'pydantic'}"
    code = f"import sys; from biodance.cli import run; run(['--help']); print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(f"│ {command} " in done.stdout for command in ("demo", "doctor", "inspect", "report", "simulate"))


def test_help_is_in_groups_with_every_command_in_one_and_rare_options_apart(capsys):
    run(["--help"])
    own, session, laboratory, dances, advanced = capsys.readouterr().out.split("╭─ ")[1:]
    assert "--version" in own
    assert session.startswith("A session ─")
    assert all(f"│ {name} " in session for name in ("app", "report", "compare"))
    assert laboratory.startswith("A laboratory ─")
    assert "│ dance " in dances
    assert "│ identify " in advanced
    run(["identify", "--help"])
    usual, robots, rare = capsys.readouterr().out.split("╭─ ")[1:]
    assert "--out" in usual
    assert "--urdf" in robots
    assert "--set" in rare


def test_a_bad_session_is_reported_all_the_same(reported):
    done, out = reported
    assert done.returncode == NEEDS_A_PERSON, done.stderr
    assert "Traceback" not in done.stderr
    assert json.loads(done.stdout) == json.loads((out / "results.json").read_text())
    written = {path.name for path in out.iterdir()}
    assert (
        {"report.html", "results.json", "methods.md"}
        <= written
        <= {*KEPT, "report.html", "results.json", "manifest.json"}
    )


def test_every_bad_file_has_its_sentence_and_the_good_ones_their_numbers(reported):
    found = json.loads(reported[0].stdout)
    assert sorted(found["refused"]) == sorted(f"{name}.c3d" for name in UNREADABLE)
    trials = {trial["name"]: trial for trial in found["trials"]}
    expected = {
        "no_plates": "no usable force plate",
        "no_markers": "no markers",
        "unknown_set": "no known marker set",
        "bow_tie": "bow-tie",
    }
    for name, words in expected.items():
        assert trials[name]["status"] == "warning"
        assert words in trials[name]["reason"]
        assert trials[name]["wrench"] is None
    for name, frames in (("static", 100), ("walk", COMPARED)):
        assert trials[name]["wrench"]["frames_used"] == frames
        assert trials[name]["marker_rms_m"] < 0.005
    steps = [step for trial in found["trials"] for step in trial["steps"]] + found["steps"]
    assert not [step for step in steps if step["status"] == "failed"]
    assert found["mass_check"]["difference_percent"] == pytest.approx(0, abs=0.3)


@pytest.mark.parametrize("name", UNREADABLE)
def test_an_unreadable_file_alone_is_not_done(session, tmp_path, capsys, name):
    shutil.copy(session / f"{name}.c3d", tmp_path)
    assert run(["inspect", str(tmp_path / f"{name}.c3d")]) == NOT_DONE
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert run(["report", str(tmp_path), "--out", str(tmp_path / "out")]) == NOT_DONE
    sentence = capsys.readouterr().err.strip()
    assert f"{name}.c3d" in sentence
    assert len(sentence.splitlines()) == 1
    assert not (tmp_path / "out" / "results.json").exists()


def test_inspect_prints_one_json_document(session, capsys):
    code = run(["inspect", str(session), "--json"])
    printed = capsys.readouterr()
    records = {record["file"].rpartition("/")[2]: record for record in json.loads(printed.out)}
    assert code == NEEDS_A_PERSON
    assert len(records) == 9
    assert [name for name, record in sorted(records.items()) if record["status"] == "refused"] == sorted(
        f"{n}.c3d" for n in UNREADABLE
    )
    assert run(["inspect", str(session / "static.c3d"), "--json"]) == DONE


def test_nothing_is_overwritten_without_force(session, tmp_path, capsys):
    small, out = tmp_path / "small", tmp_path / "out"
    small.mkdir()
    for name in ("static.c3d", "session.toml"):
        shutil.copy(session / name, small)
    assert run(["report", str(small), "--out", str(out)]) in (DONE, NEEDS_A_PERSON)
    before = (out / "results.json").stat().st_mtime_ns
    assert run(["report", str(small), "--out", str(out)]) == NOT_DONE
    assert "--force" in capsys.readouterr().err
    assert (out / "results.json").stat().st_mtime_ns == before
    assert run(["report", str(small), "--out", str(small)]) == NOT_DONE
    assert run(["report", str(small), "--out", str(out), "--force"]) in (DONE, NEEDS_A_PERSON)
    assert (out / "results.json").stat().st_mtime_ns > before


def test_a_session_without_static_is_reported_from_one_frame(session, tmp_path, capsys):
    folder = tmp_path / "session"
    folder.mkdir()
    shutil.copy(session / "walk.c3d", folder)
    text = (session / "session.toml").read_text() + '\n[trials.walk]\nrole = "fit"\n'
    (folder / "session.toml").write_text(text)
    assert run(["report", str(folder), "--out", str(tmp_path / "out"), "--json"]) == NEEDS_A_PERSON
    found = json.loads(capsys.readouterr().out)
    assert "Scaled on one frame of walk" in found["body"]["source"]
    assert any("Record a static trial" in step["reason"] for step in found["steps"])
    assert found["trials"][0]["wrench"]["frames_used"] == COMPARED


def test_ctrl_c_keeps_the_trials_that_are_done_and_says_so(session, tmp_path, capsys, monkeypatch):
    import biodance.pipeline.session as room

    whole = room.examine_trial

    def stopping(read, body, **how):
        if read.trial.name == "unknown_set":
            raise KeyboardInterrupt
        return whole(read, body, **how)

    monkeypatch.setattr(room, "examine_trial", stopping)
    assert run(["report", str(session), "--out", str(tmp_path / "out")]) == STOPPED
    assert "holds the trials that were done" in capsys.readouterr().err
    states = {
        trial["name"]: trial["status"]
        for trial in json.loads((tmp_path / "out" / "results.json").read_text())["trials"]
    }
    assert states["no_plates"] == "warning"
    assert states["unknown_set"] == states["walk"] == "refused"


def test_ctrl_c_while_identifying_keeps_all_trials(session, tmp_path, capsys, monkeypatch):
    import biodance.pipeline.session as room

    def stopping(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(room, "can_identify", lambda _: True)
    monkeypatch.setattr(room, "identify_trials", stopping)
    assert run(["report", str(session), "--out", str(tmp_path / "out")]) == STOPPED
    assert "Stopped by Ctrl-C" in capsys.readouterr().err
    assert len(json.loads((tmp_path / "out" / "results.json").read_text())["trials"]) > 2


def test_a_full_disk_is_told_with_the_path(tmp_path, monkeypatch):
    from biodance.report.files import write_files

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(BiodanceError, match=r"results.json: cannot be written \(No space left on device\)"):
        write_files(tmp_path, {"results.json": "{}"})


def test_ctrl_c_before_anything_was_done_writes_nothing(tmp_path, capsys, monkeypatch):
    def stopping(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("biodance.lab.session.read.read_session", stopping)
    assert run(["report", str(tmp_path), "--out", str(tmp_path / "out")]) == STOPPED
    assert "Stopped" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


_WHO = "--sex F --height 1.7 --mass 62"
_STANDING = f"simulate --protocol standing {_WHO} --out x"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("reprot", "report"),
        ("inspect", "nothing to inspect"),
        ("inspect no-such-file.c3d --json", "no-such-file.c3d"),
        ("report no-such-folder --out x", "no-such-folder"),
        ("settings no-such-folder", "no such folder"),
        ("report .", "--out is missing: Output folder"),
        ("report", "SESSION is missing. See biodance report --help."),
        ("live static", "static: is a folder"),
        ("report skipped --out x", "every recording (static.c3d) has the role skip"),
        ("simulate --protocol short --sex F --height 170 --mass 62 --seed 1 --out x", "stature"),
        ("simulate --protocol standing --sex F --height 1.7 --mass inf --seed 1 --out x", "mass = inf kg"),
        (f"simulate --protocol waltz {_WHO} --seed 1 --out x", "waltz"),
        (f"{_STANDING} --seed 1.5", "no whole number"),
        (f"{_STANDING} --seed -1", "0 and more"),
        (f"{_STANDING} --seed 1 --age -3", "0 to 120 years"),
        (f"dance {_WHO} --age 200 --out x", "0 to 120 years"),
        (f"dance {_WHO} --limits pipe --out x", "pipe: is a pipe"),
        ("dance --urdf pipe --feet a,b --out x", "pipe: is a pipe"),
        ("feedback empty --out x.html", "empty: is not a dance"),
        ("foresee pipe", "pipe: is a pipe"),
        ("foresee pipe --out page", "page: a page is one file that ends in .html. Choose --out page.html."),
        ("foresee pipe --out a.html", "a.html: is a folder; one file is written"),
        ("foresee pipe --out a.html --force", "a.html: is a folder; one file is written"),
        ("plates loop --out x", "loop: is no folder"),
        ("batch loop --out x", "loop: is no folder"),
        ("batch static --limit nan --out x", "--limit nan"),
    ],
)
def test_a_wrong_call_is_one_sentence(words, says, tmp_path, capsys, monkeypatch, session):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").touch()
    (tmp_path / "static").mkdir()
    (tmp_path / "a.html").mkdir()
    shutil.copy(session / "static.c3d", tmp_path / "static")
    shutil.copytree(tmp_path / "static", tmp_path / "skipped")
    (tmp_path / "skipped" / "session.toml").write_text('[trials."*"]\nrole = "skip"\n')
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.iterdir())
    assert run(words.split()) == NOT_DONE
    sentence = capsys.readouterr().err.strip()
    assert says in sentence
    assert len(sentence.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


def test_a_link_that_leads_nowhere_is_one_bad_file(session, tmp_path, monkeypatch):
    for name in ("static.c3d", "walk.c3d", "session.toml"):
        shutil.copy(session / name, tmp_path)
    (tmp_path / "broken.c3d").symlink_to("nowhere")
    (tmp_path / "again").symlink_to(".")
    monkeypatch.chdir(tmp_path)
    found = read_session(".")
    assert found.folder.name == tmp_path.name
    assert "broken.c3d: cannot be opened" in found.refused["broken.c3d"]
    assert archive_folders(tmp_path) == ((tmp_path,), ())


def test_a_fault_of_biodance_is_named_as_such(tmp_path, capsys, monkeypatch):
    def faulty(*_, **__):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr("biodance.lab.session.read.read_session", faulty)
    monkeypatch.delenv("BIODANCE_TRACEBACK", raising=False)
    assert run(["report", str(tmp_path), "--out", str(tmp_path / "out")]) == NOT_DONE
    assert "ZeroDivisionError: oops" in capsys.readouterr().err


def test_the_causes_are_listed_with_parameters_and_units_and_a_slip_is_answered(capsys):
    assert run(["effects", "added_mass", "--json"]) == DONE
    (one,) = json.loads(capsys.readouterr().out)
    assert [(p["name"], p["unit"]) for p in one["parameters"][:2]] == [("mass", "kg"), ("place_x", "m")]
    assert one["can_be_simulated"]
    assert run(["effects", "--json"]) == DONE
    rows = {row["effect"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["labels_swapped"]["parameters"] == []
    assert run(["effects", "aded_mass"]) == NOT_DONE
    assert "Did you mean 'added_mass'?" in capsys.readouterr().err
