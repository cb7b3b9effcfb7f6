"""Causes inferred from the evidence of all witnesses: which cause, its size and uncertainty, and its look-alikes.

Each observation is its expectation, plus the contributions of the causes (their traces), plus errors that several
observations share (a person's foot, a laboratory's markers), plus its own error. Shared errors and sizes of causes have
normal priors (`witness_fit`). Where markers sit on the feet is one of the shared errors: only what it leaves speaks of
a plate, and nothing is named by a single contact. The sign of a channel has no size: it is reversed in the recording,
and the witnesses observe it again.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from biodance.diagnosis.candidates import TOGETHER
from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.diagnosis.witness_evidence import ObservedEvidence, undo_causes
from biodance.diagnosis.witness_fit import (
    THRESHOLD,
    LaplaceFit,
    explain,
    fit_known,
    is_beyond_usual,
    is_told,
    no_surer,
    prior_odds,
    typical_size,
)
from biodance.diagnosis.witness_landmark import landmark_alias, landmark_finding
from biodance.effects import causes
from biodance.effects.added_mass import AddedMass
from biodance.effects.body_mass import BodyMass
from biodance.records import Array

_RARE = 3.0
"""Natural logarithm: so much rarer than other faults is a channel of the wrong sign."""
_BROAD = 10.0
"""Typical sizes: that large ones are rare counts for a name; the size itself is told as the witnesses show it."""
_AGAIN = 2
"""Times that the witnesses are asked again about a recording with the named causes put right."""
UNPLACED_LOAD = (AddedMass.name, "")
"""Effect and target of a load of which only the weight is known."""
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One cause added to those named before: its log Bayes factor, its ``score`` (the log Bayes factor minus the log of
    the number of targets), and ``found``: the sizes of all causes.
    """

    names: tuple[str, str]
    log_bayes_factor: float
    score: float
    found: LaplaceFit

    @property
    def alias(self) -> Alias:
        """The cause with its evidence."""
        return Alias(*self.names, self.log_bayes_factor)


@dataclass(frozen=True, eq=False)
class WitnessFindings:
    """Causes inferred from the witnesses: ``findings``; ``left``, the evidence that they rest on; ``first``, all causes
    of the first round, most probable first.
    """

    findings: tuple[Finding, ...]
    left: ObservedEvidence
    first: tuple[Alias, ...] = ()


def infer_causes(whole: ObservedEvidence) -> WitnessFindings:
    """Return the causes supported by the witnesses' evidence, at most three, with sizes and look-alikes."""
    evidence = whole.counting
    value = np.array([one.value - one.expected for one in evidence.observations])
    if not value.size:
        return WitnessFindings((), evidence)
    named: list[tuple[Hypothesis, tuple[Alias, ...]]] = []
    first: tuple[Alias, ...] = ()
    for number in range(_ROUNDS):
        chosen = tuple(one.names for one, _ in named if one.names in evidence.causes)
        ranking = _ranked(evidence, value, chosen, signs=number == 0)
        first = first or tuple(one.alias for one in ranking)
        best = next((one for one in ranking if one.score >= THRESHOLD and _is_told(evidence, one)), None)
        if best is None:
            break
        near = [o for o in ranking if o is best or best.score - o.score <= TOGETHER]
        near.sort(key=lambda o: o is not best)
        marker = landmark_alias(evidence, value, chosen, best.names) if best.score <= TOGETHER else ()
        named.append((best, (*(o.alias for o in near), *_load_alternatives(near), *marker)))
        if best.names in evidence.sign_reversed:
            break  # the traces of other causes hold only once the sign is mended
    found = _findings(evidence, value, named)
    sized = tuple(one.names for one, _ in named if one.names in evidence.causes)
    habit = landmark_finding(evidence, value, sized) if len(sized) == len(named) else ()
    return WitnessFindings((*found, *habit), evidence, first)


def _load_alternatives(near: Iterable[Hypothesis]) -> tuple[Alias, ...]:
    """Return an unplaced load if a body heavier than declared is among the indistinguishable causes: witnesses observe
    only the total weight.
    """
    heavier = (one for one in near if one.names == (BodyMass.name, "") and one.found.theta[-1] > 0)
    return tuple(Alias(*UNPLACED_LOAD, one.log_bayes_factor) for one in heavier)


def _ranked(
    evidence: ObservedEvidence, value: Array, named: tuple[tuple[str, str], ...], *, signs: bool
) -> list[Hypothesis]:
    """Return every further cause with its evidence, given the ``named`` ones, most probable first."""
    before = explain(evidence, value, named)
    odds, found = prior_odds(evidence), []
    for names in evidence.causes:
        if names in named or not np.abs(evidence.sensitivities[names]).any():
            continue
        one = explain(evidence, value, (*named, names))
        bayes = one.log_evidence - before.log_evidence
        found.append(Hypothesis(names, bayes, bayes + odds[names], one))
    for names, turned in evidence.sign_reversed.items() if signs else ():
        known = np.isfinite(turned)
        one = explain(evidence, turned, named, known)
        bayes = one.log_evidence - explain(evidence, value, named, known).log_evidence
        found.append(Hypothesis(names, bayes, bayes - _RARE - float(np.log(len(evidence.sign_reversed))), one))
    return sorted(found, key=lambda one: -one.score)


