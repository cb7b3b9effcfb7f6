"""The 12-segment, 23-degree-of-freedom human: from stature, mass and sex alone, and as a Body on any skeleton."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.body.human.opinions import body_opinions, sole_corners, told_by, usual_outline
from biodance.body.human.prior import child_widening, com_sd, is_child, prior
from biodance.body.human.skeleton import (
    SEGMENTS,
    Skeleton,
    cut_at_joint,
    generic_skeleton,
    joint_limits,
    joint_tree,
    kind_of,
    side_of,
)
from biodance.body.parts import Foot, SegmentMarkers
from biodance.body.tables.anthropometry import read_table, row_numbers
from biodance.body.tables.choice import measured_whole, reference, studies, trunk_joint
from biodance.display import spaced
from biodance.lab.markers.sets import MarkerSet, read_marker_set
from biodance.records import SIDES, Array, Sip, Subject
from biodance.settings import STANDARD_GRAVITY, Settings

_COM_SIGMAS = 3.0  # Half width of a CoM box in prior standard deviations
_LUMBAR_HEIGHT = 0.112 / 1.755
"""Stature: height over the hips of the lumbar joint from which ``boxes.csv`` measures the trunk (ANSUR II, 1.755 m)."""


def _shape_boxes(skeleton: Skeleton) -> Array:
    """Return the boxes (12, 2, 3) m of ``boxes.csv`` at the person's stature, in the segment frames."""
    table = read_table("human", "boxes")
    columns = "x_min y_min z_min x_max y_max z_max"
    corners = np.array([row_numbers(table.row(segment=kind_of(s)), columns) for s in SEGMENTS])
    boxes = corners.reshape(-1, 2, 3) * skeleton.stature
    boxes[SEGMENTS.index("trunk_head"), 1, 1] -= skeleton.origins["trunk"][1] - _LUMBAR_HEIGHT * skeleton.stature
    return boxes


def com_boxes(sip: Sip, skeleton: Skeleton, boxes: Array) -> Array:
    """Return where the CoM may be, (12, 2, 3) m: three standard deviations around the prior, inside the shape box."""
    half = _COM_SIGMAS * np.array([com_sd(segment, skeleton) for segment in SEGMENTS])
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
    usual, boxes = reference(table, subject), _shape_boxes(skeleton)
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
    by_source: dict[str, list[str]] = {}
    for segment, names in told.items():
        by_source.setdefault(", ".join(name for name in names if name != "scan"), []).append(segment)
    some = [f"{names} for {' and '.join(segments)}" for names, segments in by_source.items() if names]
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
    return skeleton.lengths[f"{'left' if side_of(segment) < 0 else 'right'}_{kind}"]
