"""Expectation: the table before, the identification's own arithmetic after, never worse with more of the dance."""

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.expectation import JUDGED_RATE, expected_spread, typical_noise, typical_sizes
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.splines import rest_to_rest
from biodance.identification.knowledge import segment_quantities
from biodance.identification.mismatch import mismatch, temper
from biodance.identification.posterior import find_posterior
from biodance.identification.statistics import Fit, statistics
from biodance.motion.dynamics import predict_wrench
from biodance.records import Motion, Subject
from biodance.uncertainty.caution import widened_prior

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)


@pytest.fixture(scope="module")
def motion() -> Motion:
    """Four random postures, 2 s to each."""
    rng = np.random.default_rng(4)
    x = np.zeros((4, CHAIN.size))
    x[:, ROOT:] = rng.uniform(BODY.limits.lower, BODY.limits.upper, (4, 23)) * 0.7
    x[:, 2] = 0.9
    basis = rest_to_rest(2.0, via=0, rate=JUDGED_RATE)
    parts = [
        np.concatenate([m[:-1] @ x[k : k + 2] for k in range(3)])
        for m in (basis.position, basis.velocity, basis.acceleration)
    ]
    return CHAIN.motion(np.arange(75) / JUDGED_RATE, *parts)


def test_before_the_dance_stands_the_table_and_more_dance_is_never_worse(motion: Motion) -> None:
    found = expected_spread(BODY, motion, np.array([2.0, 4.0, 6.0]))
    prior = widened_prior(BODY.sip)
    np.testing.assert_allclose(found.mass[0], np.sqrt(np.diag(prior.covariance)[::10]), rtol=1e-9)
    assert found.share[0].max() < 1e-12
    for values in (found.mass, found.com, found.inertia):
        assert values.shape == (4, 12)
        assert (np.diff(values, axis=0) <= 1e-10).all()
        assert (values[-1] < values[0]).all()
    assert (np.diff(found.share, axis=0) >= -1e-10).all()
    assert found.share.max() < 1


def test_the_end_is_what_identification_would_say_of_data_that_agree_with_the_table(motion: Motion) -> None:
    wrench = predict_wrench(BODY, motion)
    noise = typical_noise(wrench)
    fit = Fit("all", motion, wrench, motion.time < 6.0 - 1e-9)
    data = statistics(BODY, fit, noise).information(noise)
    posterior = find_posterior(temper(data, mismatch(BODY, (fit,), noise), typical_sizes()), widened_prior(BODY.sip))
    found = expected_spread(BODY, motion, np.array([6.0]))
    for i in range(12):
        cut = slice(10 * i, 10 * i + 10)
        _, slope = segment_quantities(posterior.prior.phi[cut])
        variance = np.diag(slope @ posterior.covariance[cut, cut] @ slope.T)
        assert found.mass[1, i] == pytest.approx(np.sqrt(variance[0]), rel=1e-6)
        assert found.com[1, i] == pytest.approx(np.sqrt(variance[1:4].mean()), rel=1e-6)
    np.testing.assert_allclose(posterior.mean, widened_prior(BODY.sip).phi, atol=1e-6)
