"""What the simulation of a session gets wrong: checks first, then causes; what accepting them changes in the body
and gains elsewhere.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from biodance import display
from biodance.diagnosis.accept import Residuals
from biodance.diagnosis.combine_witnesses import SimulatedSize
from biodance.diagnosis.diagnosis import Diagnosis, Finding, Verdict
from biodance.diagnosis.engine import Examined, diagnose_trials, without_names
from biodance.diagnosis.gain import Gain
from biodance.diagnosis.naming import Naming, required_evidence
from biodance.diagnosis.own_tolerances import own_tolerances
from biodance.diagnosis.plate_axes import with_plate_axes
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.repairs import by_checks, named_first, with_repairs
from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.discovery import Chosen
from biodance.effects import DiscreteEffect, Effect, QualityCheck, causes, check_quality
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.identification import Identification
from biodance.identification.unloaded_body import expect_unloaded
from biodance.pipeline.another_body import beside_another_body, without_unplaced_markers
from biodance.pipeline.attention import reconcile_with_checks
from biodance.pipeline.gains import accepted, combined_with_witnesses, noted
from biodance.pipeline.identification import FITTED_ROLES, SessionIdentification
from biodance.pipeline.judged_trials import all_windows, cases_of, chosen_windows, judged_trials, left_out
from biodance.pipeline.load import with_load, with_weighed_load
from biodance.pipeline.results import MendedCopy, SessionResult
from biodance.pipeline.undone import with_faults_undone
from biodance.records import Sip
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances, shipped

if TYPE_CHECKING:
    import pandas as pd

_COPY = (
    "What is named first was undone in a copy, and everything else was found in that copy. "
    "The recordings themselves are as they were."
)


@dataclass(frozen=True, eq=False)
class SessionDiagnosis:
    """What the simulation of a visit gets wrong, and what accepting it changes.

    Parameters
    ----------
    diagnosis : Diagnosis
        Verdict and findings.
    examined : Examined or None
        What the engine looked at; None where a check stopped it.
    before, accepted : Identification or None
        What is identified without the findings and once they are accepted; None without findings.
    left : tuple or None
        What the body in use leaves of the kept trials, and what is left once the findings are accepted.
    failures : mapping
        What could not be computed ("what accepting changes"), with cause and cure.
    mended : MendedCopy or None
        The copy without large faults of forces, and with labels exchanged where that was asked for, in which all else
        was found; None where nothing was undone.
    gain : Gain or None
        Of all findings together on the kept trials; each has its own.

    Examples
    --------
    >>> found.verdict
    'nothing wrong'
    """

    diagnosis: Diagnosis
    examined: Examined | None = None
    before: Identification | None = None
    accepted: Identification | None = None
    left: tuple[Residuals, Residuals] | None = None
    failures: Mapping[str, str] = field(default_factory=dict)
    mended: MendedCopy | None = None
    gain: Gain | None = None

    def __repr__(self) -> str:
        return f"SessionDiagnosis({self.diagnosis.told})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.diagnosis.notes)

    @property
    def verdict(self) -> Verdict:
        """One of "nothing wrong", "named, complete", "named, incomplete", "unexplained"."""
        return self.diagnosis.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The causes named, in the order found."""
        return self.diagnosis.findings

    def table(self) -> "pd.DataFrame":
        """Return one row for each parameter of each finding, see `Diagnosis.table`.

        Returns
        -------
        pandas.DataFrame
            Empty where nothing is wrong.

        Examples
        --------
        >>> len(found.table())
        0
        """
        return self.diagnosis.table()


