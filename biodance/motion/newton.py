"""Minimise the marker cost of many frames at once: projected Newton with damping, on the manifold of postures.

Each frame has its own damping and its own set of joints held at a limit. A frame takes the exact second derivatives where they are
positive definite and Gauss-Newton's where they are not, so a stationary point that is no minimum is left. Convergence is judged by
the projected gradient, never by the size of a step or of the change of the cost (Bertsekas 1982, DOI 10.1137/0320018).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.motion.ball import turned
from biodance.motion.marker_moments import Fit, Measured, fit, gradient, merge, take
from biodance.motion.quaternion import exponential, normalised, product
from biodance.motion.tree import Tree
from biodance.motion.tree_solve import Local, lever, moved_weight, quadratic, solve
from biodance.records import Array

STEP_LIMIT = 0.7
"""rad, largest change of an angle in one step: keeps a step of an ill-determined joint (straight arm, gimbal) inside its model."""

FIRST_DAMPING = 0.1
"""Damping after the first refused step, in units of the moved marker weight times lever squared; ten times more after each further one."""

NEAR = 0.03
"""m, slope below which the exact second derivatives are tried; farther away Gauss-Newton descends better."""

ROUNDING = 1e-13
"""A rise of the cost by less than this fraction of the markers' squared distances from their mean is rounding, not a rise."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """What was reached: ``q`` (nq, B); ``cost`` (B,) m²; ``slope`` (B,) m, largest projected gradient; ``steps`` (B,) steps tried."""

    q: Array
    cost: Array
    slope: Array
    steps: NDArray[np.intp]


def minimise(tree: Tree, measured: Measured, q: Array, *, tolerance: float, steps: int) -> Minimum:
    """Descend from ``q`` (nq, B) for at most ``steps`` steps; frames whose slope falls under ``tolerance`` (m) stop.

    ``slope`` is the largest gradient over the coordinates that a limit does not hold, divided by the marker weight that the coordinate
    moves and its lever (1, or ``tree_solve.LENGTH`` for an angle): a mean marker displacement in m that could still be gained.
    """
    frames = q.shape[1]
    out = Minimum(q.copy(), np.empty(frames), np.empty(frames), np.zeros(frames, dtype=np.intp))
    at = fit(tree, measured, q)
    where, damping, bent = np.arange(frames), np.zeros(frames), np.zeros(frames, dtype=bool)
    cardan = np.zeros((tree.balls.first.size, frames), dtype=bool)
    for step in range(steps + 1):
        local, turning = _local(tree, at, q, cardan)
        slope = _slope(tree, at, local)
        going = slope > tolerance
        out.q[:, where], out.cost[where], out.slope[where] = q, at.cost, slope
        out.steps[where] += going
        if step == steps or not going.any():
            break
        if going.mean() < 0.7:
            keep = np.flatnonzero(going)
            measured, at, local, q, turning, cardan = (
                take(measured, keep),
                take(at, keep),
                take(local, keep),
                q[:, keep],
                turning[:, keep],
                cardan[:, keep],
            )
            where, damping, bent, going, slope = where[keep], damping[keep], bent[keep], going[keep], slope[keep]
        newton = (slope < NEAR) & ~bent
        move, convex = solve(tree, quadratic(tree, measured, at, local, damping=damping, newton=newton))
        trial, stopped = displace(tree, q, _limited(tree, np.where(convex & going, move, 0.0)), turning)
        new = fit(tree, measured, trial)
        better = convex & (new.cost <= at.cost + ROUNDING * measured.square)
        raised = ~better & (convex | ~newton) & ~(stopped & ~cardan).any(axis=0)
        eased = np.where(damping > 1e-4, 0.1 * damping, 0.0)
        damping = np.where(better, eased, np.where(raised, np.maximum(10 * damping, FIRST_DAMPING), damping))
        q, at, cardan = np.where(better, trial, q), merge(better, new, at), stopped | (cardan & ~better)
        bent = ~better & (bent | ~convex)
    return out


def displace(tree: Tree, q: Array, step: Array, turning: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    """Return ``q`` (nq, B) moved by ``step`` (nv, B) and brought into the limits, and (G, B) the ball joints that a limit stopped.

    Root: translation, then rotation vector, lab frame; ball joints where ``turning`` (G, B): rotation vector; else angles.
    """
    out = np.empty_like(q)
    r, first = tree.n_root, len(q) - tree.joints
    if r:
        out[:3] = q[:3] + step[:3]
        out[3:7] = normalised(product(exponential(step[3:6]), q[3:7]))
    angles = np.clip(q[first:] + step[r:], tree.lower, tree.upper)
    joints, stopped = tree.balls, turning
    if joints.first.size:
        lower, upper = joints.angles_of(tree.lower), joints.angles_of(tree.upper)
        new = turned(joints.angles_of(q[first:]), np.where(turning, joints.angles_of(step[r:]), 0.0), joints, lower, upper)
        stopped = turning & ((new <= lower) | (new >= upper)).any(axis=0)
        for k in range(3):
            angles[joints.first + k] = np.where(turning, new[k], angles[joints.first + k])
    out[first:] = angles
    return out, stopped


def _local(tree: Tree, at: Fit, q: Array, cardan: NDArray[np.bool_]) -> tuple[Local, NDArray[np.bool_]]:
    """Return the local coordinates at ``q`` and (G, B) the ball joints that step by a rotation vector: all but ``cardan`` and the held.

    A coordinate is held where a joint is at a limit and the cost would fall beyond it.
    """
    slope = gradient(tree, at.twist, at.wrench)
    free = np.ones(slope.shape, dtype=bool)
    angle, joints = q[len(q) - tree.joints :], slope[tree.n_root :]
    free[tree.n_root :] = ~(((angle <= tree.lower) & (joints > 0)) | ((angle >= tree.upper) & (joints < 0)))
    turning = ~cardan & tree.balls.angles_of(free[tree.n_root :]).all(axis=0)
    twist = at.twist.copy()
    third = tree.balls.first + 2
    twist[third] = np.where(turning[:, None], at.third, twist[third])
    return Local(twist, gradient(tree, twist, at.wrench), free), turning


def _slope(tree: Tree, at: Fit, local: Local) -> Array:
    """Return (B,) m: the largest free gradient per moved marker weight and lever."""
    weight = moved_weight(tree, at)
    gain = np.abs(local.gradient) / (np.where(weight > 0, weight, 1.0) * lever(tree))
    return np.max(np.where(local.free & (weight > 0), gain, 0.0), axis=0)


def _limited(tree: Tree, step: Array) -> Array:
    """Return the step, shortened where an angle would change by more than STEP_LIMIT."""
    angles = step[3:] if tree.n_root else step
    return step * np.minimum(1.0, STEP_LIMIT / np.maximum(np.abs(angles).max(axis=0, initial=0.0), STEP_LIMIT))
