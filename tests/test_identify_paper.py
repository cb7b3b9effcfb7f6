"""The paper's programme: its constraints hold, its optimum is the optimum, and it does not guarantee a body that can
exist.
"""

from dataclasses import replace

import numpy as np
import pytest
from direct_information import information
from random_bodies import random_body, random_motion
from scipy.optimize import nnls

from biodance.identification.paper_programme import _solve, directions, inequalities, paper_programme
from biodance.motion.dynamics import predict_wrench
from biodance.records import Wrench
from biodance.uncertainty.bands import Noise

UNIT = Noise.of_sd(1.0, 1.0, np.zeros(3))


def data_of(seed: int, *, noise: float):
    rng = np.random.default_rng(seed)
    body = random_body(rng, n_segments=4)
    motion = random_motion(body, rng, frames=200)
    clean = predict_wrench(body, motion)
    wrench = Wrench(clean.time, clean.value + noise * rng.normal(size=clean.value.shape))
    return body, information(body, motion, wrench, UNIT)


def test_directions_are_unit_and_cover_the_half_sphere() -> None:
    v = directions()
    np.testing.assert_allclose(np.linalg.norm(v, axis=1), 1.0)
    np.testing.assert_allclose(v.T @ v / len(v), np.eye(3) / 3, atol=0.01)


def test_without_noise_the_table_itself_is_the_answer() -> None:
    body, data = data_of(0, noise=0.0)
    fit = paper_programme(data, body)
    assert fit.status == "solved"
    np.testing.assert_allclose(fit.phi, body.sip.phi, atol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_every_inequality_and_equality_holds(seed: int) -> None:
    body, data = data_of(seed, noise=3.0)
    fit = paper_programme(data, body)
    A, b = inequalities(body)
    assert np.all(A @ fit.phi - b > -1e-6)
    tied = list(fit.base.well_known)
    if fit.status == "solved":
        np.testing.assert_allclose(fit.base.base.regroup[tied] @ fit.phi, fit.base.value[tied], rtol=1e-4, atol=1e-5)


def test_the_inequalities_are_mass_box_and_moments_of_inertia_by_hand() -> None:
    """Two kilograms in three points: the distances of their CoM from the six walls, and what turning them takes."""
    places, weights = np.array([[0.3, -0.1, 0.2], [0.1, 0.4, -0.2], [-0.2, 0.1, 0.3]]), np.array([0.5, 0.7, 0.8])
    com = weights @ places / 2.0
    products = np.einsum("k,ki,kj->ij", weights, places, places)
    tensor = np.trace(products) * np.eye(3) - products
    phi = np.array([2.0, *(2.0 * com), *(tensor[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))])
    body = random_body(np.random.default_rng(0), n_segments=1)
    low, high = np.array([-0.11, -0.12, -0.13]), np.array([0.21, 0.22, 0.23])
    A, b = inequalities(replace(body, com_boxes=np.array([[low, high]])))
    left = A @ phi - b
    np.testing.assert_allclose(left[:7], [2.0, *(2.0 * (com - low)), *(2.0 * (high - com))])
    about = [sum(w * np.sum(np.cross(v, p) ** 2) for w, p in zip(weights, places, strict=True)) for v in directions()]
    np.testing.assert_allclose(A[7:] @ phi, about)
    least = np.linalg.eigvalsh(body.sip.phi[[[4, 5, 7], [5, 6, 8], [7, 8, 9]]])[0]
    np.testing.assert_allclose(b, [0.0] * 7 + [0.1 * least] * 100)


def least_distance(data, body) -> np.ndarray:
    """Solve eq. 8 without equalities as least distance programming (Lawson & Hanson 1974, ch. 23), an independent
    route.
    """
    A, b = inequalities(body)
    p = A.shape[1]
    H = data.triangle.T @ data.triangle + np.eye(p)
    centre = np.linalg.solve(H, data.triangle.T @ data.target + body.sip.phi)
    inverse = np.linalg.inv(np.linalg.cholesky(H).T)
    G, h = A @ inverse, b - A @ centre
    u, _ = nnls(np.vstack([G.T, h]), np.append(np.zeros(p), 1.0), maxiter=20000)
    r = np.vstack([G.T, h]) @ u - np.append(np.zeros(p), 1.0)
    return centre + inverse @ (-r[:p] / r[p])


@pytest.mark.parametrize("seed", range(3))
def test_same_optimum_as_least_distance_programming(seed: int) -> None:
    body, data = data_of(seed, noise=30.0)
    found, word = _solve(data, body, np.empty((0, 40)), np.empty(0))
    assert word == "optimal"
    np.testing.assert_allclose(found, least_distance(data, body), atol=1e-5)
