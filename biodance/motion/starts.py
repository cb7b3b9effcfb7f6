"""First guesses of a posture from the markers of one frame alone: typical joint angles, and the root where its markers say.

The root comes from the rigid fit of its markers (Kabsch 1976, DOI 10.1107/S0567739476001873).
"""

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.motion.marker_problem import MarkerProblem
from biodance.records import Array, Index

OTHERS = 0.01
"""Weight of the other segments' markers in the root's rigid fit: enough where the root's own markers are hidden."""


def start(problem: MarkerProblem, frames: Index, *, share: float | None = None) -> Array:
    """Return q (F, nq): the angles at a ``share`` of their range between the limits (None: zero), the root where its markers say."""
    lower, upper = problem.chain.lower, problem.chain.upper
    angles = np.clip(np.zeros(len(lower)), lower, upper)
    if share is not None:
        bounded = np.isfinite(lower) & np.isfinite(upper)
        angles = np.where(bounded, (1 - share) * np.where(bounded, lower, 0) + share * np.where(bounded, upper, 0), angles)
    return placed(problem, frames, np.tile(angles, (len(frames), 1)))


def placed(problem: MarkerProblem, frames: Index, angles: Array) -> Array:
    """Return q (F, nq) with the ``angles`` (F, n) rad and the root's pose that fits the body, rigid at them, best to its markers: the root
    segment's before all others.
    """
    body, xyz = problem.body, problem.xyz[frames]
    if not body.n_root:
        return angles
    model = _markers(body, problem, angles)
    own = np.where(problem.chain.slot == 0, 1.0, OTHERS) * problem.weight[frames]
    weight = (own / own.sum(axis=1, keepdims=True))[:, :, None]
    middle, seen = (weight * model).sum(axis=1), (weight * xyz).sum(axis=1)
    cross = np.swapaxes(weight * (model - middle[:, None]), 1, 2) @ (xyz - seen[:, None])
    left, _, right = np.linalg.svd(np.swapaxes(cross, 1, 2))
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
    rotation = left @ right
    place = seen - np.einsum("fij,fj->fi", rotation, middle)
    return np.concatenate([place, Rotation.from_matrix(rotation).as_quat(), angles], axis=1)


def _markers(body: Body, problem: MarkerProblem, angles: Array) -> Array:
    """Return the markers (F, K, 3) m of the body with its root at the origin, unturned."""
    root = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(angles), 1))
    pose = poses(body, np.concatenate([root, angles], axis=1))
    return pose.points(problem.segment, problem.chain.local)
