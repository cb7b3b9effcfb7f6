"""Tables of markers and forces, CSV, TSV and Parquet as data sets publish them: labels, units where a row or the labels
say them, numbers with decimal points or commas.

Of plates a table says three forces and three moments, and neither about which point nor along which axes. They are
taken along the axes of the markers, in the unit of the labels or that in which they weigh a person, with the sign that
pushes up, about the point that the points of pressure beside them say, or where session.toml says. Else, where the
pressures that follow lie under the feet, the moments are about the lab's origin; where they lie elsewhere and a single
plate carries everything, about its own, which is put where the feet stand.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from glob import escape
from itertools import chain
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.raw import split_label, unlabelled
from biodance.lab.c3d.subject import people_of
from biodance.lab.cells import Cells, clean_label, header_of, is_parquet, is_sectioned, read_tables
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.sets import read_marker_set, recognise
from biodance.lab.markers.signals import unseen_at_origin
from biodance.lab.markers.time_axis import TimeAxis, camera_instants, resampled, time_axis
from biodance.lab.markers.upright import METRES, axis_to_head, body_is_tall_along_z, extents, likely_unit, turn_to
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.plates import Told, channel_groups
from biodance.lab.readers import head_text, read_head
from biodance.lab.readers._table_plates import Load, corners_of, loads_of, table_plates
from biodance.records import Array, Markers, Role, Source, Trial

_TIME = re.compile(
    r"(?:time|t|time[\s_]?stamps?|stamps?|elapsed(?:[\s_]?time)?|seconds?|secs?)"
    r"(?:[\s_.]*(s|secs?|seconds?|ms|msecs?|milliseconds?|us|µs|ns))?",
    flags=re.IGNORECASE,
)
FEWEST_MARKERS = 3
"""Markers that a table must hold: fewer have no frame."""


@dataclass(frozen=True)
class TableColumns:
    """``time`` column, None = none, and the unit that its label says; ``markers`` label -> columns of x, y, z, and the
    ``length`` unit their labels say; ``plates`` columns of Fx Fy Fz Mx My Mz of each and, where they are there, of the
    point of pressure; ``others`` labels of columns that are none of these; ``broken`` markers of which an axis is
    missing; ``lone`` labels of forces, moments and pressures that make no plate.
    """

    time: int | None
    time_unit: str
    markers: dict[str, tuple[int, int, int]]
    length: str
    plates: tuple[tuple[int, ...], ...]
    others: tuple[str, ...]
    broken: tuple[str, ...]
    lone: tuple[str, ...]


_TURNED = re.compile(
    r"(force|moment|torque|(?<![a-z])(?:for|mom))[\s_.]*([xyz])|(?<![a-z])(t)([xyz])(?![a-z])", flags=re.IGNORECASE
)
"""Force_X_1 and FP1.ForX, Tz (which is Mz)."""
_PRESSURE = re.compile(r"(?<![a-z])(?:cof?p[\s_.]+c|cof?p[\s_.]*|c)([xyz])(?![a-z])", flags=re.IGNORECASE)
_CHANNEL = re.compile(r"(?<![a-z])[fm][xyz](?![a-z])", flags=re.IGNORECASE)
_PLACE = re.compile(r"(.+?)[\s_.]pos(?:ition)?", flags=re.IGNORECASE)


def columns_in(labels: Sequence[str]) -> TableColumns:
    """Return what the columns with these ``labels`` hold."""
    times = ((k, match[1] or "") for k, label in enumerate(labels) if (match := _TIME.fullmatch(label)))
    time, unit = next(times, (None, ""))
    plates, lone = _plates_in(labels)
    taken = {time, *lone, *chain(*plates)}
    free = [k for k in range(len(labels)) if k not in taken]
    found, length = _marker_columns(labels, free)
    markers = _with_all_axes(found)
    broken = tuple(name for name, axes in found.items() if len(axes) == 2)
    used = taken.union(*markers.values())
    others = tuple(label for k, label in enumerate(labels) if k not in used and label)
    return TableColumns(time, unit, markers, length, plates, others, broken, tuple(labels[k] for k in lone))


def _marker_columns(labels: Sequence[str], free: Sequence[int]) -> tuple[dict[str, dict[str, int]], str]:
    """Return the columns of each marker by axis, in the notation that gives most, and the unit of length."""
    behind = _triples(labels, free, r"(.+?)[\s_.:\-]*([xyz])", 2)
    before = _triples(labels, free, r"([xyz])[\s_.:\-]+(.+?)", 1)
    found, length = max((behind, before), key=lambda notation: len(_with_all_axes(notation[0])))
    # Where markers are NAME.PosX, NAME.RotX is none.
    places = {place[1]: axes for name, axes in found.items() if (place := _PLACE.fullmatch(name))}
    return (places if len(_with_all_axes(places)) >= FEWEST_MARKERS else found), length


def _plates_in(labels: Sequence[str]) -> tuple[tuple[tuple[int, ...], ...], list[int]]:
    """Return the columns of each plate, first of Fx Fy Fz Mx My Mz, then of its point of pressure; and those of forces,
    moments and pressures that make none.
    """
    forces = [
        _TURNED.sub(lambda m: ("F" if m[1] and m[1][0] in "fF" else "M") + (m[2] or m[4]), label) for label in labels
    ]
    # As forces, the pressures stand beside the moments of their plate.
    pressed = [_PRESSURE.sub(r"F\1", x) if _PRESSURE.search(x) else re.sub(r"(?i)f([xyz])", "", x) for x in forces]
    points = {group[3]: group[:3] for group in channel_groups(pressed) if len(group) == 6}
    plates = tuple((*group, *points.get(group[3], ())) for group in channel_groups(forces) if len(group) == 6)
    rest = set(range(len(labels))).difference(*plates)
    return plates, [k for k in sorted(rest) if _CHANNEL.search(forces[k]) or _PRESSURE.search(labels[k])]


def _with_all_axes(found: Mapping[str, Mapping[str, int]]) -> dict[str, tuple[int, int, int]]:
    """Return the columns of x, y, z of the markers of which none is missing."""
    return {name: (axes["x"], axes["y"], axes["z"]) for name, axes in found.items() if len(axes) == 3}


def _triples(
    labels: Sequence[str], free: Sequence[int], pattern: str, axis: int
) -> tuple[dict[str, dict[str, int]], str]:
    """Return the columns of each marker by axis, and the unit of length of the labels."""
    found: dict[str, dict[str, int]] = {}
    units = set()
    for k in free:
        if match := re.fullmatch(rf"{pattern}(?:[\s_.]+(mm|cm|m))?", labels[k], flags=re.IGNORECASE):
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
    text = head_text(head)
    header = header_of(text)
    if header is None or is_sectioned(text):
        return header is not None
    columns = columns_in([clean_label(cell)[0] for cell in header.labels])
    return (columns.time is not None or header.rate > 0) and len(columns.markers) >= FEWEST_MARKERS


_SECONDS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}


def read(path: Path, *, role: Role, subject: str | None = None, told: Told | None = None) -> Trial:
    """Return the trial of a table with a column of time, three columns a marker and, where there are any, six a plate.

    Lengths and times are in the units of the labels, else in those in which a person has a person's size and the steps
    are those of a camera. Samples at (0, 0, 0) and single-frame jumps are not seen, before anything is resampled.

    Raises
    ------
    FileRefused
        No table, no time, fewer than three markers, a time that does not increase, a marker cloud of no person's size.
    """
    files = [path, *_plates_beside(path)]
    contents = [read_bytes(file) for file in files]
    tables = [table for file, content in zip(files, contents, strict=True) for table in read_tables(content, file)]
    cells = max(tables, key=lambda one: len(columns_in(one.labels).markers))
    columns = columns_in(cells.labels)
    own, chosen = _of_subject(columns.markers, subject, path)
    columns = replace(columns, markers=own)
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
    loads, clock, weighed = _loads(cells, columns, tables, axis, path)
    known = recognise(rows.names)
    guess = "" if known else guess_set(rows).name
    worn = read_marker_set(guess) if guess else known
    markers, unseen = resampled(rows.names, rows.xyz, axis)
    plates = table_plates([one.at(clock) for one in loads], clock.time, turn, markers, worn, told or Told())
    history = (
        *cells.said,
        *chosen,
        *_columns_said(columns),
        *timed,
        *lengths,
        *unseen,
        *weighed,
        *([arrived] if arrived else []),
        *_time_said(axis, rows, loads if clock is axis else []),
        *plates.history,
    )
    rate = plates.plates[0].wrench.rate if plates.plates else math.nan
    source = Source(path, sha256(b"".join(contents)), "table", rate=markers.rate, analog_rate=rate)
    warnings = [*_lacking(columns, loads), *([axis.said] if not axis.sampled and axis.said else []), *plates.warnings]
    name = known.name if known else ""
    return Trial(path.stem, role, markers, plates.plates, source, name, history=history, warnings=tuple(warnings))


def _lacking(columns: TableColumns, loads: Sequence[Load]) -> list[str]:
    """Say which columns lack others to be a marker or a plate."""
    said = []
    if columns.broken:
        lacking = ", ".join(columns.broken)
        said.append(f"Of {lacking} only two coordinates are there: they were left out. Export all three.")
    if columns.lone and not loads:
        said.append(
            f"{', '.join(columns.lone[:6])} are no markers, and no force was read from them: a plate has Fx, Fy, Fz, "
            f"Mx, My and Mz. Export all six."
        )
    return said


def _loads(
    cells: Cells, columns: TableColumns, tables: Sequence[Cells], axis: TimeAxis, path: Path
) -> tuple[list[Load], TimeAxis, list[str]]:
    """Return the loads in the table of the markers, else in the others, which have one clock; that clock, from the
    first row of the markers on; and sentences about units.
    """
    loads, said = list[Load](), list[str]()
    for forces in [cells] if columns.plates else tables:
        held = columns_in(forces.labels)
        if forces is not cells and held.plates:
            since = _stamps(forces, held, path)[0]
            axis = time_axis(since + forces.values[0, held.time] - cells.values[0, columns.time], where=str(path))
        some, units = loads_of(held.plates, forces.labels, forces.units, forces.values, corners_of(forces.above, path))
        loads += some
        said += [units] * bool(units)
    if any(len(one.value) != len(axis.stamps) for one in loads):
        raise FileRefused(f"{path}: the forces beside it have different lengths. Export them again.")
    return loads, axis, said


def _of_subject(
    found: Mapping[str, tuple[int, int, int]], subject: str | None, path: Path
) -> tuple[dict[str, tuple[int, int, int]], list[str]]:
    """Return the labelled markers of one person, without the name of it before a colon, and what was left out."""
    nameless = unlabelled(tuple(found))
    named = {split_label(label): axes for k, (label, axes) in enumerate(found.items()) if k not in nameless}
    people = people_of(person for person, _ in named)
    if len(people) > 1 and subject not in people:
        raise FileRefused(
            f"{path}: holds markers of {len(people)} subjects ({', '.join(people)}) and none was chosen. Name one of "
            f"them as the subject."
        )
    chosen = subject if subject in people else next(iter(people), "")
    own = {name: axes for (person, name), axes in named.items() if person in ("", chosen)}
    left = len(found) - len(own)
    said = [f"Markers of {chosen or 'the person'} taken; {left} points unlabelled or of others are left out."]
    return own, said * bool(chosen or left)


def _plates_beside(path: Path) -> list[Path]:
    """Return the files of the plates, NAME_f_1.tsv and so on, beside the markers of Qualisys QTM."""
    alike = sorted(path.parent.glob(f"{escape(path.stem)}_f_*{escape(path.suffix)}"))
    return [file for file in alike if "DATA_INCLUDED\tForce" in head_text(read_head(file))]


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
        # Up to 1.5 a step is in s, from 0.7 Hz on; up to 1500 in ms, so from 667 Hz down; and so on.
        factors = [1.5 * 1000**k for k in range(3)]
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
