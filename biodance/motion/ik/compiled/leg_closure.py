"""Six joint angles that hold a foot under a pelvis, compiled: Newton's method from the neighbouring frame (see
``legs``).

All poses are in the pelvis' frame. Each frame starts from the one before it; where that does not converge nearby, the
foot is led from a known posture of the leg to its goal in small steps, so that the knee bends to the same side in every
frame.
"""

from typing import NamedTuple

import numpy as np

from biodance.motion.ik.compiled import compiled
from biodance.records import Array

_CLOSED = 1e-12  # Distance (leg lengths) and angle (rad) from the goal at which a foot is there
_NEAR = 0.5
"""rad: a larger change of an angle from frame to frame may lead to another solution and is not trusted."""
_LEADS = 8  # Steps in which a foot is led from the known posture
_LONGEST = 0.3  # rad: longest step of an angle in one iteration
_DAMPING = 1e-2, 1e-14
"""Damping of the normal equations per squared distance from the goal, and at the goal itself."""


class LegJoints(NamedTuple):
    """Placements of six joints from the pelvis outwards: ``rotation`` (6, 3, 3), ``translation`` (6, 3) m, ``axis`` (6,
    3); ``hip`` (3,) m about which the foot is led; ``size`` m, the length of the leg.
    """

    rotation: Array
    translation: Array
    axis: Array
    hip: Array
    size: float


class _Scratch(NamedTuple):
    """Room for one leg: ``turn`` (3, 3), ``place`` (3,) of the foot, ``origin``, ``direction`` (6, 3) of the axes;
    ``goal`` (3, 3), ``spot`` (3,) on the way; ``first`` (3, 3), ``begin`` (3,) of the known posture; ``a``, ``b`` (3,
    3), ``w`` (3,); ``jacobian``, ``normal`` (6, 6), ``gap``, ``step`` (6,).
    """

    turn: Array
    place: Array
    origin: Array
    direction: Array
    goal: Array
    spot: Array
    first: Array
    begin: Array
    a: Array
    b: Array
    w: Array
    jacobian: Array
    normal: Array
    gap: Array
    step: Array


def scratch() -> _Scratch:
    """Return room for one leg, filled with zeros."""
    turn, place, axes = (3, 3), (3,), (6, 3)
    foot, way, known, products = (turn, place, axes, axes), (turn, place), (turn, place), (turn, turn, place)
    newton = ((6, 6), (6, 6), (6,), (6,))
    return _Scratch(*(np.zeros(shape) for shape in (*foot, *way, *known, *products, *newton)))


@compiled
def _multiply(a, b, out):
    """Fill ``out`` (3, 3) with a b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@compiled
def _rotation_about(x, y, z, angle, out):
    """Fill ``out`` (3, 3) with the rotation about the unit axis x, y, z by ``angle``."""
    s, c = np.sin(angle), np.cos(angle)
    r = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + r * x * x, r * x * y - s * z, r * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = r * x * y + s * z, c + r * y * y, r * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = r * x * z - s * y, r * y * z + s * x, c + r * z * z


@compiled
def _rotation_vector(a, b, out):
    """Fill ``out`` (3,) with the rotation vector of a b' (both (3, 3)), which turn by less than half a turn apart."""
    trace = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        # (R - R')/2 as a vector is sin(angle) times the axis; the elements of R = a b' that it needs.
        plus = a[j, 0] * b[i, 0] + a[j, 1] * b[i, 1] + a[j, 2] * b[i, 2]
        minus = a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]
        out[k] = 0.5 * (plus - minus)
        trace += a[k, 0] * b[k, 0] + a[k, 1] * b[k, 1] + a[k, 2] * b[k, 2]
    sine = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    # angle / sine; at zero angle both are alike.
    longer = np.arctan2(sine, 0.5 * (trace - 1.0)) / sine if sine > 1e-9 else 1.0
    for k in range(3):
        out[k] *= longer


@compiled
def _place_foot(leg, angles, s):
    """Fill turn and place of the foot, origins and directions of the axes."""
    for i in range(3):
        s.place[i] = 0.0
        for j in range(3):
            s.turn[i, j] = 1.0 if i == j else 0.0
    for k in range(6):
        p, e = leg.translation[k], leg.axis[k]
        # Parent's turn times the joint's own placement, before its angle turns about the axis.
        _multiply(s.turn, leg.rotation[k], s.a)
        for i in range(3):
            s.place[i] += s.turn[i, 0] * p[0] + s.turn[i, 1] * p[1] + s.turn[i, 2] * p[2]
            s.origin[k, i] = s.place[i]
            s.direction[k, i] = s.a[i, 0] * e[0] + s.a[i, 1] * e[1] + s.a[i, 2] * e[2]
        _rotation_about(e[0], e[1], e[2], angles[k], s.b)
        _multiply(s.a, s.b, s.turn)


