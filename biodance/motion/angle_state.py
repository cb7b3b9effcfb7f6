"""Which joint angles of a frame were measured, which rest on filled gaps, and which the markers leave open.

A frame's markers determine its posture with the covariance (J' S^-1 J + P^-1)^-1: J their Jacobian, S the scatter of
a marker against the bone, P what joints can do at all. Markers that are missing for a time add to the variance of every
angle that leans on them; the root of what they add is compared with the error that gait laboratories call acceptable.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.lab.filters import LowPass
from biodance.motion.ik.determination import general_jacobian
from biodance.motion.ik.inverse_kinematics import FrameStatus
from biodance.motion.kinematics import neighbours
from biodance.records import AngleState, Array, Markers

LARGEST_ADDED = np.radians(5.0)
"""rad, the largest standard deviation that missing markers may add to an angle: errors above 5 degrees mislead clinical
interpretation (systematic review, McGinley et al. 2009, doi:10.1016/j.gaitpost.2008.09.003).
"""
_ROOT = (1.0, np.pi / np.sqrt(3))
"""m and rad, standard deviations of the root before any marker is seen: anywhere in the laboratory, turned at will."""


def angle_states(
    body: Body, markers: Markers, status: NDArray[np.int8], low_pass: LowPass
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Return (T,) whether each frame's posture is determined, and (T, n) the `AngleState` of every joint angle.

    ``body`` with the joints held that the whole trial leaves open; their angles are not determined. ``status`` (T,)
    ``FrameStatus`` of the inverse kinematics: a frame that leans or was stopped is not determined. Without the root's
    turn, and in a stopped frame, no angle is; without any marker of a segment that the trial shows at other times, none
    of the joints at its ends is. The ``low_pass`` carries what is guessed half a period of its cut-off further.
    """
    names = tuple(name for name in body.markers.names if name in markers)
    columns, worn = [body.markers.names.index(name) for name in names], markers.select(names)
    given = _given(body, columns)
    segments = np.array([body.markers.segment[column] for column in columns], dtype=int)
    left = _open(given, body, segments, worn.seen, worn.seen)
    own = left if worn.measured is worn.seen else _open(given, body, segments, worn.measured, worn.seen)
    left[status == FrameStatus.STOPPED] = True
    if worn.time.size > 1:
        reach = round(worn.rate / (2 * low_pass.cutoff))
        left = binary_dilation(left, np.ones((2 * reach + 1, 1), dtype=bool))
    state = np.where(left, AngleState.NOT_DETERMINED, np.where(own, AngleState.FILLED, AngleState.MEASURED))
    determined = (status == FrameStatus.SOLVED) & ~left.any(axis=1)
    angles = state[:, body.n_root :].astype(np.int8)
    angles[:, ~body.free] = AngleState.NOT_DETERMINED
    return determined, angles


def _given(body: Body, columns: list[int]) -> tuple[Array, Array]:
    """Return what each marker tells of the posture (K, nv, nv), and what is known without any (nv,): precisions in
    1/m² and 1/rad².
    """
    jacobian = general_jacobian(body, columns) * np.concatenate([np.ones(body.n_root), body.free])
    weight = body.markers.weight[columns] / error_size("soft_tissue", "marker") ** 2
    told = weight[:, None, None] * (np.swapaxes(jacobian, 1, 2) @ jacobian)
    span = np.maximum(body.limits.upper - body.limits.lower, 1e-3) / np.sqrt(12)
    half = body.n_root // 2
    return told, np.concatenate([np.full(half, _ROOT[0]), np.full(half, _ROOT[1]), span]) ** -2


def _open(
    given: tuple[Array, Array],
    body: Body,
    segments: NDArray[np.intp],
    seen: NDArray[np.bool_],
    shown: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return (T, nv) the coordinates to which the markers that are not ``seen`` (T, K) in a frame add more than
    `LARGEST_ADDED`, beside all that any frame of ``shown`` (T, K) has; ``segments`` (K) that they sit on.
    """
    told, before = given
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    ever = shown.any(axis=0)
    precision = np.tensordot(np.vstack([patterns, ever]).astype(float), told, axes=1) + np.diag(before)
    variance = np.diagonal(np.linalg.inv(precision), axis1=1, axis2=2)
    open_ = variance[:-1] - variance[-1] > LARGEST_ADDED**2
    open_[:, : body.n_root // 2] = False  # m: where the root is, a single marker tells
    open_[:, body.n_root :] &= body.free
    ends = neighbours(body) > 0
    for segment in np.unique(segments[ever]):
        unseen = ~patterns[:, segments == segment].any(axis=1)
        open_[unseen, body.n_root // 2 : body.n_root] |= segment == 0
        open_[unseen, body.n_root :] |= ends[:, segment] & body.free
    open_[open_[:, : body.n_root].any(axis=1)] = True
    return np.asarray(open_[which.ravel()])
