"""What the joints do: torques from motion and ground wrenches, and the share of each foot where only the sum was
measured.

Equation of motion of a tree with a free root (M, h: inertia matrix and bias; f_k: wrench of the ground on segment k,
J_k its Jacobian):

    M(q) a + h(q, v) = [0; torque] + sum_k J_k' f_k

so that the torques are the lower rows of ``rnea - sum_k J_k' f_k``. The upper six are the residual: the wrench that
motion and parameters need but that was not measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body, load_pinocchio
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.ik.compiled.tree import fill_regressor, fill_wrench
from biodance.motion.kinematics import SegmentMotion, in_blocks, segment_motion
from biodance.records import CHANNELS, Array, Motion, Wrench, frozen_array
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_origin, wrench_about_point, zero_moment_point


@dataclass(frozen=True, eq=False)
class _JointTorques:
    """Joint torques and what remains at the root.

    ``time`` (T,) s; ``torque`` (T, n) N·m along the positive sense of each joint of the body, applied by the muscles;
    ``residual`` (T, 6) N, N·m about the lab origin, force first: needed minus applied wrench (T, 0 for a body with
    fixed root).
    """

    time: Array
    torque: Array
    residual: Array


def joint_torques(body: Body, motion: Motion, contacts: Mapping[str, Wrench]) -> _JointTorques:
    """Return the torques of ``motion`` under the wrenches that act on the named segments.

    ``contacts`` segment name -> wrench of the surroundings ON that segment, about the lab origin, at the times of the
    motion. The inertial parameters are ``body.sip``, gravity is the body's.

    Raises
    ------
    UnknownName
        A segment is not of this body.
    BiodanceError
        A wrench has other times than the motion.
    """
    for segment, wrench in contacts.items():
        if wrench.time.shape != motion.time.shape or not np.allclose(wrench.time, motion.time, rtol=0, atol=1e-6):
            raise BiodanceError(
                f"The wrench on {segment} has other times than the motion. Prepare the trial before tracking it."
            )
    pin = load_pinocchio()
    model = body.model
    data = model.createData()
    # Pinocchio's joint 0 is the universe, 1 the free root: the body's joint k is k + 2, or k + 1 without root.
    first = 2 if body.n_root else 1
    owner = {name: body.segment_joint[body.segment_index(name)] + first for name in contacts}
    root, total = body.n_root, np.empty((motion.time.size, body.nv))
    residual = np.empty((motion.time.size, root))
    for frame in range(motion.time.size):
        pin.forwardKinematics(model, data, motion.q[frame])
        applied = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
        for name, wrench in contacts.items():
            # Wrench about the lab origin to the joint's own frame: Pinocchio's external forces are local.
            applied[owner[name]] += data.oMi[owner[name]].actInv(pin.Force(wrench.value[frame]))
        total[frame] = pin.rnea(model, data, motion.q[frame], motion.v[frame], motion.a[frame], applied)
        if root:
            # The root's six generalised forces are a wrench in its frame; back to the lab origin.
            residual[frame] = data.oMi[1].act(pin.Force(total[frame, :6])).vector
    return _JointTorques(motion.time, total[:, root:], residual)


def distribute(total: Wrench, right: Array, left: Array, touching: NDArray[np.bool_]) -> tuple[Wrench, Wrench]:
    """Return the wrenches of the right and the left foot, whose sum is ``total``.

    ``right``, ``left`` (T, 3) m: centres of the soles, their z the height of the ground there; ``touching`` (T, 2) True
    where the right, the left foot stands. A foot alone takes all. With both feet down (or none) the shares are linear
    in the distances of the zero-moment point to the two centres, after Xiang et al. as cited for the paper's eq. 2:

        share_right = d_left / (d_right + d_left),    share_left = d_right / (d_right + d_left).

    The paper prints d_right over the sum for the right foot; that would load the foot FARTHER from the zero-moment
    point, so the two are exchanged here. The paper scales the whole wrench, which puts both feet's centres of pressure
    on the total's, often between the feet; here each foot's force acts at its own centre, both moved by the same small
    vector, so that forces and moments still add up exactly. With less than 20 N of vertical force (`COP_FORCE`)
    there is no zero-moment point: two halves.

    Raises
    ------
    BiodanceError
        An array has the wrong shape.
    """
    frames = total.time.size
    right, left = (
        frozen_array(right, (frames, 3), "distribute: right"),
        frozen_array(left, (frames, 3), "distribute: left"),
    )
    if np.shape(touching) != (frames, 2):
        raise BiodanceError(f"distribute: touching has shape {np.shape(touching)}, expected {(frames, 2)}.")
    share = _right_share(total, right, left, np.asarray(touching, dtype=bool))
    centre = share[:, None] * right + (1 - share[:, None]) * left
    point = zero_moment_point(total.value, height=centre[:, 2], threshold=COP_FORCE)
    # About the zero-moment point only the vertical moment is left: the twist.
    twist = wrench_about_point(total.value, point)[:, 3:] * np.array([0.0, 0.0, 1.0])
    loaded = np.isfinite(point)
    feet = []
    for part, place in ((share, right), (1 - share, left)):
        # Both places moved by the same vector: sum of share * place is the total's point, so moments add up.
        own = wrench_about_origin(np.concatenate([total.force, twist], axis=1), place + point - centre)
        # Without load there is no point: the moments are shared as they are.
        moment = np.where(loaded, own[:, 3:], total.moment)
        feet.append(Wrench(total.time, part[:, None] * np.concatenate([total.force, moment], axis=1)))
    return feet[0], feet[1]


def _right_share(total: Wrench, right: Array, left: Array, touching: NDArray[np.bool_]) -> Array:
    """Return the right foot's share (T,) of the total, between 0 and 1."""
    point = zero_moment_point(total.value, height=(right[:, 2] + left[:, 2]) / 2, threshold=COP_FORCE)
    d_right, d_left = (np.linalg.norm((point - centre)[:, :2], axis=1) for centre in (right, left))
    # Near its own centre a foot has nearly all: its share is the other foot's distance.
    shared = np.divide(d_left, d_right + d_left, out=np.full(total.time.size, 0.5), where=d_right + d_left > 0)
    return np.where(touching[:, 0] == touching[:, 1], shared, touching[:, 0].astype(float))


