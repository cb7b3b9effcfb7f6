"""The nearest possible body hangs on no rounding: a hundred seeds, inputs moved by 1e-12, rows in another order,
segments at their edge.
"""

from dataclasses import replace

import numpy as np
import pytest
from direct_information import information
from identify_trials import person
from random_bodies import random_body, random_motion

from biodance.body.parts import smallest_eigenvalues
from biodance.errors import NotSolved
from biodance.identification import physical
from biodance.identification.physical import FailedFit, PhysicalFit, physical_fit
from biodance.identification.posterior import BodyPosterior, Information, find_posterior, fold
from biodance.motion.dynamics import predict_wrench
from biodance.records import Sip, Wrench
from biodance.uncertainty.bands import Noise

NOISE = Noise.of_sd(2.0, 0.5, np.zeros(3))
SEEDS = range(100)
MOVED = 1e-12
CLOSE = 1e-3
"""Posterior standard deviations: what two solves of one programme may differ by."""


def rows_of(seed: int, *, sd: float = 1.0):
    """Return a chain whose table is wrong by 10 % (every second one holds a segment that cannot exist) and whitened
    rows [W y] of it.
    """
    body, truth, rng = person(seed, segments=3)
    motion = random_motion(body, rng, frames=40)
    clean = predict_wrench(body, motion, truth).value
    wrench = Wrench(motion.time, clean + sd * rng.normal(size=clean.shape) * [2, 2, 2, 0.5, 0.5, 0.5])
    return body, information(body, motion, wrench, NOISE).R, rng


