"""Stacks of stadium solids: mass properties of a body part from a few girths (Yeadon 1990, J. Biomech. 23, 67-74,
doi:10.1016/0021-9290(90)90370-I).

A stadium is a rectangle 2 t by 2 r with a half disc of radius r at either end; a stadium solid lies between two of
them, radius r and half length t running linearly in between. t = 0 gives Hanavan's frusta of circular cones (Hanavan
1964, AMRL-TR-64-102).
"""

import numpy as np

from biodance.body.inertia import RigidInertia
from biodance.records import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)  # exact to degree 5; sections have degree 4 along the axis


def stadium(girth: Array, aspect: Array) -> tuple[Array, Array]:
    """Return radius r and half length t (n,) m of stadia from their girths (n,) m and breadth over depth (n,), at
    least 1: girth = 2 pi r + 4 t, breadth over depth = (r + t) / r.
    """
    radius = np.asarray(girth) / (2 * np.pi + 4 * (np.asarray(aspect) - 1))
    return radius, (np.asarray(aspect) - 1) * radius


def stadium_stack(level: Array, girth: Array, aspect: Array, *, length: float) -> RigidInertia:
    """Return volume (as ``mass``, m³), centroid and second moments of volume of a stack along -y from the origin.

    Parameters
    ----------
    level : array_like
        (n,) ascending, share of the length from the proximal end; the first section reaches up to 0, the last to 1.
    girth : array_like
        (n,) m.
    aspect : array_like
        (n,) breadth (z) over depth (x).
    length : float
        m.

    Returns
    -------
    RigidInertia
        x anterior, y up, z right, origin in the middle of the proximal section; inertia (m⁵) about the centroid.
    """
    radius, half = stadium(girth, aspect)
    ends = np.unique(np.concatenate([[0.0], level, [1.0]]))
    low, step = ends[:-1, None], np.diff(ends)[:, None]
    place = (low + step * (1 + _NODES) / 2).ravel()
    weight = (step * _WEIGHTS / 2).ravel() * length
    r, t, y = np.interp(place, level, radius), np.interp(place, level, half), -place * length
    area = np.pi * r**2 + 4 * r * t
    volume = float(weight @ area)
    middle = float(weight @ (area * y)) / volume
    xx = weight @ (np.pi * r**4 / 4 + 4 * t * r**3 / 3)
    zz = weight @ (np.pi * r**4 / 4 + 8 * t * r**3 / 3 + np.pi * r**2 * t**2 + 4 * r * t**3 / 3)
    yy = weight @ (area * (y - middle) ** 2)
    return RigidInertia(volume, np.array([0.0, middle, 0.0]), np.diag([yy + zz, xx + zz, xx + yy]))
