"""Measurements of a person's segments beside the table: girths, the outlines of the feet, a scan; each with its own
noise, all weighted in the same way.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.human.scan import TO_NECK, ScannedBody, cut_scan, read_scan
from biodance.body.human.skeleton import SEGMENTS, Skeleton
from biodance.body.parts import TENSOR, RigidInertia
from biodance.body.tables.anthropometry import Reference, Sex, proportion, read_table, row_numbers
from biodance.body.tables.choice import PARTS, reference, studies, study_masses
from biodance.body.tables.choice import parts as table_parts
from biodance.body.tables.error_sizes import error_size
from biodance.errors import SessionRefused
from biodance.lab.markers.sets import part_of
from biodance.lab.session.file import legal_girths, usual_girths
from biodance.records import SIDES, Array, FootSizes, Subject

WOMAN, MAN = Subject(65.0, 1.70, "F"), Subject(75.0, 1.75, "M")
_LIVING = ("adult", "older")


def published_fractions(kind: str, who: Subject) -> list[float]:
    """Return the fractions by all tables and studies of living adults of one sex; for the trunk only those that cut
    the pelvis themselves (Zatsiorsky's data are de Leva's; Winter's fractions count once, as the man's).
    """
    living = [
        name for name, group in studies(who.sex).items() if group in _LIVING and name != "zatsiorsky_seluyanov_1979"
    ]
    own = [name for name in living if kind not in _TRUNK or name in ("chen_2011", "ma_2011", "pavol_2002")]
    masses = _studied(who.sex)
    return [one.segments[kind].mass for one in published_people(who.sex)] + [masses[name][kind] for name in own]


@functools.cache
def published_people(sex: Sex) -> tuple[Reference, ...]:
    """Return the reference people of the published tables for one sex (Winter's counts once, as the man's)."""
    who = WOMAN if sex == "F" else MAN
    tables = ("de_leva_1996", "dumas_2018", *(("winter_2009",) if sex == "M" else ()))
    return tuple(reference(name, who) for name in tables)


@functools.cache
def _studied(sex: Sex) -> Mapping[str, dict[str, float]]:
    """Return the mass fractions of every kind of segment by study of living adults."""
    who = WOMAN if sex == "F" else MAN
    return {name: study_masses(name, who) for name, group in studies(sex).items() if group in _LIVING}


@functools.cache
def _mean_fraction(kind: str, sex: Sex) -> tuple[float, float]:
    """Return the mean of the published fractions of one sex and its standard error, relative."""
    some = published_fractions(kind, MAN if sex == "M" else WOMAN)
    return float(np.mean(some)), float(np.std(some, ddof=1) / np.mean(some) / np.sqrt(len(some)))


def stack_volume(level: Array, girth: Array, aspect: Array, *, length: float) -> float:
    """Return the volume, m³, of stadium-shaped sections stacked along a segment of ``length`` m.

    ``level`` (n,) ascending, shares of the length from the proximal end (the first section reaches up to 0, the last to
    1); ``girth`` (n,) m = 2 pi r + 4 t; ``aspect`` (n,) breadth over depth = (r + t) / r, at least 1, of a stadium with
    half circles of radius r, apart by 2 t. Between sections r and t are linear.
    """
    radius = np.asarray(girth) / (2 * np.pi + 4 * (np.asarray(aspect) - 1))
    ends = np.unique(np.concatenate([[0.0], level, [1.0]]))
    low, step = ends[:-1, None], np.diff(ends)[:, None]
    # Gauss-Legendre nodes of every interval between sections: exact to degree 5, sections have 4 along the axis.
    nodes, weights = np.polynomial.legendre.leggauss(3)
    place = (low + step * (1 + nodes) / 2).ravel()
    r, t = (np.interp(place, level, one) for one in (radius, (np.asarray(aspect) - 1) * radius))
    # Area of the two half circles and of the rectangle between them.
    return float((step * weights / 2).ravel() * length @ (np.pi * r**2 + 4 * r * t))


_CONTRADICTION = 0.15  # Share of the body mass by which girths, or a scan, may miss it
_TRUNK = ("pelvis", "trunk_head")
_STEP = 0.01  # Of a girth: the step of a difference quotient


@dataclass(frozen=True, eq=False)
class _SegmentOpinion:
    """One measurement of a segment: ``mass`` kg with ``mass_sd``, ``said`` the measures it rests on."""

    mass: float
    mass_sd: float
    said: tuple[str, ...]


def _girth_opinions(reference: Reference, skeleton: Skeleton, subject: Subject) -> dict[str, _SegmentOpinion]:
    """Return the masses from the subject's girths, by segment; segments without a measured girth are not in it."""
    girths = legal_girths(subject.girths)
    every = {segment: _opinion(segment, reference, skeleton, subject, girths) for segment in SEGMENTS}
    opinions = {segment: one for segment, one in every.items() if one.said}
    total = sum(one.mass for one in every.values())
    if abs(total / subject.mass - 1) > _CONTRADICTION:
        table = {segment: reference.segments[part_of(segment)].mass * subject.mass for segment in opinions}
        over = {segment: one.mass - table[segment] for segment, one in opinions.items()}
        worst = max(over, key=lambda segment: abs(over[segment]))
        raise SessionRefused(
            f"[subject] girths_cm: the girths make a body of {total:.1f} kg, but the body mass is {subject.mass:.1f} "
            f"kg ({100 * (total / subject.mass - 1):+.0f} %, at most {100 * _CONTRADICTION:.0f} % is believed). "
            f"Farthest from the table: {worst} by {over[worst]:+.1f} kg ({', '.join(opinions[worst].said)}). Measure "
            "these girths again, or correct mass_kg."
        )
    return opinions


