"""No verdict and no sentence contradicts a check or a trial that was not judged: all of them beside one another."""

import itertools
from dataclasses import replace

import pytest
from diagnosed_sessions import body
from example_results import FOUND, VERDICTS, full_session

from biodance.cli.session import exit_code
from biodance.cli.shared import DONE
from biodance.diagnosis.diagnosis import ABOUT, Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.reasons import DiagnosisStatus
from biodance.diagnosis.repairs import with_failed
from biodance.effects import QualityCheck
from biodance.pipeline.attention import (
    headline,
    identified_attention,
    open_attention,
    reconcile_with_checks,
    session_attention,
)
from biodance.pipeline.identification import NOT_WEIGHED
from biodance.pipeline.results import Placed
from biodance.pipeline.trial import Check, Step
from biodance.pipeline.words import in_words
from biodance.records.attention import Attention, Doubt, Judged, strongest_first
from biodance.report.tables.diagnosis import ATTENTION_ROW


def is_well(one: Diagnosis) -> bool:
    """Return whether nobody has to do anything: the exit code is 0."""
    return exit_code({"attention": ATTENTION_ROW.rows(one.attention)}) == DONE


GOOD = Check("marker distance, RMS", "walk", "8.0 mm", "at most 20 mm", True)

BAD = replace(GOOD, value="31.0 mm", inside=False)

HEAVY = Check("mass on the plates against declared", "static", "6.0 %", "at most 2 %", False, "Weigh again.")

WALK = Judged("walk", 0.0, "no 1 s of contact. More.", missed=True)

STATIC = Judged("static", 3.0)


def sessions():
    """Yield every verdict beside every check and trial, as `reconcile_with_checks` says it."""
    result = full_session()
    for one, check, row in itertools.product(VERDICTS, (GOOD, BAD, HEAVY), ((STATIC,), (STATIC, WALK), (WALK,))):
        trials = tuple(replace(trial, checks=()) for trial in result.trials)
        yield one, check, row, reconcile_with_checks(one, replace(result, trials=trials, checks=(check,)), row)


def test_no_verdict_contradicts_a_check_or_an_unjudged_trial() -> None:
    count = 0
    for before, check, rows, one in sessions():
        said = next(line for line in one.attention if line.about == ABOUT)
        whole = check.inside and not any(row.missed for row in rows)
        count += 1
        assert one.verdict != "named, complete" or whole
        assert said is one.attention[0]
        if one.verdict == "nothing wrong":
            assert ("could not be judged" in said.text) == (not whole)
            assert (said.level == "note") == whole == is_well(one)
        assert check.inside or check.what in [line.about for line in one.attention]
        if one.verdict == "unexplained":
            assert not one.findings
            assert said.text.startswith("Nobody can tell") == (one.status is DiagnosisStatus.CANNOT_TELL)
            assert before.verdict == one.verdict or one.status is not DiagnosisStatus.UNKNOWN or not check.inside
        assert not is_well(one) or whole
        assert list(one.attention) == list(strongest_first(one.attention))
        assert one.judged == rows
    assert count == 63


def test_forces_that_fit_a_doubtful_body_do_not_end_as_nothing_wrong() -> None:
    result = full_session()
    trials = tuple(replace(trial, checks=()) for trial in result.trials)
    fact = "the right thigh is 38 mm shorter than the left thigh"
    doubt = Doubt(fact, "Check the markers.", about=("right_thigh", "left_thigh"))
    odd = replace(body(), notes=(doubt,))
    doubtful = replace(result, trials=trials, checks=(), placed=Placed(odd, ""))
    one = reconcile_with_checks(Diagnosis(True, ()), doubtful, (STATIC,))
    assert one.verdict == "unexplained"
    assert one.status is DiagnosisStatus.CANNOT_TELL
    assert one.attention[0].text == f"Nobody can tell whether anything is wrong: {fact}. Mend it, and run this again."
    assert one.attention[1].text == f"{fact}. Check the markers."
    mended = replace(doubtful, placed=Placed(replace(odd, notes=(Doubt(fact, mended=True),)), ""))
    assert reconcile_with_checks(Diagnosis(True, ()), mended, (STATIC,)).status is DiagnosisStatus.CLEAN
    assert reconcile_with_checks(Diagnosis(True, (FOUND,)), doubtful, (STATIC,)).verdict == "named, incomplete"
    thigh = replace(FOUND, effect="segment_length", target="right_thigh")
    assert reconcile_with_checks(Diagnosis(True, (thigh,)), doubtful, (STATIC,)).verdict == "named, complete"


