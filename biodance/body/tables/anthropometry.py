"""Anthropometric tables: a tidy CSV with the numbers and a TOML of the same name with their provenance.

FAMILY: tables of segment parameters, one .csv each with its .toml beside it.
"""

import csv
import functools
import hashlib
import io
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from biodance.body.parts import RigidInertia
from biodance.discovery import DataFamily
from biodance.errors import BiodanceError, FileRefused, UnknownName
from biodance.lab.plain_text import read_text
from biodance.library import locate, read_toml
from biodance.records import Subject

Sex = Literal["F", "M"]
COUNT = {"pelvis": 1, "thigh": 2, "shank": 2, "foot": 2, "trunk_head": 1, "upper_arm": 2, "forearm_hand": 2}
"""How often each kind of segment occurs in the body."""
KINDS = tuple(COUNT)


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


FAMILY = DataFamily("table of segment inertial parameters", "biodance.segment_tables", "anthropometry/segments", ".csv")
_REQUIRED = ("segment", "sex", "quantity", "axis", "value", "unit")
_OPTIONAL = ("study", "group", "per_kg", "per_m", "sd", "n", "correlation", "landmarks")
_TENSOR = ("xx", "yy", "zz", "xy", "xz", "yz")
_ALONG = ("sagittal", "transverse", "longitudinal")
_LEGAL: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "mass": (("",), ("body_mass", "kg")),
    "length": (("",), ("m", "stature")),
    "com": (("longitudinal", "x", "y", "z"), ("length", "m")),
    "gyration": (
        (*_ALONG, "transverse_proximal", "x", "y", "z", *_TENSOR),
        ("length", "m"),
    ),
    "inertia": (_ALONG, ("kg m2",)),
}
"""The legal axes and units of every quantity; a unit such as ``length`` means a fraction of it."""


@dataclass(frozen=True)
class _Number:
    """One number: ``value`` in ``unit``; ``per_kg``, ``per_m`` its regression on mass and stature; ``sd`` or NaN."""

    value: float
    unit: str
    per_kg: float = 0.0
    per_m: float = 0.0
    sd: float = math.nan

    def of(self, subject: Subject) -> float:
        """Return the number for a person."""
        return self.value + self.per_kg * subject.mass + self.per_m * subject.stature


_NumberKey = tuple[str, str, str, str, str]


@dataclass(frozen=True, eq=False)
class SegmentTable:
    """One table: ``numbers`` by study (""), segment, sex ("F" or "M"), quantity and axis; ``groups`` of its studies
    (adult, child ...) by study and sex; ``layout`` says how its segments lie in the model (`tables.choice`);
    ``provenance`` the .toml.
    """

    name: str
    numbers: Mapping[_NumberKey, _Number]
    groups: Mapping[tuple[str, str], str] = field(default_factory=dict)
    layout: str = "model"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def find(self, segment: str, quantity: str, axis: str = "", *, sex: str, study: str = "") -> _Number | None:
        """Return one number; None where the table does not have it."""
        return self.numbers.get((study, segment, sex, quantity, axis))

    def number(self, segment: str, quantity: str, axis: str = "", *, sex: str, study: str = "") -> _Number:
        """Return one number; UnknownName where the table does not have it."""
        found = self.find(segment, quantity, axis, sex=sex, study=study)
        if found is None:
            legal = sorted({" ".join((s, q, a)).strip() for _, s, x, q, a in self.numbers if x == sex})
            raise UnknownName.of(
                f"number of table {self.name} for sex {sex}", f"{segment} {quantity} {axis}".strip(), legal
            )
        return found

    def value(self, segment: str, quantity: str, axis: str = "", *, sex: str) -> float:
        """Return the value of one number, in the unit of its row; UnknownName where the table does not have it."""
        return self.number(segment, quantity, axis, sex=sex).value

    def values(self, segment: str, quantity: str, axes: str, *, sex: str) -> tuple[float, ...]:
        """Return the values along several axes, named in a space-separated text."""
        return tuple(self.value(segment, quantity, axis, sex=sex) for axis in axes.split())

    @property
    def sexes(self) -> frozenset[str]:
        """The sexes that the table speaks of."""
        return frozenset(key[2] for key in self.numbers)


def read_segment_table(name_or_path: str | Path) -> SegmentTable:
    """Return a table by its name, or a user's own by the path of its .csv file (then the path is its name).

    A .toml of the same name beside the file gives provenance and ``layout``; a user's own file may do without.

    Raises
    ------
    UnknownName
        There is no table of that name; the message lists all.
    BiodanceError
        The file is missing, is not of this form, or its numbers are not those that its .toml describes (sha256); the
        message names the row, the value and what would be legal.
    """
    path = FAMILY.locate(name_or_path)
    own = str(name_or_path).endswith(FAMILY.suffix)
    if not os.path.isfile(path):
        raise FileRefused(
            f"{path}: there is no such table. Check the path; tables known by name are {', '.join(FAMILY.files())}."
        )
    beside = path.with_suffix(".toml")
    stamps = tuple(one.stat().st_mtime_ns if one.is_file() else 0 for one in (path, beside))
    return _read(str(name_or_path), path, own, stamps)


