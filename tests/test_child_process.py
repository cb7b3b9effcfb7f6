"""What lies beside the recordings is never run: no command imports modules of the working folder, in any process."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from small_dances import small_dance

import biodance
from biodance.child_process import start_forkserver
from biodance.cli import app
from biodance.records import Subject

PLANTED = ("numpy", "ezc3d", "random", "scipy", "pickle", "matplotlib", "mujoco", "pinocchio", "pyvista", "cvxpy")
CHECKOUT = Path(biodance.__file__).parent.parent
COMMANDS = {
    "app": "no-such-folder --no-browser",
    "batch": "archive --out out-batch --workers 1 --no-pages",
    "compare": "archive/s0 archive/s1 --out out-compare",
    "dance": "--protocol one_segment --sex F --height 1.7 --mass 500 --out out-dance",
    "demo": "--out dance.npz",
    "diagnose": "archive/s0 --out out-diagnose",
    "doctor": "",
    "effects": "",
    "export": "hoap3 --format osim --out hoap3.osim",
    "feedback": "dance.npz --out dance.html",
    "foresee": "dance.npz --out archive",
    "identify": "archive/s0 --out out-identify",
    "init": "archive/s0",
    "inspect": "archive/s0/walk.c3d archive/s1/stand.c3d",
    "learn": "archive --out lab.toml",
    "limits": "--template stroke --out person.toml",
    "live": "archive/s1/stand.c3d",
    "plates": "archive --out out-plates",
    "play": "dance.npz --out dance.mov",
    "register": "archive/s1/stand.c3d archive/s0/walk.c3d --out out-register",
    "report": "archive/s0 --out out-report",
    "settings": "archive/s1",
    "simulate": "--protocol standing --seed 1 --out simulated",
    "verify": "archive",
}
_EACH = """import json, os, sys
if __name__ == "__main__":
    from biodance.cli import run
    for words in json.load(open(sys.argv[1])):
        code = run(words)
        print("ended", words[0], code, *(["ran"] if os.path.exists("ran") else []), flush=True)
"""


@pytest.fixture(scope="module")
def ended(tmp_path_factory) -> dict[str, str]:
    """Return how every command ended, begun as the program `biodance` is, in a folder with modules of strangers."""
    place = tmp_path_factory.mktemp("planted")
    for name in PLANTED:
        (place / f"{name}.py").write_text("open('ran', 'a').write(__name__)\nraise SystemExit(7)\n")
    (place / "archive" / "s0").mkdir(parents=True)
    (place / "archive" / "s0" / "walk.c3d").write_bytes(b"no recording")
    biodance.simulate(Subject(61.0, 1.68, "F", 30.0), "standing", place / "made", seed=3)
    (place / "archive" / "s1").mkdir()
    (place / "made" / "static.c3d").replace(place / "archive" / "s1" / "stand.c3d")
    small_dance().save(place / "dance.npz")
    program = place.parent / "biodance_program.py"
    program.write_text(_EACH)
    words = place / "words.json"
    words.write_text(json.dumps([[name, *more.split()] for name, more in COMMANDS.items()]))
    own = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"} | {
        "PYTHONPATH": str(CHECKOUT)
    }
    done = subprocess.run(
        [sys.executable, str(program), str(words)],
        cwd=place,
        env=own | {"PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr
    assert "itself failed" not in done.stderr, done.stderr
    return dict(re.findall(r"ended (\w+) (.*)", done.stdout))


def test_every_command_is_asked() -> None:
    assert set(COMMANDS) == {name for name in app if not name.startswith("-")}


@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_runs_what_lies_in_the_working_folder(ended: dict[str, str], name: str) -> None:
    assert ended[name] in ("0", "1", "2")


def test_python_m_biodance_imports_nothing_of_the_working_folder(tmp_path: Path) -> None:
    (tmp_path / "numpy.py").write_text("raise SystemExit(7)")
    own = os.environ | {"PYTHONPATH": str(CHECKOUT), "PYTHONSAFEPATH": ""}
    words = [sys.executable, "-m", "biodance", "inspect", "walk.c3d"]
    done = subprocess.run(words, cwd=tmp_path, env=own, capture_output=True, text=True, check=False)
    assert (done.returncode, "walk.c3d" in done.stderr) == (2, True), done.stderr


def test_what_else_is_started_keeps_its_own_folder(monkeypatch) -> None:
    from biodance.batch.run import _process

    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with _process() as pool:
        assert pool.submit(os.getenv, "PYTHONSAFEPATH").result() == "1"
    assert "PYTHONSAFEPATH" not in os.environ


def test_a_child_imports_biodance_and_nothing_of_the_working_folder(tmp_path: Path, monkeypatch) -> None:
    from biodance.child_process import run_python

    (tmp_path / "random.py").write_text("raise SystemExit(7)")
    monkeypatch.chdir(tmp_path)
    code = "import biodance, random; print(biodance.__file__); print(random.__file__)"
    done = run_python("-c", code, timeout=60)
    own, standard = done.stdout.decode().split()
    assert Path(own).is_relative_to(CHECKOUT)
    assert not Path(standard).is_relative_to(tmp_path)


def test_ctrl_c_waits_while_the_process_of_the_workers_is_started(monkeypatch: pytest.MonkeyPatch) -> None:
    started = []

    def ensure_running() -> None:
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        started.append(True)

    monkeypatch.setattr("multiprocessing.forkserver.ensure_running", ensure_running)
    with pytest.raises(KeyboardInterrupt):
        start_forkserver()
    assert started == [True]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
