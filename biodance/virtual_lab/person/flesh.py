"""The true masses of a virtual person: pseudo-inertias drawn around a population mean, physically possible by
construction.

A pseudo-inertia is the 4x4 matrix J = [[S, h], [h', m]] of a body's density: S = second moment, h = first moment, m =
mass. Any positive density gives J >= 0; a linear map of the body's points, J -> A J A', keeps it so. Population mean:
``anthropometry/virtual/people.toml``.
"""

import numpy as np

from biodance.records import Array, Sip, Subject
from biodance.virtual_lab.person.skeleton import ARM_AND_LEG, TRUE_SEGMENTS, Proportions, virtual_people
from biodance.virtual_lab.tolerances import LabTolerances, stream

_POPULATION = 0.08
"""Relative standard deviation of what the people of one place have in common beside the tables' midpoint: as published
tables differ among themselves (de Leva 1996, Dumas 2018, Zatsiorsky)."""


def true_pseudo_inertia(mass: float, com: Array, radii: Array) -> Array:
    """Return J (4, 4) of ``mass`` kg with CoM (3,) m and radii of gyration (3,) m about the frame's axes at the CoM."""
    gyration = np.asarray(radii, float) ** 2
    second = np.diag(0.5 * gyration.sum() - gyration)
    out = np.empty((4, 4))
    out[:3, :3] = mass * (second + np.outer(com, com))
    out[:3, 3] = out[3, :3] = mass * np.asarray(com)
    out[3, 3] = mass
    return out


def parameters_of_inertia(J: Array) -> Array:
    """Return phi (10,) = [m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] about the frame's origin (kg, kg·m, kg·m²)."""
    second = J[:3, :3]
    inertia = np.trace(second) * np.eye(3) - second
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return np.concatenate([[J[3, 3]], J[:3, 3], inertia[rows, columns]])


def of_parameters(phi: Array) -> Array:
    """Return the pseudo-inertia (4, 4) of phi (10,)."""
    xx, xy, yy, xz, yz, zz = phi[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = phi[1:4]
    out[3, 3] = phi[0]
    return out


def place_inertia(J: Array, rotation: Array, position: Array) -> Array:
    """Return J of the same body in another frame, given the pose (3, 3), (3,) m of its present frame in the other."""
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = rotation, position
    return move @ J @ move.T


def _stretched(J: Array, rng: np.random.Generator, shape_sd: float, com_sd: float) -> Array:
    """Return J after a random linear map of the body about its CoM and a random shift, relative to its own size."""
    com = J[:3, 3] / J[3, 3]
    centred = place_inertia(J, np.eye(3), -com)
    size = np.sqrt(np.diag(centred)[:3] / J[3, 3])
    return place_inertia(
        centred, np.eye(3) + shape_sd * rng.normal(size=(3, 3)), com + com_sd * size * rng.normal(size=3)
    )


def draw_sip(
    size: Proportions, subject: Subject, seed: int, *, tolerances: LabTolerances, population: int | None = None
) -> Sip:
    """Draw the true parameters of the 16 segments; their masses add up to the subject's exactly.

    All persons of one ``population`` differ from the midpoint of the tables alike (`_POPULATION`), None = not at all.
    Of the ``tolerances``: ``segment_mass`` is the relative sd of a kind of segment, common to both sides; ``side_mass``
    that between right and left; ``segment_shape`` that of the linear map of the shape; ``com`` the sd of the CoM shift
    in units of the body's own spread along each axis.
    """
    table = virtual_people()["segments"][subject.sex]
    rng = stream(seed, "flesh")
    factor = {kind: np.exp(tolerances.segment_mass * rng.normal()) for kind in table}
    if population is not None:
        common = stream(population, "population")
        factor = {kind: own * np.exp(_POPULATION * common.normal()) for kind, own in factor.items()}
    bodies = []
    for segment in TRUE_SEGMENTS:
        kind = next((k for k in ARM_AND_LEG if segment.endswith(k)), segment)
        percent, *rest = table[kind]
        place = size[kind] * np.array(rest)
        if segment.startswith("left"):
            place[2] = -place[2]
        side = np.exp(tolerances.side_mass * rng.normal() if kind != segment else 0.0)
        inertia = true_pseudo_inertia(percent * factor[kind] * side, place[:3], place[3:])
        bodies.append(_stretched(inertia, rng, tolerances.segment_shape, tolerances.com))
    total = sum(J[3, 3] for J in bodies)
    phi = np.concatenate([parameters_of_inertia(J * subject.mass / total) for J in bodies])
    return Sip(TRUE_SEGMENTS, phi, np.zeros((phi.size, phi.size)))
