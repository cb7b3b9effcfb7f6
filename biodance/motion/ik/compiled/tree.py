"""The motion of a tree of joints and the regressor of its segments, compiled (numba): what `motion.kinematics` and
`motion.dynamics` define, frame by frame.

``parent`` (n,) is the joint before each, -1 the root. Functions fill the arrays that come last.
"""

from typing import NamedTuple

import numpy as np

from biodance.motion.ik.compiled import compiled
from biodance.records import Array


@compiled
def _apply(R, v, out):
    """Fill out (3,) with R v."""
    for c in range(3):
        out[c] = R[c, 0] * v[0] + R[c, 1] * v[1] + R[c, 2] * v[2]


@compiled
def _apply_transposed(R, v, out):
    """Fill out (3,) with R' v."""
    for c in range(3):
        out[c] = R[0, c] * v[0] + R[1, c] * v[1] + R[2, c] * v[2]


@compiled
def _add_product(a, b, out):
    """Add the vector product a x b to out (3,)."""
    out[0] += a[1] * b[2] - a[2] * b[1]
    out[1] += a[2] * b[0] - a[0] * b[2]
    out[2] += a[0] * b[1] - a[1] * b[0]


@compiled
def _multiply(A, B, out):
    """Fill out (3, k) with A (3, 3) times B (3, k)."""
    for c in range(3):
        for d in range(B.shape[1]):
            out[c, d] = A[c, 0] * B[0, d] + A[c, 1] * B[1, d] + A[c, 2] * B[2, d]


@compiled
def _three_of(v):
    """Return the vector (3,) as three numbers, which the compiler keeps in registers."""
    return v[0], v[1], v[2]


@compiled
def _cross_of(a, b):
    """Return the vector product a x b of three numbers each."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _matrix_of(R):
    """Return the rows of R (3, 3), three numbers each."""
    return _three_of(R[0]), _three_of(R[1]), _three_of(R[2])


@compiled
def _dot_of(a, b):
    """Return the scalar product of three numbers each."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def place_joints(parent, turn, translation, root_rotation, root_position, angle, rotation, position):
    """Fill rotation (T, n, 3, 3) and position (T, n, 3) m of the joints at angle (T, n) rad; ``turn`` (n, 3, 3, 3): a
    joint's own rotation is turn[0] + sin turn[1] + (1 - cos) turn[2].
    """
    for t in range(angle.shape[0]):
        for j in range(parent.shape[0]):
            k, sine, versine, arm = parent[j], np.sin(angle[t, j]), 1 - np.cos(angle[t, j]), _three_of(translation[j])
            above, place = _matrix_of(root_rotation[t]), _three_of(root_position[t])
            if k >= 0:
                above, place = _matrix_of(rotation[t, k]), _three_of(position[t, k])
            for d in range(3):
                a = turn[j, 0, 0, d] + sine * turn[j, 1, 0, d] + versine * turn[j, 2, 0, d]
                b = turn[j, 0, 1, d] + sine * turn[j, 1, 1, d] + versine * turn[j, 2, 1, d]
                c = turn[j, 0, 2, d] + sine * turn[j, 1, 2, d] + versine * turn[j, 2, 2, d]
                for e in range(3):
                    rotation[t, j, e, d] = _dot_of(above[e], (a, b, c))
            for e in range(3):
                position[t, j, e] = place[e] + _dot_of(above[e], arm)


@compiled
def move_joints(parent, axis, rotation, position, root, rate, rate2, moved):
    """Fill moved (3, T, n, 3), angular velocity rad/s, angular acceleration rad/s² and acceleration m/s² of the joints,
    lab, from rate (T, n) and rate2 (T, n); ``root`` (4, T, 3) the root's same three, then its position m.
    """
    for t in range(rate.shape[0]):
        for j in range(parent.shape[0]):
            k = parent[j]
            w, dw, a = _three_of(root[0, t]), _three_of(root[1, t]), _three_of(root[2, t])
            place = _three_of(root[3, t])
            if k >= 0:
                w, dw, a = _three_of(moved[0, t, k]), _three_of(moved[1, t, k]), _three_of(moved[2, t, k])
                place = _three_of(position[t, k])
            (first, second, third), own, here = (
                _matrix_of(rotation[t, j]),
                _three_of(axis[j]),
                _three_of(position[t, j]),
            )
            spin = _dot_of(first, own), _dot_of(second, own), _dot_of(third, own)
            arm = here[0] - place[0], here[1] - place[1], here[2] - place[2]
            across, lifted, swung = _cross_of(w, spin), _cross_of(dw, arm), _cross_of(w, _cross_of(w, arm))
            for c in range(3):
                moved[0, t, j, c] = w[c] + spin[c] * rate[t, j]
                moved[1, t, j, c] = dw[c] + spin[c] * rate2[t, j] + across[c] * rate[t, j]  # the axis turns with w
                moved[2, t, j, c] = a[c] + lifted[c] + swung[c]


