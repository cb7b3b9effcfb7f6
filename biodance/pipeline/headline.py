"""What a session ends with, as a colleague says it: one sentence of at most `WORDS` words, and one thing to do."""

from collections.abc import Iterator, Sequence

from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.diagnosis import ABOUT, Diagnosis
from biodance.diagnosis.reasons import DiagnosisStatus, Reason
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.display import digits, spaced
from biodance.pipeline.words import alternatives, names_markers, spoken
from biodance.records.attention import LEVELS, Attention, Judged, Level

WORDS = 30
"""Words of a headline at most."""
_UNTOLD = "Nobody can tell whether anything is wrong"
_SQUATS = "Record a few squats with both feet on the plates."
_REFERENCE = "Compare with another session of this person (--reference)."
_MEND = "Mend what stands below, and run this again."
_WHY: dict[Reason, tuple[str, str]] = {
    Reason.PERSON_UNKNOWN: ("the person's mass or stature is not known", "Give them in session.toml."),
    Reason.MOVEMENT_NOT_JUDGED: ("none of the movement could be judged", _SQUATS),
    Reason.BODY_NOT_SCALED: ("no static trial scales the body", "Record a static trial."),
    Reason.BODY_DOUBTFUL: ("what is known of the body contradicts itself", _MEND),
    Reason.NOT_COMPARED: ("no movement could be compared with a body", _MEND),
    Reason.ONLY_STANDING: ("standing still tells little", _SQUATS),
    Reason.UNDESCRIBED_JOINTS: ("what is usual of some joints of this body is not known yet", _REFERENCE),
    Reason.TOLERANCES_DO_NOT_HOLD: ("the markers move unusually much on the body", "Check how they are fixed."),
    Reason.CONTRADICTED: ("what the forces resemble rests on one step or is contradicted", "Record more steps."),
    Reason.UNUSUAL_BODY: ("the forces fit only an unusual body, or a load or mass that nobody noted", _REFERENCE),
    Reason.OUTSIDE_TOLERANCES: ("something that is small elsewhere is large here", _REFERENCE),
}
"""Why nobody can tell, and what to do about it; the first that holds is told."""


def headline(
    one: Diagnosis, judged: Sequence[Judged], static: frozenset[str], others: Sequence[Attention] = ()
) -> Attention:
    """Return what a session ends with in one sentence and one thing to do; ``static`` are its static trials,
    ``others`` what else a person must see of it: no sentence is weaker than they are.
    """
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
    text = next(text for text in sentences if len(text.split()) <= WORDS)
    return Attention(min((own, *(other.level for other in others)), key=LEVELS.index), text, about=ABOUT)


def amount(judged: Sequence[Judged], static: frozenset[str]) -> str:
    """Return what was judged in words: ``3 s of standing and 12 s of movement``, or of steps where the witnesses alone
    judged them; "" for nothing.
    """
    totals: dict[str, float] = {}
    for row in judged:
        what = "standing" if row.trial in static else "steps" if row.missed else "movement"
        totals[what] = totals.get(what, 0.0) + row.seconds
    parts = [f"{digits(s, 2)} s of {what}" for what, s in totals.items() if s > 0]
    return " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))


def _clean(seen: str, missed: Sequence[str], *, well: bool) -> Iterator[str]:
    """Yield that nothing is wrong in what was ``seen``, and what was ``missed`` or needs somebody all the same, ever
    shorter.
    """
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
    told, more = spoken(first, together), len(one.faults) - len(together)
    start = "" if more == 1 else f"{more} things are wrong. First, "
    also = alternatives(first)
    rest = ", and more is wrong" if not {Reason.FORCES_LEFT, Reason.UNUSUAL_BODY}.isdisjoint(one.why) else ""
    several = (_either(also), f"{also[0]} or something else", "something else") if also else ()
    sets = [f", or it is {some}" for some in several] or [""]
    for fact in (told.fact, told.plain):
        for alike in sets:
            yield _sentence(f"{start}{fact}{alike}{rest}. {told.do}")
    yield _sentence(f"{start}{told.plain}{sets[-1]}. {told.do}")
    yield _sentence(f"{len(one.faults)} things are wrong, the first: {spaced(first.effect)}. {_MEND}")


def _either(names: Sequence[str]) -> str:
    return " or ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


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
        yield f"{_UNTOLD}: what is usual of {_either(about)} is not known yet. {do}"
    if reason is Reason.NOT_COMPARED and seen:
        yield f"{_UNTOLD}: no movement stayed on the plates for {SHORTEST_RUN:g} s. {_SQUATS}"
    yield f"{_UNTOLD}: {why}. {do}"
