"""Which markers determine a posture, and which joints remain open without the missing ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.motion.kinematics import place_jacobian, poses
from biodance.records import Array

_LEVER = 0.1
"""m, what one radian is compared with: one metre of root translation counts as 10 rad."""

LEAST_MOTION = 0.02
"""Least share of its lever by which any unit change of posture must move the markers that it carries, for the
posture to be determined.
"""


@dataclass(frozen=True, eq=False)
class Determination:
    """Per frame: ``determined`` (T,); ``open_coordinates`` names what the best-seen frame leaves open (empty if it
    is determined).
    """

    determined: NDArray[np.bool_]
    open_coordinates: tuple[str, ...]


def determination(body: Body, columns: list[int], seen: NDArray[np.bool_]) -> Determination:
    """Tell for every frame whether the markers seen fix every coordinate of ``body`` that is free to move.

    ``columns`` (K) indices of the markers in ``body.markers``; ``seen`` (T, K). Judged by the marker Jacobian at one
    general posture, so that the answer depends on the markers and not on the pose: with the weighted Jacobian's columns
    in units of moved weight and ``LEVER``, its smallest singular value must reach ``LEAST_MOTION``.
    """
    free = np.concatenate([np.ones(body.n_root, dtype=bool), body.free])
    jacobian = general_jacobian(body, columns)[:, :, free]
    jacobian[:, :, body.n_root // 2 :] /= _LEVER
    useful = seen & (body.markers.weight[columns] > 0)
    first = np.concatenate([[True], (useful[1:] != useful[:-1]).any(axis=1)])[: len(useful)]
    patterns, which = np.unique(useful[first], axis=0, return_inverse=True)
    which = which.ravel()[np.cumsum(first) - 1]
    weight = body.markers.weight[columns] * patterns
    value = np.concatenate(
        [np.linalg.eigvalsh(_normal(jacobian, weight[i : i + 256]))[:, 0] for i in range(0, len(weight), 256)]
    )
    best = patterns.sum(axis=1).argmax()
    names = ("root x", "root y", "root z", "root rotation x", "root rotation y", "root rotation z")[: body.n_root]
    names += tuple(joint.name for joint, moves in zip(body.joints, body.free, strict=True) if moves)
    vague = _open(_normal(jacobian, weight[best : best + 1])[0])
    return Determination(
        value[which] >= LEAST_MOTION**2, tuple(name for name, is_open in zip(names, vague, strict=True) if is_open)
    )


def _normal(jacobian: Array, weight: Array) -> Array:
    """Return (P, nv, nv) scaled normal matrices of P patterns of marker weights (P, K)."""
    moves = np.abs(jacobian).max(axis=1) > 0
    moved = weight @ moves
    scale = 1 / np.sqrt(np.where(moved > 0, moved, 1.0))
    pairs = np.swapaxes(jacobian, 1, 2) @ jacobian
    return np.asarray(np.tensordot(weight, pairs, axes=1) * scale[:, :, None] * scale[:, None])


def _open(normal: Array) -> NDArray[np.bool_]:
    """Return (nv,) the coordinates that take part in a change of posture that the markers hardly see."""
    value, vector = np.linalg.eigh(normal)
    return (np.abs(vector[:, value < LEAST_MOTION**2]) > 0.2).any(axis=1)


def general_jacobian(body: Body, columns: list[int]) -> Array:
    """Return (K, 3, nv) at a general posture: how the markers of ``columns`` move, m per m and per rad."""
    angles = np.clip(0.4 + 0.2 * np.cos(1.7 * np.arange(len(body.joints))), body.limits.lower, body.limits.upper)
    pose = poses(body, np.concatenate([body.neutral[: body.nq - len(angles)], angles]))
    segment = [body.markers.segment[c] for c in columns]
    places = pose.points(segment, body.markers.position[columns])
    return np.asarray(place_jacobian(body, pose, segment, places)).reshape(len(columns), 3, body.nv)
