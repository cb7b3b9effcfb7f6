"""The 12-segment, 23-degree-of-freedom human: from stature, mass and sex alone, and as a Body on any skeleton; its
prior segment inertial parameters are a table scaled to the skeleton, with the spread of tables.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from biodance.body.body import Body
from biodance.body.human.opinions import (
    MAN,
    WOMAN,
    Opinion,
    body_opinions,
    primitives_of,
    published_fractions,
    published_people,
    sole_corners,
    told_by,
    usual_outline,
)
from biodance.body.human.skeleton import (
    SEGMENTS,
    Skeleton,
    cut_at_joint,
    generic_skeleton,
    joint_limits,
    joint_tree,
    upright_to,
)
from biodance.body.parts import (
    TENSOR,
    Foot,
    RigidInertia,
    SegmentMarkers,
    inertial_parameters,
    lump_from,
    parameter_jacobian,
    stretch_inertia,
    turn_inertia,
)
from biodance.body.tables.anthropometry import Reference, proportion, read_table, row_numbers
from biodance.body.tables.choice import PARTS, measured_whole, reference, regression, studies, study_masses, trunk_joint
from biodance.body.tables.choice import lengths as reference_lengths
from biodance.body.tables.choice import reference as reference_of
from biodance.body.tables.error_sizes import error_size
from biodance.display import spaced
from biodance.lab.markers.sets import MarkerSet, part_of, read_marker_set
from biodance.records import SIDES, Array, Sip, Subject, grouped, side_in_name
from biodance.settings import STANDARD_GRAVITY, Settings

_BOTH = (WOMAN, MAN)
_TRUNK = ("pelvis", "trunk_head")


@dataclass(frozen=True, eq=False)
class _Spread:
    """Standard deviations of one kind of segment.

    ``mass`` relative; ``com`` (3,) in units of the length; ``radii`` (3,) relative, of the radii of gyration about x,
    y, z; ``products`` (3,) of xy, xz, yz of the inertia per unit mass, in units of the length squared. The length is
    the segment's own; for pelvis and trunk_head it is mid hip to mid shoulder.
    """

    mass: float
    com: Array
    radii: Array
    products: Array


@functools.cache
def _table_spread(kind: str) -> _Spread:
    """Return the standard deviations of one kind of segment (`KINDS`)."""
    alike = kind not in _TRUNK
    people = _by_sex([[_in_lengths(one, kind) for one in published_people(who.sex)] for who in _BOTH], alike)
    masses = _by_sex([published_fractions(kind, who) for who in _BOTH], alike)
    inner = _within(kind)
    tensors = [[unit.inertia for unit in units] for units in people]
    return _Spread(
        float(np.hypot(_sd([np.array(one) / np.mean(one) for one in masses]), inner.mass)),
        np.hypot(_sd([[unit.com for unit in units] for units in people]), inner.com),
        # Radii go with the square root of the moment: d(log radius) = d(log J) / 2.
        np.hypot(_sd([[0.5 * np.log(np.diag(one)) for one in some] for some in tensors]), inner.radii),
        _sd([[one[(0, 0, 1), (1, 2, 2)] for one in some] for some in tensors]),
    )


def _by_sex(groups: list[list[Any]], alike: bool) -> list[list[Any]]:
    """Return the groups of women and men apart where the sexes are cut ``alike``, else together."""
    return groups if alike else [[one for group in groups for one in group]]


def _sd(groups: Iterable[Sequence[Array]]) -> Array:
    """Return the standard deviation about the mean of each of ``groups``, pooled."""
    each = [np.array(group) for group in groups]
    squares = sum(((one - one.mean(axis=0)) ** 2).sum(axis=0) for one in each)
    # Pooled: squares of all groups over the sum of their degrees of freedom.
    return np.asarray(np.sqrt(squares / sum(len(one) - 1 for one in each)))


def _in_lengths(person: Reference, kind: str) -> RigidInertia:
    """Return the segment in units of its length, CoM of the trunk from the mid hip; ``inertia`` per unit mass."""
    unit, length = person.segments[kind], person.lengths[kind]
    base = np.zeros(3)
    if kind in ("pelvis", "trunk_head"):
        length = person.lengths["trunk_head"]
        base[1] = person.lengths["pelvis"] if kind == "trunk_head" else 0.0
    return RigidInertia(1.0, (unit.com + base) / length, unit.inertia / length**2)


def _within(kind: str) -> _Spread:
    """Return the spread between men of one mass and stature; parts of a compound segment vary independently."""
    parts = PARTS[kind]
    mass, mass_sd = np.array([regression(part, "mass", "", MAN) for part in parts]).T
    share = mass / mass.sum()
    length = reference_lengths("M")["trunk_head" if kind == "pelvis" else kind]
    # The centres of the parts err independently, each counts with its share of the mass.
    com = np.linalg.norm(share * [regression(part, "com", "longitudinal", MAN)[1] for part in parts]) / length
    along = np.array([com, 0.0, 0.0]) if kind == "foot" else np.array([0.0, com, 0.0])
    names = ("longitudinal", "sagittal", "transverse") if kind == "foot" else ("sagittal", "longitudinal", "transverse")
    moments = np.array([[regression(part, "inertia", axis, MAN) for part in parts] for axis in names])
    # var(log k²) = var(log J) - var(log m); the radius k has half of that standard deviation.
    variance = (moments[..., 1] / moments[..., 0]) ** 2 - (mass_sd / mass) ** 2
    radii = np.array([share @ row for row in 0.5 * np.sqrt(np.maximum(variance, 0.0))])
    return _Spread(float(np.linalg.norm(mass_sd) / mass.sum()), along, radii, np.zeros(3))


MIRROR = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
"""Signs of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] under reflection at z = 0."""


def prior(
    reference: Reference, skeleton: Skeleton, subject: Subject, opinions: tuple[Opinion, ...] | None = None
) -> Sip:
    """Return the prior SIP of a person with covariance (120, 120); the masses sum to the subject's mass.

    The table scaled to the skeleton; girths, foot outlines and a scan of the subject are opinions beside it, weighted
    with their precision (``opinions``, taken from the subject if None).
    """
    lumps = scaled_lumps(reference, skeleton, subject)
    others = tuple(
        scaled_lumps(reference_of(name, subject), skeleton, subject)
        for name in measured_whole()
        if name != reference.table
    )
    opinions = body_opinions(reference, skeleton, subject) if opinions is None else opinions
    least = error_size("segment_mass", "floor") if opinions else 0.0
    wider = child_widening(subject) ** 2
    covariance = wider * primitive_covariance(lumps, skeleton, others, least=least)
    if opinions:
        apart = wider * primitive_covariance(lumps, skeleton, (), least=least)
        lumps, covariance = _weigh(lumps, covariance, apart, opinions)
    # J C J', J block diagonal: from mass, centre and inertia about it to the ten parameters.
    jacobian = np.zeros((10 * len(lumps), 10 * len(lumps)))
    for i, lump in enumerate(lumps):
        jacobian[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] = parameter_jacobian(lump)
    covariance = jacobian @ covariance @ jacobian.T
    phi = np.concatenate([inertial_parameters(lump) for lump in lumps])
    return Sip(SEGMENTS, phi, (covariance + covariance.T) / 2, tuple(told_by(opinions)))


def _weigh(
    lumps: tuple[RigidInertia, ...], covariance: Array, apart: Array, opinions: tuple[Opinion, ...]
) -> tuple[tuple[RigidInertia, ...], Array]:
    """Return segments and covariance (120, 120) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] after other opinions."""
    where = np.concatenate([one.where for one in opinions])
    noise = block_diag(*(one.noise for one in opinions))
    theta = np.concatenate([primitives_of(lump) for lump in lumps])
    total = theta[::10].sum()
    # Gain with each segment's spread on its own: `apart` has no common way of the tables.
    gain = np.linalg.solve(apart[np.ix_(where, where)] + noise, apart[where]).T
    keep = np.eye(len(covariance))
    for row, column in zip(where, gain.T, strict=True):
        keep[:, row] -= column
    theta = theta + gain @ (np.concatenate([one.value for one in opinions]) - theta[where])
    theta[::10] *= total / theta[::10].sum()
    # Joseph's form (1 - G H) C (1 - G H)' + G N G': right for any gain, also where it is not that of C.
    return tuple(lump_from(row) for row in theta.reshape(-1, 10)), keep @ covariance @ keep.T + gain @ noise @ gain.T


def is_child(subject: Subject) -> bool:
    """Return whether age, or the stature of somebody whose age is not known, says child."""
    # 1.50 m: one adult woman in twenty is smaller (ANSUR II 2012)
    return subject.stature < 1.50 if np.isnan(subject.age) else subject.age < 18.0


def child_widening(subject: Subject) -> float:
    """Return by how much the standard deviations of the adult tables are multiplied for a person: 1 for an adult.

    For a child it is what makes the table's masses and those of boys of 12 years (Jensen 1986, J. Biomech. 19,
    359-368) differ by one standard deviation in the root mean square over the segments: no
    table here holds centres of mass and inertias of children.
    """
    return _boys_widening() if is_child(subject) else 1.0


@functools.cache
def _boys_widening() -> float:
    adult, boy = reference_of("de_leva_1996", MAN), study_masses("jensen_1986_12y", MAN)
    limbs = ("thigh", "shank", "foot", "upper_arm", "forearm_hand")
    apart = np.array([boy[kind] / adult.segments[kind].mass - 1.0 for kind in limbs])
    spread = np.array([_table_spread(kind).mass for kind in limbs])
    # Widening w with mean of (apart² + spread²) / (w spread)² = 1.
    return float(max(1.0, np.sqrt(np.mean((apart**2 + spread**2) / spread**2))))


def scaled_lumps(reference: Reference, skeleton: Skeleton, subject: Subject) -> tuple[RigidInertia, ...]:
    """Return the 12 segments of the reference person at the subject's mass and segment lengths, each in its segment
    frame.

    The pelvis of the table is upright; it is turned so that its long axis points from the mid hip to where the table
    cuts the trunk, and the trunk keeps its place in the person, unless both are cut at the joint (`cut_at_joint`). The
    foot lies between the person's heel and toe, wherever between them the ankle is.
    """
    lumps = []
    for segment in SEGMENTS:
        kind = part_of(segment)
        unit, longer = reference.segments[kind], skeleton.stretched.get(segment, 1.0)
        scale, mass = skeleton.lengths[segment] / reference.lengths[kind], unit.mass * subject.mass
        lump = RigidInertia(mass, scale * unit.com, mass * scale**2 * unit.inertia)
        if segment == "pelvis":
            lump = stretch_inertia(lump, np.array([1.0, longer, 1.0]) / longer)
            lump = turn_inertia(lump, upright_to(skeleton.cut.get("pelvis", skeleton.origins["trunk"])))
        if segment == "trunk_head":
            tall = stretch_inertia(lump, np.array([1.0, longer, 1.0]))
            lump = replace(tall, com=lump.com + skeleton.cut.get("trunk_head", np.zeros(3)))
        if kind == "foot":
            usual = proportion("heel_behind_ankle", subject.sex) * skeleton.lengths[segment]
            ahead = usual - skeleton.heel_behind_ankle[segment.removesuffix("_foot")]
            lump = replace(lump, com=lump.com + np.array([ahead, 0.0, 0.0]))
        # The other body side is the mirror image at z = 0.
        lumps.append(turn_inertia(lump, np.diag([1.0, 1.0, -1.0])) if segment.startswith("left") else lump)
    return tuple(lumps)


def disagreement(lumps: tuple[RigidInertia, ...], other: tuple[RigidInertia, ...]) -> Array:
    """Return how the limbs of another table differ, (120,) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] (kg, m, m²): one
    standard deviation.

    Zero for pelvis and trunk, which tables divide at different heights.
    """
    rows = [
        np.zeros(10) if s in _TRUNK else primitives_of(b) - primitives_of(a)
        for s, a, b in zip(SEGMENTS, lumps, other, strict=True)
    ]
    return np.concatenate(rows)


def primitive_covariance(
    lumps: tuple[RigidInertia, ...],
    skeleton: Skeleton,
    others: tuple[tuple[RigidInertia, ...], ...],
    *,
    least: float = 0.0,
) -> Array:
    """Return the covariance (120, 120) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] of all segments (kg, m, m²); ``others``
    other tables'; ``least`` relative sd of the mass of a segment of one part.

    The variance of ``_primitive_sd`` is divided: what the disagreement of the tables explains moves together, the rest
    on its own.
    """
    ways = np.array([disagreement(lumps, other) for other in others]).reshape(-1, 10 * len(lumps))
    variance = np.concatenate([_primitive_sd(s, lump, skeleton) for s, lump in zip(SEGMENTS, lumps, strict=True)]) ** 2
    floor = [least * lump.mass * (len(PARTS[part_of(s)]) == 1) for s, lump in zip(SEGMENTS, lumps, strict=True)]
    variance[::10] = np.maximum(variance[::10], np.square(floor))
    # What the disagreement of the tables explains is no error of a segment's own; at least the share `own_share`.
    own = np.sqrt(np.maximum(variance - np.sum(ways**2, axis=0), error_size("own_share", "variance") * variance))
    together = np.eye(len(SEGMENTS))
    for i, segment in enumerate(SEGMENTS):
        if segment.startswith("right_"):
            left = SEGMENTS.index(segment.replace("right_", "left_"))
            together[i, left] = together[left, i] = error_size("left_right_correlation", "mass")
    scale = own * np.concatenate([MIRROR if s.startswith("left") else np.ones(10) for s in SEGMENTS])
    # Own errors, right and left correlated (mirrored axes change signs), plus one direction for each other table.
    covariance = np.kron(together, np.eye(10)) * np.outer(scale, scale) + ways.T @ ways
    total = np.tile(np.eye(10)[0], len(SEGMENTS))
    gain = covariance @ total
    # Conditioned on the total mass, known to `scale`.
    return covariance - np.outer(gain, gain) / (total @ gain + error_size("scale", "mass") ** 2)


def com_sd(segment: str, skeleton: Skeleton) -> Array:
    """Return the standard deviations (3,) m of a segment's CoM in its frame: tables, people, misplaced joints."""
    length = skeleton.lengths["trunk_head" if segment == "pelvis" else segment]
    return np.hypot(_table_spread(part_of(segment)).com * length, error_size("joint_centre", "other", state="before"))


