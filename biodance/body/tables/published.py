"""The published tables beside de Leva's: Dumas and Wojtusch 2018 (3-D CoM, full tensors, trunk joint at L5/S1), and
those that give less than a full inertia: Winter 2009, the Zatsiorsky regressions, the studies of segment masses.

What a table lacks is taken from another one, and said here. All are evaluated at the subject's own mass and stature.
"""

from functools import cache

import numpy as np

from biodance.body.inertia import RigidInertia, combine_inertias
from biodance.body.tables import de_leva
from biodance.body.tables.anthropometry import Reference, Sex, normalised_person, proportion
from biodance.body.tables.segment_data import SegmentTable, read_segment_table
from biodance.errors import UnknownName
from biodance.records import Subject


def dumas(subject: Subject) -> Reference:
    """Return the reference woman (1.61 m) or man (1.77 m); mid hip to mid shoulder in de Leva's proportion."""
    sex = subject.sex
    height, forearm = dumas_stature(sex), _dumas_length("forearm", sex)
    lengths = {kind: _dumas_length(kind, sex) for kind in ("pelvis", "thigh", "shank", "upper_arm")}
    lengths |= {"forearm_hand": forearm, "foot": proportion("foot_length", sex) * height}
    lengths["trunk_head"] = de_leva.length("trunk_3", sex) / de_leva.de_leva_stature(sex) * height
    lumps = {kind: _dumas_lump(kind, sex) for kind in ("thigh", "shank", "foot", "upper_arm")}
    lumps["forearm_hand"] = combine_inertias(_dumas_lump("forearm", sex), _dumas_lump("hand", sex, -forearm))
    lumps["trunk_head"] = combine_inertias(*trunk_parts(sex)[1:])
    return normalised_person("dumas_2018", height, lengths, {"pelvis": trunk_parts(sex)[0], **lumps})


def dumas_stature(sex: Sex) -> float:
    """Return the stature of the reference person, m."""
    return float(_dumas_table().provenance["reference_stature_m"][sex])


@cache
def _dumas_table() -> SegmentTable:
    return read_segment_table("dumas_2018")


def _dumas_length(segment: str, sex: Sex) -> float:
    return _dumas_table().value(segment, "length", sex=sex)


def trunk_parts(sex: Sex) -> tuple[RigidInertia, RigidInertia, RigidInertia, RigidInertia]:
    """Return pelvis (over the mid hip), abdomen, thorax and head with neck (over L5/S1) at the reference stature."""
    pelvis, abdomen, thorax = (_dumas_length(name, sex) for name in ("pelvis", "abdomen", "thorax"))
    neck = abdomen + thorax
    return (
        _dumas_lump("pelvis", sex, pelvis),
        _dumas_lump("abdomen", sex, abdomen),
        _dumas_lump("thorax", sex, neck),
        _dumas_lump("head_neck", sex, neck),
    )


