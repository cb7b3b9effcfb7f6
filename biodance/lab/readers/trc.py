"""OpenSim's table of markers, with the forces in a table of the same stem beside it."""

import math
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused, TrialRefused
from biodance.lab.markers.sets import recognise
from biodance.lab.markers.signals import unseen_at_origin
from biodance.lab.markers.time_axis import resampled, time_axis
from biodance.lab.markers.upright import METRES, axis_to_head, body_is_tall_along_z, extents
from biodance.lab.plain_text import (
    COMMAS_READ,
    cells,
    decode,
    parse_number,
    plain_table,
    read_bytes,
    sha256,
    with_points,
    write_whole,
)
from biodance.lab.program_tables import Y_UP_TO_Z_UP, columns_of, read_mot
from biodance.lab.readers import head_text
from biodance.lab.readers.mot import has_plates, plates_of
from biodance.records import Array, Markers, Role, Source, Trial

_HEADER_ROWS = 4
_FRAME = re.compile(r"\s*\d+(\.0*)?(\s|$)")  # A row that begins with the number of a frame
_TIME_COLUMN_ROUNDING = 1e-3  # s, some programs write three decimals

NAME = "markers of OpenSim"
EXTENSIONS = (".trc",)
PREFERENCE = 10
_TABLES = (".mot", ".sto", ".forces")


def sniff(head: bytes) -> bool:
    """Return whether the head begins with "PathFileType"."""
    return head_text(head).startswith("PathFileType")


def read(path: Path, *, role: Role, subject: str | None = None) -> Trial:
    """Return the trial of a .trc file; with plates where a table of forces lies beside it."""
    trial = read_trc(path, role=role)
    forces = beside(path)
    return _with_forces(trial, forces) if forces else trial


def beside(path: Path) -> Path | None:
    """Return the table with plate columns that belongs to a .trc file (or should, but is damaged), in its folder or in
    the one for forces beside it (MarkerData/ and ForceData/ or ID/); None if there is none.

    It has the stem of the markers with a usual ending, else it is the only one whose stem goes on behind theirs.
    """
    folder, of_forces = path.parent, r"(?i)force|grf|^id$|kinetic|^mot$|inverse.?dynamics"
    beside_it = sorted(folder.parent.iterdir()) if re.search(r"(?i)marker|mocap|trc", folder.name) else []
    places = (folder, *(one for one in beside_it if one.is_dir() and re.search(of_forces, one.name)))
    for place in places:
        for ending, suffix in product(("", "_grf", "_GRF", "_forces", "_ground_forces"), _TABLES):
            candidate = place / f"{path.stem}{ending}{suffix}"
            if candidate.is_file() and _may_hold_forces(candidate):
                return candidate
    longer = [table for place in places for table in _going_on(path, place) if _may_hold_forces(table)]
    return longer[0] if len(longer) == 1 else None


def _may_hold_forces(table: Path) -> bool:
    """Return whether a table has plate columns, or is damaged."""
    try:
        return has_plates(columns_of(table))
    except FileRefused:
        return True


def _going_on(markers: Path, place: Path) -> list[Path]:
    """Return the tables whose stem is that of the markers and more (``walk_GRF`` for ``walk``), and no other's."""
    stems = [path.stem for path in markers.parent.glob("*.trc")]

    def fits(stem: str, table: Path) -> bool:
        return table.stem.startswith(stem) and not table.stem[len(stem) : len(stem) + 1].isalnum()

    tables = [path for path in sorted(place.iterdir()) if path.suffix.lower() in _TABLES and path.is_file()]
    own = [table for table in tables if fits(markers.stem, table) and table.stem != markers.stem]
    return [table for table in own if not any(len(s) > len(markers.stem) and fits(s, table) for s in stems)]


def _with_forces(trial: Trial, path: Path) -> Trial:
    """Return the trial with the plates of the table beside it; a damaged table is a warning, the markers stay."""
    try:
        table = read_mot(path)
        plates, said, doubts = plates_of(table, where=str(path))
    except FileRefused as error:
        return replace(trial, warnings=(*trial.warnings, f"The forces beside the markers were left out. {error}"))
    digest = sha256((trial.source.sha256 + sha256(read_bytes(path))).encode())
    rate = plates[0].wrench.rate if plates else math.nan
    source = replace(trial.source, format="TRC + MOT", sha256=digest, analog_rate=rate)
    history = tuple(dict.fromkeys((*trial.history, f"Forces were read from {path.name} beside it.", *said)))
    warnings = [*trial.warnings, *table.warnings, *doubts]
    assert trial.markers is not None  # a .trc file always holds markers
    time = trial.markers.time
    overlap = min(time[-1], table.time[-1]) - max(time[0], table.time[0])
    if overlap < 0.9 * (time[-1] - time[0]):
        span = f"{time[0]:g} to {time[-1]:g} s, the forces {table.time[0]:g} to {table.time[-1]:g} s"
        warnings.append(f"The markers cover {span}: they may not belong together.")
    return replace(trial, plates=plates, source=source, history=history, warnings=tuple(warnings))


