"""A fit that fails gives no number: every caller says so, on the page, on the terminal and in the JSON."""

import json
from dataclasses import replace

import pytest
from identified_sessions import body, session_result
from identify_trials import noisy_fit, person, smooth_motion

from biodance.cli import run
from biodance.cli.shared import NEEDS_A_PERSON, NOT_DONE
from biodance.errors import NotSolved
from biodance.identification.added_mass import added_mass
from biodance.identification.identification import identify_body
from biodance.identification.paper_programme import paper_programme
from biodance.identification.physical import FailedFit
from biodance.identification.sessions import differences
from biodance.pipeline.attention import session_attention
from biodance.pipeline.identification import identify_trials
from biodance.records.attention import Attention
from biodance.report.pages.identification import identification_section
from biodance.report.tables.identification import identification_document
from biodance.report.tables.schema import plain_values

FORCED = FailedFit("No possible body, by force. Check the scaling.")


def refuse(*_) -> FailedFit:
    return FORCED


@pytest.fixture
def failing(monkeypatch):
    """Let every fit of a session fail (but of the one that other tests keep)."""
    session_result()
    monkeypatch.setattr("biodance.identification.identification.physical_fit", refuse)


def session():
    one, truth, rng = person(1)
    return one, (noisy_fit(one, smooth_motion(one, rng, frames=600), truth, rng),)


def test_an_identification_without_a_body_gives_none(failing, monkeypatch):
    found = identify_body(*session())
    assert (found.status, found.cause, found.known) == ("failed", FORCED.cause, ())
    for use in (
        lambda: found.sip,
        lambda: found.identified,
        lambda: differences(found, found),
        lambda: added_mass(found, reference=found),
    ):
        with pytest.raises(NotSolved, match="by force"):
            use()
    assert len(added_mass(found).suspects) == 4, "the table needs no fit"


def test_sessions_whose_bodies_with_room_for_a_load_fail_cannot_be_compared(monkeypatch):
    found = identify_body(*session())
    assert found.status == "solved"
    monkeypatch.setattr("biodance.identification.sessions.physical_fit", refuse)
    with pytest.raises(NotSolved, match=r"cannot be compared: t, .*by force"):
        differences(found, found)


def test_the_paper_s_programme_without_a_solution_has_no_parameters(monkeypatch):
    found = identify_body(*session())
    monkeypatch.setattr("biodance.identification.paper_programme.solve_convex", lambda _: "infeasible")
    failed = paper_programme(found.data, found.body)
    assert failed.status == "failed"
    with pytest.raises(NotSolved, match="infeasible"):
        _ = failed.phi


def test_the_session_says_it_on_the_page_and_in_the_numbers(failing):
    trials = session_result().trials
    found = identify_trials(body(), trials, name="S01")
    numbers = plain_values(identification_document(found))
    assert (numbers["status"], numbers["cause"], numbers["segments"]) == ("failed", FORCED.cause, [])
    assert numbers["failures"] == {"segments": FORCED.cause}
    assert (numbers["validation"], numbers["gain"], numbers["joint_torques"], numbers["differences"]) == (
        [],
        None,
        None,
        [],
    )
    page = identification_section(found)
    assert "Not solved, segments:" in page
    assert FORCED.cause in page
    assert "<figure>" not in page
    result = replace(session_result(), identification=found)
    said = Attention("fail", f"Not solved. {FORCED.cause}", "", "identification, segments")
    assert said in session_attention(result)


def test_a_reference_that_failed_is_said_and_not_compared_with(monkeypatch):
    with monkeypatch.context() as forced:
        forced.setattr("biodance.identification.identification.physical_fit", refuse)
        reference = identify_trials(body(), session_result().trials, name="S00")
    found = identify_trials(body(), session_result().trials, name="S01", reference=reference)
    assert found.identification.status == "solved"
    assert found.search.reference == "the table"
    assert found.changes == ()
    assert "Session S00" in found.failures["reference"]
    assert "by force" in identification_section(found)


def test_a_comparison_that_failed_is_said(monkeypatch):
    reference = session_result().identification
    monkeypatch.setattr("biodance.identification.sessions.physical_fit", refuse)
    found = identify_trials(body(), session_result().trials, name="S01", reference=reference)
    numbers = plain_values(identification_document(found))
    assert (numbers["status"], numbers["differences"]) == ("solved", [])
    assert "by force" in numbers["failures"]["differences"]
    assert "by force" in identification_section(found)


def test_the_command_says_it_and_writes_and_exports_no_body(failing, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("biodance.report.write.page", lambda *_, **__: "a page")
    found = replace(session_result(), identification=identify_trials(body(), session_result().trials, name="S01"))
    (tmp_path / "S01").mkdir()
    for room in ("biodance.lab.session.read", "biodance.pipeline.export"):
        monkeypatch.setattr(f"{room}.read_session", lambda folder, **_: replace(found.session, folder=folder))
    for stages in ("session.followed", "export.examine"):
        monkeypatch.setattr(f"biodance.pipeline.{stages}", lambda session, **_: found)
    assert run(["identify", str(tmp_path / "S01"), "--out", str(tmp_path / "out")]) == NEEDS_A_PERSON
    assert "Identification, segments: Not solved." in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "out").glob("[!.]*")) == [
        "manifest.json",
        "methods.md",
        "report.html",
        "results.json",
    ]
    assert json.loads((tmp_path / "out" / "results.json").read_text())["status"] == "failed"
    assert run(["export", str(tmp_path / "S01"), "--format", "csv", "--out", str(tmp_path / "s.csv")]) == NOT_DONE
    assert "by force" in capsys.readouterr().err
    assert not (tmp_path / "s.csv").exists()