def _opinion(
    segment: str, reference: Reference, skeleton: Skeleton, subject: Subject, girths: Mapping[str, float]
) -> _SegmentOpinion:
    kind, side = part_of(segment), segment.removesuffix(part_of(segment))
    mine = {name: girths.get(f"{side}{name}", girths.get(name)) for name in usual_girths()}
    person = {part_of(one): length for one, length in skeleton.lengths.items() if one.startswith(side)}
    survey = read_table("human", "girths").provenance["people"]["mass_kg"][subject.sex]
    mean, mean_sd = _mean_fraction(kind, subject.sex)
    shape, survey_sd = (error_size("solid_mass", what) for what in ("trunk" if kind in _TRUNK else "limb", "survey"))
    # Independent causes of error in quadrature: mean of the tables, shape of the solid, survey.
    own = np.linalg.norm([mean_sd, shape, survey_sd])
    mass = variance = 0.0
    said: tuple[str, ...] = ()
    for part, share in _shares(kind, subject.sex).items():
        solid = _part_solid(part, reference, subject, person | {"stature": skeleton.stature}, mine)
        if solid is None:
            one, sd = share * reference.segments[kind].mass * subject.mass, error_size("solid_mass", "untold part")
        else:
            ratio, untold, girths_round = solid
            one, sd = share * mean * survey * ratio, np.hypot(own, untold)
            said += tuple(name for name in girths_round if name not in said)
        mass, variance = mass + one, variance + (one * sd) ** 2
    return _SegmentOpinion(mass, float(np.sqrt(variance)), said)


def _shares(kind: str, sex: Sex) -> dict[str, float]:
    """Return the parts of a segment that tapes go round, with their shares in its mass (de Leva 1996)."""
    masses = {part: lump.mass for part, lump in table_parts(sex).items()}
    shares: dict[str, float] = {}
    for part in PARTS[kind]:
        name = "upper_trunk" if part == "middle_trunk" else part
        shares[name] = shares.get(name, 0.0) + masses[part] / sum(masses[one] for one in PARTS[kind])
    return shares


def _part_length(part: str, reference: Reference, sizes: Mapping[str, float]) -> float:
    """Return the length of a part, m, of somebody of these lengths (by kind of segment) and ``stature``."""
    cut = reference.lengths["pelvis"] / reference.lengths["trunk_head"]
    trunk = {"lower_trunk": cut, "upper_trunk": 1 - cut}
    if part in trunk:
        return trunk[part] * sizes["trunk_head"]
    return TO_NECK * sizes["stature"] if part == "head" else sizes["forearm_hand" if part == "forearm" else part]


