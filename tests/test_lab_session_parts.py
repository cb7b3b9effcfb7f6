"""What session.toml says of parts of a trial: exchanged labels, dropped markers, seconds left out."""

from pathlib import Path

import numpy as np
import pytest
from hidden_faults import hidden
from lab_sessions import two_trials

from biodance import describe_movement
from biodance.cycles.cut import Cycle, is_left_out
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.session.file import check_session_text, read_session_file
from biodance.lab.session.read import read_session
from biodance.records import LeftOutSpan


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return two_trials(tmp_path)


def told(folder: Path, text: str) -> None:
    (folder / "session.toml").write_text(text, encoding="utf-8")


def moving(folder: Path):
    return next(trial for trial in read_session(folder) if trial.role != "static")


def test_two_labels_take_each_other_s_places_for_a_span(folder):
    before = moving(folder)
    one, other = before.markers.names[:2]
    told(folder, f'[trials.{before.name}]\nexchange = [["{one}", "{other}", 0.2, 0.5]]\n')
    after = moving(folder)
    inside = (before.markers.time >= 0.2) & (before.markers.time <= 0.5)
    assert 0 < inside.sum() < inside.size
    np.testing.assert_array_equal(after.markers[one][inside], before.markers[other][inside])
    np.testing.assert_array_equal(after.markers[other][inside], before.markers[one][inside])
    np.testing.assert_array_equal(after.markers[one][~inside], before.markers[one][~inside])
    assert any("from 0.2 to 0.5 s" in line for line in after.history)


def test_a_whole_trial_is_exchanged_and_the_others_are_not(folder):
    before = read_session(folder)
    name = moving(folder).name
    one, other = before[name].markers.names[:2]
    told(folder, f'[trials.{name}]\nexchange = [["{one}", "{other}"]]\n')
    after = read_session(folder)
    np.testing.assert_array_equal(after[name].markers[one], before[name].markers[other])
    static = next(trial.name for trial in before if trial.role == "static")
    np.testing.assert_array_equal(after[static].markers.xyz, before[static].markers.xyz)


def test_dropped_markers_are_gone_and_a_slip_of_the_pen_is_said(folder):
    gone = moving(folder).markers.names[0]
    told(folder, f'[markers]\ndrop = ["{gone}", "NOBODY"]\n')
    session = read_session(folder)
    assert all(gone not in trial.markers.names for trial in session)
    assert any("NOBODY" in note for note in session.notes)
    assert not any(f"'{gone}', which no trial has" in note for note in session.notes)


def test_an_exchange_with_a_label_that_is_not_there_is_said(folder):
    trial = moving(folder)
    told(folder, f'[trials.{trial.name}]\nexchange = [["{trial.markers.names[0]}", "NOBODY"]]\n')
    assert any("NOBODY" in line for line in moving(folder).warnings)


def test_forces_of_a_span_that_is_left_out_are_unknown(folder):
    name = moving(folder).name
    told(folder, f"[trials.{name}]\nleave_out = [[0.2, 0.5]]\n")
    trial = moving(folder)
    time, value = trial.plates[0].wrench.time, trial.plates[0].wrench.value
    inside = (time >= 0.2) & (time <= 0.5)
    assert np.isnan(value[inside]).all()
    assert np.isfinite(value[~inside]).all()
    assert trial.left_out == (LeftOutSpan(0.2, 0.5),)


def test_the_forces_stay_where_the_steps_of_one_foot_are_left_out(folder):
    name = moving(folder).name
    told(folder, f'[trials.{name}]\nleave_out = [[0.2, 0.5, "left"]]\n')
    trial = moving(folder)
    assert np.isfinite(trial.plates[0].wrench.value).all()
    assert trial.left_out == (LeftOutSpan(0.2, 0.5, "left"),)


@pytest.mark.parametrize(
    ("span", "out"),
    [
        (LeftOutSpan(1.0, 2.0), True),
        (LeftOutSpan(1.4, 1.45), True),
        (LeftOutSpan(1.4, 1.45, "left"), True),
        (LeftOutSpan(1.4, 1.45, "right"), False),
        (LeftOutSpan(0.0, 1.01), False),  # the step before, whose end is this one's beginning
        (LeftOutSpan(1.99, 3.0), False),
        (LeftOutSpan(0.0, 1.1), True),
    ],
)
def test_which_cycle_a_span_leaves_out(span, out):
    assert is_left_out(Cycle("walk", "gait", "left", 1.0, 2.0, 1.6), [span]) is out


