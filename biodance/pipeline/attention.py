"""What a person must see: a headline of at most `WORDS` words, then all that is open, the strongest first."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.diagnosis import ABOUT, Diagnosis, Finding
from biodance.diagnosis.reasons import DiagnosisStatus, Reason
from biodance.diagnosis.repairs import failed_check
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.display import digits, listed, spaced
from biodance.effects import CheckKind, QualityCheck
from biodance.pipeline.identification import NOT_WEIGHED
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import Check, Step, TrialResult
from biodance.pipeline.words import (
    LOAD,
    alternatives,
    cause_of,
    explained,
    first_upper,
    names_markers,
    reason_notes,
    size_and_segments,
    spoken,
)
from biodance.records.attention import (
    LEVELS,
    LIMIT_TOLD,
    OTHER_PEOPLE,
    AnotherPerson,
    Attention,
    Doubt,
    Judged,
    Level,
    NotUsed,
    WrongWeight,
    strongest_first,
    without_path,
)

WORDS = 30
"""Words of a headline at most."""
_UNTOLD = "Nobody can tell whether anything is wrong"
_SQUATS = "Record a few squats with both feet on the plates."
_REFERENCE = "Compare with another session of this person (--reference)."
_MEND = "Mend what stands below, and run this again."
_WHY: dict[Reason, tuple[str, str]] = {
    Reason.PERSON_UNKNOWN: ("the person's mass or stature is not known", "Give them in session.toml."),
    Reason.MOVEMENT_NOT_JUDGED: ("none of the movement could be judged", _SQUATS),
    Reason.BODY_NOT_SCALED: ("the body comes from stature alone", "Record a static trial."),
    Reason.BODY_DOUBTFUL: ("what is known of the body contradicts itself", _MEND),
    Reason.NOT_COMPARED: ("no movement could be compared with a body", _MEND),
    Reason.ONLY_STANDING: ("standing still tells little", _SQUATS),
    Reason.UNDESCRIBED_JOINTS: ("what is usual of some joints of this body is not known yet", _REFERENCE),
    Reason.TOLERANCES_DO_NOT_HOLD: ("the markers move unusually much on the body", "Check how they are fixed."),
    Reason.CONTRADICTED: ("what the forces resemble rests on one step or is contradicted", "Record more movement."),
    Reason.NOT_SURE: ("something may be, and no cause of it is sure", "Record more movement."),
    Reason.UNUSUAL_BODY: ("the forces fit only an unusual body, or a load or mass that nobody noted", _REFERENCE),
    Reason.OUTSIDE_TOLERANCES: ("something that is small elsewhere is large here", _REFERENCE),
}
"""Why nobody can tell, and what to do about it; the first that holds is told."""


def headline(
    one: Diagnosis, judged: Sequence[Judged], static: frozenset[str], others: Sequence[Attention] = ()
) -> Attention:
    """Return what a session ends with, no weaker than the ``others`` to be seen; ``static`` its static trials."""
    missed = [row.trial for row in judged if row.missed and not row.seconds > 0 and row.trial not in static]
    own: Level = "fail"
    if one.status is DiagnosisStatus.NAMED:
        sentences = _named(one)
    elif one.status is DiagnosisStatus.UNKNOWN:
        sentences = _unknown(one)
    elif one.status is DiagnosisStatus.CANNOT_TELL:
        own, sentences = "warn", _cannot_tell(one, amount(judged, static))
    else:
        own = "warn" if missed else "note"
        well = all(other.level == "note" for other in others)
        sentences = _clean(amount(judged, static), missed, well=well)
    told = list(sentences)
    if count := sum(other.about == OTHER_PEOPLE for other in others):
        lead = "1 file is of another person" if count == 1 else f"{count} files are of other people"
        told = [f"{lead}, see below. {text}" for text in told] + told
    # sentences come ever shorter: the first that is short enough says most
    text = next(text for text in told if len(text.split()) <= WORDS)
    return Attention(min((own, *(other.level for other in others)), key=LEVELS.index), text, about=ABOUT)


def amount(judged: Sequence[Judged], static: frozenset[str]) -> str:
    """Return what was judged in words: ``3 s of standing and 12 s of movement``, or of steps; "" for nothing."""
    totals: dict[str, float] = {}
    for row in judged:
        what = "standing" if row.trial in static else "steps" if row.missed else "movement"
        totals[what] = totals.get(what, 0.0) + row.seconds
    return _joined([f"{digits(s, 2)} s of {what}" for what, s in totals.items() if s > 0], "and")


def _joined(names: Sequence[str], last: str) -> str:
    """Return names as a list in words, with "and" or "or" before the last."""
    return f" {last} ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _clean(seen: str, missed: Sequence[str], *, well: bool) -> Iterator[str]:
    """Yield that nothing is wrong in what was ``seen``, what was ``missed`` and what needs somebody, ever shorter."""
    again = f'Record {"it" if len(missed) == 1 else "them"} again, or set role = "skip".'
    for found in (f"Nothing wrong was found in {seen}", "Nothing wrong was found"):
        if missed:
            if len(missed) == 1:
                yield f"{found}, but {missed[0]} could not be judged. {again}"
            yield f"{found}, but {len(missed)} of the files could not be judged. {again}"
        elif not well:
            yield f"{found}, but something else needs you. {_MEND}"
        else:
            yield f"{found}."


def _named(one: Diagnosis) -> Iterator[str]:
    """Yield the first cause with its size, its alternatives and what to do, ever shorter."""
    first = one.faults[0]
    together = tuple(other for other in one.faults[1:] if other.effect == first.effect and names_markers(first))
    # what a check found is undone in a copy and judged there; all else goes by what it gains on data not used
    names = first.effect, first.target
    put_right = any((check.effect, check.target) == names and not check.alike for check in one.checks)
    proven = put_right or (first.gain is not None and first.gain.proven)
    told, more = spoken(first, together, proven=proven), len(one.faults) - len(together)
    start = "" if more == 1 else f"{more} things are wrong. First, "
    also = alternatives(first)
    rest = ", and more is wrong" if not {Reason.FORCES_LEFT, Reason.UNUSUAL_BODY}.isdisjoint(one.why) else ""
    # with every alternative by name, with one, with none
    several = (_joined(also, "or"), f"{also[0]} or something else", "something else") if also else ()
    sets = [f", or it is {some}" for some in several] or [""]
    for fact in (told.fact, told.plain):
        for alike in sets:
            yield first_upper(f"{start}{fact}{alike}{rest}. {told.do}")
    yield first_upper(f"{start}{told.plain}{sets[-1]}. {told.do}")
    yield f"{len(one.faults)} things are wrong, the first: {spaced(first.effect)}. {_MEND}"


def _unknown(one: Diagnosis) -> Iterator[str]:
    """Yield where what nobody can name is largest."""
    row = next((row for row in one.adequacy if row.matters and row.z > LIMIT), None)
    start = "Something is wrong that no known cause explains"
    for about in one.why.get(Reason.LIMIT_BROKEN, ()):
        yield f"Something is wrong: {about}. Look there."
    if row is not None:
        off = f"{row.channel} is {row.size:.2g} {row.unit} off"
        yield f"{start}: {off}, most in {row.trial} at {row.second:.1f} s. Look there."
        yield f"{start}: {off}. Look at the trials below."
    yield f"{start}. Look at the trials below."


def _cannot_tell(one: Diagnosis, seen: str) -> Iterator[str]:
    """Yield the first reason for which nobody can tell, and what to do about it; ``seen`` what was judged."""
    reason = next((reason for reason in _WHY if reason in one.why), Reason.NOT_COMPARED)
    why, do = _WHY[reason]
    about = one.why.get(reason, ())
    if reason is Reason.BODY_DOUBTFUL and len(about) == 1:
        yield f"{_UNTOLD}: {about[0]}. Mend it, and run this again."
    if reason is Reason.UNDESCRIBED_JOINTS and about:
        yield f"{_UNTOLD}: what is usual of {_joined(about, 'or')} is not known yet. {do}"
    if reason is Reason.NOT_COMPARED and seen:
        yield f"{_UNTOLD}: no movement stayed on the plates for {SHORTEST_RUN:g} s. {_SQUATS}"
    yield f"{_UNTOLD}: {why}. {do}"


_BROKEN = {
    CheckKind.FORCES: "forces and simulation of {} differ by {}",
    CheckKind.MARKERS: "markers of {} lie {} from the body",
    CheckKind.WEIGHT: "the weight on the plates in {} is {} from the declared one",
}
"""Beginnings of the names of checks beside which nothing is "nothing wrong", and what is said of them."""
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
    if one.faults:  # is anything open beside them: a check, a doubt of the body that no finding concerns, a trial?
        found = {finding.target for finding in one.findings}
        doubts = any(not doubt.mended and found.isdisjoint(doubt.about) for doubt in result.doubts)
        more = outside or doubts or any(row.missed for row in judged)
        one = replace(one, explained=one.explained and not more)
    else:
        one = _without_faults(one, result, judged, outside)
    one = replace(one, notes=(*one.notes, *reason_notes(one)), judged=judged)
    others = open_attention(result, one.findings)
    first = headline(one, judged, static_trials(result), others)
    return replace(one, attention=(first, *others))


def _without_faults(
    one: Diagnosis, result: SessionResult, judged: tuple[Judged, ...], outside: tuple[Check, ...]
) -> Diagnosis:
    """Return a diagnosis that names no fault with whether nothing is wrong, or why nobody can tell."""
    if not (one.explained or one.adequacy):
        # Feet and clocks judged steps that were compared with the body, too, if for less than the engine needs.
        compared = {one.name for one in result.trials if one.comparison is not None and one.comparison.used.any()}
        steps = any(row.seconds > 0 for row in judged if row.trial in compared - static_trials(result))
        well = not (one.why or one.resembles) and steps
        one = replace(one, explained=well, why={**one.why, Reason.NOT_COMPARED: ()})
    against = _not_clean(result, judged, outside)
    if one.explained and not against:
        return one
    # Whatever else nobody can tell, a broken limit is something wrong.
    broken = {reason: about for reason, about in against.items() if one.explained or reason is Reason.LIMIT_BROKEN}
    one = replace(one, explained=False, why={**broken, **one.why})
    if not any(row.seconds > 0 for row in judged):
        one = replace(one, why={**one.why, Reason.NOT_COMPARED: ()})
    if any(step.name == "subject" and step.status != "done" for step in result.steps):
        one = replace(one, why={Reason.PERSON_UNKNOWN: (), **one.why})
    return one


def _not_clean(
    result: SessionResult, judged: tuple[Judged, ...], outside: tuple[Check, ...]
) -> dict[Reason, tuple[str, ...]]:
    """Return why nobody may say that nothing is wrong, each reason with what it concerns."""
    # What lies far from a body of stature alone, or moves otherwise, is no sign of a fault: it fits nobody.
    why: dict[Reason, tuple[str, ...]] = {Reason.LIMIT_BROKEN: (), Reason.BODY_NOT_SCALED: ()}
    for one in outside:
        for what, said in _BROKEN.items():
            if one.what.startswith(what):
                reason = Reason.LIMIT_BROKEN if result.scaled or what is CheckKind.WEIGHT else Reason.BODY_NOT_SCALED
                why[reason] += (said.format(one.where, one.value),)
    why[Reason.BODY_DOUBTFUL] = tuple(one.fact for one in result.doubts if not one.mended)
    # Only standing was judged of a session that holds movement, not even by its steps.
    static = static_trials(result)
    moved = any(row.seconds > 0 for row in judged if row.trial not in static)
    if not moved and any(row.missed and not row.seconds > 0 for row in judged):
        return {Reason.MOVEMENT_NOT_JUDGED: ()} | {reason: about for reason, about in why.items() if about}
    return {reason: about for reason, about in why.items() if about}


def static_trials(result: SessionResult) -> frozenset[str]:
    """Return the names of the static trials."""
    return frozenset(one.trial.name for one in result.trials if one.trial.role == "static")


def session_attention(result: SessionResult, diagnosis: Diagnosis | None = None) -> tuple[Attention, ...]:
    """Return all that must be seen of a session: what its ``diagnosis`` says, else what stands open in it, and what was
    taken off the recordings.
    """
    return (*diagnosis.attention, *corrected_attention(result)) if diagnosis else open_attention(result)


def open_attention(result: SessionResult, findings: Sequence[Finding] = ()) -> tuple[Attention, ...]:
    """Return every refusal, failed fit, load, warning, and check outside its limit, which points to its cause."""
    found = [
        Attention("fail", without_path(why, file), file, OTHER_PEOPLE if isinstance(why, AnotherPerson) else "file")
        for file, why in result.session.refused.items()
    ]
    found += [Attention(_level(step), step.text, "", step.name) for step in result.steps if step.status != "done"]
    found += [Attention("note", NOT_WEIGHED, "", "weighing")] if result.weighed is None else []
    found += [
        Attention("fail", f"Not solved. {why}", "", f"identification, {what}") for what, why in result.failures.items()
    ]
    found += _noted(result)
    found += [line for trial in result.trials for line in _of_trial(trial, findings)]
    # a reader said of the weight what its check would say again, unless that points to a cause
    told = not cause_of(CheckKind.WEIGHT, findings) and any(
        isinstance(text, WrongWeight) for trial in result.trials for text in trial.reasons
    )
    outside = [check for check in result.all_checks if not check.inside]
    found += [_checked(check, findings) for check in outside if not (told and check.what.startswith(CheckKind.WEIGHT))]
    found += [_habit(one) for one in findings if one.cause.habit]
    return strongest_first([*found, *_load(result, findings), *corrected_attention(result)])


def _noted(result: SessionResult) -> list[Attention]:
    """Return what notes ask somebody to look at: lines of session.toml, then the body; and what was not used."""
    of_body = result.body.notes if result.body else ()
    notes = [("session.toml", note) for note in result.session.notes] + [("body", note) for note in of_body]
    doubts = [Attention(note.level, note.said, "", about) for about, note in notes if isinstance(note, Doubt)]
    return doubts + [Attention("note", note, "", "subject") for note in of_body if isinstance(note, NotUsed)]


def corrected_attention(result: SessionResult) -> tuple[Attention, ...]:
    """Return what was taken off the recordings before the fit, or left open in it; a note where it is no fault."""
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
    text = " or ".join([spoken(one).fact, *(f"it is {other}" for other in alternatives(one))])
    return Attention("warn" if len(one.set) > 1 else "note", first_upper(f"{text}. {one.advice}"), about=one.effect)


def _of_trial(trial: TrialResult, findings: Sequence[Finding]) -> list[Attention]:
    """Return the refusals and warnings of a trial; that a static trial stands beside the plates is a note."""
    level: Level = "fail" if trial.status == "refused" else "warn"
    if trial.trial.role == "static" and not trial.trial.warnings:
        level = "note" if all(step.status == "done" or step.name in _ON_PLATES for step in trial.steps) else level
    explains = cause_of(CheckKind.WEIGHT, findings)
    said = [text for text in trial.reasons if not (explains and isinstance(text, WrongWeight))]
    return [Attention(level, text.removeprefix(f"Trial {trial.name}: "), trial.name) for text in said]


def identified_attention(result: SessionResult, checks: Sequence[QualityCheck]) -> tuple[Attention, ...]:
    """Return what must be seen of a session not diagnosed: the ``checks`` that failed stand first."""
    findings = tuple(failed_check(quality) for quality in checks)
    if not findings:
        return open_attention(result)
    one = Diagnosis(False, findings, checks=tuple(checks))
    others = open_attention(result, findings)
    return (headline(one, (), static_trials(result), others), *others)


def _checked(check: Check, findings: Sequence[Finding]) -> Attention:
    """Return a check outside its limit as a sentence, with the finding that may explain it instead of advice."""
    cause = cause_of(check.what, findings)
    then = explained(cause) if cause else check.advice
    text = f"{check.value}{LIMIT_TOLD}{check.limit}. {first_upper(then)}".strip()
    return Attention("note" if cause or check.what in _NOTED else "warn", text, check.where, check.what)


def _level(step: Step) -> Level:
    """Return how loudly a step that was not done is said: a session too short to identify from needs nobody."""
    return "warn" if step.status != "refused" else "note" if step.name == "identify" else "fail"


def _load(result: SessionResult, findings: Sequence[Finding]) -> list[Attention]:
    """Return the load that was found where no finding names it already."""
    search = result.identification.search if result.identification else None
    if search is None or not search.found or any(LOAD in (a.effect for a in one.set) for one in findings):
        return []
    text = f"Beyond {search.reference} the subject carries {size_and_segments(search)}."
    return [Attention("warn", text, about=LOAD)]


def stepped(rows: tuple[Judged, ...], evidence: ObservedEvidence | None) -> tuple[Judged, ...]:
    """Return the rows with the seconds of one foot alone on a plate that only the witnesses could judge."""
    alone = evidence.seconds if evidence else {}
    return tuple(
        replace(row, seconds=alone[row.trial], why_not=f"only by its steps: {row.why_not}")
        if row.missed and alone.get(row.trial, 0.0) > 0
        else row
        for row in rows
    )
