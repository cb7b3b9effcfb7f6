"""Tables of markers and forces, CSV, TSV and Parquet as data sets publish them: labels, units where a row or the labels
say them, numbers with decimal points or commas.
"""

import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.sets import read_marker_set, recognise
from biodance.lab.markers.signals import unseen_at_origin
from biodance.lab.markers.time_axis import TimeAxis, camera_instants, resampled, time_axis
from biodance.lab.markers.upright import METRES, axis_to_head, body_is_tall_along_z, extents, likely_unit, turn_to
from biodance.lab.plain_text import COMMAS_READ, decode, read_bytes, sha256
from biodance.lab.plates.corners import Told
from biodance.lab.plates.parameters import channel_groups
from biodance.lab.readers import head_text
from biodance.lab.readers._table_forces import Load, loads_of, table_plates
from biodance.records import Array, Markers, Role, Source, Trial

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


def read_cells(content: bytes, path: Path, *, least: int = 4) -> Cells:
    """Return the cells of a table of ``least`` columns or more in a file's ``content``.

    Raises
    ------
    FileRefused
        No row of labels, rows of the wrong length, a cell that is no number, a Parquet file that is damaged or cannot
        be read for want of pyarrow.
    """
    return _of_parquet(content, path) if is_parquet(content) else _of_text(decode(content, path), path, least)


def header_of(text: str, *, least: int = 4) -> tuple[int, str, tuple[str, ...]] | None:
    """Return row (from 0), separator and cells of the labels: the first row of >= ``least`` cells, most no numbers."""
    for row, line in enumerate(text.split("\n")[:_HEADER_ROWS]):
        for separator in sorted(_SEPARATORS, key=line.count, reverse=True)[:1]:
            found = tuple(cell.strip() for cell in line.split(separator))
            words = sum(not _NUMBER.fullmatch(cell) for cell in found)
            if len(found) >= least and 2 * words > len(found):
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


def _of_text(text: str, path: Path, least: int) -> Cells:
    header = header_of(text, least=least)
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
    # Force_X_1 is FX_1, Tz is Mz
    forces = [
        _TURNED.sub(lambda m: ("F" if (m[1] or "").lower() == "force" else "M") + (m[2] or m[4]), x) for x in labels
    ]
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


NAME = "table of markers and forces"
EXTENSIONS = (".csv", ".tsv", ".parquet", ".txt")
PREFERENCE = 40
FOLLOWS_TOLD = True


def sniff(head: bytes) -> bool:
    """Return whether the head is that of a Parquet file, or has labels of a time and of three markers."""
    if is_parquet(head):
        return True
    header = header_of(head_text(head))
    if header is None:
        return False
    columns = columns_in([clean_label(cell)[0] for cell in header[2]])
    return columns.time is not None and len(columns.markers) >= FEWEST_MARKERS


_SECONDS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
_IN_SECONDS = 1.5
"""Steps of a time column up to which it is in s (in ms, µs beyond): from 0.7 Hz on, so from 667 Hz down in ms."""


def read(path: Path, *, role: Role, subject: str | None = None, told: Told | None = None) -> Trial:
    """Return the trial of a table with a column of time, three columns a marker and, where there are any, six a plate.

    Lengths and times are in the units of the labels, else in those in which a person has a person's size and the steps
    are those of a camera. Samples at (0, 0, 0) and single-frame jumps are not seen, before anything is resampled.

    Raises
    ------
    FileRefused
        No table, no time, fewer than three markers, a time that does not increase, a marker cloud of no person's size.
    """
    content = read_bytes(path)
    cells = read_cells(content, path)
    columns = columns_in(cells.labels)
    if len(columns.markers) < FEWEST_MARKERS:
        raise FileRefused(
            f"{path}: holds {len(columns.markers)} markers; at least {FEWEST_MARKERS} are needed, each as three "
            f"columns (LASI_x, LASI_y, LASI_z). The columns are {', '.join(cells.labels[:6])} ..."
        )
    stamps, timed = _stamps(cells, columns, path)
    time_axis(stamps, where=str(path))  # refuses stamps that are none
    rows, lengths, turn = _markers(cells, columns, stamps, path)
    instants, arrived = camera_instants(stamps, rows.xyz)
    axis, rows = time_axis(instants, where=str(path)), replace(rows, time=instants)
    axis = replace(axis, stamps=axis.stamps - axis.time[0], time=axis.time - axis.time[0])
    loads, weighed = loads_of(columns.plates, cells.labels, cells.units, cells.values)
    known = recognise(rows.names)
    guess = "" if known else guess_set(rows).name
    worn = read_marker_set(guess) if guess else known
    markers, unseen = resampled(rows.names, rows.xyz, axis)
    plates = table_plates(
        [Load(one.columns, axis.at(one.value)) for one in loads], axis.time, turn, markers, worn, told or Told()
    )
    history = (
        *cells.said,
        *_columns_said(columns),
        *timed,
        *lengths,
        *unseen,
        *([weighed] if weighed else []),
        *([arrived] if arrived else []),
        *_time_said(axis, rows, loads),
        *plates.history,
    )
    rate = plates.plates[0].wrench.rate if plates.plates else math.nan
    source = Source(path, sha256(content), "table", rate=markers.rate, analog_rate=rate)
    warnings = [*([axis.said] if not axis.sampled and axis.said else []), *plates.warnings]
    if columns.broken:
        lacking = (
            f"Of {', '.join(columns.broken)} only two coordinates are there: they were left out. Export all three."
        )
        warnings.insert(0, lacking)
    name = known.name if known else ""
    return Trial(path.stem, role, markers, plates.plates, source, name, history=history, warnings=tuple(warnings))


