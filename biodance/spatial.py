"""The algebra of rigid bodies in space, written once: cross products, rotations, quaternions, wrenches moved from point
to point, the zero-moment point, the ten parameters of a compact mass.

SI units; vectors on the last axis, everything before it broadcasts; quaternions are x y z w; a wrench is [force N,
moment N·m]. The compiled inverse kinematics (`motion/ik/compiled`) keeps its own scalar versions: numba inlines them.
The virtual laboratory keeps its own algebra ON PURPOSE: a bug in a formula that maker and finder share would cancel.
"""

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]


def cross(a: _Array, b: _Array) -> _Array:
    """Return the vector products (..., 3); twice as fast as numpy's, which serves other lengths too."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def spatial_cross(a: _Array, b: _Array) -> _Array:
    """Return the products a x b (..., 6) of spatial motion vectors [linear, angular] (Featherstone 2008, eq. 2.33)."""
    vx, vy, vz, wx, wy, wz = np.moveaxis(a, -1, 0)
    px, py, pz, rx, ry, rz = np.moveaxis(b, -1, 0)
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    out[..., 0] = (wy * pz - wz * py) + (vy * rz - vz * ry)
    out[..., 1] = (wz * px - wx * pz) + (vz * rx - vx * rz)
    out[..., 2] = (wx * py - wy * px) + (vx * ry - vy * rx)
    out[..., 3], out[..., 4], out[..., 5] = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
    return out


def skew(vector: _Array) -> _Array:
    """Return the matrices S (..., 3, 3) of vectors (..., 3): ``S @ b`` is the vector product with b."""
    out = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def axis_rotation(axis: _Array, angle: _Array) -> _Array:
    """Return rotation matrices (T, 3, 3) about one unit ``axis`` (3,) by ``angle`` (T,) rad (Rodrigues)."""
    still, turned, twice = _about(*axis)
    sine, versine = np.sin(angle)[:, None, None], (1 - np.cos(angle))[:, None, None]
    return still + sine * turned + versine * twice


@lru_cache(maxsize=64)
def _about(*axis: float) -> tuple[_Array, _Array, _Array]:
    """Return the matrices (3, 3) of Rodrigues' formula, read-only: 1, that of the product with the axis, its square."""
    turned = skew(np.array(axis))
    parts = np.eye(3), turned, turned @ turned
    for part in parts:
        part.setflags(write=False)
    return parts


def elementary_rotation(axis: Literal["x", "y", "z"], angle: ArrayLike) -> _Array:
    """Return the rotation matrices (..., 3, 3) about one ``axis`` of the frame by ``angle`` (...) rad."""
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    out = np.zeros((*np.shape(angle), 3, 3))
    out[..., k, k] = 1.0
    out[..., i, i] = out[..., j, j] = np.cos(angle)
    out[..., j, i] = np.sin(angle)
    out[..., i, j] = -out[..., j, i]
    return out


def zxy_angles(turn: _Array) -> tuple[_Array, _Array, _Array]:
    """Return (z, x, y) angles (...) rad with ``turn = Rz(z) Rx(x) Ry(y)`` (..., 3, 3)."""
    x = np.arcsin(np.clip(turn[..., 2, 1], -1.0, 1.0))
    return np.arctan2(-turn[..., 0, 1], turn[..., 1, 1]), x, np.arctan2(-turn[..., 2, 0], turn[..., 2, 2])


def rigid_fit(points: _Array, moved: _Array, weight: _Array | None = None) -> tuple[_Array, _Array]:
    """Return turn (..., 3, 3) and place (..., 3) m that bring ``points`` (..., K, 3) m nearest to where they ``moved``
    (..., K, 3), each counted by its ``weight`` (..., K) >= 0 (Kabsch 1976, doi:10.1107/S0567739476001873).
    """
    count = np.ones(moved.shape[:-1]) if weight is None else weight
    share = (count / count.sum(axis=-1, keepdims=True))[..., None]
    middle, middles = (share * points).sum(axis=-2), (share * moved).sum(axis=-2)
    shape = share * (points - middle[..., None, :])
    u, _, vt = np.linalg.svd(np.swapaxes(moved - middles[..., None, :], -1, -2) @ shape)
    u[..., 2] *= np.linalg.det(u @ vt)[..., None]
    turn = u @ vt
    return turn, middles - (turn @ middle[..., None])[..., 0]


