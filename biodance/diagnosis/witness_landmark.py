"""The place of the markers on both feet as a look-alike of plates that lie elsewhere: `effects.toe_landmark`.

It is a habit of a laboratory and no fault of an instrument, so it is among the errors that every fit allows for. It is
told where it is clearly shown, with the plates that would look the same, and it stands in the set of a plate whose
evidence beside it is small.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.candidates import SCALE, TOGETHER
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.diagnosis.witness_fit import THRESHOLD, explain, fit_known, is_told, prior_odds, typical_size
from biodance.effects.toe_landmark import ToeLandmark
from biodance.observations import LANDMARK, shift_per_sd
from biodance.records import SIDES, Array

_SHOWN = 2.0
"""Natural logarithm of the evidence from which it is told, and standard deviations of its size."""
_USUAL = 0.010
"""m: a marker beside the second ray, or a heel marker on a thick sole, is as anywhere."""
_VISIBLE = 1.0

Names = tuple[tuple[str, str], ...]


def landmark_alias(evidence: ObservedEvidence, value: Array, named: Names, cause: tuple[str, str]) -> tuple[Alias, ...]:
    """Return the feet's markers as a look-alike of a ``cause`` that only feet on plates show, beside the causes
    ``named`` before it; () where they explain nothing of the values (n,) minus expectation.
    """
    where = _columns(evidence)
    feet = (evidence.shared[:, where] != 0).any(axis=1)
    if not (feet & (evidence.sensitivities.get(cause, np.zeros(len(feet))) != 0)).any():
        return ()
    bayes = _evidence(evidence, value, named, where)
    return (Alias(ToeLandmark.name, _target(evidence), bayes),) if bayes > 0 else ()


def landmark_finding(evidence: ObservedEvidence, value: Array, named: Names) -> tuple[Finding, ...]:
    """Return how far the markers of both feet lie beside where they are expected, with all plates that look the same:
    where the values (n,) minus expectation clearly show it, or would name a plate if markers were as expected. The
    causes ``named`` are allowed for.
    """
    where = _columns(evidence)
    feet = (evidence.shared[:, where] != 0).any(axis=1)
    if len({one.contact for one, foot in zip(evidence.observations, feet, strict=True) if foot}) < 2:
        return ()
    bayes, sizes = _evidence(evidence, value, named, where), _sizes(evidence, value, named, where)
    shown = tuple(one for one in sizes if abs(one.value) > max(_USUAL + one.sd, _SHOWN * one.sd))
    alike, odds = _plates_alike(evidence, value, named, where, bayes), prior_odds(evidence)
    accused = any(a.log_bayes_factor + odds[a.effect, a.target] >= THRESHOLD for a in alike)
    if not (accused or (shown and bayes >= _SHOWN)):
        return ()
    own = Alias(ToeLandmark.name, _target(evidence), bayes)
    told = shown or (max(sizes, key=lambda one: abs(one.value) / one.sd),)
    return (Finding(own.effect, own.target, told, (own, *alike), _VISIBLE, advice=ToeLandmark.advice),)


def with_habits(one: Diagnosis, habits: tuple[Finding, ...]) -> Diagnosis:
    """Return the diagnosis with what is only a habit of the laboratory told beside it, if nothing of its set is named:
    what was told apart by more evidence stands alone.
    """
    told = {(finding.effect, finding.target) for finding in one.findings}
    told |= {(alias.effect, alias.target) for finding in one.findings for alias in finding.set}
    beside = (habit for habit in habits if not any((a.effect, a.target) in told for a in habit.set))
    return replace(one, findings=(*one.findings, *beside))


def _sizes(evidence: ObservedEvidence, value: Array, named: Names, where: NDArray[np.bool_]) -> tuple[Estimate, ...]:
    """Return how far the markers lie beside where they are expected; the causes ``named`` are allowed for."""
    norms = [name for name, one in zip(evidence.norms, where, strict=True) if one]
    Z = np.column_stack([evidence.shared[:, where], *(evidence.sensitivities[name] for name in named)])
    size = np.array([1.0] * len(norms) + [SCALE * typical_size(*name) for name in named])
    found = fit_known(evidence, value, Z, size, without=where)
    return tuple(
        Estimate(_quantity(norm), float(per * found.theta[i]), float(per * found.covariance[i, i] ** 0.5), "m")
        for i, (norm, per) in enumerate(zip(norms, map(shift_per_sd, norms), strict=True))
    )


def _plates_alike(
    evidence: ObservedEvidence, value: Array, named: Names, where: NDArray[np.bool_], bayes: float
) -> list[Alias]:
    """Return the causes that explain what feet on plates show nearly as well where the markers are as expected."""
    before, found = explain(evidence, value, named, without=where).log_evidence, []
    feet = (evidence.shared[:, where] != 0).any(axis=1)
    for names in evidence.causes:
        if names in named or not evidence.sensitivities[names][feet].any():
            continue
        alone = explain(evidence, value, (*named, names), without=where)
        if bayes - (alone.log_evidence - before) <= TOGETHER and is_told(evidence, names, alone):
            found.append(Alias(*names, alone.log_evidence - before))
    return sorted(found, key=lambda alias: -alias.log_bayes_factor)


def _evidence(evidence: ObservedEvidence, value: Array, named: Names, where: NDArray[np.bool_]) -> float:
    """Return the log Bayes factor of unknown places of the feet's markers against the expected ones."""
    free, fixed = explain(evidence, value, named), explain(evidence, value, named, without=where)
    return free.log_evidence - fixed.log_evidence


def _columns(evidence: ObservedEvidence) -> NDArray[np.bool_]:
    """Return (k,) which shared errors are those of where markers sit on both feet."""
    return np.array([LANDMARK in name for name in evidence.norms], dtype=bool)


def _quantity(norm: str) -> str:
    """Return the parameter of the effect that a shared error is."""
    return "backwards" if norm.endswith("along") else "inwards"


def _target(evidence: ObservedEvidence) -> str:
    """Return the side of the only foot seen on plates, or both."""
    seen = [side for side in SIDES if any(name.startswith(f"person {side} ") for name in evidence.norms)]
    return seen[0] if len(seen) == 1 else "both"
