"""The session folder: which files, which roles, who it is; everything guessed is said and one bad file never stops the rest."""

import os
from pathlib import Path

import numpy as np
import pytest
from lab_sessions import GRAVITY, MASS, STATURE, person, plate, write_trial

from biodance.errors import FileRefused, SessionRefused
from biodance.lab.read import format_of, read_trial
from biodance.lab.results_folder import results_folder
from biodance.lab.roles import role_by_name
from biodance.lab.session import read_session
from biodance.lab.session_file import read_session_file
from biodance.lab.weight import is_still, movement, standing_mass
from biodance.records import Source, Trial


@pytest.fixture
def folder(tmp_path):
    """A subject's folder with one session: a static and a squat, by name."""
    session = tmp_path / "S01" / "visit"
    write_trial(session, "static01")
    write_trial(session, "squat_1", speed=1.0)
    return session


def roles(session):
    return {trial.name: trial.role for trial in session.trials}


def said(session):
    return " ".join(session.notes)


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
    assert "its markers travel" in said(read_session(tmp_path))


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
        "only bad": (bad, "none of its 1 files can be read"),
        "above": (folder.parent, "but these folders do: visit"),
    }[wrong]
    with pytest.raises(SessionRefused, match=sentence):
        read_session(place)


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
    from biodance.lab.ground_forces import table_of
    from biodance.lab.mot import write_mot

    write_mot(folder / "static01_grf.mot", table_of((plate(frames=300),)))
    assert any("may not belong together" in warning for warning in read_trial(folder / "static01.trc").warnings)


# --- the subject -------------------------------------------------------------------------------------------------------------


def test_subject_of_session_toml_comes_first(folder):
    (folder / "session.toml").write_text(
        '[subject]\nmass_kg = 62\nheight_m = 1.7\nsex = "M"\nage = 40\n[trials."squat*"]\nrole = "check"\n'
    )
    (folder / "Anna.mp").write_text("$Bodymass = 80\n$Height = 1650\n$LLegLength = 870\n")
    session = read_session(folder)
    assert (session.subject.mass, session.subject.stature, session.subject.sex, session.subject.age) == (62, 1.7, "M", 40)
    assert session.subject.measurements["LLegLength"] == pytest.approx(0.87)
    assert roles(session)["squat_1"] == "check"
    assert "body mass is 62 kg in session.toml but 80 kg in Anna.mp" in said(session)


def test_subject_of_vicon_files(folder):
    (folder / "Anna.mp").write_text("$Bodymass = 62.1\n$Height = 1690\n")
    (folder / "Anna.vsk").write_text("not xml")
    session = read_session(folder)
    assert (session.subject.mass, session.subject.stature) == (62.1, 1.69)
    assert "not valid XML" in session.refused["Anna.vsk"]
    assert "sex is not given" in said(session)
    assert "age is not given" in said(session)


def test_mass_and_stature_are_estimated_last_and_said(folder):
    subject = read_session(folder).subject
    notes = said(read_session(folder))
    assert subject.mass == pytest.approx(MASS, rel=1e-3)
    assert subject.stature == pytest.approx(STATURE, abs=0.01)
    assert "read from quiet standing on the plates in static01" in notes
    assert "guessed from the height of C7 in static01" in notes
    assert subject.guessed == ("mass", "stature", "sex")


def test_unknown_mass_and_stature_stay_nan_and_are_said(tmp_path):
    write_trial(tmp_path, "walk", speed=1.2, mass=None)
    session = read_session(tmp_path)
    assert np.isnan([session.subject.mass, session.subject.stature]).all()
    assert "Set mass_kg" in said(session)
    assert "Set height_m" in said(session)
    with pytest.raises(SessionRefused, match="the mass and stature are not known"):
        session.subject.require("mass", "stature")


def test_plates_that_contradict_the_declared_mass_are_said(folder):
    (folder / "session.toml").write_text("[subject]\nmass_kg = 70\n")
    session = read_session(folder)
    assert session.subject.mass == 70
    assert "kg in quiet standing in static01, but the body mass is 70.00 kg" in said(session)


def test_trials_of_two_people_are_said(tmp_path):
    write_trial(tmp_path, "static1")
    write_trial(tmp_path, "static2", mass=80)
    notes = said(read_session(tmp_path))
    assert "in static2, but the body mass is" in notes


def trial(markers=None, plates=(), tmp="x.c3d"):
    return Trial("x", "fit", markers, plates, Source(tmp, "", "TRC"))


def test_mass_needs_quiet_standing():
    assert standing_mass(trial(plates=(plate(mass=50),))) == pytest.approx(50, rel=1e-3)
    assert standing_mass(trial(person(speed=1.0), (plate(),))) is None
    assert standing_mass(trial(person(), (plate(mass=3),))) is None
    assert standing_mass(trial(person())) is None


def test_movement_is_measured_in_metres():
    assert movement(person(speed=1.0).select(["C7", "LASI"])) == pytest.approx(0.96, rel=0.02)
    assert is_still(trial(person()))
    assert not is_still(trial(person(speed=0.2)))


# --- session.toml ------------------------------------------------------------------------------------------------------------


def test_subject_folder_fills_in_what_the_session_leaves_out(folder):
    (folder.parent / "subject.toml").write_text('[subject]\nmass_kg = 60\nheight_m = 1.7\nsex = "F"\n[trials."squat*"]\nrole = "fit"\n')
    (folder / "session.toml").write_text("[subject]\nmass_kg = 62.5\n")
    session = read_session(folder)
    assert (session.subject.mass, session.subject.stature, session.subject.sex) == (62.5, 1.7, "F")
    assert roles(session)["squat_1"] == "fit"
    assert "subject.toml in S01 was followed" in said(session)