def _primitive_sd(segment: str, lump: RigidInertia, skeleton: Skeleton) -> Array:
    """Return the standard deviations (10,) of [m, c, Jxx, Jxy, Jyy, Jxz, Jyz, Jzz] of a segment about its joint."""
    kind, own = _table_spread(part_of(segment)), lump.inertia / lump.mass
    length = skeleton.lengths["trunk_head" if segment == "pelvis" else segment]
    products = dict(zip(((0, 1), (0, 2), (1, 2)), kind.products, strict=True))
    tensor = [
        # J_ii = r²: d J = 2 J d(log r).
        2 * own[i, i] * kind.radii[i]
        if i == j
        else np.hypot(
            products[i, j] * length**2, error_size("product_floor", "inertia") * np.sqrt(own[i, i] * own[j, j])
        )
        for i, j in TENSOR
    ]
    return np.array([kind.mass * lump.mass, *(kind.com * length), *tensor])


def com_boxes(sip: Sip, skeleton: Skeleton, boxes: Array) -> Array:
    """Return where the CoM may be, (12, 2, 3) m: three standard deviations around the prior, inside the shape box."""
    # Half width of a CoM box in prior standard deviations
    half = 3.0 * np.array([com_sd(segment, skeleton) for segment in SEGMENTS])
    around = np.stack([sip.com - half, sip.com + half], axis=1)
    return np.clip(around, boxes[:, :1], boxes[:, 1:])


