"""How well a robot's maker knows its inertial parameters, for robots whose data come without deviations."""

import numpy as np

from biodance.body.inertia import RigidInertia, parameter_jacobian
from biodance.records import Array

RELATIVE_MASS_SD, RELATIVE_INERTIA_SD = 0.15, 0.30
"""Of every segment: covers, cables and cards come and go (judgement; Bonnet 2016 finds 0.4 kg of 8 kg in all)."""
POINT = 1e-6
"""m: links with a smaller radius of gyration are point masses, as some files write them."""
_ROUNDING = 1e-4
"""Of the largest moment of inertia: numbers of a file are rounded."""
_COM_SD = 0.2
"""m of CoM per m of radius of gyration: 10 mm for the links of HOAP-3."""


def robot_covariance(lumps: list[RigidInertia], com_sd: list[float]) -> Array:
    """Return the covariance (10N, 10N) of the parameters of independent segments, ``com_sd`` (N) m per axis."""
    out = np.zeros((10 * len(lumps), 10 * len(lumps)))
    for i, (lump, com) in enumerate(zip(lumps, com_sd, strict=True)):
        size = RELATIVE_INERTIA_SD * np.trace(lump.inertia) / lump.mass / 3
        jacobian, block = parameter_jacobian(lump), slice(10 * i, 10 * i + 10)
        sd = np.diag([RELATIVE_MASS_SD * lump.mass, *[com] * 3, *[size] * 6])
        out[block, block] = jacobian @ sd**2 @ jacobian.T
    return out


def is_point(lump: RigidInertia) -> bool:
    """Whether a lump has no extension: its radius of gyration is below `POINT`."""
    return bool(np.trace(lump.inertia) <= 2 * lump.mass * POINT**2)


def extended(lump: RigidInertia, box: Array) -> RigidInertia:
    """Return the lump, or for a point mass one that fills its ``box`` (2, 3) m: what is left out is unknown."""
    return solid(lump, box) if is_point(lump) else lump


def solid(lump: RigidInertia, box: Array) -> RigidInertia:
    """Return a body of uniform density that fills a ``box`` (2, 3) m, with the lump's mass and centre of mass."""
    square = np.square(box[1] - box[0])
    return RigidInertia(lump.mass, lump.com, lump.mass / 12 * np.diag(square.sum() - square))


def is_possible(lump: RigidInertia) -> bool:
    """Whether some body has this mass, centre and inertia."""
    moments = np.linalg.eigvalsh(lump.inertia)
    return bool(lump.mass > 0 and moments.sum() - 2 * moments[-1] >= -_ROUNDING * moments[-1])


def com_deviation(lump: RigidInertia) -> float:
    """Return the standard deviation m per axis of the CoM of a lump of which only the data sheet is known."""
    return float(_COM_SD * np.sqrt(np.trace(lump.inertia) / (2 * lump.mass)))
