"""Measurements of a person's segments beside the table: girths, the outlines of the feet, a scan; each with its own
noise, all weighted in the same way.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.human.girths import CONTRADICTION, SegmentOpinion, girth_opinions, mean_fraction
from biodance.body.human.scan import read_scan
from biodance.body.human.scan_parts import ScannedBody, cut_scan
from biodance.body.human.skeleton import SEGMENTS, Skeleton, kind_of
from biodance.body.inertia import TENSOR, RigidInertia
from biodance.body.tables.anthropometry import Reference, Sex, proportion, read_table
from biodance.body.tables.error_sizes import error_size
from biodance.errors import SessionRefused
from biodance.records import SIDES, Array, FootSizes, Subject


def usual_outline(length: float, sex: Sex) -> FootSizes:
    """Return the outline of a usual foot of this length, m."""
    breadth, heel = (proportion(size, sex) * length for size in ("foot_breadth", "heel_breadth"))
    return FootSizes(length, breadth, heel)


def sole_corners(outline: FootSizes, sex: Sex) -> Array:
    """Return the corners (6, 2) m of a sole, ahead of the heel and to the right, counter-clockwise from above."""
    length, wide, narrow = outline.length, outline.breadth / 2, outline.heel_breadth / 2
    ball = proportion("ball_from_heel", sex) * length
    return np.array([(0.0, narrow), (ball, wide), (length, narrow), (length, -narrow), (ball, -wide), (0.0, -narrow)])


def foot_opinions(skeleton: Skeleton, subject: Subject) -> dict[str, SegmentOpinion]:
    """Return what the outlines say about the masses of the feet.

    The foot of the mean person of the survey of girths, whose fraction all tables and studies give, times the area of
    the outline and the height of the ankle over those of that mean person.
    """
    people = read_table("human", "girths").provenance["people"]
    mean, mean_sd = mean_fraction("foot", subject.sex)
    stature = people["stature_m"][subject.sex]
    usual = usual_outline(proportion("foot_length", subject.sex) * stature, subject.sex)
    height = proportion("ankle_height", subject.sex) * stature
    own = np.linalg.norm([mean_sd, error_size("solid_mass", "foot"), error_size("solid_mass", "survey")])
    opinions = {}
    for side in SIDES:
        area = _area(subject.foot_outline[side], subject.sex) / _area(usual, subject.sex)
        mass = mean * people["mass_kg"][subject.sex] * area * skeleton.ankle_height[side] / height
        opinions[f"{side}_foot"] = SegmentOpinion(mass, float(own * mass), ("foot outline",))
    return opinions


def _area(outline: FootSizes, sex: Sex) -> float:
    x, y = sole_corners(outline, sex).T
    return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


_NEIGHBOURS = {
    "hip": ("pelvis", "thigh"),
    "knee": ("thigh", "shank"),
    "ankle": ("shank", "foot"),
    "shoulder": ("trunk_head", "upper_arm"),
    "elbow": ("upper_arm", "forearm_hand"),
}
_TRUNK = ("pelvis", "trunk_head")


@dataclass(frozen=True, eq=False)
class Opinion:
    """``value`` (n,) of the rows ``where`` (n,) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (120,; kg, m, m²) of all
    segments with covariance ``noise`` (n, n); ``said`` by segment: what its mass was measured by.
    """

    where: np.ndarray
    value: Array
    noise: Array
    said: Mapping[str, tuple[str, ...]]


def body_opinions(reference: Reference, skeleton: Skeleton, subject: Subject) -> tuple[Opinion, ...]:
    """Return what girths, foot outlines and a scan of the subject say, as far as they were given.

    Raises
    ------
    SessionRefused
        One of them cannot be of this person.
    """
    opinions = []
    if subject.girths:
        opinions.append(_of_masses(girth_opinions(reference, skeleton, subject)))
    if subject.foot_outline:
        opinions.append(_of_masses(foot_opinions(skeleton, subject)))
    if subject.scan:
        scan = read_scan(subject.scan, subject.stature, subject.scan_up)
        opinions.append(scan_opinion(cut_scan(scan, skeleton), subject))
    return tuple(opinions)


def told_by(opinions: tuple[Opinion, ...]) -> dict[str, tuple[str, ...]]:
    """Return by segment what its mass was measured by beside the table, in the order of the segments."""
    sources = {name: tuple(word for one in opinions for word in one.said.get(name, ())) for name in SEGMENTS}
    return {name: words for name, words in sources.items() if words}


def _of_masses(opinions: Mapping[str, SegmentOpinion]) -> Opinion:
    """Return opinions on masses; the sides err together: same tape, same shape of muscle."""
    kinds = np.array([kind_of(segment) for segment in opinions])
    sds = np.array([one.mass_sd for one in opinions.values()])
    together = np.where(kinds[:, None] == kinds, error_size("left_right_correlation", "mass"), 0.0)
    np.fill_diagonal(together, 1.0)
    where = np.array([10 * SEGMENTS.index(segment) for segment in opinions], dtype=np.intp)
    value = np.array([one.mass for one in opinions.values()])
    return Opinion(where, value, together * np.outer(sds, sds), {name: one.said for name, one in opinions.items()})


def scan_opinion(body: ScannedBody, subject: Subject) -> Opinion:
    """Return what a cut scan says about mass, CoM and inertia of every segment.

    Masses err with the density of their kind, with all volumes alike (clothes), and with every cut, which takes from
    one segment what it gives to its neighbour.

    Raises
    ------
    SessionRefused
        Volumes times densities miss the body mass by more than 15 %.
    """
    lumps = [body.lumps[name] for name in SEGMENTS]
    mass = np.array([lump.mass for lump in lumps])
    if abs(mass.sum() / subject.mass - 1) > CONTRADICTION:
        raise SessionRefused(
            f"[subject] scan: the scan weighs {mass.sum():.1f} kg by volume and density, but the body mass is "
            f"{subject.mass:.1f} kg ({100 * (mass.sum() / subject.mass - 1):+.0f} %, at most "
            f"{100 * CONTRADICTION:.0f} % is believed). Is it the same person, in tight clothes, and mass_kg right?"
        )
    value = np.concatenate([primitives_of(lump) for lump in lumps])
    com_sd, share, sd = error_size("scan_com", "any"), error_size("scan_inertia", "any"), list[float]()
    for lump in lumps:
        own = np.diag(lump.inertia) / lump.mass
        sd += [0.0, *[com_sd] * 3, *(share * np.array([np.sqrt(own[i] * own[j]) for i, j in TENSOR]))]
    noise = np.diag(np.square(sd))
    noise[::10, ::10] = _mass_noise(mass, body)
    return Opinion(np.arange(value.size), value, noise, dict.fromkeys(SEGMENTS, ("scan",)))


def primitives_of(lump: RigidInertia) -> Array:
    """Return [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (10,) of a lump: kg, m, m²."""
    return np.array([lump.mass, *lump.com, *(lump.inertia[i, j] / lump.mass for i, j in TENSOR)])


def _mass_noise(mass: Array, body: ScannedBody) -> Array:
    """Return the covariance (12, 12) kg² of the masses of a scan."""
    kinds = np.array([kind_of(name) for name in SEGMENTS])
    density = np.array([error_size("scan_density", "trunk" if kind in _TRUNK else "limb") for kind in kinds])
    noise = np.where(kinds[:, None] == kinds, np.outer(density * mass, density * mass), 0.0)
    surface = np.array([body.surfaces[name] for name in SEGMENTS])
    noise += error_size("scan_surface", "any") ** 2 * np.outer(surface, surface)
    alike = error_size("left_right_correlation", "mass")
    for joint, neighbours in _NEIGHBOURS.items():
        moved = np.zeros((len(SIDES), len(SEGMENTS)))  # kg that a cut moved by a metre gives to every segment
        for row, side in zip(moved, SIDES, strict=True):
            near, far = (SEGMENTS.index(kind if kind in _TRUNK else f"{side}_{kind}") for kind in neighbours)
            row[near] = body.cuts[f"{side}_{joint}"]
            row[far] = -row[near]
        both = moved.sum(axis=0)
        noise += error_size("scan_cut", joint) ** 2 * ((1 - alike) * moved.T @ moved + alike * np.outer(both, both))
    across = body.cuts["trunk"] * np.array([(name == "pelvis") - float(name == "trunk_head") for name in SEGMENTS])
    return np.asarray(noise + error_size("scan_cut", "trunk") ** 2 * np.outer(across, across))
