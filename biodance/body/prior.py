"""The prior segment inertial parameters of a person: a table scaled to the skeleton, with a covariance."""

import numpy as np

from biodance.body.inertia import Lump, mirrored, parameters
from biodance.body.segment_tables import Reference
from biodance.body.skeleton import SEGMENTS, Skeleton, kind_of, side_of
from biodance.records import Array, Sip, Subject


def scaled_lumps(reference: Reference, skeleton: Skeleton, subject: Subject) -> tuple[Lump, ...]:
    """Return the 12 segments of the reference person at the subject's mass and segment lengths, each in its segment frame."""
    lumps = []
    for segment in SEGMENTS:
        kind = kind_of(segment)
        unit = reference.segments[kind]
        scale, mass = skeleton.lengths[segment] / reference.lengths[kind], unit.mass * subject.mass
        lump = Lump(mass, scale * unit.com, mass * scale**2 * unit.inertia)
        lumps.append(lump if side_of(segment) > 0 else mirrored(lump))
    return tuple(lumps)


def prior(reference: Reference, skeleton: Skeleton, subject: Subject) -> Sip:
    """Return the prior SIP."""
    phi = np.concatenate([parameters(lump) for lump in scaled_lumps(reference, skeleton, subject)])
    sd: Array = 0.1 * np.abs(phi) + 1e-4
    return Sip(SEGMENTS, phi, np.diag(sd**2))
