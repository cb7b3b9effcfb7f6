"""The command init writes session.toml with its guesses, once; inspect honours what stands there."""

import json
from pathlib import Path

import pytest
from lab_sessions import two_trials, write_trial
from standing_markers import OWN, stand

from biodance.cli import run
from biodance.errors import SessionRefused
from biodance.lab.inspect import init_session, inspect_paths
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.read import read_session


def test_init_writes_its_guesses_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = two_trials(tmp_path)
    before = {trial.name: trial.role for trial in read_session(folder).trials}
    assert run(["init", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {trial["name"]: trial["role"] for trial in found["trials"]} == before
    after = read_session(folder)
    assert {trial.name: trial.role for trial in after.trials} == before
    assert after.subject.mass == pytest.approx(found["subject"]["mass_kg"], rel=1e-3)
    text = (folder / "session.toml").read_text()
    with pytest.raises(SessionRefused, match="nothing of yours is overwritten"):
        init_session(folder)
    assert (folder / "session.toml").read_text() == text


def test_what_init_guessed_stays_a_guess(tmp_path: Path) -> None:
    """Nobody said mass, stature, sex or roles, so the file says nothing of them; a # less, and it does."""
    folder = two_trials(tmp_path)
    init_session(folder)
    assert set(read_session(folder).subject.guessed) == {"mass", "stature", "sex"}
    assert not any("session.toml says so" in note for note in read_session(folder).notes)
    text = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(text.replace("# sex = ", "sex = ").replace("# role = ", "role = "))
    confirmed = read_session(folder)
    assert set(confirmed.subject.guessed) == {"mass", "stature"}
    assert sum("session.toml says so" in note for note in confirmed.notes) == 2


def test_a_guessed_map_is_confirmed_by_taking_the_marks_away(tmp_path: Path) -> None:
    write_trc(tmp_path / "static.trc", stand({place: f"own {place}" for place in OWN}))
    found = init_session(tmp_path)
    text = (tmp_path / "session.toml").read_text()
    assert found["marker_map"]
    assert read_session(tmp_path).trials[0].marker_set.startswith("guessed ")
    head, map_, rest = text.partition("# [markers.map]")
    assert map_
    (tmp_path / "session.toml").write_text(head + "[markers.map]" + rest.replace('\n# "', '\n"'))
    assert read_session(tmp_path).trials[0].marker_set.endswith("session.toml")


def test_init_begins_a_map_where_none_can_be_guessed(tmp_path: Path) -> None:
    numbered = {place: f"M{k:02d}" for k, place in enumerate(OWN)}
    still = stand(numbered | {"left_toe": "gone"})
    write_trc(tmp_path / "static.trc", still.select([label for label in still.names if label != "gone"]))
    init_session(tmp_path)
    text = (tmp_path / "session.toml").read_text()
    assert "# [markers.map]" in text
    assert all(f'# "{label}" = ' in text for label in numbered.values() if label in still.names)
    assert '# "M00" = "right_asis"' in text


def test_inspect_honours_the_markers_of_the_session_file(tmp_path: Path) -> None:
    file = write_trial(tmp_path, "static1")
    (tmp_path / "session.toml").write_text('[markers]\nfile = "opencap"\n')
    (record,) = [one for one in inspect_paths([tmp_path]) if one["file"] == str(file)]
    assert "The markers are not of the chosen set opencap" in " ".join(record["warnings"])
    (tmp_path / "session.toml").write_text("[markers]\nfiles = 1\n")
    (record,) = [one for one in inspect_paths([tmp_path]) if one["file"] == str(file)]
    assert "unknown key 'files'" in " ".join(record["warnings"])
