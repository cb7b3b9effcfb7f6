"""Fit of causes to what the witnesses observed, and its evidence.

Shared errors and sizes of causes have normal priors; own errors have heavy tails (Student, 4 degrees of freedom),
because about one step in twenty is an outlier. The evidence of a set of causes is the integral over all of these by
Laplace's method (Bishop 2006, section 4.4).
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from biodance.diagnosis.candidates import SCALE
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.effects import Effect, causes, effect
from biodance.records import Array

THRESHOLD = 2.0
"""Natural logarithm of the evidence with its prior odds (`prior_odds`) from which a cause is named."""
_MISSTEP = 3.0
"""Natural logarithm of twenty: one contact in twenty is odd, so that a cause that one contact alone tells needs as much
more evidence."""
_TAIL = 4.0
"""Degrees of freedom of an observation's own error."""
_STEPS = 30
_SURE = 2.0


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


def explain(
    evidence: ObservedEvidence,
    value: Array,
    names: tuple[tuple[str, str], ...],
    known: NDArray[np.bool_] | None = None,
    *,
    without: NDArray[np.bool_] | None = None,
) -> LaplaceFit:
    """Return the fit of values (n,) minus expectation by the causes ``names`` of their typical sizes; ``known`` (n,)
    observations only (by default those in reach), ``without`` (k,) some of the shared errors.
    """
    Z = np.stack([evidence.sensitivities[name] for name in names], axis=1) if names else np.empty((value.size, 0))
    size = np.array([SCALE * typical_size(*name) for name in names])
    return fit_known(evidence, value, Z, size, known, without=without)


def fit_known(
    evidence: ObservedEvidence,
    value: Array,
    Z: Array,
    size: Array,
    known: NDArray[np.bool_] | None = None,
    *,
    without: NDArray[np.bool_] | None = None,
) -> LaplaceFit:
    """Return the fit by causes with columns ``Z`` (n, p) and prior standard deviations ``size`` (p,), see `explain`."""
    kept = evidence.in_reach if known is None else known
    sd = np.array([one.sd for one in evidence.observations])[kept]
    shared = evidence.shared if without is None else evidence.shared[:, ~without]
    return fit_laplace(value[kept], sd, shared[kept], Z[kept], size)


def prior_odds(evidence: ObservedEvidence) -> dict[tuple[str, str], float]:
    """Return by cause what its evidence must make up for (natural logarithm, none above 0): the number of targets at
    which it could be seen, how rare it is, and that a single contact may be a misstep.
    """
    count = Counter(names[0] for names in evidence.causes if evidence.detected_by(names))
    return {
        names: -float(np.log(max(1, count[names[0]])))
        - effect(names[0]).rarer
        - (_MISSTEP if evidence.contacts(names) == 1 else 0.0)
        for names in evidence.causes
    }


def typical_size(effect: str, target: str) -> float:
    """Return the typical size of a cause, as its effect states it."""
    kind = causes()[effect]
    return float(kind.typical[0]) if isinstance(kind, Effect) else 1.0


def is_told(evidence: ObservedEvidence, names: tuple[str, str], found: LaplaceFit) -> bool:
    """Return whether the last cause of a fit is significant, and larger than laboratories have it without a fault."""
    return is_beyond_usual(evidence, names, float(found.theta[-1]), float(found.covariance[-1, -1] ** 0.5))


def is_beyond_usual(evidence: ObservedEvidence, names: tuple[str, str], size: float, sd: float) -> bool:
    """Return whether the ``size`` of a cause with standard deviation ``sd`` is significant and larger than laboratories
    have it without a fault.
    """
    cause = evidence.causes[names]
    usual = effect(cause.effect).parameters[0].usual_at(cause.target)
    whole = no_surer(sd, cause.effect)
    return abs(size) > usual + whole and abs(size) > _SURE * whole


def no_surer(sd: float, name: str) -> float:
    """Return the standard deviation of a size against "as the file says": none is surer than careful laboratories are
    alike (`Parameter.alike`).
    """
    return float(np.hypot(sd, effect(name).parameters[0].alike))
