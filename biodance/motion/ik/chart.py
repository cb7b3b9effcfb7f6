"""Ball joints as one rotation, and coordinates that change smoothly whenever the body does: for filters and
interpolation.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import NO_SEGMENT
from biodance.records import Array, Index
from biodance.spatial import continuous_quaternion, unit_quaternion


@dataclass(frozen=True, eq=False)
class Balls:
    """G ball joints: ``first`` (G,) index of each one's first joint, ``sign`` (G, 1) of their handedness."""

    first: np.ndarray
    sign: Array

    def angles_of(self, angles: Array) -> Array:
        """Return (3, G, B) rad from the angles of all joints (n, B)."""
        return np.stack([angles[self.first + k] for k in range(3)])


_SAME = 1e-8  # m, and of the entries of rotation matrices: what differs by less is equal


def balls(body: Body) -> Balls:
    """Return the ball joints of ``body``."""
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
        if max(apart) < _SAME:
            first.append(i)
            # +1 or -1: axes of the left side are mirrored, and turn the other way about each.
            sign.append(np.linalg.det(axes))
    return Balls(np.array(first, dtype=np.intp), np.round(np.array(sign).reshape(-1, 1)))


def continued(quaternion: Array) -> Array:
    """Return ``quaternion`` (4, ..., B) of unit size, without jumps of sign along the last axis."""
    last = np.moveaxis(quaternion, 0, -1)
    return np.moveaxis(continuous_quaternion(unit_quaternion(last)), -1, 0)


def _unit(quaternion: Array) -> Array:
    return np.moveaxis(unit_quaternion(np.moveaxis(quaternion, 0, -1)), -1, 0)


def _ball_angles(quaternion: Array, sign: Array, near: Array) -> Array:
    """Return the Cardan angles (3, G, B) rad of unit quaternions (4, G, B)."""
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
    first = _turned_near(sign * one, near)
    # (pi + a, pi - b, pi + c) is the same rotation.
    other = _turned_near(sign * (np.pi + np.array([1.0, -1.0, 1.0])[:, None, None] * one), near)
    away, other_away = (np.abs(angles - near).sum(axis=0) for angles in (first, other))
    return np.where(other_away < away, other, first)


def _turned_near(angles: Array, middle: Array) -> Array:
    """Return ``angles`` plus full turns, within half a turn of ``middle``."""
    return middle + (angles - middle + np.pi) % (2 * np.pi) - np.pi


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
    """Maps q to smooth coordinates and back: ``joints`` the ball joints, ``single`` (m,) the others."""

    joints: Balls
    single: Index
    n_root: int

    @property
    def joint_count(self) -> int:
        """Number of joints n."""
        return len(self.single) + 3 * len(self.joints.first)

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return self.joint_count + (7 if self.n_root else 0)

    def smooth(self, q: Array) -> Smooth:
        """Return the smooth coordinates of ``q`` (nq, B), B consecutive frames, signs and turns continued."""
        angles = q[7:] if self.n_root else q
        root = continued(q[3:7]) if self.n_root else q[:0]
        # Half angles; mirrored axes turn by the negative angle in their own, right-handed triad.
        half = 0.5 * self.joints.sign * self.joints.angles_of(angles)
        (s1, s2, s3), (c1, c2, c3) = np.sin(half), np.cos(half)
        c23, s23, sc, cs = c2 * c3, s2 * s3, s2 * c3, c2 * s3
        # Product of the three quaternions about x, y, z, written out.
        ball = continued(np.stack([s1 * c23 + c1 * s23, c1 * sc - s1 * cs, c1 * cs + s1 * sc, c1 * c23 - s1 * s23]))
        return Smooth(q[:3] if self.n_root else q[:0], root, ball, np.unwrap(angles[self.single], axis=-1))

    def split(self, stacked: Array) -> Smooth:
        """Return the parts of ``stacked`` (3 + 4 + 4 G + m, B), as they are."""
        root, count = (3, 7) if self.n_root else (0, 0), 4 * self.joints.first.size
        ball = stacked[root[1] : root[1] + count].reshape(4, count // 4, stacked.shape[1])
        return Smooth(stacked[: root[0]], stacked[root[0] : root[1]], ball, stacked[root[1] + count :])

    def posture(self, smooth: Smooth, near: Array) -> Array:
        """Return q (nq, B); of equal sets of Cardan angles the one closer to ``near`` (n, B) rad is taken."""
        angles = np.empty_like(near)
        angles[self.single] = smooth.angle
        ball = _ball_angles(_unit(smooth.ball), self.joints.sign, self.joints.angles_of(near))
        for k in range(3):
            angles[self.joints.first + k] = ball[k]
        return np.concatenate([smooth.place, _unit(smooth.root), angles]) if self.n_root else angles


@lru_cache(maxsize=8)
def chart_of(body: Body) -> Chart:
    """Return the chart of ``body``."""
    joints = balls(body)
    in_balls = np.concatenate([joints.first + k for k in range(3)])
    return Chart(joints, np.setdiff1d(np.arange(len(body.joints)), in_balls), body.n_root)