def _part_solid(
    part: str, reference: Reference, subject: Subject, sizes: Mapping[str, float], girths: Mapping[str, float | None]
) -> tuple[float, float, tuple[str, ...]] | None:
    """Return a part's volume over the mean person's, how unsure the tape leaves it (relative sd), and the girths that
    were measured; None where none of it was, or no tape goes round it.
    """
    table = read_table("human", "girths")
    rows = table.where(part=part)
    given = np.array([girths[row["girth"]] is not None for row in rows])
    if not given.any():
        return None
    level, aspect, usual = np.array([row_numbers(row, f"level aspect {subject.sex}") for row in rows]).T
    measured = np.array([girths[row["girth"]] or one for row, one in zip(rows, usual, strict=True)])
    # A girth that was not measured grows by the mean ratio (of logarithms) of those that were.
    predict = np.where(given[:, None], np.eye(len(rows)), given / given.sum())
    girth = usual * np.exp(predict @ np.log(measured / usual))
    grown = table.provenance["people"]["stature_m"][subject.sex] / reference.stature
    people = {kind: grown * length for kind, length in reference.lengths.items()}
    length = _part_length(part, reference, sizes)
    usual_length = _part_length(part, reference, people | {"stature": grown * reference.stature})
    volume = stack_volume(level, girth, aspect, length=length)
    mean = stack_volume(level, usual, aspect, length=usual_length)
    more = [girth * np.exp(_STEP * one) for one in np.eye(len(rows))]
    # d log V / d log girth, by a step of one girth at a time.
    slope = np.array([np.log(stack_volume(level, one, aspect, length=length) / volume) / _STEP for one in more])
    tape, untold = error_size("girth", "tape"), error_size("girth", "untold")
    # Errors of the tape through the prediction; of what no tape told, its own.
    covariance = predict @ np.diag(given * tape**2) @ predict.T + np.diag(~given * untold**2)
    said = tuple(row["girth"] for row, is_given in zip(rows, given, strict=True) if is_given)
    return volume / mean, float(np.sqrt(slope @ covariance @ slope)), said


def usual_outline(length: float, sex: Sex) -> FootSizes:
    """Return the outline of a usual foot of this length, m."""
    breadth, heel = (proportion(size, sex) * length for size in ("foot_breadth", "heel_breadth"))
    return FootSizes(length, breadth, heel)


def sole_corners(outline: FootSizes, sex: Sex) -> Array:
    """Return the corners (6, 2) m of a sole, ahead of the heel and to the right, counter-clockwise from above."""
    length, wide, narrow = outline.length, outline.breadth / 2, outline.heel_breadth / 2
    ball = proportion("ball_from_heel", sex) * length
    return np.array([(0.0, narrow), (ball, wide), (length, narrow), (length, -narrow), (ball, -wide), (0.0, -narrow)])


def _foot_opinions(skeleton: Skeleton, subject: Subject) -> dict[str, _SegmentOpinion]:
    """Return what the outlines say about the masses of the feet."""
    people = read_table("human", "girths").provenance["people"]
    mean, mean_sd = _mean_fraction("foot", subject.sex)
    stature = people["stature_m"][subject.sex]
    usual = usual_outline(proportion("foot_length", subject.sex) * stature, subject.sex)
    height = proportion("ankle_height", subject.sex) * stature
    own = np.linalg.norm([mean_sd, error_size("solid_mass", "foot"), error_size("solid_mass", "survey")])
    opinions = {}
    for side in SIDES:
        area = _area(subject.foot_outline[side], subject.sex) / _area(usual, subject.sex)
        # As the volume: area of the sole times height of the ankle, against those of the usual foot.
        mass = mean * people["mass_kg"][subject.sex] * area * skeleton.ankle_height[side] / height
        opinions[f"{side}_foot"] = _SegmentOpinion(mass, float(own * mass), ("foot outline",))
    return opinions


