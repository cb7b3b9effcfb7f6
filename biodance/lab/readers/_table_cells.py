"""The cells of a table: labels, units where a row or the labels say them, numbers; from text with any separator,
decimal points or commas, or from Parquet.
"""

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.plain_text import COMMAS_READ, decode
from biodance.lab.plates.parameters import channel_groups
from biodance.records import Array

_QUOTES = "'\"`´‘’‚‛“”„‟′″"  # What programs and spreadsheets put around a label
_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas"}
_HEADER_ROWS = 30
_PARQUET = b"PAR1"
_UNIT = re.compile(r"^(.*?)[\s_]*[(\[{]\s*([^)\]}]*?)\s*[)\]}]$")
_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?|nan|NaN|NA|")


@dataclass(frozen=True, eq=False)
class Cells:
    """``labels``, ``units`` (C) as written, "" = not said; ``values`` (T, C), NaN = empty; ``said`` how read."""

    labels: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    said: tuple[str, ...] = ()


def is_parquet(content: bytes) -> bool:
    """Return whether bytes begin as those of a Parquet file."""
    return content.startswith(_PARQUET)


def read_cells(content: bytes, path: Path) -> Cells:
    """Return the cells of a table in a file's ``content``.

    Raises
    ------
    FileRefused
        No row of labels, rows of the wrong length, a cell that is no number, a Parquet file that is damaged or cannot
        be read for want of pyarrow.
    """
    return _of_parquet(content, path) if is_parquet(content) else _of_text(decode(content, path), path)


def header_of(text: str) -> tuple[int, str, tuple[str, ...]] | None:
    """Return row (from 0), separator and cells of the labels: the first row of >= 4 cells, most no numbers."""
    for row, line in enumerate(text.split("\n")[:_HEADER_ROWS]):
        for separator in sorted(_SEPARATORS, key=line.count, reverse=True)[:1]:
            found = tuple(cell.strip() for cell in line.split(separator))
            words = sum(not _NUMBER.fullmatch(cell) for cell in found)
            if len(found) >= 4 and 2 * words > len(found):
                return row, separator, found
    return None


def clean_label(cell: str) -> tuple[str, str]:
    """Return label and unit of a cell such as ``"LASI x (mm)"`` or ``’time'``, without quotes; "" = no unit."""
    plain = cell.strip().strip(_QUOTES + " ")
    tuple_like = re.fullmatch(r"\((.*)\)", plain)  # several rows of labels, as pandas writes them
    if tuple_like and "," in plain:
        return "_".join(part.strip().strip(_QUOTES) for part in tuple_like[1].split(",")), ""
    unit = _UNIT.fullmatch(plain)
    return (unit[1].strip(), unit[2]) if unit and unit[1] else (plain, "")


def _of_text(text: str, path: Path) -> Cells:
    header = header_of(text)
    if header is None:
        raise FileRefused(f"{path}: no row holds the labels of columns. Write them into the first row, as LASI_x.")
    row, separator, found = header
    lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    body = [(number, line) for number, line in lines if number > row + 1]
    labels, units = (list(some) for some in zip(*map(clean_label, found), strict=True))
    if body and not any(_NUMBER.fullmatch(cell.strip()) and cell.strip() for cell in body[0][1].split(separator)):
        below = [clean_label(f"x ({cell.strip()})")[1].strip("()[]") for cell in body[0][1].split(separator)]
        units = [unit or said for unit, said in zip(units, [*below, *[""] * len(units)], strict=False)]
        body = body[1:]
    commas = separator != "," and any("," in line for _, line in body) and not any("." in line for _, line in body)
    said = [f"Columns are parted by {_SEPARATORS[separator]}.", *[COMMAS_READ] * commas]
    body, cut = _whole_rows(body, separator, len(labels), path)
    values = _numbers(body, separator, len(labels), commas=commas, path=path)
    return Cells(tuple(labels), tuple(units), values, (*said, *cut))


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
    table = pd.read_csv(
        io.StringIO(text),
        sep=separator,
        header=None,
        decimal="," if commas else ".",
        usecols=range(width),
        skipinitialspace=True,
        low_memory=False,
    )
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


