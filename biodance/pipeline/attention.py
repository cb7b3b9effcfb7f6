"""What a person must see first: the headline, then everything refused, not solved or outside its limit, strongest
first; what a session ends with beside all of that. Page, terminal and JSON show the same records.
"""

from collections.abc import Sequence
from dataclasses import replace

from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.repairs import failed_check
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.display import listed, spaced
from biodance.effects import CheckKind, QualityCheck
from biodance.identification.load_words import size_and_segments
from biodance.pipeline.checks import NOT_WEIGHED
from biodance.pipeline.headline import headline
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import Check, Step, TrialResult
from biodance.pipeline.words import LOAD, alternatives, cause_of, explained, reason_notes, spoken
from biodance.records.attention import LIMIT_TOLD, WARNING, Attention, Judged, Level, strongest_first, without_path

_WEIGHED = "kg are declared: check the mass"
"""What a reader says of a weight that is not the declared one; the check of it points to the cause that was found."""
_BROKEN = {
    CheckKind.FORCES: "forces and simulation of {} differ by {}",
    CheckKind.MARKERS: "markers of {} lie {} from the body",
    CheckKind.WEIGHT: "the weight on the plates in {} is {} from the declared one",
}
"""Beginnings of the names of checks beside which nothing is "nothing wrong", unless a finding explains them, and what
is said of them.
"""
_NOTED = ("fully measured",)
"""Checks that ask nobody for anything: what was not measured is not judged, which is said of every trial."""
_ON_PLATES = ("wrench", "contact", "standing", "compare")
"""Steps on a trial that look at its plates."""


def reconcile_with_checks(one: Diagnosis, result: SessionResult, judged: tuple[Judged, ...]) -> Diagnosis:
    """Return the diagnosis with what it rests on and its sentences, the headline first. It is never "complete" beside a
    check outside its limit, an unjudged trial or a doubtful body, nor "nothing wrong" beside a broken limit of forces,
    markers or weight, or a doubtful body: forces fit a body with a hip 50 mm off as well.
    """
    judged = stepped(judged, one.witnesses)
    outside = tuple(check for check in result.all_checks if not check.inside and check.what not in _NOTED)
    if one.faults:
        one = replace(one, explained=one.explained and not _more_is_wrong(one, result, judged, outside))
    else:
        one = _without_faults(one, result, judged, outside)
    one = replace(one, notes=(*one.notes, *reason_notes(one)), judged=judged)
    others = session_attention(result, one.findings)
    first = headline(one, judged, static_trials(result), others)
    return replace(one, attention=(first, *others))


def _more_is_wrong(
    one: Diagnosis, result: SessionResult, judged: tuple[Judged, ...], outside: tuple[Check, ...]
) -> bool:
    """Return whether something is open beside the causes that are named: a check, a doubt of the body that no finding
    concerns, a trial that nobody judged.
    """
    found = [spaced(finding.target) for finding in one.findings if finding.target]
    doubts = [text for text in result.doubts if not any(target in text for target in found)]
    return bool(outside or doubts or any(row.missed for row in judged))


def _without_faults(
    one: Diagnosis, result: SessionResult, judged: tuple[Judged, ...], outside: tuple[Check, ...]
) -> Diagnosis:
    """Return a diagnosis that names no fault with whether nothing is wrong, or why nobody can tell."""
    if not (one.explained or one.adequacy):
        well = not (one.why or one.resembles) and _compared_by_steps(result, judged)
        one = replace(one, explained=well, why={**one.why, Reason.NOT_COMPARED: ()})
    if one.explained and (against := _not_clean(result, judged, outside)):
        one = replace(one, explained=False, why={**against, **one.why})
    if one.explained:
        return one
    if not any(row.seconds > 0 for row in judged):
        one = replace(one, why={**one.why, Reason.NOT_COMPARED: ()})
    if any(step.name == "subject" and step.status != "done" for step in result.steps):
        one = replace(one, why={Reason.PERSON_UNKNOWN: (), **one.why})
    return one


def _compared_by_steps(result: SessionResult, judged: tuple[Judged, ...]) -> bool:
    """Return whether feet and clocks judged steps in which the forces were compared with the body, too, if for less
    than the engine needs: nothing is wrong there if they say so and no limit is broken.
    """
    compared = {one.name for one in result.trials if one.comparison is not None and one.comparison.used.any()}
    return any(row.seconds > 0 for row in judged if row.trial in compared - static_trials(result))


def _not_clean(
    result: SessionResult, judged: tuple[Judged, ...], outside: tuple[Check, ...]
) -> dict[Reason, tuple[str, ...]]:
    """Return why nobody may say that nothing is wrong, each reason with what it concerns."""
    broken = tuple(
        said.format(one.where, one.value)
        for one in outside
        for what, said in _BROKEN.items()
        if one.what.startswith(what)
    )
    doubts = tuple(
        text.removeprefix(WARNING).partition(": check")[0].partition(". ")[0].rstrip(".") for text in result.doubts
    )
    why = {Reason.LIMIT_BROKEN: broken, Reason.BODY_DOUBTFUL: doubts}
    if _only_standing_judged(result, judged):
        return {Reason.MOVEMENT_NOT_JUDGED: ()} | {reason: about for reason, about in why.items() if about}
    return {reason: about for reason, about in why.items() if about}


def static_trials(result: SessionResult) -> frozenset[str]:
    """Return the names of the static trials."""
    return frozenset(one.trial.name for one in result.trials if one.trial.role == "static")


def _only_standing_judged(result: SessionResult, judged: tuple[Judged, ...]) -> bool:
    """Return whether only standing was judged of a session that holds movement, not even by its steps."""
    static = static_trials(result)
    moved = any(row.seconds > 0 for row in judged if row.trial not in static)
    return not moved and any(row.missed and not row.seconds > 0 for row in judged)


