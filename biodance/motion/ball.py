"""Ball joints: three joints in a row about orthogonal axes through one point, whose angles are Cardan angles of one rotation.

Their angles are what a Body is described by, but a poor measure of nearness: where the second angle comes near 90 deg (an arm held out
sideways) the first and the third axis fall together and a small turn needs large angles. Steps and smoothing therefore work on the
rotation. With the axes a1, a2, a3 as basis, right-handed (sign +1) or left-handed (-1), the joint is Rx(sign t1) Ry(sign t2) Rz(sign t3).
Batches have the frame as the last axis.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import NO_SEGMENT, Body
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Balls:
    """G ball joints: ``first`` (G,) index of the first of the three joints, ``sign`` (G, 1) of their axes' handedness."""

    first: np.ndarray
    sign: Array

    def angles_of(self, angles: Array) -> Array:
        """Return (3, G, B) rad from the angles of all joints (n, B)."""
        return np.stack([angles[self.first + k] for k in range(3)])


def balls(body: Body) -> Balls:
    """Return the ball joints of ``body``."""
    first, sign = [], []
    parents = [joint.parent for joint in body.joints]
    for i in range(len(body.joints) - 2):
        one, two, three = body.joints[i : i + 3]
        axes = np.array([joint.axis for joint in (one, two, three)])
        in_a_row = two.parent == i and three.parent == i + 1 and parents.count(i) == parents.count(i + 1) == 1
        one_point = all(np.allclose(j.translation, 0) and np.allclose(j.rotation, np.eye(3)) for j in (two, three))
        bare = one.segment == two.segment == NO_SEGMENT
        if in_a_row and one_point and bare and np.allclose(axes @ axes.T, np.eye(3), atol=1e-9):
            first.append(i)
            sign.append(np.linalg.det(axes))
    return Balls(np.array(first, dtype=np.intp), np.round(np.array(sign).reshape(-1, 1)))


def quaternion_of(angles: Array, sign: Array) -> Array:
    """Return the quaternion (4, G, B) of Cardan angles (3, G, B) rad."""
    half = 0.5 * sign * angles
    (s1, s2, s3), (c1, c2, c3) = np.sin(half), np.cos(half)
    c23, s23, sc, cs = c2 * c3, s2 * s3, s2 * c3, c2 * s3
    return np.stack([s1 * c23 + c1 * s23, c1 * sc - s1 * cs, c1 * cs + s1 * sc, c1 * c23 - s1 * s23])


def angles_of(quaternion: Array, sign: Array, near: Array, lower: Array, upper: Array) -> Array:
    """Return the Cardan angles (3, G, B) rad of unit quaternions (4, G, B).

    Every rotation has two sets of Cardan angles (and any number of full turns). The one inside ``lower``, ``upper`` (3, G, 1) is taken,
    if both or none are: the one closer to ``near`` (3, G, B).
    """
    x, y, z, w = quaternion
    sine = np.clip(2 * (x * z + y * w), -1.0, 1.0)
    one = np.stack(
        [
            np.arctan2(2 * (x * w - y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(sine),
            np.arctan2(2 * (z * w - x * y), 1 - 2 * (y * y + z * z)),
        ]
    )
    narrow = upper - lower < 2 * np.pi
    middle = np.where(narrow, 0.5 * (np.where(narrow, lower, 0.0) + np.where(narrow, upper, 0.0)), near)
    first = _turned_near(sign * one, middle)
    other = _turned_near(sign * (np.pi + np.array([1.0, -1.0, 1.0])[:, None, None] * one), middle)
    outside = [np.maximum(np.maximum(lower - a, a - upper), 0.0).sum(axis=0) for a in (first, other)]
    away = [np.abs(a - near).sum(axis=0) for a in (first, other)]
    take_other = (outside[1] < outside[0]) | ((outside[1] == outside[0]) & (away[1] < away[0]))
    return np.where(take_other, other, first)


def _turned_near(angles: Array, middle: Array) -> Array:
    """Return ``angles`` plus full turns, within half a turn of ``middle``."""
    return middle + (angles - middle + np.pi) % (2 * np.pi) - np.pi
