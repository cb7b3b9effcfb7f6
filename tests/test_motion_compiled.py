"""The machine code of inverse kinematics: cost, slopes, second derivatives and steps against plain markers and
finite differences.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from marker_trials import dance, points
from random_bodies import random_body
from scipy.spatial.transform import Rotation

import biodance.motion
from biodance.body.human.human import human
from biodance.motion.ik.compiled import ball_step, newton
from biodance.motion.ik.compiled.newton import (
    _LENGTH,
    add_up,
    add_up_model,
    chain_of,
    factorise,
    gradient,
    hessian,
    place,
    step_from,
    sums_of,
)
from biodance.records import Array, Subject

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))
FAR = 20.0


class Setting:
    """A body at one posture with markers 3 cm off, one of them hidden, unequal weights, and no limits on the joints."""

    def __init__(self, kind: str):
        rng = np.random.default_rng(0)
        tree = random_body(rng, n_segments=6, root="fixed" if kind == "fixed" else "free_flyer")
        self.body = WOMAN if kind == "human" else tree
        self.weight = rng.uniform(0.2, 1.5, len(self.body.markers.names))
        self.weight[4] = 0.0
        self.q = dance(self.body, 1, rng, reach=0.5)[0]
        self.xyz = points(self.body, self.q[None])[0] + rng.normal(0, 0.03, (len(self.weight), 3))
        chain = chain_of(self.body, list(self.body.markers.segment), self.body.markers.position)
        self.chain = chain._replace(lower=np.full_like(chain.lower, -FAR), upper=np.full_like(chain.upper, FAR))
        self.at, self.nv = sums_of(self.chain), self.body.nv
        self.cost = self.fitted(self.q)
        self.plain_angles = np.zeros(len(self.chain.ball), dtype=bool)

    def fitted(self, q: Array) -> float:
        place(self.chain, q, self.at)
        return add_up(self.chain, self.xyz, self.weight, q, self.at)

    def moved(self, step: Array, turning: Array) -> Array:
        out, stopped = np.empty_like(self.q), np.zeros(len(self.chain.ball), dtype=bool)
        newton.displace(self.chain, self.q, step, turning, stopped, out)
        return out

    def off(self, step: Array, turning: Array) -> Array:
        """Return the weighted marker differences after a step, by the plain kinematics."""
        return (
            np.sqrt(self.weight)[:, None] * (points(self.body, self.moved(step, turning)[None])[0] - self.xyz)
        ).ravel()

    def matrix(self, *, newton_terms: bool) -> Array:
        """Return the full matrix that ``hessian`` packs along the paths."""
        if newton_terms:
            hessian(self.chain, self.at, self.at.below[:, 4:7], self.at.below[:, 7:])
        else:
            add_up_model(self.chain, self.weight, self.at)
            hessian(self.chain, self.at, self.at.below[:, 1:4], self.at.model)
        full = np.zeros((self.nv, self.nv))
        for k in range(self.nv):
            path = self.chain.path[k, : self.chain.depth[k] + 1]
            full[k, path] = full[path, k] = self.at.factor[k, : len(path)]
        return full


@pytest.fixture(params=["human", "free", "fixed"])
def setting(request):
    """Return the three kinds of body."""
    return Setting(request.param)


def differences(setting: Setting, turning: Array, h: float = 1e-6) -> Array:
    unit = h * np.eye(setting.nv)
    return np.array([(setting.off(e, turning) - setting.off(-e, turning)) / (2 * h) for e in unit]).T


def test_cost_is_half_the_weighted_squares_of_the_markers_seen(setting):
    assert setting.cost == pytest.approx(
        0.5 * (setting.off(np.zeros(setting.nv), setting.plain_angles) ** 2).sum(), rel=1e-12
    )


def test_gradient_and_gauss_newton_matrix(setting):
    jacobian, found = differences(setting, setting.plain_angles), np.empty(setting.nv)
    gradient(setting.chain, setting.at, found)
    np.testing.assert_allclose(found, jacobian.T @ setting.off(np.zeros(setting.nv), setting.plain_angles), atol=1e-8)
    np.testing.assert_allclose(setting.matrix(newton_terms=False), jacobian.T @ jacobian, atol=1e-7)


def test_ball_joints_turn_about_the_three_axes_at_their_first_angle(setting):
    turning, slope, none = ~setting.plain_angles, np.empty(setting.nv), np.zeros(setting.nv, dtype=bool)
    gradient(setting.chain, setting.at, slope)
    newton.turn_balls(setting.chain, setting.at, slope, none, setting.plain_angles, turning)
    assert turning.all()
    jacobian = differences(setting, turning)
    np.testing.assert_allclose(slope, jacobian.T @ setting.off(np.zeros(setting.nv), turning), atol=1e-8)
    np.testing.assert_allclose(setting.matrix(newton_terms=False), jacobian.T @ jacobian, atol=1e-7)


def test_newton_matrix_has_the_exact_second_derivatives(setting):
    n, h = setting.nv, 1e-3

    def cost(i: int, j: int, one: int, two: int) -> float:
        step = np.zeros(n)
        step[i] += one * h
        step[j] += two * h
        return 0.5 * (setting.off(step, setting.plain_angles) ** 2).sum()

    wanted = np.array(
        [
            [cost(i, j, 1, 1) - cost(i, j, 1, -1) - cost(i, j, -1, 1) + cost(i, j, -1, -1) for j in range(n)]
            for i in range(n)
        ]
    ) / (4 * h * h)
    np.testing.assert_allclose(setting.matrix(newton_terms=True), wanted, atol=1e-5 * np.abs(wanted).max())


def test_the_step_solves_the_damped_equations_and_leaves_held_coordinates(setting):
    matrix, slope, step = setting.matrix(newton_terms=False), np.empty(setting.nv), np.empty(setting.nv)
    gradient(setting.chain, setting.at, slope)
    weight = np.array([setting.at.below[max(i - setting.chain.roots + 1, 0), 0] for i in range(setting.nv)])
    lever = np.where(np.arange(setting.nv) < min(setting.chain.roots, 3), 1.0, _LENGTH)
    held = np.zeros(setting.nv, dtype=bool)
    held[-3] = True
    assert factorise(setting.chain, setting.at, held, 0.01)
    step_from(setting.chain, setting.at, slope, held, step)
    free = np.flatnonzero(~held)
    damped = matrix + 0.01 * np.diag(weight * lever**2)
    assert step[-3] == 0.0
    np.testing.assert_allclose(step[free], -np.linalg.solve(damped[np.ix_(free, free)], slope[free]), atol=1e-10)


def test_a_matrix_that_is_not_positive_definite_is_said(setting):
    setting.matrix(newton_terms=False)
    setting.at.factor[0, 0] = -1.0
    assert not factorise(setting.chain, setting.at, np.zeros(setting.nv, dtype=bool), 0.0)


def rotation_of(sign: float, angles: Array) -> Rotation:
    return Rotation.from_euler("XYZ", sign * np.asarray(angles))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("size", [0.01, 0.5])
def test_a_ball_joint_turns_by_the_rotation_vector(sign, size):
    rng, far = np.random.default_rng(1), np.full(3, 3.0)
    for _ in range(200):
        angles, out = rng.uniform([-1.2, -1.5, -1.2], [1.2, 1.5, 1.2]), np.empty(3)
        step = size * rng.normal(0, 0.5, 3)
        ball_step.turned(angles, step, sign, -far, far, out)
        first = rotation_of(sign, [angles[0], 0.0, 0.0])
        wanted = first * Rotation.from_rotvec(sign * step) * first.inv() * rotation_of(sign, angles)
        allowed = (
            1e-12 if size > 0.1 or np.cos(angles[1]) < ball_step._UPRIGHT else 3 * (step @ step) / np.cos(angles[1])
        )
        assert (rotation_of(sign, out) * wanted.inv()).magnitude() < allowed + 1e-9


def test_a_ball_joint_stopped_by_a_limit_takes_the_nearest_rotation_within_it():
    rng, lower, upper, met = np.random.default_rng(2), np.array([-0.5, -0.6, -0.4]), np.array([0.6, 0.5, 0.5]), 0
    grid = np.stack(
        np.meshgrid(*(np.linspace(a, b, 23) for a, b in zip(lower, upper, strict=True)), indexing="ij"), -1
    ).reshape(-1, 3)
    every = rotation_of(1.0, grid)
    for _ in range(40):
        angles, out = rng.uniform(lower, upper), np.empty(3)
        step = rng.normal(0, 0.35, 3)
        stopped = ball_step.turned(angles, step, 1.0, lower, upper, out)
        assert (out >= lower).all()
        assert (out <= upper).all()
        first = rotation_of(1.0, [angles[0], 0.0, 0.0])
        wanted = first * Rotation.from_rotvec(step) * first.inv() * rotation_of(1.0, angles)
        beyond = (out == lower) | (out == upper)
        assert stopped == beyond.any()
        if beyond.sum() == 1:  # one limit holds: the other two angles are the best ones
            met += 1
            assert (rotation_of(1.0, out) * wanted.inv()).magnitude() <= (every * wanted.inv()).magnitude().min() + 0.02
    assert met >= 10


CHANGED = """
import sys
sys.path.insert(0, {root!r})
from machine_code_copy import entry
print(entry.answer(1.0))
"""


def test_machine_code_is_made_again_when_another_file_of_the_folder_changes(tmp_path):
    folder = tmp_path / "machine_code_copy"
    folder.mkdir()
    shutil.copy(Path(biodance.motion.__file__).parent / "ik" / "compiled" / "__init__.py", folder / "__init__.py")
    imports = "from machine_code_copy import compiled\nfrom machine_code_copy.inner import twice\n\n"
    (folder / "entry.py").write_text(f"{imports}@compiled\ndef answer(x):\n    return twice(x)\n")
    answers = []
    for factor in ("2.0", "10.0"):
        (folder / "inner.py").write_text(
            f"from machine_code_copy import compiled\n\n@compiled\ndef twice(x):\n    return {factor} * x\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", CHANGED.format(root=str(tmp_path))], capture_output=True, text=True, check=True
        )
        answers.append(float(done.stdout))
    assert answers == [2.0, 10.0]


def test_a_second_process_takes_the_kept_machine_code():
    chain = Setting("human").chain
    newton.fill_distances(
        chain, np.zeros((1, len(chain.slot), 3)), WOMAN.neutral[None].copy(), np.empty((1, len(chain.slot)))
    )
    code = (
        "from biodance.motion.ik.compiled import newton\nfrom biodance.body.human.human import human\nfrom "
        "biodance.records import Subject\n"
        "from biodance.motion.ik.compiled.newton import chain_of\nimport numpy as np\nb = human(Subject(58.3, 1.64, "
        "'F', 31.0))\n"
        "c = chain_of(b, list(b.markers.segment), b.markers.position)\n"
        "newton.fill_distances(c, np.zeros((1, len(c.slot), 3)), b.neutral[None].copy(), np.empty((1, len(c.slot))))\n"
        "print(sum(newton.fill_distances.stats.cache_hits.values()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) == 1
