"""Page, terminal and JSON over all verdicts, checks and unjudged trials: none of them says that all is well beside a
check outside its limit or a trial that was not judged.
"""

import itertools
import json
import re
from dataclasses import replace
from io import StringIO

import pytest
from example_results import FOUND, LEFT, UNLIKE, VERDICTS, WHOLE, full_session
from rich.console import Console

from biodance.cli.session import print_reported
from biodance.cli.shared import DONE, NEEDS_A_PERSON
from biodance.diagnosis.diagnosis import Diagnosis
from biodance.diagnosis.reasons import Reason
from biodance.pipeline.attention import _checked, reconcile_with_checks, session_attention
from biodance.pipeline.results import SessionDiagnosis
from biodance.pipeline.saved_results import provenance
from biodance.pipeline.trial import Check
from biodance.records.attention import Attention, Doubt, Judged, WrongWeight, told_together
from biodance.report.pages.diagnosis import diagnosis_page, diagnosis_section
from biodance.report.pages.session import page
from biodance.report.tables.diagnosis import ATTENTION_ROW, diagnosis_document
from biodance.report.tables.schema import to_text
from biodance.report.tables.session import results_document
from biodance.report.terminal import print_diagnosis, print_session

WELL = re.compile(
    r"nothing wrong(?! in what could be judged| was found in (?:[^.]|\.\d)*, but)|named, complete|"
    r"every check is inside|\bcomplete\b|\bnothing more is wrong",
    re.IGNORECASE,
)
"""What may not stand beside a failed check: an unlimited "nothing wrong", "complete" and their like."""
CHECKS = tuple(
    Check(what, "walk <1>", "9 units", "at most 5 units", False, "Look.")
    for what in (
        "mass on the plates against declared",
        "centre of mass off the centre of pressure, standing",
        "marker distance, RMS",
        "marker distance, largest",
        "posture left open",
        "markers not seen",
        "force difference, worst axis",
    )
)
FULL = full_session()
CALM = replace(FULL, checks=(), trials=tuple(replace(trial, checks=()) for trial in FULL.trials))
MADE = provenance(FULL, created="2026-01-01T00:00:00Z")
STATIC, MISSED = Judged("static", 3.0), Judged("walk", 0.0, "no 1 s of contact.", missed=True)


def surfaces(verdict: Diagnosis, check: Check, judged: tuple[Judged, ...]) -> dict[str, str]:
    """Return what page, terminal and JSON say, as plain text, of a verdict beside a check of a trial."""
    full = FULL
    trial = replace(full.trials[0], fit=None, comparison=None, standing=None, checks=(check,))
    result = replace(full, trials=(trial,), checks=(), standing=None)
    found = SessionDiagnosis(reconcile_with_checks(verdict, result, judged))
    made, first = MADE, found.diagnosis.attention
    numbers = json.loads(to_text(diagnosis_document(found)))
    screen = StringIO()
    console = Console(file=screen, width=1000)
    print_session(result, {"attention": ATTENTION_ROW.rows(first)}, console)
    print_diagnosis(numbers, console)
    pages = (
        page(result, made, attention=first, diagnosis=diagnosis_section(found)),
        diagnosis_page(result, found, made),
    )
    whole = to_text(results_document(result, made)) + to_text({**numbers, "verdict": ""})
    plain = [re.sub(r"<style>.*?</style>|<script>.*?</script>|<[^>]+>", " ", text, flags=re.DOTALL) for text in pages]
    return {"page": plain[0], "page of the diagnosis": plain[1], "terminal": screen.getvalue(), "JSON": whole}


@pytest.mark.parametrize("verdict", VERDICTS, ids=lambda one: f"{one.verdict} {one.doubted}{len(one.resembles)}")
def test_nothing_says_all_is_well_beside_a_failed_check_or_an_unjudged_trial(verdict: Diagnosis) -> None:
    inside, rows = replace(CHECKS[2], inside=True), ((STATIC, MISSED), (MISSED,))
    for check, judged in (*itertools.product(CHECKS, ((STATIC,),)), *itertools.product((inside, CHECKS[0]), rows)):
        for where, text in surfaces(verdict, check, judged).items():
            said = " ".join(text.split()).replace("as probable as nothing wrong", "").replace("named, incomplete", "")
            assert not WELL.findall(said), f"{where} beside {check.what} ({check.inside}): {WELL.search(said)}"
            if not check.inside:
                assert check.what[1:] in said, where


def test_too_little_time_on_the_plates_asks_nobody_for_anything() -> None:
    short = Check("fully measured", "walk", "0.32 s", "at least 0.5 s", False, "Record more.")
    one = reconcile_with_checks(WHOLE, replace(CALM, checks=(short,)), (STATIC,))
    assert (one.verdict, [said.level for said in one.attention]) == ("nothing wrong", ["note", "note"])