@compiled
def fill_regressor(rotation, position, omega, alpha, drive, W):
    """Fill W (T, 6, 10N) for segments with angular velocity ``omega``, angular acceleration ``alpha`` and ``drive`` =
    acceleration minus gravity (T, N, 3), lab; W holds zeros.
    """
    w, dw, column = np.empty(3), np.empty(3), np.empty(3)
    A, L, B, first, second = np.empty((3, 3)), np.zeros((3, 6)), np.empty((3, 6)), np.empty((3, 3)), np.empty((3, 6))
    for t in range(position.shape[0]):
        for s in range(position.shape[1]):
            R, p, f, own = rotation[t, s], position[t, s], drive[t, s], W[t, :, 10 * s : 10 * s + 10]
            _apply_transposed(R, omega[t, s], w)
            _apply_transposed(R, alpha[t, s], dw)
            square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
            # A = [dw]x + [w]x²: the force of the first moments is R A h.
            for c in range(3):
                for d in range(3):
                    A[c, d] = w[c] * w[d] - (square if c == d else 0.0)
            A[0, 1], A[0, 2], A[1, 2] = A[0, 1] - dw[2], A[0, 2] + dw[1], A[1, 2] - dw[0]
            A[1, 0], A[2, 0], A[2, 1] = A[1, 0] + dw[2], A[2, 0] - dw[1], A[2, 1] + dw[0]
            _multiply(R, A, first)
            _inertia_columns(w, L)
            for d in range(6):  # w x (I w), per element of I
                B[0, d] = w[1] * L[2, d] - w[2] * L[1, d]
                B[1, d] = w[2] * L[0, d] - w[0] * L[2, d]
                B[2, d] = w[0] * L[1, d] - w[1] * L[0, d]
            _inertia_columns(dw, L)
            B += L
            _multiply(R, B, second)
            for c in range(3):
                own[c, 0] = f[c]
                for d in range(3):
                    own[c, 1 + d] = first[c, d]
                for d in range(6):
                    own[3 + c, 4 + d] = second[c, d]
            _add_product(p, f, own[3:, 0])  # mass: p x (a - g)
            for d in range(3):
                column[:] = 0.0
                _add_product(p, first[:, d], column)  # p x (R A e_d)
                _add_product(R[:, d], f, column)  # (R e_d) x (a - g)
                for c in range(3):
                    own[3 + c, 1 + d] = column[c]


@compiled
def fill_wrench(rotation, position, omega, alpha, drive, phi, wrench):
    """Fill wrench (T, 6), which holds zeros, with `fill_regressor` times the parameters ``phi`` (N, 10)."""
    w, dw, h, spin, force, moment = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    first, about = np.empty(3), np.empty(3)
    for t in range(position.shape[0]):
        for s in range(position.shape[1]):
            R, f, m, own = rotation[t, s], drive[t, s], phi[s, 0], phi[s]
            _apply_transposed(R, omega[t, s], w)
            _apply_transposed(R, alpha[t, s], dw)
            _apply(R, own[1:4], h)
            _turn_inertia(own, w, spin)
            _turn_inertia(own, dw, moment)
            _add_product(w, spin, moment)
            first[:] = 0.0
            _add_product(w, own[1:4], first)
            force[:] = 0.0
            _add_product(w, first, force)
            _add_product(dw, own[1:4], force)
            _apply(R, force, first)
            _apply(R, moment, about)
            _add_product(h, f, about)
            for c in range(3):
                force[c] = m * f[c] + first[c]
            _add_product(position[t, s], force, about)
            for c in range(3):
                wrench[t, c] += force[c]
                wrench[t, 3 + c] += about[c]


@compiled
def _turn_inertia(own, v, out):
    """Fill out (3,) with I v, of the parameters own (10,)."""
    out[0] = own[4] * v[0] + own[5] * v[1] + own[7] * v[2]
    out[1] = own[5] * v[0] + own[6] * v[1] + own[8] * v[2]
    out[2] = own[7] * v[0] + own[8] * v[1] + own[9] * v[2]


