"""Optimise the via points of one trajectory so that the regressor it adds to the history reveals the most.

For bodies with few joints and any criterion: the regressor of the trajectory and its derivative with respect to every via point come
from one batched call on centrally perturbed trajectories, the criterion's own gradient is analytic, joint ranges are linear constraints on
the samples, and SLSQP does the rest. The paper's planar example (III.C) is solved with it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize

from biodance.body.body import Body
from biodance.dance.criteria import Criterion
from biodance.dance.splines import Basis
from biodance.dance.target import Target
from biodance.identify.information import fold
from biodance.motion.kinematics import segment_motion
from biodance.motion.regressor import regressor_of
from biodance.records import Array, Motion

STEP = 1e-5
"""rad, central difference of the regressor (error of second order: 1e-10 relative)."""


@dataclass(frozen=True, eq=False)
class Excitation:
    """One design problem on a body with fixed root: ``basis`` (n samples, k via points), ``channels`` of the wrench that are measured,
    ``gravity`` (3,) m/s² in the lab frame, ``target`` and ``criterion``.
    """

    body: Body
    basis: Basis
    channels: tuple[int, ...]
    target: Target
    criterion: Criterion
    gravity: Array

    def regressor(self, points: Array) -> Array:
        """Return W (..., n channels, 10N) of trajectories through ``points`` (..., k, joints) rad."""
        samples = [np.einsum("nk,...kj->...nj", m, points) for m in (self.basis.position, self.basis.velocity, self.basis.acceleration)]
        q, v, a = (s.reshape(-1, s.shape[-1]) for s in samples)
        motion = Motion(np.arange(len(q), dtype=float), q, v, a)
        W = regressor_of(segment_motion(self.body, motion), gravity=self.gravity)[:, list(self.channels)]
        return W.reshape(*points.shape[:-2], -1, W.shape[2])

    def extend(self, history: Array, points: Array) -> Array:
        """Return the triangle (10N, 10N) of ``history`` (m, 10N) together with one trajectory."""
        return fold(self.regressor(points), history)

    def value_and_gradient(self, flat: Array, history: Array) -> tuple[float, Array]:
        """Return the criterion of ``history`` plus this trajectory, and its gradient with respect to the via points, flattened."""
        points = flat.reshape(self.basis.position.shape[1], -1)
        W = self.regressor(points)
        value, slope = self.criterion(fold(W, history), self.target)
        steps = STEP * np.eye(flat.size).reshape(-1, *points.shape)
        both = self.regressor(np.concatenate([points + steps, points - steps]))
        dW = (both[: flat.size] - both[flat.size :]) / (2 * STEP)
        return value, 2 * np.einsum("irp,rp->i", dW, W @ slope)


def interpolating_basis(duration: float, *, via: int, rate: float = 50.0) -> Basis:
    """Return the cubic B-spline through ``via`` points at equal distances over the whole ``duration``, ends free (paper III.C)."""
    through = np.linspace(0, duration, via)
    time = np.linspace(0, duration, round(duration * rate) + 1)
    spline = make_interp_spline(through, np.eye(via), k=min(3, via - 1))
    return Basis(time, *(spline(time, nu=nu) for nu in range(3)))


def design(problem: Excitation, start: Array, history: Array, *, iterations: int = 200) -> Array:
    """Return via points (k, joints) rad that minimise the criterion within the joint ranges, from ``start`` (k, joints)."""
    limits, samples = problem.body.limits, problem.basis.position
    joints = start.shape[1]
    rows = np.einsum("nk,ij->nikj", samples, np.eye(joints)).reshape(len(samples) * joints, -1)
    low, high = np.tile(limits.lower, len(samples)), np.tile(limits.upper, len(samples))
    ranges = {"type": "ineq", "fun": lambda x: np.concatenate([rows @ x - low, high - rows @ x]), "jac": lambda _: np.vstack([rows, -rows])}
    judge, options = problem.value_and_gradient, {"maxiter": iterations}
    found = minimize(judge, start.ravel(), args=(history,), jac=True, method="SLSQP", constraints=[ranges], options=options)
    best = found.x if found.fun < judge(start.ravel(), history)[0] else start.ravel()
    return best.reshape(start.shape)
