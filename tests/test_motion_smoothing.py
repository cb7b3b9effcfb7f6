"""Smoothing: velocities and accelerations of known motions, in Pinocchio's convention, behind the same low-pass as
the forces.
"""

import numpy as np
import pytest
from marker_trials import apart, points
from scipy.spatial.transform import Rotation

from biodance.body.human.human import human
from biodance.errors import TrialRefused
from biodance.lab.prepare import LowPass, low_pass
from biodance.motion.track import smooth
from biodance.records import Array, Subject

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))
RATE = 200.0
ABDUCTION = [WOMAN.joint_index(f"{side}_shoulder_adduction") for side in ("left", "right")]

INNER = slice(100, -100)


def pirouette(time: Array) -> tuple[Array, Array, Array]:
    """Return q, v, a of a body that spins once a second, nods and sways while every joint swings, all in closed
    form.
    """
    spin, nod = 2 * np.pi * time, 0.6 * np.sin(3 * time)
    dspin, dnod, ddnod = 2 * np.pi, 1.8 * np.cos(3 * time), -5.4 * np.sin(3 * time)
    turn = Rotation.from_rotvec(np.outer(spin, [0.0, 0, 1])) * Rotation.from_rotvec(
        np.outer(nod, [0.0, 1, 0])
    )  # about the lab's z, then about the own y
    zero = np.zeros_like(time)
    omega = np.stack([-np.sin(nod) * dspin, dnod, np.cos(nod) * dspin], axis=1)
    alpha = np.stack([-np.cos(nod) * dnod * dspin, ddnod, -np.sin(nod) * dnod * dspin], axis=1)
    place = np.stack([0.5 * np.sin(2 * time), 0.3 * np.cos(4 * time), 0.9 + zero], axis=1)
    speed = np.stack([np.cos(2 * time), -1.2 * np.sin(4 * time), zero], axis=1)
    push = np.stack([-2 * np.sin(2 * time), -4.8 * np.cos(4 * time), zero], axis=1)
    linear = turn.inv().apply(speed)
    acceleration = turn.inv().apply(push) - np.cross(omega, linear)
    middle, swing = 0.5 * (WOMAN.limits.lower + WOMAN.limits.upper), 0.2 * (WOMAN.limits.upper - WOMAN.limits.lower)
    middle[ABDUCTION] = -0.4  # away from 90 deg, where an arm's angles have no rates
    rate, phase = 1.0 + 0.15 * np.arange(23), np.arange(23)
    angle = rate * time[:, None] + phase
    q = np.hstack([place, turn.as_quat(), middle + swing * np.sin(angle)])
    v = np.hstack([linear, omega, swing * rate * np.cos(angle)])
    a = np.hstack([acceleration, alpha, -swing * rate**2 * np.sin(angle)])
    return q, v, a


TIME = np.arange(800) / RATE


def test_velocity_and_acceleration_of_a_known_motion():
    q, v, a = pirouette(TIME)
    found = smooth(WOMAN, TIME, q)
    assert apart(found.q, q, 6)[INNER].max() < 1e-4
    np.testing.assert_allclose(found.v[INNER], v[INNER], atol=1e-3)
    np.testing.assert_allclose(found.a[INNER], a[INNER], atol=2e-2)
    assert np.abs(v[:, 3:6]).max() > 6.0  # the root does turn fast
    assert np.abs(a[:, 3:6]).max() > 10.0


def test_a_recording_that_ends_in_the_middle_of_a_movement_keeps_its_last_accelerations():
    q, v, a = pirouette(TIME)
    rng = np.random.default_rng(2)
    noisy = q.copy()
    noisy[:, :3] += rng.normal(0, 2e-4, (len(q), 3))  # m: what thirty markers of 1 mm leave
    cut = slice(150, 600)
    found = smooth(WOMAN, TIME[cut], noisy[cut])
    largest = np.abs(a[cut, :3]).max()
    assert np.abs(a[cut, :3])[[0, -1]].max() > 0.5 * largest  # the movement is not at rest there
    assert np.abs(found.a[:, :3] - a[cut, :3])[[0, 1, 2, -3, -2, -1]].max() < 0.2 * largest
    np.testing.assert_allclose(found.v[:, :3], v[cut, :3], atol=0.03)
    shortest = smooth(WOMAN, TIME[:21], q[:21])
    assert np.abs(shortest.a[:, :3] - a[:21, :3]).max() < 0.3 * np.abs(a[:21, :3]).max()