# For every segment with origin p, rotation R, angular velocity w and acceleration dw (lab frame) and origin
# acceleration a, with g the gravity vector, first moment h = R mc and inertia J = R I R' about the segment origin:
#
#     f = m (a - g) + dw x h + w x (w x h)
#     n = h x (a - g) + J dw + w x J w        (about the segment origin)
#
# and the wrench about the lab origin is [f; n + p x f]. Both are linear in [m, mc, I]: the columns of W.

_NEEDED: WeakKeyDictionary[Motion, WeakKeyDictionary[Body, Wrench]] = WeakKeyDictionary()
"""What motions need with a body's own parameters, kept as long as both live: many stages of a session ask for it."""


def regressor_of(segments: SegmentMotion, *, gravity: Array, sharing: Array | None = None) -> Array:
    """Return W (T, 6, 10N): wrench about the lab origin, force first, per unit of each parameter; ``gravity`` (3,)
    m/s², lab frame; ``sharing`` (10 M, 10 N) what each of the M links that move has of the N segments
    (``Body.sharing``; None: they are the segments).
    """
    frames, count = segments.position.shape[:2]
    W = np.zeros((frames, 6, 10 * count))
    # W is linear in a - g, so that gravity enters as an acceleration of the whole body.
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
    (10N,): the regressor times phi, without the regressor; what has no parameters costs nothing.
    """
    links = np.array(phi if body.sharing is None else body.sharing @ phi, dtype=float).reshape(-1, 10)
    heavy = np.flatnonzero(links.any(axis=1))
    turn, place, omega, alpha, drive = (
        part if heavy.size == len(links) else part.take(heavy, axis=1)
        for part in (move.rotation, move.position, move.angular_velocity, move.angular_acceleration, move.acceleration)
    )
    value = np.zeros((len(move.position), 6))
    fill_wrench(turn, place, omega, alpha, drive - body.gravity, links[heavy], value)
    return value


_LEAST_FRAMES = 3  # A correlation of fewer frames says nothing


@dataclass(frozen=True, eq=False)
class Agreement:
    """How two wrenches agree over ``frames`` frames.

    ``rms`` (6,) N, N·m, root mean square of the difference per channel Fx Fy Fz Mx My Mz; ``correlation`` (6)
    Pearson's, None where it is not defined; ``notes`` say why not.
    """

    frames: int
    rms: Array
    correlation: tuple[float | None, ...]
    notes: tuple[str, ...] = ()


def compare(measured: Wrench, simulated: Wrench, mask: NDArray[np.bool_] | None = None) -> Agreement:
    """Compare two wrenches of the same times over the frames where ``mask`` (T,) is True (all frames without it).

    Frames in which either wrench is not known (NaN) are left out, and said.

    Raises
    ------
    BiodanceError
        The two wrenches do not have the same times, or the mask has another length.
    TrialRefused
        No frame is left to compare.
    """
    if measured.time.shape != simulated.time.shape or not np.allclose(measured.time, simulated.time, rtol=0, atol=1e-6):
        raise BiodanceError(
            f"The wrenches have different times ({measured.time.size} and {simulated.time.size} frames). Prepare the "
            f"trial first."
        )
    chosen = np.ones(measured.time.size, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if chosen.shape != measured.time.shape:
        raise BiodanceError(f"The mask has {chosen.size} frames, the wrenches have {measured.time.size}.")
    known = np.isfinite(measured.value).all(axis=1) & np.isfinite(simulated.value).all(axis=1)
    used = chosen & known
    if not used.any():
        raise TrialRefused(
            f"No frame is left to compare: {chosen.sum()} of {chosen.size} may be used, and none of them is known in "
            f"both."
        )
    first, second = measured.value[used], simulated.value[used]
    rms = np.sqrt(np.mean((first - second) ** 2, axis=0))
    correlation = tuple(_pearson(a, b) for a, b in zip(first.T, second.T, strict=True))
    notes = [f"{int((chosen & ~known).sum())} frames left out: not known in both."] if np.any(chosen & ~known) else []
    flat = [name for name, value in zip(CHANNELS, correlation, strict=True) if value is None]
    if flat:
        why = f"only {used.sum()} frames" if used.sum() < _LEAST_FRAMES else "constant"
        notes.append(f"No correlation of {', '.join(flat)}: {why}.")
    return Agreement(int(used.sum()), rms, correlation, tuple(notes))


def _pearson(first: Array, second: Array) -> float | None:
    """Return Pearson's correlation of two signals (T,); None if one does not vary or there are too few samples."""
    if first.size < _LEAST_FRAMES:
        return None
    a, b = first - first.mean(), second - second.mean()
    # Constant up to rounding: a correlation would be that of the rounding.
    flat = [np.linalg.norm(centred) <= 1e-9 * np.linalg.norm(signal) for centred, signal in ((a, first), (b, second))]
    return None if any(flat) else float(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0))
