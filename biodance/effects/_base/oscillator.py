"""A mass on a spring and a damper that rides on a moving point: what it adds to the wrench.

Relative to the point, x'' + 2 damping w x' + w² x = -a with w = 2 pi frequency and a the point's acceleration; gravity
only sets the place of rest. The ground then carries m (a + x'') instead of m a, at the place c + x instead of c.
"""

from functools import lru_cache

import numpy as np

from biodance.effects._base.case import Case
from biodance.records import Array
from biodance.spatial import cross


def relative_motion(acceleration: Array, rate: float, *, frequency: float, damping: float) -> tuple[Array, Array]:
    """Return x (T, n) m and x'' (T, n) m/s² of the mass, exact for an ``acceleration`` (T, n) m/s² that is linear
    between samples.

    ``rate`` Hz; ``frequency`` Hz and ``damping`` (1 = critical) of the free mass, which starts at rest on the moving
    point.
    """
    from scipy.signal import lfilter

    w, (numerators, denominator, rest) = 2 * np.pi * frequency, _filters(rate, frequency, damping)
    place, speed = (
        # Initial state of a filter at rest under the first acceleration.
        lfilter(b, denominator, acceleration, axis=0, zi=zi[:, None] * acceleration[:1])[0]
        for b, zi in zip(numerators, rest, strict=True)
    )
    # The equation of motion gives x'' from place and speed, without differentiating.
    return place, -acceleration - w * w * place - 2 * damping * w * speed


@lru_cache(maxsize=64)
def _filters(rate: float, frequency: float, damping: float) -> tuple[Array, Array, list[Array]]:
    """Return numerators (2, 3) of place and speed, denominator (3,), and the states at rest under unit acceleration."""
    from scipy.signal import cont2discrete, lfilter_zi, ss2tf

    w = 2 * np.pi * frequency
    system = (np.array([[0, 1], [-w * w, -2 * damping * w]]), np.array([[0], [-1]]), np.eye(2), np.zeros((2, 1)))
    # First-order hold: exact for inputs that are linear between samples.
    numerators, denominator = ss2tf(*cont2discrete(system, 1 / rate, method="foh")[:4])
    return numerators, denominator, [lfilter_zi(b, denominator) for b in numerators]


def point_motion(case: Case, segment: int, local: Array) -> tuple[Array, Array]:
    """Return place (T, 3) m and acceleration (T, 3) m/s² of the point ``local`` (3,) m of a segment, lab frame,
    without gravity.
    """
    move = case.segments
    arm = move.rotation[:, segment] @ local
    omega, alpha = move.angular_velocity[:, segment], move.angular_acceleration[:, segment]
    # a + dw x arm + w x (w x arm).
    acceleration = move.acceleration[:, segment] + cross(alpha, arm) + cross(omega, cross(omega, arm))
    return move.position[:, segment] + arm, acceleration


def oscillator_wrench(place: Array, acceleration: Array, moved: tuple[Array, Array], *, gravity: Array) -> Array:
    """Return (T, 6) per kilogram about the lab origin: what the relative motion ``moved`` (x, x'') adds at a point
    (T, 3).
    """
    x, relative = moved
    # m (a + x'' - g) at c + x less m (a - g) at c, to first order in x.
    return np.concatenate([relative, cross(place, relative) + cross(x, acceleration - gravity)], axis=1)
