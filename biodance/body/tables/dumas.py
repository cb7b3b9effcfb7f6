"""The reference persons of Dumas and Wojtusch 2018: 3-D CoM and full inertia tensors; the trunk joint is L5/S1."""

from functools import cache

import numpy as np

from biodance.body.inertia import RigidInertia, combine_inertias
from biodance.body.tables import de_leva
from biodance.body.tables.reference import Reference, Sex, normalised_person, proportion
from biodance.body.tables.segment_data import SegmentTable, read_segment_table
from biodance.records import Subject


def dumas(subject: Subject) -> Reference:
    """Return the reference woman (1.61 m) or man (1.77 m); mid hip to mid shoulder, which the table lacks, in de
    Leva's proportion.
    """
    sex = subject.sex
    height, forearm = dumas_stature(sex), _length("forearm", sex)
    lengths = {kind: _length(kind, sex) for kind in ("pelvis", "thigh", "shank", "upper_arm")}
    lengths |= {"forearm_hand": forearm, "foot": proportion("foot_length", sex) * height}
    lengths["trunk_head"] = de_leva.length("trunk_3", sex) / de_leva.de_leva_stature(sex) * height
    lumps = {kind: _lump(kind, sex) for kind in ("thigh", "shank", "foot", "upper_arm")}
    lumps["forearm_hand"] = combine_inertias(_lump("forearm", sex), _lump("hand", sex, -forearm))
    lumps["trunk_head"] = combine_inertias(*trunk_parts(sex)[1:])
    return normalised_person("dumas_2018", height, lengths, {"pelvis": trunk_parts(sex)[0], **lumps})


def dumas_stature(sex: Sex) -> float:
    """Return the stature of the reference person, m."""
    return float(_table().provenance["reference_stature_m"][sex])


@cache
def _table() -> SegmentTable:
    return read_segment_table("dumas_2018")


def _length(segment: str, sex: Sex) -> float:
    return _table().value(segment, "length", sex=sex)


def trunk_parts(sex: Sex) -> tuple[RigidInertia, RigidInertia, RigidInertia, RigidInertia]:
    """Return pelvis (over the mid hip), abdomen, thorax and head with neck (over L5/S1) at the reference stature."""
    pelvis, abdomen, thorax = (_length(name, sex) for name in ("pelvis", "abdomen", "thorax"))
    neck = abdomen + thorax
    return (
        _lump("pelvis", sex, pelvis),
        _lump("abdomen", sex, abdomen),
        _lump("thorax", sex, neck),
        _lump("head_neck", sex, neck),
    )


def _lump(segment: str, sex: Sex, origin: float = 0.0) -> RigidInertia:
    """Return the lump of a segment; ``origin`` m is the height of the table's own origin in the model's segment
    frame.
    """
    table, length = _table(), _length(segment, sex)
    mass = table.value(segment, "mass", sex=sex)
    com = np.array(table.values(segment, "com", "x y z", sex=sex)) * length + [0.0, origin, 0.0]
    xx, yy, zz, xy, xz, yz = (
        r * abs(r) * length**2 for r in table.values(segment, "gyration", "xx yy zz xy xz yz", sex=sex)
    )
    return RigidInertia(mass, com, mass * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
