"""The true masses of a virtual person: pseudo-inertias drawn around a population mean, physically possible by
construction.

A pseudo-inertia is the 4x4 matrix J = [[S, h], [h', m]] of a body's density: S = second moment, h = first moment, m =
mass. Any positive density gives J >= 0; a linear map of the body's points, J -> A J A', keeps it so. Population mean:
rounded midpoint of Dumas & Wojtusch 2018 and de Leva 1996, so that neither table is the truth.
"""

import numpy as np

from biodance.records import Array, Sip, Subject
from biodance.virtual_lab.person.skeleton import ARM_AND_LEG, TRUE_SEGMENTS, Proportions
from biodance.virtual_lab.tolerances import LabTolerances, stream

PopulationRow = tuple[float, float, float, float, float, float, float]
_FEMALE: dict[str, PopulationRow] = {
    "pelvis": (13.9, -0.080, 0.772, 0.0, 0.950, 1.050, 0.820),
    "lumbar": (4.3, 0.150, 0.590, 0.0, 0.650, 0.780, 0.520),
    "thorax": (25.2, 0.030, 0.458, 0.0, 0.380, 0.320, 0.340),
    "head": (6.7, 0.030, 0.540, 0.0, 0.290, 0.240, 0.300),
    "thigh": (14.7, -0.040, -0.370, 0.004, 0.333, 0.174, 0.334),
    "shank": (4.65, -0.025, -0.420, 0.015, 0.280, 0.098, 0.280),
    "foot": (1.15, 0.370, -0.310, 0.030, 0.260, 0.520, 0.530),
    "upper_arm": (2.4, -0.025, -0.530, -0.016, 0.285, 0.150, 0.290),
    "forearm": (1.4, 0.010, -0.435, 0.010, 0.265, 0.117, 0.257),
    "hand": (0.53, 0.040, -0.760, 0.024, 0.580, 0.400, 0.570),
}
_MALE: dict[str, PopulationRow] = {
    "pelvis": (13.3, 0.000, 0.720, 0.0, 1.020, 1.060, 0.960),
    "lumbar": (3.3, 0.120, 0.640, 0.0, 0.540, 0.660, 0.430),
    "thorax": (29.2, 0.015, 0.445, 0.0, 0.420, 0.330, 0.360),
    "head": (6.8, 0.030, 0.535, 0.0, 0.290, 0.220, 0.300),
    "thigh": (13.2, -0.020, -0.415, 0.015, 0.310, 0.150, 0.313),
    "shank": (4.55, -0.024, -0.430, 0.004, 0.265, 0.102, 0.270),
    "foot": (1.28, 0.450, -0.250, 0.017, 0.250, 0.500, 0.500),
    "upper_arm": (2.55, 0.009, -0.525, -0.016, 0.280, 0.145, 0.292),
    "forearm": (1.66, -0.006, -0.435, 0.006, 0.272, 0.116, 0.278),
    "hand": (0.60, 0.040, -0.820, 0.037, 0.580, 0.400, 0.600),
}
"""Mass in per cent of the body; CoM (x, y, z) and radii of gyration about it (x, y, z) in fractions of the segment's
length.
"""


_POPULATION = 0.08
"""Relative standard deviation of what the people of one place have in common beside the tables' midpoint: as published
tables differ among themselves (de Leva 1996, Dumas 2018, Zatsiorsky)."""


def true_pseudo_inertia(mass: float, com: Array, radii: Array) -> Array:
    """Return J (4, 4) of a body of ``mass`` kg with CoM (3,) m and radii of gyration (3,) m about the frame's axes
    at the CoM.
    """
    gyration = np.asarray(radii, float) ** 2
    second = np.diag(0.5 * gyration.sum() - gyration)
    out = np.empty((4, 4))
    out[:3, :3] = mass * (second + np.outer(com, com))
    out[:3, 3] = out[3, :3] = mass * np.asarray(com)
    out[3, 3] = mass
    return out


def parameters_of_inertia(J: Array) -> Array:
    """Return phi (10,) = [m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] of a pseudo-inertia, about the frame's origin (kg,
    kg·m, kg·m²).
    """
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
    """Return J after a random linear map of the body about its CoM and a random shift, both relative to the body's
    own size.
    """
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
    table = _FEMALE if subject.sex == "F" else _MALE
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
