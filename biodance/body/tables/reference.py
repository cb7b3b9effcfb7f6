"""A reference person of a published table, in the segments of the 12-segment human."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from biodance.body.inertia import RigidInertia
from biodance.body.tables.anthropometry import read_table

Sex = Literal["F", "M"]
KINDS = ("pelvis", "thigh", "shank", "foot", "trunk_head", "upper_arm", "forearm_hand")
COUNT = {"pelvis": 1, "thigh": 2, "shank": 2, "foot": 2, "trunk_head": 1, "upper_arm": 2, "forearm_hand": 2}
"""How often each kind occurs in the body."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference person of one table.

    ``segments``: for each kind the mass FRACTION, CoM (3,) m and inertia per unit mass (3, 3) m² about the CoM (a
    ``Lump``), right side, in the segment frame of the model (x anterior, y up, z right; origin at the proximal joint;
    pelvis: middle of the hip centres). ``lengths`` m by kind: pelvis (mid hip to trunk joint), thigh, shank, foot,
    trunk_head (mid hip to MID SHOULDER centres), upper_arm, forearm_hand (elbow to wrist). ``stature`` m. Fractions sum
    to 1 over the body.
    """

    table: str
    stature: float
    lengths: Mapping[str, float]
    segments: Mapping[str, RigidInertia]


def normalised_person(
    table: str, stature: float, lengths: Mapping[str, float], lumps: Mapping[str, RigidInertia]
) -> Reference:
    """Return the reference person of lumps with masses in any unit: fractions that sum to 1, inertia per unit mass."""
    total = sum(COUNT[kind] * lumps[kind].mass for kind in KINDS)
    segments = {
        kind: RigidInertia(lumps[kind].mass / total, lumps[kind].com, lumps[kind].inertia / lumps[kind].mass)
        for kind in KINDS
    }
    return Reference(table, stature, lengths, segments)


def proportion(size: str, sex: Sex) -> float:
    """Return a ratio of ``anthropometry/human/proportions.csv``, for example foot_length (of stature)."""
    return float(read_table("human", "proportions").row(size=size, sex=sex)["ratio"])
