"""Coordinates in which a posture may be interpolated and filtered: numbers that change smoothly whenever the body does.

Root position, root quaternion, the quaternion of every ball joint (its Cardan angles may jump while the limb hardly moves, see ``ball``)
and the angles of all other joints. The frame is the last axis.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.motion.ball import Balls, angles_of, balls, quaternion_of
from biodance.motion.quaternion import continuous, normalised
from biodance.records import Array, Index


@dataclass(frozen=True, eq=False)
class Smooth:
    """B postures: ``place`` (3, B) m and ``root`` (4, B) quaternion, (0, B) for a fixed root; ``ball`` (4, G, B); ``angle`` (m, B) rad."""

    place: Array
    root: Array
    ball: Array
    angle: Array

    def stacked(self) -> Array:
        """Return all numbers as one array (3 + 4 + 4 G + m, B)."""
        return np.concatenate([self.place, self.root, self.ball.reshape(-1, self.angle.shape[1]), self.angle])


@dataclass(frozen=True, eq=False)
class Chart:
    """Maps q to smooth coordinates and back: ``joints`` the ball joints, ``single`` (m,) the others, limits (3, G, 1) rad of the balls."""

    joints: Balls
    single: Index
    lower: Array
    upper: Array
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
        """Return the smooth coordinates of ``q`` (nq, B), B consecutive frames (signs and full turns are continued along them)."""
        angles = q[7:] if self.n_root else q
        root = continuous(q[3:7]) if self.n_root else q[:0]
        ball = continuous(quaternion_of(self.joints.angles_of(angles), self.joints.sign))
        return Smooth(q[:3] if self.n_root else q[:0], root, ball, np.unwrap(angles[self.single], axis=-1))

    def split(self, stacked: Array) -> Smooth:
        """Return the parts of ``stacked`` (3 + 4 + 4 G + m, B), as they are."""
        root, count = (3, 7) if self.n_root else (0, 0), 4 * self.joints.first.size
        ball = stacked[root[1] : root[1] + count].reshape(4, count // 4, stacked.shape[1])
        return Smooth(stacked[: root[0]], stacked[root[0] : root[1]], ball, stacked[root[1] + count :])

    def posture(self, smooth: Smooth, near: Array) -> Array:
        """Return q (nq, B); quaternions are normalised here; ``near`` (n, B) rad decides between equal sets of Cardan angles."""
        angles = np.empty_like(near)
        angles[self.single] = smooth.angle
        ball = angles_of(normalised(smooth.ball), self.joints.sign, self.joints.angles_of(near), self.lower, self.upper)
        for k in range(3):
            angles[self.joints.first + k] = ball[k]
        return np.concatenate([smooth.place, normalised(smooth.root), angles]) if self.n_root else angles


def chart_of(body: Body) -> Chart:
    """Return the chart of ``body``."""
    joints, limits = balls(body), body.limits
    in_balls = np.concatenate([joints.first + k for k in range(3)])
    return Chart(
        joints,
        np.setdiff1d(np.arange(len(body.joints)), in_balls),
        joints.angles_of(limits.lower[:, None]),
        joints.angles_of(limits.upper[:, None]),
        body.n_root,
    )
