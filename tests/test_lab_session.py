"""The session folder: which files, which roles, what comes out where; everything guessed is said and one bad file
never stops the rest.
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import hidden
from lab_sessions import GRAVITY, MASS, plate, roles, said, table_of, two_trials, write_trial
from threadpoolctl import threadpool_info, threadpool_limits

from biodance.errors import SessionRefused
from biodance.lab.program_tables import write_mot
from biodance.lab.readers import read_trial
from biodance.lab.session.read import read_session
from biodance.lab.session.recordings import role_by_name
from biodance.lab.session.results_folder import results_folder
from biodance.records.attention import Doubt


@pytest.fixture
def folder(tmp_path):
    """A subject's folder with one session: a static and a squat, by name."""
    return two_trials(tmp_path)


def test_names_tell_the_roles(folder):
    write_trial(folder, "Walk02", speed=1.2)
    session = read_session(folder)
    assert roles(session) == {"Walk02": "fit", "squat_1": "validate", "static01": "static"}
    assert dict(session.refused) == {}
    assert "static01 has the role static: guessed from its name" in said(session)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("Static_trial", "static"),
        ("CB_Static0001", "static"),
        ("cal 03", "static"),
        ("STATIC2", "static"),
        ("statique", None),
        ("subjectCalibration1", "static"),
        ("calf_raise", None),
        ("SquatDeep3", "validate"),
        ("sub1-squats-02", "validate"),
        ("walk", None),
        ("HC030A01", None),
    ],
)
def test_role_by_name(name, role):
    assert role_by_name(name) == role


def test_static_is_guessed_by_standing_still(tmp_path):
    write_trial(tmp_path, "A01")
    write_trial(tmp_path, "A02", speed=1.2)
    session = read_session(tmp_path)
    assert roles(session) == {"A01": "static", "A02": "fit"}
    assert "A01 has the role static: guessed" in said(session)


def test_single_frame_is_a_static(tmp_path):
    write_trial(tmp_path, "A01", frames=1, mass=None)
    write_trial(tmp_path, "A02", speed=1.2)
    session = read_session(tmp_path)
    assert roles(session)["A01"] == "static"
    assert "single frame" in said(session)


def test_session_without_a_static_says_so(tmp_path):
    write_trial(tmp_path, "A02", speed=1.2)
    session = read_session(tmp_path)
    assert session.of_role("static") == ()
    assert "no static trial" in said(session)


def test_static_that_walks_is_said(tmp_path):
    write_trial(tmp_path, "static", speed=1.2)
    (doubt,) = (note for note in read_session(tmp_path).notes if isinstance(note, Doubt))
    assert "its markers travel" in doubt
    assert doubt.level == "warn", "the body, the joints and what is judged as standing rest on it"


def test_eclipse_tells_role_and_invalid_plate(folder):
    write_trial(folder, "T05")
    (folder / "T05.Trial05.enf").write_bytes("[TRIAL_INFO]\r\nTYPE=Static\r\nFP1=Invalid\r\n".encode("cp1252"))
    write_trial(folder, "T06", speed=1.0)
    (folder / "T06.Trial.enf").write_text("[TRIAL_INFO]\nTYPE=Dynamic\nDESCRIPTION=Squat fast\n")
    session = read_session(folder)
    assert roles(session)["T05"] == "static"
    assert roles(session)["T06"] == "validate"
    trial = next(t for t in session.trials if t.name == "T05")
    assert any("FP1" in warning for warning in trial.warnings)


def test_one_bad_file_never_stops_the_session(folder):
    (folder / "broken.trc").write_text("PathFileType\nnonsense\n")
    (folder / "empty.trc").write_bytes(b"")
    (folder / "README.txt").write_text("the belt slipped in squat_1\n")
    session = read_session(folder)
    assert set(session.refused) == {"broken.trc", "empty.trc"}
    assert "is empty" in session.refused["empty.trc"]
    assert set(roles(session)) == {"squat_1", "static01"}


