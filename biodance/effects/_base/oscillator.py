"""A mass on a spring and a damper that rides on a moving point: what it adds to the wrench.

Relative to the point, x'' + 2 damping w x' + w² x = -a with w = 2 pi frequency and a the point's acceleration; gravity
only sets the place of rest. The ground then carries m (a + x'') instead of m a, at the place c + x instead of c.
"""

import numpy as np
from scipy.linalg import expm
from scipy.linalg.lapack import dtbtrs

from biodance.effects._base.case import Case
from biodance.records import Array
from biodance.spatial import cross


def relative_motion(acceleration: Array, rate: float, *, frequency: float, damping: float) -> tuple[Array, Array]:
    """Return x (T, n) m and x'' (T, n) m/s² of the mass, exact for an ``acceleration`` (T, n) m/s² that is linear
    between samples.

    ``rate`` Hz; ``frequency`` Hz and ``damping`` (1 = critical) of the free mass, which starts at rest on the moving
    point.
    """
    w = 2 * np.pi * frequency
    A = np.array([[0.0, 1.0], [-w * w, -2 * damping * w]])
    whole = np.zeros((4, 4))  # state, input and its slope over one sample (Van Loan 1978, doi:10.1109/TAC.1978.1101743)
    whole[:2, :2], whole[:2, 2], whole[2, 3] = A / rate, (0.0, -1.0 / rate), 1.0
    step = expm(whole)
    slope = np.diff(acceleration, axis=0)
    states = np.zeros((len(acceleration), 2, acceleration.shape[1]))
    states[0, 0] = -acceleration[0] / (w * w)
    states[1:] = step[:2, 2, None] * acceleration[:-1, None] + step[:2, 3, None] * slope[:, None]
    band = np.zeros((4, 2 * len(states)))  # state k+1 less step of state k, one row after the other
    band[0] = 1.0
    for row, column in np.ndindex(2, 2):
        band[2 + row - column, column::2] = -step[row, column]
    solved, _ = dtbtrs(band, states.reshape(len(band[0]), -1), uplo="L")
    place, speed = np.moveaxis(solved.reshape(states.shape), 1, 0)
    return place, -acceleration - w * w * place - 2 * damping * w * speed


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
