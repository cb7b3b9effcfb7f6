"""The 12-segment, 23-degree-of-freedom human from stature, mass and sex alone, and its assembly from any skeleton."""

import numpy as np

from biodance.body.body import Body, Foot, SegmentMarkers
from biodance.body.limits import joint_limits
from biodance.body.prior import prior
from biodance.body.segment_tables import proportion, reference
from biodance.body.skeleton import SEGMENTS, SIDES, Skeleton, generic_skeleton, joint_tree, kind_of, side_of
from biodance.body.tables import numbers, read_table
from biodance.lab.marker_sets import MarkerSet, read_marker_set
from biodance.records import Array, Subject

DEFAULT_TABLE = "de_leva_1996"


def human(subject: Subject, *, table: str = DEFAULT_TABLE, markers: str = "plug_in_gait") -> Body:
    """Return a generic person of the subject's stature, mass and sex, with the markers of a marker set at their usual places.

    Lengths, masses, CoM and inertias come from ``table``, widths and feet from ``anthropometry/human``. For a person who was measured,
    use ``scale``: generic segment lengths miss by several centimetres and generic wand markers are useless.

    Raises
    ------
    UnknownName
        There is no such table or marker set.
    """
    model = reference(table, subject)
    skeleton = generic_skeleton(model, subject)
    note = f"Lengths: table {table} at stature {subject.stature:.3f} m, generic markers of {markers}."
    return assemble(subject, skeleton, table=table, markers=generic_markers(skeleton, read_marker_set(markers)), notes=(note,))


def assemble(subject: Subject, skeleton: Skeleton, *, table: str, markers: SegmentMarkers, notes: tuple[str, ...]) -> Body:
    """Return the Body of a skeleton: joint tree, prior SIP, limits, boxes and feet."""
    model = reference(table, subject)
    boxes = shape_boxes(skeleton)
    return Body(
        name=subject.name or "human",
        segments=SEGMENTS,
        joints=joint_tree(skeleton),
        sip=prior(model, skeleton, subject),
        limits=joint_limits(subject),
        markers=markers,
        boxes=boxes,
        com_boxes=boxes,
        feet={side: sole(skeleton, subject, side) for side in SIDES},
        notes=(*notes, f"Prior SIP: {table}, {subject.sex}, total mass {subject.mass:.2f} kg."),
    )


def generic_markers(skeleton: Skeleton, marker_set: MarkerSet) -> SegmentMarkers:
    """Return the markers of a set at their usual places (offset times normaliser); markers without a usual place are left out."""
    shoulders = np.mean([skeleton.origins["right_shoulder"], skeleton.origins["left_shoulder"]], axis=0)
    placed = [marker for marker in marker_set.markers if marker.offset is not None]
    position = [
        np.array(marker.offset) * _size(skeleton, marker.normaliser, marker.segment)
        + (shoulders if marker.origin == "mid_shoulder" else 0.0)
        for marker in placed
    ]
    return SegmentMarkers(
        tuple(marker.label for marker in placed),
        tuple(SEGMENTS.index(marker.segment) for marker in placed),
        np.array(position),
        np.array([marker.weight for marker in placed]),
    )


def _size(skeleton: Skeleton, normaliser: str, segment: str) -> float:
    """Return a normaliser of the marker sets, m, on the marker's own side."""
    if normaliser in ("asis_width", "stature"):
        return skeleton.asis_width if normaliser == "asis_width" else skeleton.stature
    if normaliser == "trunk_length":
        return skeleton.lengths["trunk_head"]
    kind = normaliser.removesuffix("_length")
    side = "left" if side_of(segment) < 0 else "right"
    return skeleton.lengths[f"{side}_{'forearm_hand' if kind == 'forearm' else kind}"]


def shape_boxes(skeleton: Skeleton) -> Array:
    """Return the boxes (12, 2, 3) m of ``boxes.csv``: lower and upper corners in the segment frames."""
    table = read_table("human", "boxes")
    columns = "x_min y_min z_min x_max y_max z_max"
    return np.array([numbers(table.row(segment=kind_of(s)), columns) for s in SEGMENTS]).reshape(-1, 2, 3) * skeleton.stature


def sole(skeleton: Skeleton, subject: Subject, side: str) -> Foot:
    """Return the sole: heel, ball and toe corners of a hexagon under the ankle, m, counter-clockwise from above."""
    segment = f"{side}_foot"
    length, ratio = (
        skeleton.lengths[segment],
        {s: proportion(s, subject.sex) for s in ("heel_behind_ankle", "ball_from_heel", "foot_breadth")},
    )
    heel = -ratio["heel_behind_ankle"] * length
    ball, toe = heel + ratio["ball_from_heel"] * length, heel + length
    wide, narrow = ratio["foot_breadth"] * length / 2, proportion("heel_breadth", subject.sex) * length / 2
    # right (z > 0) from heel to toe, then back on the left: counter-clockwise seen from above (y up, x forward, z right)
    corners = [(heel, narrow), (ball, wide), (toe, narrow), (toe, -narrow), (ball, -wide), (heel, -narrow)]
    return Foot(SEGMENTS.index(segment), np.array([[x, -skeleton.ankle_height[side], z] for x, z in corners]))
