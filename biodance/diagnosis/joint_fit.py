"""All named causes fitted jointly, with all their curvature, and the evidence of one set of them against another."""

import numpy as np

from biodance.diagnosis.candidates import SCALE
from biodance.diagnosis.model import Model, NamedCause
from biodance.records import Array

_STEPS = 5
"""Gauss-Newton steps at most."""


def settle(found: Model, named: tuple[NamedCause, ...]) -> Model:
    """Return the model with the parameters of all ``named`` causes at their most probable values, by Gauss-Newton
    steps.
    """
    current = found if named is found.named else found.without_causes(named)
    for _ in range(_STEPS):
        if not named:
            return current
        s, G = current.named_score
        u = np.concatenate([one.theta / (SCALE * one.effect.typical) for one in named])
        inner: Array = np.asarray(np.linalg.inv(np.eye(len(s)) + G), dtype=float)
        step = inner @ (s - u)
        named = _moved(named, u + step, inner)
        current = current.without_causes(named)
        if np.abs(step).max() < 1e-3:
            break
    return current


def log_bayes_factor_between(found: Model, other: Model) -> float:
    """Return the log Bayes factor of the causes named in ``found`` against those named in ``other``."""
    return found.log_likelihood - _penalty(found) - other.log_likelihood + _penalty(other)


def _moved(named: tuple[NamedCause, ...], u: Array, inner: Array) -> tuple[NamedCause, ...]:
    """Return the causes with new parameters ``u`` (in standard deviations of a fault) and their covariances."""
    out, start = [], 0
    for one in named:
        width = one.effect.typical.size
        cut, scale = slice(start, start + width), SCALE * one.effect.typical
        out.append(NamedCause(one.effect, scale * u[cut], inner[cut, cut] * np.outer(scale, scale)))
        start += width
    return tuple(out)


def _penalty(found: Model) -> float:
    """Return what the parameters of the named causes cost: their prior, and the volume that the data leave of it
    (Laplace).
    """
    if not found.named:
        return 0.0
    _, G = found.named_score
    u = np.concatenate([one.theta / (SCALE * one.effect.typical) for one in found.named])
    return 0.5 * float(u @ u) + 0.5 * float(np.linalg.slogdet(np.eye(len(u)) + G)[1])
