"""The doctor: a library that is missing, raises, crashes the process or hangs is a finding that says how to mend it."""

import json

import pytest

from biodance import doctor
from biodance.cli import run
from biodance.cli.shared import DONE, NEEDS_A_PERSON
from biodance.doctor import MachineFinding, Probe, run_probe

MEND = "apt-get install it."


def test_what_works_says_its_version():
    assert run_probe(Probe("x", "print('noise'); print('1.2')", MEND)) == MachineFinding("x", True, True, "1.2")


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("import no_such_library", "No module named 'no_such_library'"),
        ("import os; os.abort()", "the process died (code -6)"),
        ("raise ImportError('libgomp.so.1: cannot open shared object file')", "libgomp.so.1"),
    ],
)
def test_what_fails_says_why_and_how_to_mend_it(code, why):
    finding = run_probe(Probe("x", code, MEND, needed=False))
    assert not finding.works
    assert not finding.needed
    assert why in finding.text
    assert finding.text.endswith(MEND)


def test_what_hangs_is_given_up(monkeypatch):
    monkeypatch.setattr(doctor, "_PATIENCE", 0.5)
    assert "no answer within 0.5 s" in run_probe(Probe("x", "import time; time.sleep(30)", MEND)).text


@pytest.mark.parametrize(("needed", "code"), [(True, NEEDS_A_PERSON), (False, DONE)])
def test_only_what_is_needed_changes_the_exit_code(needed, code, monkeypatch, capsys):
    found = (MachineFinding("python", True, True, "3.12"), MachineFinding("x", False, needed, MEND))
    monkeypatch.setattr(doctor, "examine_machine", lambda **_: found)
    assert run(["doctor", "--json"]) == code
    assert json.loads(capsys.readouterr().out)[1] == {"name": "x", "works": False, "needed": needed, "text": MEND}
    assert run(["doctor"]) == code
    assert ("MISSING" in capsys.readouterr().out) is needed


def test_everything_that_biodance_is_made_of_is_looked_at(monkeypatch):
    monkeypatch.setattr(doctor, "run_probe", lambda probe: MachineFinding(probe.name, True, probe.needed, ""))
    names = " ".join(finding.name for finding in doctor.examine_machine())
    for part in (
        "python",
        "anthropometry",
        "protocols",
        "pinocchio",
        "cvxpy",
        "GL stills",
        "opensim",
        "mujoco",
        "chromium",
        "writable",
    ):
        assert part in names
