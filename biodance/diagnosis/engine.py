"""A session's diagnosis: the causes named, whether the rest is like a session without fault, what was not seen."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.adequacy import (
    CONFLICT_LIMIT,
    LIMIT,
    LOUDER,
    STRETCHED,
    TORN,
    adequacy,
    conflict_at_loudness,
    conflict_at_own_noise,
    largest_z,
    residual_scale,
    stretch,
    verdict,
    with_strides_once,
)
from biodance.diagnosis.consequence import matters
from biodance.diagnosis.diagnosis import Diagnosis, Estimate, Finding, Unobservable
from biodance.diagnosis.doubt import doubt_reasons, only_resembled
from biodance.diagnosis.model import Model, NamedCause
from biodance.diagnosis.naming import Naming, Round, cause_key, causes_of, name_causes, passes_threshold, without_cause
from biodance.diagnosis.observability import detection_limits, hidden, visibility
from biodance.diagnosis.plate_axes import in_plate_axes
from biodance.diagnosis.problem import Problem, TrialWindow, problem
from biodance.diagnosis.reasons import OF_RESIDUAL, Reason
from biodance.diagnosis.size_dependence import changes_wrench, significant_dependences
from biodance.diagnosis.transient_contact import with_transient_contact
from biodance.diagnosis.unusual_body import robust_causes
from biodance.discovery import Chosen
from biodance.effects import Case, DiscreteEffect, Effect, QualityCheck, unit_at
from biodance.effects import effects as family
from biodance.records import Sip
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances, key_of, shipped


@dataclass(frozen=True, eq=False)
class Examined:
    """A diagnosis with what it was made from: ``naming`` all rounds, with the problem; ``named`` the causes of
    the findings (without any: those that it resembles), with their sizes.
    """

    diagnosis: Diagnosis
    naming: Naming
    named: tuple[NamedCause, ...] = ()

    @property
    def passes_threshold(self) -> bool:
        """Whether a cause passes the threshold before any is named."""
        return passes_threshold(self.naming.screening, self.naming.first.tolerances)


@one_thread()
def diagnose_trials(
    body: Body,
    windows: tuple[TrialWindow, ...],
    *,
    checks: tuple[QualityCheck, ...] = (),
    tolerances: Tolerances | None = None,
    prior: Sip | None = None,
    effects: Chosen[Effect | DiscreteEffect] = None,
    search: bool = True,
) -> Examined:
    """Return what the simulation of ``body`` (with the SIP known before, by default the table's) gets wrong in the
    trials ``windows``.

    ``checks`` the checks made before; ``tolerances`` of everything that is no fault (those of virtual subjects by
    default); ``prior`` of the parameters (an earlier session's; by default the table's); ``effects`` names limit the
    causes to these, objects (``[MyEffect()]``) are looked for beside the family; without ``search`` nothing is named:
    only what is left is judged.

    Raises
    ------
    TrialRefused
        No trial has a second of believable, fully measured frames.
    """
    known = tolerances or shipped()
    asked = family(effects)
    posed = problem(body, windows, prior=prior, chosen=asked)
    standing = not any(is_moving(case) for case, picks in zip(posed.cases, posed.spectrum.picks, strict=True) if picks)
    naming, scale = _named_at_own_noise(posed, known, asked, search=search and not standing, standing=standing)
    rows = detection_limits(visibility(naming.first, naming.first_causes), body, known.threshold)
    why: dict[Reason, tuple[str, ...]] = {Reason.ONLY_STANDING: ()} if standing else {}
    if scale > LOUDER:
        why[Reason.LOUD_LABORATORY] = (f"{scale:.1f}",)
    bare = Diagnosis(
        verdict="nothing wrong",
        findings=(),
        checks=checks,
        unobservable=hidden(rows),
        limits=tuple(sorted(rows, key=_relative)),
        notes=posed.notes,
        why=why,
        candidates=tuple(one.alias for one in naming.screening.suspects),
    )
    return assess(Examined(bare, naming))


def _named_at_own_noise(
    posed: Problem, known: Tolerances, asked: Mapping[str, Effect], *, search: bool, standing: bool
) -> tuple[Naming, float]:
    """Return the naming with tolerances scaled to the noise of this laboratory where it exceeds `LOUDER`, and the
    scale: `residual_scale` of the residual left by a first naming; quiet ``standing`` does not determine it.
    """
    every = causes_of(posed, known, asked)

    def named(under: Tolerances) -> Naming:
        if not search:
            return name_causes(posed, under, asked, rounds=0, every=every)
        return with_transient_contact(name_causes(posed, under, asked, every=every), asked)

    naming = named(known)
    scale = 1.0 if standing else residual_scale(naming.found)
    if scale <= LOUDER:
        return naming, scale
    del naming  # no two of them at once: they are the largest that a diagnosis keeps
    return named(replace(known, noise=scale**2 * known.noise, zeros=scale**2 * known.zeros)), scale


def assess(examined: Examined) -> Examined:
    """Return the session with the verdict and findings of its naming, and the adequacy of the remaining residual."""
    naming, one = examined.naming, examined.diagnosis
    remaining, posed, known = adequacy(naming.found), naming.found.problem, naming.found.tolerances
    named = tuple(_measured(cause, naming.found) for cause in naming.found.named)
    dependences = {names: one.over for names, one in significant_dependences(naming.found).items()}
    every = [
        (cause, replace(_finding(cause, r, known, posed.cases[0]), varies_with=dependences.get(cause_key(cause), "")))
        for cause, r in zip(named, naming.accepted, strict=True)
    ]
    reportable = [pair for pair in every if _is_reportable(naming.found, pair[0])]
    conflicts = _conflicts(naming.found, named=bool(reportable))
    outcome = verdict(len(reportable), largest_z(remaining), one.checks, in_conflict=bool(conflicts))
    doubted = only_resembled(reportable, named, known)
    if (
        outcome == "unexplained"
        and conflicts == (Reason.UNUSUAL_BODY,)
        and largest_z(remaining) <= LIMIT
        and len(doubted) < len(reportable)
    ):
        sure = robust_causes(naming.found, naming.accepted)
        stand = [pair for pair in reportable if cause_key(pair[0]) in sure and any(p.known for p in pair[1].parameters)]
        doubted = [pair for pair in reportable if pair in doubted or pair not in stand]
        outcome = "named, incomplete" if len(doubted) < len(reportable) else outcome
    trusted = [] if outcome == "unexplained" else [pair for pair in reportable if pair not in doubted]
    if doubted and outcome != "unexplained":
        outcome = "named, incomplete" if trusted else "unexplained"
    if doubted and not (trusted or conflicts) and largest_z(remaining) <= LIMIT:
        bare = naming.bare
        remaining, conflicts = adequacy(bare), (Reason.WITHOUT_RESEMBLED, *_conflicts(bare, named=False))
    if outcome == "named, complete" and any(row.z > LIMIT for row in remaining):
        outcome = "named, incomplete"
    left = [Reason.FORCES_LEFT] if largest_z(remaining) > LIMIT else []
    why = {reason: about for reason, about in one.why.items() if reason not in OF_RESIDUAL}
    why |= dict.fromkeys((*left, *conflicts), ()) | doubt_reasons(reportable, named, known)
    found = replace(
        one,
        verdict=outcome,
        why=why,
        findings=tuple(finding for _, finding in trusted),
        resembles=tuple(finding for pair in reportable if pair not in trusted for finding in pair[1:]),
        tolerated=tuple(pair[1] for pair in every if pair not in reportable),
        adequacy=remaining,
    )
    return Examined(found, naming, tuple(cause for cause, _ in trusted or reportable))


def _is_reportable(found: Model, cause: NamedCause) -> bool:
    """Return whether a cause is large enough to be told: its size matters, and what it changes in this session's wrench
    does (5 % of a shear of 2 N is a tenth of a newton, however well it is seen). One that comes and goes is felt while
    it is there.
    """
    return matters(cause.effect, cause.theta) and (bool(cause.course) or changes_wrench(found, cause))


def is_moving(case: Case) -> bool:
    """Return whether the person does more than stand: the centre of mass of any segment moves by more than in quiet
    standing (`StandingRules.still`), and the trial is not the static one.
    """
    place = case.poses.points(list(range(len(case.body.segments))), case.body.sip.com)
    away = np.sqrt(np.mean(np.sum((place - place.mean(axis=0)) ** 2, axis=2), axis=0))
    return case.trial.role != "static" and bool(away.max() > case.trial.settings.standing.still)


def without_names(examined: Examined, checks: tuple[QualityCheck, ...] = ()) -> Examined:
    """Return the same session with no cause named: what was named is only what it resembles, and what is left is
    judged without it.
    """
    naming, one = examined.naming, replace(examined.diagnosis, checks=checks)
    found = assess(Examined(one, replace(naming, found=naming.bare, accepted=())))
    unnamed = replace(
        found.diagnosis, checks=examined.diagnosis.checks, resembles=(*one.findings, *one.resembles), tolerated=()
    )
    return replace(found, diagnosis=unnamed)


def without_name(examined: Examined, index: int) -> Examined:
    """Return the same session without the finding ``index``, which is only what it resembles; the sizes of all other
    causes are fitted again, and what is left is judged without it.
    """
    gone, one = examined.diagnosis.findings[index], examined.diagnosis
    names = [cause_key(cause) for cause in examined.naming.found.named]
    found = assess(replace(examined, naming=without_cause(examined.naming, names.index((gone.effect, gone.target)))))
    resembles = (*found.diagnosis.resembles, gone, *one.resembles)
    return replace(found, diagnosis=replace(found.diagnosis, resembles=resembles))


def _conflicts(found: Model, *, named: bool) -> tuple[Reason, ...]:
    """Return what had to be unlike people or laboratories for the rest to fit; where a cause is ``named``, it has to
    fit without any excuse but how loud the session is.
    """
    once = with_strides_once(found)
    body = (conflict_at_loudness(once) if named else conflict_at_own_noise(once)) > CONFLICT_LIMIT
    far = stretch(found)
    strange = {
        Reason.UNUSUAL_BODY: body,
        Reason.OUTSIDE_TOLERANCES: far > STRETCHED,
        Reason.OUTSIDE_EVERY_LABORATORY: far > TORN,
    }
    return tuple(reason for reason, holds in strange.items() if holds)


def _relative(row: Unobservable) -> float:
    return row.limit / row.typical


def _measured(one: NamedCause, found: Model) -> NamedCause:
    """Return a named cause with the whole of its size (`Model.whole`), or with the one that the markers show by
    themselves, where they do (`Effect.measured`).
    """
    if one.course:
        return one
    covariance, shown = np.array(one.covariance), found.tolerances.size(f"shown {one.effect.name}")
    covariance[0, 0] = shown**2 or covariance[0, 0]
    theta = one.effect.measured(found.whole(one), *found.problem.cases)
    return replace(one, theta=theta, covariance=covariance)


def _finding(one: NamedCause, found: Round, known: Tolerances, case: Case) -> Finding:
    """Return a named cause as a finding; no size is surer than sessions without fault are alike, nor than faults are
    like their models.
    """
    alike = known.size(key_of(one.effect.name, one.effect.target)) * one.effect.typical / one.effect.typical[0]
    units = np.array([parameter.unit for parameter in one.effect.parameters])
    length = np.array([np.linalg.norm(one.theta[units == unit]) for unit in units])
    sd = np.hypot(np.maximum(np.sqrt(np.diag(one.covariance)), alike), known.model_error(one.effect.name) * length)
    reported = one.effect.reported(case, one.theta, sd)
    place = one.effect.target
    parameters = tuple(Estimate(name, size, own, unit_at(unit, place)) for name, size, own, unit in reported)
    advice = f"{one.effect.advice} {in_plate_axes(place, case.trial.plates)}".strip()
    return Finding(one.effect.name, place, parameters, found.set, found.suspects[0].visible, advice=advice)
