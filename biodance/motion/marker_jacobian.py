"""How points on the segments of a body move when its coordinates do: batches of exact first derivatives."""

import numpy as np

from biodance.body.body import Body
from biodance.motion.kinematics import Poses
from biodance.records import Array


def below(body: Body) -> Array:
    """Return (n, N) 1 where a segment hangs on a joint."""
    table = np.zeros((len(body.joints), len(body.segments)))
    for s, j in enumerate(body.segment_joint):
        while j >= 0:
            table[j, s] = 1.0
            j = body.joints[j].parent
    return table


def chains(body: Body) -> tuple[tuple[int, ...], ...]:
    """Return the axes of every anatomical joint, first to last."""
    found = []
    for last in body.segment_joint:
        chain: list[int] = []
        while last >= 0:
            chain.append(last)
            last = body.joints[last].parent
            if last < 0 or body.joints[last].segment >= 0:
                break
        if chain:
            found.append(tuple(reversed(chain)))
    return tuple(found)


def skew(vector: Array) -> Array:
    """Return the cross-product matrices (..., 3, 3) of vectors (..., 3)."""
    out = np.zeros((*vector.shape, 3))
    x, y, z = np.moveaxis(vector, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def jacobian(body: Body, pose: Poses, segment: list[int], points: Array) -> tuple[Array, Array]:
    """Return (T, 3S, nv) of points (T, S, 3) on segments and of their turn, per unit of the lab-frame tangent [root place, root turn,
    angles].
    """
    frames, count = points.shape[:2]
    place, turn = np.zeros((2, frames, count, 3, body.nv))
    if body.n_root:
        place[..., :3] = np.eye(3)
        turn[..., 3:6] = np.eye(3)
        place[..., 3:6] = -skew(points - pose.root_position[:, None])
    hangs = below(body)[:, segment]
    for j, joint in enumerate(body.joints):
        on = np.flatnonzero(hangs[j])
        axis = (pose.joint_rotation[:, j] @ joint.axis)[:, None]
        place[..., body.n_root + j][:, on] = np.cross(axis, points[:, on] - pose.joint_position[:, j, None])
        turn[..., body.n_root + j][:, on] = axis
    return place.reshape(frames, 3 * count, body.nv), turn.reshape(frames, 3 * count, body.nv)
