"""MAP and physical consistency on bodies whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from direct_information import information, whiten
from random_bodies import random_body, random_motion

from biodance.body.parts import pseudo_inertia, smallest_eigenvalues
from biodance.identification.physical import physical_fit
from biodance.identification.posterior import find_posterior, mean_and_covariance
from biodance.motion.dynamics import predict_wrench, regressor
from biodance.records import Sip, Wrench
from biodance.uncertainty.bands import Noise

NOISE = Noise.of_sd(2.0, 0.5, np.zeros(3))


def drawn(seed: int, frames: int = 300):
    """Return a body whose prior is wrong by its own standard deviations, a motion, and the noisy wrench of the
    truth.
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, n_segments=4)
    truth = body.sip.phi
    sd = 0.1 * np.abs(truth) + 1e-3
    prior = Sip(body.segments, truth + sd * rng.normal(size=truth.size), np.diag(sd**2))
    motion = random_motion(body, rng, frames=frames)
    clean = predict_wrench(body, motion)
    noisy = Wrench(clean.time, clean.value + rng.normal(size=(frames, 6)) * [2, 2, 2, 0.5, 0.5, 0.5])
    return body, prior, motion, noisy, truth


def test_posterior_equals_the_textbook_formula() -> None:
    body, prior, motion, wrench, _ = drawn(0)
    found = find_posterior(information(body, motion, wrench, NOISE), prior)
    W = whiten(NOISE, regressor(body, motion)).reshape(-1, 40)
    y = whiten(NOISE, wrench.value[:, :, None]).ravel()
    precision = np.linalg.inv(prior.covariance) + W.T @ W
    covariance = np.linalg.inv(precision)
    mean = covariance @ (np.linalg.inv(prior.covariance) @ prior.phi + W.T @ y)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(found.mean, mean, rtol=1e-6, atol=1e-9)
    rows = np.column_stack([W, y])
    for one, other in zip(mean_and_covariance(rows.T @ rows, prior), (mean, covariance), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)


def test_intervals_cover_the_truth() -> None:
    z = []
    for seed in range(30):
        body, prior, motion, wrench, truth = drawn(seed, frames=60)
        found = find_posterior(information(body, motion, wrench, NOISE), prior)
        z.append((found.mean - truth) / np.sqrt(np.diag(found.covariance)))
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.02)


def test_evidence_prefers_the_right_prior_width() -> None:
    scores = {}
    for factor in (0.1, 1.0, 10.0):
        total = 0.0
        for seed in range(8):
            body, prior, motion, wrench, _ = drawn(seed)
            total += find_posterior(
                information(body, motion, wrench, NOISE), replace(prior, covariance=prior.covariance * factor**2)
            ).log_evidence
        scores[factor] = total
    assert max(scores, key=scores.__getitem__) == 1.0


def test_pinned_parameter_stays_where_the_prior_put_it() -> None:
    body, prior, motion, wrench, _ = drawn(3)
    covariance = prior.covariance.copy()
    covariance[0, :] = covariance[:, 0] = 0.0
    found = find_posterior(information(body, motion, wrench, NOISE), replace(prior, covariance=covariance))
    assert found.mean[0] == pytest.approx(prior.phi[0], abs=1e-12)
    assert found.information[0] == 0.0


def test_pseudo_inertia_of_a_point_cloud() -> None:
    rng = np.random.default_rng(0)
    body = random_body(rng, n_segments=3)
    assert np.all(smallest_eigenvalues(body.sip.phi) > 0)
    phi = body.sip.phi.copy()
    phi[4] += 10.0  # Ixx > Iyy + Izz: no such body
    assert smallest_eigenvalues(phi)[0] < 0
    J = pseudo_inertia(phi)[0]
    np.testing.assert_allclose(J, J.T)


@pytest.mark.parametrize("seed", range(6))
def test_physical_fit_is_consistent_and_nearest(seed: int) -> None:
    body, prior, motion, wrench, truth = drawn(seed, frames=8)
    wild = replace(prior, covariance=prior.covariance * 1e4)
    posterior = find_posterior(information(body, motion, wrench, NOISE), wild)
    assert smallest_eigenvalues(posterior.mean).min() < 0, "the case must need the constraint"
    fit = physical_fit(posterior, body)
    assert fit.status == "solved"
    assert smallest_eigenvalues(fit.sip.phi).min() >= 0
    # no consistent point is nearer in the posterior's metric: compare with the truth, which is consistent
    U, s, Vt = np.linalg.svd(posterior.factor, full_matrices=False)
    truth_distance = np.linalg.norm(Vt.T @ ((U.T @ (truth - posterior.mean)) / s))
    assert fit.distance <= truth_distance * (1 + 1e-6)
