"""Causes inferred from the evidence of all witnesses: which cause, its size and uncertainty, and its look-alikes.

Each observation is its expectation, plus the contributions of the causes (their traces), plus errors that several
observations share (a person's foot, a laboratory's markers), plus its own error. Shared errors and sizes of causes have
normal priors; own errors have heavy tails (Student, 4 degrees of freedom), because about one step in twenty is an
outlier. The evidence of a cause is the integral over all of these by Laplace's method (Bishop 2006, section 4.4). The
sign of a channel has no size: it is reversed in the recording, and the witnesses observe it again.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from biodance.diagnosis.candidates import SCALE
from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.diagnosis.naming import TOGETHER
from biodance.diagnosis.witness_evidence import WitnessEvidence, undo_causes
from biodance.effects import Effect, causes
from biodance.effects.added_mass import AddedMass
from biodance.effects.body_mass import BodyMass
from biodance.records import Array

THRESHOLD = 2.0
"""Natural logarithm of the evidence, less that of the number of targets that are seen, from which a cause is named."""
_TAIL = 4.0
"""Degrees of freedom of an observation's own error."""
_RARE = 3.0
_RARER = {"plate_crosstalk": 1.0}
"""Natural logarithms: so much rarer than other faults are a channel of the wrong sign, and cross-talk that looks like a
plate beside its place."""
_BROAD = 10.0
"""Typical sizes: that large ones are rare counts for a name; the size itself is told as the witnesses show it."""
_AGAIN = 2
"""Times that the witnesses are asked again about a recording with the named causes put right."""
UNPLACED_LOAD = (AddedMass.name, "")
"""Effect and target of a load of which only the weight is known."""
_ROUNDS = 3
_STEPS = 30
_SURE = 2.0
_USUAL = {
    ("plate_position", "m"): 0.006,
    ("plate_rotation", "rad"): 0.03,
    ("plate_gain", "1"): 0.02,
    ("plate_offset", "N"): 7.0,
    ("plate_offset", "N·m"): 2.0,
    ("plate_crosstalk", "m"): 0.006,
    ("time_delay", "s"): 0.008,
    ("body_mass", "kg"): 0.7,
}
"""Sizes up to which laboratories have a cause without calling it a fault: plates 2 to 5 mm off (Collins 2009), zeros of
public recordings to 6 N, clocks within a frame, clothes and shoes."""
_ALIKE = {
    "plate_position": 0.005,
    "plate_crosstalk": 0.005,
    "plate_rotation": 0.01,
    "plate_gain": 0.004,
    "time_delay": 0.002,
}
"""Standard deviation of what careful laboratories have (same units): no size is surer against "as the file says"."""
_VERTICAL = 18.0
"""N of vertical zero, which readers take off: public recordings have up to 16."""


@dataclass(frozen=True, eq=False)
class LaplaceFit:
    """Fit of a set of causes: ``log_evidence``, their sizes ``theta`` (p,) and the sizes' ``covariance`` (p, p)."""

    log_evidence: float
    theta: Array
    covariance: Array


def fit_laplace(value: Array, sd: Array, shared: Array, Z: Array, size: Array) -> LaplaceFit:
    """Return the fit of values (n,) minus expectation, with own ``sd`` (n,), by ``shared`` (n, k) errors of unit
    variance and causes with columns ``Z`` (n, p), whose sizes have prior standard deviations ``size`` (p,).
    """
    A = np.concatenate([shared, Z * size], axis=1)
    weight, u = np.ones(value.size), np.zeros(A.shape[1])
    for _ in range(_STEPS):
        H = (A * (weight / sd**2)[:, None]).T @ A + np.eye(A.shape[1])
        factor = cho_factor(H, lower=True)
        new = cho_solve(factor, A.T @ (weight / sd**2 * value))
        weight = (_TAIL + 1) / (_TAIL + ((value - A @ new) / sd) ** 2)
        done, u = np.abs(new - u).max(initial=0.0) < 1e-4, new
        if done:
            break
    left = (value - A @ u) / sd
    tails = -0.5 * (_TAIL + 1) * np.log1p(left**2 / _TAIL).sum()
    inverse = cho_solve(factor, np.eye(len(u)))
    p = Z.shape[1]
    theta, covariance = size * u[len(u) - p :], inverse[len(u) - p :, len(u) - p :] * np.outer(size, size)
    log_evidence = float(tails - 0.5 * u @ u - np.log(np.diag(factor[0])).sum())
    return LaplaceFit(log_evidence, theta, covariance)


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
    left: WitnessEvidence
    first: tuple[Alias, ...] = ()


