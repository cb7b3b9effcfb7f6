"""What the outlines of the feet say: how large the soles are, and what the feet weigh."""

import numpy as np

from biodance.body.human.fractions import MAN, WOMAN, mean_fraction
from biodance.body.human.girths import SegmentOpinion
from biodance.body.human.skeleton import Skeleton
from biodance.body.tables.anthropometry import read_table
from biodance.body.tables.error_sizes import error_size
from biodance.body.tables.reference import Sex, proportion
from biodance.records import SIDES, Array, FootSizes, Subject


def usual_outline(length: float, sex: Sex) -> FootSizes:
    """Return the outline of a usual foot of this length, m."""
    breadth, heel = (proportion(size, sex) * length for size in ("foot_breadth", "heel_breadth"))
    return FootSizes(length, breadth, heel)


def sole_corners(outline: FootSizes, sex: Sex) -> Array:
    """Return the corners (6, 2) m of a sole, ahead of the heel and to the right, counter-clockwise from above: heel,
    ball, toes.
    """
    length, wide, narrow = outline.length, outline.breadth / 2, outline.heel_breadth / 2
    ball = proportion("ball_from_heel", sex) * length
    return np.array([(0.0, narrow), (ball, wide), (length, narrow), (length, -narrow), (ball, -wide), (0.0, -narrow)])


def foot_opinions(skeleton: Skeleton, subject: Subject) -> dict[str, SegmentOpinion]:
    """Return what the outlines say about the masses of the feet.

    The foot of the mean person of the survey of girths, whose fraction all tables and studies give, times the area of
    the outline and the height of the ankle over those of that mean person.
    """
    people = read_table("human", "girths").provenance["people"]
    mean, mean_sd = mean_fraction("foot", MAN if subject.sex == "M" else WOMAN)
    stature = people["stature_m"][subject.sex]
    usual = usual_outline(proportion("foot_length", subject.sex) * stature, subject.sex)
    height = proportion("ankle_height", subject.sex) * stature
    own = np.linalg.norm([mean_sd, error_size("solid_mass", "foot"), error_size("solid_mass", "survey")])
    found = {}
    for side in SIDES:
        area = _area(subject.foot_outline[side], subject.sex) / _area(usual, subject.sex)
        mass = mean * people["mass_kg"][subject.sex] * area * skeleton.ankle_height[side] / height
        found[f"{side}_foot"] = SegmentOpinion(mass, float(own * mass), ("foot outline",))
    return found


def _area(outline: FootSizes, sex: Sex) -> float:
    x, y = sole_corners(outline, sex).T
    return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))
