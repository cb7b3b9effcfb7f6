"""What will be known after a dance, segment by segment, and how that grows with its duration - before anybody has
danced.

The same machinery as identification, on the planned motion: information of the whitened regressor, discounted by what
twins of the person (soft tissue, joint centres, hinge axes) and plates within their tolerances would disturb, on top of
the table. Only the noise is not the session's own but that of virtual dances. How well a dance was danced is judged by
the same (`scoring`).

`MovementInformation` judges posture by posture and move by move, so that a page can add up while somebody dances. A
posture that is held tells by weight alone: the vertical force, and its moments about the horizontal axes. A move tells
by its accelerations, too. What disturbs a session beyond the noise (soft tissue, joint centres, plates) is left out;
instead only a share of the information counts.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.identification.information import Information
from biodance.identification.knowledge import segment_quantities
from biodance.identification.mismatch import Mismatch, Sizes, mismatch, temper
from biodance.identification.posterior import BodyPosterior, find_posterior
from biodance.identification.statistics import Fit, statistics
from biodance.library import locate, read_toml
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, Motion, Wrench
from biodance.threads import one_thread
from biodance.uncertainty.bands import BANDS, Bands
from biodance.uncertainty.caution import widened_prior
from biodance.uncertainty.noise import Noise

JUDGED_RATE = 12.5
"""Hz at which a plan is judged: moves of 2 s from rest to rest have nothing to say above 6 Hz."""
_STILL = 1.5
"""s of every hold that count: the noise is so slow that longer standing tells next to nothing
(docs/benchmarks/dance.md), and it would cost time.
"""


@dataclass(frozen=True, eq=False)
class Expectation:
    """Standard deviations expected after ``duration`` (D,) s, the first row 0 s = the table: ``mass`` (D, N) kg,
    ``com`` (D, N) m (root mean square over the axes), ``inertia`` (D, N) kg·m² (of the three moments about the
    centre of mass), ``share`` (D, N) of the table's variance that the dance removes (mean over the ten parameters of
    a segment).
    """

    segments: tuple[str, ...]
    duration: Array
    mass: Array
    com: Array
    inertia: Array
    share: Array

    @classmethod
    def of(cls, body: Body, duration: Array, posteriors: list[BodyPosterior]) -> "Expectation":
        """Return what ``posteriors`` (D) after each ``duration`` (D,) s say."""
        sd = np.array([_deviations(posterior) for posterior in posteriors])
        share = np.array([removed_shares(posterior) for posterior in posteriors])
        mass, com, inertia = np.moveaxis(sd, 2, 0)
        return cls(body.segments, duration, mass, com, inertia, share)


def _deviations(posterior: BodyPosterior) -> Array:
    """Return the standard deviations (N, 3) of mass kg, CoM m per axis and moments of inertia kg·m² of each segment."""
    out = []
    for first in range(0, posterior.prior.phi.size, 10):
        cut = slice(first, first + 10)
        _, slope = segment_quantities(posterior.prior.phi[cut])
        variance = np.diag(slope @ posterior.covariance[cut, cut] @ slope.T)
        out.append(np.sqrt([variance[0], np.mean(variance[1:4]), np.mean(variance[[4, 6, 9]])]))
    return np.array(out)


def removed_shares(posterior: BodyPosterior) -> Array:
    """Return the share (N,) of the table's variance that the data removed, mean over the parameters of a segment."""
    known = np.diag(posterior.prior.covariance).reshape(-1, 10) > 0
    removed = np.where(known, posterior.information.reshape(-1, 10), 0.0)
    return np.asarray(removed.sum(axis=1) / np.maximum(known.sum(axis=1), 1))


@dataclass(frozen=True, eq=False)
class MovementEvidence:
    """What movements tell of a ``body``: the information ``H`` (p, p) on its parameters, and the scores of what
    disturbs it; adds up.
    """

    body: Body
    H: Array
    disturbed: Mismatch

    def __add__(self, other: "MovementEvidence") -> "MovementEvidence":
        """Return what both tell."""
        a, b = self.disturbed, other.disturbed
        return MovementEvidence(self.body, self.H + other.H, Mismatch(a.kinematics + b.kinematics, a.plates + b.plates))

    def posterior(self) -> BodyPosterior:
        """Return the posterior after data that agree with the table."""
        prior, H = widened_prior(self.body.sip), self.H
        scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
        value, vector = np.linalg.eigh(H / np.outer(scale, scale))
        rows = np.sqrt(np.maximum(value, 0.0))[:, None] * vector.T * scale
        triangle = np.linalg.qr(np.column_stack([rows, rows @ prior.phi]), mode="r")
        R = np.zeros((len(H) + 1, len(H) + 1))
        R[: len(triangle)] = triangle
        data = Information(R, 1)
        return find_posterior(temper(data, self.disturbed, typical_sizes()) if H.any() else data, prior)


