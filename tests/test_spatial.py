"""The algebra of space against scipy, pinocchio and numbers by hand; the virtual laboratory does not use it."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from biodance import spatial

RNG = np.random.default_rng(11)
A, B = RNG.normal(size=(2, 5, 4, 3))
Q, R = RNG.normal(size=(2, 6, 4))


def test_cross_and_skew_are_numpys_vector_product() -> None:
    np.testing.assert_allclose(spatial.cross(A, B), np.cross(A, B), atol=1e-15)
    np.testing.assert_allclose(spatial.cross(A[0, 0], B), np.cross(A[0, 0], B), atol=1e-15)
    np.testing.assert_allclose((spatial.skew(A) @ B[..., None])[..., 0], np.cross(A, B), atol=1e-15)
    assert spatial.cross(np.array([0, 1j, 0]), np.array([0.0, 0.0, 2.0]))[0] == 2j


def test_spatial_cross_is_pinocchios_motion_product() -> None:
    a, b = RNG.normal(size=(2, 7, 6))
    wanted = [pin.Motion(one).cross(pin.Motion(other)).vector for one, other in zip(a, b, strict=True)]
    np.testing.assert_allclose(spatial.spatial_cross(a, b), wanted, atol=1e-14)


def test_rotations_are_scipys() -> None:
    axis, angle = np.array([2.0, -3.0, 6.0]) / 7, np.linspace(-4, 4, 9)
    wanted = Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
    np.testing.assert_allclose(spatial.axis_rotation(axis, angle), wanted, atol=1e-14)
    np.testing.assert_allclose(spatial.quaternion_matrix(Q), Rotation.from_quat(Q).as_matrix(), atol=1e-14)
    batched = spatial.quaternion_matrix(np.stack([Q, R]))
    np.testing.assert_allclose(batched[1], Rotation.from_quat(R).as_matrix(), atol=1e-14)


def test_quaternions_are_scipys() -> None:
    a, b = spatial.unit_quaternion(Q), spatial.unit_quaternion(R)
    np.testing.assert_allclose(np.linalg.norm(a, axis=1), 1, atol=1e-15)
    both = Rotation.from_quat(spatial.quaternion_product(a, b)) * (Rotation.from_quat(a) * Rotation.from_quat(b)).inv()
    assert both.magnitude().max() < 1e-7
    identity = spatial.quaternion_product(a, spatial.quaternion_conjugate(a))
    np.testing.assert_allclose(identity, np.tile([0, 0, 0, 1.0], (6, 1)), atol=1e-15)


def test_a_continuous_quaternion_only_changes_signs() -> None:
    angle = np.linspace(0, 4 * np.pi, 60)
    smooth = np.stack([np.sin(angle / 2), 0 * angle, 0 * angle, np.cos(angle / 2)], axis=1)
    torn = smooth * np.where(np.arange(60) % 7 < 3, -1, 1)[:, None]
    np.testing.assert_array_equal(spatial.continuous_quaternion(torn), -smooth)
    np.testing.assert_array_equal(spatial.continuous_quaternion(np.stack([smooth, torn]))[1], -smooth)


def test_wrenches_move_as_pinocchios_forces_do() -> None:
    wrench, point = RNG.normal(size=(8, 6)), np.array([0.3, -2.0, 0.7])
    there = pin.SE3(np.eye(3), point)
    moved = [there.actInv(pin.Force(one)).vector for one in wrench]
    np.testing.assert_allclose(spatial.wrench_about_point(wrench, point), moved, atol=1e-14)
    np.testing.assert_allclose(wrench @ spatial.wrench_shift(point).T, moved, atol=1e-14)
    back = [there.act(pin.Force(one)).vector for one in wrench]
    np.testing.assert_allclose(spatial.wrench_about_origin(wrench, point), back, atol=1e-14)


def test_a_force_of_10_newtons_upwards_half_a_metre_ahead() -> None:
    wrench = spatial.wrench_of_force(np.array([0.0, 0.0, 10.0]), [[0.5, 0.2, 3.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(wrench, [[0, 0, 10, 2, -5, 0], [0, 0, 10, 0, 0, 0]])


def test_the_zero_moment_point_is_where_the_force_acts() -> None:
    force = np.array([[30.0, -20.0, 700.0], [5.0, 1.0, 19.0], [0.0, 0.0, 0.0]])
    point = np.array([0.2, -0.1, 0.4])
    wrench = spatial.wrench_of_force(force, point) + np.array([0, 0, 0, 0, 0, 3.0])
    np.testing.assert_allclose(spatial.zero_moment_point(wrench, height=0.4)[:2], [point, point], atol=1e-14)
    heights = spatial.zero_moment_point(wrench, height=np.array([0.4, 1.4, 0.4]), threshold=10)
    np.testing.assert_allclose(heights[1], point + np.array([5 / 19, 1 / 19, 1]), atol=1e-14)
    assert np.isnan(spatial.zero_moment_point(wrench, threshold=20.0)[1:]).all()
    assert np.isnan(spatial.zero_moment_point(wrench)[2]).all()


@pytest.mark.parametrize("radius", [0.0, 0.04])
def test_a_compact_mass_has_pinocchios_parameters(radius: float) -> None:
    place = np.array([0.1, -0.2, 0.3])
    inertia = pin.Inertia(2.5, place, 2.5 * radius**2 * np.eye(3))
    np.testing.assert_allclose(spatial.point_mass(2.5, place, radius=radius), inertia.toDynamicParameters(), atol=1e-15)


def test_a_rigid_fit_is_scipys_and_never_a_mirror() -> None:
    points, weight = RNG.normal(size=(5, 7, 3)), RNG.uniform(0.1, 1.0, size=(5, 7))
    turns, places = Rotation.random(5, random_state=3), RNG.normal(size=(5, 3))
    moved = np.stack([turn.apply(some) for turn, some in zip(turns, points, strict=True)]) + places[:, None]
    moved += RNG.normal(0, 0.05, moved.shape)
    for counted in (None, weight):
        turn, place = spatial.rigid_fit(points, moved, counted)
        for k, (some, there) in enumerate(zip(points, moved, strict=True)):
            share = None if counted is None else counted[k]
            middle, middles = np.average(some, axis=0, weights=share), np.average(there, axis=0, weights=share)
            wanted, _ = Rotation.align_vectors(there - middles, some - middle, weights=share)
            np.testing.assert_allclose(turn[k], wanted.as_matrix(), atol=1e-9)
            np.testing.assert_allclose(place[k], middles - wanted.apply(middle), atol=1e-9)
    # Points of one plane have two nearest turns, one of them a mirror.
    turn, _ = spatial.rigid_fit(points * [1.0, 1.0, 0.0], points * [1.0, 1.0, 0.0] @ np.diag([1.0, -1.0, 1.0]))
    np.testing.assert_allclose(np.linalg.det(turn), 1.0, atol=1e-12)
