"""What was accepted as wrong with a plate is taken off the recordings exactly: the faults are made here, by hand."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plate_trials import CENTRE, CORNERS, FORCE, POINT, TIME, trial

from biodance.errors import FileRefused
from biodance.lab.c3d.write import write_trial
from biodance.lab.plates.faults import (
    PlateCorrection,
    corrected_session,
    corrected_trial,
    corrections_text,
    joined_corrections,
    read_corrections,
)
from biodance.lab.readers import read_trial
from biodance.lab.session.file import read_session_file
from biodance.pipeline.accepted import write_corrected
from biodance.pipeline.lab_file import read_lab
from biodance.records import FootEvent, LeftOutSpan, Plate, Session, Subject, Trial, Wrench


def off(one: Trial, correction: PlateCorrection) -> float:
    """Return the largest difference, N or N·m, of the corrected trial from the true one, the delay's ends left out."""
    found = corrected_trial(one, [correction]).plates[0].wrench.value
    return float(np.abs(found - trial().plates[0].wrench.value)[50:-50].max())


def test_a_plate_that_the_file_puts_elsewhere_is_moved_back() -> None:
    shift = np.array([0.03, 0.0, 0.0])
    wrong = trial(point=POINT + shift, corners=CORNERS + shift)
    correction = PlateCorrection("plate_position", "plate1:x", 0.03)
    assert off(wrong, correction) < 1e-9
    np.testing.assert_allclose(corrected_trial(wrong, [correction]).plates[0].corners, CORNERS, atol=1e-12)
    assert "plate position plate1:x (shift 0.03 m)" in corrected_trial(wrong, [correction]).history[-1]


def test_a_turned_plate_is_turned_back() -> None:
    turn = np.array([[np.cos(0.05), -np.sin(0.05), 0], [np.sin(0.05), np.cos(0.05), 0], [0, 0, 1]])
    wrong = trial(force=FORCE @ turn.T, point=CENTRE + (POINT - CENTRE) @ turn.T)
    assert off(wrong, PlateCorrection("plate_rotation", "plate1:z", 0.05)) < 1e-9


def test_gain_crosstalk_offset_and_delay_are_taken_off() -> None:
    local = np.hstack([FORCE, np.cross(POINT - CENTRE, FORCE)])
    changed = {
        ("plate_gain", "Fz", 0.04): local * [1, 1, 1.04, 1, 1, 1],
        ("plate_crosstalk", "Fz->My", 0.01): local + 0.01 * local[:, 2:3] * np.eye(6)[4],
        ("plate_offset", "plate1:Fx", -6.0): local - 6.0 * np.eye(6)[0],
    }
    for cause, value in changed.items():
        wrench = Wrench(TIME, np.hstack([value[:, :3], value[:, 3:] + np.cross(CENTRE, value[:, :3])]))
        one = replace(trial(), plates=(Plate("plate1", 2, CORNERS, wrench),))
        assert off(one, PlateCorrection(*cause)) < 1e-9
    late = trial()
    plate = late.plates[0]
    late = replace(late, plates=(replace(plate, wrench=Wrench(TIME, np.roll(plate.wrench.value, 12, axis=0))),))
    assert off(late, PlateCorrection("time_delay", "", 0.012)) < 1e-6


def test_a_delay_is_taken_off_a_trial_whose_ends_are_not_known() -> None:
    """The first 40 samples were padded, ten in the middle lost: held before the first, lost where they were."""
    plate = trial().plates[0]
    value = np.roll(plate.wrench.value, 20, axis=0)
    value[:40], value[300:310] = np.nan, np.nan
    wrong = replace(trial(), plates=(replace(plate, wrench=Wrench(TIME, value)),))
    found = corrected_trial(wrong, [PlateCorrection("time_delay", "", 0.02)]).plates[0].wrench.value
    lost = np.flatnonzero(np.isnan(found).any(axis=1))
    assert set(range(280, 290)) <= set(lost) <= set(range(279, 291))
    kept = np.setdiff1d(np.arange(30, TIME.size - 30), lost)
    np.testing.assert_allclose(found[kept], plate.wrench.value[kept], atol=1e-3)
    assert np.isfinite(found[:100]).all()


def test_a_plate_that_is_not_meant_stays_as_it_is() -> None:
    same = corrected_trial(trial(), [PlateCorrection("plate_position", "plate2:x", 0.03)])
    np.testing.assert_array_equal(same.plates[0].wrench.value, trial().plates[0].wrench.value)
    assert not same.history


