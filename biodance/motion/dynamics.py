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

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.pinocchio_model import load_pinocchio
from biodance.errors import BiodanceError
from biodance.records import Array, Motion, Wrench, frozen_array
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_origin, wrench_about_point, zero_moment_point


@dataclass(frozen=True, eq=False)
class JointTorques:
    """Joint torques and what remains at the root.

    ``time`` (T,) s; ``torque`` (T, n) N·m along the positive sense of each joint of the body, applied by the muscles;
    ``residual`` (T, 6) N, N·m about the lab origin, force first: needed minus applied wrench (T, 0 for a body with
    fixed root).
    """

    time: Array
    torque: Array
    residual: Array


def joint_torques(body: Body, motion: Motion, contacts: Mapping[str, Wrench]) -> JointTorques:
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
    first = 2 if body.n_root else 1
    owner = {name: body.segment_joint[body.segment_index(name)] + first for name in contacts}
    root, total = body.n_root, np.empty((motion.time.size, body.nv))
    residual = np.empty((motion.time.size, root))
    for frame in range(motion.time.size):
        pin.forwardKinematics(model, data, motion.q[frame])
        applied = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
        for name, wrench in contacts.items():
            applied[owner[name]] += data.oMi[owner[name]].actInv(pin.Force(wrench.value[frame]))
        total[frame] = pin.rnea(model, data, motion.q[frame], motion.v[frame], motion.a[frame], applied)
        if root:
            residual[frame] = data.oMi[1].act(pin.Force(total[frame, :6])).vector
    return JointTorques(motion.time, total[:, root:], residual)


def distribute(
    total: Wrench, right: Array, left: Array, touching: NDArray[np.bool_], *, threshold: float = COP_FORCE
) -> tuple[Wrench, Wrench]:
    """Return the wrenches of the right and the left foot, whose sum is ``total``.

    ``right``, ``left`` (T, 3) m: centres of the soles, their z the height of the ground there; ``touching`` (T, 2) True
    where the right, the left foot stands. A foot alone takes all. With both feet down (or none) the shares are linear
    in the distances of the zero-moment point to the two centres, after Xiang et al. as cited for the paper's eq. 2:

        share_right = d_left / (d_right + d_left),    share_left = d_right / (d_right + d_left).

    The paper prints d_right over the sum for the right foot; that would load the foot FARTHER from the zero-moment
    point, so the two are exchanged here. The paper scales the whole wrench, which puts both feet's centres of pressure
    on the total's, often between the feet; here each foot's force acts at its own centre, both moved by the same small
    vector, so that forces and moments still add up exactly. With less than ``threshold`` N of vertical force there is
    no zero-moment point: two halves.

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
    share = _right_share(total, right, left, np.asarray(touching, dtype=bool), threshold)
    centre = share[:, None] * right + (1 - share[:, None]) * left
    point = zero_moment_point(total.value, height=centre[:, 2], threshold=threshold)
    twist = wrench_about_point(total.value, point)[:, 3:] * np.array([0.0, 0.0, 1.0])
    loaded = np.isfinite(point)
    feet = []
    for part, place in ((share, right), (1 - share, left)):
        own = wrench_about_origin(np.concatenate([total.force, twist], axis=1), place + point - centre)
        moment = np.where(loaded, own[:, 3:], total.moment)
        feet.append(Wrench(total.time, part[:, None] * np.concatenate([total.force, moment], axis=1)))
    return feet[0], feet[1]


def _right_share(total: Wrench, right: Array, left: Array, touching: NDArray[np.bool_], threshold: float) -> Array:
    """Return the right foot's share (T,) of the total, between 0 and 1."""
    point = zero_moment_point(total.value, height=(right[:, 2] + left[:, 2]) / 2, threshold=threshold)
    d_right, d_left = (np.linalg.norm((point - centre)[:, :2], axis=1) for centre in (right, left))
    shared = np.divide(d_left, d_right + d_left, out=np.full(total.time.size, 0.5), where=d_right + d_left > 0)
    return np.where(touching[:, 0] == touching[:, 1], shared, touching[:, 0].astype(float))