def sole(skeleton: Skeleton, subject: Subject, side: str) -> Foot:
    """Return the sole under one foot: a hexagon of heel, ball and toe corners, m, counter-clockwise seen from above."""
    segment = f"{side}_foot"
    outline = subject.foot_outline.get(side) or usual_outline(skeleton.lengths[segment], subject.sex)
    corners = sole_corners(outline, subject.sex) - [skeleton.heel_behind_ankle[side], 0.0]
    return Foot(SEGMENTS.index(segment), np.insert(corners, 1, -skeleton.ankle_height[side], axis=1))


_ADULT = (18.0, 65.0)  # years: the ages that the usual table speaks for


def human(
    subject: Subject, *, table: str = Settings.table, markers: str = "plug_in_gait", gravity: float = STANDARD_GRAVITY
) -> Body:
    """Return a generic person of the subject's stature, mass and sex, with the markers of a marker set at their usual
    places.

    For a person who was measured use `scale`: generic lengths miss by centimetres, and the wand markers have no usual
    place.

    Parameters
    ----------
    subject : Subject
        Mass kg, stature m, sex; the age where strength matters.
    table : str
        Table of segment inertial parameters, which also gives the lengths.
    markers : str
        Name of a marker set, or the path of its file.
    gravity : float
        Of the laboratory, m/s² along -z.

    Returns
    -------
    Body
        12 segments, 23 joint angles, inertial parameters with covariance.

    Raises
    ------
    UnknownName
        There is no such table for this sex, or no such marker set.
    SessionRefused
        The mass or the stature is not known.

    See Also
    --------
    scale : The body of a person with a static trial.

    References
    ----------
    The usual table: de Leva 1996, doi:10.1016/0021-9290(95)00178-6.

    Examples
    --------
    >>> biodance.human(biodance.Subject(62.0, 1.70, "F", name="S01"))
    Body('S01', 12 segments, 23 joint angles, 62.0 kg)
    """
    subject.require("mass", "stature")
    skeleton = generic_skeleton(reference(table, subject), subject)
    note = (
        f"Segment lengths: table {table} at stature {subject.stature:.3f} m; nobody was measured. Markers: usual "
        f"places of {markers}."
    )
    worn = _generic_markers(skeleton, read_marker_set(markers))
    return assemble(subject, skeleton, table=table, markers=worn, notes=(note,), gravity=gravity)