def test_exact_name_wins_over_pattern(folder):
    (folder / "session.toml").write_text('[trials."s*"]\nrole = "skip"\n[trials.STATIC01]\nrole = "static"\n')
    session = read_session(folder)
    assert roles(session) == {"static01": "static"}
    assert "squat_1.trc was left aside: session.toml says so" in said(session)


def test_entry_that_fits_no_recording_is_said(folder):
    (folder / "session.toml").write_text('[trials.squat1]\nrole = "fit"\n')
    assert "[trials.squat1] fits no recording of the session. Did you mean 'squat_1'?" in said(read_session(folder))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "[subject]\nmass = 60\n",
            r"\[subject\] has the unknown key 'mass'. Did you mean 'mass_kg'\? Legal: mass_kg, height_m",
        ),
        ("[subject]\nheight_m = 1750\n", "height_m = 1750.0 in .subject. is not legal: .* Give the stature in m"),
        ('[subject]\nmass_kg = "60"\n', "mass_kg = '60' .* is not legal"),
        ('[subject]\nsex = "female"\n', 'Write "F" or "M"'),
        ('[trials.a]\nrole = "statik"\n', "Legal are static, fit, validate, check, skip"),
        ('[trials.a]\nroll = "static"\n', r"\[trials.a\] has the unknown key 'roll'. Did you mean 'role'"),
        ("[person]\nage = 3\n", "the top level has the unknown key 'person'"),
        ("[subject\n", "is not valid TOML"),
    ],
)
def test_mistake_in_session_toml_is_a_sentence(tmp_path, text, sentence):
    (tmp_path / "session.toml").write_text(text)
    with pytest.raises(ValueError, match=sentence) as caught:
        read_session_file(tmp_path)
    assert "session.toml" in str(caught.value)


# --- the door ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.xlsx", b"PK\x03\x04 something", "Legal are .c3d, .trc"),
        ("a.mp", b"$Bodymass = 60\n", "holds Vicon measurements, not a recording"),
        ("a.enf", b"[TRIAL_INFO]\n", "holds Vicon Eclipse notes"),
        ("a.trc", b"", "is empty"),
    ],
)
def test_file_that_is_no_recording_is_refused(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileRefused, match=sentence):
        read_trial(tmp_path / name)


def test_missing_file_and_folder_are_refused(tmp_path):
    with pytest.raises(FileRefused, match="cannot be opened"):
        read_trial(tmp_path / "absent.c3d")
    with pytest.raises(FileRefused, match="is a folder"):
        read_trial(tmp_path)


def test_fault_in_a_reader_is_a_refusal_of_that_file(folder, monkeypatch):
    def broken(path, *, role):
        raise IndexError("index 3 is out of bounds")

    monkeypatch.setattr("biodance.lab.read.read_trc", broken)
    with pytest.raises(FileRefused, match=r"IndexError: index 3 .* Please report this file"):
        read_trial(folder / "static01.trc")


def test_content_counts_more_than_the_name(tmp_path, folder):
    path = tmp_path / "renamed.c3d"
    path.write_bytes((folder / "static01.trc").read_bytes())
    assert format_of(path) == ".trc"
    assert read_trial(path).markers.names[0] == "LFHD"
    table = tmp_path / "numbers.dat"
    table.write_text("1,2,3,4,5,6\n-1,2.5,3e-1,4,5,6\n")
    assert format_of(table) == ".asc"


# --- real sessions -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "static", "subject"),
    [
        ("biomechzoo/HC030A", "HC030A01", (45.8, 1.48, "F")),
        ("biomechzoo/HC038A", "HC038A01", (56.8, 1.74, "M")),
        ("pycgm", "Static_trial", (85.0, 1.679, "F")),
        ("adl_gait", "2014001_ST", (67.0, 1.655, "M")),
        ("c3d_parser", "CB_Static0001", (36.3, np.nan, "F")),
    ],
)
def test_real_session_finds_static_and_subject(place, static, subject):
    folder = os.environ.get("BIODANCE_DATA")
    if not folder:
        pytest.skip("BIODANCE_DATA is not set: no real recordings here")
    session = read_session(Path(folder) / place)
    assert [trial.name for trial in session.of_role("static")] == [static]
    assert len(session.of_role("fit")) == 1
    assert dict(session.refused) == {}
    np.testing.assert_allclose([session.subject.mass, session.subject.stature], subject[:2], rtol=1e-3)
    assert session.subject.sex == subject[2]


# --- where results go --------------------------------------------------------------------------------------------------------


def test_results_get_a_folder_of_their_own(folder):
    made = results_folder(None, folder)
    assert made == (folder / "biodance").resolve()
    assert made.is_dir()
    (made / "results.json").write_text("{}")
    with pytest.raises(SessionRefused, match="nothing is overwritten"):
        results_folder(None, folder)
    assert results_folder(None, folder, force=True) == made
    assert read_session(folder).refused == {}


@pytest.mark.parametrize("force", [False, True])
def test_results_never_lie_among_recordings_or_strangers(tmp_path, folder, force):
    other = tmp_path / "S02"
    write_trial(other, "static01")
    strange = tmp_path / "letters"
    strange.mkdir()
    (strange / "letter.odt").write_text("dear")
    for place, sentence in ((folder, "among the recordings"), (folder.parent, "among"), (other, "recordings"), (strange, "holds files")):
        with pytest.raises(SessionRefused, match=sentence):
            results_folder(place, folder, force=force)
    with pytest.raises(SessionRefused, match="is a file"):
        results_folder(folder / "static01.trc", folder, force=force)
