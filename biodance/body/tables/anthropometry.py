"""Read one anthropometric table: a tidy CSV with the numbers and a TOML of the same name with their provenance."""

import csv
import functools
import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from biodance.body.parts import RigidInertia
from biodance.errors import BiodanceError, UnknownName
from biodance.library import locate, read_toml

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


TableRow = Mapping[str, str]


@dataclass(frozen=True, eq=False)
class AnthropometricTable:
    """One table: ``rows`` as text by column; ``provenance``: title, source, doi, population, units, sd, sha256 ..."""

    name: str
    rows: tuple[TableRow, ...]
    provenance: Mapping[str, Any]

    def where(self, **wanted: str) -> tuple[TableRow, ...]:
        """Return the rows whose columns equal the wanted texts, for example ``where(segment="foot", sex="F")``."""
        return _rows_where(self, tuple(wanted.items()))

    def row(self, **wanted: str) -> TableRow:
        """Return the one row that matches.

        Raises
        ------
        UnknownName
            No row, or more than one, matches.
        """
        rows = self.where(**wanted)
        if len(rows) != 1:
            column, text = next(iter(wanted.items()))
            legal = sorted({row[column] for row in self.rows})
            raise UnknownName.of(f"{column} of table {self.name} (with {wanted})", text, legal)
        return rows[0]


@functools.cache
def _rows_where(table: AnthropometricTable, wanted: tuple[tuple[str, str], ...]) -> tuple[TableRow, ...]:
    return tuple(row for row in table.rows if all(row[column] == text for column, text in wanted))


def row_numbers(row: TableRow, columns: str) -> tuple[float, ...]:
    """Return the columns named in a space-separated text as floats."""
    return tuple(float(row[column]) for column in columns.split())


@functools.cache
def read_table(family: str, name: str) -> AnthropometricTable:
    """Read ``anthropometry/<family>/<name>.csv`` and its provenance, for example ``read_table("segments",
    "de_leva_1996")``.

    Raises
    ------
    UnknownName
        There is no such table; the message lists all.
    BiodanceError
        The numbers are not those that the provenance describes (sha256).
    """
    path = locate(f"anthropometry/{family}", name, ".csv")
    provenance = read_toml(path.with_suffix(".toml"))
    refuse_changed(path, provenance.get("sha256", ""))
    rows = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))
    return AnthropometricTable(name, tuple(MappingProxyType(row) for row in rows), MappingProxyType(provenance))


def refuse_changed(path: Path, sha256: str) -> None:
    """Raise BiodanceError if a table is not the one whose ``sha256`` its provenance gives."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if digest != sha256:
        raise BiodanceError(
            f"{path}: the numbers were changed since {path.stem}.toml was written (sha256 {digest}). "
            "Restore the file, or describe your change in the .toml and put this sha256 there."
        )