def test_diagnose_begins_with_its_headline() -> None:
    found = SessionDiagnosis(reconcile_with_checks(WHOLE, replace(FULL, checks=()), (STATIC,)))
    screen = StringIO()
    print_diagnosis(json.loads(to_text(diagnosis_document(found))), Console(file=screen, width=1000))
    assert screen.getvalue().startswith(found.diagnosis.attention[0].text)


@pytest.mark.parametrize(
    "reasons",
    [
        (Reason.UNUSUAL_BODY,),
        (Reason.OUTSIDE_TOLERANCES,),
        (Reason.UNUSUAL_BODY, Reason.OUTSIDE_TOLERANCES),
    ],
    ids=("body", "tolerance", "both"),
)
def test_what_is_strange_is_no_alarm_before_a_limit_is_broken(reasons: tuple[Reason, ...]) -> None:
    quiet, why = (replace(LEFT[0], z=1.0),), dict.fromkeys(reasons, ())
    strange = replace(WHOLE, explained=False, adequacy=quiet, why=why, resembles=(FOUND,))
    for one, level, begins in (
        (strange, "warn", "Nobody can tell whether anything is wrong"),
        (replace(strange, adequacy=LEFT, why=why | UNLIKE), "warn", "Nobody can tell whether anything is wrong"),
        (replace(strange, adequacy=LEFT, why=why | UNLIKE | {Reason.LIMIT_BROKEN: ()}), "fail", "Something is wrong"),
    ):
        found = reconcile_with_checks(one, CALM, (STATIC,))
        assert (found.attention[0].level, found.attention[0].text[: len(begins)]) == (level, begins)
        assert "It resembles plate gain Fz (gain 6 ± 0.4 %), which is not enough." in found.notes


@pytest.mark.parametrize("reason", [Reason.OUTSIDE_TOLERANCES, Reason.NOT_SURE, Reason.CONTRADICTED])
def test_a_broken_limit_leads_whatever_else_nobody_can_tell(reason: Reason) -> None:
    check = Check("force difference", "walk", "15.0 % of weight", "at most 8 %", False, "Look at it.")
    unsure = replace(WHOLE, explained=False, why={reason: ()})
    for checks, begins in (((check,), "Something is wrong"), ((), "Nobody can tell")):
        found = reconcile_with_checks(unsure, replace(CALM, checks=checks), (STATIC,))
        assert found.attention[0].text.startswith(begins)
    assert "15.0 % of weight" in reconcile_with_checks(unsure, replace(CALM, checks=(check,)), ()).attention[0].text


def test_what_lies_far_from_a_body_of_stature_alone_is_no_sign_of_a_fault_but_its_weight_is() -> None:
    far = Check("marker distance, RMS", "walk", "31 mm", "at most 20 mm", False, "Look at it.")
    heavy = Check("mass on the plates against declared", "walk", "9.0 ± 0.4 %", "at most 2 %", False, "Weigh again.")
    unscaled = replace(CALM, steps=())
    for result, check, begins in (
        (CALM, far, "Something is wrong: markers of walk lie 31 mm"),
        (unscaled, far, "Nobody can tell whether anything is wrong: the body comes from stature alone."),
        (unscaled, heavy, "Something is wrong: the weight on the plates in walk is 9.0 ± 0.4 %"),
    ):
        found = reconcile_with_checks(WHOLE, replace(result, checks=(check,)), (STATIC,))
        assert found.verdict == "unexplained"
        assert found.attention[0].text.startswith(begins)


@pytest.mark.parametrize(
    ("verdict", "judged", "then"),
    [
        (replace(WHOLE, explained=False), (MISSED,), "Mend what stands below"),
        (WHOLE, (replace(STATIC, seconds=0.0), MISSED), "Record a few squats"),
        (VERDICTS[5], (STATIC,), "Record a few squats"),
        (
            replace(VERDICTS[3], adequacy=(replace(LEFT[0], z=1.0),), why={Reason.UNUSUAL_BODY: ()}),
            (STATIC,),
            "Compare with another session of this person",
        ),
    ],
)
def test_who_cannot_tell_says_what_to_do_next(verdict: Diagnosis, judged: tuple[Judged, ...], then: str) -> None:
    first = reconcile_with_checks(verdict, CALM, judged).attention[0].text
    assert first.startswith("Nobody can tell")
    assert f". {then}" in first


def test_checks_of_one_limit_are_said_together() -> None:
    name = "force difference, worst axis"
    checks = [Check(name, f"walk_{k}", f"{k} % of weight", "at most 5 % of weight", False, "") for k in (6, 7)]
    lines = [_checked(check, ()) for check in checks]
    assert [one.trial for one in lines] == ["walk_6", "walk_7"]
    other = Attention("warn", "6 %, should be at most 4 %.", "walk_6", name)
    together = told_together([*lines, other])
    assert [one.trial for one in together] == ["", "walk_6"]
    assert together[0].text == "walk_6 6 % of weight, walk_7 7 % of weight, should be at most 5 % of weight."