def infer_causes(testimony: WitnessEvidence) -> WitnessFindings:
    """Return the causes supported by the witnesses' evidence, at most three, with sizes and look-alikes."""
    evidence = testimony.counting
    value = np.array([one.value - one.expected for one in evidence.observations])
    if not value.size:
        return WitnessFindings((), evidence)
    named: list[tuple[Hypothesis, tuple[Alias, ...]]] = []
    first: tuple[Alias, ...] = ()
    for number in range(_ROUNDS):
        chosen = tuple(one.names for one, _ in named if one.names in evidence.causes)
        ranking = _ranked(evidence, value, chosen, signs=number == 0)
        first = first or tuple(one.alias for one in ranking)
        best = next((one for one in ranking if one.score >= THRESHOLD and _exceeds_usual(evidence, one)), None)
        if best is None:
            break
        near = [o for o in ranking if o is best or best.score - o.score <= TOGETHER]
        near.sort(key=lambda o: o is not best)
        named.append((best, (*(o.alias for o in near), *_load_alternatives(near))))
        if best.names in evidence.turned:
            break  # the traces of other causes hold only once the sign is mended
    return WitnessFindings(_findings(evidence, value, named), evidence, first)


def _load_alternatives(near: Iterable[Hypothesis]) -> tuple[Alias, ...]:
    """Return an unplaced load if a body heavier than declared is among the indistinguishable causes: witnesses observe
    only the total weight.
    """
    heavier = (one for one in near if one.names == (BodyMass.name, "") and one.found.theta[-1] > 0)
    return tuple(Alias(*UNPLACED_LOAD, one.log_bayes_factor) for one in heavier)


def _ranked(
    evidence: WitnessEvidence, value: Array, named: tuple[tuple[str, str], ...], *, signs: bool
) -> list[Hypothesis]:
    """Return every further cause with its evidence, given the ``named`` ones, most probable first."""
    before = _explain(evidence, value, named)
    count = Counter(names[0] for names in evidence.causes if evidence.seen_by(names))  # who is not seen is not mistaken
    found = []
    for names in evidence.causes:
        if names in named or not np.abs(evidence.traces[names]).any():
            continue
        one = _explain(evidence, value, (*named, names))
        bayes = one.log_evidence - before.log_evidence
        score = bayes - float(np.log(max(1, count[names[0]]))) - _RARER.get(names[0], 0.0)
        found.append(Hypothesis(names, bayes, score, one))
    for names, turned in evidence.turned.items() if signs else ():
        known = np.isfinite(turned)
        one = _explain(evidence, turned, named, known)
        bayes = one.log_evidence - _explain(evidence, value, named, known).log_evidence
        found.append(Hypothesis(names, bayes, bayes - _RARE - float(np.log(len(evidence.turned))), one))
    return sorted(found, key=lambda one: -one.score)


def _explain(
    evidence: WitnessEvidence, value: Array, names: tuple[tuple[str, str], ...], known: Array | None = None
) -> LaplaceFit:
    Z = np.stack([evidence.traces[name] for name in names], axis=1) if names else np.empty((value.size, 0))
    return _fit_known(evidence, value, Z, np.array([SCALE * _typical(*name) for name in names]), known)


def _fit_known(
    evidence: WitnessEvidence, value: Array, Z: Array, size: Array, known: Array | None = None
) -> LaplaceFit:
    kept = np.ones(value.size, dtype=bool) if known is None else known.astype(bool)
    sd = np.array([one.sd for one in evidence.observations])[kept]
    return fit_laplace(value[kept], sd, evidence.shared[kept], Z[kept], size)


def _fit_sizes(evidence: WitnessEvidence, value: Array, names: tuple[tuple[str, str], ...]) -> LaplaceFit:
    """Return the fit of the named causes with wide priors on their sizes. The causes are undone in the recording and
    the witnesses observe again, because traces are not linear in the size.
    """
    size = np.array([_BROAD * _typical(*name) for name in names])
    Z = np.stack([evidence.traces[name] for name in names], axis=1) if names else np.empty((value.size, 0))
    found = _fit_known(evidence, value, Z, size)
    for _ in range(_AGAIN if evidence.recorded and names else 0):
        added, slopes = undo_causes(evidence, dict(zip(names, map(float, found.theta), strict=True)))
        again = value + added + slopes @ found.theta
        found = _fit_known(evidence, np.nan_to_num(again), slopes, size, np.isfinite(again))
    return found


def _typical(effect: str, target: str) -> float:
    """Return the typical size of a cause, as its effect states it."""
    kind = causes()[effect]
    return float(kind.typical[0]) if isinstance(kind, Effect) else 1.0


