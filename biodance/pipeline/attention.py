"""What a person must see first: one sentence for the verdict and what it rests on, then everything refused, not solved
or outside its limit, strongest first. Page, terminal and JSON show the same records.
"""

from collections.abc import Sequence
from dataclasses import replace

from biodance.diagnosis.adequacy import LIMIT
from biodance.diagnosis.diagnosis import ABOUT, Diagnosis, Finding
from biodance.diagnosis.reasons import DiagnosisStatus, Reason
from biodance.diagnosis.repairs import failed_check
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.diagnosis.witness_evidence import WitnessEvidence
from biodance.effects import QualityCheck
from biodance.identification.load_words import size_and_segments
from biodance.pipeline.finding_words import LOAD, alternatives_in_words, cause_of, explained, in_words, listed
from biodance.pipeline.judged_trials import TOO_SHORT
from biodance.pipeline.reason_words import STRANGE_IN_WORDS, doubt_in_words, reason_notes
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import Check
from biodance.records.attention import LIMIT_TOLD, WARNING, Attention, Judged, Level, strongest_first, without_path

_FORCES = "force difference"
"""Beginning of the name of a check that compares a body with the plates, for however short a time."""
_EMPTY = "empty_plate"
"""The witness that sees plates with nobody on them."""
_WEIGHED = "kg are declared: check the mass"
"""What a reader says of a weight that is not the declared one; the check of it points to the cause that was found."""
_MOVE = " To know it, record some seconds of movement with both feet on the plates: a few squats, for example."
_MEND = " To know it, mend what stands below, and run this again."
_COMPARE = (
    " To know it, compare with another session of the same person (--reference), or teach what is usual in this "
    "laboratory (biodance learn, then --lab)."
)
"""What to do next where nothing can be told: movement is missing, something is doubtful, or what is usual is not known
well enough.
"""
_WEIGHT = "mass on the plates"
"""Beginning of the name of the check of the weight."""


def reconcile_with_checks(one: Diagnosis, result: SessionResult, judged: tuple[Judged, ...]) -> Diagnosis:
    """Return the diagnosis with what it rests on and its sentences, and never "complete" beside a check outside its
    limit, an unjudged trial or a doubtful body, nor "nothing wrong" beside the last: forces fit a body with a hip 50 mm
    off as well.
    """
    outside = tuple(check for check in result.all_checks if not check.inside)
    judged = stepped(judged, one.witnesses)
    found = [finding.target.replace("_", " ") for finding in one.findings if finding.target]
    doubts = [text for text in result.doubts if not any(target in text for target in found)]
    if one.verdict == "named, complete" and (outside or doubts or any(row.missed for row in judged)):
        one = replace(one, verdict="named, incomplete")
    if one.verdict == "nothing wrong" and result.doubts:
        why = {Reason.BODY_DOUBTFUL: (_doubtful(result.doubts),), **one.why}
        one = replace(one, verdict="unexplained", why=why)
    if one.verdict == "nothing wrong" and _only_standing_judged(result, judged):
        one = replace(one, verdict="unexplained", why={Reason.MOVEMENT_NOT_JUDGED: (), **one.why})
    if one.verdict == "unexplained" and not (one.adequacy and any(row.seconds > 0 for row in judged)):
        one = replace(one, why={**one.why, Reason.NOT_COMPARED: ()})
    one = replace(one, notes=(*one.notes, *reason_notes(one)))
    first = headline(one, amount(result, judged), judged, outside)
    return replace(one, judged=judged, attention=strongest_first([first, *session_attention(result, one.findings)]))


def _only_standing_judged(result: SessionResult, judged: tuple[Judged, ...]) -> bool:
    """Return whether only standing was judged of a session that holds movement, not even by its steps."""
    static = {one.trial.name for one in result.trials if one.trial.role == "static"}
    moved = any(row.seconds > 0 for row in judged if row.trial not in static)
    return not moved and any(row.missed and not row.seconds > 0 for row in judged)


def is_well(one: Diagnosis) -> bool:
    """Return whether nothing is wrong or refused, every trial was judged, and no check is outside its limit."""
    refused = any(said.level == "fail" for said in one.attention)
    said = all(said.level == "note" for said in one.attention if said.about == ABOUT)
    return one.verdict == "nothing wrong" and said and not refused


def amount(result: SessionResult, judged: tuple[Judged, ...]) -> str:
    """Return what was judged in words: ``3 s of standing (static) and 12 s of movement (walk_1, walk_2)``; "" for
    nothing.
    """
    static = {one.trial.name for one in result.trials if one.trial.role == "static"}
    parts = []
    for quiet, what in ((True, "standing"), (False, "movement")):
        rows = [row for row in judged if (row.trial in static) is quiet and row.seconds > 0]
        total = sum(row.seconds for row in rows)
        if rows:
            parts.append(f"{total:.{0 if total >= 9.5 else 1}f} s of {what} ({listed([row.trial for row in rows])})")
    return " and ".join(parts)