def is_well(one: Diagnosis) -> bool:
    """Return whether nobody has to do anything: the headline is as strong as the strongest sentence below it."""
    return all(said.level == "note" for said in one.attention)


def session_attention(result: SessionResult, findings: Sequence[Finding] = ()) -> tuple[Attention, ...]:
    """Return every file refused, step refused, fit that failed, load found, warning, and check outside its limit; a
    check that a finding may explain points to it. Nobody has to stand on a plate in the static trial.
    """
    found = [Attention("fail", without_path(why, file), file, "file") for file, why in result.session.refused.items()]
    found += [Attention(_level(step), step.text, "", step.name) for step in result.steps if step.status != "done"]
    found += [Attention("note", NOT_WEIGHED, "", "weighing")] if result.weighed is None else []
    found += [
        Attention("fail", f"Not solved. {why}", "", f"identification, {what}") for what, why in result.failures.items()
    ]
    found += [Attention("warn", text.removeprefix(WARNING), "", "session.toml") for text in result.slips]
    found += [Attention("warn", text.removeprefix(WARNING), "", "body") for text in result.doubts]
    said = [_of_trial(trial, findings) for trial in result.trials]
    found += [line for lines in said for line in lines]
    told = any(_WEIGHED in line.text for lines in said for line in lines)
    outside = [check for check in result.all_checks if not check.inside]
    found += [_checked(check, findings) for check in outside if not (told and check.what.startswith(CheckKind.WEIGHT))]
    found += [_habit(one) for one in findings if one.cause.habit]
    return strongest_first([*found, *_load(result, findings), *corrected_attention(result)])


def corrected_attention(result: SessionResult) -> tuple[Attention, ...]:
    """Return what was taken off the recordings before the body was fitted, or left open in it, one sentence each: the
    laboratory's next recording will have it again. A note where it is no fault, so that nobody has to do anything.
    """
    found = result.identification.corrected if result.identification else ()
    return tuple(
        Attention(
            "warn" if one.advice else "note",
            f"{'left open when' if one.cause.of_person() else 'taken off before'} the body was fitted, in "
            f"{listed(one.trials) or 'all trials'}: {spoken(one).fact}. "
            f"{one.cause.advice if one.advice else ''}".strip(),
            about=one.effect,
        )
        for one in found
    )


def _habit(one: Finding) -> Attention:
    """Return what a laboratory does otherwise than is expected, and what it cannot be told from."""
    text = " or ".join([spoken(one).fact, *(f"it is {other}" for other in alternatives(one))]) + f". {one.advice}"
    return Attention("warn" if len(one.set) > 1 else "note", f"{text[:1].upper()}{text[1:]}", about=one.effect)


def _of_trial(trial: TrialResult, findings: Sequence[Finding]) -> list[Attention]:
    """Return the refusals and warnings of a trial. A static trial is not compared with the plates: that it stands
    beside them is a note.
    """
    level: Level = "fail" if trial.status == "refused" else "warn"
    if trial.trial.role == "static" and not trial.trial.warnings:
        level = "note" if all(step.status == "done" or step.name in _ON_PLATES for step in trial.steps) else level
    said = [text for text in trial.reasons if not (_WEIGHED in text and cause_of(CheckKind.WEIGHT, findings))]
    return [Attention(level, text.removeprefix(f"Trial {trial.name}: "), trial.name) for text in said]


def identified_attention(result: SessionResult, checks: Sequence[QualityCheck]) -> tuple[Attention, ...]:
    """Return what a person must see of a session that was identified and not diagnosed: the ``checks`` of its
    recordings that failed (units, signs, labels, clocks) stand first, as the diagnosis says them.
    """
    findings = tuple(failed_check(quality) for quality in checks)
    if not findings:
        return session_attention(result)
    one = Diagnosis(False, findings, checks=tuple(checks))
    others = session_attention(result, findings)
    return (headline(one, (), static_trials(result), others), *others)


def _checked(check: Check, findings: Sequence[Finding]) -> Attention:
    """Return a check outside its limit as a sentence, with the finding that may explain it instead of advice."""
    cause = cause_of(check.what, findings)
    then = explained(cause) if cause else check.advice
    text = f"{check.value}{LIMIT_TOLD}{check.limit}. {then[:1].upper()}{then[1:]}".strip()
    return Attention("note" if cause or check.what in _NOTED else "warn", text, check.where, check.what)


def _load(result: SessionResult, findings: Sequence[Finding]) -> list[Attention]:
    """Return the load that was found where no finding names it already."""
    search = result.identification.search if result.identification else None
    if search is None or not search.found or any(LOAD in (a.effect for a in one.set) for one in findings):
        return []
    text = f"Beyond {search.reference} the subject carries {size_and_segments(search)}."
    return [Attention("warn", text, about=LOAD)]


def _level(step: Step) -> Level:
    """Return how loudly a step that was not done is said: a session too short to identify from needs nobody."""
    if step.status == "refused":
        return "note" if step.name == "identify" else "fail"
    return "warn"


def stepped(rows: tuple[Judged, ...], evidence: ObservedEvidence | None) -> tuple[Judged, ...]:
    """Return what a verdict rests on with the steps that only the witnesses could judge: seconds of one foot alone on
    a plate. Such a trial still misses the comparison with a body.
    """
    alone = evidence.seconds if evidence else {}
    return tuple(
        replace(row, seconds=alone[row.trial], why_not=f"only by its steps: {row.why_not}")
        if row.missed and alone.get(row.trial, 0.0) > 0
        else row
        for row in rows
    )
