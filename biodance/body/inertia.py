"""Mass, centre of mass and inertia of lumps, and their ten parameters about a joint.

Pseudo-inertia (Wensing, Kim and Slotine 2018, doi:10.1109/LRA.2017.2729659): P = [[0.5 tr(I) 1 - I, m c], [m c', m]]
about the joint; a lump is made of real (positive) mass if and only if P is positive semi-definite.
"""

from dataclasses import dataclass

import numpy as np

from biodance.records import Array

TENSOR = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Row and column of Ixx, Ixy, Iyy, Ixz, Iyz, Izz in Pinocchio's order of the ten parameters."""


@dataclass(frozen=True, eq=False)
class RigidInertia:
    """A rigid lump: ``mass`` kg, ``com`` (3,) m in some frame, ``inertia`` (3, 3) kg·m² about the CoM in its axes."""

    mass: float
    com: Array
    inertia: Array


def combine_inertias(*lumps: RigidInertia) -> RigidInertia:
    """Return several lumps given in one frame as one rigid lump."""
    mass = sum(lump.mass for lump in lumps)
    com = sum((lump.mass * lump.com for lump in lumps), np.zeros(3)) / mass
    inertia = sum((lump.inertia + lump.mass * _steiner(lump.com - com) for lump in lumps), np.zeros((3, 3)))
    return RigidInertia(mass, com, inertia)


def _steiner(arm: Array) -> Array:
    """Return the inertia (3, 3) m² of a unit point mass at ``arm`` (3,) m about the origin."""
    return float(arm @ arm) * np.eye(3) - np.outer(arm, arm)


def stretch_inertia(lump: RigidInertia, times: Array) -> RigidInertia:
    """Return the lump with its matter stretched by ``times`` (3,) along the axes of its frame, from the origin."""
    moments = times[:, None] * (0.5 * np.trace(lump.inertia) * np.eye(3) - lump.inertia) * times
    return RigidInertia(lump.mass, times * lump.com, np.trace(moments) * np.eye(3) - moments)


def inertial_parameters(lump: RigidInertia) -> Array:
    """Return [m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] (10,), inertia about the origin of the lump's frame."""
    about_origin = lump.inertia + lump.mass * _steiner(lump.com)
    return np.array([lump.mass, *(lump.mass * lump.com), *(about_origin[i, j] for i, j in TENSOR)])


def rigid_inertia(phi: Array) -> RigidInertia:
    """Return the lump of ten parameters; the inverse of `inertial_parameters` for a positive mass."""
    com = phi[1:4] / phi[0]
    return RigidInertia(float(phi[0]), com, _tensor(phi[4:]) - phi[0] * _steiner(com))


def _tensor(moments: Array) -> Array:
    """Return the tensor (3, 3) of Ixx, Ixy, Iyy, Ixz, Iyz, Izz (6,)."""
    xx, xy, yy, xz, yz, zz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _pseudo_inertia_map() -> Array:
    """Return M (16, 10) with ``J = (M @ phi).reshape(4, 4)``."""
    M = np.zeros((4, 4, 10))
    M[3, 3, 0] = 1.0
    for axis in range(3):
        M[axis, 3, 1 + axis] = M[3, axis, 1 + axis] = 1.0
    for column, (i, j) in enumerate(TENSOR, start=4):
        if i == j:
            for axis in range(3):
                M[axis, axis, column] += 0.5 if axis != i else -0.5
        else:
            M[i, j, column] = M[j, i, column] = -1.0
    return M.reshape(16, 10)


PSEUDO_INERTIA = _pseudo_inertia_map()
"""(16, 10): the pseudo-inertia is linear in the ten parameters."""


def shift_matter(shift: Array, turn: Array | None = None) -> Array:
    """Return the map (10, 10) of the ten parameters when all matter is turned by ``turn`` (3, 3) about the origin of
    the segment's frame, if given, and moves by ``shift`` (3,) m in it.
    """
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = np.eye(3) if turn is None else turn, shift
    return np.asarray(np.linalg.lstsq(PSEUDO_INERTIA, np.kron(move, move) @ PSEUDO_INERTIA, rcond=None)[0])


def pseudo_inertia(phi: Array) -> Array:
    """Return the pseudo-inertias (N, 4, 4) of ``phi`` (10N,): second moments kg·m², first moments kg·m, mass kg."""
    return (phi.reshape(-1, 10) @ PSEUDO_INERTIA.T).reshape(-1, 4, 4)


def smallest_eigenvalues(phi: Array) -> Array:
    """Return the smallest eigenvalue (N,) of every segment's pseudo-inertia; negative: no such body can exist."""
    return np.asarray(np.linalg.eigvalsh(pseudo_inertia(phi))[:, 0])


def turn_inertia(lump: RigidInertia, rotation: Array) -> RigidInertia:
    """Return the lump in another frame with the same origin: ``rotation`` (3, 3) is new_R_old."""
    return RigidInertia(lump.mass, rotation @ lump.com, rotation @ lump.inertia @ rotation.T)


def mirror_inertia(lump: RigidInertia) -> RigidInertia:
    """Return the lump of the other body side: reflected at the plane z = 0."""
    flip = np.diag([1.0, 1.0, -1.0])
    return RigidInertia(lump.mass, flip @ lump.com, flip @ lump.inertia @ flip)


def parameter_jacobian(lump: RigidInertia) -> Array:
    """Return d phi / d [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (10, 10) at a lump."""
    mass, com = lump.mass, lump.com
    out = np.zeros((10, 10))
    out[:, 0] = inertial_parameters(lump) / mass
    out[1:4, 1:4] = mass * np.eye(3)
    for row, (i, j) in enumerate(TENSOR, start=4):
        for k in range(3):
            shift = 2 * com[k] * (i == j) - com[i] * (j == k) - com[j] * (i == k)
            out[row, 1 + k] = mass * shift
    out[4:, 4:] = mass * np.eye(6)
    return out


def lump_from(row: Array) -> RigidInertia:
    """Return the segment of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz]; the inverse of `primitives_of`."""
    return RigidInertia(float(row[0]), row[1:4], row[0] * _tensor(row[4:]))
