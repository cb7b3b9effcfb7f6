"""A session's posterior from what was recorded: which rows judge it, and the diagnosis that follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.candidates import Candidate
from biodance.diagnosis.consequence import NAMED
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Finding
from biodance.diagnosis.model import causes_of
from biodance.diagnosis.problem import Problem, TrialWindow, problem
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.spectrum import power_about
from biodance.diagnosis.witness_evidence import CONTACTS, ObservedEvidence
from biodance.effects import Case, Cause, Effect, Transient
from biodance.inference.columns import VisibleColumns
from biodance.inference.contact import with_contacts
from biodance.inference.decision import Inferred, decide
from biodance.inference.hypotheses import Hypothesis, Posterior
from biodance.inference.observability import detection_limits, hidden, visibility
from biodance.inference.own_noise import own_noise
from biodance.inference.rows import Rows, rows_of, with_observed
from biodance.inference.scales import bare, fit, nominal, prior_sd
from biodance.inference.sets import Search, hypothesis, infer
from biodance.inference.unknown import adequacy, with_unknown
from biodance.records import Array, Sip
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances

_SIGN = 0.005
"""Probability that a channel of a session has the wrong sign, before any data."""

_HEAVIER = 0.3
"""Share of a segment's mass by which it must look heavier before its kinematic errors are computed again."""
_STALE = 0.03
"""Share of the predicted wrench that may change before causes are predicted again: their sizes are then right to
this share.
"""


@dataclass(frozen=True, eq=False)
class Seen:
    """What the simulation of a session shows: its ``problem``, all ``causes`` with their columns, and whether it is
    only quiet ``standing``, in which no cause of the simulation has a size.
    """

    problem: Problem
    causes: tuple[Candidate, ...]
    standing: bool = False


def see(
    body: Body, windows: tuple[TrialWindow, ...], known: Tolerances, asked: Mapping[str, Cause], prior: Sip | None
) -> Seen:
    """Return what the trials ``windows`` of ``body`` show.

    Raises
    ------
    TrialRefused
        No trial has a second of believable, fully measured frames.
    """
    kinds = {name: one for name, one in asked.items() if isinstance(one, Effect)}
    posed = problem(body, windows, prior=prior, chosen=kinds)
    standing = not any(is_moving(case) for case, picks in zip(posed.cases, posed.spectrum.picks, strict=True) if picks)
    return Seen(posed, causes_of(posed, known, kinds), standing)


@one_thread()
def judge(
    seen: Seen | None,
    evidence: ObservedEvidence,
    known: Tolerances,
    asked: Mapping[str, Cause],
    bare: Diagnosis,
    *,
    simulate: bool = True,
) -> Inferred:
    """Return the diagnosis of a session from everything it shows; from observations alone where nothing was ``seen``,
    it only stands, or the simulation cannot be believed (``simulate`` False).
    """
    if seen is not None and simulate and not seen.standing:
        every = with_observed(seen.causes, evidence, asked, seen.problem)
        seen, known = _with_own_noise(seen, every, known, evidence)
        rows = rows_of(seen.problem, every, known, evidence)
    else:
        every = with_observed((), evidence, asked, of=seen.problem.cases[0] if seen else None)
        rows = rows_of(None, every, known, evidence)
    search, posterior = _inferred(rows, every, asked, evidence)
    if seen is not None:
        bare = _with_limits(bare, seen.problem, search, posterior)
        bare = replace(bare, why={**bare.why, Reason.ONLY_STANDING: ()}) if seen.standing else bare
    causes = search.causes
    found = decide(search, posterior, bare)
    sign = _turned(evidence, known, causes, asked) if rows.evidence is not None else ()
    if sign:  # what all other causes do holds only once the sign is mended
        told = replace(found.diagnosis, findings=sign, explained=False)
        found = replace(found, diagnosis=told, named=())
    return found if rows.problem is not None else replace(found, diagnosis=_with_rest(found.diagnosis, seen, known))


def _with_own_noise(
    seen: Seen, every: tuple[Candidate, ...], known: Tolerances, evidence: ObservedEvidence
) -> tuple[Seen, Tolerances]:
    """Return what was seen with the noise where the session's movement has it, and the tolerances with its own noise
    (`own_noise`).
    """
    posed = seen.problem
    power = power_about(posed.spectrum, posed.cases, known.whiteners(posed.mass))
    quiet, share = own_noise(rows_of(posed, every, known, evidence), power)
    if not share:
        return seen, quiet
    seen = replace(seen, problem=posed.with_loud(np.sqrt(1 - share + share * power)))
    return seen, own_noise(rows_of(seen.problem, every, known, evidence))[0]


def _inferred(
    rows: Rows, every: tuple[Candidate, ...], asked: Mapping[str, Cause], evidence: ObservedEvidence
) -> tuple[Search, Posterior]:
    """Return the search and its posterior: what looks heavier errs more with the markers; and causes are predicted
    again from the body of the most probable set where it moves otherwise than the prior's (a tilted floor pulls at the
    centre of mass that is there).
    """
    search = Search.of(rows, _of(every, asked))
    if rows.problem is None:
        return search, infer(search)
    posed, phi = rows.problem, hypothesis(search, ()).phi
    # phi[::10]: the masses, first of ten parameters of each segment.
    if np.any(phi[::10] - posed.prior.mass > _HEAVIER * posed.prior.mass):
        posed = posed.with_matter(phi)
        search = Search.of(rows_of(posed, every, rows.tolerances, evidence), search.causes)
    found = infer(search, _contacts)
    if not found.best.causes or not _predicts_otherwise(posed, found.best.phi):
        return search, found
    kinds = {name: one for name, one in asked.items() if isinstance(one, Effect)}
    posed = posed.with_parameters(found.best.phi)
    every = with_observed(causes_of(posed, rows.tolerances, kinds), evidence, asked, posed)
    search = Search.of(rows_of(posed, every, rows.tolerances, evidence), _of(every, asked))
    return search, infer(search, _contacts)