_TIME = re.compile(
    r"(?:time|t|time[\s_]?stamps?|stamps?|elapsed(?:[\s_]?time)?|seconds?|secs?)"
    r"(?:[\s_.]*(s|secs?|seconds?|ms|msecs?|milliseconds?|us|µs|ns))?",
    flags=re.IGNORECASE,
)
_BEHIND = re.compile(r"(.+?)[\s_.:\-]*([xyz])(?:[\s_.]+(mm|cm|m))?", flags=re.IGNORECASE)
_BEFORE = re.compile(r"([xyz])[\s_.:\-]+(.+?)(?:[\s_.]+(mm|cm|m))?", flags=re.IGNORECASE)
_TURNED = re.compile(r"(force|moment|torque)[\s_.]*([xyz])|(?<![A-Za-z])(t)([xyz])(?![a-z])", flags=re.IGNORECASE)
FEWEST_MARKERS = 3
"""Markers that a table must hold: fewer have no frame."""


@dataclass(frozen=True)
class TableColumns:
    """``time`` column, None = none, and the unit that its label says; ``markers`` label -> columns of x, y, z, and the
    ``length`` unit their labels say; ``plates`` columns of Fx Fy Fz Mx My Mz of each; ``others`` labels of columns that
    are none of these; ``broken`` markers of which an axis is missing.
    """

    time: int | None
    time_unit: str
    markers: dict[str, tuple[int, int, int]]
    length: str
    plates: tuple[tuple[int, ...], ...]
    others: tuple[str, ...]
    broken: tuple[str, ...]


def columns_in(labels: Sequence[str]) -> TableColumns:
    """Return what the columns with these ``labels`` hold."""
    times = ((k, match[1] or "") for k, label in enumerate(labels) if (match := _TIME.fullmatch(label)))
    time, unit = next(times, (None, ""))
    forces = [_as_channel(label) for label in labels]
    plates = tuple(group for group in channel_groups(forces) if len(group) == 6)
    taken = {time, *chain(*plates)}
    free = [k for k in range(len(labels)) if k not in taken]
    behind, before = (_triples(labels, free, pattern, axis) for pattern, axis in ((_BEHIND, 2), (_BEFORE, 1)))
    found, length = max((behind, before), key=lambda notation: len(_with_all_axes(notation[0])))
    markers = _with_all_axes(found)
    broken = tuple(name for name, axes in found.items() if len(axes) == 2)
    used = taken.union(*markers.values())
    others = tuple(label for k, label in enumerate(labels) if k not in used and label)
    return TableColumns(time, unit, markers, length, plates, others, broken)


def _with_all_axes(found: Mapping[str, Mapping[str, int]]) -> dict[str, tuple[int, int, int]]:
    """Return the columns of x, y, z of the markers of which none is missing."""
    return {name: (axes["x"], axes["y"], axes["z"]) for name, axes in found.items() if len(axes) == 3}


def _as_channel(label: str) -> str:
    """Return the label of a force column as ``Fx``, ``Mz`` with what else it says: Force_X_1 is FX_1, Tz is Mz."""
    return _TURNED.sub(lambda m: ("F" if (m[1] or "").lower() == "force" else "M") + (m[2] or m[4]), label)


def _triples(
    labels: Sequence[str], free: Sequence[int], pattern: re.Pattern[str], axis: int
) -> tuple[dict[str, dict[str, int]], str]:
    """Return the columns of each marker by axis, and the unit of length of the labels."""
    found: dict[str, dict[str, int]] = {}
    units = set()
    for k in free:
        if match := pattern.fullmatch(labels[k]):
            found.setdefault(match[3 - axis].strip(), {}).setdefault(match[axis].lower(), k)
            units.add((match[3] or "").lower())
    return found, units.pop() if len(units) == 1 else ""
