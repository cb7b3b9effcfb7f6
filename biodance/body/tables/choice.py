"""Choose a table of segment inertial parameters: a shipped one or a study by its name, a user's own by the path of
its .csv file.

A user's own (DXA, scan) is in the segments and frames of the model itself, complete or not. Segments are pelvis,
thigh, shank, foot, trunk_head, upper_arm and forearm_hand (right side; one of two); CoM and radii of gyration are in
the segment frame (x anterior, y up, z right, origin at the proximal joint, for the pelvis the middle of the hip
centres), radii about the CoM. Lengths are those of `Reference`. What it leaves out comes from another table at the
person's stature.
"""

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from biodance.body.parts import RigidInertia, combine_inertias, inertial_parameters, smallest_eigenvalues
from biodance.body.tables.anthropometry import (
    COUNT,
    FAMILY,
    KINDS,
    Reference,
    SegmentTable,
    Sex,
    normalised_person,
    proportion,
    read_segment_table,
)
from biodance.errors import BiodanceError, FileRefused, UnknownName, known_index
from biodance.records import Subject

# The trunk joint is the navel (omphalion): lower trunk = pelvis; middle trunk, upper trunk and head = trunk_head;
# forearm and straight hand = forearm_hand.

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


BASE = "de_leva_1996"
"""The table that completes a user's own, unless its .toml says otherwise (``completed_by``)."""
_shipped = cache(read_segment_table)


def de_leva(subject: Subject) -> Reference:
    """Return the reference woman (1.735 m) or man (1.741 m) of de Leva 1996, Table 4."""
    sex = subject.sex
    return _joined(BASE, _de_leva_stature(sex), sex, parts(sex))


def _de_leva_stature(sex: Sex) -> float:
    """Return the stature of the reference person, m."""
    return float(_shipped(BASE).provenance["reference_stature_m"][sex])


def length(segment: str, sex: Sex) -> float:
    """Return the length of a segment, m, of the reference person."""
    return _shipped(BASE).value(segment, "length", sex=sex)


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
        "foot": proportion("foot_length", sex) * _de_leva_stature(sex)
    }


def _joined(table: str, height: float, sex: Sex, lumps: Mapping[str, RigidInertia]) -> Reference:
    """Return the reference person of ten parts given at stature ``height`` m at de Leva's places."""
    scale = height / _de_leva_stature(sex)
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
        "foot": _down("foot", sex, 0.0),
        "upper_arm": _down("upper_arm", sex, 0.0),
        "forearm": _down("forearm", sex, 0.0),
        "hand": _down("hand", sex, -length("forearm", sex)),
    }


def _down(segment: str, sex: Sex, top: float) -> RigidInertia:
    """Return the lump of a segment whose origin is at height ``top`` m and whose end lies under it; the foot's axis
    points forwards, its CoM lies on the heel-toe line at 0.6 of the ankle's height under the ankle.
    """
    table, size = _shipped(BASE), length(segment, sex)
    mass, fraction = (table.value(segment, *what, sex=sex) for what in (("mass",), ("com", "longitudinal")))
    place, axes = np.array([0.0, top - fraction * size, 0.0]), "sagittal longitudinal transverse"
    if segment == "foot":
        under = -0.6 * proportion("ankle_height", sex) * _de_leva_stature(sex)
        place = np.array([(fraction - proportion("heel_behind_ankle", sex)) * size, under, 0.0])
        axes = "longitudinal sagittal transverse"
    radii = np.array(table.values(segment, "gyration", axes, sex=sex)) * size
    return RigidInertia(mass, place, mass * np.diag(radii**2))


def dumas(subject: Subject) -> Reference:
    """Return the reference woman (1.61 m) or man (1.77 m); mid hip to mid shoulder in de Leva's proportion."""
    sex = subject.sex
    height = float(_shipped("dumas_2018").provenance["reference_stature_m"][sex])
    forearm = _dumas_length("forearm", sex)
    lengths = {kind: _dumas_length(kind, sex) for kind in ("pelvis", "thigh", "shank", "upper_arm")}
    lengths |= {"forearm_hand": forearm, "foot": proportion("foot_length", sex) * height}
    lengths["trunk_head"] = length("trunk_3", sex) / _de_leva_stature(sex) * height
    lumps = {kind: _dumas_lump(kind, sex) for kind in ("thigh", "shank", "foot", "upper_arm")}
    lumps["forearm_hand"] = combine_inertias(_dumas_lump("forearm", sex), _dumas_lump("hand", sex, -forearm))
    lumps["trunk_head"] = combine_inertias(*_trunk_parts(sex)[1:])
    return normalised_person("dumas_2018", height, lengths, {"pelvis": _trunk_parts(sex)[0], **lumps})