@pytest.mark.parametrize("wrong", ["nothing", "file", "empty", "only bad", "above"])
def test_folder_without_a_session_is_refused(tmp_path, folder, wrong):
    empty = tmp_path / "empty"
    empty.mkdir()
    bad = tmp_path / "bad"
    bad.mkdir()
    (bad / "x.trc").write_text("nonsense")
    place, sentence = {
        "nothing": (tmp_path / "absent", "no such folder"),
        "file": (folder / "static01.trc", "is a file"),
        "empty": (empty, "Legal are files of the formats .c3d"),
        "only bad": (bad, "its only file, .*cannot be read"),
        "above": (folder.parent, "but these folders do: visit"),
    }[wrong]
    with pytest.raises(SessionRefused, match=sentence):
        read_session(place)


def test_a_single_c3d_file_is_a_session_with_what_session_toml_beside_it_says(tmp_path):
    place = hidden(tmp_path / "S01", trials=("static", "squat_1"))
    session = read_session(place / "squat_1.c3d")
    whole = read_session(place)
    assert roles(session) == {"squat_1": whole["squat_1"].role}
    assert session.subject == whole.subject
    assert session.folder == place
    assert "squat_1.c3d was read alone." in session.notes
    with pytest.raises(SessionRefused, match="no such folder"):
        read_session(place / "squat_9.c3d")


def test_parts_of_a_session_in_folders_of_their_own(tmp_path):
    write_trial(tmp_path / "static", "T01")
    write_trial(tmp_path / "dynamic", "T01", speed=1.1)
    assert roles(read_session(tmp_path)) == {"T01": "fit", "static_T01": "static"}


def test_files_are_told_before_they_are_read(folder):
    told = []
    read_session(folder, tell=told.append)
    assert told == ["squat_1.trc", "static01.trc"]


def test_markers_and_forces_of_one_stem_are_one_trial(folder):
    trial = read_trial(folder / "static01.trc")
    assert trial.source.format == "TRC + MOT"
    assert trial.markers.names[0] == "LFHD"
    assert trial.plates[0].wrench.force[:, 2].mean() == pytest.approx(MASS * GRAVITY, rel=1e-3)
    assert trial.source.analog_rate == pytest.approx(1000)
    alone = read_trial(folder / "static01.mot")
    assert alone.markers is None
    assert len(alone.plates) == 1


def test_damaged_forces_leave_the_markers(folder):
    (folder / "static01.mot").write_text("nonsense")
    session = read_session(folder)
    trial = next(t for t in session.trials if t.name == "static01")
    assert trial.plates == ()
    assert "forces beside the markers were left out" in " ".join(trial.warnings)
    assert dict(session.refused) == {}


def test_forces_of_another_time_are_said(folder):
    (folder / "static01.mot").unlink()

    write_mot(folder / "static01_grf.mot", table_of((plate(frames=300),)))
    assert any("may not belong together" in warning for warning in read_trial(folder / "static01.trc").warnings)


@pytest.mark.parametrize(
    ("place", "static", "subject"),
    [
        ("biomechzoo/HC030A", "HC030A01", (45.8, 1.48, "F")),
        ("biomechzoo/HC038A", "HC038A01", (56.8, 1.74, "M")),
        ("pycgm", "Static_trial", (85.0, 1.679, "F")),
        ("adl_gait", "2014001_ST", (67.0, 1.655, "M")),
        ("c3d_parser", "CB_Static0001", (36.3, 1.425, "F")),
    ],
)
def test_real_session_finds_static_and_subject(place, static, subject, data):
    session = read_session(data / place)
    assert [trial.name for trial in session.of_role("static")] == [static]
    assert session.of_role("fit")
    assert dict(session.refused) == {}
    np.testing.assert_allclose([session.subject.mass, session.subject.stature], subject[:2], rtol=1e-3)
    assert session.subject.sex == subject[2]


def test_results_get_a_folder_of_their_own(folder):
    made = results_folder(folder / "biodance", folder)
    assert made.place == (folder / "biodance").resolve()
    (made.part / "results.json").write_text("{}")
    assert read_session(folder).refused == {}
    assert made.finish(folder, {}) is None
    with pytest.raises(SessionRefused, match="nothing is overwritten"):
        results_folder(folder / "biodance", folder)
    assert results_folder(folder / "biodance", folder, force=True) == made
    assert read_session(folder).refused == {}


