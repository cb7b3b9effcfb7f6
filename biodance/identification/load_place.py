"""On which segment the place of a load lies: a load is looked for in and near every segment's box, and near a joint the
box of the neighbour is as near.
"""

from collections.abc import Sequence

import numpy as np

from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion

_FRAMES = 50
"""Frames of a movement in which the boxes are compared: only joints that turn far change the answer."""


def nearest_segment(body: Body, motions: Sequence[Motion], segment: str, place: Array) -> str:
    """Return the segment to whose box a point is nearest in the mean over ``motions``.

    Parameters
    ----------
    body : Body
        Whose boxes are compared.
    motions : sequence of Motion
        In which the point is carried along.
    segment : str
        That carries the point; it is the answer where no other is nearer.
    place : Array
        (3,) m in the joint frame of ``segment``; NaN: not known.

    Returns
    -------
    str
        Its name; "" where the place is not known.
    """
    if not np.isfinite(place).all():
        return ""
    q = np.concatenate([one.q[:: max(1, len(one.q) // _FRAMES)] for one in motions])
    pose, own = poses(body, q), body.segment_index(segment)
    point, n = pose.points([own], place[None]), len(body.segments)
    local = np.einsum("tsji,tsj->tsi", pose.rotation[:, :n], point - pose.position[:, :n])
    low, high = np.moveaxis(body.boxes, 1, 0)
    far = np.linalg.norm(np.maximum(0.0, np.maximum(low - local, local - high)), axis=2).mean(axis=0)
    return segment if far[own] <= far.min() else body.segments[int(np.argmin(far))]
