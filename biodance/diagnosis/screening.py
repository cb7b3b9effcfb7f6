"""The screening: the evidence of every cause beside those that were named, all at once."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from biodance.diagnosis.candidates import AT_ONCE, SCALE, Candidate, bases_of, removed
from biodance.diagnosis.diagnosis import Alias
from biodance.diagnosis.evidence import Evidence, evidence
from biodance.diagnosis.model import Model
from biodance.effects import Effect
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class ScoredCandidate:
    """One cause in one round: its ``score`` is the log Bayes factor less the logarithm of its number of targets;
    ``start`` (p,) parameters, ``sd`` of the first of them (NaN where it was not measured in proportion to the cause);
    ``visible`` share. Its columns are not kept.
    """

    effect: Effect
    log_bayes_factor: float
    score: float
    start: Array
    visible: float
    sd: float = float("nan")

    @property
    def names(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect.name, self.effect.target

    @property
    def alias(self) -> Alias:
        """The cause with its evidence."""
        return Alias(*self.names, self.log_bayes_factor)


def screen(found: Model, causes: tuple[Candidate, ...]) -> tuple[ScoredCandidate, ...]:
    """Return all causes with their evidence, most probable first."""
    parts = (causes[start : start + AT_ONCE] for start in range(0, len(causes), AT_ONCE))
    near = [pair for some in parts for pair in zip(some, _scored(found, some), strict=True)]
    targets = Counter(one.names[0] for one in causes)
    suspects = []
    for one, here in near:
        tried = [(here.log_bayes_factor, one.start(here.mean)), *_at_sizes(found, one.effect)]
        value, begin = max(tried, key=lambda pair: pair[0])
        score = value - float(np.log(targets[one.names[0]]))
        measured = begin is tried[0][1] and not one.silent[0]
        sd = SCALE * one.effect.typical[0] * here.covariance[0, 0] ** 0.5 if measured else float("nan")
        suspects.append(ScoredCandidate(one.effect, value, score, begin, here.visible, float(sd)))
    return tuple(sorted(suspects, key=lambda suspect: -suspect.score))


def _scored(found: Model, causes: tuple[Candidate, ...]) -> Iterator[Evidence]:
    """Yield the evidence of some causes near none, beside those that were named."""
    Z, cuts = bases_of(causes)
    Z = found.white(Z, out=Z)
    s = Z.T @ found.posterior.residual
    half = found.posterior.half(found.posterior.X.T @ Z)
    lost = absorbed(found, Z, half)
    for cut in cuts:
        own, hides = Z[:, cut], np.concatenate([half[:, cut], lost[:, cut]])
        yield evidence(s[cut], own.T @ own - hides.T @ hides, found.length(own))


def _at_sizes(found: Model, effect: Effect) -> list[tuple[float, Array]]:
    """Return the log Bayes factor of a cause near each of the sizes at which it is screened, with that size (1,): its
    prior there, and the volume that the data leave of it (Laplace, the slope taken as that of the way from none).
    """
    out = []
    for share in effect.screened_at:
        s, G = found.posterior.score(found.white(removed(found.problem, effect, share * effect.typical)[:, None]))
        u = share / SCALE
        out.append((float(s[0] - 0.5 * G[0, 0] - 0.5 * u**2 - 0.5 * np.log1p(G[0, 0] / u**2)), share * effect.typical))
    return out


def absorbed(found: Model, Z: Array, half: Array) -> Array:
    """Return H (n, k): H' H is what of the information of whitened columns ``Z`` (r, k), whose `LinearPosterior.half`
    is ``half``, the sizes of the n parameters of the named causes may still absorb.
    """
    own = found.posterior.half(found.posterior.X.T @ found.named_columns)
    _, G = found.named_score
    return np.linalg.solve(np.linalg.cholesky(np.eye(len(G)) + G), found.named_columns.T @ Z - own.T @ half)
