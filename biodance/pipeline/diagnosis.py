"""What the simulation of a session gets wrong: checks, causes, one load, and what accepting them gains elsewhere."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.own_tolerances import SessionTolerances, own_tolerances
from biodance.diagnosis.plate_axes import of_family, with_plate_axes
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.repairs import named_first, with_failed, with_repairs
from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.discovery import Chosen
from biodance.effects import Cause, CheckKind, DiscreteEffect, Effect, Recorded, causes, check_quality
from biodance.effects.added_mass import AddedMass
from biodance.effects.body_mass import BodyMass
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.added_mass import LoadSearch, expect_unloaded
from biodance.inference.decision import UNPLACED_LOAD
from biodance.inference.session import judge, see
from biodance.pipeline.accepted import accepted, with_faults_undone, with_proven_corrections
from biodance.pipeline.attention import reconcile_with_checks
from biodance.pipeline.identification import FITTED_ROLES, SessionIdentification, load_doubts
from biodance.pipeline.judged_trials import chosen_windows, half_spans, judged_trials, left_out
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.session import identified
from biodance.pipeline.words import LOAD, cause_of, explained
from biodance.records import Sip
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances, shipped


def as_diagnosed(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session with what the ``diagnosis`` says of its load: told where it may be, else why not."""
    return with_causes_of_doubt(with_weighed_load(result, diagnosis), diagnosis)