@compiled
def _solve_step(s, damping):
    """Fill the step: (J'J + damping) step = J' gap, by Cholesky's factor in ``normal``."""
    # Row by row of L L' = J'J + damping; the forward substitution of the right side goes along.
    for i in range(6):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(6):
                total += s.jacobian[k, i] * s.jacobian[k, j]
            for k in range(j):
                total -= s.normal[i, k] * s.normal[j, k]
            s.normal[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / s.normal[j, j]
        right = 0.0
        for k in range(6):
            right += s.jacobian[k, i] * s.gap[k]
        for k in range(i):
            right -= s.normal[i, k] * s.step[k]
        s.step[i] = right / s.normal[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            s.step[i] -= s.normal[k, i] * s.step[k]
        s.step[i] /= s.normal[i, i]


@compiled
def _reach_for(leg, angles, turn, place, rounds, s):
    """Improve ``angles`` (6,) until the foot has the pose ``turn``, ``place``; return how far it is from it."""
    away = np.inf
    for _ in range(rounds):
        _place_foot(leg, angles, s)
        _rotation_vector(turn, s.turn, s.w)
        square = 0.0
        for i in range(3):
            # Distances in leg lengths beside angles in rad: one measure for both.
            s.gap[i], s.gap[3 + i] = (place[i] - s.place[i]) / leg.size, s.w[i]
            square += s.gap[i] * s.gap[i] + s.w[i] * s.w[i]
        away = np.sqrt(square)
        if away < _CLOSED:
            break
        for k in range(6):
            for i in range(3):
                m, n = (i + 1) % 3, (i + 2) % 3
                # a x (foot - origin): how the foot moves with the angle.
                lever = s.direction[k, m] * (s.place[n] - s.origin[k, n]) - s.direction[k, n] * (
                    s.place[m] - s.origin[k, m]
                )
                s.jacobian[i, k], s.jacobian[3 + i, k] = lever / leg.size, s.direction[k, i]
        # Levenberg's damping in proportion to the squared distance: strong far away, and quadratic convergence near.
        _solve_step(s, _DAMPING[0] * square + _DAMPING[1])
        longest = _LONGEST
        for k in range(6):
            longest = max(longest, abs(s.step[k]))
        for k in range(6):
            angles[k] += s.step[k] * (_LONGEST / longest)
    return away


@compiled
def lead(leg, known, angles, turn, place, s):
    """Fill ``angles`` (6,) for the pose ``turn``, ``place``, led from ``known``; return the foot's distance."""
    for k in range(6):
        angles[k] = known[k]
    _place_foot(leg, angles, s)
    _rotation_vector(turn, s.turn, s.w)
    size = np.sqrt(s.w[0] * s.w[0] + s.w[1] * s.w[1] + s.w[2] * s.w[2])
    x, y, z = (s.w[0] / size, s.w[1] / size, s.w[2] / size) if size > 1e-12 else (1.0, 0.0, 0.0)
    short, long = 0.0, 0.0
    for i in range(3):
        s.begin[i] = s.place[i] - leg.hip[i]
        short, long = short + s.begin[i] ** 2, long + (place[i] - leg.hip[i]) ** 2
        for j in range(3):
            s.first[i, j] = s.turn[i, j]
    # Turn about a fixed axis and distance to the hip in even shares; direction along the chord.
    for k in range(1, _LEADS):
        share, length = k / _LEADS, 0.0
        _rotation_about(x, y, z, share * size, s.b)
        _multiply(s.b, s.first, s.goal)
        for i in range(3):
            s.spot[i] = (1.0 - share) * s.begin[i] + share * (place[i] - leg.hip[i])
            length += s.spot[i] ** 2
        # The chord is shorter than its ends: stretched so that the leg never has to shorten on the way.
        longer = ((1.0 - share) * np.sqrt(short) + share * np.sqrt(long)) / np.sqrt(length)
        for i in range(3):
            s.spot[i] = leg.hip[i] + longer * s.spot[i]
        _reach_for(leg, angles, s.goal, s.spot, 6, s)
    return _reach_for(leg, angles, turn, place, 60, s)


@compiled
def close_leg(leg, known, turn, place, s, out, away):
    """Fill ``out`` (T, 6) with the angles for foot poses ``turn``, ``place``, ``away`` (T,) how far it stays."""
    for t in range(len(place)):
        change = np.inf
        # Only a closed neighbour is a start.
        if t and away[t - 1] < _CLOSED:
            for k in range(6):
                out[t, k] = out[t - 1, k]
            away[t] = _reach_for(leg, out[t], turn[t], place[t], 10, s)
            change = 0.0
            for k in range(6):
                change = max(change, abs(out[t, k] - out[t - 1, k]))
        if not (away[t] < _CLOSED and change < _NEAR):
            away[t] = lead(leg, known, out[t], turn[t], place[t], s)