def _fit_sizes(evidence: ObservedEvidence, value: Array, names: tuple[tuple[str, str], ...]) -> LaplaceFit:
    """Return the fit of the named causes with wide priors on their sizes. The causes are undone in the recording and
    the witnesses observe again, because traces are not linear in the size.
    """
    size = np.array([_BROAD * typical_size(*name) for name in names])
    Z = np.stack([evidence.sensitivities[name] for name in names], axis=1) if names else np.empty((value.size, 0))
    found = fit_known(evidence, value, Z, size)
    for _ in range(_AGAIN if evidence.recorded and names else 0):
        added, slopes = undo_causes(evidence, dict(zip(names, map(float, found.theta), strict=True)))
        again = value + added + slopes @ found.theta
        found = fit_known(evidence, np.nan_to_num(again), slopes, size, np.isfinite(again) & evidence.in_reach)
    return found


def _is_told(evidence: ObservedEvidence, one: Hypothesis) -> bool:
    """Return whether the last cause of a fit is told (`is_told`) by more than the only contact of a session; the sign
    of a channel has no size.
    """
    signed = one.names not in evidence.causes
    enough = evidence.contacts() > 1 or (not signed and evidence.contacts(one.names) > 1)
    return enough and (signed or is_told(evidence, one.names, one.found))


def _findings(
    evidence: ObservedEvidence, value: Array, named: list[tuple[Hypothesis, tuple[Alias, ...]]]
) -> tuple[Finding, ...]:
    """Return the named causes with jointly fitted sizes, if these are still more than laboratories have."""
    sized = tuple(one.names for one, _ in named if one.names in evidence.causes)
    last, found = _fit_sizes(evidence, value, sized), []
    for one, near in named:
        kind, visible = causes()[one.names[0]], 1.0
        estimates: tuple[Estimate, ...] = ()
        if one.names in sized:
            i, cause = sized.index(one.names), evidence.causes[one.names]
            size, sd = float(last.theta[i]), float(last.covariance[i, i] ** 0.5)
            if not is_beyond_usual(evidence, one.names, size, sd):
                continue
            whole = no_surer(sd, cause.effect)
            estimates = (Estimate(cause.parameter, size, whole, cause.unit),)
            visible = _visible_share(evidence, one.names)
        found.append(
            Finding(*one.names, estimates, near, visible, advice=f"{_carried_by(evidence, one.names)} {kind.advice}")
        )
    return tuple(found)


def size_from_witnesses(evidence: ObservedEvidence, names: tuple[str, str]) -> tuple[float, float] | None:
    """Return the size of a cause and its standard deviation from the witnesses alone, inflated by their disagreement;
    None if no witness responds to it.
    """
    counting = evidence.counting
    if names not in counting.causes or not counting.detected_by(names):
        return None
    value = np.array([one.value - one.expected for one in counting.observations])
    one = _fit_sizes(counting, value, (names,))
    sd = (
        _disagreement(counting, names, value - counting.sensitivities[names] * one.theta[0])
        * one.covariance[0, 0] ** 0.5
    )
    return float(one.theta[0]), no_surer(float(sd), names[0])


def _disagreement(evidence: ObservedEvidence, names: tuple[str, str], left: Array) -> float:
    """Return the Birge ratio (at least 1) of the residuals ``left`` (n,) of the observations that respond to a cause:
    their scatter relative to their errors (Birge 1932, doi:10.1103/PhysRev.40.207).
    """
    sees = evidence.detects(names)
    if sees.sum() < 2:
        return 1.0
    own = np.array([one.sd for one in evidence.observations])[sees]
    spread = np.diag(own**2) + evidence.shared[sees] @ evidence.shared[sees].T
    return max(1.0, float(left[sees] @ np.linalg.solve(spread, left[sees]) / (sees.sum() - 1)) ** 0.5)


def _visible_share(evidence: ObservedEvidence, names: tuple[str, str]) -> float:
    """Return the share of a cause's trace that the shared errors of the expectations cannot imitate."""
    sd = np.array([one.sd for one in evidence.observations])
    z, N = evidence.sensitivities[names] / sd, evidence.shared / sd[:, None]
    inner = np.linalg.solve(np.eye(N.shape[1]) + N.T @ N, N.T @ z)
    return float(np.sqrt(np.clip((z @ z - z @ N @ inner) / max(float(z @ z), 1e-300), 0.0, 1.0)))


def _carried_by(evidence: ObservedEvidence, names: tuple[str, str]) -> str:
    """Return a sentence that names the witnesses behind a finding."""
    if names not in evidence.causes:
        return "With this sign turned back, the pressure lies under the feet and a step brakes first and pushes then."
    seen = evidence.detected_by(names)
    return f"Seen by: {', '.join(name.replace('_', ' ') for name in seen)}." if seen else ""