def test_another_weight_is_said_once_and_a_slip_in_session_toml_is() -> None:
    mass = Check("mass on the plates against declared", "static", "2.9 %", "at most 2 %", False, "Weigh again.")
    trial = replace(FULL.trials[0], checks=(mass,), fit=None, comparison=None, standing=None)
    weighed = WrongWeight("The plates carry 72.2 kg in quiet standing, 70.2 kg are declared: check the mass.")
    trial = replace(trial, trial=replace(trial.trial, warnings=(weighed,)))
    session = replace(FULL.session, notes=(Doubt("[trials.wlak] fits no recording of the session"),))
    result = replace(CALM, session=session, trials=(trial,), standing=None)
    said = session_attention(result)
    assert sum("declared" in one.text + one.about for one in said) == 1
    assert any(one.text.startswith("[trials.wlak] fits no recording") for one in said)


def test_standing_still_has_no_correlation_on_the_terminal() -> None:
    screen = StringIO()
    moved = next(one for one in FULL.trials if one.comparison is not None)
    still = replace(moved, trial=replace(moved.trial, role="static"))
    print_session(replace(FULL, trials=(still, moved)), {"attention": ()}, Console(file=screen, width=200))
    rows = [line.split() for line in screen.getvalue().splitlines() if line.startswith(moved.trial.name)]
    assert rows[0][-1] == "–"
    assert float(rows[1][-1].replace("−", "-")) <= 1


@pytest.mark.parametrize(("verdict", "code"), [(WHOLE, DONE), (VERDICTS[1], NEEDS_A_PERSON), (None, DONE)])
def test_report_asks_for_a_person_whenever_its_diagnosis_does(verdict: Diagnosis | None, code: int, tmp_path) -> None:
    trial = replace(FULL.trials[0], fit=None, comparison=None, standing=None, checks=())
    result = replace(FULL, trials=(trial,), checks=(), standing=None)
    said = reconcile_with_checks(verdict, result, (STATIC,)).attention if verdict else ()
    found = {"attention": ATTENTION_ROW.rows(said), "diagnosis": None}
    assert print_reported(result, tmp_path, found, json=True) == code


def test_a_session_without_fault_may_say_so() -> None:
    check = replace(CHECKS[2], inside=True)
    for where, text in surfaces(WHOLE, check, (STATIC,)).items():
        assert "othing wrong" in text, where


def test_a_trial_with_a_failed_check_is_not_ok() -> None:
    trial = full_session().trials[0]
    assert replace(trial, checks=()).status == "ok"
    assert replace(trial, checks=(replace(CHECKS[0], inside=True),)).status == "ok"
    for check in CHECKS:
        one = replace(trial, checks=(check,))
        assert one.status == "warning"
        assert check.what[1:] in one.reason


SURE = replace(FOUND, probability=0.9712)
NAMED = replace(WHOLE, explained=True, findings=(SURE, replace(FOUND, effect="time_delay", probability=0.88)))
ALONE = {Reason.FORCES_LEFT: ()}


@pytest.mark.parametrize(
    ("verdict", "probability", "said"),
    [
        (replace(WHOLE, p_clean=0.93, p_unknown=0.02), 0.93, "Nothing is wrong in what was judged: P = 0.93."),
        (replace(WHOLE, p_clean=0.9999), 0.9999, "Nothing is wrong in what was judged: P &gt; 0.99."),
        (NAMED, 0.9712, "there: P = 0.97."),
        (replace(WHOLE, explained=False, why=ALONE, p_unknown=0.61), 0.61, "is not named: P = 0.61."),
        (replace(WHOLE, explained=False, why={Reason.LIMIT_BROKEN: ()}, p_unknown=0.1), 1.0, "P &gt; 0.99."),
        (replace(WHOLE, explained=False, why={Reason.ONLY_STANDING: ()}, p_unknown=0.7), None, ""),
    ],
    ids=("clean", "surely clean", "named", "unknown", "limit broken", "cannot tell"),
)
def test_page_and_json_give_the_probability_of_the_verdict_and_of_every_finding(
    verdict: Diagnosis, probability: float | None, said: str
) -> None:
    found = SessionDiagnosis(verdict)
    numbers = json.loads(to_text(diagnosis_document(found)))
    assert numbers["probability"] == probability
    assert [one["probability"] for one in numbers["findings"]] == [one.probability for one in verdict.findings]
    facts = diagnosis_page(FULL, found, MADE).split("<details><summary>What was judged")[1]
    assert said in facts
    assert ("P = 0.97; more than" in facts) == bool(verdict.findings)
    assert ("P = " in facts or "P &gt; " in facts) == (probability is not None)
