"""The sums behind inverse kinematics: cost, gradient, Gauss-Newton and Newton steps against plain markers and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from marker_trials import dance, points
from random_bodies import random_body

from biodance.body.human import human
from biodance.motion.marker_moments import fit, gradient
from biodance.motion.marker_problem import marker_problem
from biodance.motion.newton import displace
from biodance.motion.tree_solve import Local, lever, moved_weight, quadratic, solve
from biodance.records import Array, Subject

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))


@pytest.fixture(params=["human", "free", "fixed"])
def setting(request):
    """Return a body, one posture (nq, 1) and its problem: markers 3 cm off, one of them hidden, unequal weights."""
    rng = np.random.default_rng(0)
    tree = random_body(rng, n_segments=6, root="fixed" if request.param == "fixed" else "free_flyer")
    body = WOMAN if request.param == "human" else tree
    body = replace(body, markers=replace(body.markers, weight=rng.uniform(0.2, 1.5, len(body.markers.names))))
    q = dance(body, 1, rng, reach=0.5)
    xyz = points(body, q) + rng.normal(0, 0.03, (1, len(body.markers.names), 3))
    xyz[0, 4] = np.nan
    return body, q.T, xyz[0], marker_problem(body, list(range(xyz.shape[1])), xyz, tolerance=1e-7)


def plain(body, xyz: Array, q: Array) -> Array:
    """Return the weighted marker differences (3K', B) m of the seen markers at ``q`` (nq, B)."""
    seen = ~np.isnan(xyz).any(axis=1)
    off = np.sqrt(body.markers.weight[seen])[:, None] * (points(body, q.T)[:, seen] - xyz[seen])
    return off.reshape(q.shape[1], -1).T


def moved(problem, q: Array, step: Array) -> Array:
    """Return ``q`` moved by the steps (nv, B) of the local coordinates with plain angles."""
    many = np.repeat(q, step.shape[1], axis=1)
    return displace(problem.tree, many, step, np.zeros((problem.tree.balls.first.size, step.shape[1]), dtype=bool))[0]


def at(problem, q: Array):
    """Return the sums at ``q`` (lab origin as the origin of the sums) and the local coordinates, all free, plain angles."""
    weight = np.repeat(problem.weight.T, q.shape[1], axis=1)
    frames = np.zeros(q.shape[1], dtype=np.intp)
    measured, origin = problem.measured(frames)
    assert measured.weight.sum() == pytest.approx(weight.sum())
    here = q.copy()
    here[: min(problem.tree.n_root, 3)] -= origin[: min(problem.tree.n_root, 3)]
    found = fit(problem.tree, measured, here)
    slope = gradient(problem.tree, found.twist, found.wrench)
    return measured, found, Local(found.twist, slope, np.ones(slope.shape, dtype=bool))


def test_cost_is_half_the_weighted_squares_of_the_markers_seen(setting):
    body, q, xyz, problem = setting
    assert at(problem, q)[1].cost == pytest.approx(0.5 * (plain(body, xyz, q) ** 2).sum(axis=0), rel=1e-10)


def test_gradient_and_gauss_newton_step(setting):
    body, q, xyz, problem = setting
    measured, found, local = at(problem, q)
    unit, h = np.eye(body.nv), 1e-6
    jacobian = (plain(body, xyz, moved(problem, q, h * unit)) - plain(body, xyz, moved(problem, q, -h * unit))) / (2 * h)
    slope = jacobian.T @ plain(body, xyz, q)[:, 0]
    np.testing.assert_allclose(local.gradient[:, 0], slope, atol=1e-8)
    damping = 0.01
    size = (moved_weight(problem.tree, found) * lever(problem.tree) ** 2)[:, 0]
    step, convex = solve(
        problem.tree, quadratic(problem.tree, measured, found, local, damping=np.full(1, damping), newton=np.zeros(1, dtype=bool))
    )
    assert convex.all()
    np.testing.assert_allclose(step[:, 0], -np.linalg.solve(jacobian.T @ jacobian + damping * np.diag(size), slope), atol=1e-6)


def test_newton_step_has_the_exact_second_derivatives(setting):
    body, q, xyz, problem = setting
    measured, found, local = at(problem, q)
    n, h = body.nv, 1e-3
    one, two = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    unit = h * np.eye(n)

    def cost(sign_one: float, sign_two: float) -> Array:
        step = sign_one * unit[:, one] + sign_two * unit[:, two]
        return 0.5 * (plain(body, xyz, moved(problem, q, step)) ** 2).sum(axis=0)

    hessian = ((cost(1, 1) - cost(1, -1) - cost(-1, 1) + cost(-1, -1)) / (4 * h * h)).reshape(n, n)
    damping = 0.3  # 3 cm are far from a minimum: without damping the cost need not be convex
    size = (moved_weight(problem.tree, found) * lever(problem.tree) ** 2)[:, 0]
    full = hessian + damping * np.diag(size)
    assert np.linalg.eigvalsh(full)[0] > 0
    step, convex = solve(
        problem.tree, quadratic(problem.tree, measured, found, local, damping=np.full(1, damping), newton=np.ones(1, dtype=bool))
    )
    wanted = -np.linalg.solve(full, local.gradient[:, 0])
    assert convex.all()
    np.testing.assert_allclose(step[:, 0], wanted, atol=1e-4 * np.abs(wanted).max())


def test_a_held_joint_does_not_move_and_the_others_step_as_if_it_were_fixed(setting):
    body, q, xyz, problem = setting
    measured, found, local = at(problem, q)
    unit, h, held = np.eye(body.nv), 1e-6, body.nv - 3
    jacobian = (plain(body, xyz, moved(problem, q, h * unit)) - plain(body, xyz, moved(problem, q, -h * unit))) / (2 * h)
    free = np.ones((body.nv, 1), dtype=bool)
    free[held] = False
    model = quadratic(
        problem.tree, measured, found, Local(local.twist, local.gradient, free), damping=np.zeros(1), newton=np.zeros(1, dtype=bool)
    )
    step, _ = solve(problem.tree, model)
    rest = np.delete(jacobian, held, axis=1)
    wanted = np.linalg.lstsq(rest, -plain(body, xyz, q)[:, 0], rcond=None)[0]
    assert step[held, 0] == 0.0
    np.testing.assert_allclose(np.delete(step[:, 0], held), wanted, atol=1e-5 * max(1.0, np.abs(wanted).max()))
