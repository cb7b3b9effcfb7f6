"""A mass on a spring and a damper that rides on a moving point: what it adds to the wrench.

Relative to the point, x'' + 2 damping w x' + w² x = -a with w = 2 pi frequency and a the point's acceleration; gravity
only sets the place of rest. The ground then carries m (a + x'') instead of m a, at the place c + x instead of c.
"""

import numpy as np
from scipy.linalg import expm

from biodance.effects._base.case import Case
from biodance.lab.recursion import run_section
from biodance.records import Array
from biodance.spatial import cross


def relative_motion(acceleration: Array, rate: float, *, frequency: float, damping: float) -> tuple[Array, Array]:
    """Return x (T, n) m and x'' (T, n) m/s² of the mass, exact for an ``acceleration`` (T, n) m/s² that is linear
    between samples.

    ``rate`` Hz; ``frequency`` Hz and ``damping`` (1 = critical) of the free mass, which starts at rest on the moving
    point.
    """
    w = 2 * np.pi * frequency
    whole = np.zeros((4, 4))
    whole[:2, :2] = np.array([[0, 1], [-w * w, -2 * damping * w]]) / rate
    whole[1, 2], whole[2, 3] = -1 / rate, 1.0
    step = expm(whole)
    A, D = step[:2, :2], step[:2, 3]
    B = step[:2, 2] - D + A @ D
    feedback = _characteristic(A)
    forward = [_characteristic(A - np.outer(B, row)) + (D[i] - 1) * feedback for i, row in enumerate(np.eye(2))]
    place, speed = (run_section(np.concatenate([b, feedback]), acceleration) for b in forward)
    return place, -acceleration - w * w * place - 2 * damping * w * speed


def _characteristic(matrix: Array) -> Array:
    """Return the coefficients (3,) of the characteristic polynomial of a (2, 2) matrix, highest power first."""
    return np.array([1.0, -np.trace(matrix), np.linalg.det(matrix)])


def point_motion(case: Case, segment: int, local: Array) -> tuple[Array, Array]:
    """Return place (T, 3) m and acceleration (T, 3) m/s² of the point ``local`` (3,) m of a segment, lab frame,
    without gravity.
    """
    move = case.segments
    arm = move.rotation[:, segment] @ local
    omega, alpha = move.angular_velocity[:, segment], move.angular_acceleration[:, segment]
    acceleration = move.acceleration[:, segment] + cross(alpha, arm) + cross(omega, cross(omega, arm))
    return move.position[:, segment] + arm, acceleration


def riding_wrench(place: Array, acceleration: Array, moved: tuple[Array, Array], *, gravity: Array) -> Array:
    """Return (T, 6) per kilogram about the lab origin: what the relative motion ``moved`` (x, x'') adds at a point
    (T, 3).
    """
    x, relative = moved
    return np.concatenate([relative, cross(place, relative) + cross(x, acceleration - gravity)], axis=1)