def assemble(
    subject: Subject,
    skeleton: Skeleton,
    *,
    table: str,
    markers: SegmentMarkers,
    notes: tuple[str, ...],
    gravity: float = STANDARD_GRAVITY,
) -> Body:
    """Return the Body of a skeleton: joint tree, prior SIP, limits, boxes and soles."""
    measured = {f"{side}_foot": outline.length for side, outline in subject.foot_outline.items()}
    skeleton = replace(skeleton, lengths={**skeleton.lengths, **measured})
    usual, corners = reference(table, subject), "x_min y_min z_min x_max y_max z_max"
    rows = [row_numbers(read_table("human", "boxes").row(segment=part_of(s)), corners) for s in SEGMENTS]
    boxes = np.array(rows).reshape(-1, 2, 3) * skeleton.stature
    # The box ends at the vertex, counted from this person's trunk joint instead of the lumbar one from which the
    # table measures the trunk: 0.112 m over the hips at 1.755 m (ANSUR II).
    boxes[SEGMENTS.index("trunk_head"), 1, 1] -= skeleton.origins["trunk"][1] - 0.112 / 1.755 * skeleton.stature
    opinions = body_opinions(usual, skeleton, subject)
    sip = prior(usual, skeleton, subject, opinions)
    along = prior(usual, cut_at_joint(skeleton), subject) if skeleton.cut else None
    told = told_by(opinions)
    rooms = np.array([com_boxes(one, skeleton, boxes) for one in (sip, along) if one])
    return Body(
        name=subject.name or "human",
        segments=SEGMENTS,
        joints=joint_tree(skeleton),
        sip=sip,
        limits=joint_limits(subject),
        markers=markers,
        boxes=boxes,
        com_boxes=np.stack([rooms[:, :, 0].min(axis=0), rooms[:, :, 1].max(axis=0)], axis=1),
        feet={side: sole(skeleton, subject, side) for side in SIDES},
        notes=(*notes, *_prior_notes(subject, table), *_shape_notes(told)),
        gravity=np.array([0.0, 0.0, -gravity]),
        at_joint=along,
        girths=told,
    )


