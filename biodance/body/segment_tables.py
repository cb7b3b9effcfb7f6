"""The segments of the 12-segment human in the published tables: mass fraction, CoM and inertia of a reference person.

A published table cuts the body into 14 to 16 parts. Here its parts become the seven kinds of segment of the model: the trunk parts over
the trunk joint and the head become ``trunk_head``, forearm and straight hand become ``forearm_hand``. The trunk joint lies where the
table cuts: at the navel (omphalion) in de Leva 1996, at L5/S1 in Dumas and Wojtusch 2018; so one table is one definition of the joint.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from biodance.body.inertia import Lump, merge
from biodance.body.tables import Row, Table, numbers, read_table
from biodance.errors import UnknownName
from biodance.records import Subject

Sex = Literal["F", "M"]
KINDS = ("pelvis", "thigh", "shank", "foot", "trunk_head", "upper_arm", "forearm_hand")
COUNT = {"pelvis": 1, "thigh": 2, "shank": 2, "foot": 2, "trunk_head": 1, "upper_arm": 2, "forearm_hand": 2}
"""How often each kind occurs in the body."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference person in one table.

    ``segments``: for each kind the mass FRACTION, CoM (3,) m and inertia per unit mass (3, 3) m² about the CoM (a ``Lump`` of fractional
    mass), right side, in the segment frame of the model (x anterior, y up, z right, origin at the proximal joint; pelvis: mid hip centres).
    ``lengths`` m: pelvis (mid hip to trunk joint), thigh, shank, foot, trunk_head (mid hip to MID SHOULDER), upper_arm, forearm_hand (elbow
    to wrist). ``stature`` m. ``name`` of the table and ``sex``. Fractions sum to 1 over the body.
    """

    name: str
    sex: Sex
    stature: float
    lengths: Mapping[str, float]
    segments: Mapping[str, Lump]


def proportion(size: str, sex: Sex) -> float:
    """Return a ratio of ``anthropometry/human/proportions.csv``, for example foot_length (of stature)."""
    return float(read_table("human", "proportions").row(size=size, sex=sex)["ratio"])


def reference(table: str, subject: Subject) -> Reference:
    """Return the reference person of one table, mass fractions renormalised to 1.

    Raises
    ------
    UnknownName
        No such table for this sex.
    """
    if table not in READERS:
        raise UnknownName.of("table of segment inertial parameters", table, tuple(READERS))
    raw = READERS[table](read_table("segments", table), subject.sex)
    total = sum(COUNT[kind] * lump.mass for kind, lump in raw.segments.items())
    segments = {kind: Lump(lump.mass / total, lump.com, lump.inertia / lump.mass) for kind, lump in raw.segments.items()}
    return Reference(raw.name, raw.sex, raw.stature, raw.lengths, segments)


def _along(row: Row, start: float, direction: float, *, turned: bool = False) -> Lump:
    """Return the lump of a de Leva row whose origin lies at height ``start`` m and whose end lies in ``direction`` (+1 up, -1 down)."""
    mass, length, fraction = numbers(row, "mass_fraction length_m com_fraction")
    radii = np.array(numbers(row, "gyration_sagittal gyration_longitudinal gyration_transverse")) * length
    if turned:  # foot: the longitudinal axis lies along x, the sagittal one upwards
        radii = radii[[1, 0, 2]]
    return Lump(mass, np.array([0.0, start + direction * fraction * length, 0.0]), mass * np.diag(radii**2))


def _foot(row: Row, sex: Sex, stature: float) -> Lump:
    """Return the de Leva foot: CoM on the heel-toe line, at 0.6 of the ankle's height under the ankle joint."""
    lump, length = _along(row, 0.0, 1.0, turned=True), float(row["length_m"])
    forward = lump.com[1] - proportion("heel_behind_ankle", sex) * length
    return Lump(lump.mass, np.array([forward, -0.6 * proportion("ankle_height", sex) * stature, 0.0]), lump.inertia)


def _de_leva(table: Table, sex: Sex) -> Reference:
    def row(segment: str) -> Row:
        return table.row(segment=segment, sex=sex)

    def length(segment: str) -> float:
        return float(row(segment)["length_m"])

    stature = table.provenance["reference_stature_m"][sex]
    middle, upper, forearm = length("middle_trunk"), length("upper_trunk"), length("forearm")
    neck = middle + upper + length("trunk_2") - length("trunk")  # cervicale lies higher than suprasternale
    trunk = merge(
        _along(row("middle_trunk"), middle, -1.0),
        _along(row("upper_trunk"), middle + upper, -1.0),
        _along(row("head_2"), neck + length("head_2"), -1.0),
    )
    segments = {
        "pelvis": _along(row("lower_trunk"), length("lower_trunk"), -1.0),
        "thigh": _along(row("thigh"), 0.0, -1.0),
        "shank": _along(row("shank_2"), 0.0, -1.0),
        "foot": _foot(row("foot"), sex, stature),
        "trunk_head": trunk,
        "upper_arm": _along(row("upper_arm"), 0.0, -1.0),
        "forearm_hand": merge(_along(row("forearm"), 0.0, -1.0), _along(row("hand"), -forearm, -1.0)),
    }
    lengths = {
        "pelvis": length("lower_trunk"),
        "thigh": length("thigh"),
        "shank": length("shank_2"),
        "foot": proportion("foot_length", sex) * stature,
        "trunk_head": length("trunk_3"),
        "upper_arm": length("upper_arm"),
        "forearm_hand": forearm,
    }
    return Reference(table.name, sex, stature, lengths, segments)


def _tensor_lump(row: Row, origin: float) -> Lump:
    """Return the lump of a Dumas row in the model's frame; ``origin`` m is the height of the row's own origin."""
    mass, length = numbers(row, "mass_fraction length_m")
    com = np.array(numbers(row, "com_x com_y com_z")) * length + [0.0, origin, 0.0]
    xx, yy, zz, xy, xz, yz = (r * abs(r) * length**2 for r in numbers(row, "r_xx r_yy r_zz r_xy r_xz r_yz"))
    return Lump(mass, com, mass * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _dumas(table: Table, sex: Sex) -> Reference:
    def lump(segment: str, origin: float = 0.0) -> Lump:
        return _tensor_lump(table.row(segment=segment, sex=sex), origin)

    lengths = {row["segment"]: float(row["length_m"]) for row in table.where(sex=sex)}
    stature = table.provenance["reference_stature_m"][sex]
    neck = lengths["abdomen"] + lengths["thorax"]
    segments = {
        "pelvis": lump("pelvis", lengths["pelvis"]),
        "thigh": lump("thigh"),
        "shank": lump("shank"),
        "foot": lump("foot"),
        "trunk_head": merge(lump("abdomen", lengths["abdomen"]), lump("thorax", neck), lump("head_neck", neck)),
        "upper_arm": lump("upper_arm"),
        "forearm_hand": merge(lump("forearm"), lump("hand", -lengths["forearm"])),
    }
    de_leva = read_table("segments", "de_leva_1996")
    trunk = float(de_leva.row(segment="trunk_3", sex=sex)["length_m"]) / de_leva.provenance["reference_stature_m"][sex]
    own = {kind: lengths[kind] for kind in ("pelvis", "thigh", "shank", "upper_arm")}
    foot = proportion("foot_length", sex) * stature
    return Reference(
        table.name, sex, stature, own | {"foot": foot, "trunk_head": trunk * stature, "forearm_hand": lengths["forearm"]}, segments
    )


READERS: Mapping[str, Callable[[Table, Sex], Reference]] = {"de_leva_1996": _de_leva, "dumas_2018": _dumas}
