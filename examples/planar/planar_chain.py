"""The planar chain of the paper's numerical example (III.C, Fig. 4): head and trunk, arm, hand in a vertical plane,
base fixed.

Printed in the paper: three hinges, the link lengths 0.8 m and 0.2 m (they appear in eq. 13), base wrench Fx, Fy, Mz.
NOT printed, hence assumed here and said in the body's notes: masses (Winter 2009, for 65 kg), centres of mass, inertias
(uniform rods), joint ranges. The chain lies in the plane x (along a link) and y (up at rest: gravity is -y), the axes
are z, as in the paper.
"""

from types import MappingProxyType

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import Joint, JointLimits, SegmentMarkers
from biodance.errors import UnknownName
from biodance.records import Array, Sip
from biodance.settings import STANDARD_GRAVITY

LENGTHS = (0.8, 0.2, 0.2)
"""m: the first two as printed in eq. 13, the hand's (it is in no base parameter) assumed."""
MASSES = (37.57, 2.86, 0.39)
"""kg, assumed: 0.578, 0.044 and 0.006 of 65 kg (head and trunk, arm without hand, hand; Winter 2009, Table 4.1)."""
PLANAR_GRAVITY = np.array([0.0, -STANDARD_GRAVITY, 0.0])
"""(3,) m/s² in the lab frame of the chain."""
PLANAR_CHANNELS = (0, 1, 5)
"""Fx, Fy, Mz: the three channels of the base wrench that a planar motion drives."""
RANGES = MappingProxyType(
    {
        "frontal": ((-30.0, 30.0), (-45.0, 135.0), (-30.0, 20.0)),
        "equal": ((-45.0, 45.0), (-45.0, 45.0), (-45.0, 45.0)),
        "wide": ((-90.0, 90.0), (-90.0, 90.0), (-90.0, 90.0)),
    }
)
"""Assumed joint ranges, deg: the frontal plane of a person (trunk bending, shoulder abduction, wrist deviation), and
two plain ones.
"""


def planar_chain(*, ranges: str = "frontal") -> Body:
    """Return the three-link planar chain with fixed base; ``ranges`` names the assumed joint ranges (see ``RANGES``).

    Raises
    ------
    UnknownName
        ``ranges`` is not a name in ``RANGES``.
    """
    if ranges not in RANGES:
        raise UnknownName.of("set of planar joint ranges", ranges, tuple(RANGES))
    segments = ("head_trunk", "arm", "hand")
    lower, upper = np.radians(np.array(RANGES[ranges])).T
    boxes = np.array([[[0.0, -0.05, -0.05], [length, 0.05, 0.05]] for length in LENGTHS])
    free = np.full(3, np.inf)
    return Body(
        name="planar chain",
        segments=segments,
        joints=tuple(
            Joint(f"q{i + 1}", i - 1, np.array([0.0, 0.0, 1.0]), np.eye(3), np.array([length, 0.0, 0.0]), segment=i)
            for i, length in enumerate((0.0, *LENGTHS[:2]))
        ),
        sip=Sip(
            segments, np.concatenate([_rod(m, length) for m, length in zip(MASSES, LENGTHS, strict=True)]), _spread()
        ),
        limits=JointLimits(lower, upper, free, -free, free),
        markers=SegmentMarkers((), (), np.empty((0, 3)), np.empty(0)),
        boxes=boxes,
        com_boxes=boxes,
        root="fixed",
        gravity=PLANAR_GRAVITY,
        notes=(
            "Link lengths 0.8 m and 0.2 m are the paper's (eq. 13); masses, centres of mass and inertias are assumed "
            "(Winter 2009, rods).",
            f"Joint ranges {ranges!r} are assumed: the paper does not print them. No speed and no torque limit, as in "
            f"the paper.",
        ),
    )


def _rod(mass: float, length: float) -> Array:
    """Return the ten parameters of a rod along x about its proximal end, the centre of mass 1 % of the length off its
    axis.
    """
    x, y = 0.5 * length, 0.01 * length
    inertia = mass * length**2 / 3
    return np.array([mass, mass * x, mass * y, 0.0, 0.0, 0.0, inertia, 0.0, 0.0, inertia])


def _spread() -> Array:
    """Return the covariance (30, 30): standard deviations of 10 % of each value, and of 1 cm for the centre of mass
    across the rod.
    """
    sd = np.concatenate([0.1 * np.abs(_rod(m, length)) for m, length in zip(MASSES, LENGTHS, strict=True)])
    sd[2::10] = 0.01 * np.array(MASSES)
    return np.diag(sd**2)
