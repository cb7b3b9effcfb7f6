"""The door: which reader a file gets, by its content, and what is refused in a sentence."""

import pytest
from lab_sessions import two_trials

from biodance.errors import FileRefused
from biodance.lab.read import format_of, read_trial


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

    monkeypatch.setattr("biodance.lab.read.read_trc", broken)
    with pytest.raises(FileRefused, match=r"IndexError: index 3 .* Please report this file"):
        read_trial(folder / "static01.trc")


def test_content_counts_more_than_the_name(tmp_path, folder):
    path = tmp_path / "renamed.c3d"
    path.write_bytes((folder / "static01.trc").read_bytes())
    assert format_of(path) == ".trc"
    assert read_trial(path).markers.names[0] == "LFHD"
    table = tmp_path / "numbers.dat"
    table.write_text("1,2,3,4,5,6\n-1,2.5,3e-1,4,5,6\n")
    assert format_of(table) == ".asc"
