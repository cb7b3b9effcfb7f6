"""Minimise the marker cost of frames one by one: projected Newton with damping, on the manifold of postures, compiled
(numba).

Each frame has its own damping and its own set of joints held at a limit. A frame takes the exact second derivatives
where they are positive definite and Gauss-Newton's where they are not, so a stationary point that is no minimum is
left. Convergence is judged by the projected gradient, never by the size of a step or of the change of the cost
(Bertsekas 1982, DOI 10.1137/0320018). Ball joints step by a rotation vector, so that their Cardan angles' singularity
is no obstacle, and by their angles where a limit is met.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.motion.ik.compiled import compiled
from biodance.motion.ik.compiled.ball_step import exponential, product, turned
from biodance.motion.kinematics import chart_of, joint_arrays
from biodance.records import Array

# All that the gradient and the second derivatives by a joint need are four sums over the markers that move with it,
# with p the model's and m the measured place, both from the root's origin (docs/derivations.md 10):
#
#     S0 = sum w,   S = sum w p,   A = sum w m,   M = sum w p m'
#
# With the twist t_j = (o_j x a_j, a_j) of joint j (axis a, origin o), i at or before j:
#
#     gradient_j = t_j . (S - A, skew M),   H_ij = t_i . momentum_j
#     momentum_j = (S0 v + a x S,  A x v + tr(M) a - M a)   with t_j = (v, a)
#
# and with m = p (A = S, M = sum w p p') the Gauss-Newton matrix. Slot 0 is the root, slot i + 1 is joint i; coordinates
# are the root's translation and rotation vector (lab axes), then the joints, as in Pinocchio.

_LENGTH = 0.1
"""m, turns an angle into a typical marker displacement: makes gradients, damping and pivots of different coordinates
comparable.
"""

_FLAT = 1e-9
"""A pivot below this fraction of its coordinate's scale counts as zero or negative: the cost is not convex there."""


class MarkerChain(NamedTuple):
    """A body and K of its markers as plain arrays.

    ``parent`` (n,) joint before each, -1 the root; ``turn`` (n, 3, 3, 3) with joint rotation = turn[0] + sin turn[1] +
    (1 - cos) turn[2]; ``translation`` (n, 3) m; ``axis`` (n, 3); ``slot`` (K,) and ``local`` (K, 3) m of the markers;
    ``lower``, ``upper`` (n,) rad; ``path`` (nv, depth) the coordinates from the first to each and ``depth`` (nv,) how
    many come before it; ``ball`` (G,) first joint of every ball joint and ``sign`` (G,) of its axes; ``roots`` 6 or 0.
    """

    parent: NDArray[np.int64]
    turn: Array
    translation: Array
    axis: Array
    slot: NDArray[np.int64]
    local: Array
    lower: Array
    upper: Array
    path: NDArray[np.int64]
    depth: NDArray[np.int64]
    ball: NDArray[np.int64]
    sign: Array
    roots: int


class _Sums(NamedTuple):
    """What is known at one posture: ``rotation`` (n + 1, 3, 3) and ``origin`` (n + 1, 3) m of every slot and ``twist``
    (n + 1, 6) of its coordinate, lab axes from the root's origin; ``below`` (n + 1, 16) the sums S0, S (3), A (3), M
    (9) over the markers beyond every slot; ``model`` (n + 1, 9) sum w p p', filled where Gauss-Newton needs it;
    ``factor`` (nv, depth) the matrix or its factors.
    """

    rotation: Array
    origin: Array
    twist: Array
    below: Array
    model: Array
    factor: Array


