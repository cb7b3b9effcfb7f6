"""Twins and plates: first-order changes against the real thing, sizes by evidence, information that is discounted as the formula says."""

from dataclasses import replace

import numpy as np
import pytest
from identify_trials import noisy_fit, person, smooth_motion

from biodance.identify.information import Information
from biodance.identify.mismatch import Mismatch, Sizes, draw_plates, evidence_of_scale, evident_sizes, mismatch, temper
from biodance.identify.noise import Noise
from biodance.identify.posterior import posterior
from biodance.identify.twins import Twins, chains, disturbance, draw_twins, jacobian, neighbours, wrench_change
from biodance.motion.kinematics import poses
from biodance.motion.regressor import GRAVITY, predict_wrench
from biodance.records import Sip


def test_jacobian_is_the_derivative_of_the_places() -> None:
    body, _, rng = person(0)
    motion = smooth_motion(body, rng, frames=5)
    segment = list(body.markers.segment)
    place, _ = jacobian(body, poses(body, motion.q), segment, poses(body, motion.q).points(segment, body.markers.position))
    step = 1e-6
    for j in range(len(body.joints)):
        q = motion.q.copy()
        q[:, 7 + j] += step
        change = poses(body, q).points(segment, body.markers.position) - poses(body, motion.q).points(segment, body.markers.position)
        np.testing.assert_allclose(place[:, :, 6 + j], change.reshape(5, -1) / step, atol=1e-5)


def test_wrench_change_of_a_shift_and_of_a_slow_sway() -> None:
    body, _, rng = person(1)
    motion = smooth_motion(body, rng, frames=400)
    count, mass = len(body.segments), body.sip.mass.sum()
    shift = np.array([0.01, -0.02, 0.03])
    still = np.broadcast_to(shift[:, None], (400, count, 3, 1))
    change = wrench_change(body, motion, still, np.zeros_like(still))
    force = predict_wrench(body, motion).force
    inner = slice(20, -20)
    np.testing.assert_allclose(change[inner, :3, 0], 0.0, atol=1e-8)
    np.testing.assert_allclose(change[inner, 3:, 0], np.cross(shift, force)[inner], atol=0.05 * np.abs(np.cross(shift, force)).max())
    sway = 0.01 * np.sin(2 * np.pi * motion.time)[:, None, None, None] * np.array([1.0, 0, 0])[:, None] * np.ones((1, count, 1, 1))
    moved = wrench_change(body, motion, sway, np.zeros_like(sway))[inner, 0, 0]
    expected = -mass * 0.01 * (2 * np.pi) ** 2 * np.sin(2 * np.pi * motion.time)[inner]
    np.testing.assert_allclose(moved, expected, atol=0.02 * np.abs(expected).max())


def test_wrench_change_of_a_turn_is_the_turned_wrench() -> None:
    body, _, rng = person(2)
    motion = smooth_motion(body, rng, frames=400)
    rho = np.array([0.01, 0.02, -0.01])
    com = poses(body, motion.q).points(list(range(4)), body.sip.com)
    places = np.cross(rho, com)[..., None]
    turns = np.broadcast_to(rho[:, None], places.shape)
    change = wrench_change(body, motion, places, turns)[..., 0]
    inertial = predict_wrench(body, motion).value + body.sip.mass.sum() * np.r_[GRAVITY, 0, 0, 0]
    inner = slice(20, -20)
    expected = np.cross(rho, inertial[:, :3])[inner]
    np.testing.assert_allclose(change[inner, :3], expected, atol=0.05 * np.abs(expected).max())


def test_a_displaced_centre_carries_what_hangs_on_it() -> None:
    body, _, rng = person(3)
    motion = smooth_motion(body, rng, frames=6)
    joint = chains(body)[-1][0]
    twins = draw_twins(body, 1, rng)
    centre = np.zeros_like(twins.centre)
    centre[joint, :, 0] = [0.01, 0.0, -0.02]
    only = Twins(0 * twins.slide, 0 * twins.flesh, centre, 0 * twins.tilt)
    moved = replace(
        body, joints=tuple(replace(j, translation=j.translation + centre[i, :, 0]) if i == joint else j for i, j in enumerate(body.joints))
    )

    def places(one, q):
        return poses(one, q).points(list(range(4)), one.sip.com)

    rest, now = (places(moved, q) - places(body, q) for q in (body.neutral, motion.q))
    neutral, pose = poses(body, body.neutral), poses(body, motion.q)
    own = np.einsum("sba,sb->sa", neutral.rotation[0], rest[0])
    expected = now - np.einsum("tsab,sb->tsa", pose.rotation, own)
    np.testing.assert_allclose(disturbance(body, motion, pose, only).places[..., 0], expected, atol=1e-12)