@one_thread()
def diagnose_session(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    effects: Chosen[Effect | DiscreteEffect] = None,
    mended: MendedCopy | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionDiagnosis:
    """Return the diagnosis of an examined session, with the gain of every finding on the trials that were kept.

    ``reference`` an earlier session of the same person without fault or load: its posterior is then what is known of
    the body; ``tolerances`` as learned by the laboratory; ``effects`` names limit the causes to these, objects
    (``[MyEffect()]``) join the family; ``mended`` says which labels were put right where ``result`` is of a copy
    (`with_right_labels`): they are named first. Faults too large for gates and statistics are undone in a copy, too.

    Where nothing can be judged, the verdict is "unexplained", and the first sentence says "Cannot tell".
    """
    tell("looking for faults too large for statistics")
    mended = with_faults_undone(result, mended, causes(effects), reference=reference, tell=tell)
    result = result if mended is None else mended.result
    found = _diagnosed(result, reference=reference, tolerances=tolerances, effects=effects, tell=tell)
    tell("observing feet on plates, clocks, weights")
    evidence = collect_evidence(result.session, effects, (tolerances or shipped()).norms)
    naming = found.examined.naming if found.examined else None
    measured = _measured(naming, found.diagnosis.why) if naming else {}
    whole = combined_with_witnesses(result, found.diagnosis, found.examined, evidence, measured)
    if naming:
        whole = with_repairs(whole, naming.found.problem.cases, tolerances or shipped(), effects)
    whole = named_first(whole, tuple(quality for quality in whole.checks if quality.mended and not quality.ok))
    if mended is not None:
        whole, found = named_first(whole, mended.checks, _COPY), replace(found, mended=mended)
        whole = replace(whole, checks=(*mended.checks, *whole.checks))
    plates = next((trial.plates for trial in result.session.trials if trial.plates), ())
    whole = replace(whole, findings=with_plate_axes(whole.findings, plates))
    looked_at = found.examined.naming.found.problem.looked_at if found.examined else frozenset[str]()
    result = with_weighed_load(result, whole)
    whole = with_load(whole, result.identification.search if result.identification else None)
    return replace(found, diagnosis=reconcile_with_checks(whole, result, judged_trials(result, looked_at)))


def _measured(naming: Naming, reasons: Collection[Reason]) -> dict[tuple[str, str], SimulatedSize]:
    """Return what the simulation tells of every cause, by effect and target, before any is named; nothing where it
    looked for none, or its tolerances do not hold.
    """
    if not {Reason.ONLY_STANDING, Reason.BODY_NOT_SCALED, Reason.TOLERANCES_DO_NOT_HOLD}.isdisjoint(reasons):
        return {}
    return {
        one.names: SimulatedSize(float(one.start[0]), one.sd, required_evidence(naming.first, one.visible) - one.score)
        for one in naming.screening.suspects
    }


def _diagnosed(
    result: SessionResult,
    *,
    reference: SessionIdentification | None,
    tolerances: Tolerances | None,
    effects: Chosen[Effect | DiscreteEffect],
    tell: Callable[[str], None],
) -> SessionDiagnosis:
    """Return what was found; `reconcile_with_checks` says it."""
    fitted = chosen_windows(result.trials)
    tell("checking units, signs, labels and clocks")
    asked = causes(effects)
    checks = check_quality(result.session, cases_of(result.body, all_windows(result.trials)), chosen=asked)
    failed = tuple(quality for quality in checks if not quality.ok and not quality.mended)
    if result.body is None or not fitted:
        why = f"No movement could be compared with a body. {result.body_source} {_reasons(result)}".strip()
        return SessionDiagnosis(by_checks(checks) if failed else _cannot_tell(checks, why, *result.doubts))
    tell("looking for causes")
    own = own_tolerances(result.body, fitted, result.session.trials, known=tolerances)
    try:
        examined = diagnose_trials(
            result.body,
            fitted,
            checks=checks,
            tolerances=own.tolerances,
            prior=_prior(reference, result),
            effects=asked,
            search=not failed,
        )
    except TrialRefused as why:
        return SessionDiagnosis(by_checks(checks) if failed else _cannot_tell(checks, str(why), *result.doubts))
    notes = (*_reference_note(reference), *result.doubts, *standing_notes(result), *left_out(result.trials), *own.notes)
    examined = noted(examined, *notes)
    if failed:
        return SessionDiagnosis(
            by_checks(checks, examined.diagnosis, suspicious=bool(examined.passes_threshold)), examined
        )
    unsure = {Reason.BODY_NOT_SCALED: not result.scaled, Reason.TOLERANCES_DO_NOT_HOLD: not own.believed}
    if any(unsure.values()):
        reasons = {**examined.diagnosis.why, **{reason: () for reason, holds in unsure.items() if holds}}
        examined = replace(examined, diagnosis=replace(examined.diagnosis, why=reasons))
        return SessionDiagnosis(_only_resembled(without_names(examined).diagnosis), examined)
    joints = tuple(one.name for one in result.shown_joints.gains if one.taken)
    examined = without_unplaced_markers(beside_another_body(examined, result.body, joints), result.body)
    tell("measuring what the findings change")
    return _with_gains(result, examined)


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


def diagnosed(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionDiagnosis | None:
    """Return the diagnosis of a session; None where the recordings cannot carry one."""
    try:
        return diagnose_session(result, reference=reference, tolerances=tolerances, tell=tell)
    except BiodanceError:
        return None


def _cannot_tell(checks: tuple[QualityCheck, ...], *notes: str) -> Diagnosis:
    """Return the diagnosis of a session of which nothing could be judged: its checks, and why."""
    return Diagnosis(verdict="unexplained", findings=(), checks=checks, notes=notes)


def _only_resembled(one: Diagnosis) -> Diagnosis:
    """Return the diagnosis without its names, which are only resembled: the tolerances under which they were found do
    not hold here.
    """
    alike = ", ".join(f"{finding.effect} {finding.target}".strip() for finding in one.resembles)
    if not alike:
        return one
    return replace(one, notes=(*one.notes, f"What is left resembles {alike}, which is not believed."))


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


def _with_gains(result: SessionResult, examined: Examined) -> SessionDiagnosis:
    """Return the diagnosis with what accepting its findings changes, where there are any and movement to identify
    from.
    """
    before = result.identification.identification if result.identification else None
    if not examined.diagnosis.findings or before is None:
        return SessionDiagnosis(examined.diagnosis, examined, before)
    found = accepted(result, examined, before)
    return SessionDiagnosis(
        found.examined.diagnosis, found.examined, before, found.identified, found.left, found.failures, gain=found.gain
    )
