"""Sessions written by a laboratory whose code is not ours (BIODANCE_FOREIGN_LAB): other body, other markers, other
motion, other noise.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from identified_sessions import declared

from biodance.identification.added_mass import added_mass
from biodance.lab.session.read import read_session
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine

LOAD, WEIGHT = 2.4, 74.0


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of two visits of a person: A without and B with a load on the forearm, weighed with it."""
    lab = os.environ.get("BIODANCE_FOREIGN_LAB")
    if not lab:
        pytest.skip("BIODANCE_FOREIGN_LAB is not set: no independent virtual laboratory here")
    folder = tmp_path_factory.mktemp("visits")
    person = {"seed": 611, "sex": "M", "height": 1.78, "mass": WEIGHT, "trials": 1, "noise": 0.6, "camera": 0.3}
    asked = [text for name, value in person.items() for text in (f"--{name}", str(value))]
    worn = ["--session", "2", "--cause", "added_mass", "--target", "l_farm", "--size", str(LOAD), "--weighed"]
    for name, more in {"A": [], "B": worn}.items():
        command = [sys.executable, str(Path(lab) / "foreign_lab.py"), *asked, *more, "--out", str(folder / name)]
        subprocess.run(command, check=True, capture_output=True, timeout=240)
    return folder


@pytest.fixture(scope="module")
def bare(visits: Path) -> SessionResult:
    """Return what the visit without load comes to."""
    return examine(read_session(visits / "A"))


def test_a_person_is_identified_and_gains_on_what_was_kept(visits: Path, bare: SessionResult) -> None:
    assert [trial.trial.name for trial in bare.trials] == ["static", "dance01", "squat01", "squat02"]
    found = bare.identification
    assert found is not None
    assert (found.identification.status, dict(found.failures)) == ("solved", {})
    true = json.loads((visits / "A.truth.json").read_text())
    assert found.identification.sip.mass.sum() == pytest.approx(true["true_total_mass_kg"], rel=0.01)
    assert found.gain is not None
    assert found.gain.force_interval[0] > 1
    assert found.gain.moment_interval[0] > 1


def test_nobody_without_load_is_accused_and_a_load_is_found_either_way(visits: Path, bare: SessionResult) -> None:
    loaded = examine(read_session(visits / "B"))
    assert bare.identification is not None
    assert loaded.subject.declared_mass == pytest.approx(WEIGHT + LOAD)
    assert bare.identification.search.status == "none"
    for mass in (WEIGHT, WEIGHT + LOAD):
        found = added_mass(declared(loaded, mass), reference=bare.identification.identification)
        assert found.found
        assert found.best.segment == "left_forearm_hand"
        assert found.best.mass == pytest.approx(LOAD, abs=0.35)
        assert found.best.interval[0] < LOAD < found.best.interval[1]