def test_a_lab_file_comes_back_and_adds_up(tmp_path: Path) -> None:
    first = (PlateCorrection("plate_position", "plate1:x", 0.03, 0.001, 'session "A"'),)
    later = (PlateCorrection("plate_position", "plate1:x", 0.002), PlateCorrection("plate_gain", "Fz", 0.04))
    both = joined_corrections(first, later)
    path = tmp_path / "lab.toml"
    path.write_text(corrections_text(both))
    again = read_corrections(path)
    assert [(one.effect, one.target, round(one.value, 6)) for one in again] == [
        ("plate_position", "plate1:x", 0.032),
        ("plate_gain", "Fz", 0.04),
    ]
    assert again[0].source.startswith('session "A"')
    assert repr(read_lab(path).corrections) == repr(again)  # an unknown sd is nan, which equals nothing
    assert read_lab(None).corrections == ()


@pytest.mark.parametrize(
    ("effect", "target", "values"), [("plate_gain", "Fz", (0.3, 0.2)), ("plate_position", "plate1:x", (0.03, 0.01))]
)
def test_what_is_accepted_twice_is_what_one_correction_after_the_other_does(
    effect: str, target: str, values: tuple[float, float]
) -> None:
    first, later = (PlateCorrection(effect, target, value) for value in values)
    in_turn = corrected_trial(corrected_trial(trial(), [first]), [later]).plates[0]
    at_once = corrected_trial(trial(), joined_corrections([first], [later])).plates[0]
    np.testing.assert_allclose(at_once.wrench.value, in_turn.wrench.value, atol=1e-9)
    np.testing.assert_allclose(at_once.corners, in_turn.corners, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[corrections.added_mass."trunk"]\nmass = 1', "nothing that can be corrected"),
        ('[corrections.plate_position."plate1:x"]\nshift = "far"', "expected a number in m"),
        ('[corrections.plate_position."x"]\nshift = 0.03', "no such target"),
        ("corrections = 3", "expected tables"),
        ("[corrections", "is not valid TOML"),
    ],
)
def test_a_wrong_lab_file_is_refused_in_a_sentence(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "lab.toml").write_text(text)
    with pytest.raises(FileRefused, match=said):
        read_corrections(tmp_path / "lab.toml")


def test_corrected_trials_are_a_session_that_is_not_corrected_twice(tmp_path: Path) -> None:
    shift = np.array([0.03, 0.0, 0.0])
    wrong = trial(point=POINT + shift, corners=CORNERS + shift)
    write_trial(wrong, tmp_path / "t.c3d")
    session = Session(Subject(66.0, 1.7, "F", 30.0), (replace(wrong, role="fit"),), tmp_path)
    made = (PlateCorrection("plate_position", "plate1:x", 0.03),)
    written, refused = write_corrected(session, (), made, tmp_path / "corrected")
    assert (written, refused) == (("t",), ())
    back = read_trial(tmp_path / "corrected" / "t.c3d", role="fit")
    np.testing.assert_allclose(back.plates[0].wrench.value, trial().plates[0].wrench.value, atol=0.01)
    folder = replace(session, trials=(back,), folder=tmp_path / "corrected")
    assert corrected_session(folder, made).trials[0].history == back.history
    once = corrected_session(session, made)
    assert corrected_session(once, made).trials[0].history == once.trials[0].history
    assert (tmp_path / "t.c3d").stat().st_mtime <= (tmp_path / "corrected" / "t.c3d").stat().st_mtime


def test_a_corrected_copy_says_no_more_of_the_person_than_was_known(tmp_path: Path) -> None:
    person = Subject(66.0, 1.7, "F", 30.0, guessed=("mass", "sex"))
    own = replace(trial(), role="fit", marker_set=str(tmp_path / "own.toml"))
    write_corrected(Session(person, (own,), tmp_path), (), (), tmp_path / "corrected")
    said = tomllib.loads((tmp_path / "corrected/session.toml").read_text())
    assert said["subject"] == {"height_m": 1.7, "age": 30.0}
    assert said["markers"] == {"file": str((tmp_path / "own.toml").resolve())}


def test_a_corrected_copy_keeps_what_the_analyst_said_of_the_steps(tmp_path: Path) -> None:
    spans = (LeftOutSpan(0.1, 0.2), LeftOutSpan(0.3, 0.4, "left"))
    events = (FootEvent(0.1, "left", True, "hand"), FootEvent(0.25, "left", False, "hand"))
    told = replace(trial(), role="fit", left_out=spans, events=events)
    write_corrected(Session(Subject(66.0, 1.7, "F", 30.0), (told,), tmp_path), (), (), tmp_path / "corrected")
    parts = read_session_file(tmp_path / "corrected").parts("t")
    assert (parts.left_out, parts.events) == (spans, events)
