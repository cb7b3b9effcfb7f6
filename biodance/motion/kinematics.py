"""Forward kinematics of a Body for all frames at once, exact first derivatives of points on its segments, and
coordinates that change smoothly whenever the body does (ball joints as one rotation): for filters and interpolation.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import NO_SEGMENT
from biodance.motion.ik.compiled.ball_step import EQUAL_ANGLES
from biodance.motion.ik.compiled.tree import PlacedJoints, fill_places, fill_tangent, move_joints, place_joints
from biodance.records import Array, Index, Motion
from biodance.spatial import continuous_quaternion, cross, quaternion_matrix, skew, unit_quaternion

_BLOCK = 512
"""Frames worked on at once where little of what is computed is kept: little memory, whatever the length."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses in the lab frame: ``joint_rotation`` (T, n, 3, 3), ``joint_position`` (T, n, 3) m of the joint frames
    (after their angle); ``rotation`` (T, N, 3, 3), ``position`` (T, N, 3) m of the segment frames, with those of the
    body's parts behind them (N + P); ``root_rotation`` (T, 3, 3), ``root_position`` (T, 3) m.
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
        # sum over j of R[t, k, i, j] local[k, j], plus the origin.
        return np.einsum("tkij,kj->tki", self.rotation[:, index], local) + self.position[:, index]

    def at(self, some: slice) -> "Poses":
        """Return the poses in some of the frames."""
        return Poses(*(getattr(self, one.name)[some] for one in fields(self)))


def poses(body: Body, q: Array) -> Poses:
    """Return the poses of all joints and segments for positions ``q`` (T, nq)."""
    q = np.atleast_2d(q)
    frames, n = q.shape[0], len(body.joints)
    if body.n_root:
        root_rotation, root_position = np.ascontiguousarray(quaternion_matrix(q[:, 3:7])), np.array(q[:, :3])
    else:
        root_rotation, root_position = np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, 3))
    rotation, position = np.empty((frames, n, 3, 3)), np.empty((frames, n, 3))
    parent, turn, translation, _ = joint_arrays(body)
    angles = np.array(q[:, body.nq - n :])
    place_joints(parent, turn, translation, root_rotation, root_position, angles, rotation, position)
    segments = _of_segments(body, root_rotation, rotation), _of_segments(body, root_position, position)
    return Poses(rotation, position, *segments, root_rotation, root_position)