def _area(outline: FootSizes, sex: Sex) -> float:
    x, y = sole_corners(outline, sex).T
    # Shoelace formula.
    return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


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
        opinions.append(_of_masses(_girth_opinions(reference, skeleton, subject)))
    if subject.foot_outline:
        opinions.append(_of_masses(_foot_opinions(skeleton, subject)))
    if subject.scan:
        scan = read_scan(subject.scan, subject.stature, subject.scan_up)
        opinions.append(_scan_opinion(cut_scan(scan, skeleton), subject))
    return tuple(opinions)


def told_by(opinions: tuple[Opinion, ...]) -> dict[str, tuple[str, ...]]:
    """Return by segment what its mass was measured by beside the table, in the order of the segments."""
    sources = {name: tuple(word for one in opinions for word in one.said.get(name, ())) for name in SEGMENTS}
    return {name: words for name, words in sources.items() if words}


def _of_masses(opinions: Mapping[str, _SegmentOpinion]) -> Opinion:
    """Return opinions on masses; the sides err together: same tape, same shape of muscle."""
    kinds = np.array([part_of(segment) for segment in opinions])
    sds = np.array([one.mass_sd for one in opinions.values()])
    together = np.where(kinds[:, None] == kinds, error_size("left_right_correlation", "mass"), 0.0)
    np.fill_diagonal(together, 1.0)
    where = np.array([10 * SEGMENTS.index(segment) for segment in opinions], dtype=np.intp)
    value = np.array([one.mass for one in opinions.values()])
    return Opinion(where, value, together * np.outer(sds, sds), {name: one.said for name, one in opinions.items()})


def _scan_opinion(body: ScannedBody, subject: Subject) -> Opinion:
    """Return what a cut scan says about mass, CoM and inertia of every segment."""
    lumps = [body.lumps[name] for name in SEGMENTS]
    mass = np.array([lump.mass for lump in lumps])
    if abs(mass.sum() / subject.mass - 1) > _CONTRADICTION:
        raise SessionRefused(
            f"[subject] scan: the scan weighs {mass.sum():.1f} kg by volume and density, but the body mass is "
            f"{subject.mass:.1f} kg ({100 * (mass.sum() / subject.mass - 1):+.0f} %, at most "
            f"{100 * _CONTRADICTION:.0f} % is believed). Is it the same person, in tight clothes, and mass_kg right?"
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
    kinds = np.array([part_of(name) for name in SEGMENTS])
    density = np.array([error_size("scan_density", "trunk" if kind in _TRUNK else "limb") for kind in kinds])
    # Density errs alike for segments of one kind.
    noise = np.where(kinds[:, None] == kinds, np.outer(density * mass, density * mass), 0.0)
    surface = np.array([body.surfaces[name] for name in SEGMENTS])
    # Surface farther out by one error everywhere: all masses gain together.
    noise += error_size("scan_surface", "any") ** 2 * np.outer(surface, surface)
    alike = error_size("left_right_correlation", "mass")
    neighbours_at = {"hip": ("pelvis", "thigh"), "knee": ("thigh", "shank"), "ankle": ("shank", "foot")}
    neighbours_at |= {"shoulder": ("trunk_head", "upper_arm"), "elbow": ("upper_arm", "forearm_hand")}
    for joint, neighbours in neighbours_at.items():
        moved = np.zeros((len(SIDES), len(SEGMENTS)))  # kg that a cut moved by a metre gives to every segment
        for row, side in zip(moved, SIDES, strict=True):
            near, far = (SEGMENTS.index(kind if kind in _TRUNK else f"{side}_{kind}") for kind in neighbours)
            row[near] = body.cuts[f"{side}_{joint}"]
            # What one side of a cut gains the other loses.
            row[far] = -row[near]
        both = moved.sum(axis=0)
        # Both sides' cuts correlated by `alike`: (1 - rho) each on its own, rho together.
        noise += error_size("scan_cut", joint) ** 2 * ((1 - alike) * moved.T @ moved + alike * np.outer(both, both))
    across = body.cuts["trunk"] * np.array([(name == "pelvis") - float(name == "trunk_head") for name in SEGMENTS])
    return np.asarray(noise + error_size("scan_cut", "trunk") ** 2 * np.outer(across, across))
