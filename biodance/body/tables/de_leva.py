"""The ten parts of de Leva 1996 in the frames of the model, and all tables that use their places.

The trunk joint is the navel (omphalion): lower trunk = pelvis; middle trunk, upper trunk and head = trunk_head; forearm
and straight hand = forearm_hand.
"""

from collections.abc import Mapping
from functools import cache

import numpy as np

from biodance.body.inertia import RigidInertia, combine_inertias
from biodance.body.tables.anthropometry import Reference, Sex, normalised_person, proportion
from biodance.body.tables.segment_data import SegmentTable, read_segment_table
from biodance.records import Subject

PARTS = {
    "pelvis": ("lower_trunk",),
    "thigh": ("thigh",),
    "shank": ("shank",),
    "foot": ("foot",),
    "trunk_head": ("middle_trunk", "upper_trunk", "head"),
    "upper_arm": ("upper_arm",),
    "forearm_hand": ("forearm", "hand"),
}
"""Which of the ten parts make which segment of the model."""


def de_leva(subject: Subject) -> Reference:
    """Return the reference woman (1.735 m) or man (1.741 m) of de Leva 1996, Table 4."""
    sex = subject.sex
    return joined("de_leva_1996", de_leva_stature(sex), sex, parts(sex))


def de_leva_stature(sex: Sex) -> float:
    """Return the stature of the reference person, m."""
    return float(_table().provenance["reference_stature_m"][sex])


@cache
def _table() -> SegmentTable:
    return read_segment_table("de_leva_1996")


def length(segment: str, sex: Sex) -> float:
    """Return the length of a segment, m, of the reference person."""
    return _table().value(segment, "length", sex=sex)


def lengths(sex: Sex) -> dict[str, float]:
    """Return the lengths by kind of the reference person, m."""
    rows = {
        "pelvis": "lower_trunk",
        "thigh": "thigh",
        "shank": "shank_2",
        "trunk_head": "trunk_3",
        "upper_arm": "upper_arm",
        "forearm_hand": "forearm",
    }
    return {kind: length(row, sex) for kind, row in rows.items()} | {
        "foot": proportion("foot_length", sex) * de_leva_stature(sex)
    }


def joined(table: str, height: float, sex: Sex, lumps: Mapping[str, RigidInertia]) -> Reference:
    """Return the reference person of ten parts given at stature ``height`` m at de Leva's places."""
    scale = height / de_leva_stature(sex)
    own = {kind: scale * value for kind, value in lengths(sex).items()}
    return normalised_person(
        table, height, own, {kind: combine_inertias(*(lumps[part] for part in names)) for kind, names in PARTS.items()}
    )


def parts(sex: Sex) -> dict[str, RigidInertia]:
    """Return the ten parts of the reference person: mass fraction, CoM m in the model's frame, inertia in that unit."""
    middle, upper = length("middle_trunk", sex), length("upper_trunk", sex)
    neck = middle + upper + length("trunk_2", sex) - length("trunk", sex)  # cervicale lies higher than suprasternale
    return {
        "lower_trunk": _down("lower_trunk", sex, length("lower_trunk", sex)),
        "middle_trunk": _down("middle_trunk", sex, middle),
        "upper_trunk": _down("upper_trunk", sex, middle + upper),
        "head": _down("head_2", sex, neck + length("head_2", sex)),
        "thigh": _down("thigh", sex, 0.0),
        "shank": _down("shank_2", sex, 0.0),
        "foot": _foot(sex),
        "upper_arm": _down("upper_arm", sex, 0.0),
        "forearm": _down("forearm", sex, 0.0),
        "hand": _down("hand", sex, -length("forearm", sex)),
    }


def _sizes(segment: str, sex: Sex) -> tuple[float, float, float]:
    """Return mass fraction, length m and CoM as a fraction of it."""
    table = _table()
    along = table.value(segment, "com", "longitudinal", sex=sex)
    return table.value(segment, "mass", sex=sex), table.value(segment, "length", sex=sex), along


def _down(segment: str, sex: Sex, top: float) -> RigidInertia:
    """Return the lump of a segment whose origin is at height ``top`` m and whose end lies under it."""
    mass, size, fraction = _sizes(segment, sex)
    radii = np.array(_table().values(segment, "gyration", "sagittal longitudinal transverse", sex=sex)) * size
    return RigidInertia(mass, np.array([0.0, top - fraction * size, 0.0]), mass * np.diag(radii**2))


def _foot(sex: Sex) -> RigidInertia:
    """Return the foot: long axis forwards, CoM on the heel-toe line at 0.6 of the ankle's height under the ankle."""
    mass, size, fraction = _sizes("foot", sex)
    radii = np.array(_table().values("foot", "gyration", "longitudinal sagittal transverse", sex=sex)) * size
    forward = (fraction - proportion("heel_behind_ankle", sex)) * size
    return RigidInertia(
        mass,
        np.array([forward, -0.6 * proportion("ankle_height", sex) * de_leva_stature(sex), 0.0]),
        mass * np.diag(radii**2),
    )
