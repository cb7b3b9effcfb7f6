"""Tables as programs and spreadsheets write them, text or Parquet: rows of numbers under labels, and what stands above
these.
"""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.plain_text import COMMAS_READ, decode
from biodance.records import Array

_QUOTES = "'\"`´‘’‚‛“”„‟′″"  # What programs and spreadsheets put around a label
_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas"}
_UNIT = re.compile(r"^(.*?)[\s_]*[(\[{]\s*([^)\]}]*?)\s*[)\]}]$")
_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?|nan|NaN|NA|")


@dataclass(frozen=True, eq=False)
class Cells:
    """``labels``, ``units`` (C) as written, "" = not said; ``values`` (T, C), NaN = empty; ``said`` how read; ``above``
    what stands above the labels, by its first word (QTM).
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    said: tuple[str, ...] = ()
    above: Mapping[str, Sequence[str]] = field(default_factory=dict)


def is_parquet(content: bytes) -> bool:
    """Return whether bytes begin as those of a Parquet file."""
    return content.startswith(b"PAR1")


def read_cells(content: bytes, path: Path, *, least: int = 4) -> Cells:
    """Return the cells of a table of ``least`` columns or more in a file's ``content``, the first of several.

    Raises
    ------
    FileRefused
        No row of labels, rows of the wrong length, a cell that is no number, a Parquet file that is damaged or cannot
        be read for want of pyarrow.
    """
    return read_tables(content, path, least=least)[0]


def read_tables(content: bytes, path: Path, *, least: int = 4) -> tuple[Cells, ...]:
    """Return the tables of a file: several of Vicon Nexus (devices, trajectories), else one; FileRefused as of
    `read_cells`.
    """
    if is_parquet(content):
        return (_of_parquet(content, path),)
    text = decode(content, path)
    titles = [*_TITLE.finditer(text)]
    if not titles:
        return (_of_text(text, path, least),)
    ends = [*(title.start() for title in titles[1:]), len(text)]
    found = [
        _of_text(text[title.start() : end], path, least, first=text.count("\n", 0, title.start()))
        for title, end in zip(titles, ends, strict=True)
        if title[1] in ("Trajectories", "Devices")
    ]
    if not found:
        only = ", ".join(title[1] for title in titles)
        raise FileRefused(f"{path}: is an export of Vicon Nexus, of {only}. Export Trajectories and Devices, too.")
    return tuple(found)


def is_sectioned(text: str) -> bool:
    """Return whether a text is of Vicon Nexus: tables one below the other, each under its title and rate."""
    return bool(_TITLE.search(text))


_TITLE = re.compile(
    r"^(Devices|Events|Joints|Model Outputs|Segments|Trajectories)[,;\t]*\n(\d+(?:\.\d+)?)[,;\t]*$", re.MULTILINE
)
"""A section of Vicon Nexus and its rate."""
_AXES = re.compile(r"Frame[,;\t](Sub Frame|Time \(Seconds\))[,;\t]", re.IGNORECASE)
"""How the row of axes begins where names stand in a row above it (Vicon Nexus, OptiTrack Motive)."""
_LENGTHS = {"meters": "m", "centimeters": "cm", "millimeters": "mm"}


class TableHeader(NamedTuple):
    """The last ``row`` (from 0) of a header, its ``separator``, the ``labels`` of the columns; the ``rate`` (Hz) of the
    rows where none of the columns is the time, else NaN; ``above`` as of `Cells`.
    """

    row: int
    separator: str
    labels: tuple[str, ...]
    rate: float = math.nan
    above: Mapping[str, Sequence[str]] = {}


def header_of(text: str, *, least: int = 4) -> TableHeader | None:
    """Return the labels of columns: the first row of >= ``least`` cells, most no numbers; where programs write names
    and axes in several rows, or names beside a keyword, one label a column is made of them.
    """
    if re.match(r"(FILE_VERSION|NO_OF_\w+)\t", text):
        return _of_keywords(text.split("\n"))
    lines = text.split("\n", 30)[:30]
    if is_sectioned(text) or text.startswith("Format Version"):
        axes = next((row for row, line in enumerate(lines) if _AXES.match(line)), 0)
        return _stacked(lines, axes) if axes > 2 else None
    for row, line in enumerate(lines):
        for separator in sorted(_SEPARATORS, key=line.count, reverse=True)[:1]:
            found = tuple(cell.strip() for cell in line.split(separator))
            if len(found) >= least and _are_words(found):
                return TableHeader(row, separator, found)
    return None


def _of_keywords(lines: Sequence[str]) -> TableHeader | None:
    """Return the header of Qualisys QTM: a keyword and its values in each row, then labels, or none."""
    rows = [[cell.strip() for cell in line.rstrip("\t").split("\t")] for line in lines[:500]]
    keyword = re.compile(r"(?!SAMPLE$)[A-Z]+(_[A-Z0-9]+)*")
    last = next((k for k, row in enumerate(rows) if not keyword.fullmatch(row[0])), len(rows))
    above = {row[0]: row[1:] for row in rows[:last]}
    if last < len(rows) and _are_words(rows[last]):
        labels = rows[last]
    else:
        names = above.get("MARKER_NAMES") or ["Force", "Moment", "COP"]
        labels = [f"{name} {axis}" for name in names for axis in "XYZ"]
        if last < len(lines) and lines[last].count("\t") > len(labels):
            labels = ["Frame", "Time", *labels]
        last -= 1
    timed = "time" in map(str.lower, labels)
    return TableHeader(last, "\t", tuple(labels), math.nan if timed else _rate(above.get("FREQUENCY", [])), above)


def _stacked(lines: Sequence[str], axes: int) -> TableHeader:
    """Return the header of axes in row ``axes`` under names in another: of Vicon Nexus, that spans names over the cells
    to their right and has units below and its rate above, or of OptiTrack Motive, of which measured markers are taken.
    """
    separator = lines[axes][5]
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines[: axes + 2], delimiter=separator)]
    width = len(rows[axes])
    if rows[axes][1].lower() == "sub frame":
        names, units = ([*row, *[""] * width] for row in (rows[axes - 1], *rows[axes + 1 :], [])[:2])
        for k in range(1, width):
            names[k] = names[k] or names[k - 1]
        labels = [f"{n} {a} ({u})" if u else a for n, a, u in zip(names, rows[axes], units, strict=False)]
        return TableHeader(axes + 1, separator, tuple(labels), _rate(rows[axes - 2]))
    kinds, names, what = (*[row for row in rows[1:axes] if any(row)][:2], rows[axes - 1])
    pairs = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    unit = _LENGTHS.get(pairs.get("Length Units", "").lower(), "")
    ours = [(kind, part) == ("Marker", "Position") for kind, part in zip(kinds, what, strict=False)]
    labels = [f"{n} {a} ({unit})" if own else "" for n, a, own in zip(names, rows[axes], ours, strict=False)]
    return TableHeader(axes, separator, (*rows[axes][:2], *labels[2:], *[""] * (width - len(labels))))


def _rate(cells: Sequence[str]) -> float:
    """Return the number in the first cell, NaN where there is none ("EXT")."""
    return float(cells[0]) if cells and re.fullmatch(r"\d+\.?\d*", cells[0]) else math.nan


def _are_words(cells: Sequence[str]) -> bool:
    return 2 * sum(not _NUMBER.fullmatch(cell) for cell in cells) > len(cells)


def clean_label(cell: str) -> tuple[str, str]:
    """Return label and unit of a cell such as ``"LASI x (mm)"`` or ``’time'``, without quotes; "" = no unit."""
    plain = cell.strip().strip(_QUOTES + " ")
    tuple_like = re.fullmatch(r"\((.*)\)", plain)  # several rows of labels, as pandas writes them
    if tuple_like and "," in plain:
        return "_".join(part.strip().strip(_QUOTES) for part in tuple_like[1].split(",")), ""
    unit = _UNIT.fullmatch(plain)
    return (unit[1].strip(), unit[2]) if unit and unit[1] else (plain, "")


