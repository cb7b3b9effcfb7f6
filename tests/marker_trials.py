"""Postures and markers of any body with known truth, for tests of inverse kinematics and smoothing."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, RotationSpline

from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.records import Array, Markers

RATE = 100.0


def dance(body: Body, frames: int, rng: np.random.Generator, *, reach: float = 0.9) -> Array:
    """Return q (frames, nq): a new posture every 0.5 s anywhere in the middle ``reach`` of the joint ranges, the
    root turning about.
    """
    time = np.arange(frames) / RATE
    knots = np.arange(0.0, time[-1] + 1.0, 0.5)
    lower, upper = body.limits.lower, body.limits.upper
    share = 0.5 + 0.5 * reach * rng.uniform(-1, 1, (len(knots), len(lower)))
    angles = PchipInterpolator(knots, lower + share * (upper - lower))(time)
    if not body.n_root:
        return angles
    turn = RotationSpline(knots, Rotation.from_rotvec(rng.normal(0, 0.4, (len(knots), 3))))(time)
    place = PchipInterpolator(knots, rng.normal([0.3, -0.2, 0.9], 0.1, (len(knots), 3)))(time)
    return np.hstack([place, (turn * Rotation.from_quat(body.neutral[3:7])).as_quat(), angles])


def points(body: Body, q: Array) -> Array:
    """Return the body's markers (T, K, 3) m."""
    return poses(body, q).points(body.markers.segment, body.markers.position)


def markers_of(body: Body, q: Array, *, noise: Array | float = 0.0) -> Markers:
    """Return the markers of the postures ``q`` (T, nq), displaced by ``noise`` (T, K, 3) m."""
    return Markers(body.markers.names, np.arange(len(q)) / RATE, points(body, q) + noise)


def apart(q: Array, other: Array, n_root: int) -> NDArray[np.float64]:
    """Return (T,) the largest difference of two sets of postures, m and rad; q and -q are one quaternion."""
    if not n_root:
        return np.abs(q - other).max(axis=1)
    turn = (Rotation.from_quat(q[:, 3:7]) * Rotation.from_quat(other[:, 3:7]).inv()).magnitude()
    return np.maximum(np.abs(np.delete(q - other, range(3, 7), axis=1)).max(axis=1), turn)


def noisy_dance(body: Body, frames: int, *, seed: int, reach: float = 0.6, sd: float = 0.004) -> tuple[Array, Markers]:
    """Return postures of a dance and its markers with white noise of standard deviation ``sd`` m."""
    rng = np.random.default_rng(seed)
    q = dance(body, frames, rng, reach=reach)
    return q, markers_of(body, q, noise=rng.normal(0, sd, (frames, len(body.markers.names), 3)))
