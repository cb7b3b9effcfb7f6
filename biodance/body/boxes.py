"""Shape boxes, boxes for the centre of mass, and the soles."""

import numpy as np

from biodance.body.body import Foot
from biodance.body.prior import com_sd
from biodance.body.reference import proportion
from biodance.body.skeleton import SEGMENTS, Skeleton, kind_of
from biodance.body.tables import numbers, read_table
from biodance.records import Array, Sip, Subject

COM_SIGMAS = 3.0
"""Half width of a CoM box in prior standard deviations."""


LUMBAR_HEIGHT = 0.112 / 1.755
"""Stature: height over the hip centres of the lumbar joint from which ``boxes.csv`` measures the trunk (ANSUR II man of 1.755 m)."""


def shape_boxes(skeleton: Skeleton) -> Array:
    """Return the boxes (12, 2, 3) m of ``boxes.csv`` at the person's stature: lower and upper corners in the segment frames.

    The trunk's box ends at the vertex wherever this skeleton has its trunk joint.
    """
    table = read_table("human", "boxes")
    columns = "x_min y_min z_min x_max y_max z_max"
    corners = np.array([numbers(table.row(segment=kind_of(s)), columns) for s in SEGMENTS])
    boxes = corners.reshape(-1, 2, 3) * skeleton.stature
    boxes[SEGMENTS.index("trunk_head"), 1, 1] -= skeleton.origins["trunk"][1] - LUMBAR_HEIGHT * skeleton.stature
    return boxes


def com_boxes(sip: Sip, skeleton: Skeleton, boxes: Array) -> Array:
    """Return where the CoM may be, (12, 2, 3) m: three prior standard deviations around the prior CoM, inside the shape box."""
    half = COM_SIGMAS * np.array([com_sd(segment, skeleton) for segment in SEGMENTS])
    around = np.stack([sip.com - half, sip.com + half], axis=1)
    return np.clip(around, boxes[:, :1], boxes[:, 1:])


def sole(skeleton: Skeleton, subject: Subject, side: str) -> Foot:
    """Return the sole under one foot: a hexagon of heel, ball and toe corners, m, counter-clockwise seen from above."""
    segment = f"{side}_foot"
    length, heel = skeleton.lengths[segment], -skeleton.heel_behind_ankle[side]
    ball, toe = heel + proportion("ball_from_heel", subject.sex) * length, heel + length
    wide, narrow = (proportion(size, subject.sex) * length / 2 for size in ("foot_breadth", "heel_breadth"))
    corners = [(heel, narrow), (ball, wide), (toe, narrow), (toe, -narrow), (ball, -wide), (heel, -narrow)]
    return Foot(SEGMENTS.index(segment), np.array([[x, -skeleton.ankle_height[side], z] for x, z in corners]))
