"""What a movement tells of every segment: what will be known after a planned dance, how that grows with its duration,
how well a dance was danced, which transitions are worth dancing once more, and which posture to choose next.

The same machinery as identification: information of the whitened regressor, discounted by what twins of the person
(soft tissue, joint centres, hinge axes) and plates within their tolerances would disturb, on top of the table. Only the
noise is not the session's own but that of virtual dances, so that planned and performed motion are judged alike. A
robot has encoders and no skin: nothing disturbs it but the noise that its own wrench had.

`MovementInformation` judges posture by posture and move by move, so that a page can add up while somebody dances. A
posture that is held tells by weight alone: the vertical force, and its moments about the horizontal axes. A move tells
by its accelerations, too. What disturbs a session beyond the noise is left out; only a share of the information counts.

`PostureInformation` judges candidates while a dance is designed, thousands a second: rows of the regressor per standard
deviation of the error and of the table. With ``centres`` postures also tell of the centres of the ball joints, which
identification finds from the movement. A centre lies at c in the frame of the one segment and at d in that of the
other: c = R d + their distance, with R the rotation between them. Every posture is one such equation, and only postures
that differ tell both apart.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from biodance import display
from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import Phase, rest_to_rest
from biodance.dance.visit_log import VisitLog
from biodance.errors import BiodanceError
from biodance.identification.knowledge import segment_quantities
from biodance.identification.mismatch import Mismatch, Sizes, mismatch, temper
from biodance.identification.posterior import BodyPosterior, Information, find_posterior, prior_factor
from biodance.identification.statistics import Fit, statistics
from biodance.library import locate, read_toml
from biodance.motion.dynamics import predict_wrench, regressor
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Sip, Wrench
from biodance.threads import one_thread
from biodance.uncertainty.bands import BANDS, Bands, Noise
from biodance.uncertainty.caution import widened_prior

JUDGED_RATE = 12.5
"""Hz at which a plan is judged: moves of 2 s from rest to rest have nothing to say above 6 Hz."""
_STILL = 1.5
"""s of every hold that count: the noise is so slow that longer standing tells next to nothing
(docs/benchmarks/dance.md), and it would cost time.
"""
ROBOT_ERROR = np.array([1.1, 0.5, 0.9, 0.2, 0.7, 0.4])
"""N, N·m: error of one sample of a robot's wrench, unexplained of a movement of HOAP-3 (Bonnet 2016, table II)."""
ROBOT_RATE = 4.0
"""Hz: independent samples of the wrench of a robot."""


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
        mass, com, inertia = np.moveaxis(np.array([*map(_deviations, posteriors)]), 2, 0)
        return cls(body.segments, duration, mass, com, inertia, np.array([*map(removed_shares, posteriors)]))


def _deviations(posterior: BodyPosterior) -> Array:
    """Return the standard deviations (N, 3) of mass kg, CoM m per axis and moments of inertia kg·m² of each segment."""
    out = []
    for first in range(0, posterior.prior.phi.size, 10):
        cut = slice(first, first + 10)
        _, slope = segment_quantities(posterior.prior.phi[cut])
        # J C J'. The six inertias come as xx, xy, yy, xz, yz, zz.
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

    def posterior(self, prior: Sip | None = None) -> BodyPosterior:
        """Return the posterior after data that agree with the table; ``prior`` by default with its caution."""
        prior = prior or widened_prior(self.body.sip)
        expected = np.column_stack([np.eye(prior.phi.size), prior.phi])  # [W y] = W [1 phi]
        # [1 phi]'H [1 phi]: the data agree with the table, y = W phi.
        data = Information.of_normal(expected.T @ self.H @ expected, 1)
        scores = self.disturbed.kinematics.any() or self.disturbed.plates.any()
        return find_posterior(temper(data, self.disturbed, typical_sizes()) if scores else data, prior)