def flat(seed: int):
    """Return a body whose every segment is flat: four point masses in one plane, so that its pseudo-inertia ends at
    zero.
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, n_segments=3)
    frames = np.linalg.qr(rng.normal(size=(3, 3, 3)))[0]
    phi = np.concatenate([sum(point(frame[:, :2] @ rng.normal(0, 0.1, 2)) for _ in range(4)) for frame in frames])
    return body, phi, frames, rng


def point(place: np.ndarray) -> np.ndarray:
    """Return the ten parameters of 1 kg at ``place``."""
    x, y, z = place
    return np.array([1, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])


def assert_same(one: PhysicalFit | FailedFit, other: PhysicalFit | FailedFit) -> None:
    assert one.status == other.status == "solved", (one.cause, other.cause)
    sd = np.sqrt(np.diag(one.sip.covariance))
    np.testing.assert_array_less(np.abs(one.sip.phi - other.sip.phi), CLOSE * sd + 1e-9)
    np.testing.assert_array_equal(one.moved, other.moved)


def test_no_session_without_fault_fails_and_rounding_changes_nothing() -> None:
    held = 0
    for seed in SEEDS:
        body, R, rng = rows_of(seed)
        shaken = R[rng.permutation(len(R))] * (1 + MOVED * rng.normal(size=R.shape))
        fits = [physical_fit(find_posterior(Information(fold(rows), 40), body.sip), body) for rows in (R, shaken)]
        assert_same(*fits)
        assert smallest_eigenvalues(fits[0].sip.phi).min() > -1e-12
        held += fits[0].moved.any()
    assert held > 30, "the cases must need the constraint"


def test_the_posterior_of_a_session_as_prior_of_the_next() -> None:
    for seed in SEEDS:
        body, R, rng = rows_of(seed)
        before = find_posterior(Information(R, 40), body.sip)
        expected = Sip(
            body.segments,
            before.mean + 0.5 * before.factor @ rng.normal(size=before.factor.shape[1]),
            before.covariance,
        )
        shaken = Sip(
            body.segments, expected.phi * (1 + MOVED * rng.normal(size=expected.phi.size)), expected.covariance
        )
        assert_same(*(physical_fit(find_posterior(Information(R, 40), prior), body) for prior in (expected, shaken)))


def test_segments_that_all_lie_at_their_edge() -> None:
    for seed in SEEDS:
        body, phi, _, rng = flat(seed)
        factor = np.diag(0.1 * np.abs(phi) + 1e-3)
        fits = []
        for mean in (phi, phi * (1 + MOVED * rng.normal(size=phi.size)), phi * (1 - MOVED)):
            fits.append(
                physical_fit(BodyPosterior(Sip(body.segments, phi, factor**2), mean, factor, 0.0, 0.0, 1), body)
            )
        for other in fits[1:]:
            assert_same(fits[0], other)
        assert fits[0].distance < 1e-3


@pytest.mark.parametrize("seed", range(12))
def test_a_plate_whose_thickness_is_fixed_has_no_room_for_a_gap(seed: int) -> None:
    body, phi, frames, rng = flat(seed)
    factor = np.zeros((30, 12))
    for k, frame in enumerate(frames):
        for column in range(4):
            factor[10 * k : 10 * k + 10, 4 * k + column] = 0.3 * point(frame[:, :2] @ rng.normal(0, 0.1, 2))
    mean = phi - 9.0 * factor[:, ::4].sum(axis=1)
    needed = smallest_eigenvalues(mean) < -1e-3
    assert needed.any(), "the case must need the constraint"
    fit = physical_fit(BodyPosterior(Sip(body.segments, phi, factor @ factor.T), mean, factor, 0.0, 0.0, 1), body)
    assert fit.status == "solved", fit.cause
    assert smallest_eigenvalues(fit.sip.phi).min() > -1e-7
    assert fit.moved[needed].all()


@pytest.mark.parametrize("seed", range(5))
def test_data_a_hundred_thousand_deviations_away_are_solved(seed: int) -> None:
    body, truth, rng = person(seed, segments=3)
    motion = random_motion(body, rng, frames=40)
    impossible = truth * np.where(np.arange(truth.size) % 10 == 4, -3.0, 1.0)
    data = information(body, motion, predict_wrench(body, motion, impossible), Noise.of_sd(2e-4, 5e-5, np.zeros(3)))
    fit = physical_fit(find_posterior(data, replace(body.sip, covariance=100 * body.sip.covariance)), body)
    assert fit.status == "solved", fit.cause
    assert fit.distance > 5e4
    assert smallest_eigenvalues(fit.sip.phi).min() > -1e-12


def test_an_inaccurate_answer_is_asked_for_again_and_never_taken(monkeypatch) -> None:
    body, R, _ = rows_of(0)
    posterior = find_posterior(Information(R, 40), replace(body.sip, covariance=1e4 * body.sip.covariance))
    right, solve, asked = physical_fit(posterior, body), physical.shortest_inside, []
    assert right.moved.any()

    def inaccurate(*problem) -> tuple:
        asked.append(solve(*problem))
        return (None, "optimal_inaccurate") if len(asked) == 1 else asked[-1]

    monkeypatch.setattr(physical, "shortest_inside", inaccurate)
    again = physical_fit(posterior, body)
    assert len(asked) > 1
    assert_same(right, again)
    monkeypatch.setattr(physical, "shortest_inside", lambda *_: (None, "optimal_inaccurate"))
    failed = physical_fit(posterior, body)
    assert isinstance(failed, FailedFit)
    assert failed.status == "failed"
    assert "optimal_inaccurate" in failed.cause
    assert "segments s0, s2" in failed.cause
    assert "Check the scaling" in failed.cause
    for name in ("sip", "phi"):
        with pytest.raises(NotSolved, match="Check the scaling"):
            getattr(failed, name)


def test_boxes_that_no_body_can_meet_are_a_failure_with_the_segment() -> None:
    body, R, _ = rows_of(1)
    boxes = np.array(body.com_boxes)
    boxes[2] = [[5.0] * 3, [4.0] * 3]
    posterior = find_posterior(Information(R, 40), Sip(body.segments, body.sip.phi, body.sip.covariance))
    pinned = replace(posterior, factor=posterior.factor * (np.arange(30) >= 30)[:, None])
    failed = physical_fit(pinned, replace(body, com_boxes=boxes))
    assert failed.status == "failed"
    assert "s2" in failed.cause


def test_a_centre_of_mass_outside_its_box_stops_at_the_wall() -> None:
    """2 kg whose first moment alone is unknown, alike along all axes: the nearest CoM is the one clipped to the box."""
    body = random_body(np.random.default_rng(0), n_segments=1)
    round_one = np.array([2.0, 0, 0, 0, 5.0, 0, 5.0, 0, 0, 5.0])
    factor = 0.1 * np.eye(10)[:, 1:4]
    believed = round_one + 2.0 * np.array([0, 0.2, -0.3, 0.01, 0, 0, 0, 0, 0, 0])
    boxes = np.array([[[-0.03, -0.05, -0.02], [0.08, 0.07, 0.09]]])
    posterior = BodyPosterior(Sip(body.segments, round_one, factor @ factor.T), believed, factor, 0.0, 0.0, 1)
    fit = physical_fit(posterior, replace(body, com_boxes=boxes))
    np.testing.assert_allclose(fit.sip.phi[1:4] / 2.0, [0.08, -0.05, 0.01], atol=1e-5)
    assert fit.moved.tolist() == [True]
    assert fit.distance == pytest.approx(2.0 * np.hypot(0.12, 0.25) / 0.1, rel=1e-3)


@pytest.mark.parametrize("beyond", [1e-6, 1e-4])
def test_a_body_that_is_outside_by_more_than_rounding_is_moved_inside(beyond: float) -> None:
    """A centre of mass a micrometre beyond its box is outside; one a thousandth of that is rounding."""
    body = random_body(np.random.default_rng(0), n_segments=1)
    round_one = np.array([2.0, 0, 0, 0, 5.0, 0, 5.0, 0, 0, 5.0])
    factor = 0.1 * np.eye(10)[:, 1:4]

    def fit_of(com: float) -> PhysicalFit:
        prior = Sip(body.segments, round_one, factor @ factor.T)
        posterior = BodyPosterior(prior, round_one + 2.0 * com * np.eye(10)[1], factor, 0.0, 0.0, 1)
        return physical_fit(posterior, replace(body, com_boxes=np.array([[[-0.05] * 3, [0.05] * 3]])))

    assert fit_of(0.05 + beyond).moved.all()
    assert fit_of(0.05 + beyond).sip.phi[1] <= 2.0 * 0.05 + 1e-9
    assert not fit_of(0.05 + 1e-9).moved.any() or fit_of(0.05 + 1e-9).distance < 1e-4
