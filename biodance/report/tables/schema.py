"""What is told of one kind of record, declared once: keys with unit for programs, headings and formats for people."""

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from string import Formatter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from biodance.display import cause_in_words
from biodance.identification.knowledge import SIGMAS
from biodance.report.wording import changed, format_number, size_seen, sized, small

if TYPE_CHECKING:
    from pandas import DataFrame

Row: TypeAlias = dict[str, Any]
"""Key -> value of one record."""


@dataclass(frozen=True)
class Schema:
    """What is told of one kind of record.

    Parameters
    ----------
    fields : str
        Keys, the unit as suffix, each with its place in the record: ``"segment kg=mass unit=cause.unit low=interval.0
        count=#trials place_m=x.value,y.value"``. Without a place the key is the attribute's name; ``#`` counts; behind
        None all is None.
    parts : mapping
        More keys -> `Schema` of the record or records of that name, or a function of the whole record; one that stands
        among the fields, too, has its place there.
    shown : str
        What people see of a row, column by column: ``"segment: {segment:name} | mass (kg): {kg:2} {sd_kg:±2}"``
        (`RowFormat`).
    """

    fields: str
    parts: "Mapping[str, Schema | Callable[[Any], Any]]" = field(default_factory=dict)
    shown: str = ""

    @cached_property
    def places(self) -> Mapping[str, str]:
        """Key -> place in the record."""
        pairs = (one.partition("=") for one in self.fields.split())
        return {key: place or key for key, _, place in pairs} | {
            key: key for key in self.parts if key not in self.fields.split()
        }

    @cached_property
    def columns(self) -> Mapping[str, str]:
        """Heading -> format of what stands below it."""
        return {heading: said for heading, _, said in (one.partition(": ") for one in self.shown.split(" | "))}

    def at(self, place: str) -> Callable[[Any], Any]:
        """Return a function that tells what stands in another place of a record."""
        return lambda record: self.told(value_at(record, place))

    def told(self, found: Any) -> Any:
        """Return a record as a row, several as rows, and None of None."""
        if found is None:
            return None
        return self.rows(found) if isinstance(found, tuple | list) else self.row(found)

    def rows(self, records: Iterable[Any], **about: Any) -> list[Row]:
        """Return a row for each record, what they are ``about`` (key -> value) in front."""
        return [{**about, **self.row(one)} for one in records]

    def row(self, record: Any) -> Row:
        """Return the values of a record by their keys; None under every key of None."""
        out: Row = {}
        for key, place in self.places.items():
            part = self.parts.get(key)
            if part is None or isinstance(part, Schema):
                value = value_at(record, place)
                out[key] = value if part is None else part.told(value)
            else:
                out[key] = part(record)
        return out

    def cells(self, row: Row, headings: Iterable[str] | None = None) -> list[str]:
        """Return what people see of a row below the ``headings`` (by default all)."""
        return [shown(self.columns[name], row) for name in (self.columns if headings is None else headings)]

    def frame(self, records: Iterable[Any]) -> "DataFrame":
        """Return a table of the records with these columns; numbers that are not known are NaN."""
        return table_of(self.rows(records), self.places)


def value_at(record: Any, place: str) -> Any:
    """Return what stands at a path of attributes, keys, numbers (``#`` counts; commas: a list); None for none."""
    if "," in place:
        return [value_at(record, one) for one in place.split(",")]
    for name in place.removeprefix("#").split("."):
        if record is None:
            return None
        if name.isdigit():
            record = record[int(name)] if int(name) < len(record) else None
        else:
            record = record.get(name) if isinstance(record, Mapping) else getattr(record, name)
    return len(record) if place.startswith("#") and record is not None else record


def table_of(rows: Iterable[Mapping[str, Any]], columns: Iterable[str]) -> "DataFrame":
    """Return rows as a table with these ``columns`` in order; None is NaN."""
    import pandas as pd

    wanted = list(columns)
    values = [[math.nan if row[name] is None else row[name] for name in wanted] for row in rows]
    return pd.DataFrame(values, columns=wanted)


def markdown_table(schema: Schema, rows: Iterable[Row]) -> str:
    """Return rows as a Markdown table, as their schema shows them."""
    head, *body = (f"| {' | '.join(cells)} |\n" for cells in (schema.columns, *map(schema.cells, rows)))
    return f"{head}{'|---' * len(schema.columns)}|\n{''.join(body)}"


_SPEC = re.compile(r"(?P<kind>mm|ms|%|deg|)(?P<digits>\d)(?P<unit> .+)?")
_FACTORS = {"": 1.0, "mm": 1000.0, "ms": 1000.0, "%": 100.0, "deg": 57.29578}


@dataclass(frozen=True)
class RowFormat(Formatter):
    """How the values of a ``row`` are written for people, by what stands behind the colon.

    ``2 kg`` with two decimals and unit, ``mm0`` m in whole millimetres, ``ms1`` s in milliseconds, ``%1`` a share in
    per cent, ``deg1`` rad in degrees; ``size`` with the unit of the row, ``change`` with its sign, too; ``seen`` the
    size of a cause, ``p`` a probability; ``±`` before any of them makes of a standard deviation half the width of a
    95 % interval, with the sign; ``name`` a name as words; several values one by one, or their ``count``; what
    is not known as "–", without its unit.
    """

    row: Row

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        """Return a value of the row; None behind None."""
        try:
            return super().get_field(field_name, args, kwargs)
        except TypeError:
            return None, field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return one value as text."""
        if format_spec == "count":
            return str(len(value))
        if format_spec.startswith("±"):
            # sd -> half the width of the 95 % interval
            return f"± {self.format_field(value if value is None else SIGMAS * value, format_spec[1:])}"
        if format_spec == "seen":
            return size_seen(value, self.row["typical"], self.row["unit"])
        if isinstance(value, list | tuple | np.ndarray):
            return ", ".join(self.format_field(one, format_spec) for one in value)
        if isinstance(value, str):
            return cause_in_words(value) if format_spec == "name" else value
        if format_spec == "size":
            return "–" if value is None else sized(value, self.row["unit"])
        if format_spec == "change":
            return "–" if value is None else changed(value, self.row["unit"])
        spec = _SPEC.fullmatch(format_spec)
        if value is None or spec is None:
            return "–" if value is None else small(value) if format_spec == "p" else format(value, format_spec)
        number = format_number(_FACTORS[spec["kind"]] * value, int(spec["digits"]))
        return number if number == "–" else number + (spec["unit"] or "")


def shown(said: str, row: Row) -> str:
    """Return a format (`RowFormat`) filled with the values of a row."""
    return RowFormat(row).vformat(said, (), row).strip()


def plain_values(value: object) -> Any:
    """Return ``value`` made of dict, list, str, int, float, bool and None only; a number that is not finite is None."""
    # the usual types first, and by identity: a document holds hundreds of thousands of numbers
    if type(value) is float:
        return value if math.isfinite(value) else None
    if type(value) is str or type(value) is int or value is None:
        return value
    if isinstance(value, Mapping):
        return {str(key): plain_values(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain_values(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_values(item) for item in value]
    if isinstance(value, np.generic):
        return plain_values(value.item())
    return value if isinstance(value, int) else str(value)


def to_text(document: object) -> str:
    """Return one JSON document as text (indented, keys in their order, newline at the end)."""
    return json.dumps(plain_values(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