def _stamps(cells: Cells, columns: TableColumns, path: Path) -> tuple[Array, list[str]]:
    """Return the time of every row in s from the first on, and the sentence about its unit."""
    if columns.time is None:
        raise FileRefused(
            f"{path}: has no column of time. Name it time (in s) or time_ms; the columns are "
            f"{', '.join(cells.labels[:6])} ..."
        )
    raw = cells.values[:, columns.time]
    said = columns.time_unit or cells.units[columns.time]
    unit = re.sub(r"^(sec|second)s?$", "s", said.lower())
    unit = {"msec": "ms", "msecs": "ms", "millisecond": "ms", "milliseconds": "ms", "us": "µs"}.get(unit, unit)
    by = "as its label says"
    if unit not in _SECONDS:
        step = float(np.median(np.diff(raw))) if raw.size > 1 else 0.0
        whole = step >= 1 and bool((raw == np.rint(raw)).all())
        factors = [_IN_SECONDS * 1000**k for k in range(3)]
        unit = "ms" if whole and step < factors[0] else list(_SECONDS)[int(np.searchsorted(factors, step))]
        by = f"steps of {step:.4g}"
    label = cells.labels[columns.time]
    return (raw - raw[0]) * _SECONDS[unit], [f"Time: column {label} in {unit} ({by}), counted from its first row."]


def _markers(cells: Cells, columns: TableColumns, stamps: Array, path: Path) -> tuple[Markers, list[str], Array]:
    """Return the markers in m, z up, what was decided, and lab_R_file (3, 3)."""
    names = tuple(columns.markers)
    raw = cells.values[:, np.array([columns.markers[name] for name in names])]
    raw, zeros = unseen_at_origin(raw)
    sides = extents(raw, FEWEST_MARKERS)
    extent = float(np.median(sides.max(axis=1))) if len(sides) else 0.0
    if not extent > 0:
        raise FileRefused(f"{path}: no row shows {FEWEST_MARKERS} markers apart. Check what the columns hold.")
    written = {plain for k in columns.markers.values() for i in k if (plain := cells.units[i].lower())}
    label = columns.length or (written.pop() if len(written) == 1 else "")
    unit = label if label in METRES else likely_unit(extent)
    by = "as the labels say" if label in METRES else f"the markers span {extent:.4g}"
    if not 0.05 <= extent * METRES[unit] <= 50:
        raise FileRefused(
            f"{path}: the markers of one row span {extent * METRES[unit]:.2g} m in {unit}. Correct the unit."
        )
    markers = Markers(names, np.arange(len(stamps), dtype=float), raw * METRES[unit])
    up = axis_to_head(markers, recognise(names))
    if up is None:
        up = np.eye(3)[2 if body_is_tall_along_z(markers.xyz) else 1]
    turn = turn_to(up)
    axis = f"{'+' if up.sum() > 0 else '-'}{'XYZ'[int(np.argmax(np.abs(up)))]}"
    turned = "" if axis == "+Z" else "; everything was turned so that z points up"
    said = [f"Coordinates were read in {unit} ({by}) and turned into m.", f"Up is {axis} in the table{turned}.", *zeros]
    return Markers(names, stamps, markers.xyz @ turn.T), said, turn


def _columns_said(columns: TableColumns) -> list[str]:
    some = list(columns.markers)
    said = [f"{len(some)} markers ({some[0]} ... {some[-1]}), {len(columns.plates)} force plates by their labels."]
    if columns.others:
        more = f" and {len(columns.others) - 6} more" if len(columns.others) > 6 else ""
        said.append(f"Columns that are none of these were left aside: {', '.join(columns.others[:6])}{more}.")
    return said


def _time_said(axis: TimeAxis, markers: Markers, loads: list[Load]) -> list[str]:
    """Return what was decided of the time, and what resampling costs."""
    if not axis.sampled:
        return [axis.said] if axis.said else []
    missed = [f"markers {1000 * axis.missed_by(markers.xyz):.2g} mm"]
    for unit, part in (("forces {:.2g} N", slice(0, 3)), ("moments {:.2g} N·m", slice(3, 6))):
        missed += [unit.format(axis.missed_by(np.hstack([one.value[:, part] for one in loads])))] if loads else []
    cost = (
        f"What that costs at most, as a sample left out is missed by its neighbours (RMS): {', '.join(missed)}; the "
        f"noise of single samples is multiplied by {axis.noise:.2f}."
    )
    return [axis.said, cost]