def chain_of(body: Body, segment: list[int], local: Array) -> MarkerChain:
    """Return the chain of ``body`` with markers at ``local`` (K, 3) m in the frames of the segments ``segment`` (K)."""
    parent, turn, translation, axis = joint_arrays(body)
    root, chart = range(body.n_root), chart_of(body)
    paths = [list(root[: k + 1]) for k in root]
    paths += [[*root, *(body.n_root + joint for joint in path)] for path in body.paths]
    depth = np.array([len(path) - 1 for path in paths], dtype=np.int64)
    return MarkerChain(
        parent.astype(np.int64),
        turn,
        translation,
        axis,
        np.array(body.segment_joint, dtype=np.int64)[segment] + 1,
        np.array(local, dtype=float).reshape(-1, 3),
        np.array(body.limits.lower, dtype=float),
        np.array(body.limits.upper, dtype=float),
        np.array([path + [0] * (int(depth.max()) + 1 - len(path)) for path in paths], dtype=np.int64),
        depth,
        chart.ball[0].astype(np.int64),
        chart.sign[:, 0].astype(float),
        body.n_root,
    )


@compiled
def sums_of(chain):
    """Return Sums for a chain, to be filled."""
    n, (nv, deep) = chain.parent.shape[0] + 1, chain.path.shape
    return _Sums(
        np.empty((n, 3, 3)),
        np.zeros((n, 3)),
        np.zeros((n, 6)),
        np.empty((n, 16)),
        np.empty((n, 9)),
        np.zeros((nv, deep)),
    )


@compiled
def _set_twist(at, s, x, y, z):
    """Set the twist of slot ``s`` to a unit turn about the axis x, y, z through its origin."""
    o, t = at.origin[s], at.twist[s]
    t[0], t[1], t[2], t[3], t[4], t[5] = o[1] * z - o[2] * y, o[2] * x - o[0] * z, o[0] * y - o[1] * x, x, y, z