def test_neighbours_are_at_the_ends() -> None:
    body, _, _ = person(4)
    table = neighbours(body)
    assert np.all(table.sum(axis=1) == 2)
    assert sum(len(chain) for chain in chains(body)) == len(body.joints)


def test_without_disturbance_nothing_is_discounted() -> None:
    rng = np.random.default_rng(0)
    data = Information(np.triu(rng.normal(size=(41, 41))) + 5 * np.eye(41), 100)
    none = Mismatch(np.zeros((40, 8)), np.zeros((40, 8)))
    body, _, _ = person(5)
    for noise in (1.0, 4.0):
        mild = temper(data, none, Sizes(1.0, noise))
        np.testing.assert_allclose(mild.triangle.T @ mild.triangle, data.triangle.T @ data.triangle / noise, rtol=1e-6, atol=1e-9)
        weaker = posterior(mild, body.sip)
        np.testing.assert_array_less(posterior(data, body.sip).covariance.trace() - 1e-12, weaker.covariance.trace())


def test_tempered_data_give_the_textbook_posterior() -> None:
    rng = np.random.default_rng(1)
    data = Information(np.triu(rng.normal(size=(41, 41))) + 5 * np.eye(41), 100)
    found = Mismatch(rng.normal(size=(40, 60)), rng.normal(size=(40, 60)))
    body, _, _ = person(6)
    H = data.triangle.T @ data.triangle
    C = 2.0 * H + found.kinematics @ found.kinematics.T / 60 + found.plates @ found.plates.T / 60
    W = H @ np.linalg.inv(C)
    precision = np.linalg.inv(body.sip.covariance) + W @ H
    mean = np.linalg.solve(precision, np.linalg.inv(body.sip.covariance) @ body.sip.phi + W @ data.triangle.T @ data.target)
    got = posterior(temper(data, found, Sizes(1.0, 2.0)), body.sip)
    np.testing.assert_allclose(got.mean, mean, rtol=1e-6, atol=1e-8)


def test_evidence_finds_the_size_of_the_noise_and_of_the_prior() -> None:
    rng = np.random.default_rng(2)
    body, _truth, _ = person(7)
    rows = rng.normal(size=(40, 40)) * 20
    none = Mismatch(1e-9 * rng.normal(size=(40, 8)), 1e-9 * rng.normal(size=(40, 8)))
    chosen, curve = [], np.zeros(3)
    for _ in range(20):
        drawn = body.sip.phi + np.sqrt(np.diag(body.sip.covariance)) * rng.normal(size=40)
        y = rows @ drawn + 2.0 * rng.normal(size=40)
        R = np.zeros((41, 41))
        triangle = np.linalg.qr(np.column_stack([rows, y]), mode="r")
        R[: len(triangle)] = triangle
        data = Information(R, 40)
        chosen.append(evident_sizes(data, none, body.sip).noise)
        curve += evidence_of_scale(temper(data, none, Sizes(1.0, 4.0)), body.sip, np.array([0.3, 1.0, 3.0]))
    assert 3.0 <= np.median(chosen) <= 7.0
    assert curve.argmax() == 1


def test_mismatch_is_reproducible_and_scaled_to_the_markers() -> None:
    body, truth, rng = person(8)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=400), truth, rng)
    noise = Noise(np.tile(np.eye(6), (2, 1, 1)), np.zeros(3), (0.0, 1.0, 10.0), 25.0)
    plain = mismatch(body, (fit,), noise)
    np.testing.assert_array_equal(plain.kinematics, mismatch(body, (fit,), noise).kinematics)

    def with_residual(size: float):
        motion = replace(fit.motion, residual=np.full((400, 3), size), marker_names=("m0", "m1", "m2"))
        return mismatch(body, (replace(fit, motion=motion),), noise).kinematics

    np.testing.assert_allclose(with_residual(0.02), 2 * with_residual(0.01), rtol=1e-9)


def test_plates_have_the_tolerances_stated() -> None:
    plates = draw_plates(4000, np.random.default_rng(0))
    assert plates.mixing[:, 2, 2].std() == pytest.approx(0.004, rel=0.1)
    assert plates.mixing[:, 3, 1].std() == pytest.approx(np.hypot(0.002, 0.001 * 0.5), rel=0.1)
    assert plates.offset[:, 2].std() == pytest.approx(1.0, rel=0.1)
    assert isinstance(Sip(("a",), np.zeros(10), np.zeros((10, 10))).phi, np.ndarray)
