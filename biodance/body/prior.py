"""The prior segment inertial parameters of a person: a table scaled to the skeleton, with a covariance that is consistent.

Per segment the uncertain quantities are mass m, CoM c and inertia per unit mass J about the CoM, with the standard deviations of
``spread`` and of ``anthropometry/uncertainty/sizes.csv``. Left and right are correlated as mirror images. Tables that disagree do so as a
whole (``disagreement``): what the data say of one limb in this respect, they say of all. The masses are conditioned on the scale (their
sum is the body mass within its error). The covariance of phi = [m, m c, m (J + |c|² 1 - c c')] is the Jacobian times that covariance
times the Jacobian's transpose: positive semi-definite by construction.
"""

from dataclasses import replace

import numpy as np

from biodance.body.error_sizes import error_size
from biodance.body.inertia import TENSOR, Lump, mirrored, parameters, turned
from biodance.body.reference import Reference
from biodance.body.segment_tables import measured_whole
from biodance.body.segment_tables import reference as reference_of
from biodance.body.skeleton import SEGMENTS, Skeleton, kind_of, side_of
from biodance.body.spread import spread
from biodance.records import Array, Sip, Subject

TRUNK = ("pelvis", "trunk_head")
MIRROR = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
"""Signs of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] under reflection at z = 0."""


def prior(reference: Reference, skeleton: Skeleton, subject: Subject) -> Sip:
    """Return the prior SIP of a person with covariance (120, 120); the masses sum to the subject's mass."""
    lumps = scaled_lumps(reference, skeleton, subject)
    jacobian = np.zeros((10 * len(lumps), 10 * len(lumps)))
    for i, lump in enumerate(lumps):
        jacobian[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] = parameter_jacobian(lump)
    others = tuple(scaled_lumps(reference_of(name, subject), skeleton, subject) for name in measured_whole() if name != reference.table)
    covariance = jacobian @ primitive_covariance(lumps, skeleton, others) @ jacobian.T
    return Sip(SEGMENTS, np.concatenate([parameters(lump) for lump in lumps]), (covariance + covariance.T) / 2)


def scaled_lumps(reference: Reference, skeleton: Skeleton, subject: Subject) -> tuple[Lump, ...]:
    """Return the 12 segments of the reference person at the subject's mass and segment lengths, each in its segment frame.

    The pelvis of the table is upright; it is turned so that its long axis points from the mid hip to where the table cuts the trunk. The
    trunk above the cut keeps its place in the person, also where the joint lies elsewhere.
    """
    lumps = []
    for segment in SEGMENTS:
        kind = kind_of(segment)
        unit = reference.segments[kind]
        scale, mass = skeleton.lengths[segment] / reference.lengths[kind], unit.mass * subject.mass
        lump = Lump(mass, scale * unit.com, mass * scale**2 * unit.inertia)
        if segment == "pelvis":
            lump = turned(lump, _upright_to(skeleton.cut.get("pelvis", skeleton.origins["trunk"])))
        if segment == "trunk_head":
            lump = replace(lump, com=lump.com + skeleton.cut.get("trunk_head", np.zeros(3)))
        lumps.append(lump if side_of(segment) > 0 else mirrored(lump))
    return tuple(lumps)


def _upright_to(point: Array) -> Array:
    """Return the rotation (3, 3) about z that turns y towards a point in the sagittal plane."""
    sine, cosine = point[:2] / np.linalg.norm(point[:2])
    return np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def disagreement(lumps: tuple[Lump, ...], other: tuple[Lump, ...]) -> Array:
    """Return how the limbs of another table differ, (120,) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (kg, m, m²): one standard deviation.

    Zero for pelvis and trunk, which tables divide at different heights.
    """
    rows = [np.zeros(10) if s in TRUNK else _primitives(b) - _primitives(a) for s, a, b in zip(SEGMENTS, lumps, other, strict=True)]
    return np.concatenate(rows)


def _primitives(lump: Lump) -> Array:
    return np.array([lump.mass, *lump.com, *(lump.inertia[i, j] / lump.mass for i, j in TENSOR)])


def primitive_covariance(lumps: tuple[Lump, ...], skeleton: Skeleton, others: tuple[tuple[Lump, ...], ...]) -> Array:
    """Return the covariance (120, 120) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] of all segments (kg, m, m²); ``others`` other tables'.

    The variance of ``primitive_sd`` is divided: what the disagreement of the tables explains moves together, the rest on its own.
    """
    ways = np.array([disagreement(lumps, other) for other in others]).reshape(-1, 10 * len(lumps))
    variance = np.concatenate([primitive_sd(s, lump, skeleton) for s, lump in zip(SEGMENTS, lumps, strict=True)]) ** 2
    own = np.sqrt(np.maximum(variance - np.sum(ways**2, axis=0), error_size("own_share", "variance") * variance))
    together = np.eye(len(SEGMENTS))
    for i, segment in enumerate(SEGMENTS):
        if segment.startswith("right_"):
            left = SEGMENTS.index(segment.replace("right_", "left_"))
            together[i, left] = together[left, i] = error_size("left_right_correlation", "mass")
    scale = own * np.concatenate([MIRROR if side_of(s) < 0 else np.ones(10) for s in SEGMENTS])
    covariance = np.kron(together, np.eye(10)) * np.outer(scale, scale) + ways.T @ ways
    total = np.tile(np.eye(10)[0], len(SEGMENTS))
    gain = covariance @ total
    return covariance - np.outer(gain, gain) / (total @ gain + error_size("scale", "mass") ** 2)


def com_sd(segment: str, skeleton: Skeleton) -> Array:
    """Return the standard deviations (3,) m of a segment's CoM in its joint frame: tables, people and misplaced joint centres."""
    length = skeleton.lengths["trunk_head" if segment == "pelvis" else segment]
    return np.hypot(spread(kind_of(segment)).com * length, error_size("joint_centre", "other", state="before"))


def primitive_sd(segment: str, lump: Lump, skeleton: Skeleton) -> Array:
    """Return the standard deviations (10,) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] of one segment."""
    kind, own = spread(kind_of(segment)), lump.inertia / lump.mass
    length = skeleton.lengths["trunk_head" if segment == "pelvis" else segment]
    products = dict(zip(((0, 1), (0, 2), (1, 2)), kind.products, strict=True))
    tensor = [
        2 * own[i, i] * kind.radii[i]
        if i == j
        else np.hypot(products[i, j] * length**2, error_size("product_floor", "inertia") * np.sqrt(own[i, i] * own[j, j]))
        for i, j in TENSOR
    ]
    return np.array([kind.mass * lump.mass, *com_sd(segment, skeleton), *tensor])


def parameter_jacobian(lump: Lump) -> Array:
    """Return d phi / d [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (10, 10) at a lump."""
    mass, com = lump.mass, lump.com
    out = np.zeros((10, 10))
    out[:, 0] = parameters(lump) / mass
    out[1:4, 1:4] = mass * np.eye(3)
    for row, (i, j) in enumerate(TENSOR, start=4):
        for k in range(3):
            shift = 2 * com[k] * (i == j) - com[i] * (j == k) - com[j] * (i == k)
            out[row, 1 + k] = mass * shift
    out[4:, 4:] = mass * np.eye(6)
    return out