def read_trc(path: str | Path, *, role: Role = "fit") -> Trial:
    """Return the trial of a .trc file: markers in metres, z up, NaN where a marker was not seen; no plates.

    Frames that are left out in the file are given back as unseen, so that the time steps are equal; where they change,
    the markers are resampled on their own stamps (`time_axis`).

    Raises
    ------
    FileRefused
        Not a .trc file, a header without rate, unit or labels, a cell that is no number, rows of the wrong length, time
        running back.
    """
    path = Path(path)
    content = read_bytes(path)
    text, commas = with_points(decode(content, path))
    rows = text.splitlines()
    header = _header(rows, path)
    names, warnings = _labels(rows, path)
    numbers, raw_time, values, short = _table(rows, len(names), path)
    unit = header.get("Units", "").lower()
    unit = {"meters": "m", "metres": "m", "millimeters": "mm", "millimetres": "mm"}.get(unit, unit)
    if unit not in METRES:
        raise FileRefused(
            f"{path}: Units is {header.get('Units')!r}; legal are {', '.join(METRES)}. Correct the third row."
        )
    if (announced := header.get("NumFrames", "")).isdigit() and int(announced) != numbers.size:
        warnings.append(f"The header announces {announced} frames, the file holds {numbers.size}.")
    sides = extents(values, 1).max(axis=1)
    spread = float(np.median(sides)) * METRES[unit] if sides.size else 0.0
    # No frame has markers 50 m apart, and four or more of a hand are 5 cm apart.
    if spread > 50.0 or (0 < spread < 0.05 and len(names) >= 4):
        raise FileRefused(
            f"{path}: the markers of one frame lie {spread:.2g} m apart in the unit {unit!r} of the header. Correct "
            f"the unit."
        )
    seen, unseen = unseen_at_origin(values * METRES[unit])
    (time, xyz), timing = _equal_steps(tuple(names), numbers, raw_time, seen, _rate(header, path), path)
    warnings += timing
    history = [*[COMMAS_READ] * commas, *short, f"Coordinates were read in {unit} and turned into m.", *unseen]
    # by the labels of high and low markers, else by where the cloud is tall
    known = recognise(names)
    up = axis_to_head(Markers(tuple(names), time, xyz), known)
    if body_is_tall_along_z(xyz) if up is None or up[0] else bool(up[2]):
        warnings.append(
            "The markers are tallest along z: the file was taken as z up, although .trc files are y up by convention."
        )
    else:
        xyz = xyz @ Y_UP_TO_Z_UP.T
        history.append("The file is y up (OpenSim): turned by 90 degrees about x to z up.")
    markers = Markers(tuple(names), time, xyz)
    source = Source(path, sha256(content), "TRC", rate=markers.rate, first_frame=int(numbers[0]))
    worn = known.name if known else ""
    return Trial(path.stem, role, markers, (), source, worn, history=tuple(history), warnings=tuple(warnings))


def write_trc(path: str | Path, markers: Markers) -> Path:
    """Write markers as OpenSim expects them: millimetres, y up, an empty cell where a marker was not seen; return the
    path.

    Raises
    ------
    FileRefused
        The file exists (nothing is overwritten).
    TrialRefused
        The markers hold no frame or no marker, or their time steps are not equal (the format holds one rate).
    """
    path = Path(path)
    if not markers.names or not markers.time.size:
        raise TrialRefused(f"{path}: there is no marker to write. Give at least one frame of one marker.")
    rate = markers.rate if markers.time.size > 1 else 100.0
    steps = np.diff(markers.time)
    if steps.size and np.ptp(steps) > 1e-3 / rate:
        raise TrialRefused(
            f"{path}: the time steps vary from {steps.min():g} to {steps.max():g} s, a .trc file holds one rate. "
            f"Resample first."
        )
    xyz = markers.xyz @ Y_UP_TO_Z_UP / METRES["mm"]
    count, frames = len(markers.names), markers.time.size
    header = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:.10g}\t{rate:.10g}\t{frames}\t{count}\tmm\t{rate:.10g}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(markers.names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i}" for i in range(1, count + 1) for axis in "XYZ"),
        "",
    ]
    lines = (
        "\t".join([str(i), f"{t:.9g}", *("" if np.isnan(v) else f"{v:.6f}" for v in frame.ravel())])
        for i, (t, frame) in enumerate(zip(markers.time, xyz, strict=True), start=1)
    )
    return write_whole(path, ("\n".join([*header, *lines]) + "\n").encode())


def _header(rows: list[str], path: Path) -> dict[str, str]:
    """Return the names and values of the second and third row."""
    if not rows or not rows[0].lstrip().startswith("PathFileType"):
        raise FileRefused(
            f"{path}: does not begin with 'PathFileType', so it is not a .trc file. Export the markers again."
        )
    if len(rows) <= _HEADER_ROWS:
        raise FileRefused(
            f"{path}: ends after {len(rows)} rows; a .trc file has five header rows and the frames. Export it again."
        )
    names, values = (list(filter(None, cells(row))) for row in rows[1:3])  # some writers put two tabs between values
    return dict(zip(names, values, strict=False))


