"""Tables over time as text: the .mot and .sto files of OpenSim (forces of the plates, joint coordinates, anything with
a time column).

A name, header rows ``key=value`` up to ``endheader``, a row of column labels (the first is ``time``), then numbers.
What the columns mean is not said in the file, apart from ``inDegrees``; ``ground_forces.py`` knows the columns of force
plates.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.errors import BiodanceError, FileRefused, TrialRefused, UnknownName
from biodance.lab.plain_text import cells, parse_number, read_text, write_new
from biodance.records import Array, assign, frozen_array

_LONGEST_HEADER = 200
_JITTER = 0.2  # how far a time may lie from equal steps, as part of a step: writers round the time column


@dataclass(frozen=True, eq=False)
class TimeTable:
    """A table over time: ``columns`` (C) labels, ``time`` (T,) s, ``values`` (T, C) in the file's units.

    ``in_degrees`` says that rotational coordinates are in degrees (the file's ``inDegrees``); which columns are
    rotations only the model knows. ``name`` is the first row of the file. ``warnings`` are what a person should look
    at.
    """

    name: str
    columns: tuple[str, ...]
    time: Array
    values: Array
    in_degrees: bool = False
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = frozen_array(self.time, (None,), "Table.time")
        values = frozen_array(self.values, (time.size, len(self.columns)), "Table.values")
        assign(self, columns=tuple(self.columns), time=time, values=values, warnings=tuple(self.warnings))
        if len(set(self.columns)) != len(self.columns):
            raise BiodanceError(f"Table {self.name}: a column label occurs twice in {', '.join(self.columns)}.")

    def __getitem__(self, column: str) -> Array:
        """Return one column (T,) by its label; UnknownName lists the legal ones."""
        if column not in self.columns:
            raise UnknownName.of("column of this table", column, self.columns)
        return self.values[:, self.columns.index(column)]

    @property
    def has_equal_steps(self) -> bool:
        """True if every time lies within a fifth of a step of equal steps (writers round the time column)."""
        even = np.linspace(self.time[0], self.time[-1], self.time.size) if self.time.size else self.time
        return bool(self.time.size < 3 or np.abs(self.time - even).max() <= _JITTER * (even[1] - even[0]))


def read_mot(path: str | Path) -> TimeTable:
    """Return the table of a .mot or .sto file. Time may have unequal steps; cells that hold ``nan`` stay NaN.

    Raises
    ------
    FileRefused
        No ``endheader``, no ``time`` column, rows of the wrong length, a cell that is no number, a time that does not
        increase.
    """
    path = Path(path)
    header, labels, body = _parts(path)
    if not body:
        raise FileRefused(f"{path}: holds no row of numbers. Export it again.")
    table = np.array([_numbers(row, len(labels), f"{path}, row {i}") for i, row in body])
    time = table[:, 0]
    if np.isnan(time).any() or np.any(np.diff(time) <= 0):
        at = int(np.argmax(np.isnan(time))) if np.isnan(time).any() else int(np.argmax(np.diff(time) <= 0)) + 1
        raise FileRefused(f"{path}: the time does not increase at row {body[at][0]} ({time[at]:g} s). Export it again.")
    announced = header.get("nrows", header.get("datarows", ""))
    differs = announced.isdigit() and int(announced) != len(table)
    warnings = (f"The header announces {announced} rows, the file holds {len(table)}.",) if differs else ()
    degrees = header.get("indegrees", "no").lower() in ("yes", "true", "1")
    return TimeTable(header.get("", path.stem), tuple(labels[1:]), time, table[:, 1:], degrees, warnings)


def columns_of(path: str | Path) -> tuple[str, ...]:
    """Return the column labels of a .mot or .sto file without ``time``; raises FileRefused as `read_mot` does for a
    wrong header.
    """
    return tuple(_parts(Path(path))[1][1:])


def write_mot(path: str | Path, table: TimeTable) -> Path:
    """Write a table as .mot or .sto (version 1, tabs, nine significant digits); return the path.

    Raises
    ------
    FileRefused
        The file exists (nothing is overwritten).
    TrialRefused
        A value is NaN or infinite: OpenSim's splines break on it. The message names column and time.
    """
    path = Path(path)
    if not np.isfinite(table.values).all():
        row, column = np.argwhere(~np.isfinite(table.values))[0]
        raise TrialRefused(
            f"{path}: column {table.columns[column]} is {table.values[row, column]} at {table.time[row]:g} s, and the "
            "format allows finite numbers only. Fill the gap or leave the column out."
        )
    counts = (f"nRows={table.time.size}", f"nColumns={len(table.columns) + 1}")
    degrees = f"inDegrees={'yes' if table.in_degrees else 'no'}"
    labels = "\t".join(["time", *table.columns])
    header = [table.name or path.stem, "version=1", *counts, degrees, "endheader", labels]
    rows = ("\t".join(f"{v:.10g}" for v in (t, *values)) for t, values in zip(table.time, table.values, strict=True))
    return write_new(path, ("\n".join([*header, *rows]) + "\n").encode())


def _parts(path: Path) -> tuple[dict[str, str], list[str], list[tuple[int, str]]]:
    """Return the header (lower-case keys, the table's name under ""), the column labels and the numbered rows."""
    rows = read_text(path).splitlines()
    start = next((i for i, row in enumerate(rows[:_LONGEST_HEADER]) if row.strip().lower() == "endheader"), None)
    if start is None:
        raise FileRefused(f"{path}: has no row 'endheader', so it is not a .mot or .sto file. Export it again.")
    pairs = (re.split(r"\s*=\s*|\s+", row.strip(), maxsplit=1) for row in rows[:start])
    header = {pair[0].lower(): pair[1].strip() for pair in pairs if len(pair) == 2}
    if start and "=" not in rows[0]:
        header[""] = rows[0].strip()
    body = [(i, row) for i, row in enumerate(rows[start + 1 :], start=start + 2) if row.strip()]
    labels = [cell for cell in cells(body[0][1]) if cell] if body else []
    if not labels or labels[0].lower() != "time":
        found = repr(labels[0]) if labels else "missing"
        raise FileRefused(f"{path}: the first column is {found}, it must be 'time'. Export it again.")
    return header, labels, body[1:]


def _numbers(row: str, width: int, where: str) -> list[float]:
    found = cells(row)
    found = found[:-1] if len(found) == width + 1 and not found[-1] else found
    if len(found) != width:
        raise FileRefused(f"{where}: holds {len(found)} cells, {width} are expected. Export the file again.")
    return [parse_number(cell, where) for cell in found]
