"""The door: which reader a file gets, by its content, and what is refused in a sentence."""

import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from lab_sessions import two_trials

from biodance.errors import BiodanceError, FileRefused
from biodance.lab.c3d.raw import read_raw
from biodance.lab.readers import read_trial, reader_of
from biodance.lab.session.read import read_session
from biodance.records import Source


@pytest.fixture
def folder(tmp_path):
    """A subject's folder with one session: a static and a squat, by name."""
    return two_trials(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.xlsx", b"PK\x03\x04 something", "Legal are .c3d, .trc"),
        ("a.mp", b"$Bodymass = 60\n", "holds Vicon measurements, not a recording"),
        ("a.enf", b"[TRIAL_INFO]\n", "holds Vicon Eclipse notes"),
        ("a.trc", b"", "is empty"),
    ],
)
def test_file_that_is_no_recording_is_refused(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileRefused, match=sentence):
        read_trial(tmp_path / name)


def test_missing_file_and_folder_are_refused(tmp_path):
    with pytest.raises(FileRefused, match="cannot be opened"):
        read_trial(tmp_path / "absent.c3d")
    with pytest.raises(FileRefused, match="is a folder"):
        read_trial(tmp_path)


def test_fault_in_a_reader_is_a_refusal_of_that_file(folder, monkeypatch):
    def broken(path, *, role):
        raise IndexError("index 3 is out of bounds")

    monkeypatch.setattr("biodance.lab.readers.trc.read_trc", broken)
    with pytest.raises(FileRefused, match=r"IndexError: index 3 .* Please report this file"):
        read_trial(folder / "static01.trc")


def test_a_pipe_never_hangs(tmp_path, folder):
    os.mkfifo(folder / "squat_9.c3d")
    with pytest.raises(FileRefused, match=r"squat_9\.c3d: is a pipe, socket or device, an ordinary file is expected"):
        read_trial(folder / "squat_9.c3d")
    assert "is a pipe" in read_session(folder).refused["squat_9.c3d"]


def test_only_the_head_of_a_large_file_is_looked_at(tmp_path):
    path = tmp_path / "huge.bin"
    with open(path, "wb") as stream:
        stream.truncate(60_000_000_000)  # a hole: no disk is used
    with pytest.raises(FileRefused, match="none of the formats that can be read"):
        read_trial(path)


def test_a_reader_may_be_given_as_an_object(folder):
    reader = SimpleNamespace(
        NAME="stick figures",
        EXTENSIONS=(".stick",),
        PREFERENCE=5,
        sniff=lambda head: head.startswith(b"STICK"),
        read=lambda path, *, role, subject: replace(
            read_trial(folder / "static01.trc", role=role), name=path.stem, source=Source(path, "", "stick figures")
        ),
    )
    (folder / "walk.stick").write_bytes(b"STICK 1")
    assert "walk" not in [trial.name for trial in read_session(folder).trials]
    assert [trial.role for trial in read_session(folder, readers=[reader]).trials if trial.name == "walk"] == ["fit"]
    with pytest.raises(BiodanceError, match="lacks sniff, read, so it is no reader"):
        read_session(folder, readers=[SimpleNamespace(NAME="x", EXTENSIONS=(), PREFERENCE=1)])


def test_content_counts_more_than_the_name(tmp_path, folder):
    path = tmp_path / "renamed.c3d"
    path.write_bytes((folder / "static01.trc").read_bytes())
    assert reader_of(path).EXTENSIONS[0] == ".trc"
    assert read_trial(path).markers.names[0] == "LFHD"
    table = tmp_path / "numbers.dat"
    table.write_text("1,2,3,4,5,6\n-1,2.5,3e-1,4,5,6\n")
    assert reader_of(table).EXTENSIONS[0] == ".asc"


def test_a_file_larger_than_any_recording_is_refused_without_reading_it(tmp_path):
    huge = tmp_path / "huge.c3d"
    with open(huge, "wb") as stream:
        stream.truncate(6 * 10**9)
    with pytest.raises(FileRefused, match=r"has 6.0 GB, a recording at most 2.1"):
        read_raw(huge)


def test_a_full_disk_names_the_place_that_was_asked_for(tmp_path, monkeypatch, capsys):
    from biodance import cli

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cli, "app", full)
    assert cli.run(["report", "visit", "--out", str(tmp_path)]) == 2
    assert f"{tmp_path}: No space left on device." in capsys.readouterr().err


def test_segment_poses_without_points_are_refused_in_one_sentence(tmp_path: Path) -> None:
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["LABELS"]["value"] = ["dummy"]
    file["parameters"]["POINT"]["RATE"]["value"] = [85.0]
    points = np.full((4, 1, 20), np.nan)
    points[3] = 1
    file["data"]["points"] = points
    file["data"]["rotations"] = np.tile(np.eye(4)[:, :, None, None], (1, 1, 2, 20))
    file.add_parameter("ROTATION", "LABELS", ["pelvis_4X4", "l_thigh_4X4"])
    file.add_parameter("ROTATION", "RATE", [85.0])
    file.add_parameter("ROTATION", "USED", [2])
    file.write(str(tmp_path / "theia.c3d"))
    with pytest.raises(FileRefused, match=r"holds 2 segment poses \(pelvis, l_thigh .*no markers. The file is sound"):
        read_trial(tmp_path / "theia.c3d")
