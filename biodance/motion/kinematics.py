"""Forward kinematics of a Body for all frames at once, and exact first derivatives of points on its segments."""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.records import Array, Motion
from biodance.spatial import axis_rotation, cross, quaternion_matrix, skew


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses in the lab frame: ``joint_rotation`` (T, n, 3, 3), ``joint_position`` (T, n, 3) m of the joint frames
    (after their angle); ``rotation`` (T, N, 3, 3), ``position`` (T, N, 3) m of the segment frames; ``root_rotation``
    (T, 3, 3), ``root_position`` (T, 3) m.
    """

    joint_rotation: Array
    joint_position: Array
    rotation: Array
    position: Array
    root_rotation: Array
    root_position: Array

    def points(self, segment: tuple[int, ...] | list[int], local: Array) -> Array:
        """Return the lab positions (T, K, 3) m of points ``local`` (K, 3) fixed in the given segments (K)."""
        index = list(segment)
        return np.einsum("tkij,kj->tki", self.rotation[:, index], local) + self.position[:, index]


def poses(body: Body, q: Array) -> Poses:
    """Return the poses of all joints and segments for positions ``q`` (T, nq)."""
    q = np.atleast_2d(q)
    frames, n = q.shape[0], len(body.joints)
    if body.n_root:
        root_rotation, root_position = quaternion_matrix(q[:, 3:7]), q[:, :3]
    else:
        root_rotation, root_position = np.broadcast_to(np.eye(3), (frames, 3, 3)), np.zeros((frames, 3))
    rotation, position = np.empty((frames, n, 3, 3)), np.empty((frames, n, 3))
    angles = q[:, body.nq - n :]
    for i, joint in enumerate(body.joints):
        parent_r, parent_p = (
            (root_rotation, root_position)
            if joint.parent < 0
            else (rotation[:, joint.parent], position[:, joint.parent])
        )
        rotation[:, i] = parent_r @ (joint.rotation @ axis_rotation(joint.axis, angles[:, i]))
        position[:, i] = parent_p + parent_r @ joint.translation
    carrier = body.segment_joint
    seg_r = np.stack([root_rotation if j < 0 else rotation[:, j] for j in carrier], axis=1)
    seg_p = np.stack([root_position if j < 0 else position[:, j] for j in carrier], axis=1)
    return Poses(rotation, position, seg_r, seg_p, root_rotation, root_position)


@dataclass(frozen=True, eq=False)
class SegmentMotion:
    """Segments in the lab frame: ``rotation`` (T, N, 3, 3), ``position`` (T, N, 3) m of the segment origin,
    ``angular_velocity`` (T, N, 3) rad/s, ``angular_acceleration`` (T, N, 3) rad/s²,
    ``acceleration`` (T, N, 3) m/s² of the segment origin (gravity not included).
    """

    rotation: Array
    position: Array
    angular_velocity: Array
    angular_acceleration: Array
    acceleration: Array


def segment_motion(body: Body, motion: Motion) -> SegmentMotion:
    """Return the spatial motion of all segments of ``body`` during ``motion``."""
    pose = poses(body, motion.q)
    frames, n = motion.time.size, len(body.joints)
    w_root, dw_root, acc_root = np.zeros((frames, 3)), np.zeros((frames, 3)), np.zeros((frames, 3))
    if body.n_root:
        linear, angular = motion.v[:, :3], motion.v[:, 3:6]
        turn = pose.root_rotation
        w_root = np.einsum("tij,tj->ti", turn, angular)
        dw_root = np.einsum("tij,tj->ti", turn, motion.a[:, 3:6])
        acc_root = np.einsum("tij,tj->ti", turn, motion.a[:, :3] + cross(angular, linear))
    omega, alpha, acc = (np.empty((frames, n, 3)) for _ in range(3))
    rate, rate2 = motion.v[:, body.n_root :], motion.a[:, body.n_root :]
    for i, joint in enumerate(body.joints):
        p = joint.parent
        w, dw, a0, x0 = (
            (w_root, dw_root, acc_root, pose.root_position)
            if p < 0
            else (omega[:, p], alpha[:, p], acc[:, p], pose.joint_position[:, p])
        )
        arm = pose.joint_position[:, i] - x0
        axis = pose.joint_rotation[:, i] @ joint.axis
        acc[:, i] = a0 + cross(dw, arm) + cross(w, cross(w, arm))
        spin = axis * rate[:, i, None]
        omega[:, i] = w + spin
        alpha[:, i] = dw + axis * rate2[:, i, None] + cross(w, spin)
    pick = body.segment_joint

    def gather(root: Array, joints: Array) -> Array:
        return np.stack([root if j < 0 else joints[:, j] for j in pick], axis=1)

    return SegmentMotion(
        pose.rotation, pose.position, gather(w_root, omega), gather(dw_root, alpha), gather(acc_root, acc)
    )


def centre_of_mass(body: Body, motion: Motion) -> Array:
    """Return the centre of mass (T, 3) m of ``body`` with its own parameters during ``motion``."""
    mass = body.sip.mass
    carried = np.flatnonzero(mass > 0)
    points = poses(body, motion.q).points(carried.tolist(), body.sip.com[carried])
    return np.einsum("k,tkj->tj", mass[carried], points) / mass[carried].sum()


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


def jacobian(body: Body, pose: Poses, segment: list[int], points: Array) -> tuple[Array, Array]:
    """Return (T, 3S, nv) of points (T, S, 3) on segments and of their turn, per unit of the lab-frame tangent [root
    place, root turn, angles].
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
        place[..., body.n_root + j][:, on] = cross(axis, points[:, on] - pose.joint_position[:, j, None])
        turn[..., body.n_root + j][:, on] = axis
    return place.reshape(frames, 3 * count, body.nv), turn.reshape(frames, 3 * count, body.nv)
