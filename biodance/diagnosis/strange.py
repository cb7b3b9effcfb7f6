"""Which names stand beside a body that is more unlike the table than people are: those that stand just as well when
the body may be as strange as it is. What hides in the body does not.
"""

from dataclasses import replace

import numpy as np

from biodance.diagnosis.evidence import believe
from biodance.diagnosis.model import Model
from biodance.diagnosis.naming import OVERWHELMING, Round, held, named_of
from biodance.effects import Effect


def as_strange(found: Model) -> Model:
    """Return the model in which the body may be as unlike the table as it was found: its prior is so many times as wide
    as the mean square of its coefficients says.
    """
    k = found.problem.factor.shape[1]
    u, unit = found.belief.mean[:k], np.eye(len(found.belief.mean))[:k]
    weight = np.clip(1 - np.linalg.eigvalsh(found.belief.covariance(unit)), 0.0, 1.0)
    wide = np.ones(len(found.belief.mean))
    wide[:k] = np.sqrt(max(1.0, float(u @ u / weight.sum())))
    return replace(found, belief=believe(found.belief.X * wide, found.belief.y))


def firm(found: Model, accepted: tuple[Round, ...]) -> set[tuple[str, str]]:
    """Return effect and target of the named causes whose evidence overwhelms (`OVERWHELMING`) beside a body that is as
    strange as it was found; of one that comes and goes, whose course takes part in the belief, that of its round. None
    in a single trial, which cannot show that a size is the same in another one, and no joint that the model lacks
    (`Effect.shown`), which makes a body strange by itself.
    """
    if len(found.problem.cases) == 1:
        return set()
    sure = OVERWHELMING * found.tolerances.threshold
    lacking = {named_of(one) for one in found.named if type(one.effect).shown is not Effect.shown}
    if any(one.course for one in found.named):
        strong = {named_of(one) for one, by in zip(found.named, accepted, strict=True) if by.suspects[0].score >= sure}
        return strong - lacking
    stern = replace(as_strange(found), tolerances=replace(found.tolerances, threshold=sure))
    return {named_of(one) for one in held(stern, accepted)[0].named} - lacking
