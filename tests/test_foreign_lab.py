"""A session written by a laboratory whose code is not ours (BIODANCE_FOREIGN_LAB): other body, other markers, other
motion, other noise.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from biodance.lab.session.read import read_session
from biodance.pipeline.session import examine


def test_a_session_of_another_laboratory_is_identified_and_gains_on_what_was_kept(tmp_path: Path) -> None:
    folder = os.environ.get("BIODANCE_FOREIGN_LAB")
    if not folder:
        pytest.skip("BIODANCE_FOREIGN_LAB is not set: no independent virtual laboratory here")
    person = ["--seed", "1", "--sex", "F", "--height", "1.68", "--mass", "61"]
    command = [
        sys.executable,
        str(Path(folder) / "foreign_lab.py"),
        *person,
        "--trials",
        "1",
        "--out",
        str(tmp_path / "S01"),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    result = examine(read_session(tmp_path / "S01"))
    assert [trial.trial.name for trial in result.trials] == ["static", "dance01", "squat01", "squat02"]
    found = result.identification
    assert found is not None
    assert (found.identification.status, dict(found.failures)) == ("solved", {})
    true = json.loads((tmp_path / "S01.truth.json").read_text())
    assert found.identification.sip.mass.sum() == pytest.approx(true["true_total_mass_kg"], rel=0.01)
    assert found.gain is not None
    assert found.gain.force_interval[0] > 1
    assert found.gain.moment_interval[0] > 1
