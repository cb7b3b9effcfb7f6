"""Acceptance in a window: a preview beside the results that changes nothing, before and after, and what is kept."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import hidden

from biodance.app.sessions import Archive
from biodance.app.window import keep_acceptance, preview_of_acceptance
from biodance.errors import BiodanceError


def contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_a_plate_that_reads_too_much_is_taken_off_in_a_copy(tmp_path):
    hidden(tmp_path / "archive" / "S01", "plate_gain:target=Fz,gain=0.3", trials=("static", "move_1", "squat_1"))
    archive = Archive(tmp_path / "archive", tmp_path / "results")
    place, before = archive["S01"], contents(tmp_path / "archive")
    found = preview_of_acceptance(place, archive.out)
    assert contents(tmp_path / "archive") == before
    vertical = {row["trial"]: (row["before"][2], row["after"][2]) for row in found["residuals"]}
    assert set(vertical) == {"static", "move_1", "squat_1"}
    assert np.all([after < 0.3 * as_recorded for as_recorded, after in vertical.values()])
    assert vertical["static"][0] == pytest.approx(0.3 * 64 * 9.81, rel=0.15)
    assert any(row["file"].endswith("squat_1.c3d") for row in found["written"])
    kept = keep_acceptance(place, archive.out)
    assert (kept / "corrected" / "squat_1.c3d").is_file()
    with pytest.raises(BiodanceError, match="before and after"):
        keep_acceptance(place, archive.out)


def test_what_was_kept_before_stays(tmp_path):
    folder = tmp_path / "archive" / "S01"
    folder.mkdir(parents=True)
    (folder / "static.c3d").write_bytes(b"no recording")
    archive = Archive(tmp_path / "archive", tmp_path / "results")
    for text in ("first", "second"):
        preview = archive.out / "accepted" / "S01 (preview)"
        preview.mkdir(parents=True)
        (preview / "lab.toml").write_text(text)
        keep_acceptance(archive["S01"], archive.out)
    assert (archive.out / "accepted" / "S01" / "lab.toml").read_text() == "first"
    assert (archive.out / "accepted" / "S01 2" / "lab.toml").read_text() == "second"


def test_a_session_that_cannot_be_diagnosed_says_why_and_leaves_no_preview(tmp_path):
    folder = tmp_path / "archive" / "S01"
    folder.mkdir(parents=True)
    (folder / "static.c3d").write_bytes(b"no recording")
    archive = Archive(tmp_path / "archive", tmp_path / "results")
    with pytest.raises(BiodanceError, match=r"static\.c3d"):
        preview_of_acceptance(archive["S01"], archive.out)
    assert not list((archive.out / "accepted").iterdir())
