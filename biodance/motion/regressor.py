"""The root regressor: the ground wrench that a motion needs, linear in the standard inertial parameters (paper eq. 3,
upper part).

For every segment with origin p, rotation R, angular velocity w and acceleration dw (lab frame) and origin acceleration
a, with g the gravity vector, first moment h = R mc and inertia J = R I R' about the segment origin:

    f = m (a - g) + dw x h + w x (w x h)
    n = h x (a - g) + J dw + w x J w        (about the segment origin)

and the wrench about the lab origin is [f; n + p x f]. Both are linear in [m, mc, I]: the columns of W.
"""

import numpy as np

from biodance.body.body import Body
from biodance.body.inertia import TENSOR
from biodance.motion.kinematics import SegmentMotion, segment_motion
from biodance.records import Array, Motion, Wrench
from biodance.spatial import skew


def _inertia_columns(local: Array) -> Array:
    """Return L (..., 3, 6) with ``L @ [Ixx Ixy Iyy Ixz Iyz Izz] = I @ local`` for vectors ``local`` (..., 3)."""
    out = np.zeros((*local.shape, 6))
    for column, (i, j) in enumerate(TENSOR):
        out[..., i, column] += local[..., j]
        if i != j:
            out[..., j, column] += local[..., i]
    return out


def regressor_of(segments: SegmentMotion, *, gravity: Array, sharing: Array | None = None) -> Array:
    """Return W (T, 6, 10N): wrench about the lab origin, force first, per unit of each parameter; ``gravity`` (3,)
    m/s², lab frame; ``sharing`` (10 M, 10 N) what each of the M links that move has of the N segments
    (``Body.sharing``; None: they are the segments).
    """
    rotation, position = segments.rotation, segments.position
    frames, count = position.shape[:2]
    turned = np.swapaxes(rotation, -1, -2)
    w = np.einsum("...ij,...j->...i", turned, segments.angular_velocity)
    dw = np.einsum("...ij,...j->...i", turned, segments.angular_acceleration)
    drive = segments.acceleration - gravity
    skew_w = skew(w)
    first = rotation @ (skew(dw) + skew_w @ skew_w)
    second = rotation @ (_inertia_columns(dw) + skew_w @ _inertia_columns(w))
    arm = skew(position)
    columns = np.zeros((frames, count, 6, 10))
    columns[..., :3, 0] = drive
    columns[..., :3, 1:4] = first
    columns[..., 3:, 0] = np.einsum("...ij,...j->...i", arm, drive)
    columns[..., 3:, 1:4] = arm @ first - skew(drive) @ rotation
    columns[..., 3:, 4:] = second
    W = np.moveaxis(columns, 1, 2).reshape(frames, 6, 10 * count)
    return W if sharing is None else W @ sharing


def regressor(body: Body, motion: Motion) -> Array:
    """Return W (T, 6, 10N) of ``body`` during ``motion``: ``W[t] @ sip.phi`` is the ground wrench about the lab origin
    (N, N·m).

    Parameters of segment i are columns 10i..10i+9 in Pinocchio's order [m, mc (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz] about
    the segment's joint frame. Gravity is the body's.
    """
    return regressor_of(segment_motion(body, motion), gravity=body.gravity, sharing=body.sharing)


def predict_wrench(body: Body, motion: Motion, phi: Array | None = None) -> Wrench:
    """Return the wrench that a motion needs from the ground.

    Parameters
    ----------
    body : Body
        Who moves, and under which gravity.
    motion : Motion
        At T instants.
    phi : numpy.ndarray, optional
        (10N,) inertial parameters, see `Sip`; by default the body's.

    Returns
    -------
    Wrench
        (T, 6) N, N·m ON the subject about the lab origin, force first.

    References
    ----------
    Ground wrench of a tree of rigid bodies, linear in the inertial parameters; docs/derivations.md.

    Examples
    --------
    >>> needed = biodance.predict_wrench(result.body, result["squat_1"].motion)
    >>> round(float(needed.force[:, 2].mean()), -1)
    610.0
    """
    W = regressor(body, motion)
    return Wrench(motion.time, W @ (body.sip.phi if phi is None else phi))