def _rate(header: dict[str, str], path: Path) -> float:
    rate = parse_number(header.get("DataRate", ""), f"{path}: DataRate")
    if not rate > 0 or not np.isfinite(rate):
        raise FileRefused(
            f"{path}: DataRate is {header.get('DataRate')!r}; it must be the frames per second, above 0. Correct the "
            f"header."
        )
    return rate


def _labels(rows: list[str], path: Path) -> tuple[list[str], list[str]]:
    """Return the marker labels, the second of two equal ones with a number, and the warnings of that."""
    found = [cell for cell in cells(rows[3])[2:] if cell]
    if not found:
        raise FileRefused(f"{path}: the fourth row names no marker. Export the markers with their labels.")
    names: list[str] = []
    warnings: list[str] = []
    for label in found:
        name, turn = label, 1
        while name in names:
            turn += 1
            name = f"{label}_{turn}"
        if turn > 1:
            warnings.append(f"Marker label {label} occurs {turn} times; the last one is called {name} here.")
        names.append(name)
    return names, warnings


def _table(rows: list[str], count: int, path: Path) -> tuple[NDArray[np.int64], Array, Array, list[str]]:
    """Return frame numbers (T,), times (T,) s, coordinates (T, K, 3) in file units, and which rows are short."""
    # One or two rows behind the labels may number the axes, or hold nothing.
    begin = next((k for k in range(_HEADER_ROWS, _HEADER_ROWS + 3) if _FRAME.match("".join(rows[k : k + 1]))), 0)
    frames, short = list(filter(str.strip, rows[begin:])), list[int]()
    array = plain_table(frames, 2 + 3 * count) if all(map(_FRAME.match, frames)) else None
    if array is None:
        array, short = _row_by_row(rows, count, path)
    said = (
        [f"{len(short)} rows are short (first: row {short[0]}): their last markers count as not seen."] if short else []
    )
    return array[:, 0].astype(int), array[:, 1], array[:, 2:].reshape(len(array), count, 3), said


def _row_by_row(rows: list[str], count: int, path: Path) -> tuple[Array, list[int]]:
    """Return all cells (T, 2 + 3 K) and which rows are short; the first row that cannot be one is refused."""
    width, short = 2 + 3 * count, list[int]()
    table: list[list[float]] = []
    for line_number, line in enumerate(rows[_HEADER_ROWS:], start=_HEADER_ROWS + 1):
        found = cells(line)
        if not any(found) or not re.fullmatch(r"\d+(\.0*)?", found[0]):
            if any(found) and (table or line_number > _HEADER_ROWS + 2):
                raise FileRefused(
                    f"{path}: row {line_number} does not begin with a frame number ({found[0]!r}). Export the file "
                    f"again."
                )
            continue
        if len(found) > width and not any(found[width:]):
            found = found[:width]
        lacking = width - len(found)
        if lacking < 0 or (lacking and ("\t" not in line or lacking % 3)):
            raise FileRefused(
                f"{path}: row {line_number} holds {len(found)} cells, {width} are expected for {count} markers. "
                f"Export it again."
            )
        short += [line_number] * (lacking > 0)
        found += [""] * lacking
        table.append([parse_number(cell, f"{path}, row {line_number}") for cell in found])
    if not table:
        raise FileRefused(f"{path}: holds a header but no frame. Export the recording again.")
    return np.array(table), short


def _equal_steps(
    names: tuple[str, ...], number_of: NDArray[np.int64], raw: Array, xyz: Array, declared: float, path: Path
) -> tuple[tuple[Array, Array], list[str]]:
    """Return time (T,) with equal steps, coordinates on it (NaN in frames left out), and warnings."""
    axis = time_axis(raw, where=str(path), row="frame")
    if raw.size == 1:
        return (raw, xyz), []
    duration = raw[-1] - raw[0]
    for place in (number_of - number_of[0], np.rint((raw - raw[0]) * declared).astype(int)):
        # Places by the frame numbers, else by the times at the declared rate: each row near its place.
        step = duration / place[-1] if place[-1] > 0 else np.inf
        near = np.abs(raw - raw[0] - step * place) < 0.25 * step + _TIME_COLUMN_ROUNDING
        if np.all(np.diff(place) > 0) and near.all():
            break
    else:
        markers, unseen = resampled(names, xyz, axis)
        return (markers.time, markers.xyz), [axis.said, *unseen]
    warnings = []
    rate = declared
    # A rounded time column leaves the rate open by its rounding over the duration.
    if abs(1 / (step * declared) - 1) > _TIME_COLUMN_ROUNDING / duration + 1e-6:
        rate = 1 / step
        warnings.append(f"DataRate says {declared:g} Hz, the time column {rate:.6g} Hz; the time column was used.")
    full = np.full((int(place[-1]) + 1, *xyz.shape[1:]), np.nan)
    full[place] = xyz
    if len(full) > raw.size:
        warnings.append(f"{len(full) - raw.size} frames are left out in the file; they count as not seen.")
    return (raw[0] + np.arange(len(full)) / rate, full), warnings