def _dumas_lump(segment: str, sex: Sex, origin: float = 0.0) -> RigidInertia:
    """Return the lump of a segment; ``origin`` m: height of the table's origin in the model's segment frame."""
    table, length = _dumas_table(), _dumas_length(segment, sex)
    mass = table.value(segment, "mass", sex=sex)
    com = np.array(table.values(segment, "com", "x y z", sex=sex)) * length + [0.0, origin, 0.0]
    xx, yy, zz, xy, xz, yz = (
        r * abs(r) * length**2 for r in table.values(segment, "gyration", "xx yy zz xy xz yz", sex=sex)
    )
    return RigidInertia(mass, com, mass * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def winter(subject: Subject) -> Reference:
    """Return Winter 2009 at the subject's stature; longitudinal radii from de Leva 1996, the trunk from Dumas 2018."""
    sex, height, table = subject.sex, subject.stature, read_segment_table("winter_2009")
    shape = dumas(subject)
    scale = height / shape.stature
    lengths = {kind: scale * value for kind, value in shape.lengths.items()}
    lumps = {kind: _winter_limb(kind, subject) for kind in ("thigh", "shank", "upper_arm", "forearm", "hand")}
    lengths |= {kind: table.value(kind, "length", sex=sex) * height for kind in ("thigh", "shank", "upper_arm")}
    lengths["forearm_hand"] = table.value("forearm", "length", sex=sex) * height
    hand = lumps.pop("hand")
    lumps["forearm_hand"] = combine_inertias(
        lumps.pop("forearm"), RigidInertia(hand.mass, hand.com - [0.0, lengths["forearm_hand"], 0.0], hand.inertia)
    )
    names = ("pelvis", "abdomen", "thorax", "head_neck")
    pelvis, *upper = (
        _with_mass(part, table.value(name, "mass", sex=sex), scale)
        for part, name in zip(trunk_parts(sex), names, strict=True)
    )
    return normalised_person(
        "winter_2009",
        height,
        lengths,
        {"pelvis": pelvis, "trunk_head": combine_inertias(*upper), "foot": _winter_foot(subject), **lumps},
    )


def _winter_limb(kind: str, subject: Subject) -> RigidInertia:
    mass, fraction, radius = _winter_sizes(kind, subject)
    size = read_segment_table("winter_2009").value(kind, "length", sex=subject.sex) * subject.stature
    across = (radius * size) ** 2
    return RigidInertia(
        mass, np.array([0.0, -fraction * size, 0.0]), mass * np.diag([across, _along(kind, subject), across])
    )


def _winter_sizes(kind: str, subject: Subject) -> tuple[float, float, float]:
    """Return mass fraction, CoM and transverse radius of gyration as fractions of the length."""
    table, sex = read_segment_table("winter_2009"), subject.sex
    radius = table.value(kind, "gyration", "transverse", sex=sex)
    return table.value(kind, "mass", sex=sex), table.value(kind, "com", "longitudinal", sex=sex), radius


def _winter_foot(subject: Subject) -> RigidInertia:
    """Return Winter's foot: from the malleolus to the second metatarsal head, that is forwards and down to the sole."""
    mass, fraction, radius = _winter_sizes("foot", subject)
    sex, size = subject.sex, proportion("foot_length", subject.sex) * subject.stature
    toe = np.array([(proportion("ball_from_heel", sex) - proportion("heel_behind_ankle", sex)) * size, 0.0, 0.0])
    toe[1] = -proportion("ankle_height", sex) * subject.stature
    across = float((radius * np.linalg.norm(toe)) ** 2)
    return RigidInertia(mass, fraction * toe, mass * np.diag([_along("foot", subject, 0), across, across]))


def _along(part: str, subject: Subject, axis: int = 1) -> float:
    """Return de Leva's squared longitudinal radius of gyration, m², at the subject's stature."""
    lump, scale = de_leva.parts(subject.sex)[part], subject.stature / de_leva.de_leva_stature(subject.sex)
    return float(lump.inertia[axis, axis] / lump.mass * scale**2)


def _with_mass(lump: RigidInertia, mass: float, scale: float) -> RigidInertia:
    return RigidInertia(mass, scale * lump.com, scale**2 * mass / lump.mass * lump.inertia)


def zatsiorsky(subject: Subject) -> Reference:
    """Return the regressions of Zatsiorsky 2002 on mass and stature, men; CoM and lengths from de Leva 1996, whose
    landmarks are joints.

    Raises
    ------
    UnknownName
        The subject is a woman: the only transcription found of the women's coefficients is wrong (a foot of negative
        mass, a body of 60.6 kg for 65 kg), so it is not shipped.
    """
    if subject.sex == "F":
        raise UnknownName(
            "Table zatsiorsky_2002 holds the regressions for men only: the coefficients found for women give a foot of "
            "negative mass. Choose de_leva_1996 (the same women, without regression) or dumas_2018."
        )
    scale = subject.stature / de_leva.de_leva_stature("M")
    lumps = {}
    for part, lump in de_leva.parts("M").items():
        mass = regression(part, "mass", "", subject)[0]
        moments = [regression(part, "inertia", axis, subject)[0] for axis in ("sagittal", "longitudinal", "transverse")]
        inertia = np.diag(moments if part != "foot" else [moments[1], moments[0], moments[2]])
        lumps[part] = RigidInertia(mass, scale * lump.com, inertia)
        if mass <= 0 or 2 * max(moments) > sum(moments) or min(moments) <= 0:
            raise UnknownName(
                f"Table zatsiorsky_2002 gives no possible {part} for {subject.mass:.1f} kg and {subject.stature:.2f} "
                "m: its regressions hold for men of 50 to 90 kg. Choose de_leva_1996."
            )
    return de_leva.joined("zatsiorsky_2002", subject.stature, "M", lumps)


def regression(part: str, quantity: str, axis: str, subject: Subject) -> tuple[float, float]:
    """Return value and printed standard deviation (between men of the same mass and stature) of one regression, SI."""
    found = read_segment_table("zatsiorsky_2002").number(part, quantity, axis, sex="M")
    return found.of(subject), found.sd


def study(name: str, subject: Subject) -> Reference:
    """Return the masses of one study of ``mass_studies.csv`` on the bodies of de Leva 1996.

    Where the study has no pelvis of its own, its trunk is split as in de Leva 1996.
    """
    masses = study_masses(name, subject)
    base = de_leva.de_leva(subject)
    lumps = {
        kind: RigidInertia(mass, base.segments[kind].com, mass * base.segments[kind].inertia)
        for kind, mass in masses.items()
    }
    return normalised_person(name, base.stature, base.lengths, lumps)


def study_masses(name: str, subject: Subject) -> dict[str, float]:
    """Return the mass fraction of each kind of segment in one study; the trunk over the joint is what remains."""
    numbers = read_segment_table("mass_studies").numbers
    part = {
        segment: one.value for (which, segment, sex, *_), one in numbers.items() if (which, sex) == (name, subject.sex)
    }
    limbs = {kind: part[kind] for kind in ("thigh", "shank", "foot", "upper_arm")} | {
        "forearm_hand": part["forearm"] + part["hand"]
    }
    above = 1.0 - 2 * sum(limbs.values())
    own = de_leva.parts(subject.sex)
    head = part.get("head", own["head"].mass)
    ratio = own["lower_trunk"].mass / (own["lower_trunk"].mass + own["middle_trunk"].mass + own["upper_trunk"].mass)
    pelvis = part.get("pelvis", ratio * (above - head))
    return limbs | {"pelvis": pelvis, "trunk_head": above - pelvis}