def _of(every: tuple[Candidate, ...], asked: Mapping[str, Cause]) -> tuple[Candidate, ...]:
    """Return those of the family that is asked for."""
    return tuple(one for one in every if one.names[0] in asked)


def _predicts_otherwise(posed: Problem, phi: Array) -> bool:
    """Return whether ``phi`` (10N,) predicts wrenches that differ from those in use by more than `_STALE`."""
    both = np.zeros(2)
    for case in posed.cases:
        # (T, 6, 2): the change of the predicted wrench beside the wrench itself, each about its mean over time.
        wrench = np.stack([case.needed(phi - case.phi), case.predicted], axis=2)
        both += np.sum((wrench - wrench.mean(axis=0)) ** 2, axis=(0, 1))
    return bool(both[0] > _STALE**2 * both[1])


def _contacts(search: Search, base: Hypothesis) -> tuple[Hypothesis, ...]:
    """Return the hypotheses that add a contact which comes and goes."""
    kinds = [one.effect for one in search.causes if isinstance(one.effect, Transient)]
    return with_contacts(search, base, kinds) if kinds else ()


def is_moving(case: Case) -> bool:
    """Return whether the person does more than stand: the centre of mass of any segment moves by more than in quiet
    standing (`StandingRules.still`), and the trial is not the static one.
    """
    place = case.poses.points(list(range(len(case.body.segments))), case.body.sip.com)
    away = np.sqrt(np.mean(np.sum((place - place.mean(axis=0)) ** 2, axis=2), axis=0))
    return case.trial.role != "static" and bool(away.max() > case.trial.settings.standing.still)


def _with_limits(bare: Diagnosis, seen: Problem, search: Search, posterior: Posterior) -> Diagnosis:
    """Return the diagnosis with the smallest sizes of all causes that the session would show, at the scales by which it
    was decided: where an unknown cause is left, only what is larger is seen.
    """
    limits = detection_limits(visibility(search, posterior.best.fit.scales), seen.cases[0].body)
    rows = tuple(sorted(limits, key=lambda row: row.limit / row.typical))
    return replace(bare, limits=rows, unobservable=hidden(limits), notes=(*bare.notes, *seen.notes))


def _with_rest(one: Diagnosis, seen: Seen | None, known: Tolerances) -> Diagnosis:
    """Return the diagnosis with what the body leaves of forces; nothing found is not clean with nothing compared."""
    if seen is None:
        return replace(one, explained=one.explained and bool(one.faults))
    rows = rows_of(seen.problem, seen.causes, known, None)
    bare = with_unknown(hypothesis(Search.of(rows, ()), ()))
    left = adequacy(bare, rows)
    if not (bare.log_unknown > bare.log_posterior and any(row.matters for row in left)):
        return replace(one, adequacy=left)
    unknown = float(1 / (1 + np.exp(bare.log_posterior - bare.log_unknown)))
    return replace(one, adequacy=left, explained=False, why={**one.why, Reason.FORCES_LEFT: ()}, p_unknown=unknown)


def _turned(
    evidence: ObservedEvidence, known: Tolerances, causes: Sequence[Candidate], asked: Mapping[str, Cause]
) -> tuple[Finding, ...]:
    """Return the channel whose sign, turned back, puts pressures under feet; () if none is more probable."""
    counting, found = evidence.counting, []
    as_they_are: dict[bytes, tuple[VisibleColumns, float]] = {}
    for name, turned in counting.sign_reversed.items():
        here = np.isfinite(turned)
        if not here.any():
            continue
        if (key := here.tobytes()) not in as_they_are:
            columns = VisibleColumns.of(rows_of(None, causes, known, counting.where(here), everywhere=True))
            as_they_are[key] = columns, _log_evidence(columns, columns.rows.y)
        columns, as_is = as_they_are[key]
        own = np.array([one.sd for one in counting.observations])
        other = _log_evidence(columns, (turned / own)[here])
        # Log odds of this one channel, the prior of a wrong sign shared by all channels.
        found.append((other - as_is + np.log(_SIGN / (1 - _SIGN) / len(counting.sign_reversed)), name))
    if not found:
        return ()
    best, name = max(found)
    probability = float(1 / (1 + np.exp(-best)))
    if probability < NAMED or counting.contacts() < CONTACTS:
        return ()
    alike = tuple(Alias(*other, float(value)) for value, other in sorted(found, reverse=True) if best - value <= 3.0)
    advice = (
        "With this sign turned back, the pressure lies under the feet and a step brakes first and pushes then. "
        f"{asked[name[0]].advice}"
    )
    return (Finding(*name, (), alike, 1.0, advice=advice, probability=probability, kind=asked[name[0]]),)


def _log_evidence(columns: VisibleColumns, y: Array) -> float:
    """Return the log evidence of a target ``y`` (r,) without any cause."""
    return fit(bare(columns, y), prior_sd(columns.rows), nominal(columns.rows)).log_evidence
