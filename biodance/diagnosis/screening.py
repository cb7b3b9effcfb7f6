"""The screening: the evidence of every cause beside those that were named, all at once."""

from dataclasses import dataclass

import numpy as np

from biodance.diagnosis.candidates import SCALE, Candidate, removed, slopes
from biodance.diagnosis.diagnosis import Alias
from biodance.diagnosis.evidence import evidence
from biodance.diagnosis.model import Model
from biodance.effects import Effect
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class ScoredCandidate:
    """One cause in one round: its ``score`` is the log Bayes factor less the logarithm of its number of targets;
    ``start`` (p,) parameters; ``visible`` share.
    """

    cause: Candidate
    log_bayes_factor: float
    score: float
    start: Array
    visible: float

    @property
    def alias(self) -> Alias:
        """The cause with its evidence."""
        return Alias(*self.cause.names, self.log_bayes_factor)


def screen(found: Model, causes: tuple[Candidate, ...]) -> tuple[ScoredCandidate, ...]:
    """Return all causes with their evidence, most probable first."""
    widths = [one.basis.shape[1] for one in causes]
    named = taken(found)
    Z = np.concatenate([one.basis for one in causes], axis=1)
    Z = found.white(Z, out=Z)
    s, G = found.belief.score(Z)
    if named.shape[1]:
        G = G - shared(found, named, Z)
    targets = {name: sum(1 for one in causes if one.names[0] == name) for name, _ in (c.names for c in causes)}
    suspects, start = [], 0
    for one, width in zip(causes, widths, strict=True):
        cut = slice(start, start + width)
        start += width
        here = evidence(s[cut], G[cut, cut], float(np.sum(Z[:, cut] ** 2)))
        tried = [(here.log_bayes_factor, one.start(here.mean)), *_at_sizes(found, one.effect)]
        value, begin = max(tried, key=lambda pair: pair[0])
        score = value - float(np.log(targets[one.names[0]]))
        suspects.append(ScoredCandidate(one, value, score, begin, here.visible))
    return tuple(sorted(suspects, key=lambda suspect: -suspect.score))


def _at_sizes(found: Model, effect: Effect) -> list[tuple[float, Array]]:
    """Return the log Bayes factor of a cause near each of the sizes at which it is screened, with that size (1,): its
    prior there, and the volume that the data leave of it (Laplace, the slope taken as that of the way from none).
    """
    out = []
    for share in effect.screened_at:
        s, G = found.belief.score(found.white(removed(found.problem, effect, share * effect.typical)[:, None]))
        u = share / SCALE
        out.append((float(s[0] - 0.5 * G[0, 0] - 0.5 * u**2 - 0.5 * np.log1p(G[0, 0] / u**2)), share * effect.typical))
    return out


def taken(found: Model) -> Array:
    """Return the whitened columns (r, k) of the named causes, per standard deviation of a fault."""
    parts = [
        slopes(found.problem, one.effect, one.theta, of=one.effect.removed) * SCALE * one.effect.typical
        for one in found.named
    ]
    return found.white(np.concatenate(parts, axis=1)) if parts else np.empty((found.belief.y.size, 0))


def shared(found: Model, named: Array, Z: Array) -> Array:
    """Return (k, k): what of the information of ``Z`` (r, k) the sizes of the named causes may still absorb."""
    both = np.concatenate([named, Z], axis=1)
    _, G = found.belief.score(both)
    n = named.shape[1]
    return np.asarray(G[n:, :n] @ np.linalg.solve(np.eye(n) + G[:n, :n], G[:n, n:]))