@compiled
def place(chain, q, at):
    """Fill rotation, origin and twist of ``at`` at the posture q (nq,)."""
    R, o, first = at.rotation, at.origin, q.shape[0] - chain.parent.shape[0]
    x, y, z, w = (q[3], q[4], q[5], q[6]) if chain.roots else (0.0, 0.0, 0.0, 1.0)
    R[0, 0, 0], R[0, 0, 1], R[0, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    R[0, 1, 0], R[0, 1, 1], R[0, 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    R[0, 2, 0], R[0, 2, 1], R[0, 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    for j in range(chain.parent.shape[0]):
        above, own, turn, t, e = R[chain.parent[j] + 1], R[j + 1], chain.turn[j], chain.translation[j], chain.axis[j]
        sine, versine = np.sin(q[first + j]), 1 - np.cos(q[first + j])
        for k in range(3):
            a = turn[0, 0, k] + sine * turn[1, 0, k] + versine * turn[2, 0, k]
            b = turn[0, 1, k] + sine * turn[1, 1, k] + versine * turn[2, 1, k]
            c = turn[0, 2, k] + sine * turn[1, 2, k] + versine * turn[2, 2, k]
            own[0, k] = above[0, 0] * a + above[0, 1] * b + above[0, 2] * c
            own[1, k] = above[1, 0] * a + above[1, 1] * b + above[1, 2] * c
            own[2, k] = above[2, 0] * a + above[2, 1] * b + above[2, 2] * c
        for c in range(3):
            o[j + 1, c] = o[chain.parent[j] + 1, c] + above[c, 0] * t[0] + above[c, 1] * t[1] + above[c, 2] * t[2]
        ax = own[0, 0] * e[0] + own[0, 1] * e[1] + own[0, 2] * e[2]
        ay = own[1, 0] * e[0] + own[1, 1] * e[1] + own[1, 2] * e[2]
        az = own[2, 0] * e[0] + own[2, 1] * e[1] + own[2, 2] * e[2]
        _set_twist(at, j + 1, ax, ay, az)


@compiled
def add_up(chain, xyz, weight, q, at):
    """Fill the sums of ``at`` for markers xyz (K, 3) m of ``weight`` (K,) at a placed q; return the cost, m²."""
    S, cost = at.below, 0.0
    S[:] = 0.0
    x, y, z = (q[0], q[1], q[2]) if chain.roots else (0.0, 0.0, 0.0)
    for k in range(chain.slot.shape[0]):
        w = weight[k]
        if w <= 0:
            continue
        T, R, o, local = S[chain.slot[k]], at.rotation[chain.slot[k]], at.origin[chain.slot[k]], chain.local[k]
        px = o[0] + R[0, 0] * local[0] + R[0, 1] * local[1] + R[0, 2] * local[2]
        py = o[1] + R[1, 0] * local[0] + R[1, 1] * local[1] + R[1, 2] * local[2]
        pz = o[2] + R[2, 0] * local[0] + R[2, 1] * local[1] + R[2, 2] * local[2]
        mx, my, mz = xyz[k, 0] - x, xyz[k, 1] - y, xyz[k, 2] - z
        cost += 0.5 * w * ((px - mx) ** 2 + (py - my) ** 2 + (pz - mz) ** 2)
        px, py, pz = w * px, w * py, w * pz  # below: sums of w, w p, w m and, row by row, w p m'
        T[0] += w
        T[1], T[2], T[3] = T[1] + px, T[2] + py, T[3] + pz
        T[4], T[5], T[6] = T[4] + w * mx, T[5] + w * my, T[6] + w * mz
        T[7], T[8], T[9] = T[7] + px * mx, T[8] + px * my, T[9] + px * mz
        T[10], T[11], T[12] = T[10] + py * mx, T[11] + py * my, T[12] + py * mz
        T[13], T[14], T[15] = T[13] + pz * mx, T[14] + pz * my, T[15] + pz * mz
    for j in range(chain.parent.shape[0] - 1, -1, -1):
        for c in range(16):
            S[chain.parent[j] + 1, c] += S[j + 1, c]
    return cost


@compiled
def add_up_model(chain, weight, at):
    """Fill ``at.model``."""
    S = at.model
    S[:] = 0.0
    p = np.empty(3)
    for k in range(chain.slot.shape[0]):
        s = chain.slot[k]
        for c in range(3):
            p[c] = at.origin[s, c]
            for d in range(3):
                p[c] += at.rotation[s, c, d] * chain.local[k, d]
        for c in range(3):
            for d in range(3):
                S[s, 3 * c + d] += weight[k] * p[c] * p[d]
    for j in range(chain.parent.shape[0] - 1, -1, -1):
        for c in range(9):
            S[chain.parent[j] + 1, c] += S[j + 1, c]


@compiled
def _slope_along(at, s):
    """Return the derivative of the cost by the coordinate of slot ``s``."""
    t, S = at.twist[s], at.below[s]
    linear = t[0] * (S[1] - S[4]) + t[1] * (S[2] - S[5]) + t[2] * (S[3] - S[6])
    return linear + t[3] * (S[14] - S[12]) + t[4] * (S[9] - S[13]) + t[5] * (S[10] - S[8])


@compiled
def gradient(chain, at, g):
    """Fill the gradient g (nv,)."""
    S = at.below[0]
    if chain.roots:
        g[0], g[1], g[2] = S[1] - S[4], S[2] - S[5], S[3] - S[6]
        g[3], g[4], g[5] = S[14] - S[12], S[9] - S[13], S[10] - S[8]
    for j in range(chain.parent.shape[0]):
        g[chain.roots + j] = _slope_along(at, j + 1)


@compiled
def hessian(chain, at, seen, cross):
    """Fill ``at.factor``: row k holds the second derivatives by coordinate k and every coordinate on its path, itself
    last.

    ``seen`` (n + 1, 3) and ``cross`` (n + 1, 9): A and M of every slot for Newton, S and sum w p p' for Gauss-Newton.
    """
    H, roots = at.factor, chain.roots
    if roots:
        S, M = at.below[0], cross[0]
        trace = M[0] + M[4] + M[8]
        for c in range(3):
            for d in range(3):
                H[c, d] = S[0] if c == d else 0.0
                H[3 + c, d] = 0.0
                # Turns do not commute: second derivatives by the rotation vector are the symmetric part.
                H[3 + c, 3 + d] = (trace if c == d else 0.0) - 0.5 * (M[3 * c + d] + M[3 * d + c])
        H[3, 1], H[3, 2], H[4, 0], H[4, 2], H[5, 0], H[5, 1] = -S[3], S[2], S[3], -S[1], -S[2], S[1]
    for j in range(chain.parent.shape[0]):
        S, A, M, t, row = at.below[j + 1], seen[j + 1], cross[j + 1], at.twist[j + 1], H[roots + j]
        vx, vy, vz, x, y, z = t[0], t[1], t[2], t[3], t[4], t[5]
        fx, fy, fz = S[0] * vx + y * S[3] - z * S[2], S[0] * vy + z * S[1] - x * S[3], S[0] * vz + x * S[2] - y * S[1]
        trace = M[0] + M[4] + M[8]
        mx = A[1] * vz - A[2] * vy + trace * x - (M[0] * x + M[1] * y + M[2] * z)
        my = A[2] * vx - A[0] * vz + trace * y - (M[3] * x + M[4] * y + M[5] * z)
        mz = A[0] * vy - A[1] * vx + trace * z - (M[6] * x + M[7] * y + M[8] * z)
        if roots:
            row[0], row[1], row[2], row[3], row[4], row[5] = fx, fy, fz, mx, my, mz
        for d in range(roots, chain.depth[roots + j] + 1):
            u = at.twist[chain.path[roots + j, d] - roots + 1]
            row[d] = u[0] * fx + u[1] * fy + u[2] * fz + u[3] * mx + u[4] * my + u[5] * mz


@compiled
def _scale_of(chain, at, i):
    """Return the marker weight that coordinate ``i`` moves and its lever, m."""
    return at.below[max(i - chain.roots + 1, 0), 0], (1.0 if chain.roots and i < 3 else _LENGTH)


@compiled
def factorise(chain, at, held, damping):
    """Damp the matrix, take the ``held`` coordinates out of it and replace it by its factors L'DL along the tree,
    without fill-in.

    Return False where a pivot is flat or negative (Featherstone 2008, table 6.3).
    """
    H, path, depth = at.factor, chain.path, chain.depth
    for k in range(held.shape[0]):
        weight, lever = _scale_of(chain, at, k)
        H[k, depth[k]] += damping * weight * lever * lever  # Levenberg-Marquardt, in units of each coordinate
        for d in range(depth[k] + 1):
            if held[k] or held[path[k, d]]:
                H[k, d] = 1.0 if d == depth[k] else 0.0
    for k in range(held.shape[0] - 1, -1, -1):
        weight, lever = _scale_of(chain, at, k)
        row, pivot = H[k], H[k, depth[k]]
        if pivot <= _FLAT * (1.0 if held[k] else weight * lever * lever):
            return False
        over = 1.0 / pivot
        for d in range(depth[k] - 1, -1, -1):
            factor, above = row[d] * over, H[path[k, d]]  # L_kd = H_kd / D_k
            for e in range(d + 1):
                above[e] -= factor * row[e]  # Schur complement
            row[d] = factor
        row[depth[k]] = over  # 1 / D_k
    return True


@compiled
def step_from(chain, at, g, held, x):
    """Fill x (nv,) with the step to the minimum from the factors and the gradient; held coordinates stay."""
    H, path, depth = at.factor, chain.path, chain.depth
    for k in range(g.shape[0]):
        x[k] = 0.0 if held[k] else -g[k]
    for k in range(g.shape[0] - 1, -1, -1):
        for d in range(depth[k]):
            x[path[k, d]] -= H[k, d] * x[k]  # L' z = -g, from the tips
    for k in range(g.shape[0]):
        x[k] *= H[k, depth[k]]  # y = D^-1 z
        for d in range(depth[k]):
            x[k] -= H[k, d] * x[path[k, d]]  # L x = y, from the root


_STEP_LIMIT = 0.7
"""rad, largest change of an angle in one step: keeps a step of an ill-determined joint (straight arm, gimbal) inside
its model.
"""

_FIRST_DAMPING = 0.1
"""Damping after the first refused step, in units of the moved marker weight times lever squared; ten times more
after each further one.
"""

_NEAR = 0.03
"""m, slope below which the exact second derivatives are tried; farther away Gauss-Newton descends better."""

_ROUNDING = 1e-13
"""A rise of the cost by less than this fraction of the markers' squared distances from their mean is rounding, not a
rise.
"""


@compiled
def _held_at(chain, q, g, held):
    """Mark the coordinates that a limit holds because the cost would fall beyond it."""
    first, roots = q.shape[0] - chain.parent.shape[0], chain.roots
    for i in range(g.shape[0]):
        j = i - roots
        held[i] = j >= 0 and (
            chain.lower[j] == chain.upper[j]
            or (q[first + j] <= chain.lower[j] and g[i] > 0)
            or (q[first + j] >= chain.upper[j] and g[i] < 0)
        )


@compiled
def turn_balls(chain, at, g, held, cardan, turning):
    """Mark the ball joints that step by a rotation vector, not ``cardan`` or held; turn axis and gradient."""
    for b in range(chain.ball.shape[0]):
        j = chain.ball[b]
        i = chain.roots + j
        turning[b] = not (cardan[b] or held[i] or held[i + 1] or held[i + 2])
        if turning[b]:
            # Third axis at zero second angle, in the frame of the first joint: square to both others.
            R, e = at.rotation[j + 1], chain.axis[j + 2]
            x = R[0, 0] * e[0] + R[0, 1] * e[1] + R[0, 2] * e[2]
            y = R[1, 0] * e[0] + R[1, 1] * e[1] + R[1, 2] * e[2]
            z = R[2, 0] * e[0] + R[2, 1] * e[1] + R[2, 2] * e[2]
            _set_twist(at, j + 3, x, y, z)
            g[i + 2] = _slope_along(at, j + 3)


@compiled
def _largest_slope(chain, at, g, held):
    """Return the largest free gradient per moved marker weight and lever, m."""
    worst = 0.0
    for i in range(g.shape[0]):
        weight, lever = _scale_of(chain, at, i)
        if not held[i] and weight > 0:
            worst = max(worst, abs(g[i]) / (weight * lever))
    return worst


@compiled
def displace(chain, q, x, turning, stopped, out):
    """Fill ``out`` with q moved by x (nv,), within the limits; mark the ball joints ``stopped`` at one."""
    roots, first = chain.roots, q.shape[0] - chain.parent.shape[0]
    if roots:
        for c in range(3):
            out[c] = q[c] + x[c]
        a, b, c, d = product(exponential(x[3], x[4], x[5]), (q[3], q[4], q[5], q[6]))
        over = 1.0 / np.sqrt(a * a + b * b + c * c + d * d)
        out[3], out[4], out[5], out[6] = a * over, b * over, c * over, d * over
    for j in range(chain.parent.shape[0]):
        out[first + j] = min(max(q[first + j] + x[roots + j], chain.lower[j]), chain.upper[j])
    for b in range(chain.ball.shape[0]):
        stopped[b] = False
        if turning[b]:
            j = chain.ball[b]
            angles, step = q[first + j : first + j + 3], x[roots + j : roots + j + 3]
            lower, upper = chain.lower[j : j + 3], chain.upper[j : j + 3]
            stopped[b] = turned(angles, step, chain.sign[b], lower, upper, out[first + j : first + j + 3])


@compiled
def _shorten(chain, x):
    """Shorten the step where an angle would change by more than STEP_LIMIT."""
    largest = 0.0
    for i in range(3 if chain.roots else 0, x.shape[0]):
        largest = max(largest, abs(x[i]))
    if largest > _STEP_LIMIT:
        for i in range(x.shape[0]):
            x[i] *= _STEP_LIMIT / largest


@compiled
def _centred_squares(chain, xyz, weight):
    """Return the weighted squared distances of the markers from their mean (fixed root: from the origin), m²."""
    total, square = 0.0, 0.0
    mean = np.zeros(3)
    for k in range(xyz.shape[0]):
        total += weight[k]
        for c in range(3):
            mean[c] += weight[k] * xyz[k, c]
            square += weight[k] * xyz[k, c] * xyz[k, c]
    if chain.roots and total > 0:
        square -= (mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2) / total  # sum w |x - mean|²
    return square


@compiled
def _turn_stopped_by_angles(stopped, better, cardan):
    """Let the ball joints that a limit stopped turn by their angles (``cardan``) until a better step is free of it;
    return whether one was stopped that turned freely.
    """
    first = False
    for b in range(stopped.shape[0]):
        first = first or (stopped[b] and not cardan[b])
        cardan[b] = stopped[b] or (cardan[b] and not better)
    return first


@compiled
def minimise_frames(chain, xyz, weight, frames, found, tolerance, steps):
    """Move the postures ``found.q`` (B, nq) to minima for the markers xyz (T, K, 3) m, of ``weight`` (T, K), in
    ``frames`` (B,), in at most ``steps``, and fill the rest of ``found``: ``cost`` (B,) m², ``slope`` (B,) m.

    The slope is the largest gradient over the coordinates that no limit holds, divided by the marker weight that the
    coordinate moves and its lever (1, or LENGTH for an angle): a mean marker displacement that could still be gained; a
    frame stops where it falls under ``tolerance``.
    """
    q, cost, slope = found.q, found.cost, found.slope
    at, nv, nq = sums_of(chain), chain.depth.shape[0], q.shape[1]
    g, x, held, new = np.empty(nv), np.empty(nv), np.zeros(nv, dtype=np.bool_), np.empty(nq)
    groups = chain.ball.shape[0]
    cardan, turning, stopped = np.zeros(groups, np.bool_), np.zeros(groups, np.bool_), np.zeros(groups, np.bool_)
    for f in range(q.shape[0]):
        now, seen, w = q[f], xyz[frames[f]], weight[frames[f]]
        damping, bent = 0.0, False
        cardan[:] = False
        place(chain, now, at)
        cost[f] = add_up(chain, seen, w, now, at)
        for step in range(steps + 1):
            gradient(chain, at, g)
            _held_at(chain, now, g, held)
            turn_balls(chain, at, g, held, cardan, turning)
            slope[f] = _largest_slope(chain, at, g, held)
            if slope[f] <= tolerance or step == steps:
                break
            newton = slope[f] < _NEAR and not bent
            if newton:
                hessian(chain, at, at.below[:, 4:7], at.below[:, 7:])  # A, M: exact second derivatives
            else:
                add_up_model(chain, w, at)
                hessian(chain, at, at.below[:, 1:4], at.model[:, 0:9])  # sliced: the same type as above
            convex = factorise(chain, at, held, damping)
            x[:] = 0.0
            if convex:
                step_from(chain, at, g, held, x)
                _shorten(chain, x)
            displace(chain, now, x, turning, stopped, new)
            lowered = cost[f]
            if convex:
                place(chain, new, at)
                lowered = add_up(chain, seen, w, new, at)
            better = convex and (
                lowered <= cost[f] or lowered <= cost[f] + _ROUNDING * _centred_squares(chain, seen, w)
            )
            retreat = _turn_stopped_by_angles(stopped, better, cardan)
            if better:
                damping = 0.1 * damping if damping > 1e-4 else 0.0
                cost[f] = lowered
                for i in range(nq):  # an array as a whole brings numba's words on unequal shapes along: 2 s to compile
                    now[i] = new[i]
                bent = False
            else:
                if (convex or not newton) and not retreat:  # not convex: Gauss-Newton next, undamped
                    damping = max(10 * damping, _FIRST_DAMPING)
                bent = bent or not convex
                place(chain, now, at)
                add_up(chain, seen, w, now, at)


@compiled
def fill_distances(chain, xyz, q, out):
    """Fill ``out`` (B, K) m with the distance of the markers xyz (B, K, 3) from the model's at q (B, nq)."""
    at = sums_of(chain)
    for f in range(q.shape[0]):
        place(chain, q[f], at)
        x, y, z = (q[f, 0], q[f, 1], q[f, 2]) if chain.roots else (0.0, 0.0, 0.0)
        for k in range(xyz.shape[1]):
            o, R, a, m = at.origin[chain.slot[k]], at.rotation[chain.slot[k]], chain.local[k], xyz[f, k]
            rx = o[0] + x - m[0] + R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2]
            ry = o[1] + y - m[1] + R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2]
            rz = o[2] + z - m[2] + R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2]
            out[f, k] = np.sqrt(rx * rx + ry * ry + rz * rz)
