"""Tables of markers and forces: CSV, TSV and Parquet as data sets publish them."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.sets import MarkerSet, read_marker_set, recognise
from biodance.lab.markers.signals import unseen_at_origin
from biodance.lab.markers.time_axis import TimeAxis, camera_instants, resampled, time_axis
from biodance.lab.markers.upright import axis_to_head, body_is_tall_along_z, turn_to
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.plates.corners import Told
from biodance.lab.readers import head_text
from biodance.lab.readers._table_cells import (
    FEWEST_MARKERS,
    Cells,
    TableColumns,
    clean_label,
    columns_in,
    header_of,
    is_parquet,
    read_cells,
)
from biodance.lab.readers._table_forces import Load, loads_of, table_plates
from biodance.records import Array, Markers, Role, Source, Trial

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
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_PERSON = 1.5
"""m, largest extent of the markers on a person: 0.9 for legs alone to 2.3 with arms spread or raised."""


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
    axis, rows = time_axis(instants, where=str(path)).from_zero(), replace(rows, time=instants)
    loads, weighed = loads_of(columns.plates, cells.labels, cells.units, cells.values)
    known, worn = recognise(rows.names), _worn(rows)
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
    warnings = (*_broken(columns), *([axis.said] if not axis.sampled and axis.said else []), *plates.warnings)
    name = known.name if known else ""
    return Trial(path.stem, role, markers, plates.plates, source, name, history=history, warnings=warnings)


def _worn(markers: Markers) -> MarkerSet | None:
    """Return the set that was worn: the known one, else what can be guessed; None where nothing can."""
    known = recognise(markers.names)
    if known is not None:
        return known
    guess = guess_set(markers)
    return read_marker_set(guess.name) if guess.name else None


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
    seen = raw[np.isfinite(raw).all(axis=2).sum(axis=1) >= FEWEST_MARKERS]
    extent = float(np.median((np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1)).max(axis=1))) if len(seen) else 0.0
    if not extent > 0:
        raise FileRefused(f"{path}: no row shows {FEWEST_MARKERS} markers apart. Check what the columns hold.")
    written = {plain for k in columns.markers.values() for i in k if (plain := cells.units[i].lower())}
    label = columns.length or (written.pop() if len(written) == 1 else "")
    unit = label if label in _METRES else min(_METRES, key=lambda u: abs(math.log(extent * _METRES[u] / _PERSON)))
    by = "as the labels say" if label in _METRES else f"the markers span {extent:.4g}"
    if not 0.05 <= extent * _METRES[unit] <= 50:
        raise FileRefused(
            f"{path}: the markers of one row span {extent * _METRES[unit]:.2g} m in {unit}. Correct the unit."
        )
    markers = Markers(names, np.arange(len(stamps), dtype=float), raw * _METRES[unit])
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


def _broken(columns: TableColumns) -> tuple[str, ...]:
    if not columns.broken:
        return ()
    return (f"Of {', '.join(columns.broken)} only two coordinates are there: they were left out. Export all three.",)


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
