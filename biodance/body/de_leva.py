"""The ten parts of de Leva 1996 in the frames of the model, and all tables that use their places.

The trunk joint is the navel (omphalion): lower trunk = pelvis; middle trunk, upper trunk and head = trunk_head; forearm and straight
hand = forearm_hand.
"""

from collections.abc import Mapping

import numpy as np

from biodance.body.inertia import Lump, merge
from biodance.body.reference import Reference, Sex, normalised, proportion
from biodance.body.tables import Row, numbers, read_table
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
    return joined("de_leva_1996", stature(sex), sex, parts(sex))


def stature(sex: Sex) -> float:
    """Return the stature of the reference person, m."""
    return float(read_table("segments", "de_leva_1996").provenance["reference_stature_m"][sex])


def _row(segment: str, sex: Sex) -> Row:
    return read_table("segments", "de_leva_1996").row(segment=segment, sex=sex)


def length(segment: str, sex: Sex) -> float:
    """Return the length of a row, m, of the reference person."""
    return float(_row(segment, sex)["length_m"])


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
    return {kind: length(row, sex) for kind, row in rows.items()} | {"foot": proportion("foot_length", sex) * stature(sex)}


def joined(table: str, height: float, sex: Sex, lumps: Mapping[str, Lump]) -> Reference:
    """Return the reference person of ten parts given at stature ``height`` m at de Leva's places."""
    scale = height / stature(sex)
    own = {kind: scale * value for kind, value in lengths(sex).items()}
    return normalised(table, height, own, {kind: merge(*(lumps[part] for part in names)) for kind, names in PARTS.items()})


def parts(sex: Sex) -> dict[str, Lump]:
    """Return the ten parts of the reference person: mass fraction, CoM m in the model's segment frame, inertia in that unit of mass."""
    middle, upper = length("middle_trunk", sex), length("upper_trunk", sex)
    neck = middle + upper + length("trunk_2", sex) - length("trunk", sex)  # cervicale lies higher than suprasternale
    return {
        "lower_trunk": _down(_row("lower_trunk", sex), length("lower_trunk", sex)),
        "middle_trunk": _down(_row("middle_trunk", sex), middle),
        "upper_trunk": _down(_row("upper_trunk", sex), middle + upper),
        "head": _down(_row("head_2", sex), neck + length("head_2", sex)),
        "thigh": _down(_row("thigh", sex), 0.0),
        "shank": _down(_row("shank_2", sex), 0.0),
        "foot": _foot(sex),
        "upper_arm": _down(_row("upper_arm", sex), 0.0),
        "forearm": _down(_row("forearm", sex), 0.0),
        "hand": _down(_row("hand", sex), -length("forearm", sex)),
    }


def _down(row: Row, top: float) -> Lump:
    """Return the lump of a row whose origin is at height ``top`` m and whose end lies under it."""
    mass, size, fraction = numbers(row, "mass_fraction length_m com_fraction")
    radii = np.array(numbers(row, "gyration_sagittal gyration_longitudinal gyration_transverse")) * size
    return Lump(mass, np.array([0.0, top - fraction * size, 0.0]), mass * np.diag(radii**2))


def _foot(sex: Sex) -> Lump:
    """Return the foot: long axis forwards, CoM on the heel-toe line at 0.6 of the ankle's height under the ankle joint."""
    row = _row("foot", sex)
    mass, size, fraction = numbers(row, "mass_fraction length_m com_fraction")
    radii = np.array(numbers(row, "gyration_longitudinal gyration_sagittal gyration_transverse")) * size
    forward = (fraction - proportion("heel_behind_ankle", sex)) * size
    return Lump(mass, np.array([forward, -0.6 * proportion("ankle_height", sex) * stature(sex), 0.0]), mass * np.diag(radii**2))