def with_weighed_load(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session with its load told where nothing but its own weight spoke against it and it is more probable
    than none: a weight other than declared is a doubt about a load until the ``diagnosis`` names a load, alone or among
    causes that it cannot tell apart.
    """
    found = result.identification
    if found is None or not any(alias.effect == LOAD for one in diagnosis.findings for alias in one.set):
        return result
    plain, weighed = (set(load_doubts(result.all_checks, weighed=one)) for one in (False, True))
    search = replace(found.search, doubts=tuple(one for one in found.search.doubts if one not in plain - weighed))
    return replace(result, identification=replace(found, search=search)) if _likely(search) else result


def with_causes_of_doubt(result: SessionResult, diagnosis: Diagnosis) -> SessionResult:
    """Return the session whose doubt about a load points to the cause found in place of its advice."""
    found, causes = result.identification, [one for one in diagnosis.findings if one.effect != LOAD]
    if found is None or not found.search.doubts or not causes:
        return result
    pointed = {}
    for check in result.all_checks:
        for doubt in load_doubts([check], weighed=False):
            cause = cause_of(check.what, causes)
            pointed[doubt] = f"{doubt.removesuffix(check.advice)}{explained(cause)}" if cause else doubt
    doubts = tuple(pointed.get(doubt, doubt) for doubt in found.search.doubts)
    return replace(result, identification=replace(found, search=replace(found.search, doubts=doubts)))


def with_load(one: Diagnosis, search: LoadSearch | None) -> Diagnosis:
    """Return the diagnosis with the load that was found (`LoadSearch`) in place of its own, before a cause that cannot
    be told from it, as an alternative to one of the same weight, or beside what has another reason; where only its
    weight was named (`UNPLACED_LOAD`), on the segments that may carry it, as soon as it is more probable than none.
    """
    if search is None:
        return one
    heavy = next((finding for finding in one.findings if any(alias.effect == LOAD for alias in finding.set)), None)
    mine = [finding for finding in one.findings if finding.effect == LOAD]
    if heavy is not None and not mine:
        return _with(one, heavy, _placed(heavy, search))
    if not search.found or len(mine) > 1:  # the search knows one load only
        return one
    load = _finding(search, mine[0] if mine else None)
    if mine:
        return _with(one, mine[0], load)
    alike = next((finding for finding in one.findings if CheckKind.WEIGHT in finding.cause.explains), None)
    if alike is not None:
        return _with(one, alike, replace(alike, set=(*alike.set, *load.set)))
    return replace(one, findings=(*one.findings, load))


def _with(one: Diagnosis, finding: Finding, other: Finding) -> Diagnosis:
    """Return the diagnosis with another finding in the place of one."""
    return replace(one, findings=tuple(other if every is finding else every for every in one.findings))


def _likely(search: LoadSearch) -> bool:
    """Return whether a load is more probable than none, a wrong declared mass among what is none, and may be told."""
    return search.status != "none" and not search.doubts


def _placed(finding: Finding, search: LoadSearch) -> Finding:
    """Return a cause of weight, from which a load cannot be told, with that load on the segments of the search; the
    load first where it was found, or likely where only the weight was named: the search has compared it with a wrong
    declared mass, or with the reference, in every posture.
    """
    weight_only = any((alias.effect, alias.target) == UNPLACED_LOAD for alias in finding.set)
    if not (search.found or weight_only):
        return finding
    bayes = next(alias.log_bayes_factor for alias in finding.set if alias.effect == LOAD)
    here = tuple(Alias(LOAD, segment, bayes) for segment in search.segments)
    others = tuple(alias for alias in finding.set if alias.effect != LOAD)
    if _likely(search):
        return replace(_finding(search, None), set=(*here, *others))
    return replace(finding, set=(*others, *here))


def _finding(search: LoadSearch, named: Finding | None) -> Finding:
    """Return the load as a finding, with what the diagnosis knows of the one that it ``named``."""
    best, bayes = search.best, {one.segment: one.log_bayes_factor for one in search.suspects}
    own = Estimate("mass", best.mass, best.sd, "kg", best.interval)
    place = zip("xyz", best.place, best.place_sd, strict=True)
    parameters = (own, *(Estimate(f"place_{axis}", float(v), float(sd), "m") for axis, v, sd in place if v == v))
    others = tuple(alias for alias in (named.set if named else ()) if alias.effect != LOAD)
    alike = (*(Alias(LOAD, segment, bayes[segment]) for segment in search.segments), *others)
    if named is None:
        return Finding(LOAD, best.segment, parameters, alike, float("nan"), advice=AddedMass.advice)
    return replace(named, target=best.segment, parameters=parameters, set=alike)


_ANYWAY = ("standing_twist",)
"""Observations to which other channels hardly matter: believed beside one that is wrong."""
_COPY = (
    "What is named first was undone in a copy, and everything else was found in that copy. "
    "The recordings themselves are as they were."
)


@one_thread()
def diagnose_session(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    effects: Chosen[Effect | DiscreteEffect] = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionDiagnosis:
    """Return the diagnosis of a session that was examined, or `followed`, with the gain of every finding on the trials
    that were kept.

    ``reference`` an earlier session of the same person without fault or load: its posterior is then what is known of
    the body; ``tolerances`` as learned by the laboratory; ``effects`` names limit the causes to these, objects
    (``[MyEffect()]``) join the family. Exchanged labels, and faults too large for gates and statistics, are undone in a
    copy (`with_faults_undone`), named first, and everything else is judged there.

    Where nothing can be judged, the verdict is "unexplained", and the first sentence says "Cannot tell".
    """
    tell("looking for faults too large for statistics")
    family = _suspects(effects, result)
    result, recorded, mended = with_faults_undone(result, family, reference=reference, tell=tell)
    # weighed in the copy: in the session as recorded the segments would carry the fault that was undone
    result = identified(result, reference=reference, tell=tell)
    found, looked_at = _judged(result, recorded, family, reference=reference, tolerances=tolerances, tell=tell)
    whole = of_family(found.diagnosis, family)
    cases = found.inferred.search.rows.problem.cases if found.inferred and found.inferred.search.rows.problem else ()
    if cases:
        whole = with_repairs(whole, cases, tolerances or shipped(), effects)
    whole = named_first(whole, tuple(quality for quality in whole.checks if quality.mended and not quality.ok))
    if mended is not None:
        whole, found = named_first(whole, mended.checks, _COPY), replace(found, mended=mended)
        whole = replace(whole, checks=(*mended.checks, *whole.checks))
    plates = next((trial.plates for trial in result.session.trials if trial.plates), ())
    whole = of_family(replace(whole, findings=with_plate_axes(whole.findings, plates)), family)
    weighed = with_weighed_load(result, whole)
    if not any(one.cause.of_person() for one in whole.findings):
        whole = with_load(whole, weighed.identification.search if weighed.identification else None)
    whole = reconcile_with_checks(whole, weighed, judged_trials(weighed, looked_at))
    return replace(found, diagnosis=whole, judged=result)


def _suspects(effects: Chosen[Effect | DiscreteEffect], result: SessionResult) -> Mapping[str, Cause]:
    """Return the causes that may be named; no declared mass where the plates weighed the person."""
    family = causes(effects)
    if "mass" not in result.session.subject.guessed:
        return family
    return {name: one for name, one in family.items() if name != BodyMass.name} or family


def _judged(
    result: SessionResult,
    recorded: Recorded,
    asked: Mapping[str, Cause],
    *,
    reference: SessionIdentification | None,
    tolerances: Tolerances | None,
    tell: Callable[[str], None],
) -> tuple[SessionDiagnosis, frozenset[str]]:
    """Return what was found, which `reconcile_with_checks` says, and the trials that were compared with a body."""
    fitted = chosen_windows(result.trials)
    tell("checking units, signs, labels and clocks")
    checks = check_quality(recorded, chosen=asked)
    failed = tuple(quality for quality in checks if not quality.ok and not quality.mended)
    tell("observing feet on plates, clocks, weights")
    known = tolerances or shipped()
    evidence = collect_evidence(result.session, asked, known.norms, half_spans(result.trials))
    # what feet, clocks and weights measure on spoilt channels has no size
    if any(asked[quality.effect].raw for quality in failed if quality.effect in asked):
        evidence = evidence.only(_ANYWAY)
    bare = Diagnosis(
        False, (), checks=checks, notes=result.doubts, witnesses=evidence if evidence.observations else None
    )
    tell("looking for causes")
    seen, own, looked_at, simulate = None, None, frozenset[str](), not failed
    if result.body is None or not fitted:
        told = (reason for one in result.trials if one.trial.role in FITTED_ROLES for reason in one.reasons)
        why = " ".join(["No movement could be compared with a body.", result.placed.source, *dict.fromkeys(told)])
        bare = replace(bare, notes=(why, *bare.notes))
    else:
        own = own_tolerances(result.body, fitted, result.session.trials, known=tolerances)
        try:
            seen = see(result.body, fitted, own.tolerances, asked, _prior(reference, result))
        except TrialRefused as why:
            bare = replace(bare, notes=(str(why), *bare.notes))
        else:
            session = (*_reference_note(reference), *bare.notes, *standing_notes(result), *left_out(result.trials))
            reasons = _body_reasons(result, own)
            bare = replace(bare, notes=(*session, *own.notes), why=reasons)
            looked_at, simulate = seen.problem.looked_at, simulate and not reasons
    found = judge(seen, evidence, own.tolerances if own else known, asked, bare, simulate=simulate)
    tell("measuring what the findings change")
    before = result.identification.identification if result.identification else None
    gained = accepted(result, found, before)
    return replace(gained, diagnosis=with_failed(failed, gained.diagnosis)) if failed else gained, looked_at


def _body_reasons(result: SessionResult, own: SessionTolerances) -> dict[Reason, tuple[str, ...]]:
    """Return why forces simulated with this body prove nothing, each reason with what it concerns."""
    joints = result.placed.taken
    # new joints of a sound body may be judged; of a doubtful one they excuse anything
    reasons = {Reason.UNDESCRIBED_JOINTS: joints} if joints and result.doubts else {}
    unsure = {Reason.BODY_NOT_SCALED: not result.scaled, Reason.TOLERANCES_DO_NOT_HOLD: not own.believed}
    return reasons | {reason: () for reason, holds in unsure.items() if holds}


def standing_notes(result: SessionResult) -> tuple[str, ...]:
    """Say where the table's centre of mass lies beside the measured centre of pressure in quiet standing."""
    found = result.standing
    if found is None or not found.com.size:
        return ()
    ahead, left = 1000 * found.com_ahead, 1000 * found.com_left
    sides = "in front of" if ahead > 0 else "behind", "left" if left > 0 else "right"
    return (
        f"Standing still ({found.trial}), the table's centre of mass lies {abs(ahead):.0f} mm {sides[0]} the centre of "
        f"pressure and {abs(left):.0f} mm to its {sides[1]}.",
    )


def diagnosed_and_corrected(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[SessionResult, SessionDiagnosis | None]:
    """Return a session, examined or `followed`, identified without what its diagnosis proves to be wrong
    (`with_proven_corrections`), and the diagnosis of the session as it was recorded; None where the recordings cannot
    carry one.
    """
    try:
        found = diagnose_session(result, reference=reference, tolerances=tolerances, tell=tell)
    except BiodanceError:
        return identified(result, reference=reference, tell=tell), None
    # a copy in which faults were undone stands for the session only where that is proven
    result = result if found.mended or found.judged is None else found.judged
    if not result.corrections:
        result = with_proven_corrections(result, found, reference=reference, tell=tell)
    return identified(result, reference=reference, tell=tell), found


def _prior(reference: SessionIdentification | None, result: SessionResult) -> Sip | None:
    """Return what an earlier session, or the body that this one started from, lets expect; None without either."""
    if reference is None or result.identification is None or reference.identification.status == "failed":
        return result.placed.prior
    return expect_unloaded(reference.identification, result.identification.identification)


def _reference_note(reference: SessionIdentification | None) -> tuple[str, ...]:
    """Say that the reference tells nothing of the body, if so."""
    if reference is None or reference.identification.status == "solved":
        return ()
    return (
        f"Session {reference.name} tells nothing of the body, so the table is what is known before. "
        f"{reference.identification.cause}",
    )