def in_blocks(motion: Motion) -> Iterator[tuple[slice, Motion]]:
    """Yield the motion in parts that need little memory, and the frames of each."""
    for start in range(0, motion.time.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        yield part, motion.at(part)


@dataclass(frozen=True, eq=False)
class SegmentMotion:
    """Segments in the lab frame, the body's parts behind them: ``rotation`` (T, N, 3, 3), ``position`` (T, N, 3) m of
    the segment origin, ``angular_velocity`` (T, N, 3) rad/s, ``angular_acceleration`` (T, N, 3) rad/s²,
    ``acceleration`` (T, N, 3) m/s² of the segment origin (gravity not included).
    """

    rotation: Array
    position: Array
    angular_velocity: Array
    angular_acceleration: Array
    acceleration: Array


def segment_motion(body: Body, motion: Motion, *, pose: Poses | None = None) -> SegmentMotion:
    """Return the spatial motion of all segments of ``body`` during ``motion``, whose ``pose`` may be known already."""
    pose = pose or poses(body, motion.q)
    frames, n = motion.time.size, len(body.joints)
    w_root, dw_root, acc_root = np.zeros((frames, 3)), np.zeros((frames, 3)), np.zeros((frames, 3))
    if body.n_root:
        linear, angular = motion.v[:, :3], motion.v[:, 3:6]
        turn = pose.root_rotation
        w_root = np.einsum("tij,tj->ti", turn, angular)
        dw_root = np.einsum("tij,tj->ti", turn, motion.a[:, 3:6])
        # Pinocchio's a is the derivative of v in the root's own, turning frame: + w x v.
        acc_root = np.einsum("tij,tj->ti", turn, motion.a[:, :3] + cross(angular, linear))
    rate, rate2 = np.array(motion.v[:, body.n_root :]), np.array(motion.a[:, body.n_root :])
    root = np.stack([w_root, dw_root, acc_root, pose.root_position])
    parent, _, _, axis = joint_arrays(body)
    omega, alpha, acc = moved = np.empty((3, frames, n, 3))
    move_joints(parent, axis, pose.joint_rotation, pose.joint_position, root, rate, rate2, moved)
    pairs = (w_root, omega), (dw_root, alpha), (acc_root, acc)
    return SegmentMotion(pose.rotation, pose.position, *(_of_segments(body, *pair) for pair in pairs))


def _of_segments(body: Body, root: Array, joints: Array) -> Array:
    """Return (T, N + P, ...) what segments, then parts, have of ``root`` (T, ...) and ``joints`` (T, n, ...)."""
    carrier = np.array(body.segment_joint)
    if not body.joints:
        return np.repeat(root[:, None], carrier.size, axis=1)
    # Segments of the root have joint -1: index 0 is a stand-in that is overwritten.
    found = joints.take(np.maximum(carrier, 0), axis=1)
    found[:, carrier < 0] = root[:, None]
    return found


def centre_of_mass(body: Body, motion: Motion) -> Array:
    """Return the centre of mass (T, 3) m of ``body`` with its own parameters during ``motion``."""
    table = body.link_parameters().reshape(-1, 10)
    mass = table[:, 0]
    carried = np.flatnonzero(mass > 0)
    places, found = table[carried, 1:4] / mass[carried, None], np.empty((motion.time.size, 3))
    for part, frames in in_blocks(motion):
        points = poses(body, frames.q).points(carried.tolist(), places)
        found[part] = np.einsum("k,tkj->tj", mass[carried], points) / mass[carried].sum()
    return found


@lru_cache(maxsize=8)
def joint_arrays(body: Body) -> tuple[Index, Array, Array, Array]:
    """Return the joints of ``body`` as compiled code takes them: parent (n,), -1 the root; the three terms (n, 3, 3, 3)
    of the rotation, which is term 0 + sin term 1 + (1 - cos) term 2; translation (n, 3) m; axis (n, 3).
    """
    axis = np.array([joint.axis for joint in body.joints], dtype=float).reshape(-1, 3)
    fixed = np.array([joint.rotation for joint in body.joints], dtype=float).reshape(-1, 3, 3)
    # Rodrigues: R = F (1 + sin K + (1 - cos) K²), K = [axis]x, F the fixed placement.
    sine = fixed @ skew(axis)
    turn = np.stack([fixed, sine, sine @ skew(axis)], axis=1)
    translation = np.array([joint.translation for joint in body.joints], dtype=float).reshape(-1, 3)
    return np.array([joint.parent for joint in body.joints], dtype=np.intp), turn, translation, axis


@lru_cache(maxsize=8)
def below(body: Body) -> Array:
    """Return (n, N + P) 1 where a joint moves a segment or a part of one, else 0; read-only."""
    table = np.zeros((len(body.joints), len(body.segment_joint)))
    for link in range(table.shape[1]):
        table[list(body.path_to(link)), link] = 1.0
    table.setflags(write=False)
    return table


@lru_cache(maxsize=8)
def chains(body: Body) -> tuple[tuple[int, ...], ...]:
    """Return the axes of every anatomical joint, first to last."""
    found = []
    for last in body.segment_joint:
        chain: list[int] = []
        while last >= 0:
            chain.append(last)
            last = body.joints[last].parent
            # A chain ends where a joint before carries a segment: its other axes are massless.
            if last < 0 or body.joints[last].segment >= 0:
                break
        if chain:
            found.append(tuple(reversed(chain)))
    return tuple(found)


def neighbours(body: Body) -> Array:
    """Return (n, N + P) 1 where an anatomical joint (all its axes) is at an end of one of the `Body.links`."""
    table = np.zeros((len(body.joints), len(body.links)))
    for chain in chains(body):
        child, above = body.joints[chain[-1]].segment, body.joints[chain[0]].parent
        table[np.ix_(chain, (child, 0 if above < 0 else body.joints[above].segment))] = 1.0
    return table


def jacobian(body: Body, pose: Poses, segment: list[int], points: Array) -> tuple[Array, Array]:
    """Return (T, 3S, nv) of points (T, S, 3) on segments and of their turn, per unit of the lab-frame tangent [root
    place, root turn, angles].
    """
    turn = np.zeros((*points.shape, body.nv))
    if body.n_root:
        turn[..., 3:6] = np.eye(3)
    for j, hangs in enumerate(below(body)[:, segment]):
        # Every segment that hangs on a joint turns about its axis, in the lab.
        turn[..., body.n_root + j][:, hangs > 0] = (pose.joint_rotation[:, j] @ body.joints[j].axis)[:, None]
    return place_jacobian(body, pose, segment, points), turn.reshape(len(turn), -1, body.nv)


def place_jacobian(body: Body, pose: Poses, segment: list[int], points: Array) -> Array:
    """Return (T, 3S, nv) of points (T, S, 3) on segments, the first of `jacobian`."""
    place = np.zeros((*points.shape, body.nv))
    hangs = np.ascontiguousarray(below(body)[:, segment] > 0)
    fill_places(hangs, _placed_joints(body, pose), np.ascontiguousarray(points), place)
    return place.reshape(len(place), -1, body.nv)


def tangent_of(body: Body, pose: Poses, com: Array, place: Array, turn: Array) -> Array:
    """Return (T, L, nv): what each coordinate, as in `jacobian`, does to L functionals that are ``place`` (T, N, L, 3)
    of the moved ``com`` (T, N, 3) m of the body's segments and ``turn`` (T, N, L, 3) of their turn.
    """
    tangent = np.zeros((len(com), place.shape[2], body.nv))
    hangs = np.ascontiguousarray(below(body)[:, : com.shape[1]] > 0)
    com, place, turn = (np.ascontiguousarray(one) for one in (com, place, turn))
    fill_tangent(hangs, _placed_joints(body, pose), com, place, turn, tangent)
    return tangent


def _placed_joints(body: Body, pose: Poses) -> PlacedJoints:
    """Return the joints as the compiled code takes them: contiguous arrays, so that there is one type of them."""
    known = pose.joint_rotation, pose.joint_position, pose.root_position
    rotation, origin, root = (np.ascontiguousarray(one) for one in known)
    return PlacedJoints(joint_arrays(body)[3], rotation, origin, root, body.n_root)


_NO_LIMIT = np.array([[-np.inf]])


def continued(quaternion: Array) -> Array:
    """Return ``quaternion`` (4, ..., B) of unit size, without jumps of sign along the last axis."""
    last = np.moveaxis(quaternion, 0, -1)
    return np.moveaxis(continuous_quaternion(unit_quaternion(last)), -1, 0)


def _unit(quaternion: Array) -> Array:
    return np.moveaxis(unit_quaternion(np.moveaxis(quaternion, 0, -1)), -1, 0)


def _ball_angles(quaternion: Array, sign: Array, near: Array, lower: Array, upper: Array) -> Array:
    """Return the Cardan angles (3, G, B) rad of unit quaternions (4, G, B); of both sets the one less outside the
    limits (3, G, B or 1), if alike the one closer to ``near``.
    """
    x, y, z, w = quaternion
    # Cardan angles x, y, z of R = R1 R2 R3: sin of the second is R[0, 2] = 2 (x z + y w).
    sine = np.clip(2 * (x * z + y * w), -1.0, 1.0)
    one = np.stack(
        [
            np.arctan2(2 * (x * w - y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(sine),
            np.arctan2(2 * (z * w - x * y), 1 - 2 * (y * y + z * z)),
        ]
    )
    with np.errstate(invalid="ignore"):  # of joints without limits
        middle = np.where(upper - lower < 2 * np.pi, (lower + upper) / 2, near)
    # (pi + a, pi - b, pi + c) is the same rotation.
    other = np.pi + np.array([1.0, -1.0, 1.0])[:, None, None] * one
    # Full turns added, within half a turn of the middle.
    both = [middle + (sign * angles - middle + np.pi) % (2 * np.pi) - np.pi for angles in (one, other)]
    more = [np.maximum(np.maximum(lower - angles, angles - upper), 0.0).sum(axis=0) for angles in both]
    away = [np.abs(angles - near).sum(axis=0) for angles in both]
    better = (more[1] < more[0] - EQUAL_ANGLES) | ((more[1] < more[0] + EQUAL_ANGLES) & (away[1] < away[0]))
    return np.where(better, both[1], both[0])


@dataclass(frozen=True, eq=False)
class Smooth:
    """B postures: ``place`` (3, B) m and ``root`` (4, B) quaternion, (0, B) for a fixed root; ``ball`` (4, G, B);
    ``angle`` (m, B) rad.
    """

    place: Array
    root: Array
    ball: Array
    angle: Array

    def stacked(self) -> Array:
        """Return all numbers as one array (3 + 4 + 4 G + m, B)."""
        return np.concatenate([self.place, self.root, self.ball.reshape(-1, self.angle.shape[1]), self.angle])

    def at(self, some: slice) -> "Smooth":
        """Return some of the postures."""
        return Smooth(self.place[:, some], self.root[:, some], self.ball[..., some], self.angle[:, some])


@dataclass(frozen=True, eq=False)
class Chart:
    """Maps q to smooth coordinates and back: ``ball`` (3, G) the joints of the G ball joints, ``sign`` (G, 1) of their
    handedness, ``single`` (m,) the other joints.
    """

    ball: Index
    sign: Array
    single: Index
    n_root: int

    @property
    def joint_count(self) -> int:
        """Number of joints n."""
        return self.single.size + self.ball.size

    def smooth(self, q: Array) -> Smooth:
        """Return the smooth coordinates of ``q`` (nq, B), B consecutive frames, signs and turns continued."""
        angles = q[7:] if self.n_root else q
        root = continued(q[3:7]) if self.n_root else q[:0]
        # Half angles; mirrored axes turn by the negative angle in their own, right-handed triad.
        half = 0.5 * self.sign * angles[self.ball]
        (s1, s2, s3), (c1, c2, c3) = np.sin(half), np.cos(half)
        c23, s23, sc, cs = c2 * c3, s2 * s3, s2 * c3, c2 * s3
        # Product of the three quaternions about x, y, z, written out.
        ball = continued(np.stack([s1 * c23 + c1 * s23, c1 * sc - s1 * cs, c1 * cs + s1 * sc, c1 * c23 - s1 * s23]))
        return Smooth(q[:3] if self.n_root else q[:0], root, ball, np.unwrap(angles[self.single], axis=-1))

    def turns(self, q: Array) -> Array:
        """Return (n, B) how far every joint is turned in ``q`` (nq, B), B consecutive frames: the angle of a single
        one, 2 sin(theta / 2) u of a ball joint that is turned by theta about u.

        Small turns are the angles. Cardan angles jump where an arm is raised (their middle axis at a right angle); what
        goes with a joint, as skin does, does not.
        """
        smooth, turns = self.smooth(q), np.empty((self.joint_count, q.shape[1]))
        turns[self.single] = smooth.angle
        if q.shape[1]:
            # A quaternion and its negative are one turn: the one of less than half a turn, nearest to neutral.
            scalar = smooth.ball[3]
            sign = np.sign(np.take_along_axis(scalar, np.abs(scalar).argmax(axis=1)[:, None], axis=1))
            turns[self.ball] = 2 * sign * self.sign * smooth.ball[:3]
        return turns

    def split(self, stacked: Array) -> Smooth:
        """Return the parts of ``stacked`` (3 + 4 + 4 G + m, B), as they are."""
        root, count = (3, 7) if self.n_root else (0, 0), self.ball.shape[1]
        ball = stacked[root[1] : root[1] + 4 * count].reshape(4, count, stacked.shape[1])
        return Smooth(stacked[: root[0]], stacked[root[0] : root[1]], ball, stacked[root[1] + 4 * count :])

    def posture(self, smooth: Smooth, near: Array, lower: Array = _NO_LIMIT, upper: Array = -_NO_LIMIT) -> Array:
        """Return q (nq, B); of equal sets of Cardan angles the one less outside the limits (n, 1), if alike the one
        closer to ``near`` (n, B) rad is taken.
        """
        angles = np.empty_like(near)
        angles[self.single] = smooth.angle
        limits = (np.broadcast_to(one, (len(near), 1))[self.ball] for one in (lower, upper))
        angles[self.ball] = _ball_angles(_unit(smooth.ball), self.sign, near[self.ball], *limits)
        return np.concatenate([smooth.place, _unit(smooth.root), angles]) if self.n_root else angles


@lru_cache(maxsize=8)
def chart_of(body: Body) -> Chart:
    """Return the chart of ``body``."""
    first, sign = [], []
    parents = [joint.parent for joint in body.joints]
    for i in range(len(body.joints) - 2):
        one, two, three = body.joints[i : i + 3]
        in_a_row = two.parent == i and three.parent == i + 1 and parents.count(i) == parents.count(i + 1) == 1
        if not (in_a_row and one.segment == two.segment == NO_SEGMENT):
            continue
        axes = np.array([joint.axis for joint in (one, two, three)])
        # Meeting in one point, no rotation between, and square to each other: a ball joint.
        turns = np.array([two.rotation, three.rotation, axes @ axes.T])
        apart = np.abs([two.translation, three.translation]).max(), np.abs(turns - np.eye(3)).max()
        # Places (m) and entries of rotation matrices that differ by less are equal.
        if max(apart) < 1e-8:
            first.append(i)
            # +1 or -1: axes of the left side are mirrored, and turn the other way about each.
            sign.append(np.linalg.det(axes))
    ball = np.array(first, dtype=np.intp) + np.arange(3)[:, None]
    single = np.setdiff1d(np.arange(len(body.joints)), ball)
    return Chart(ball, np.round(np.array(sign).reshape(-1, 1)), single, body.n_root)
