"""A mass on a spring and a damper that rides on a moving point: what it adds to the wrench.

Relative to the point, x'' + 2 damping w x' + w² x = -a with w = 2 pi frequency and a the point's acceleration; gravity
only sets the place of rest. The ground then carries m (a + x'') instead of m a, at the place c + x instead of c.
"""

import numpy as np
from scipy.linalg import expm

from biodance.effects._base.case import Case
from biodance.lab.recursive import run_forwards
from biodance.records import Array
from biodance.spatial import cross


def relative_motion(acceleration: Array, rate: float, *, frequency: float, damping: float) -> tuple[Array, Array]:
    """Return x (T, n) m and x'' (T, n) m/s² of the mass, exact for an ``acceleration`` (T, n) m/s² that is linear
    between samples.

    ``rate`` Hz; ``frequency`` Hz and ``damping`` (1 = critical) of the free mass, which starts at rest on the moving
    point.
    """
    w = 2 * np.pi * frequency
    place, speed = (run_forwards(section, acceleration) for section in _sections(w, damping, 1 / rate))
    return place, -acceleration - w * w * place - 2 * damping * w * speed


def _sections(w: float, damping: float, dt: float) -> tuple[Array, Array]:
    """Return the filters (1, 6) from samples every ``dt`` s of the point's acceleration to x and to x', exact where it
    is linear in between.

    One exponential holds the step of the state (A), of a constant input and of a ramp (Franklin, Powell and Workman,
    Digital Control of Dynamic Systems, section 6.3.2). With C the row of x or x', the filter is C (z - A)^-1 B + D.
    """
    block = np.zeros((4, 4))
    block[:2, :3] = [[0.0, dt, 0.0], [-w * w * dt, -2 * damping * w * dt, -dt]]
    block[2, 3] = 1.0
    step = expm(block)
    A, flat, ramp = step[:2, :2], step[:2, 2], step[:2, 3]
    B = flat - ramp + A @ ramp
    pole = np.array([1.0, -np.trace(A), np.linalg.det(A)])
    seen = (A - np.outer(B, row) for row in np.eye(2))
    rest = (np.array([1.0, -np.trace(one), np.linalg.det(one)]) for one in seen)
    x, speed = (
        np.concatenate([top + (through - 1) * pole, pole])[None] for top, through in zip(rest, ramp, strict=True)
    )
    return x, speed


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