def movement_evidence(
    body: Body, motion: Motion, use: NDArray[np.bool_] | None = None, *, noise: Noise, robot: bool = False
) -> MovementEvidence:
    """Return what a ``motion`` of ``body`` tells at its frames ``use`` (T,), judged at 12.5 Hz under ``noise``; of a
    ``robot`` at all of its samples, and undisturbed.
    """
    step = 1 if robot else max(1, round(motion.rate / JUDGED_RATE))
    few = Motion(motion.time[::step], motion.q[::step], motion.v[::step], motion.a[::step])
    used = np.ones(few.time.size, dtype=bool) if use is None else use[::step]
    fit = Fit("movement", few, predict_wrench(body, few), used)
    # Upper triangle R of the whitened regressor, R'R its information.
    triangle = statistics(body, (fit,), noise).information(noise).triangle
    size = len(triangle)
    scores = Mismatch(*np.zeros((2, size, 1))) if robot else mismatch(body, (fit,), noise)
    return MovementEvidence(body, triangle.T @ triangle, scores)


@one_thread()
def expect(dance: Dance, *, steps: int = 10) -> Expectation:
    """Return what is expected after ``steps`` durations of ``dance``, evenly spread over its postures; of a robot if it
    is danced exactly.
    """
    robot = not dance.body.markers.names
    brief = dance if robot else replace(dance, hold=np.minimum(dance.hold, _STILL))
    holds = [k for k, phase in enumerate(dance.phases) if phase.kind == "hold"]
    # The holds after whose ends it is told, the last one included.
    chosen = [holds[k] for k in sorted({int(k) for k in np.linspace(0, len(holds) - 1, steps + 1).round()[1:]})]
    ends, motion = np.array([brief.phases[k].end for k in chosen]), brief.motion(ROBOT_RATE if robot else JUDGED_RATE)
    found = expected_spread(brief.body, motion, ends, robot=robot)
    return replace(found, duration=np.array([0.0, *(dance.phases[k].end for k in chosen)]))


def expected_spread(body: Body, motion: Motion, ends: Array, *, robot: bool = False) -> Expectation:
    """Return what is expected when a ``motion`` at (a multiple of) 12.5 Hz, of a robot at any rate, stops at each
    instant ``ends`` (D,) s.
    """
    # One noise for all stretches: their informations are about one point and in the same bands.
    robots = Noise(np.diag(ROBOT_ERROR**2)[None], np.zeros(3))  # one band: the same error at all frequencies
    noise = robots if robot else typical_noise(predict_wrench(body, motion))
    size = 10 * len(body.segments)
    told = [MovementEvidence(body, np.zeros((size, size)), Mismatch(*np.zeros((2, size, 1))))]
    for start, end in pairwise([motion.time[0], *ends]):
        use = (motion.time >= start - 1e-9) & (motion.time < end - 1e-9)
        # Information of separate stretches adds.
        told.append(told[-1] + movement_evidence(body, motion, use, noise=noise, robot=robot))
    posteriors = [one.posterior(body.sip if robot else None) for one in told]
    return Expectation.of(body, np.concatenate([[0.0], ends]), posteriors)


def typical_noise(wrench: Wrench) -> Noise:
    """Return the noise of a typical session about the mean centre of pressure of the planned ``wrench``; the variance
    of a coefficient grows with the rate.
    """
    # Orthonormal coefficients: the variance of each is the power density times the rate.
    covariance = JUDGED_RATE / BANDS.rate * np.array([np.diag(np.square(row)) for row in _danced()["noise"]])
    return Noise(covariance, np.asarray(wrench.cop().mean(axis=0)), Bands(BANDS.edges, JUDGED_RATE))


def typical_sizes() -> Sizes:
    """Return the sizes of the disturbances that the evidence chose in typical sessions."""
    return Sizes(**_danced()["sizes"])


@cache
def _danced() -> dict[str, Any]:
    """Return what virtual dances left: ``anthropometry/uncertainty/dances.toml``."""
    return read_toml(locate("anthropometry/uncertainty", "dances"))


_FELT = 1.0  # s: a hold that is judged alone says nothing more after this time
_AT_REST = slice(2, 5)  # Components of a wrench (Fx, Fy, Fz, Mx, My, Mz) that a body at rest has


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
    # Information of a coefficient: 1 / variance.
    # so much of it disturbances leave where postures and moves are judged one by one
    weights = 0.1 / np.diagonal(noise.covariance, axis1=1, axis2=2)
    value, vector = np.linalg.eigh(widened_prior(dance.body.sip).covariance)
    # V sqrt(lambda): a root of a covariance that may be singular.
    root = vector * np.sqrt(np.maximum(value, 0.0))
    return MovementInformation(
        JUDGED_RATE, root, weights, noise.bands.edges, _FELT * JUDGED_RATE * weights[0, _AT_REST], noise.about
    )