def _shape_notes(told: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Return what of the person's shape says something about which masses."""
    if not told:
        return ()
    sources = ((", ".join(name for name in names if name != "scan"), segment) for segment, names in told.items())
    some = [f"{names} for {' and '.join(segments)}" for names, segments in grouped(sources).items() if names]
    scanned = ["the scan for all segments"] if "scan" in told.get("pelvis", ()) else []
    words = spaced("; ".join([*some, *scanned]))
    return (
        f"Shapes of the person weigh beside the table in the prior ({words}): girths as stadium solids (Yeadon 1990) "
        "and foot outlines about the mean of all tables, a scan by volume and density; other segments keep the table's "
        "opinion under the same body mass.",
    )


def _prior_notes(subject: Subject, table: str) -> tuple[str, ...]:
    joint = trunk_joint(table)
    sex = {"F": "woman", "M": "man"}[subject.sex]
    notes = [
        f"Segment parameters before the data: {table} for a {sex} of {subject.mass:.2f} kg, standard deviations from "
        f"the spread of tables; trunk joint at {joint}."
    ]
    if table in measured_whole() and not (np.isnan(subject.age) or _ADULT[0] <= subject.age <= _ADULT[1]):
        groups = {study for sex in ("F", "M") for study, group in studies(sex).items() if group in ("child", "older")}
        notes.append(
            f"Table {table} is of young adults, the subject is {subject.age:.0f} years old; consider "
            f"{', '.join(sorted(groups))}."
        )
    if is_child(subject):
        why = f"{subject.age:.0f} years" if not np.isnan(subject.age) else f"{subject.stature:.2f} m and no age given"
        notes.append(
            f"A child ({why}): no table of children has centres of mass and inertias, so those of adults are scaled "
            f"and their standard deviations are multiplied by {child_widening(subject):.1f} (boys of 12, Jensen 1986)."
        )
    return tuple(notes)


def _generic_markers(skeleton: Skeleton, marker_set: MarkerSet) -> SegmentMarkers:
    """Return the markers of a set that have a usual place, there (offset times normaliser)."""
    shoulders = np.mean([skeleton.origins["right_shoulder"], skeleton.origins["left_shoulder"]], axis=0)
    worn = [marker for marker in marker_set.markers if marker.offset is not None]
    places = [
        np.array(marker.offset) * normaliser(skeleton, marker.normaliser, marker.segment)
        + (shoulders if marker.origin == "mid_shoulder" else 0.0)
        for marker in worn
    ]
    return SegmentMarkers(
        tuple(marker.label for marker in worn),
        tuple(SEGMENTS.index(marker.segment) for marker in worn),
        np.array(places).reshape(-1, 3),
        np.array([marker.weight for marker in worn]),
    )


def normaliser(skeleton: Skeleton, name: str, segment: str) -> float:
    """Return a normaliser of the marker sets, m, on the marker's own side."""
    sizes = {
        "asis_width": skeleton.asis_width,
        "stature": skeleton.stature,
        "trunk_length": skeleton.lengths["trunk_head"],
    }
    if name in sizes:
        return sizes[name]
    kind = name.removesuffix("_length").replace("forearm", "forearm_hand")
    return skeleton.lengths[f"{side_in_name(segment, 'right')}_{kind}"]