def movement_evidence(
    body: Body, motion: Motion, use: NDArray[np.bool_] | None = None, *, noise: Noise
) -> MovementEvidence:
    """Return what a ``motion`` of ``body`` tells at its frames ``use`` (T,), judged at 12.5 Hz under ``noise``."""
    step = max(1, round(motion.rate / JUDGED_RATE))
    few = Motion(motion.time[::step], motion.q[::step], motion.v[::step], motion.a[::step])
    used = np.ones(few.time.size, dtype=bool) if use is None else use[::step]
    fit = Fit("movement", few, predict_wrench(body, few), used)
    triangle = statistics(body, fit, noise).information(noise).triangle
    return MovementEvidence(body, triangle.T @ triangle, mismatch(body, (fit,), noise))


@one_thread()
def expect(dance: Dance, *, steps: int = 10) -> Expectation:
    """Return what is expected after ``steps`` durations of ``dance``, evenly spread over its postures."""
    brief = replace(dance, hold=np.minimum(dance.hold, _STILL))
    chosen = evenly_spread(brief, steps)
    found = expected_spread(brief.body, brief.motion(JUDGED_RATE), np.array([brief.phases[k].end for k in chosen]))
    return replace(found, duration=np.array([0.0, *(dance.phases[k].end for k in chosen)]))


def evenly_spread(dance: Dance, steps: int) -> list[int]:
    """Return the phases after whose ends it is told what is expected: ``steps`` of the holds, the last one included."""
    holds = [k for k, phase in enumerate(dance.phases) if phase.kind == "hold"]
    return [holds[k] for k in sorted({int(k) for k in np.linspace(0, len(holds) - 1, steps + 1).round()[1:]})]


def expected_spread(body: Body, motion: Motion, ends: Array) -> Expectation:
    """Return what is expected when a ``motion`` at (a multiple of) 12.5 Hz stops at each instant ``ends`` (D,) s."""
    noise, size = typical_noise(predict_wrench(body, motion)), 10 * len(body.segments)
    told = [MovementEvidence(body, np.zeros((size, size)), Mismatch(*np.zeros((2, size, 1))))]
    for start, end in pairwise([motion.time[0], *ends]):
        use = (motion.time >= start - 1e-9) & (motion.time < end - 1e-9)
        told.append(told[-1] + movement_evidence(body, motion, use, noise=noise))
    return Expectation.of(body, np.concatenate([[0.0], ends]), [one.posterior() for one in told])


def typical_noise(wrench: Wrench) -> Noise:
    """Return the noise of a typical session about the mean centre of pressure of the planned ``wrench``; the variance
    of a coefficient grows with the rate.
    """
    covariance = JUDGED_RATE / BANDS.rate * np.array([np.diag(np.square(row)) for row in _danced()["noise"]])
    return Noise(covariance, np.asarray(wrench.cop().mean(axis=0)), Bands(BANDS.edges, JUDGED_RATE))


def typical_sizes() -> Sizes:
    """Return the sizes of the disturbances that the evidence chose in typical sessions."""
    return Sizes(**_danced()["sizes"])


@cache
def _danced() -> dict[str, Any]:
    """Return what virtual dances left: ``anthropometry/uncertainty/dances.toml``."""
    return read_toml(locate("anthropometry/uncertainty", "dances"))


_FELT = 1.0
"""s: a hold that is judged alone says nothing more after this time."""
_TRUST = 0.1
"""Share of the information that disturbances leave where postures and moves are judged one by one: with it whole dances
tell of every segment what is expected of them.
"""
_AT_REST = slice(2, 5)
"""Components of a wrench (Fx, Fy, Fz, Mx, My, Mz) that a body at rest has."""


@dataclass(frozen=True, eq=False)
class MovementInformation:
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


def movement_information(dance: Dance) -> MovementInformation:
    """Return by what the parts of ``dance`` are judged."""
    plan = dance.motion(JUDGED_RATE)
    noise = typical_noise(predict_wrench(dance.body, plan))
    weights = _TRUST / np.diagonal(noise.covariance, axis1=1, axis2=2)
    value, vector = np.linalg.eigh(widened_prior(dance.body.sip).covariance)
    root = vector * np.sqrt(np.maximum(value, 0.0))
    return MovementInformation(
        JUDGED_RATE, root, weights, noise.bands.edges, _FELT * JUDGED_RATE * weights[0, _AT_REST], noise.about
    )