def test_an_arm_that_passes_90_deg_moves_on_smoothly():
    q, _, _ = pirouette(TIME)
    q[:, np.array(ABDUCTION) + 7] = -1.5 + 0.8 * np.sin(TIME)[:, None]
    found = smooth(WOMAN, TIME, q)
    assert np.isfinite(found.v).all()
    assert np.isfinite(found.a).all()
    np.testing.assert_allclose(points(WOMAN, found.q)[INNER], points(WOMAN, q)[INNER], atol=1e-4)


def test_signs_of_quaternions_do_not_matter():
    q, _, _ = pirouette(TIME)
    flipped = q.copy()
    flipped[::3, 3:7] *= -1
    np.testing.assert_allclose(smooth(WOMAN, TIME, flipped).v, smooth(WOMAN, TIME, q).v, atol=1e-9)


def test_pinocchio_integrates_the_velocities_to_the_postures():
    pin = pytest.importorskip("pinocchio")
    rng = np.random.default_rng(0)
    q, _, _ = pirouette(TIME)
    noisy = q + rng.normal(0, 0.002, q.shape)
    noisy[:, 3:7] /= np.linalg.norm(noisy[:, 3:7], axis=1, keepdims=True)
    found = smooth(WOMAN, TIME, noisy)
    step = 1 / RATE
    for t in range(100, 700, 7):
        ahead = pin.integrate(WOMAN.model, found.q[t], found.v[t] * step + found.a[t] * step**2 / 2)
        assert np.abs(pin.difference(WOMAN.model, ahead, found.q[t + 1])).max() < 2e-4
        both = pin.difference(WOMAN.model, found.q[t - 1], found.q[t + 1]) / (2 * step)
        assert np.abs(both - found.v[t]).max() < 2e-2
        assert np.abs((found.v[t + 1] - found.v[t - 1]) / (2 * step) - found.a[t]).max() < 0.6


def test_hinges_and_the_place_of_the_root_pass_the_low_pass_of_the_forces():
    rng = np.random.default_rng(1)
    q, _, _ = pirouette(TIME)
    knee, place = 7 + WOMAN.joint_index("left_knee_flexion"), slice(0, 3)
    q[:, knee] += rng.normal(0, 0.01, len(q))
    q[:, place] += rng.normal(0, 0.01, (len(q), 3))
    for settings in (LowPass(), LowPass(order=2, cutoff=4.0)):
        found = smooth(WOMAN, TIME, q, settings=settings)
        np.testing.assert_allclose(found.q[INNER, knee], low_pass(q[:, knee], RATE, settings)[INNER], atol=1e-6)
        np.testing.assert_allclose(found.q[INNER, place], low_pass(q[:, place], RATE, settings)[INNER], atol=1e-6)
    assert np.array_equal(smooth(WOMAN, TIME, q).q, smooth(WOMAN, TIME, q, settings=LowPass()).q)


def test_noise_above_the_cut_off_goes_and_a_slow_motion_stays():
    rng = np.random.default_rng(2)
    q, v, _ = pirouette(TIME)
    noisy = q.copy()
    noisy[:, 3:7] = (Rotation.from_quat(q[:, 3:7]) * Rotation.from_rotvec(rng.normal(0, 0.01, (len(q), 3)))).as_quat()
    found = smooth(WOMAN, TIME, noisy)
    left = (Rotation.from_quat(found.q[:, 3:7]).inv() * Rotation.from_quat(q[:, 3:7])).as_rotvec()[INNER]
    assert (
        0.001 < left.std() < 0.01 * np.sqrt(2 * 10.0 / RATE) * 1.3
    )  # the share of white noise that passes 10 of 100 Hz
    assert (found.v - v)[INNER, 3:6].std() < 0.3


def test_a_single_frame_is_a_pose_at_rest():
    q, _, _ = pirouette(TIME[:1])
    found = smooth(WOMAN, TIME[:1], q)
    assert np.array_equal(found.q, q)
    assert not found.v.any()
    assert not found.a.any()


def test_a_trial_too_short_for_the_low_pass_says_how_long_it_must_be():
    q, _, _ = pirouette(TIME[:15])
    with pytest.raises(TrialRefused, match=r"15 frames at 200 Hz are too few .* 10 Hz: at least 21 are needed"):
        smooth(WOMAN, TIME[:15], q)


def test_frames_that_are_not_even_or_not_there_are_refused():
    q, _, _ = pirouette(TIME)
    late = TIME.copy()
    late[300:] += 0.05
    with pytest.raises(TrialRefused, match=r"not evenly spaced: 0\.055 s after frame 299"):
        smooth(WOMAN, late, q)
    q[17, 9] = np.nan
    with pytest.raises(TrialRefused, match="Frame 17 has no posture"):
        smooth(WOMAN, TIME, q)
