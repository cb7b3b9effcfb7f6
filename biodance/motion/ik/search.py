"""From which postures the frames of a trial descend: first guesses from the markers of one frame, then neighbours."""

from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.motion.ik.chart import Chart, chart_of
from biodance.motion.ik.compiled import newton
from biodance.motion.ik.compiled.ball_step import interpolate
from biodance.motion.ik.compiled.newton import MarkerChain, chain_of
from biodance.motion.kinematics import poses
from biodance.records import Array, Index, assign
from biodance.spatial import rigid_fit

_STEPS = 200  # Most Newton steps of a frame


@dataclass(frozen=True, eq=False)
class MarkerProblem:
    """A body against T frames of measured markers: ``segment`` (K) that carries each, ``xyz`` (T, K, 3) m (anything
    finite where hidden), ``weight`` (T, K) >= 0, zero where hidden; ``tolerance`` m, largest slope of a solved frame.
    """

    body: Body
    chain: MarkerChain
    chart: Chart
    segment: list[int]
    xyz: Array
    weight: Array
    tolerance: float

    def __post_init__(self) -> None:
        """Keep ``xyz`` as a view that nothing writes to: one type for the compiled code, whatever was given."""
        view = self.xyz.view()
        view.flags.writeable = False
        assign(self, xyz=view)


class Minimum(NamedTuple):
    """What was reached: ``q`` (B, nq); ``cost`` (B,) m²; largest ``slope`` (B,) m; ``steps`` (B,) tried."""

    q: Array
    cost: Array
    slope: Array
    steps: Index

    def part(self, frames: Index) -> "Minimum":
        """Return a copy of some frames."""
        return Minimum(self.q[frames], self.cost[frames], self.slope[frames], self.steps[frames])

    def put(self, frames: Index, part: "Minimum") -> None:
        """Replace some frames."""
        for mine, other in zip(self, part, strict=True):
            mine[frames] = other


def marker_problem(body: Body, columns: list[int], xyz: Array, *, tolerance: float) -> MarkerProblem:
    """Return the problem of the body's markers ``columns`` (K) against ``xyz`` (T, K, 3) m, NaN = hidden."""
    segment = [body.markers.segment[c] for c in columns]
    seen = np.isfinite(xyz.sum(axis=2))
    return MarkerProblem(
        body=body,
        chain=chain_of(body, segment, body.markers.position[columns]),
        chart=chart_of(body),
        segment=segment,
        xyz=np.ascontiguousarray(xyz) if seen.all() else np.where(seen[:, :, None], xyz, 0.0),
        weight=seen * body.markers.weight[columns],
        tolerance=tolerance,
    )


def minimise_markers(problem: MarkerProblem, frames: Index, start: Array, *, steps: int = _STEPS) -> Minimum:
    """Return the minima of ``frames`` (F,) reached from ``start`` (F, nq) in at most ``steps`` steps."""
    count, joints = len(frames), len(problem.chain.lower)
    q = np.array(start, order="C")
    angles = q[:, q.shape[1] - joints :]
    np.clip(angles, problem.chain.lower, problem.chain.upper, out=angles)
    found = Minimum(q, np.zeros(count), np.full(count, np.inf), np.zeros(count, dtype=np.intp))
    weight = np.ascontiguousarray(problem.weight)  # one type for the compiled code
    newton.minimise_frames(problem.chain, problem.xyz, weight, frames, found, problem.tolerance, steps)
    return found


def marker_distances(problem: MarkerProblem, q: Array) -> Array:
    """Return the distance (T, K) m between every marker and the model at the postures ``q`` (T, nq)."""
    out = np.empty(problem.weight.shape)
    newton.fill_distances(problem.chain, problem.xyz, q, out)
    return out


_EQUAL = 1e-9
"""Share by which the costs of one posture may differ: what the tolerance of the descent leaves."""


def better(one: Minimum, other: Minimum) -> Minimum:
    """Return frame by frame the minimum of lower cost; of equal ones, ``one``."""
    first = one.cost <= other.cost * (1 + _EQUAL)
    return Minimum(
        np.where(first[:, None], one.q, other.q),
        np.where(first, one.cost, other.cost),
        np.where(first, one.slope, other.slope),
        one.steps + other.steps,
    )


_OTHERS = 0.01
"""Weight of the other segments' markers in the root's rigid fit: enough where the root's own markers are hidden."""


def _guess_postures(problem: MarkerProblem, frames: Index, *, share: float | None = None) -> Array:
    """Return q (F, nq): angles at a ``share`` of their range (None: zero), the root where its markers say."""
    lower, upper = problem.chain.lower, problem.chain.upper
    angles = np.clip(np.zeros(len(lower)), lower, upper)
    if share is not None:
        bounded = np.isfinite(lower) & np.isfinite(upper)
        angles = np.where(
            bounded, (1 - share) * np.where(bounded, lower, 0) + share * np.where(bounded, upper, 0), angles
        )
    return _place_root(problem, frames, np.tile(angles, (len(frames), 1)))


