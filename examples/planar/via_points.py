"""Optimise the via points of one trajectory so that the regressor it adds to the history reveals the most.

For bodies with few joints and any criterion: the regressor of the trajectory and its derivative with respect to every
via point come from one batched call on centrally perturbed trajectories, the criterion's own gradient is analytic,
joint ranges are linear constraints on the samples, and SLSQP does the rest. The paper's planar example (III.C) is
solved with it.
"""

from dataclasses import dataclass

import numpy as np
from criteria import Criterion
from scipy.optimize import minimize
from target import Target

from biodance.body.body import Body
from biodance.dance.problem.splines import Basis
from biodance.identification.posterior import fold
from biodance.motion.dynamics import regressor_of
from biodance.motion.kinematics import segment_motion
from biodance.records import Array, Motion

STEP = 1e-5
"""rad, central difference of the regressor (error of second order: 1e-10 relative)."""
ALL_POINTS = slice(None)
EVERY = 4
"""Samples from one to the next at which the optimiser sees the joint ranges."""


@dataclass(frozen=True, eq=False)
class Excitation:
    """One design problem on a body with fixed root: ``basis`` (n samples, k via points), ``channels`` of the wrench
    that are measured, ``gravity`` (3,) m/s² in the lab frame, ``target`` and ``criterion``.
    """

    body: Body
    basis: Basis
    channels: tuple[int, ...]
    target: Target
    criterion: Criterion
    gravity: Array

    def samples(self, points: Array) -> tuple[Array, Array, Array]:
        """Return position rad, velocity rad/s and acceleration rad/s² (n, joints) of the trajectory through ``points``
        (k, joints) rad.
        """
        basis = self.basis
        return basis.position @ points, basis.velocity @ points, basis.acceleration @ points

    def rows(self, q: Array, v: Array, a: Array) -> Array:
        """Return W (..., channels, 10N) at the states ``q``, ``v``, ``a`` (..., joints)."""
        q_rows, v_rows, a_rows = (state.reshape(-1, state.shape[-1]) for state in (q, v, a))
        motion = Motion(np.arange(len(q_rows), dtype=float), q_rows, v_rows, a_rows)
        W = regressor_of(segment_motion(self.body, motion), gravity=self.gravity)
        return W[:, list(self.channels)].reshape(*q.shape[:-1], len(self.channels), -1)

    def regressor(self, points: Array) -> Array:
        """Return W (n channels, 10N) of the trajectory through ``points`` (k, joints) rad."""
        W = self.rows(*self.samples(points))
        return W.reshape(-1, W.shape[-1])

    def extend(self, history: Array, points: Array) -> Array:
        """Return the triangle (10N, 10N) of ``history`` (m, 10N) together with one trajectory."""
        return fold(self.regressor(points), history)

    def value_and_gradient(self, points: Array, history: Array) -> tuple[float, Array]:
        """Return the criterion of ``history`` plus this trajectory, and its gradient (k, joints) with respect to the
        points.
        """
        states = np.stack(self.samples(points))
        value, slope = self.criterion(fold(self.regressor(points), history), self.target)
        kinds, frames, joints = states.shape
        steps = STEP * np.eye(kinds * joints).reshape(kinds * joints, kinds, 1, joints)
        ahead, behind = (self.rows(*np.moveaxis(states + sign * steps, 1, 0)) for sign in (1, -1))
        W = (ahead[0] + behind[0]) / 2
        by_state = 2 * np.einsum("itcp,tcp->it", (ahead - behind) / (2 * STEP), W @ slope).reshape(
            kinds, joints, frames
        )
        matrices = (self.basis.position, self.basis.velocity, self.basis.acceleration)
        return value, sum((m.T @ g.T for m, g in zip(matrices, by_state, strict=True)), np.zeros_like(points))


def design(
    problem: Excitation, start: Array, history: Array, *, movable: slice = ALL_POINTS, iterations: int = 200
) -> Array:
    """Return points (k, joints) rad that minimise the criterion within the joint ranges, from ``start`` (k, joints).

    Only the ``movable`` points move, the others (ends that are given) stay. The optimiser sees the ranges at every
    fourth sample; what it finds is then shrunk towards mid-range until every sample respects them.
    """
    limits = problem.body.limits
    samples = problem.basis.position[::EVERY, movable]
    joints = start.shape[1]
    rows = np.einsum("nk,ij->nikj", samples, np.eye(joints)).reshape(len(samples) * joints, -1)
    given = (problem.basis.position[::EVERY] @ start).ravel() - rows @ start[movable].ravel()
    low, high = (np.tile(limit, len(samples)) - given for limit in (limits.lower, limits.upper))
    ranges = {
        "type": "ineq",
        "fun": lambda x: np.concatenate([rows @ x - low, high - rows @ x]),
        "jac": lambda _: np.vstack([rows, -rows]),
    }

    def points(x: Array) -> Array:
        moved = start.copy()
        moved[movable] = x.reshape(-1, joints)
        return moved

    def judge(x: Array) -> tuple[float, Array]:
        value, gradient = problem.value_and_gradient(points(x), history)
        return value, gradient[movable].ravel()

    found = minimize(
        judge, start[movable].ravel(), jac=True, method="SLSQP", constraints=[ranges], options={"maxiter": iterations}
    )
    candidates = [within_ranges(problem, p) for p in (points(found.x), start)]
    return min(candidates, key=lambda p: problem.value_and_gradient(p, history)[0])


def within_ranges(problem: Excitation, points: Array) -> Array:
    """Return ``points`` (k, joints) rad shrunk towards mid-range, joint by joint, so that no sample leaves its range.

    Exact because a spline is affine in its points; a given end at the limit of its joint moves only where a sample
    beyond it forces it.
    """
    limits = problem.body.limits
    middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
    reach = np.max(np.abs(problem.basis.position @ (points - middle)), axis=0)
    return middle + (points - middle) * np.minimum(1.0, half / np.maximum(reach, 1e-12))
