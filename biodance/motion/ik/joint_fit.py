"""The fit behind a functional calibration: the postures nearest to the markers of a movement for every choice of the
unknowns, and what of the markers no posture can undo.

The postures are eliminated frame by frame (variable projection: Golub and Pereyra 1973, DOI 10.1137/0710036;
docs/derivations.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.human.scaling import Scaling
from biodance.errors import TrialRefused
from biodance.motion.ik.elsewhere import MarkerSlopes
from biodance.motion.ik.inverse_kinematics import FrameStatus, solve_ik
from biodance.motion.ik.joint_unknowns import SIZE, JointUnknowns
from biodance.motion.kinematics import Poses, place_jacobian, poses
from biodance.records import Array, Markers

_POSTURES = 150
"""Postures taken evenly from all moving trials together."""
_STEPS, _SMALLEST = 8, 5e-4
"""Most Gauss-Newton steps; m or rad below which a step ends the search."""


@dataclass(frozen=True, eq=False)
class CalibrationState:
    """A choice ``theta`` (37,) of the unknowns with its postures ``q`` (T, nq), of which the ``solved`` (T,) count;
    ``cost``, its ``gradient`` (37,) and ``information`` (37, 37), movement and prior together; ``rms`` m, weighted
    marker distance.
    """

    theta: Array
    q: Array
    solved: NDArray[np.bool_]
    cost: float
    gradient: Array
    information: Array
    rms: float


def spread_postures(trials: Sequence[Markers], names: tuple[str, ...]) -> Markers:
    """Return ``POSTURES`` frames, or as many as there are, taken evenly from all trials; NaN where a trial lacks a
    marker.
    """
    parts = [
        np.stack([one[n] if n in one else np.full((one.time.size, 3), np.nan) for n in names], axis=1) for one in trials
    ]
    xyz = np.concatenate(parts) if parts else np.empty((0, len(names), 3))
    xyz = xyz[np.isfinite(xyz).any(axis=(1, 2))]
    if not len(xyz):
        raise TrialRefused(
            "No moving trial shows a marker of the body, so its joints stay where the static trial puts them."
        )
    chosen = np.linspace(0, len(xyz), min(_POSTURES, len(xyz)), endpoint=False).astype(int)
    return Markers(names, np.arange(len(chosen)) / 100.0, xyz[chosen])


def evaluate_joints(
    scaling: Scaling, postures: Markers, theta: Array, guess: Array | None, *, noise: float
) -> CalibrationState:
    """Return the state at ``theta``: the postures of its body that come nearest to the markers, cost and derivatives.

    ``guess`` (T, nq) where to look for the postures; ``noise`` m per axis, standard deviation of a marker of weight 1
    if all postures were independent.
    """
    unknowns = JointUnknowns(scaling.centres)
    body, stand = replace(scaling, centres=unknowns.moved(theta)).body()
    found = solve_ik(body, postures, guess=guess)
    solved = np.asarray(found.status == FrameStatus.SOLVED)
    at = _Linear.of(body, postures, found.q, solved, noise=noise)
    free = at.left_open(unknowns.slope(body, stand, at.pose, at.points, theta))
    prior, prior_slope = unknowns.prior(theta)
    gradient = np.einsum("trp,tr->p", free, at.residual) + prior_slope.T @ prior
    information = np.einsum("trp,trs->ps", free, free, optimize=True) + prior_slope.T @ prior_slope
    cost = 0.5 * float(np.sum(at.residual**2) + prior @ prior)
    rms = float(np.sqrt(3 * np.sum(at.residual**2) / np.sum(at.rows**2)))
    return CalibrationState(theta, found.q, solved, cost, gradient, information, rms)


def marker_slopes(scaling: Scaling, postures: Markers, found: CalibrationState, *, noise: float) -> MarkerSlopes:
    """Return what the ``postures`` say at ``found`` of the place of every marker that counts."""
    unknowns = JointUnknowns(scaling.centres)
    body, stand = replace(scaling, centres=unknowns.moved(found.theta)).body()
    at = _Linear.of(body, postures, found.q, found.solved, noise=noise)
    joints = at.left_open(unknowns.slope(body, stand, at.pose, at.points, found.theta))
    kept = np.flatnonzero(body.markers.weight > 0)
    own = np.zeros((*at.points.shape, len(kept), 3))
    for place, marker in enumerate(kept):
        own[:, marker, :, place] = at.pose.rotation[:, body.markers.segment[marker]]
    shape = (len(at.points), at.rows.shape[1], 3 * len(kept))
    free = at.left_open(own.reshape(shape)).reshape(*shape[:2], len(kept), 3)
    return MarkerSlopes(
        tuple(body.markers.names[marker] for marker in kept),
        np.einsum("trki,tr->ki", free, at.residual),
        np.einsum("trki,trkj->kij", free, free),
        np.einsum("trki,trp->kip", free, joints, optimize=True),
    )


@dataclass(frozen=True, eq=False)
class _Linear:
    """The markers of T postures about a body: its ``pose``, ``points`` (T, K, 3) m; whitened ``rows`` (T, 3K) 1/m,
    ``residual`` (T, 3K) and its change with the ``coordinates`` (T, 3K, nv).
    """

    pose: Poses
    points: Array
    rows: Array
    residual: Array
    coordinates: Array

    @classmethod
    def of(cls, body: Body, postures: Markers, q: Array, solved: NDArray[np.bool_], *, noise: float) -> "_Linear":
        """Return the ``solved`` ones of the postures ``q`` (T, nq)."""
        pose, segment = poses(body, q[solved]), list(body.markers.segment)
        points = pose.points(segment, body.markers.position)
        apart = points - postures.xyz[solved]
        seen = np.isfinite(apart)
        rows = (np.sqrt(body.markers.weight)[:, None] * seen / noise).reshape(len(points), -1)
        residual = rows * np.where(seen, apart, 0.0).reshape(len(points), -1)
        place = place_jacobian(body, pose, segment, points) * _free(body, q[solved])[:, None]
        return cls(pose, points, rows, residual, rows[..., None] * place)

    def left_open(self, slope: Array) -> Array:
        """Return what of ``slope`` (T, 3K, p) of the points no change of the coordinates can undo, whitened."""
        return _left_open(self.coordinates, self.rows[..., None] * slope)


def _free(body: Body, q: Array) -> NDArray[np.bool_]:
    """Return (T, nv) False where a joint is at a limit."""
    angle = q[:, body.nq - len(body.joints) :]
    inside = (angle > body.limits.lower) & (angle < body.limits.upper)
    return np.concatenate([np.ones((len(q), body.n_root), dtype=bool), inside], axis=1)


def _left_open(coordinates: Array, slope: Array) -> Array:
    """Return what of ``slope`` (T, r, p) no change of the ``coordinates`` (T, r, nv) can undo, frame by frame."""
    transposed = np.swapaxes(coordinates, 1, 2)
    square = transposed @ coordinates
    size = np.einsum("tii->t", square)[:, None, None] / square.shape[1]
    return np.asarray(
        slope - coordinates @ np.linalg.solve(square + 1e-9 * size * np.eye(square.shape[1]), transposed @ slope)
    )


def fit_joints(
    scaling: Scaling, postures: Markers, start: CalibrationState, shown: NDArray[np.bool_], *, noise: float
) -> CalibrationState:
    """Return the minimum over the ``shown`` unknowns: Gauss-Newton, steps halved where the cost would rise."""
    at, chosen = start, np.flatnonzero(shown)
    if not chosen.size:
        return at
    for _ in range(_STEPS):
        step = np.zeros(SIZE)
        step[chosen] = -np.linalg.solve(at.information[np.ix_(chosen, chosen)], at.gradient[chosen])
        while np.abs(step).max() > _SMALLEST:
            new = evaluate_joints(scaling, postures, at.theta + step, at.q, noise=noise)
            if new.cost < at.cost:
                break
            step = step / 2
        else:
            break
        at = new
    return at