PROPOSED = 3
"""Transitions that are proposed for repetition."""


@dataclass(frozen=True)
class SegmentExcitation:
    """What a dance was ``planned`` to tell of a ``segment``, and what was ``reached``: share of the table's variance
    removed, 0 to 1, mean over its ten inertial parameters.
    """

    segment: str
    planned: float
    reached: float


@dataclass(frozen=True)
class Repetition:
    """One ``transition`` of a dance, counted from 1: it leads from cue ``transition`` to the next one. Planned from
    ``start`` to ``end`` s of the dance; ``gain``: by how much dancing it once more, as planned, raises the share of
    the table's variance removed, mean over the segments; ``most`` the segment that gains most.
    """

    transition: int
    start: float
    end: float
    gain: float
    most: str


@dataclass(frozen=True, eq=False)
class PerformanceScore:
    """How well a dance was danced.

    Parameters
    ----------
    dance : str
        Name of its protocol.
    excitation : tuple of SegmentExcitation
        Planned and reached, segment by segment.
    repetitions : tuple of Repetition
        The transitions whose repetition would gain most together, best first.
    seconds : float
        Recorded and used, s.
    logs : tuple of VisitLog
        What the page of the dance noted meanwhile (`visit_log`), where its files lie beside the recordings.

    Examples
    --------
    >>> identified = biodance.identify(result, dance="dance.npz")
    >>> identified.performance.repeat
    (1,)
    """

    dance: str
    excitation: tuple[SegmentExcitation, ...]
    repetitions: tuple[Repetition, ...]
    seconds: float
    logs: tuple[VisitLog, ...] = ()

    def __repr__(self) -> str:
        planned, reached = (np.mean([getattr(one, name) for one in self.excitation]) for name in ("planned", "reached"))
        told = f"{100 * reached:.0f} % of the table's variance removed, planned {100 * planned:.0f} %"
        return f"PerformanceScore({self.dance!r}: {told})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, [f"Repeat transition {k}." for k in self.repeat])

    @property
    def repeat(self) -> tuple[int, ...]:
        """Numbers of the transitions to repeat, best first."""
        return tuple(one.transition for one in self.repetitions)


def score_performance(
    dance: Dance, body: Body, recorded: tuple[tuple[Motion, NDArray[np.bool_]], ...]
) -> PerformanceScore:
    """Return how well ``dance`` was danced in the motions ``recorded`` of ``body``, each with its usable frames (T,).

    `PROPOSED` transitions are chosen one after another, each the one that raises the mean share most beside those
    chosen before.

    Raises
    ------
    BiodanceError
        The dance has joints that the body has not, or nothing was recorded.
    """
    names, own = ([joint.name for joint in one.joints] for one in (dance.body, body))
    if [name for name in own if name in names] != names or dance.body.segments != body.segments:
        other = sorted(set(names) ^ set(own)) or ["the order"]
        raise BiodanceError(
            f"Dance {dance.protocol}: was designed for a body with other joints than that of this session "
            f"({', '.join(other[:3])}). Give the dance that was shown."
        )
    if not any(use.any() for _, use in recorded):
        raise BiodanceError("No trial with role fit has motion and plates, so nobody knows how the dance was danced.")
    brief = replace(dance, hold=np.minimum(dance.hold, _FELT))
    # The performer's body has the joints; the plan gets those it lacks.
    plan = _in_joints_of(body, dance, brief.motion(JUDGED_RATE))
    noise = typical_noise(predict_wrench(body, plan))
    planned = removed_shares(movement_evidence(body, plan, noise=noise).posterior())
    parts = [movement_evidence(body, motion, use, noise=noise) for motion, use in recorded if use.any()]
    total = sum(parts[1:], parts[0])
    reached = removed_shares(total.posterior())
    rows = tuple(SegmentExcitation(*row) for row in zip(body.segments, planned.tolist(), reached.tolist(), strict=True))
    seconds = sum(float(use.sum()) / motion.rate for motion, use in recorded)
    return PerformanceScore(dance.protocol, rows, _repetitions(dance, body, total, noise), seconds)


