"""Causes that can be named although the identified body is unusual (further from the segment table than people are):
those that remain significant when the prior of the body is widened accordingly.
"""

from dataclasses import replace

import numpy as np

from biodance.diagnosis.evidence import linear_posterior
from biodance.diagnosis.model import Model
from biodance.diagnosis.naming import OVERWHELMING, Round, cause_key, drop_weak_causes
from biodance.effects import Effect


def with_inflated_prior(found: Model) -> Model:
    """Return the model with the prior standard deviations of the body inflated by the root mean square of its
    identified coefficients, at least 1.
    """
    k = found.problem.factor.shape[1]
    u, unit = found.posterior.mean[:k], np.eye(len(found.posterior.mean))[:k]
    weight = np.clip(1 - np.linalg.eigvalsh(found.posterior.covariance(unit)), 0.0, 1.0)
    wide = np.ones(len(found.posterior.mean))
    wide[:k] = np.sqrt(max(1.0, float(u @ u / weight.sum())))
    return replace(found, posterior=linear_posterior(found.posterior.X * wide, found.posterior.y))


def robust_causes(found: Model, accepted: tuple[Round, ...]) -> set[tuple[str, str]]:
    """Return effect and target of the named causes whose evidence is overwhelming (`OVERWHELMING`) even with the
    inflated prior of the body. If a transient contact was named, whose time course is part of the posterior, the
    evidence of each cause's own round counts. Empty for a single trial, which cannot show that a size is constant over
    trials. Excluded are joints missing from the model (`Effect.shown`), which themselves make a body unusual, and
    causes that are only named alone (`Effect.single`).
    """
    if len(found.problem.cases) == 1:
        return set()
    sure = OVERWHELMING * found.tolerances.threshold
    never = {cause_key(n) for n in found.named if n.effect.single or type(n.effect).shown is not Effect.shown}
    if any(one.course for one in found.named):
        strong = {cause_key(one) for one, by in zip(found.named, accepted, strict=True) if by.suspects[0].score >= sure}
        return strong - never
    stern = replace(with_inflated_prior(found), tolerances=replace(found.tolerances, threshold=sure))
    return {cause_key(one) for one in drop_weak_causes(stern, accepted)[0].named} - never
