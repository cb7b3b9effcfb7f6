"""The root regressor: the ground wrench that a motion needs, linear in the standard inertial parameters (paper eq. 3,
upper part).

For every segment with origin p, rotation R, angular velocity w and acceleration dw (lab frame) and origin acceleration
a, with g the gravity vector, first moment h = R mc and inertia J = R I R' about the segment origin:

    f = m (a - g) + dw x h + w x (w x h)
    n = h x (a - g) + J dw + w x J w        (about the segment origin)

and the wrench about the lab origin is [f; n + p x f]. Both are linear in [m, mc, I]: the columns of W.
"""

from weakref import WeakKeyDictionary

import numpy as np

from biodance.body.body import Body
from biodance.motion.ik.compiled.tree import fill_regressor, fill_wrench
from biodance.motion.kinematics import SegmentMotion, in_blocks, segment_motion
from biodance.records import Array, Motion, Wrench

_NEEDED: WeakKeyDictionary[Motion, WeakKeyDictionary[Body, Wrench]] = WeakKeyDictionary()
"""What motions need with a body's own parameters, kept as long as both live: many stages of a session ask for it."""


def regressor_of(segments: SegmentMotion, *, gravity: Array, sharing: Array | None = None) -> Array:
    """Return W (T, 6, 10N): wrench about the lab origin, force first, per unit of each parameter; ``gravity`` (3,)
    m/s², lab frame; ``sharing`` (10 M, 10 N) what each of the M links that move has of the N segments
    (``Body.sharing``; None: they are the segments).
    """
    frames, count = segments.position.shape[:2]
    W = np.zeros((frames, 6, 10 * count))
    omega, alpha, drive = segments.angular_velocity, segments.angular_acceleration, segments.acceleration - gravity
    fill_regressor(segments.rotation, segments.position, omega, alpha, drive, W)
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
    if phi is not None:
        return _predicted(body, motion, phi)
    kept = _NEEDED.setdefault(motion, WeakKeyDictionary())
    if body not in kept:
        kept[body] = _predicted(body, motion, body.sip.phi)
    return kept[body]


def _predicted(body: Body, motion: Motion, phi: Array) -> Wrench:
    value = np.empty((motion.time.size, 6))
    for part, frames in in_blocks(motion):
        value[part] = wrench_of_segments(body, segment_motion(body, frames), phi)
    return Wrench(motion.time, value)


def wrench_of_segments(body: Body, move: SegmentMotion, phi: Array) -> Array:
    """Return the wrench (T, 6) about the lab origin that segments which ``move`` need with the parameters ``phi``
    (10N,): the regressor times phi, without the regressor.
    """
    links = np.array(phi if body.sharing is None else body.sharing @ phi, dtype=float).reshape(-1, 10)
    value, drive = np.zeros((len(move.position), 6)), move.acceleration - body.gravity
    fill_wrench(move.rotation, move.position, move.angular_velocity, move.angular_acceleration, drive, links, value)
    return value