@compiled
def _inertia_columns(v, L):
    """Fill L (3, 6) with L [Ixx Ixy Iyy Ixz Iyz Izz] = I v."""
    x, y, z = v
    L[0, 0], L[0, 1], L[0, 3] = x, y, z
    L[1, 1], L[1, 2], L[1, 4] = x, y, z
    L[2, 3], L[2, 4], L[2, 5] = x, y, z


class PlacedJoints(NamedTuple):
    """The n joints of T postures, lab frame: the own ``axis`` (n, 3) of each, ``rotation`` (T, n, 3, 3) and ``origin``
    (T, n, 3) m; the ``root`` (T, 3) m and how many coordinates move it (``roots``: 6, or 0).
    """

    axis: Array
    rotation: Array
    origin: Array
    root: Array
    roots: int


@compiled
def fill_places(hangs, joints, points, J):
    """Fill J (T, K, 3, nv): how ``points`` (T, K, 3) m move with each coordinate of `PlacedJoints`."""
    axis, rotation, origin, root, roots = joints
    for t in range(points.shape[0]):
        for k in range(points.shape[1]):
            if roots:
                for c in range(3):
                    J[t, k, c, c] = 1.0
                x, y, z = points[t, k, 0] - root[t, 0], points[t, k, 1] - root[t, 1], points[t, k, 2] - root[t, 2]
                J[t, k, 0, 4], J[t, k, 0, 5], J[t, k, 1, 3] = z, -y, -z
                J[t, k, 1, 5], J[t, k, 2, 3], J[t, k, 2, 4] = x, y, -x
        for j in range(axis.shape[0]):
            turn, o = _turned_axis(rotation[t, j], axis[j]), origin[t, j]
            for k in range(points.shape[1]):
                if hangs[j, k]:
                    arm = points[t, k, 0] - o[0], points[t, k, 1] - o[1], points[t, k, 2] - o[2]
                    moved = _cross_of(turn, arm)
                    for c in range(3):
                        J[t, k, c, roots + j] = moved[c]


@compiled
def _turned_axis(R, axis):
    """Return R times an axis (3,)."""
    first, second, third = _matrix_of(R)
    own = _three_of(axis)
    return _dot_of(first, own), _dot_of(second, own), _dot_of(third, own)


@compiled
def fill_tangent(hangs, joints, com, place, turn, tangent):
    """Fill tangent (T, L, nv): what each coordinate of `PlacedJoints` does to L functionals that are ``place``
    (T, N, L, 3) of the moved ``com`` (T, N, 3) m of N segments and ``turn`` (T, N, L, 3) of their turn.
    """
    axis, rotation, origin, root, roots = joints
    for t in range(com.shape[0]):
        for s in range(com.shape[1]):
            P, D, at = place[t, s], turn[t, s], _three_of(com[t, s])
            if roots:
                arm = at[0] - root[t, 0], at[1] - root[t, 1], at[2] - root[t, 2]
                for f in range(P.shape[0]):
                    across = _cross_of(arm, _three_of(P[f]))  # P . (e x arm) = e . (arm x P)
                    for c in range(3):
                        tangent[t, f, c] += P[f, c]
                        tangent[t, f, 3 + c] += D[f, c] + across[c]
            for j in range(axis.shape[0]):
                if hangs[j, s]:
                    a, o = _turned_axis(rotation[t, j], axis[j]), origin[t, j]
                    moved = _cross_of(a, (at[0] - o[0], at[1] - o[1], at[2] - o[2]))
                    for f in range(P.shape[0]):
                        tangent[t, f, roots + j] += _dot_of(_three_of(P[f]), moved) + _dot_of(_three_of(D[f]), a)


_NINE, FOUR = 9, 4
"""Functionals of a frame, and frames taken together: known beforehand, so that their loops are unrolled."""


@compiled
def add_products(value, angle, back, work, out):
    """Add to out (R, n, p) the sum over time and functionals of ``value`` (T, 9, R) times ``angle`` (T, n) times
    ``back`` (T, 9, p); ``work`` (4, p) is scratch.
    """
    frames, _, size = back.shape
    for first in range(0, frames, FOUR):
        for r in range(value.shape[2]):
            for t in range(FOUR):
                if first + t < frames:
                    for j in range(size):
                        total = 0.0
                        for f in range(_NINE):
                            total += value[first + t, f, r] * back[first + t, f, j]
                        work[t, j] = total
                else:
                    work[t] = 0.0
            for n in range(angle.shape[1]):
                for j in range(size):
                    total = 0.0
                    for t in range(FOUR):
                        total += angle[min(first + t, frames - 1), n] * work[t, j]
                    out[r, n, j] += total
