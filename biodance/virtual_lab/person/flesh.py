"""The true masses of a virtual person: pseudo-inertias drawn around a population mean, physically possible by
construction.

A pseudo-inertia is the 4x4 matrix J = [[S, h], [h', m]] of a body's density: S = second moment, h = first moment, m =
mass. Any positive density gives J >= 0; a linear map of the body's points, J -> A J A', keeps it so. Population mean:
``anthropometry/virtual/people.toml``.
"""

import numpy as np

from biodance.errors import BiodanceError, UnknownName
from biodance.records import Array, Sip, Subject
from biodance.virtual_lab.person.skeleton import ARM_AND_LEG, TRUE_SEGMENTS, Proportions, virtual_people
from biodance.virtual_lab.tolerances import LabTolerances, stream

_REPLACED = {"shank": ("shank", "foot"), "foot": ("foot",), "forearm": ("forearm", "hand")}
"""What a prosthesis replaces, by its first true segment."""
_STUMP = 0.85
"""Share of its length to which the matter of the first segment is squeezed towards the joint: a stump in a socket above
a tube."""
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


def fit_prosthesis(sip: Sip, segment: str, less: float) -> Sip:
    """Return the true parameters of somebody whose limb from ``segment`` on (a shank, foot or forearm) is a prosthesis
    that is ``less`` kg lighter than the limb was; on the scale the person weighs what was declared, so that all other
    segments weigh more.

    Raises
    ------
    UnknownName
        No prosthesis begins there.
    BiodanceError
        The limb does not weigh as much.
    """
    side, _, first = segment.removesuffix("_hand").partition("_")
    if first not in _REPLACED or side not in ("right", "left"):
        legal = tuple(f"{side}_{one}" for side in ("right", "left") for one in _REPLACED)
        raise UnknownName.of("segment that a prosthesis begins with", segment, legal)
    limb = [TRUE_SEGMENTS.index(f"{side}_{part}") for part in _REPLACED[first]]
    bodies, mass = [of_parameters(phi) for phi in sip.phi.reshape(-1, 10)], float(sip.mass[limb].sum())
    if not 0 < less < mass:
        raise BiodanceError(
            f"{segment}: the limb weighs {mass:.2f} kg; it can be 0 to {mass:.2f} kg lighter, not {less}."
        )
    squeezed = np.diag([1.0, _STUMP, 1.0, 1.0])
    bodies[limb[0]] = squeezed @ bodies[limb[0]] @ squeezed
    total = float(sip.mass.sum())
    scale = [1 - less / mass if k in limb else 1 + less / (total - mass) for k in range(len(bodies))]
    phi = np.concatenate([parameters_of_inertia(times * J) for times, J in zip(scale, bodies, strict=True)])
    return Sip(sip.segments, phi, sip.covariance)