def headline(one: Diagnosis, rests_on: str, judged: tuple[Judged, ...], outside: tuple[Check, ...]) -> Attention:
    """Return the one sentence that says the verdict, what it rests on, and what it does not know."""
    its_own = tuple(check for check in outside if cause_of(check.what, one.findings))
    beside = _unjudged_and_failed(judged, tuple(check for check in outside if check not in its_own))
    names = " and ".join(f"{in_words(finding)}{alternatives_in_words(finding)}" for finding in one.findings)
    like = f" It resembles {' and '.join(map(in_words, one.resembles))}, which is not enough." if one.resembles else ""
    level: Level = "fail"
    if one.findings:
        rest = f"In {rests_on}, " if rests_on else ""
        more = {
            "named, complete": f"{rest or 'With it accepted, '}nothing more is wrong.",
            "named, incomplete": _incomplete(one, rests_on),
        }.get(one.verdict, "")
        text = f"Found: {names}. {_checks(one)}{more}{_explained(its_own)}{_sentence(beside)}"
    elif one.verdict == "nothing wrong":
        level = "warn" if beside else "note"
        text = f"Nothing wrong in what could be judged ({rests_on}){beside}." if beside or one.doubted else (
            f"Nothing wrong was found in {rests_on}. Faults below the sizes that it could have seen stay unseen."
        )  # fmt: skip
    elif not {Reason.BODY_DOUBTFUL, Reason.MOVEMENT_NOT_JUDGED}.isdisjoint(one.why):
        level, said = "warn", doubt_in_words(one)
        text = f"Cannot tell whether anything is wrong in {rests_on}: the forces fit this body, but {said}."
        text += (_MOVE if Reason.MOVEMENT_NOT_JUDGED in one.why else _MEND) + _sentence(beside)
    elif Reason.NOT_COMPARED in one.why:
        partly = any(TOO_SHORT in row.why_not for row in judged) or any(
            check.what.startswith(_FORCES) for check in outside
        )
        whole = f" for {SHORTEST_RUN:g} s without a break" if partly else ""
        level, where = "warn", f" in {rests_on}: no movement could be compared with a body{whole}" if rests_on else ""
        text = f"Cannot tell whether anything is wrong{where or ': nothing could be judged'}.{_witness_sentence(one)}"
        text += (_MOVE if where else _MEND) + _sentence(beside)
    elif one.status is DiagnosisStatus.CANNOT_TELL:
        level, doubt = "warn", doubt_in_words(one)
        text = f"Cannot tell whether anything is wrong in {rests_on}: {_where(one)}"
        text += f"{f'; but {doubt}.' if doubt else f'.{like}'}{_COMPARE}{_sentence(beside)}"
    else:
        text = f"Something is wrong in {rests_on} that no known cause explains: {_where(one)}.{_sentence(beside)}{like}"
    return Attention(level, text.strip(), about=ABOUT)


def _checks(one: Diagnosis) -> str:
    """Return where the named causes whose size is not told were seen, as sentences: which labels, in which trials."""
    bare = {(f.effect, f.target) for f in one.findings if all(p.sd != p.sd for p in f.parameters)}
    said = [quality.text for quality in one.checks if not quality.ok and (quality.effect, quality.target) in bare]
    return "".join(f"{_first_sentence(text)}. " for text in dict.fromkeys(said))


def _doubtful(doubts: Sequence[str]) -> str:
    """Return what is doubtful of a body, without advice."""
    return listed([_first_sentence(text.removeprefix(WARNING).partition(": check")[0]) for text in doubts])


def session_attention(result: SessionResult, findings: Sequence[Finding] = ()) -> tuple[Attention, ...]:
    """Return every file refused, step refused, fit that failed, load found, warning, and check outside its limit; a
    check that a finding may explain points to it.
    """
    found = [Attention("fail", without_path(why, file), file, "file") for file, why in result.session.refused.items()]
    found += [
        Attention(_level(step.status), step.text, "", step.name) for step in result.steps if step.status != "done"
    ]
    found += [
        Attention("fail", f"Not solved. {why}", "", f"identification, {what}") for what, why in result.failures.items()
    ]
    found += [Attention("warn", text.removeprefix(WARNING), "", "session.toml") for text in result.slips]
    found += [Attention("warn", text.removeprefix(WARNING), "", "body") for text in result.doubts]
    weighed = False
    for trial in result.trials:
        level: Level = "fail" if trial.status == "refused" else "warn"
        said = [text for text in trial.reasons if not (_WEIGHED in text and cause_of(_WEIGHT, findings))]
        weighed |= any(_WEIGHED in text for text in said)
        found += [Attention(level, text.removeprefix(f"Trial {trial.name}: "), trial.name) for text in said]
    outside = [check for check in result.all_checks if not check.inside]
    found += [_checked(check, findings) for check in outside if not (weighed and check.what.startswith(_WEIGHT))]
    return strongest_first([*found, *_load(result, findings)])


