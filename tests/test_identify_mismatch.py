"""Twins and plates: first-order changes against the real thing, sizes by evidence, information that is discounted as the formula says."""

from dataclasses import replace

import numpy as np
from biodance.identify.kinematic_scores import kinematic_scores
from biodance.identify.twins import Twins, central_inertia, chains, disturbance, draw_twins, jacobian, neighbours, skew
from identify_trials import noisy_fit, person, smooth_motion

from biodance.body.body import Body
from biodance.identify.information import Information
from biodance.identify.mismatch import Mismatch, Sizes, evidence_of_scale, evident_sizes, mismatch, nothing, plate_sources, temper
from biodance.identify.posterior import posterior
from biodance.motion.kinematics import poses, segment_motion
from biodance.motion.regressor import GRAVITY, predict_wrench
from biodance.records import Array, Motion
from biodance.uncertainty.noise import Noise


def wrench_change(body: Body, motion: Motion, places: Array, turns: Array) -> Array:
    """Return the change (T, 6, K) of the table's wrench about the lab origin when centres of mass move by ``places`` and segments turn by
    ``turns`` (T, N, 3, K), lab frame: the rate of change of momentum and angular momentum, less the moment of gravity.
    """
    move = segment_motion(body, motion)
    step = 1.0 / motion.rate
    mass = body.sip.mass
    com = (move.rotation @ body.sip.com[..., None])[..., 0] + move.position
    momentum = mass[:, None] * np.gradient(com, step, axis=0)
    inertia = move.rotation @ central_inertia(body) @ np.swapaxes(move.rotation, -1, -2)
    spin = (inertia @ move.angular_velocity[..., None])[..., 0]
    rate = mass[:, None, None] * np.gradient(places, step, axis=0)
    angular = _summed(-skew(momentum), places) + _summed(skew(com), rate) - _summed(skew(spin), turns)
    angular += _summed(inertia, np.gradient(turns, step, axis=0))
    force = np.gradient(rate.sum(axis=1), step, axis=0)
    weight = mass[:, None] * GRAVITY
    moment = np.gradient(angular, step, axis=0) + np.tensordot(places, skew(weight), axes=([1, 2], [0, 2])).swapaxes(1, 2)
    return np.concatenate([force, moment], axis=1)


def _summed(matrix: Array, vectors: Array) -> Array:
    """Return sum over segments of matrix (T, N, 3, 3) times vectors (T, N, 3, K)."""
    frames, count = matrix.shape[:2]
    wide = np.swapaxes(matrix, 1, 2).reshape(frames, 3, 3 * count)
    return np.asarray(wide @ vectors.reshape(frames, 3 * count, -1))


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
    C = 2.0 * H + found.kinematics @ found.kinematics.T + found.plates @ found.plates.T
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

    rigid = 3 * 2 * len(body.joints)
    first, second = with_residual(0.1), with_residual(0.2)
    np.testing.assert_allclose(second[:, :-rigid], 2 * first[:, :-rigid], rtol=1e-9)
    np.testing.assert_array_equal(second[:, -rigid:], first[:, -rigid:])
    np.testing.assert_array_equal(with_residual(1e-6), plain.kinematics)


def test_scores_are_what_every_source_does_to_the_equations() -> None:
    body, _, rng = person(9)
    motion = smooth_motion(body, rng, frames=60)
    twins, weight = draw_twins(body, 6, rng), rng.normal(size=(60, 6, 5))
    pose, segment, everything = poses(body, motion.q), list(body.markers.segment), list(range(4))
    J, _ = jacobian(body, pose, segment, pose.points(segment, body.markers.position))
    place, turn = jacobian(body, pose, everything, pose.points(everything, body.sip.com))
    wrong = disturbance(body, motion, pose, twins)
    weighted = np.swapaxes(np.repeat(body.markers.weight, 3)[:, None] * J, 1, 2)
    ridge = 1e-6 * np.trace(weighted @ J, axis1=1, axis2=2)[:, None, None] / body.nv * np.eye(body.nv)
    tangent = -np.linalg.solve(weighted @ J + ridge, weighted @ wrong.markers.reshape(60, -1, 6))
    shape = wrong.places.shape
    error = wrench_change(body, motion, wrong.places + (place @ tangent).reshape(shape), wrong.turns + (turn @ tangent).reshape(shape))
    found = kinematic_scores(body, motion, weight)
    pairs = ((found.slide, twins.slide), (found.flesh, twins.flesh), (found.centre, twins.centre), (found.tilt, twins.tilt))
    total = sum(a.reshape(-1, 5).T @ b.reshape(-1, 6) for a, b in pairs)
    np.testing.assert_allclose(total, np.einsum("tcp,tck->pk", weight, error), rtol=1e-9, atol=1e-9 * np.abs(total).max())


def test_weighted_rows_are_whitened_twice() -> None:
    rng = np.random.default_rng(4)
    factor = rng.normal(size=(2, 6, 6)) + 4 * np.eye(6)
    rows, other = rng.normal(size=(2, 80, 6, 3))
    for noise in (
        Noise(factor @ np.swapaxes(factor, 1, 2), np.array([0.2, 0.1, 0.0]), (0.0, 1.0, 8.0), 25.0),
        Noise(factor[:1] @ np.swapaxes(factor[:1], 1, 2), np.array([0.2, 0.1, 0.0])),
    ):
        white = [noise.whiten(x).reshape(-1, 3) for x in (rows, other)]
        np.testing.assert_allclose(np.einsum("tci,tcj->ij", other, noise.weighted(rows)), white[1].T @ white[0], rtol=1e-9)


def test_no_frames_make_no_scores() -> None:
    body, truth, rng = person(10)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=100), truth, rng)
    some = mismatch(body, (fit,), Noise(np.tile(np.eye(6), (2, 1, 1)), np.zeros(3), (0.0, 1.0, 10.0), 25.0))
    none = nothing(body)
    assert none.kinematics.shape == some.kinematics.shape
    assert none.plates.shape == some.plates.shape
    assert np.abs(some.kinematics).max() > 0
    short = replace(fit, use=np.arange(100) < 5)
    assert not np.any(mismatch(body, (short,), Noise(np.tile(np.eye(6), (2, 1, 1)), np.zeros(3), (0.0, 1.0, 10.0), 25.0)).kinematics)


def test_plates_have_the_tolerances_stated() -> None:
    plates = plate_sources()
    np.testing.assert_allclose(np.sqrt((plates.mixing**2).sum(axis=0))[2, 2], 0.004)
    np.testing.assert_allclose(np.sqrt((plates.mixing**2).sum(axis=0))[3, 1], np.hypot(0.002, 0.001 * 0.5))
    np.testing.assert_allclose(np.sqrt((plates.offset**2).sum(axis=0))[2], 1.0)
    faults = (plates.mixing != 0).any(axis=(1, 2)).astype(int) + (plates.offset != 0).any(axis=1) + (plates.delay != 0)
    np.testing.assert_array_equal(faults, 1)