@functools.cache
def _read(name: str, path: Path, own: bool, _stamps: tuple[int, ...]) -> SegmentTable:
    """Return the table in a file; read anew when a file has changed."""
    beside = path.with_suffix(".toml")
    if not beside.is_file() and not own:
        raise FileRefused(
            f"{path}: has no {beside.name} beside it, which says where its numbers come from. Write it, or move the "
            f"table away."
        )
    provenance = read_toml(beside) if beside.is_file() else {}
    if "sha256" in provenance:
        refuse_changed(path, provenance["sha256"])
    numbers: dict[_NumberKey, _Number] = {}
    groups: dict[tuple[str, str], str] = {}
    for line, row in _rows(path):
        for sex in row["sex"]:
            key = (row["study"], row["segment"], sex, row["quantity"], row["axis"])
            if key in numbers:
                raise FileRefused(
                    f"{path}, row {line}: {' '.join(filter(None, key))} stands twice. Remove one of the two rows."
                )
            numbers[key] = _number(path, line, row)
            groups[row["study"], sex] = row["group"]
    if not numbers:
        raise FileRefused(f"{path}: the table has no row. Write one row per number: {', '.join(_REQUIRED)}.")
    layout = str(provenance.get("layout", "model"))
    return SegmentTable(name, MappingProxyType(numbers), MappingProxyType(groups), layout, MappingProxyType(provenance))


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Return the rows of a table, checked, each with its line in the file; what a file leaves out is empty."""
    reader = csv.DictReader(io.StringIO(read_text(path)))
    columns = tuple(reader.fieldnames or ())
    absent = [name for name in _REQUIRED if name not in columns]
    unknown = [name for name in columns if name not in (*_REQUIRED, *_OPTIONAL)]
    if absent or unknown:
        what = f"lacks the column {absent[0]!r}" if absent else f"has the unknown column {unknown[0]!r}"
        raise FileRefused(
            f"{path}: the table {what}. Legal are {', '.join(_REQUIRED)}, and optional {', '.join(_OPTIONAL)}."
        )
    rows = []
    for line, cells in enumerate(reader, start=2):
        if None in cells or None in cells.values():
            raise FileRefused(
                f"{path}, row {line}: has not {len(columns)} cells as the header has. Correct its commas."
            )
        row = dict.fromkeys(_OPTIONAL, "") | {name: str(cell).strip() for name, cell in cells.items()}
        _refuse_illegal(path, line, row)
        rows.append((line, row))
    return rows


def _refuse_illegal(path: Path, line: int, row: Mapping[str, str]) -> None:
    """Refuse a row with an illegal word."""
    quantity = row["quantity"]
    axes, units = _LEGAL.get(quantity, ((row["axis"],), (row["unit"],)))
    for column, what, legal in (
        ("sex", "sex", ("F", "M", "FM")),
        ("quantity", "quantity", tuple(_LEGAL)),
        ("axis", f"axis of {quantity}", axes),
        ("unit", f"unit of {quantity}", units),
    ):
        if row[column] not in legal:
            words = ", ".join(name or "(empty)" for name in legal)
            raise FileRefused(f"{path}, row {line}: the {what} is {row[column]!r}. Legal: {words}.")
    if not row["segment"]:
        raise FileRefused(f"{path}, row {line}: names no segment. Write its name.")


def _number(path: Path, line: int, row: Mapping[str, str]) -> _Number:
    """Return the number of a row; FileRefused where a cell is no number, or none that can be."""
    found = {}
    for name in ("value", "per_kg", "per_m", "sd"):
        if name == "value" or row[name]:
            try:
                found[name] = float(row[name])
            except ValueError:
                found[name] = math.nan
            if not math.isfinite(found[name]):
                raise FileRefused(
                    f"{path}, row {line}: the {name} of {row['segment']} is {row[name]!r}, expected a number."
                )
    regression = "per_kg" in found or "per_m" in found
    if row["quantity"] in ("mass", "length") and found["value"] <= 0 and not regression:
        raise FileRefused(
            f"{path}, row {line}: the {row['quantity']} of {row['segment']} is {row['value']}, expected more than 0."
        )
    if found.get("sd", 0.0) < 0:
        raise FileRefused(f"{path}, row {line}: the sd of {row['segment']} is {row['sd']}, expected 0 or more.")
    return _Number(unit=row["unit"], **found)
