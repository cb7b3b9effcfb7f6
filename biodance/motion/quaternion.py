"""Unit quaternions x y z w for batches: the four components are the FIRST axis, everything else broadcasts."""

import numpy as np

from biodance.records import Array


def product(a: Array, b: Array) -> Array:
    """Return the product of quaternions (4, ...): the rotation b, then a."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def conjugate(a: Array) -> Array:
    """Return the inverse of unit quaternions (4, ...)."""
    return np.concatenate([-a[:3], a[3:]])


def normalised(a: Array) -> Array:
    """Return ``a`` (4, ...) divided by its norm."""
    return a / np.sqrt(np.sum(a * a, axis=0))


def matrix(a: Array) -> Array:
    """Return rotation matrices (3, 3, ...) of unit quaternions (4, ...)."""
    x, y, z, w = a
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def continuous(a: Array) -> Array:
    """Return quaternions (4, ..., T) with the sign that makes neighbours in time close (q and -q are the same
    rotation).
    """
    together = np.sum(a[..., 1:] * a[..., :-1], axis=0) >= 0
    flips = np.cumprod(np.where(together, 1.0, -1.0), axis=-1)
    return np.concatenate([a[..., :1], a[..., 1:] * flips], axis=-1)
