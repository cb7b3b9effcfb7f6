"""First derivatives of places on a tree of joints and of what is linear in them, compiled (numba): what
`motion.kinematics` and `uncertainty.response` define, frame by frame.

Coordinates are the root's place and turn where it moves, then the n joints, lab axes. ``hangs`` (n, K) tells which of K
points hang on a joint; functions fill the arrays that come last, which hold zeros.
"""

from typing import NamedTuple

from biodance.motion.ik.compiled import compiled
from biodance.motion.ik.compiled.tree import cross_of, dot_of, matrix_of, three_of
from biodance.records import Array


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
                    moved = cross_of(turn, arm)
                    for c in range(3):
                        J[t, k, c, roots + j] = moved[c]


@compiled
def _turned_axis(R, axis):
    """Return R times an axis (3,)."""
    first, second, third = matrix_of(R)
    own = three_of(axis)
    return dot_of(first, own), dot_of(second, own), dot_of(third, own)


@compiled
def fill_tangent(hangs, joints, com, place, turn, tangent):
    """Fill tangent (T, L, nv): what each coordinate of `PlacedJoints` does to L functionals that are ``place``
    (T, N, L, 3) of the moved ``com`` (T, N, 3) m of N segments and ``turn`` (T, N, L, 3) of their turn.
    """
    axis, rotation, origin, root, roots = joints
    for t in range(com.shape[0]):
        for s in range(com.shape[1]):
            P, D, at = place[t, s], turn[t, s], three_of(com[t, s])
            if roots:
                arm = at[0] - root[t, 0], at[1] - root[t, 1], at[2] - root[t, 2]
                for f in range(P.shape[0]):
                    across = cross_of(arm, three_of(P[f]))
                    for c in range(3):
                        tangent[t, f, c] += P[f, c]
                        tangent[t, f, 3 + c] += D[f, c] + across[c]
            for j in range(axis.shape[0]):
                if hangs[j, s]:
                    a, o = _turned_axis(rotation[t, j], axis[j]), origin[t, j]
                    moved = cross_of(a, (at[0] - o[0], at[1] - o[1], at[2] - o[2]))
                    for f in range(P.shape[0]):
                        tangent[t, f, roots + j] += dot_of(three_of(P[f]), moved) + dot_of(three_of(D[f]), a)


NINE, FOUR = 9, 4
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
                        for f in range(NINE):
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
