"""`identify --method paper`: the paper's programme reaches a session through the command, with the same form of results
as the posterior beside it; what it cannot do is said.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import hidden
from identified_sessions import session_result

from biodance.cli import run
from biodance.identification.paper_programme import inequalities
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import by_paper, identified
from biodance.report.pages.identification import identification_section


def as_paper() -> SessionIdentification:
    """Return the identification by the paper's programme of a session without files."""
    found = by_paper(session_result()).identification
    assert found is not None
    return found


def test_the_programme_stands_beside_the_posterior_and_keeps_its_own_constraints():
    plain, found = session_result().identification, as_paper()
    assert (plain.method, found.method, found.status) == ("posterior", "paper", "solved")
    assert found.posterior is plain
    sip, body = found.identification.sip, found.identification.body
    A, b = inequalities(body)
    assert np.all(A @ sip.phi - b > -1e-6)
    assert np.all(np.abs(sip.phi - plain.identification.sip.phi).reshape(-1, 10)[:, 0] < 3.0)
    assert np.abs(sip.phi - plain.identification.sip.phi).max() > 1e-3
    tied = list(found.identification.base.well_known)
    if "held as equalities" in found.notes[0]:
        left = found.identification.base.base.regroup[tied] @ sip.phi - found.identification.base.value[tied]
        assert np.abs(left).max() < 1e-3
    for before, after in zip(plain.validations, found.validations, strict=True):
        np.testing.assert_array_equal(before.measured.value, after.measured.value)
        table, paper = (np.reshape(one.rms, (2, 3)) for one in (after.table_agreement, after.identified_agreement))
        assert np.all(np.linalg.norm(paper, axis=1) < np.linalg.norm(table, axis=1))  # forces, moments
    assert all(np.isnan(one.sd) for one in found.identification.known)
    assert found.search is plain.search


def test_without_a_solution_the_reason_is_said_and_the_posterior_stays(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("biodance.identification.paper_programme.solve_convex", lambda _: "infeasible")
    found = as_paper()
    assert found.status == "failed"
    assert "has no solution (infeasible)" in found.failures["segments"]
    assert found.validations == ()
    assert found.posterior is not None
    assert found.posterior.status == "solved"
    assert "has no solution (infeasible)" in identification_section(found)


def test_where_nothing_was_identified_there_is_nothing_to_compare():
    nothing: SessionResult = replace(session_result(), identification=None)
    assert by_paper(nothing) is nothing


def test_the_command_writes_the_same_form_for_both(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """What the diagnosis takes off before (`test_proven_corrections`) is not asked."""
    monkeypatch.setattr(
        "biodance.pipeline.diagnosis.diagnosed_and_corrected", lambda result, **_: (identified(result), None)
    )
    folder = hidden(tmp_path / "S01", trials=("static", "move_1", "squat_1"))
    assert run(["identify", str(folder), "--method", "paper", "--out", str(tmp_path / "out"), "--json"]) in (0, 1)
    found = json.loads(capsys.readouterr().out)
    assert (found["method"], found["status"], found["posterior"]["method"]) == ("paper", "solved", "posterior")
    assert set(found["posterior"]) <= set(found)
    for one in (found, found["posterior"]):
        assert {row["name"] for row in one["segments"]} == {row["name"] for row in found["segments"]}
        assert one["validation"][0]["trial"] == "squat_1"
        assert one["base_parameters"]["count"] > 80
    assert all(row["mass_sd_kg"] is None for row in found["segments"])
    assert all(row["mass_sd_kg"] > 0 for row in found["posterior"]["segments"])
    page = (tmp_path / "out" / "report.html").read_text()
    assert "the posterior and the paper" in page
    assert "NaN" not in (tmp_path / "out" / "body.json").read_text()
    assert run(["identify", str(folder), "--method", "guess", "--out", str(tmp_path / "o2")]) == 2
    assert (
        run(
            [
                "identify",
                str(folder),
                "--method",
                "paper",
                "--urdf",
                "r.urdf",
                "--feet",
                "A,B",
                "--out",
                str(tmp_path / "o3"),
            ]
        )
        == 2
    )
    assert "--method cannot be used with --urdf" in capsys.readouterr().err
