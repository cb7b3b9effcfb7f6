"""Who was recorded: session.toml first, then the files of the system, then a guess that is said."""

import numpy as np
import pytest
from lab_sessions import MASS, STATURE, person, plate, roles, said, two_trials, write_trial

from biodance.errors import SessionRefused
from biodance.lab.markers.upright import is_still, movement, standing_mass
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.file import read_session_file
from biodance.lab.session.read import read_session
from biodance.records import Source, Trial


@pytest.fixture
def folder(tmp_path):
    """A subject's folder with one session: a static and a squat, by name."""
    return two_trials(tmp_path)


def test_subject_of_session_toml_comes_first(folder):
    (folder / "session.toml").write_text(
        '[subject]\nmass_kg = 62\nheight_m = 1.7\nsex = "M"\nage = 40\n[trials."squat*"]\nrole = "check"\n'
    )
    (folder / "Anna.mp").write_text("$Bodymass = 80\n$Height = 1650\n$LLegLength = 870\n")
    session = read_session(folder)
    assert (session.subject.mass, session.subject.stature, session.subject.sex, session.subject.age) == (
        62,
        1.7,
        "M",
        40,
    )
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
    assert subject.stature == pytest.approx(STATURE, abs=0.025)  # places of markers on it are those of four people
    assert "read from quiet standing on the plates in static01" in notes
    assert "were guessed from the heights over the ankles of the head markers, the jugular notch, C7" in notes
    assert subject.guessed == ("mass", "stature", "sex")


def test_unknown_mass_and_stature_stay_nan_and_are_said(tmp_path):
    walking = person(speed=1.2)
    write_trc(tmp_path / "walk.trc", walking.select([name for name in walking.names if "ANK" not in name]))
    session = read_session(tmp_path)
    assert np.isnan([session.subject.mass, session.subject.stature]).all()
    assert "Set mass_kg" in said(session)
    assert "Set height_m" in said(session)
    with pytest.raises(SessionRefused, match="the mass and stature are not known"):
        session.subject.require("mass", "stature")


def test_without_plates_a_middling_mass_is_taken_and_said(tmp_path):
    write_trial(tmp_path, "static", mass=None)
    session = read_session(tmp_path)
    assert session.subject.mass == pytest.approx(22.5 * session.subject.stature**2, abs=0.06)
    assert "mass" in session.subject.guessed
    assert "the movement does not depend on it, forces and loads do" in said(session)


def test_beside_plates_no_mass_is_made_up(tmp_path):
    write_trial(tmp_path, "static", mass=None)
    write_trial(tmp_path, "walk", speed=1.2)
    assert np.isnan(read_session(tmp_path).subject.mass)


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
    """A trial of nothing but the given markers and plates."""
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


def test_subject_folder_fills_in_what_the_session_leaves_out(folder):
    (folder.parent / "subject.toml").write_text(
        '[subject]\nmass_kg = 60\nheight_m = 1.7\nsex = "F"\n[trials."squat*"]\nrole = "fit"\n'
    )
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
        ("[subject\n", "is not valid TOML: .* Correct that line"),
        ("[subject]\nmass_kg = 60,3\n", "Write decimals with a point: 60.3"),
    ],
)
def test_mistake_in_session_toml_is_a_sentence(tmp_path, text, sentence):
    (tmp_path / "session.toml").write_text(text)
    with pytest.raises(ValueError, match=sentence) as caught:
        read_session_file(tmp_path)
    assert "session.toml" in str(caught.value)