@pytest.mark.parametrize("force", [False, True])
def test_results_never_lie_among_recordings_or_strangers(tmp_path, folder, force):
    other = tmp_path / "S02"
    write_trial(other, "static01")
    strange = tmp_path / "letters"
    strange.mkdir()
    (strange / "letter.odt").write_text("dear")
    for place, sentence in (
        (folder, "among the recordings"),
        (folder.parent, "among"),
        (other, "recordings"),
        (strange, "holds files"),
    ):
        with pytest.raises(SessionRefused, match=sentence):
            results_folder(place, folder, force=force)
    with pytest.raises(SessionRefused, match="is a file"):
        results_folder(folder / "static01.trc", folder, force=force)


@pytest.mark.parametrize(
    "names",
    [
        ("Static/s1", "Straight/w1", "Turn/t1"),
        ("static01", "Slow/w1", "Fast/w1", "Fast/again/w2"),
        ("Static/s1", "walk01"),
        ("Day 1/cal1", "Day 1/w1", "Conditions/Slow/w1"),
    ],
)
def test_nothing_in_a_natural_layout_is_left_out(tmp_path, names):
    for number, name in enumerate(names):
        write_trial(tmp_path / Path(name).parent, Path(name).name, seed=number)
    session = read_session(tmp_path)
    assert len(session.trials) == len(names)
    assert sum(trial.role == "static" for trial in session.trials) == 1
    assert len({trial.name for trial in session.trials}) == len(names)


def test_sessions_of_their_own_are_named_and_left_aside(tmp_path):
    for name in ("static01", "walk", "Day 2/static01", "Day 2/walk"):
        write_trial(tmp_path / Path(name).parent, Path(name).name, seed=len(name))
    session = read_session(tmp_path)
    assert len(session.trials) == 2
    assert any("Day 2 (2 recordings) was left aside: it is a session of its own" in note for note in session.notes)
    days = tmp_path / "Day 2" / "x"
    for day in ("A", "B"):
        write_trial(days / day, "static01")
        write_trial(days / day, "walk")
    with pytest.raises(SessionRefused, match="these folders do: A, B"):
        read_session(days)


def test_markers_and_forces_in_folders_of_their_own_and_copies(tmp_path):
    for name in ("static1", "walk1"):
        write_trial(tmp_path / "MarkerData", name, mass=None, speed=0.0 if name == "static1" else 1.0)
        write_mot(tmp_path / "MarkerData" / f"{name}_forces.mot", table_of((plate(),)))
    (tmp_path / "ID").mkdir()
    for path in (tmp_path / "MarkerData").glob("*_forces.mot"):
        path.rename(tmp_path / "ID" / path.name)
    (tmp_path / "Copies").mkdir()
    (tmp_path / "Copies" / "walk1.trc").write_bytes((tmp_path / "MarkerData" / "walk1.trc").read_bytes())
    session = read_session(tmp_path)
    assert session.refused == {}
    assert [len(trial.plates) for trial in session.trials if trial.name == "static1"] == [1]
    assert sorted(trial.name for trial in session.trials) == ["static1", "walk1"]
    assert any("is a copy of" in note for note in session.notes)


def test_two_runs_never_write_into_one_folder(tmp_path, folder):
    out = results_folder(tmp_path / "out", folder)
    assert results_folder(tmp_path / "out", folder) == out  # this process holds it
    lock = next(out.part.glob(".*lock"))
    other = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        lock.write_text(f"{other.pid} {platform.node()}")
        with pytest.raises(SessionRefused, match=f"process {other.pid} on .* is writing there"):
            results_folder(tmp_path / "out", folder)
    finally:
        other.communicate(b"\n")
    assert results_folder(tmp_path / "out", folder) == out  # that one has ended
    assert lock.read_text().startswith(f"{os.getpid()} ")


def test_reading_keeps_to_one_thread_of_linear_algebra(tmp_path: Path) -> None:
    folder, seen = two_trials(tmp_path), list[int]()

    def count(_: str) -> None:
        seen.extend(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")

    with threadpool_limits(2, user_api="blas"):
        read_session(folder, tell=count)
    assert set(seen) == {1}