def test_a_session_whose_walks_were_all_left_out_cannot_tell() -> None:
    full = full_session()
    result = replace(full, trials=tuple(replace(trial, checks=()) for trial in full.trials), checks=())
    assert reconcile_with_checks(Diagnosis(True, ()), result, (STATIC,)).verdict == "nothing wrong"
    one = reconcile_with_checks(Diagnosis(True, ()), result, (replace(STATIC, seconds=0.0), WALK))
    assert one.verdict == "unexplained"
    assert one.attention[0].text.startswith("Nobody can tell whether anything is wrong: none of the movement")
    assert not is_well(one)


def test_a_unit_whose_factor_has_no_interval_is_told_in_words() -> None:
    said = "The plates carry 0.4536 times the declared weight: pounds declared as kilograms."
    quality = QualityCheck("weight on the plates", False, said, "unit_error", "", 0.4536, "factor", "1")
    one = with_failed((quality,), Diagnosis(False, ()))
    assert (
        headline(one, (), frozenset()).text == "A unit is mistaken by a factor of 0.45. Correct it, and run this again."
    )


def test_beside_a_refused_step_nothing_is_well() -> None:
    """Exit code 1, as of report and identify: no body could be made. Who was not weighed is only told so."""
    full = full_session()
    calm = replace(full, trials=tuple(replace(trial, checks=()) for trial in full.trials), checks=(), steps=())
    refused = replace(calm, steps=(Step("body", "refused", "No stature."),))
    told = [reconcile_with_checks(Diagnosis(True, ()), some, (STATIC,)) for some in (calm, refused)]
    assert [one.verdict for one in told] == ["nothing wrong", "nothing wrong"]
    assert [is_well(one) for one in told] == [True, False]
    light = reconcile_with_checks(Diagnosis(True, ()), replace(calm, weighed=None), (STATIC,))
    assert is_well(light)
    assert [line.text for line in light.attention[1:]] == [NOT_WEIGHED]


def test_a_check_points_to_the_cause_that_was_found() -> None:
    result = replace(full_session(), checks=(HEAVY,))
    plain = next(one for one in session_attention(result) if one.about == HEAVY.what)
    named = next(one for one in open_attention(result, [FOUND]) if one.about == HEAVY.what)
    assert plain.level == "warn"
    assert "Weigh again." in plain.text
    assert named.level == "note"
    assert "Plate gain Fz" in named.text
    assert "Weigh again." not in named.text


def test_sentences_come_strongest_first_and_once() -> None:
    note, fail = Attention("note", "a"), Attention("fail", "b")
    assert strongest_first([note, fail, note]) == (fail, note)


def test_a_size_that_is_hardly_known_says_so() -> None:
    shaky = replace(FOUND, parameters=(Estimate("gain", 0.06, 0.05, "1"),))
    assert "hardly known" in in_words(shaky)
    assert "hardly known" not in in_words(FOUND)
    assert "6 % too much (0 to 16)" in headline(Diagnosis(True, (shaky,)), (STATIC,), frozenset()).text


@pytest.mark.parametrize(("late", "told"), [(0.034, "forces late"), (-0.034, "forces early")])
def test_a_delay_says_in_words_which_way_it_goes(late: float, told: str) -> None:
    delayed = Finding("time_delay", "", (Estimate("delay", late, 0.004, "s"),), (Alias("time_delay", "", 80.0),), 0.9)
    assert in_words(delayed) == f"time delay (delay {1000 * late:.0f} ± 8 ms; {told})"
    unsure = replace(delayed, parameters=(Estimate("delay", late, 0.03, "s"),))
    assert told not in in_words(unsure)


def test_identify_says_first_what_the_checks_of_the_recordings_found() -> None:
    quality = QualityCheck(
        "labels of the markers", False, "A and B carry each other's names in walk.", "labels_swapped", "A/B"
    )
    full = full_session()
    first, *others = identified_attention(full, [quality])
    assert (first.level, first.about) == ("fail", ABOUT)
    assert first.text == "A and B carry each other's names. Exchange them, or accept the correction."
    assert ABOUT not in [one.about for one in others]
    assert identified_attention(full, []) == session_attention(full)


def test_a_static_trial_beside_the_plates_is_a_note() -> None:
    trial = full_session().trials[0]
    why = "Trial cal: it has no usable force plate, so there is no wrench to compare with."
    steps = (Step("track", "done"), Step("wrench", "refused", why))
    levels = []
    for role in ("static", "fit"):
        one = replace(trial, trial=replace(trial.trial, role=role), steps=steps, checks=(), comparison=None)
        said = session_attention(replace(full_session(), trials=(one,), checks=()))
        levels += [line.level for line in said if "no usable force plate" in line.text]
    assert levels == ["note", "warn"]
