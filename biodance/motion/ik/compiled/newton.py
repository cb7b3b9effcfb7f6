"""Minimise the marker cost of frames one by one: projected Newton with damping, on the manifold of postures, compiled
(numba).

Each frame has its own damping and its own set of joints held at a limit. A frame takes the exact second derivatives
where they are positive definite and Gauss-Newton's where they are not, so a stationary point that is no minimum is
left. Convergence is judged by the projected gradient, never by the size of a step or of the change of the cost
(Bertsekas 1982, DOI 10.1137/0320018). Ball joints step by a rotation vector, so that their Cardan angles' singularity
is no obstacle, and by their angles where a limit is met.
"""

import numpy as np

from biodance.motion.ik.compiled import compiled
from biodance.motion.ik.compiled.ball_step import exponential, product, turned
from biodance.motion.ik.compiled.chain import (
    add_up,
    add_up_model,
    factorise,
    gradient,
    hessian,
    place,
    scale_of,
    set_twist,
    slope_along,
    step_from,
    sums_of,
)

STEP_LIMIT = 0.7
"""rad, largest change of an angle in one step: keeps a step of an ill-determined joint (straight arm, gimbal) inside
its model.
"""

FIRST_DAMPING = 0.1
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
def held_at(chain, q, at, g, held):
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
    """Mark the ball joints that step by a rotation vector, all but ``cardan`` and the held, and turn their third
    axis and gradient so.
    """
    for b in range(chain.ball.shape[0]):
        j = chain.ball[b]
        i = chain.roots + j
        turning[b] = not (cardan[b] or held[i] or held[i + 1] or held[i + 2])
        if turning[b]:
            R, e = at.rotation[j + 1], chain.axis[j + 2]
            x = R[0, 0] * e[0] + R[0, 1] * e[1] + R[0, 2] * e[2]
            y = R[1, 0] * e[0] + R[1, 1] * e[1] + R[1, 2] * e[2]
            z = R[2, 0] * e[0] + R[2, 1] * e[1] + R[2, 2] * e[2]
            set_twist(at, j + 3, x, y, z)
            g[i + 2] = slope_along(at, j + 3)


@compiled
def largest_slope(chain, at, g, held):
    """Return the largest free gradient per moved marker weight and lever, m."""
    worst = 0.0
    for i in range(g.shape[0]):
        weight, lever = scale_of(chain, at, i)
        if not held[i] and weight > 0:
            worst = max(worst, abs(g[i]) / (weight * lever))
    return worst


@compiled
def displace(chain, q, x, turning, stopped, out):
    """Fill ``out`` with q moved by the step x (nv,), angles within their limits; mark the ball joints that a limit
    ``stopped``.
    """
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
def shorten(chain, x):
    """Shorten the step where an angle would change by more than STEP_LIMIT."""
    largest = 0.0
    for i in range(3 if chain.roots else 0, x.shape[0]):
        largest = max(largest, abs(x[i]))
    if largest > STEP_LIMIT:
        for i in range(x.shape[0]):
            x[i] *= STEP_LIMIT / largest


@compiled
def centred_squares(chain, xyz, weight):
    """Return the weighted squared distances of the markers from their mean, m² (from the lab's origin for a fixed
    root).
    """
    total, square = 0.0, 0.0
    mean = np.zeros(3)
    for k in range(xyz.shape[0]):
        total += weight[k]
        for c in range(3):
            mean[c] += weight[k] * xyz[k, c]
            square += weight[k] * xyz[k, c] * xyz[k, c]
    if chain.roots and total > 0:
        square -= (mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2) / total
    return square


@compiled
def minimise_frames(chain, xyz, weight, frames, found, tolerance, steps):
    """Move the postures ``found.q`` (B, nq) to minima for the markers xyz (T, K, 3) m, of ``weight`` (T, K), in
    ``frames`` (B,), in at most ``steps``, and fill the rest of ``found``: ``cost`` (B,) m², ``slope`` (B,) m, ``steps``
    (B,) taken.

    The slope is the largest gradient over the
    coordinates that no limit holds, divided by the marker weight that the coordinate moves and its lever (1, or LENGTH
    for an angle): a mean marker displacement that could still be gained; a frame stops where it falls under
    ``tolerance``.
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
            held_at(chain, now, at, g, held)
            turn_balls(chain, at, g, held, cardan, turning)
            slope[f], found.steps[f] = largest_slope(chain, at, g, held), step
            if slope[f] <= tolerance or step == steps:
                break
            newton = slope[f] < _NEAR and not bent
            if newton:
                hessian(chain, at, at.below[:, 4:7], at.below[:, 7:])
            else:
                add_up_model(chain, w, at)
                hessian(chain, at, at.below[:, 1:4], at.model[:, 0:9])  # sliced: the same type as above
            convex = factorise(chain, at, held, damping)
            x[:] = 0.0
            if convex:
                step_from(chain, at, g, held, x)
                shorten(chain, x)
            displace(chain, now, x, turning, stopped, new)
            lowered = cost[f]
            if convex:
                place(chain, new, at)
                lowered = add_up(chain, seen, w, new, at)
            better = convex and (lowered <= cost[f] or lowered <= cost[f] + _ROUNDING * centred_squares(chain, seen, w))
            retreat = False
            for b in range(groups):
                retreat = retreat or (stopped[b] and not cardan[b])
                cardan[b] = stopped[b] or (cardan[b] and not better)
            if better:
                damping = 0.1 * damping if damping > 1e-4 else 0.0
                cost[f] = lowered
                for i in range(nq):  # an array as a whole brings numba's words on unequal shapes along: 2 s to compile
                    now[i] = new[i]
                bent = False
            else:
                if (convex or not newton) and not retreat:
                    damping = max(10 * damping, FIRST_DAMPING)
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