def test_a_squat_that_reaches_into_a_span_left_out_is_not_told(tmp_path):
    folder = hidden(tmp_path / "S01", trials=("static", "squat_1"))
    whole = describe_movement(folder)["squat_1"].cycles
    assert len(whole) > 1
    middle = (whole[0].start + whole[0].end) / 2
    text = (folder / "session.toml").read_text(encoding="utf-8")
    (line,) = [one for one in text.splitlines() if one.startswith("[trials.") and "squat_1" in one]
    told(folder, text.replace(line, f"{line}\nleave_out = [[{middle - 0.01}, {middle + 0.01}]]"))
    left = describe_movement(folder)["squat_1"].cycles
    assert [one.start for one in left] == pytest.approx([one.start for one in whole[1:]], abs=0.02)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('[trials.a]\nexchange = [["LKNE"]]', "exchange"),
        ('[trials.a]\nexchange = [["LKNE", "LKNE"]]', "exchange"),
        ('[trials.a]\nexchange = [["LKNE", "RKNE", 2.0, 1.0]]', "exchange"),
        ('[trials.a]\nexchange = [["LKNE", "RKNE", 2.0]]', "exchange"),
        ('[trials.a]\nevents = [{side = "left", kind = "strike"}]', "time in s"),
        ('[trials.a]\nevents = [{side = "left", kind = "strike", time = "1"}]', "time in s"),
        ('[trials.a]\nevents = [{side = "left", kind = "strike", time = nan}]', "time in s"),
        ('[trials.a]\nevents = [{side = "left", kind = "stirke", time = 1}]', "strike, off"),
        ('[trials.a]\nevents = [{side = "both", kind = "strike", time = 1}]', "left, right"),
        ('[trials.a]\nevents = [{side = "left", kind = "off", tiem = 1}]', "Did you mean 'time'"),
        ("[trials.a]\nleave_out = [[2.0]]", "leave_out"),
        ("[trials.a]\nleave_out = [[2.0, 1.0]]", "leave_out"),
        ("[trials.a]\nleave_out = [[1.0, nan]]", "leave_out"),
        ('[trials.a]\nleave_out = [[1.0, 2.0, "rigth"]]', "leave_out"),
        ('[markers]\ndrop = "T10"', "drop"),
        ('[markers.map]\nLASI = "left_assis"', "left_assis"),
        ("[settings]\nfilter.cutof = 6", "cutof"),
    ],
)
def test_what_is_not_legal_is_refused_before_it_is_written(folder, text, word):
    with pytest.raises(SessionRefused if "map" not in text else Exception, match=word):
        check_session_text(folder / "session.toml", text)


def event(side: str, kind: str, time: float) -> str:
    return f'{{side = "{side}", kind = "{kind}", time = {time}}}'


def test_strikes_and_offs_of_a_foot_are_read_in_the_order_of_time(folder):
    before = moving(folder)
    assert before.events == ()
    some = ", ".join([event("left", "off", 0.6), event("left", "strike", 0.2), event("right", "strike", 0.5)])
    told(folder, f"[trials.{before.name}]\nevents = [{some}]\n")
    trial = moving(folder)
    assert [(one.time, one.side, one.down, one.source) for one in trial.events] == [
        (0.2, "left", True, "hand"),
        (0.5, "right", True, "hand"),
        (0.6, "left", False, "hand"),
    ]
    assert any("3 strikes and offs of the right and left foot were set by hand" in line for line in trial.history)


@pytest.mark.parametrize(("kind", "missing"), [("strike", "no off"), ("off", "no strike")])
def test_a_strike_without_an_off_and_an_off_without_a_strike_are_refused(folder, kind, missing):
    other = event("right", "off" if kind == "strike" else "strike", 1.0)  # of the other foot: it helps nothing
    text = f"[trials.a]\nevents = [{event('left', kind, 0.5)}, {other}, {event('left', kind, 1.5)}]"
    with pytest.raises(SessionRefused, match=rf"left {kind} at 0.5 s and then the left {kind} at 1.5 s with {missing}"):
        check_session_text(folder / "session.toml", text)


def test_an_event_that_is_not_within_the_recording_refuses_it(folder):
    name = moving(folder).name
    told(folder, f"[trials.{name}]\nevents = [{event('left', 'strike', 7.5)}]\n")
    session = read_session(folder)
    assert [trial.role for trial in session] == ["static"]
    (why,) = session.refused.values()
    assert "left strike at 7.5 s" in why
    assert "0 to 0.999 s" in why


def test_a_text_that_is_no_toml_is_refused_with_its_line(folder):
    with pytest.raises(FileRefused, match="line 2"):
        check_session_text(folder / "session.toml", "[subject]\nmass_kg = 60,3")


def test_the_exact_name_wins_over_a_pattern(folder):
    told(folder, '[trials."s*"]\nleave_out = [[0, 1]]\n[trials.squat]\nleave_out = []\n')
    said = read_session_file(folder)
    assert said.parts("squat").left_out == ()
    assert said.parts("stand").left_out == (LeftOutSpan(0.0, 1.0),)