def _of_text(text: str, path: Path, least: int, first: int = 0) -> Cells:
    """Return the table in ``text``, which begins behind ``first`` rows of its file."""
    if re.match(r"(?:.*\n){4}ITEM\t", text):
        raise FileRefused(f"{path}: is an export of Visual3D, which says no rate. Give the C3D file it was made from.")
    header = header_of(text, least=least)
    if header is None:
        raise FileRefused(f"{path}: no row holds the labels of columns. Write them into the first row, as LASI_x.")
    row, separator, found, rate, above = header
    lines = enumerate(text.split("\n")[row + 1 :], start=first + row + 2)
    # Where rows are counted, an empty one counts: nothing was seen in it.
    counted = math.isfinite(rate) and "Frame" not in found
    body = [(number, line) for number, line in lines if line.strip(" " if counted else f" \t{separator}")]
    labels, units = (list(some) for some in zip(*map(clean_label, found), strict=True))
    if body and not any(_NUMBER.fullmatch(cell.strip()) and cell.strip() for cell in body[0][1].split(separator)):
        below = [clean_label(f"x ({cell.strip()})")[1].strip("()[]") for cell in body[0][1].split(separator)]
        units = [unit or said for unit, said in zip(units, [*below, *[""] * len(units)], strict=False)]
        body = body[1:]
    commas = separator != "," and any("," in line for _, line in body) and not any("." in line for _, line in body)
    said = [f"Columns are parted by {_SEPARATORS[separator]}.", *[COMMAS_READ] * commas]
    body, cut = _whole_rows(body, separator, len(labels), path)
    values = _numbers(body, separator, len(labels), commas=commas, path=path)
    if math.isfinite(rate):
        values = np.column_stack([values, _times(labels, values, rate, path)])
        said.append(f"The rows have no time: it was counted at the {rate:g} Hz that stand above them.")
        labels, units = [*labels, "time"], [*units, "s"]
    return Cells(tuple(labels), tuple(units), values, (*said, *cut), above)