def _place_root(problem: MarkerProblem, frames: Index, angles: Array) -> Array:
    """Return q (F, nq) with ``angles`` (F, n) rad and the root's pose that fits the rigid body best."""
    body, xyz = problem.body, problem.xyz[frames]
    if not body.n_root:
        return angles
    model = _markers(body, problem, angles)
    own = np.where(problem.chain.slot == 0, 1.0, _OTHERS) * problem.weight[frames]
    rotation, place = rigid_fit(model, xyz, own)
    return np.concatenate([place, Rotation.from_matrix(rotation).as_quat(), angles], axis=1)


def _markers(body: Body, problem: MarkerProblem, angles: Array) -> Array:
    """Return the markers (F, K, 3) m of the body with its root at the origin, unturned."""
    root = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(angles), 1))
    pose = poses(body, np.concatenate([root, angles], axis=1))
    return pose.points(problem.segment, problem.chain.local)


_STRIDES = (64, 16, 4, 1)
"""Every 64th frame is solved from its own markers; then every 16th, 4th and each frame from those around it."""

SHARES = (0.5, None)
"""First guesses of the angles, as shares of their range (None: zero): a bent body finds straight limbs more often
than the reverse.
"""

MORE_SHARES = (0.25, 0.75)
"""Further guesses for doubtful frames, and for all first frames of a short trial."""

_SHORT = 640
"""Frames below which a trial is short: it has too few neighbours to correct a frame that started wrongly."""

_NEIGHBOURS = 11  # Frames whose median fit a frame is compared with

_DOUBT = (1.5, 0.001)
"""A frame is doubtful where its RMS distance exceeds the neighbours' median times the first number plus the second
(m).
"""


def search(problem: MarkerProblem, frames: Index) -> Minimum:
    """Return the minima (F frames) of ``frames`` (F,), increasing, without any guess."""
    count = len(frames)
    out = Minimum(
        np.zeros((count, problem.chart.nq)), np.zeros(count), np.full(count, np.inf), np.zeros(count, dtype=np.intp)
    )
    known = np.zeros(0, dtype=np.intp)
    for stride in _STRIDES:
        # Coarse frames first, the last one always; those between start from what is solved around them.
        level = np.setdiff1d(np.append(np.arange(0, count, stride), count - 1), known, assume_unique=True)
        if not known.size:
            found = from_markers(problem, frames[level], SHARES if count > _SHORT else (*SHARES, *MORE_SHARES))
        elif level.size:
            found = minimise_markers(
                problem, frames[level], interpolate_postures(problem, frames[known], out.q[known], frames[level])
            )
        else:
            continue
        out.put(level, found)
        known = np.union1d(known, level)
        if stride in (_STRIDES[0], _STRIDES[-1]):
            out.put(known, _retry(problem, frames[known], out.part(known)))
    return out


def from_markers(problem: MarkerProblem, frames: Index, shares: tuple[float | None, ...]) -> Minimum:
    """Return the best of the minima reached from the first guesses at the given ``shares`` of the joint ranges."""
    return reduce(
        better, [minimise_markers(problem, frames, _guess_postures(problem, frames, share=share)) for share in shares]
    )


def from_guess(problem: MarkerProblem, frames: Index, guess: Array) -> Minimum:
    """Return the minima reached from ``guess`` (F, nq), roots first put where markers say if nearer."""
    moved = _place_root(problem, frames, guess[:, guess.shape[1] - len(problem.chain.lower) :])
    own, other = (minimise_markers(problem, frames, q, steps=0) for q in (guess, moved))
    return _retry(problem, frames, minimise_markers(problem, frames, better(own, other).q))


def _retry(problem: MarkerProblem, frames: Index, found: Minimum) -> Minimum:
    """Return ``found`` with doubtful frames tried again, from their markers and from sound frames beside."""
    # cost = 1/2 sum w r².
    rms = np.sqrt(np.maximum(2 * found.cost, 0.0) / problem.weight[frames].sum(axis=1))
    doubtful = rms > _DOUBT[0] * median_filter(rms, min(_NEIGHBOURS, len(rms)), mode="mirror") + _DOUBT[1]
    sound, bad = np.flatnonzero(~doubtful), np.flatnonzero(doubtful)
    if not (bad.size and sound.size):
        return found
    best = better(found.part(bad), from_markers(problem, frames[bad], (*SHARES, *MORE_SHARES)))
    after = np.searchsorted(sound, bad)
    for neighbour in (sound[np.maximum(after - 1, 0)], sound[np.minimum(after, len(sound) - 1)]):
        best = better(best, minimise_markers(problem, frames[bad], found.q[neighbour]))
    out = found.part(np.arange(len(frames)))
    out.put(bad, best)
    return out


def interpolate_postures(problem: MarkerProblem, known: Index, q: Array, wanted: Index) -> Array:
    """Return postures (F, nq) at the frames ``wanted`` (F,) between the postures ``q`` (M, nq) at the frames ``known``
    (M,), increasing.

    Monotone cubics in smooth coordinates; the first and the last posture are kept outside.
    """
    out = np.empty((len(wanted), q.shape[1]))
    if wanted.size:
        smooth = np.ascontiguousarray(problem.chart.smooth(q.T).stacked().T)
        interpolate(problem.chain, known, smooth, q, problem.chart.single, wanted, out)
    return out
