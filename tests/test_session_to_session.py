"""What one session gives to the next, as commands and functions: a dance performed, a body, a laboratory's file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import hidden
from identified_sessions import SUBJECT, body, session_result
from plate_trials import CORNERS, POINT, trial
from small_dances import small_dance

import biodance
from biodance.body.body import body_text
from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.diagnosis.accept import Gain
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.effects import QualityCheck
from biodance.errors import BiodanceError, SessionRefused, UnknownName
from biodance.identification.identification import identify_body
from biodance.lab.session.results_folder import check_results
from biodance.pipeline.body import starting_from
from biodance.pipeline.front_dance import virtual_subject
from biodance.pipeline.results import MendedCopy, SessionDiagnosis
from biodance.pipeline.saved_results import known_body
from biodance.pipeline.trial import trial_fit
from biodance.records import Session, Subject
from biodance.report.write import _accepted

NAN = float("nan")


@pytest.fixture(scope="module")
def danced(tmp_path_factory) -> Path:
    """Return a folder with a dance and the session of somebody steady who danced it."""
    folder = tmp_path_factory.mktemp("danced")
    replace(small_dance(), subject=Subject(65.0, 1.75, "F")).save(folder / "dance.npz")
    words = ["simulate", "--dance", str(folder / "dance.npz"), "--performer", "steady", "--seed", "3"]
    assert run([*words, "--out", str(folder / "visit")]) == 0
    return folder


def test_a_dance_is_performed_by_the_person_it_was_designed_for(danced: Path) -> None:
    names = sorted(path.name for path in (danced / "visit").iterdir())
    assert names == ["dance_1.c3d", "session.toml", "squat_1.c3d", "squat_2.c3d", "static.c3d", "truth"]
    truth = json.loads((danced / "visit" / "truth" / "truth.json").read_text())
    assert truth["subject"] == {"mass_kg": 65.0, "height_m": 1.75, "sex": "F"}
    assert [one["role"] for one in truth["trials"]] == ["static", "validate", "validate", "fit"]
    assert Dance.load(danced / "dance.npz").subject.stature == 1.75


def test_identify_says_how_well_it_was_danced(danced: Path, capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    monkeypatch.setattr("biodance.report.write.page", lambda *_, **__: "a page")
    posture = {"number": 1, "times": 2, "held_s": 3.0, "skipped": False, "easier": False}
    log = {"biodance_dance_log": 1, "dance": "one_segment", "mark": Dance.load(danced / "dance.npz").mark}
    log |= {"begun": "2026-03-02T10:00:00Z", "camera": False, "speed": 1, "known_percent": None}
    log["postures"] = [posture | {"told_percent": None, "reached_deg": None}]
    (danced / "visit" / "dance_log_2026.json").write_text(json.dumps(log))
    words = ["identify", str(danced / "visit"), "--dance", str(danced / "dance.npz"), "--out", str(danced / "out")]
    assert run([*words, "--json"]) in (0, 1)
    told = json.loads(capsys.readouterr().out)["performance"]
    assert told["repeat"] == [1]
    (noted,) = told["logs"]
    assert (noted["same"], noted["danced"], noted["repeated"]) == (True, 1, [1])
    rows = {row["segment"]: row for row in told["excitation"]}
    assert len(rows) == 12
    assert 0 < rows["left_upper_arm"]["reached"] < 1
    assert rows["left_upper_arm"]["planned"] > rows["right_upper_arm"]["planned"]


def test_one_report_says_how_it_was_danced_and_accepts_what_is_proven(
    danced: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    monkeypatch.setattr("biodance.report.write.page", lambda *_, **__: "a page")
    words = ["report", str(danced / "visit"), "--dance", str(danced / "dance.npz"), "--accept"]
    assert run([*words, "--out", str(tmp_path / "out"), "--json"]) in (0, 1)
    told = json.loads(capsys.readouterr().out)
    assert len(told["identification"]["performance"]["excitation"]) == 12
    assert told["accepted"]["written"] == []
    late = hidden(tmp_path / "late", "time_delay:delay=0.025", trials=("static", "move_1", "move_3"))
    assert run(["report", str(late), "--accept", "--out", str(tmp_path / "late_out")]) == 1
    told = json.loads((tmp_path / "late_out" / "results.json").read_text())["accepted"]
    files = [one["file"] for one in told["written"]]
    assert {"accepted/body.json", "accepted/lab.toml", "accepted/corrected/move_1.c3d"} <= {*files}
    assert all((tmp_path / "late_out" / file).is_file() for file in files)
    kept = check_results(tmp_path / "late_out")
    assert kept is not None
    assert kept.whole
    assert {*files} <= kept.manifest.outputs.keys()
    assert "written: accepted/lab.toml" in capsys.readouterr().out


def test_who_dances_must_be_known() -> None:
    with pytest.raises(BiodanceError, match="--sex, --height, --mass"):
        virtual_subject(None, sex=None, height=None, mass=None, age=NAN)
    with pytest.raises(BiodanceError, match="does not say for whom"):
        virtual_subject(small_dance(), sex="F", height=None, mass=65.0, age=NAN)
    known = replace(small_dance(), subject=Subject(65.0, 1.75, "F", 33.0))
    assert virtual_subject(known, sex=None, height=None, mass=60.0, age=NAN) == Subject(60.0, 1.75, "F", 33.0)
    with pytest.raises(UnknownName, match="restless"):
        biodance.simulate(SUBJECT, None, "nowhere", dance=small_dance(), performer="sloppy")
    with pytest.raises(BiodanceError, match="either a protocol or a dance"):
        biodance.simulate(SUBJECT, "squat", "nowhere", dance=small_dance())


def test_a_body_carried_on_is_known_better_than_the_table(tmp_path: Path) -> None:
    first, second = session_result(seed=1), session_result(seed=5)
    assert first.identification is not None
    one = first.identification.identification
    (tmp_path / "body.json").write_text(body_text(one.identified, "test"))
    known = known_body(tmp_path)
    assert known is not None
    started, prior, words = starting_from(known, body(), SUBJECT.mass, "Scaled.")
    assert started.sip.mass.sum() == pytest.approx(SUBJECT.mass)
    assert "earlier session" in words
    fits = tuple(fit for t in second.trials if t.trial.role == "fit" and (fit := trial_fit(t)))
    fresh, carried = identify_body(body(), fits), identify_body(started, fits, prior=prior)
    mass_sd = [np.sqrt(np.diag(found.posterior.covariance)[::10]) for found in (fresh, carried)]
    assert (mass_sd[1] < 1.001 * mass_sd[0]).all()
    assert np.median(mass_sd[1] / mass_sd[0]) < 0.98
    with pytest.raises(SessionRefused, match="another person"):
        starting_from(known, body(), 90.0, "")
    with pytest.raises(SessionRefused, match="Give the body"):
        starting_from(replace(known, sip=replace(known.sip, covariance=0 * known.sip.covariance)), body(), 62.0, "")


def test_accepting_writes_lab_file_and_corrected_trials(tmp_path: Path) -> None:
    shift = np.array([0.03, 0.0, 0.0])
    wrong = trial(point=POINT + shift, corners=CORNERS + shift)
    session = Session(SUBJECT, (wrong,), Path("/lab/S01"))
    cause, proven = Alias("plate_position", "plate1:x", 50.0), Gain(np.ones(6), np.zeros(6), (0.2, 0.4), ("t",))
    place = Finding("plate_position", "plate1:x", (Estimate("shift", 0.03, 0.001, "m"),), (cause,), 1.0, proven)
    zero = replace(place, effect="plate_offset", target="Fx", parameters=(Estimate("offset", 5.0, 0.3, "N"),))
    load = replace(place, effect="added_mass", target="trunk_head", parameters=(Estimate("mass", 2.0, 0.1, "kg"),))
    turned = replace(place, effect="plate_rotation", target="plate1:z", gain=replace(proven, ci95=(-0.1, 0.2)))
    unmeasured = replace(turned, target="plate1:x", gain=None)
    found = SessionDiagnosis(Diagnosis(explained=True, findings=(place, zero, load, turned, unmeasured)))
    (tmp_path / "again").mkdir()
    told, files = _accepted(replace(session_result(), session=session), found, tmp_path, ())
    assert told["trials"] == ("t",)
    assert told["not_in_recordings"] == []
    assert [one["cause"] for one in told["not_applied"]] == [
        "added_mass trunk_head",
        "plate_rotation plate1:z",
        "plate_rotation plate1:x",
    ]
    assert "removes -10 to 20 %" in told["not_applied"][1]["why"]
    assert "is not measured" in told["not_applied"][2]["why"]
    said = {one["file"]: one["what"] for one in told["written"]}
    assert set(said) == {
        "lab.toml",
        *(f"corrected/{name}" for name in ("t.c3d", "session.toml", "corrected.toml")),
    }
    assert said["corrected/t.c3d"] == "taken off: plate position plate1:x (shift 0.03 m); plate offset Fx (offset 5 N)"
    assert "rotation" not in (tmp_path / "corrected" / "corrected.toml").read_text()
    late = QualityCheck("clock of the forces", False, "In t the forces come 200 ms late.", "time_delay", trials=("t",))
    other = replace(wrong, name="u", source=replace(wrong.source, path=Path("u.c3d")))
    copy = replace(found, diagnosis=Diagnosis(explained=True, findings=()), mended=MendedCopy({}, (late,)))
    two = replace(session_result(), session=replace(session, trials=(wrong, other)))
    said = {one["file"]: one["what"] for one in _accepted(two, copy, tmp_path / "again", ())[0]["written"]}
    assert said["corrected/t.c3d"] == "taken off: In t the forces come 200 ms late."
    assert said["corrected/u.c3d"] == "as read: nothing was taken off"
    assert late.text in (tmp_path / "again" / "corrected" / "corrected.toml").read_text()
    assert "plate_position" in files["lab.toml"]
    assert "plate_offset" not in files["lab.toml"]  # of today only
    assert sorted(path.name for path in (tmp_path / "corrected").iterdir()) == [
        "corrected.toml",
        "session.toml",
        "t.c3d",
    ]


def test_a_dance_is_played_and_filmed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra peers)")
    from PIL import Image

    small_dance().save(tmp_path / "dance.npz")
    words = ["play", str(tmp_path / "dance.npz"), "--out"]
    assert run([*words, str(tmp_path / "film.gif"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["stays_up"]
    assert told["kept"]
    assert told["touched"] == []
    assert told["played_s"] == pytest.approx(3.0)
    with Image.open(tmp_path / "film.gif") as film:
        assert film.size == (4 * 290, 480), "planned and played, each from the front and from the right"
        lasts = [film.seek(k) or film.info["duration"] for k in range(film.n_frames)]
    assert sum(lasts) == pytest.approx(3000, abs=80), "ms, pictures that are alike shown longer"
    assert min(lasts) == 40
    assert run([*words, str(tmp_path / "film.gif")]) == 2
    assert "--force" in capsys.readouterr().err
    assert run([*words, str(tmp_path / "film.avi")]) == 2
    assert ".gif or .mp4" in capsys.readouterr().err