def _exceeds_usual(evidence: WitnessEvidence, one: Hypothesis) -> bool:
    """Return whether the last cause of a fit is significant and larger than laboratories have it without a fault; the
    sign of a channel has no size.
    """
    if one.names not in evidence.causes:
        return True
    return is_beyond_usual(evidence, one.names, float(one.found.theta[-1]), float(one.found.covariance[-1, -1] ** 0.5))


def is_beyond_usual(evidence: WitnessEvidence, names: tuple[str, str], size: float, sd: float) -> bool:
    """Return whether the ``size`` of a cause with standard deviation ``sd`` is significant and larger than laboratories
    have it without a fault.
    """
    cause = evidence.causes[names]
    usual = _USUAL.get((cause.effect, cause.unit), 0.0)
    if cause.effect == "plate_offset" and cause.target.endswith("Fz"):
        usual = _VERTICAL
    whole = float(np.hypot(sd, _ALIKE.get(cause.effect, 0.0)))
    return abs(size) > usual + whole and abs(size) > _SURE * whole


def _findings(
    evidence: WitnessEvidence, value: Array, named: list[tuple[Hypothesis, tuple[Alias, ...]]]
) -> tuple[Finding, ...]:
    """Return the named causes with jointly fitted sizes."""
    sized = tuple(one.names for one, _ in named if one.names in evidence.causes)
    last, found = _fit_sizes(evidence, value, sized), []
    for one, near in named:
        kind, visible = causes()[one.names[0]], 1.0
        estimates: tuple[Estimate, ...] = ()
        if one.names in sized:
            i, cause = sized.index(one.names), evidence.causes[one.names]
            sd = float(np.hypot(last.covariance[i, i] ** 0.5, _ALIKE.get(cause.effect, 0.0)))
            estimates = (Estimate(cause.parameter, float(last.theta[i]), sd, cause.unit),)
            visible = _visible_share(evidence, one.names)
        found.append(
            Finding(*one.names, estimates, near, visible, advice=f"{_carried_by(evidence, one.names)} {kind.advice}")
        )
    return tuple(found)


def size_from_witnesses(evidence: WitnessEvidence, names: tuple[str, str]) -> tuple[float, float] | None:
    """Return the size of a cause and its standard deviation from the witnesses alone, inflated by their disagreement;
    None if no witness responds to it.
    """
    counting = evidence.counting
    if names not in counting.causes or not counting.seen_by(names):
        return None
    value = np.array([one.value - one.expected for one in counting.observations])
    one = _fit_sizes(counting, value, (names,))
    sd = _disagreement(counting, names, value - counting.traces[names] * one.theta[0]) * one.covariance[0, 0] ** 0.5
    return float(one.theta[0]), float(np.hypot(sd, _ALIKE.get(names[0], 0.0)))


def _disagreement(evidence: WitnessEvidence, names: tuple[str, str], left: Array) -> float:
    """Return the Birge ratio (at least 1) of the residuals ``left`` (n,) of the observations that respond to a cause:
    their scatter relative to their errors (Birge 1932, doi:10.1103/PhysRev.40.207).
    """
    sees = evidence.sees(names)
    if sees.sum() < 2:
        return 1.0
    own = np.array([one.sd for one in evidence.observations])[sees]
    spread = np.diag(own**2) + evidence.shared[sees] @ evidence.shared[sees].T
    return max(1.0, float(left[sees] @ np.linalg.solve(spread, left[sees]) / (sees.sum() - 1)) ** 0.5)


def _visible_share(evidence: WitnessEvidence, names: tuple[str, str]) -> float:
    """Return the share of a cause's trace that the shared errors of the expectations cannot imitate."""
    sd = np.array([one.sd for one in evidence.observations])
    z, N = evidence.traces[names] / sd, evidence.shared / sd[:, None]
    inner = np.linalg.solve(np.eye(N.shape[1]) + N.T @ N, N.T @ z)
    return float(np.sqrt(np.clip((z @ z - z @ N @ inner) / max(float(z @ z), 1e-300), 0.0, 1.0)))


def _carried_by(evidence: WitnessEvidence, names: tuple[str, str]) -> str:
    """Return a sentence that names the witnesses behind a finding."""
    if names not in evidence.causes:
        return "With this sign turned back, the pressure lies under the feet and a step brakes first and pushes then."
    seen = evidence.seen_by(names)
    return f"Seen by: {', '.join(name.replace('_', ' ') for name in seen)}." if seen else ""