def quaternion_product(a: _Array, b: _Array) -> _Array:
    """Return the products (..., 4) of quaternions: the rotation b, then a."""
    ax, ay, az, aw = np.moveaxis(a, -1, 0)
    bx, by, bz, bw = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def quaternion_conjugate(a: _Array) -> _Array:
    """Return the inverses (..., 4) of unit quaternions."""
    return a * np.array([-1.0, -1.0, -1.0, 1.0])


def unit_quaternion(a: _Array) -> _Array:
    """Return quaternions (..., 4) divided by their norm."""
    return a / np.sqrt(np.sum(a * a, axis=-1, keepdims=True))


def quaternion_matrix(a: _Array) -> _Array:
    """Return the rotation matrices (..., 3, 3) of quaternions (..., 4), normalised here."""
    unit = unit_quaternion(a)
    x, y, z, w = unit[..., 0], unit[..., 1], unit[..., 2], unit[..., 3]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def continuous_quaternion(a: _Array) -> _Array:
    """Return quaternions (..., T, 4) with the sign that makes neighbours in time close (q and -q are one rotation)."""
    together = np.sum(a[..., 1:, :] * a[..., :-1, :], axis=-1) >= 0
    flips = np.cumprod(np.where(together, 1.0, -1.0), axis=-1)
    return np.concatenate([a[..., :1, :], a[..., 1:, :] * flips[..., None]], axis=-2)


def wrench_about_point(wrench: _Array, point: ArrayLike) -> _Array:
    """Return wrenches (..., 6) about the origin as wrenches about ``point`` (3,) or (..., 3) m: M - point x F."""
    force = wrench[..., :3]
    return np.concatenate([force, wrench[..., 3:] - cross(np.asarray(point), force)], axis=-1)


def wrench_about_origin(wrench: _Array, point: ArrayLike) -> _Array:
    """Return wrenches (..., 6) about ``point`` (3,) or (..., 3) m as wrenches about the origin: M + point x F."""
    return wrench_about_point(wrench, -np.asarray(point))


def turned_wrench(wrench: _Array, turn: _Array) -> _Array:
    """Return wrenches (..., 6) in the axes to which ``turn`` (3, 3) leads, about the same point."""
    return np.concatenate([wrench[..., :3] @ turn.T, wrench[..., 3:] @ turn.T], axis=-1)


def wrench_of_force(force: _Array, point: ArrayLike) -> _Array:
    """Return the wrenches (..., 6) about the origin of forces (..., 3) N that act at ``point`` (3,) or (..., 3) m."""
    moment = cross(np.asarray(point), force)
    return np.concatenate([np.broadcast_to(force, moment.shape), moment], axis=-1)


def wrench_shift(point: _Array) -> _Array:
    """Return the matrix (6, 6) of ``wrench_about_point`` for ``point`` (3,) m."""
    out = np.eye(6)
    out[3:, :3] = -skew(point)
    return out


def zero_moment_point(wrench: _Array, *, height: ArrayLike = 0.0, threshold: float = 0.0) -> _Array:
    """Return where the moment of wrenches (T, 6) has no horizontal part: the centre of pressure of a measured wrench.

    ``height`` m, one or (T,), of the horizontal plane over the origin. Returns (T, 3) m; NaN where |Fz| is below
    ``threshold`` N, or zero.
    """
    fx, fy, fz, mx, my, _ = wrench.T
    loaded = (np.abs(fz) >= threshold) & (fz != 0)
    safe = np.where(loaded, fz, 1.0)
    x, y = (fx * height - my) / safe, (fy * height + mx) / safe
    return np.where(loaded[:, None], np.stack([x, y, np.broadcast_to(height, x.shape)], axis=1), np.nan)


def point_mass(mass: float, place: _Array, *, radius: float = 0.0) -> _Array:
    """Return the ten parameters (..., 10) [m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] of compact loads of ``mass`` kg at
    ``place`` (..., 3) m with the radius of gyration ``radius`` m about their own centre.
    """
    place = np.asarray(place)
    x, y, z = place[..., 0], place[..., 1], place[..., 2]
    own = radius**2
    about = [y * y + z * z + own, -x * y, x * x + z * z + own, -x * z, -y * z, x * x + y * y + own]
    return mass * np.stack([np.ones_like(x), x, y, z, *about], axis=-1)
