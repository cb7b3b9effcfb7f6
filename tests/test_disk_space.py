"""Before anything is installed, `make` says in a sentence what the disk has no room for."""

import shutil
import subprocess
import sys
from pathlib import Path

ROOM = Path(__file__).parents[1] / ".ci" / "room.py"


def told(*folders: str) -> tuple[int, str]:
    done = subprocess.run([sys.executable, ROOM, *folders], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def test_what_fits_is_installed_without_a_word(tmp_path: Path) -> None:
    assert told(f"{tmp_path / 'yet' / 'to_be_made'}=0.000001", f"{tmp_path}=0.000001") == (0, "")


def test_what_does_not_fit_is_refused_with_both_folders_and_what_to_do(tmp_path: Path) -> None:
    code, said = told(f"{tmp_path / 'venv'}=900000", f"{tmp_path}=1")
    assert code == 1
    assert f"900000 GB in {tmp_path / 'venv'} and 1 GB in {tmp_path}" in said
    assert "GB are free" in said
    assert "ROOM=no" in said
    assert "Traceback" not in said


def test_folders_on_one_disk_are_added_up(tmp_path: Path) -> None:
    most = 0.7 * shutil.disk_usage(tmp_path).free / 1e9
    assert told(f"{tmp_path}={most}")[0] == 0
    assert told(f"{tmp_path}={most}", f"{tmp_path / 'other'}={most}")[0] == 1