def _times(labels: Sequence[str], values: Array, rate: float, path: Path) -> Array:
    """Return the time (T,) s of rows at a rate: of frames and sub frames where these are counted, from frame 1 on."""
    if labels[:2] != ["Frame", "Sub Frame"]:
        return np.arange(len(values)) / rate
    each = values[:, 1].max() + 1
    count = (values[:, 0] - 1) * each + values[:, 1]
    if (steps := np.diff(count) != 1).any():
        frame = values[int(np.argmax(steps)), 0]
        raise FileRefused(f"{path}: after frame {frame:g} rows are missing or repeated. Export it again.")
    return np.asarray(count / rate)


def _whole_rows(
    body: list[tuple[int, str]], separator: str, width: int, path: Path
) -> tuple[list[tuple[int, str]], list[str]]:
    """Return the rows of ``width`` cells; only the last may be cut off, which is said."""
    if not body:
        raise FileRefused(f"{path}: holds labels and no row of numbers. Export it again.")
    cut: list[str] = []
    if len(body) > 1 and body[-1][1].count(separator) + 1 < width:
        cut = [f"The last row ({body[-1][0]}) is cut off and was left out."]
        body = body[:-1]
    for number, line in body:
        count = (
            len(line.rstrip(separator).split(separator))
            if line.count(separator) >= width
            else line.count(separator) + 1
        )
        if count > width or line.count(separator) + 1 < width:
            raise FileRefused(
                f"{path}: row {number} holds {count} cells, {width} are expected. Correct it or export it again."
            )
    return body, cut


def _numbers(body: list[tuple[int, str]], separator: str, width: int, *, commas: bool, path: Path) -> Array:
    import pandas as pd

    text = "\n".join(line for _, line in body)
    try:
        table = pd.read_csv(
            io.StringIO(text),
            sep=separator,
            header=None,
            decimal="," if commas else ".",
            usecols=range(width),
            skipinitialspace=True,
            low_memory=False,
        )
    except pd.errors.ParserError as error:
        raise FileRefused(
            f"{path}: a quotation mark is opened and never closed among the numbers. Take it out or export the file "
            f"again."
        ) from error
    for column in range(width):
        if not pd.api.types.is_numeric_dtype(table[column]):
            wrong = pd.to_numeric(table[column], errors="coerce").isna() & table[column].notna()
            at = int(np.argmax(wrong)) if wrong.any() else 0
            raise FileRefused(
                f"{path}: row {body[at][0]}, column {column + 1}: {table[column][at]!r} is not a number. Correct that "
                f"cell or export the file again."
            )
    return table.to_numpy(dtype=float)


def _of_parquet(content: bytes, path: Path) -> Cells:
    import pandas as pd

    try:
        table = pd.read_parquet(io.BytesIO(content))
    except ImportError as error:
        raise FileRefused(
            f"{path}: reading Parquet needs pyarrow. Install it (pip install pyarrow), or export the table as CSV."
        ) from error
    except Exception as error:
        raise FileRefused(f"{path}: is a damaged Parquet file ({error}). Export it again.") from error
    index = [] if isinstance(table.index, pd.RangeIndex) else [table.index.to_numpy()]
    names = [str(table.index.name or "index")] * len(index) + [str(name) for name in table.columns]
    columns = [*index, *(table[name].to_numpy() for name in table.columns)]
    kept = [(name, column) for name, column in zip(names, columns, strict=True) if column.dtype.kind in "iufmM"]
    labels, units = zip(*(clean_label(name) for name, _ in kept), strict=True) if kept else ((), ())
    values = [
        np.where(
            np.isnat(c),
            np.nan,
            c.astype("timedelta64[ns]" if c.dtype.kind == "m" else "datetime64[ns]").astype("int64") / 1e9,
        )
        if c.dtype.kind in "mM"
        else c.astype(float)
        for _, c in kept
    ]
    return Cells(labels, units, np.stack(values, axis=1) if values else np.empty((0, 0)), ("Read from Parquet.",))
