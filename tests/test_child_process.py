"""What lies beside the recordings is never run: modules of the working folder are not imported by any process."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import biodance

PLANTED = ("numpy", "ezc3d", "random", "scipy", "pickle")
CHECKOUT = str(Path(biodance.__file__).parent.parent)


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """Return a folder with a session of one broken file and modules that write down that they were run."""
    for name in PLANTED:
        (tmp_path / f"{name}.py").write_text("open('ran', 'a').write(__name__)\nraise SystemExit(7)\n")
    (tmp_path / "archive" / "s0").mkdir(parents=True)
    (tmp_path / "archive" / "s0" / "walk.c3d").write_bytes(b"no recording")
    return tmp_path


@pytest.mark.parametrize(
    "words", [("doctor",), ("inspect", "archive/s0/walk.c3d"), ("batch", "archive", "--out", "out", "--workers", "1")]
)
def test_no_command_runs_what_lies_in_the_working_folder(planted: Path, words: tuple[str, ...]) -> None:
    own = os.environ | {"PYTHONPATH": CHECKOUT}
    program = [sys.executable, "-P", "-m", "biodance", *words]
    done = subprocess.run(program, cwd=planted, env=own, capture_output=True, check=False)
    assert not (planted / "ran").exists(), (planted / "ran").read_text()
    assert done.returncode in (0, 1, 2), done.stderr.decode()
    assert b"Traceback" not in done.stderr


def test_what_else_is_started_keeps_its_own_folder(monkeypatch) -> None:
    from biodance.batch.engines import _process

    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with _process() as pool:
        assert pool.submit(os.getenv, "PYTHONSAFEPATH").result() == "1"
    assert "PYTHONSAFEPATH" not in os.environ


def test_a_child_imports_biodance_and_nothing_of_the_working_folder(planted: Path, monkeypatch) -> None:
    from biodance.child_process import run_python

    monkeypatch.chdir(planted)
    code = "import biodance, random; print(biodance.__file__); print(random.__file__)"
    done = run_python("-c", code, timeout=60)
    own, standard = done.stdout.decode().split()
    assert Path(own).is_relative_to(CHECKOUT)
    assert not Path(standard).is_relative_to(planted)