def identified_attention(result: SessionResult, checks: Sequence[QualityCheck]) -> tuple[Attention, ...]:
    """Return what a person must see of a session that was identified and not diagnosed: the ``checks`` of its
    recordings that failed (units, signs, labels, clocks) stand first, as the diagnosis says them.
    """
    findings = tuple(failed_check(quality) for quality in checks)
    if not findings:
        return session_attention(result)
    one = Diagnosis("named, incomplete", findings, checks=tuple(checks))
    text = f"Found: {' and '.join(map(in_words, findings))}. {_checks(one)}".strip()
    return strongest_first([Attention("fail", text, about=ABOUT), *session_attention(result, findings)])


def _checked(check: Check, findings: Sequence[Finding]) -> Attention:
    """Return a check outside its limit as a sentence, with the finding that may explain it instead of advice."""
    cause = cause_of(check.what, findings)
    then = explained(cause) if cause else check.advice
    text = f"{check.value}{LIMIT_TOLD}{check.limit}. {then[:1].upper()}{then[1:]}".strip()
    return Attention("note" if cause else "warn", text, check.where, check.what)


def _load(result: SessionResult, findings: Sequence[Finding]) -> list[Attention]:
    """Return the load that was found where no finding names it already."""
    search = result.identification.search if result.identification else None
    if search is None or not search.found or any(LOAD in (a.effect for a in one.set) for one in findings):
        return []
    text = f"Beyond {search.reference} the subject carries {size_and_segments(search)}."
    return [Attention("warn", text, about=LOAD)]


def _level(status: str) -> Level:
    return "fail" if status == "refused" else "warn"


def _unjudged_and_failed(judged: tuple[Judged, ...], outside: tuple[Check, ...]) -> str:
    """Return what was not judged and which checks failed, to go on a sentence with."""
    missed: dict[str, list[str]] = {}
    stepped_only = [row.trial for row in judged if row.missed and row.seconds > 0]
    for row in judged:
        if row.missed and not row.seconds > 0:
            why = without_path(_first_sentence(row.why_not), row.trial).removeprefix(f"Trial {row.trial}: ")
            missed.setdefault(why, []).append(row.trial)
    parts = [f"; not judged: {listed(names)}, because: {why}" for why, names in missed.items()]
    parts += [f"; only the steps on plates were judged of {listed(stepped_only)}"] if stepped_only else []
    return "".join(parts) + (f"; outside the limit: {_named_checks(outside)}" if outside else "")


def _explained(checks: tuple[Check, ...]) -> str:
    """Return the checks outside their limit that a finding may explain as a sentence."""
    return f" Outside the limit, which this may explain: {_named_checks(checks)}." if checks else ""


def _named_checks(checks: tuple[Check, ...]) -> str:
    """Return the checks in words, each once with the trials that it was held against: values stand below."""
    alike: dict[str, list[str]] = {}
    for one in checks:
        alike.setdefault(one.what, []).append(one.where)
    return listed([f"{what} ({listed(where)})" for what, where in alike.items()])


def _first_sentence(reason: str) -> str:
    return reason.split(". ")[0].rstrip(".")


def _witness_sentence(one: Diagnosis) -> str:
    """Return that the witnesses were asked, as a sentence; "" where they saw nobody on a plate."""
    trials = len({o.trial for o in one.witnesses.observations if o.witness != _EMPTY}) if one.witnesses else 0
    return f" Plates and clocks, judged alone, look right in {trials} trial{'s' * (trials > 1)}." if trials else ""


def stepped(rows: tuple[Judged, ...], evidence: WitnessEvidence | None) -> tuple[Judged, ...]:
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


def _sentence(beside: str) -> str:
    """Return what goes on a sentence as one of its own."""
    text = beside.removeprefix("; ")
    return f" Also: {text}." if text else ""


def _where(one: Diagnosis) -> str:
    """Return where what is left is largest, with its size."""
    rows = [row for row in one.adequacy if row.matters and row.z > LIMIT] or list(one.adequacy)
    strange = next((words for reason, words in STRANGE_IN_WORDS.items() if reason in one.why), "")
    if strange and Reason.FORCES_LEFT not in one.why:
        return strange
    if not rows:
        return "what is left is unlike sessions without fault"
    row = rows[0]
    return (
        f"{row.channel} at {row.band_hz[0]:g} to {row.band_hz[1]:g} Hz is {row.size:.2g} {row.unit} off "
        f"({row.z:.1f} standard deviations of sessions without fault), most in {row.trial} around {row.second:.1f} s"
    )


def _incomplete(one: Diagnosis, rests_on: str) -> str:
    """Return what is more to say of a diagnosis that is not complete."""
    if not {Reason.UNUSUAL_BODY, Reason.FORCES_LEFT}.isdisjoint(one.why):
        return f"Something more is wrong in {rests_on} that no known cause explains: {_where(one)}."
    return (
        f"Apart from that, {rests_on} look like a session without fault."
        if rests_on and one.adequacy
        else "Whether the forces fit the body was not judged."
    )