def _dumas_length(segment: str, sex: Sex) -> float:
    return _shipped("dumas_2018").value(segment, "length", sex=sex)


def _trunk_parts(sex: Sex) -> tuple[RigidInertia, RigidInertia, RigidInertia, RigidInertia]:
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
    table, length = _shipped("dumas_2018"), _dumas_length(segment, sex)
    mass = table.value(segment, "mass", sex=sex)
    com = np.array(table.values(segment, "com", "x y z", sex=sex)) * length + [0.0, origin, 0.0]
    # Imaginary radii stand for negative products: r |r|.
    xx, yy, zz, xy, xz, yz = (
        r * abs(r) * length**2 for r in table.values(segment, "gyration", "xx yy zz xy xz yz", sex=sex)
    )
    return RigidInertia(mass, com, mass * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _winter(subject: Subject) -> Reference:
    """Return Winter 2009 at the subject's stature; longitudinal radii from de Leva 1996, the trunk from Dumas 2018.

    The foot reaches from the malleolus to the second metatarsal head, that is forwards and down to the sole.
    """
    sex, height, table = subject.sex, subject.stature, read_segment_table("winter_2009")
    shape, own, lumps = dumas(subject), parts(sex), {}
    scale = height / shape.stature
    lengths = {kind: scale * value for kind, value in shape.lengths.items()}
    for kind in ("thigh", "shank", "upper_arm", "forearm", "hand", "foot"):
        mass, fraction, radius = (
            table.value(kind, *what, sex=sex)
            for what in (("mass",), ("com", "longitudinal"), ("gyration", "transverse"))
        )
        if kind == "foot":
            foot = proportion("foot_length", sex) * height
            ahead = (proportion("ball_from_heel", sex) - proportion("heel_behind_ankle", sex)) * foot
            end, axis = np.array([ahead, -proportion("ankle_height", sex) * height, 0.0]), 0
        else:
            end, axis = np.array([0.0, -table.value(kind, "length", sex=sex) * height, 0.0]), 1
        moments = np.full(3, float(radius * np.linalg.norm(end)) ** 2)
        # De Leva's squared longitudinal radius of gyration, m², at the subject's stature.
        moments[axis] = own[kind].inertia[axis, axis] / own[kind].mass * (height / _de_leva_stature(sex)) ** 2
        lumps[kind] = RigidInertia(mass, fraction * end, mass * np.diag(moments))
    lengths |= {kind: table.value(kind, "length", sex=sex) * height for kind in ("thigh", "shank", "upper_arm")}
    lengths["forearm_hand"] = table.value("forearm", "length", sex=sex) * height
    hand = lumps.pop("hand")
    lumps["forearm_hand"] = combine_inertias(
        lumps.pop("forearm"), RigidInertia(hand.mass, hand.com - [0.0, lengths["forearm_hand"], 0.0], hand.inertia)
    )
    trunk = []
    for part, name in zip(_trunk_parts(sex), ("pelvis", "abdomen", "thorax", "head_neck"), strict=True):
        mass = table.value(name, "mass", sex=sex)
        trunk.append(RigidInertia(mass, scale * part.com, scale**2 * mass / part.mass * part.inertia))
    lumps |= {"pelvis": trunk[0], "trunk_head": combine_inertias(*trunk[1:])}
    return normalised_person("winter_2009", height, lengths, lumps)


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
    scale = subject.stature / _de_leva_stature("M")
    lumps = {}
    for part, lump in parts("M").items():
        mass = regression(part, "mass", "", subject)[0]
        moments = [regression(part, "inertia", axis, subject)[0] for axis in ("sagittal", "longitudinal", "transverse")]
        # The foot's long axis lies along x: longitudinal and sagittal moments change places.
        inertia = np.diag(moments if part != "foot" else [moments[1], moments[0], moments[2]])
        lumps[part] = RigidInertia(mass, scale * lump.com, inertia)
        if mass <= 0 or 2 * max(moments) > sum(moments) or min(moments) <= 0:
            raise UnknownName(
                f"Table zatsiorsky_2002 gives no possible {part} for {subject.mass:.1f} kg and {subject.stature:.2f} "
                "m: its regressions hold for men of 50 to 90 kg. Choose de_leva_1996."
            )
    return _joined("zatsiorsky_2002", subject.stature, "M", lumps)


def regression(part: str, quantity: str, axis: str, subject: Subject) -> tuple[float, float]:
    """Return value and printed standard deviation (between men of the same mass and stature) of one regression, SI."""
    found = read_segment_table("zatsiorsky_2002").number(part, quantity, axis, sex="M")
    return found.of(subject), found.sd


def study(name: str, subject: Subject) -> Reference:
    """Return the masses of one study of ``mass_studies.csv`` on the bodies of de Leva 1996.

    Where the study has no pelvis of its own, its trunk is split as in de Leva 1996.
    """
    masses = study_masses(name, subject)
    base = de_leva(subject)
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
    own = parts(subject.sex)
    head = part.get("head", own["head"].mass)
    ratio = own["lower_trunk"].mass / (own["lower_trunk"].mass + own["middle_trunk"].mass + own["upper_trunk"].mass)
    pelvis = part.get("pelvis", ratio * (above - head))
    return limbs | {"pelvis": pelvis, "trunk_head": above - pelvis}


_FULL = 0.02  # How far the masses of a complete table may sum from the whole body, as a share


def _completed(table: SegmentTable, subject: Subject, base: Reference) -> Reference:
    """Return the person of a table in the model's segments, with what it lacks from ``base``."""
    known = {key[1] for key in table.numbers if key[2] == subject.sex}
    strange = sorted({key[1] for key in table.numbers} - set(KINDS))
    if strange:
        raise FileRefused(f"{table.name}: {strange[0]!r} is not a segment of the model. Legal: {', '.join(KINDS)}.")
    if not known:
        raise FileRefused(
            f"{table.name}: holds no row for sex {subject.sex}. Add rows, or write FM where they hold for both."
        )
    lengths = {kind: _length(table, kind, subject, base) for kind in KINDS}
    masses = _masses(table, subject, base)
    lumps = {kind: _lump(table, kind, subject, base, lengths[kind], masses[kind]) for kind in KINDS}
    for kind, lump in lumps.items():
        if smallest_eigenvalues(inertial_parameters(lump))[0] <= 0:
            raise FileRefused(
                f"{table.name}: no body has the radii of gyration given for {kind} (each moment at most the sum of "
                f"the others)."
            )
    return normalised_person(table.name, subject.stature, lengths, lumps)


def _length(table: SegmentTable, kind: str, subject: Subject, base: Reference) -> float:
    found = table.find(kind, "length", sex=subject.sex)
    if found is None:
        return base.lengths[kind] * subject.stature / base.stature
    return found.of(subject) * (subject.stature if found.unit == "stature" else 1.0)


def _masses(table: SegmentTable, subject: Subject, base: Reference) -> dict[str, float]:
    """Return the share of the body mass of one segment of each kind; those not given share what the others leave."""
    given = {kind: found for kind in KINDS if (found := table.find(kind, "mass", sex=subject.sex))}
    share = {kind: one.of(subject) / (subject.mass if one.unit == "kg" else 1.0) for kind, one in given.items()}
    total = sum(COUNT[kind] * value for kind, value in share.items())
    rest = {kind: base.segments[kind].mass for kind in KINDS if kind not in share}
    if (not rest and abs(total - 1) > _FULL) or (rest and not 0 <= total < 1) or min(share.values(), default=1.0) <= 0:
        raise FileRefused(
            f"{table.name}: the masses given are {100 * total:.1f} % of the body (two of each limb), expected "
            f"{'less than 100' if rest else f'100 within {100 * _FULL:.0f}'} %. Give the mass of one limb, in kg or as "
            f"share of the body."
        )
    left = (1 - total) / sum(COUNT[kind] * value for kind, value in rest.items()) if rest else 0.0
    return share | {kind: left * value for kind, value in rest.items()}


def _lump(
    table: SegmentTable, kind: str, subject: Subject, base: Reference, length: float, mass: float
) -> RigidInertia:
    """Return one segment: the base table's, stretched to ``length`` m, with the CoM and radii that the table gives."""
    stretch = length / base.lengths[kind]
    com, inertia = np.array(base.segments[kind].com) * stretch, np.array(base.segments[kind].inertia) * stretch**2
    wider = np.ones(3)
    for i, axis in enumerate("xyz"):
        if place := table.find(kind, "com", axis, sex=subject.sex):
            com[i] = place.of(subject) * (length if place.unit == "length" else 1.0)
        if radius := table.find(kind, "gyration", axis, sex=subject.sex):
            metres = radius.of(subject) * (length if radius.unit == "length" else 1.0)
            wider[i] = abs(metres) / np.sqrt(inertia[i, i])
    # Scaled on both sides: moments with the square of the radii, products in between.
    return RigidInertia(mass, com, mass * (inertia * np.outer(wider, wider)))  # correlations are kept


_LAYOUTS: Mapping[str, Callable[[Subject], Reference]] = {
    "along_segments": de_leva,
    "full_tensors": dumas,
    "one_radius": _winter,
    "regressions": zatsiorsky,
}
"""How the published tables give their segments; whoever cuts the body as the model does uses the layout "model"."""
_STUDIES = "mass_studies"
_NO_TABLES = ("uncertainty", _STUDIES)


def studies(sex: str) -> dict[str, str]:
    """Return the studies of segment masses that hold for a sex, with their group: adult, older, child or cadaver."""
    return {study: group for (study, own), group in read_segment_table(_STUDIES).groups.items() if own == sex}


def tables(sex: str | None = None) -> tuple[SegmentTable, ...]:
    """Return the tables known by name, the shipped ones first; only those that speak of ``sex`` if given."""
    found = (read_segment_table(name) for name in FAMILY.files() if name not in _NO_TABLES)
    return tuple(table for table in found if sex is None or sex in table.sexes)


def table_names(sex: str) -> tuple[str, ...]:
    """Return all names that ``reference`` knows for a sex."""
    return (*(table.name for table in tables(sex)), *studies(sex))


def measured_whole() -> tuple[str, ...]:
    """Return the shipped tables of whole bodies for both sexes (``measured_whole`` in their .toml): one laid every CoM
    on the line between the joint centres, the other measured where it lies.
    """
    shipped = FAMILY.shipped()
    return tuple(table.name for table in tables() if table.name in shipped and table.provenance.get("measured_whole"))


def trunk_joint(table: str) -> str:
    """Return where a table cuts the trunk, in words."""
    if table in (*studies("F"), *studies("M")):
        return trunk_joint(_STUDIES)
    found = read_segment_table(table).provenance
    return str(found.get("trunk_joint") or trunk_joint(found.get("completed_by", BASE)))


def reference(table: str, subject: Subject) -> Reference:
    """Return the reference person of one table: ``de_leva_1996``, ``dumas_2018``, ``winter_2009``, ``zatsiorsky_2002``
    (men), a study of segment masses, for example ``pavol_2002`` (older adults) or ``jensen_1986_12y``, or a user's own
    by its path.

    Raises
    ------
    UnknownName
        No such table for this sex; the message lists the legal ones.
    FileRefused
        A user's own table breaks a rule (`read_segment_table`, `_completed`).
    """
    table = str(table)
    if table in studies(subject.sex):
        return study(table, subject)
    shipped = table in FAMILY.files() and table not in _NO_TABLES and subject.sex in read_segment_table(table).sexes
    if not shipped and not table.endswith(FAMILY.suffix) and table != "zatsiorsky_2002":
        known_index(f"table of segment inertial parameters for sex {subject.sex}", table, table_names(subject.sex))
    own = read_segment_table(table)
    if own.layout == "model":
        return _completed(own, subject, reference(str(own.provenance.get("completed_by", BASE)), subject))
    if own.layout not in _LAYOUTS or _LAYOUTS[own.layout](subject).table != table:
        raise BiodanceError(
            f"{table}: the layout {own.layout!r} is that of a published table. Write the rows in the segments of the "
            'model and layout = "model", or no layout.'
        )
    return _LAYOUTS[own.layout](subject)
