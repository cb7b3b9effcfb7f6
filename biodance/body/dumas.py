"""The reference persons of Dumas and Wojtusch 2018: 3-D CoM and full inertia tensors; the trunk joint is L5/S1."""

import numpy as np

from biodance.body import de_leva
from biodance.body.inertia import Lump, merge
from biodance.body.reference import Reference, Sex, normalised, proportion
from biodance.body.tables import numbers, read_table
from biodance.records import Subject


def dumas(subject: Subject) -> Reference:
    """Return the reference woman (1.61 m) or man (1.77 m); mid hip to mid shoulder, which the table lacks, in de Leva's proportion."""
    sex = subject.sex
    height, own = stature(sex), {row["segment"]: float(row["length_m"]) for row in read_table("segments", "dumas_2018").where(sex=sex)}
    lengths = {kind: own[kind] for kind in ("pelvis", "thigh", "shank", "upper_arm")}
    lengths |= {"forearm_hand": own["forearm"], "foot": proportion("foot_length", sex) * height}
    lengths["trunk_head"] = de_leva.length("trunk_3", sex) / de_leva.stature(sex) * height
    lumps = {kind: _lump(kind, sex) for kind in ("thigh", "shank", "foot", "upper_arm")}
    lumps["forearm_hand"] = merge(_lump("forearm", sex), _lump("hand", sex, -own["forearm"]))
    lumps["trunk_head"] = merge(*trunk_parts(sex)[1:])
    return normalised("dumas_2018", height, lengths, {"pelvis": trunk_parts(sex)[0], **lumps})


def stature(sex: Sex) -> float:
    """Return the stature of the reference person, m."""
    return float(read_table("segments", "dumas_2018").provenance["reference_stature_m"][sex])


def trunk_parts(sex: Sex) -> tuple[Lump, Lump, Lump, Lump]:
    """Return pelvis (over the mid hip), abdomen, thorax and head with neck (over L5/S1) at the reference stature."""
    rows = read_table("segments", "dumas_2018")
    pelvis, abdomen, thorax = (float(rows.row(segment=name, sex=sex)["length_m"]) for name in ("pelvis", "abdomen", "thorax"))
    neck = abdomen + thorax
    return _lump("pelvis", sex, pelvis), _lump("abdomen", sex, abdomen), _lump("thorax", sex, neck), _lump("head_neck", sex, neck)


def _lump(segment: str, sex: Sex, origin: float = 0.0) -> Lump:
    """Return the lump of a row; ``origin`` m is the height of the row's own origin in the model's segment frame."""
    row = read_table("segments", "dumas_2018").row(segment=segment, sex=sex)
    mass, length = numbers(row, "mass_fraction length_m")
    com = np.array(numbers(row, "com_x com_y com_z")) * length + [0.0, origin, 0.0]
    xx, yy, zz, xy, xz, yz = (r * abs(r) * length**2 for r in numbers(row, "r_xx r_yy r_zz r_xy r_xz r_yz"))
    return Lump(mass, com, mass * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