def _repetitions(dance: Dance, body: Body, known: MovementEvidence, noise: Noise) -> tuple[Repetition, ...]:
    """Return the moves that gain most beside what is ``known``, best first; none to another place of the feet."""
    some = {
        phase: _once(dance, body, phase, noise)
        for phase in dance.phases
        if phase.kind == "move"
        and np.array_equal(dance.stances[phase.posture - 1].ankle, dance.stances[phase.posture].ankle)
    }
    out: list[Repetition] = []
    while some and len(out) < PROPOSED:
        before = removed_shares(known.posterior())
        gains = {phase: removed_shares((known + one).posterior()) - before for phase, one in some.items()}
        best = max(gains, key=lambda phase: float(gains[phase].mean()))
        segment = body.segments[int(np.argmax(gains[best]))]
        out.append(Repetition(best.posture, best.start, best.end, float(gains[best].mean()), segment))
        known = known + some.pop(best)
    return tuple(out)


def _once(dance: Dance, body: Body, phase: Phase, noise: Noise) -> MovementEvidence:
    """Return what the planned movement of one phase tells, at the rate of the judgement."""
    time = np.arange(max(2, round((phase.end - phase.start) * JUDGED_RATE)) + 1) / JUDGED_RATE
    state = dance.state(phase, np.minimum(phase.start + time, phase.end))
    motion = dance.chain.motion(time, state.x, state.v, state.a)
    return movement_evidence(body, _in_joints_of(body, dance, motion), noise=noise)


def _in_joints_of(body: Body, dance: Dance, motion: Motion) -> Motion:
    """Return a planned motion in the coordinates of a body that may have joints which the dance leaves at zero."""
    names = [joint.name for joint in dance.body.joints]
    new = np.flatnonzero([joint.name not in names for joint in body.joints])
    if not new.size:
        return motion
    # np.insert counts places in the array as it is before.
    before, root = new - np.arange(new.size), body.nq - len(body.joints)
    q = np.insert(motion.q, before + root, 0.0, axis=1)
    v, a = (np.insert(part, before + body.n_root, 0.0, axis=1) for part in (motion.v, motion.a))
    return Motion(motion.time, q, v, a, joint_names=tuple(joint.name for joint in body.joints))


SAMPLE_ERROR = np.array([8.0, 8.0, 8.0, 4.0, 4.0, 4.0])
"""N, N·m: error of one independent sample of the wrench of a person (residual of the paper: 7.8 N, 4.3 N·m)."""
SAMPLE_RATE = 4.0
"""Hz: independent samples per second of moving."""
_BALLS = (
    *(("pelvis", "right_thigh"), ("pelvis", "left_thigh"), ("pelvis", "trunk_head")),
    *(("trunk_head", "right_upper_arm"), ("trunk_head", "left_upper_arm")),
)
CENTRES = 6 * len(_BALLS)
"""Unknown coordinates of all centres."""


