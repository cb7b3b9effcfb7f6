"""A laboratory learns its own tolerances: what its sessions show counts beside what was shipped; lab.toml keeps it."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from biodance.cli import run
from biodance.diagnosis.archive.norms import SeenValue, norms, usual_noise
from biodance.diagnosis.learning import Null, learn_tolerances, shown_by
from biodance.errors import SessionRefused
from biodance.lab.session.read import read_session
from biodance.pipeline.lab_file import read_lab
from biodance.pipeline.learn import (
    LearnedLaboratory,
    LearnedSession,
    learn_laboratory,
    learned_session,
    learned_together,
)
from biodance.pipeline.session import examine
from biodance.report.laboratory import lab_file_text
from biodance.uncertainty.tolerances import InstrumentNoise, shipped

BAND = np.repeat(np.arange(len(shipped().noise)), 12)
MOVED = np.ones((len(shipped().noise), 6))
LOUD, NEVER = "plate_offset Fx", "clock_drift"
TRUE = 4.0


def null(seed: int) -> Null:
    """Return a session whose rows show ten offsets of standard deviation 4 N, and nothing of the clock."""
    chance = np.random.default_rng(seed)
    columns = np.concatenate([chance.normal(size=(6 * BAND.size, 10)), np.zeros((6 * BAND.size, 1))], axis=1)
    rows = columns @ np.append(TRUE * chance.normal(size=10), 0.0) + 0.3 * chance.normal(size=len(columns))
    return Null(rows, columns, (LOUD,) * 10 + (NEVER,), BAND, (), 70.0, MOVED, ("",) * 11)


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory) -> LearnedLaboratory:
    quiet = InstrumentNoise(5e-5, (0.01,) * 6, 0.008)
    cameras = [SeenValue("camera_noise", f"S{i}", 5e-5 + 1e-6 * i, "m") for i in range(20)]
    sessions = [LearnedSession(one.session, null(i), quiet, (one,)) for i, one in enumerate(cameras)]
    return learned_together(tmp_path_factory.mktemp("lab") / "archive", sessions, {"S99": "a check failed"})


def test_sizes_are_the_mean_square_of_sessions_and_what_was_known_before(laboratory):
    before = shipped().size(LOUD)
    expected = np.sqrt((20 * TRUE**2 + 5 * before**2) / 25)
    assert laboratory.tolerances.size(LOUD) == pytest.approx(expected, rel=0.15)
    assert laboratory.tolerances.size(NEVER) == pytest.approx(shipped().size(NEVER), rel=0.01)
    assert laboratory.shown[LOUD] == pytest.approx(200, rel=0.05)
    assert laboratory.shown[NEVER] == pytest.approx(0, abs=1e-6)


def test_what_was_known_before_counts_as_many_sessions_as_said():
    nulls = [null(i) for i in range(4)]
    alone, heavy = (learn_tolerances(nulls, shipped(), rounds=5, worth=worth).size(LOUD) for worth in (0.0, 1e6))
    assert alone == pytest.approx(TRUE, rel=0.25)
    assert heavy == pytest.approx(shipped().size(LOUD), rel=0.01)
    assert shown_by(nulls, shipped())[NEVER] == 0


def test_the_file_is_dated_says_what_each_number_rests_on_and_is_read_back(laboratory, tmp_path):
    path = tmp_path / "lab.toml"
    path.write_text(lab_file_text(laboratory))
    text = path.read_text()
    raw = tomllib.loads(text)
    assert len(raw["laboratory"]["sessions"]) == 20
    assert raw["laboratory"]["learned_utc"].isoformat()[:10] == laboratory.created[:10]
    assert "values in 20 sessions; shipped" in next(line for line in text.splitlines() if line.startswith(f'"{LOUD}"'))
    assert "no session shows it" in next(line for line in text.splitlines() if line.startswith(f'"{NEVER}"'))
    assert raw["norms"]["camera_noise"]["sessions"] == 20
    again = read_lab(path).tolerances
    assert again is not None
    assert again.instruments == laboratory.tolerances.instruments
    np.testing.assert_allclose(again.noise, laboratory.tolerances.noise, rtol=1e-3)
    assert dict(again.sizes) == pytest.approx(dict(laboratory.tolerances.sizes), rel=1e-6)


def test_corrections_stand_in_the_same_file(laboratory, tmp_path):
    path = tmp_path / "lab.toml"
    correction = '[corrections.plate_position."plate1:x"]\nshift = 0.03\nsd = 0.001\nsource = "S1"\n'
    path.write_text(lab_file_text(laboratory) + "\n" + correction)
    assert len(read_lab(path).corrections) == 1
    assert read_lab(path).tolerances is not None


def test_too_few_sessions_teach_nothing(laboratory, tmp_path, capsys):
    one = LearnedSession("S", null(0), InstrumentNoise(), ())
    with pytest.raises(
        SessionRefused, match=r"2 of 3 sessions can be learned from, at least 3 are needed. S99: broken"
    ):
        learned_together(tmp_path, [one, one], {"S99": "broken"})
    (tmp_path / "there.toml").write_text("mine")
    assert run(["learn", str(tmp_path), "--out", str(tmp_path / "there.toml")]) == 2
    assert "is not overwritten" in capsys.readouterr().err
    assert (tmp_path / "there.toml").read_text() == "mine"


def test_recordings_beside_the_sessions_are_no_session_and_a_missing_folder_is_told_at_once(
    tmp_path, monkeypatch, capsys
):
    for name in ("A", "B", "C"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "walk.c3d").write_bytes(b"P")
    (tmp_path / "stray.c3d").write_bytes(b"P")
    seen = []
    with pytest.raises(SessionRefused, match="0 of 3 sessions can be learned from"):
        learn_laboratory(tmp_path, tell=seen.append)
    assert any("beside the session folders" in one for one in seen)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SessionRefused, match="0 of 3 sessions"):
        learn_laboratory(".")
    with pytest.raises(SessionRefused, match="holds 1 session"):
        learn_laboratory("A")
    monkeypatch.setattr("biodance.pipeline.learn.learn_laboratory", None)  # no work before the check
    assert run(["learn", ".", "--out", "nowhere/lab.toml"]) == 2
    assert "nowhere: there is no such folder" in capsys.readouterr().err


def test_norms_are_medians_of_sessions_pooled():
    rows = [
        SeenValue("sway", session, value, "m") for session, value in (("a", 1.0), ("a", 3.0), ("a", 2.0), ("b", 4.0))
    ]
    (found,) = norms([*rows, SeenValue("alone", "a", 1.0, "m")])
    assert (found.name, found.sessions, found.observations) == ("sway", 2, 4)
    assert found.value == pytest.approx(3.0)
    assert usual_noise([InstrumentNoise(0.0, (0.0,) * 6), InstrumentNoise(2e-4, (0.5,) * 6)]).camera == 2e-4


def test_a_real_session_teaches_its_own_quiet(data):
    session = read_session(data / "biomechzoo" / "HC032A")
    static = replace(session, trials=session.of_role("static"))
    taught = learned_session(examine(static))
    assert 0 < taught.instruments.camera < 1e-5  # filtered before export
    weighed = next(one for one in taught.seen if one.name == "plates less declared mass")
    assert weighed.value == pytest.approx(0.02, abs=0.05)
