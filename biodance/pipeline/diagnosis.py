"""What the simulation of a session gets wrong: checks first, then causes; what accepting them changes in the body
and gains elsewhere.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from biodance.diagnosis.diagnosis import Diagnosis
from biodance.diagnosis.of_family import of_family
from biodance.diagnosis.own_tolerances import SessionTolerances, own_tolerances
from biodance.diagnosis.plate_axes import with_plate_axes
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.repairs import named_first, with_failed, with_repairs
from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.discovery import Chosen
from biodance.effects import Cause, DiscreteEffect, Effect, Recorded, causes, check_quality
from biodance.effects.body_mass import BodyMass
from biodance.effects.labels_swapped import LabelsSwapped
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.added_mass import LoadSearch
from biodance.identification.unloaded_body import expect_unloaded
from biodance.inference.decision import Inferred
from biodance.inference.session import judge, see
from biodance.pipeline.accepted import accepted, with_faults_undone, with_proven_corrections, with_right_labels
from biodance.pipeline.attention import reconcile_with_checks
from biodance.pipeline.identification import FITTED_ROLES, SessionIdentification
from biodance.pipeline.judged_trials import chosen_windows, judged_trials, left_out, recorded_of
from biodance.pipeline.load import with_load, with_weighed_load
from biodance.pipeline.results import SessionDiagnosis as SessionDiagnosis
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import identified
from biodance.records import Sip
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances, shipped

if TYPE_CHECKING:
    pass


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
    copy (`with_right_labels`, `with_faults_undone`), named first, and everything else is judged there.

    Where nothing can be judged, the verdict is "unexplained", and the first sentence says "Cannot tell".
    """
    tell("looking for faults too large for statistics")
    family = _suspects(effects, result)
    recorded, right = recorded_of(result), None
    if LabelsSwapped.name in family:
        right = with_right_labels(result, recorded, reference=reference, tell=tell)
    if right is not None:
        result, recorded = right.result, recorded_of(right.result)
    mended, recorded = with_faults_undone(result, recorded, right, family, reference=reference, tell=tell)
    result = identified(mended.result if mended else result, reference=reference, tell=tell)
    mended = replace(mended, result=result) if mended else None
    found = _judged(result, recorded, family, reference=reference, tolerances=tolerances, tell=tell)
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
    whole = with_load(whole, _load_of(weighed, whole))
    whole = reconcile_with_checks(whole, weighed, judged_trials(weighed, found.looked_at))
    return replace(found, diagnosis=whole, judged=result)


def _suspects(effects: Chosen[Effect | DiscreteEffect], result: SessionResult) -> Mapping[str, Cause]:
    """Return the causes that may be named; a declared mass is none where nobody declared one: the plates weighed it."""
    family = causes(effects)
    if "mass" not in result.session.subject.guessed:
        return family
    return {name: one for name, one in family.items() if name != BodyMass.name} or family


def _load_of(result: SessionResult, whole: Diagnosis) -> LoadSearch | None:
    """Return the search for a load; None without one, or where a cause in the person is named already."""
    if result.identification is None or any(one.cause.of_person() for one in whole.findings):
        return None
    return result.identification.search


def _judged(
    result: SessionResult,
    recorded: Recorded,
    asked: Mapping[str, Cause],
    *,
    reference: SessionIdentification | None,
    tolerances: Tolerances | None,
    tell: Callable[[str], None],
) -> SessionDiagnosis:
    """Return what was found; `reconcile_with_checks` says it."""
    fitted = chosen_windows(result.trials)
    tell("checking units, signs, labels and clocks")
    checks = check_quality(recorded, chosen=asked)
    failed = tuple(quality for quality in checks if not quality.ok and not quality.mended)
    tell("observing feet on plates, clocks, weights")
    known = tolerances or shipped()
    evidence = collect_evidence(result.session, asked, known.norms)
    if any(asked[quality.effect].raw for quality in failed if quality.effect in asked):
        evidence = evidence.only(_ANYWAY)
    bare = Diagnosis(
        False, (), checks=checks, notes=result.doubts, witnesses=evidence if evidence.observations else None
    )
    tell("looking for causes")
    seen, own, looked_at, simulate = None, None, frozenset[str](), not failed
    if result.body is None or not fitted:
        why = f"No movement could be compared with a body. {result.body_source} {_reasons(result)}".strip()
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
    told = replace(_with_gains(result, found), looked_at=looked_at)
    return replace(told, diagnosis=with_failed(failed, told.diagnosis)) if failed else told


def _body_reasons(result: SessionResult, own: SessionTolerances) -> dict[Reason, tuple[str, ...]]:
    """Return why forces simulated with this body prove nothing, each reason with what it concerns."""
    joints = tuple(gain.name for gain in result.shown_joints.gains if gain.taken)
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
    result = found.judged if found.judged and not found.mended else result
    if not result.corrections:
        result = with_proven_corrections(result, found.inferred, found.mended, reference=reference, tell=tell)
    return identified(result, reference=reference, tell=tell), found


def _prior(reference: SessionIdentification | None, result: SessionResult) -> Sip | None:
    """Return what an earlier session lets expect of the body, or the body that the session started from; None without
    either.
    """
    if reference is None or result.identification is None or reference.identification.status == "failed":
        return result.prior
    return expect_unloaded(reference.identification, result.identification.identification)


def _reference_note(reference: SessionIdentification | None) -> tuple[str, ...]:
    """Say that the reference tells nothing of the body, if so."""
    if reference is None or reference.identification.status == "solved":
        return ()
    return (
        f"Session {reference.name} tells nothing of the body, so the table is what is known before. "
        f"{reference.identification.cause}",
    )


def _reasons(result: SessionResult) -> str:
    return " ".join(
        dict.fromkeys(reason for trial in result.trials if trial.trial.role in FITTED_ROLES for reason in trial.reasons)
    )


def _with_gains(result: SessionResult, found: Inferred) -> SessionDiagnosis:
    """Return the diagnosis with what accepting its findings changes, where there are any and movement to identify
    from.
    """
    before = result.identification.identification if result.identification else None
    if not found.named or before is None:
        return SessionDiagnosis(found.diagnosis, found, before)
    return accepted(result, found, before)