class PostureInformation:
    """What postures of ``chain`` and moves of the plan's duration tell; ``factor`` (10 N, k): the table's covariance is
    ``factor factor'``; ``scale`` (10 N, k) the same per standard deviation of the table, weighted by the plan.

    Rows (m, k) are per standard deviation; a posterior (k, k) is the covariance of what they multiply, 1 beforehand.
    """

    def __init__(self, chain: Chain, plan: Plan, *, centres: bool = False) -> None:
        self.chain, self.centres, self.factor = chain, centres, prior_factor(chain.body.sip)
        before = np.sum(self.factor**2, axis=1)
        self.weight = np.repeat(plan.emphasis(chain.body.segments), 10) * (before > 0)
        # tr(scale C scale'): sum of the variances over those of the table, weighted.
        self.scale = self.factor * np.sqrt(self.weight / np.where(before > 0, before, 1.0))[:, None]
        if centres:
            self.factor = np.pad(self.factor, ((0, 0), (0, CENTRES)))
            self.scale = block_diag(self.scale, np.eye(CENTRES))
        way = rest_to_rest(plan.move, via=0, rate=SAMPLE_RATE)
        # Both ends are at rest: the postures, which count on their own.
        self._way = [part[1:-1] for part in (way.position, way.velocity, way.acceleration)]

    @property
    def beforehand(self) -> Array:
        """(k, k) the posterior before any posture."""
        return np.eye(self.factor.shape[1])

    def white(self, W: Array) -> Array:
        """Return regressors (G, 6 T, 10 N) per standard deviation of error and of the table, (G, 6 T, k)."""
        error = np.tile(SAMPLE_ERROR, W.shape[1] // 6)
        # F^-1 W S, with S the root of the table's covariance.
        flat = (W / error[:, None]).reshape(-1, W.shape[2]) @ self.factor  # one product: many small ones are slow
        return np.asarray(flat.reshape(*W.shape[:2], -1))

    def of_ways(self, ends: Array) -> Array:
        """Return the rows (G, m, k) of going straight from one posture to another, ``ends`` (G, 2, n)."""
        # The splines are linear in the ends.
        x, v, a = ((part @ ends).reshape(-1, ends.shape[2]) for part in self._way)
        W = regressor(self.chain.body, self.chain.motion(np.arange(len(x)) / SAMPLE_RATE, x, v, a))
        return self.white(np.asarray(W).reshape(len(ends), -1, W.shape[-1]))

    def of_posture(self, x: Array, standing: Array) -> Array:
        """Return the rows (m, k) of a posture ``x`` (n,) whose regressor ``standing`` (6, 10 N) is known
        (`standing_regressors`).
        """
        still = self.white(standing[None])[0]
        return np.concatenate([still, rows_of_centres(self.chain, x, still.shape[1])]) if self.centres else still

    def gains(self, posterior: Array, rows: Array) -> Array:
        """Return by how much each of ``rows`` (..., m, k) lowers the weighted variance that a posterior leaves."""
        # tr(scale Z'Z scale').
        return np.asarray(np.sum((learned(posterior, rows) @ self.scale.T) ** 2, axis=(-2, -1)))


def standing_regressors(chain: Chain, x: Array) -> Array:
    """Return the regressor (S, 6, 10 N) of standing still in each posture (S, n)."""
    motion = chain.motion(np.arange(len(x), dtype=float), x, *np.zeros((2, *x.shape)))
    return np.asarray(regressor(chain.body, motion)).reshape(len(x), 6, -1)


def learned(posterior: Array, rows: Array) -> Array:
    """Return Z (..., m, k) with new covariance = ``posterior`` - Z'Z (k, k) after whitened ``rows`` (..., m, k)."""
    # Woodbury: P - P X'(1 + X P X')^-1 X P, with L L' = 1 + X P X' and Z = L^-1 X P.
    spread = rows @ posterior
    factor = np.linalg.cholesky(np.eye(rows.shape[-2]) + spread @ np.swapaxes(rows, -1, -2))
    return np.asarray(np.linalg.solve(factor, spread))


def update_posterior(posterior: Array, rows: Array) -> Array:
    """Return the posterior (k, k) after whitened ``rows`` (m, k)."""
    Z = learned(posterior, rows)
    return np.asarray(posterior - Z.T @ Z)


def rows_of_centres(chain: Chain, x: Array, columns: int) -> Array:
    """Return the whitened rows (3 J, columns) of a posture ``x`` (n,): per standard deviation of what slides and, in
    the last `CENTRES` columns, of what is not known of the J centres.
    """
    body, out = chain.body, np.zeros((3 * len(_BALLS), columns))
    turned = np.asarray(poses(body, chain.positions(x[None])).rotation)[0]
    for k, (near, far) in enumerate(_BALLS):
        first, second = (turned[body.segments.index(name)] for name in (near, far))
        here = columns - CENTRES + 6 * k
        # c - R d = what is to be known of the distance; R = R_near' R_far.
        out[3 * k : 3 * k + 3, here : here + 6] = np.hstack([np.eye(3), -first.T @ second])
    # Prior deviation over error.
    return out * 0.015 / 0.020
