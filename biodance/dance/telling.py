"""What a dance tells of the body when it is judged posture by posture and move by move, so that a page can add up while
somebody dances.

A posture that is held tells by weight alone: the vertical force, and its moments about the horizontal axes. A move
tells by its accelerations, too. Both are judged under the noise of typical sessions (`dance.expectation`). What
disturbs a session beyond the noise (soft tissue, joint centres, plates) is left out; instead only the share `_TRUST` of
the information counts, with which whole dances tell of every segment what is expected of them.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.expectation import typical_noise
from biodance.motion.regressor import predict_wrench, regressor
from biodance.records import Array, Motion
from biodance.spatial import wrench_shift
from biodance.uncertainty.bands import Bands
from biodance.uncertainty.caution import widened
from biodance.uncertainty.noise import Noise

_RATE = 12.5
"""Hz at which a dance is judged, as in `dance.expectation`."""
_STILL = 1.0
"""s: a hold says nothing more after this time."""
_TRUST = 0.1
"""Share of the information that disturbances leave."""
_AT_REST = slice(2, 5)
"""Components of a wrench (Fx, Fy, Fz, Mx, My, Mz) that a body at rest has."""


@dataclass(frozen=True, eq=False)
class Telling:
    """By what a movement is judged that shall tell of the p = 10 N inertial parameters of a body.

    ``rate`` Hz of the motions that are judged; ``root`` (p, p): the table's covariance is ``root root'``; ``weights``
    (B, 6): information of one coefficient of the wrench (N, N·m about ``about`` (3,) m of the lab) in each of the bands
    between ``edges`` (B + 1,) Hz; ``still`` (3,): information of one held posture on Fz, Mx and My.
    """

    rate: float
    root: Array
    weights: Array
    edges: tuple[float, ...]
    still: Array
    about: Array

    def information(self, body: Body, motion: Motion, *, held: bool) -> Array:
        """Return the information (p, p) of a ``motion`` at ``rate`` or of the posture in which it ends."""
        W = regressor(body, motion)
        if held:
            rows = (wrench_shift(self.about) @ W[-1])[_AT_REST]
            return np.asarray(rows.T @ (self.still[:, None] * rows))
        covariance = np.array([np.diag(1.0 / row) for row in self.weights])
        white = Noise(covariance, self.about, Bands(self.edges, self.rate)).whiten(W).reshape(-1, W.shape[2])
        return np.asarray(white.T @ white)

    def shares(self, information: Array) -> Array:
        """Return the share (N,) of the table's variance that an ``information`` (p, p) removes, mean over the ten
        parameters of a segment.
        """
        left = np.linalg.inv(np.eye(len(self.root)) + self.root.T @ information @ self.root)
        before = np.sum(self.root**2, axis=1)
        after = np.einsum("ij,jk,ik->i", self.root, left, self.root)
        removed = np.where(before > 0, 1.0 - after / np.where(before > 0, before, 1.0), 0.0)
        return np.asarray(removed.reshape(-1, 10).mean(axis=1))


def telling_of(dance: Dance) -> Telling:
    """Return by what the parts of ``dance`` are judged."""
    plan = dance.motion(_RATE)
    noise = typical_noise(predict_wrench(dance.body, plan))
    weights = _TRUST / np.diagonal(noise.covariance, axis1=1, axis2=2)
    value, vector = np.linalg.eigh(widened(dance.body.sip).covariance)
    root = vector * np.sqrt(np.maximum(value, 0.0))
    return Telling(_RATE, root, weights, noise.bands.edges, _STILL * _RATE * weights[0, _AT_REST], noise.about)


def planned_shares(dance: Dance, told: Telling) -> Array:
    """Return the share (N,) of the table's variance that the whole dance removes as planned."""
    plan, total = dance.motion(_RATE), np.zeros_like(told.root)
    for phase in dance.phases:
        inside = (plan.time >= phase.start - 1e-9) & (plan.time <= phase.end + 1e-9)
        part = plan.at(inside)
        total += told.information(dance.body, part, held=phase.kind == "hold")
    return told.shares(total)
