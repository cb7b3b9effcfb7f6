"""Marker trajectories as text: the .trc file of OpenSim, OpenCap and Motion Analysis.

Five header rows (PathFileType; two rows of names and values; marker labels, one every three columns; X1 Y1 Z1 ...),
then one row per frame with number, time and coordinates, separated by tabs; an empty cell means that the marker was not
seen. OpenSim holds the files with y up; the recording itself is asked (`body_is_tall_along_z`), for Motion Analysis
writes the same file with z up.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused, TrialRefused
from biodance.lab.markers.gaps import unseen_at_origin
from biodance.lab.markers.resampled import resampled
from biodance.lab.markers.sets import recognise
from biodance.lab.markers.time_axis import time_axis
from biodance.lab.markers.up_axis import axis_to_head, body_is_tall_along_z
from biodance.lab.opensim import Y_UP_TO_Z_UP
from biodance.lab.plain_text import (
    COMMAS_READ,
    cells,
    decode,
    parse_number,
    read_bytes,
    sha256,
    with_points,
    write_whole,
)
from biodance.records import Array, Markers, Role, Source, Trial

_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_HEADER_ROWS = 4
_WIDEST = 50.0  # m, between the markers of one frame
_NARROWEST = 0.05  # m, the same of a hand
_FEW = 4  # markers, fewer of which may lie anywhere
_TIME_COLUMN_ROUNDING = 1e-3  # s, some programs write three decimals


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
    unit = _unit(header, path)
    if (announced := header.get("NumFrames", "")).isdigit() and int(announced) != numbers.size:
        warnings.append(f"The header announces {announced} frames, the file holds {numbers.size}.")
    spread = _spread(values) * _METRES[unit]
    if spread > _WIDEST or (0 < spread < _NARROWEST and len(names) >= _FEW):
        raise FileRefused(
            f"{path}: the markers of one frame lie {spread:.2g} m apart in the unit {unit!r} of the header. Correct "
            f"the unit."
        )
    seen, unseen = unseen_at_origin(values * _METRES[unit])
    (time, xyz), timing = _equal_steps(tuple(names), numbers, raw_time, seen, _rate(header, path), path)
    warnings += timing
    history = [*[COMMAS_READ] * commas, *short, f"Coordinates were read in {unit} and turned into m.", *unseen]
    if _is_z_up(Markers(tuple(names), time, xyz)):
        warnings.append(
            "The markers are tallest along z: the file was taken as z up, although .trc files are y up by convention."
        )
    else:
        xyz = xyz @ Y_UP_TO_Z_UP.T
        history.append("The file is y up (OpenSim): turned by 90 degrees about x to z up.")
    markers, known = Markers(tuple(names), time, xyz), recognise(names)
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
    xyz = markers.xyz @ Y_UP_TO_Z_UP / _METRES["mm"]
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


def _unit(header: dict[str, str], path: Path) -> str:
    unit = header.get("Units", "").lower()
    unit = {"meters": "m", "metres": "m", "millimeters": "mm", "millimetres": "mm"}.get(unit, unit)
    if unit not in _METRES:
        raise FileRefused(
            f"{path}: Units is {header.get('Units')!r}; legal are {', '.join(_METRES)}. Correct the third row."
        )
    return unit


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
    """Return frame numbers (T,), times (T,) s, coordinates (T, K, 3) in file units, and which rows are short.

    Some programs leave out the empty cells at a row's end: whole markers, never a part of one.
    """
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
    array = np.array(table)
    said = (
        [f"{len(short)} rows are short (first: row {short[0]}): their last markers count as not seen."] if short else []
    )
    return array[:, 0].astype(int), array[:, 1], array[:, 2:].reshape(len(table), count, 3), said


def _spread(values: Array) -> float:
    """Return the median over frames of the largest extent of the markers (T, K, 3), file units; 0 if none is seen."""
    known = np.isfinite(values)
    extent = np.where(known, values, -np.inf).max(axis=1) - np.where(known, values, np.inf).min(axis=1)
    seen = extent[np.isfinite(extent).any(axis=1)]
    return float(np.median(seen.max(axis=1))) if len(seen) else 0.0


def _equal_steps(
    names: tuple[str, ...], number_of: NDArray[np.int64], raw: Array, xyz: Array, declared: float, path: Path
) -> tuple[tuple[Array, Array], list[str]]:
    """Return time (T,) with equal steps and the coordinates on it, and warnings: frames left out by their numbers or
    the declared rate are NaN, steps that change are resampled.
    """
    axis = time_axis(raw, where=str(path), row="frame")
    if raw.size == 1:
        return (raw, xyz), []
    duration = raw[-1] - raw[0]
    for place in (number_of - number_of[0], np.rint((raw - raw[0]) * declared).astype(int)):
        step = duration / place[-1] if place[-1] > 0 else np.inf
        near = np.abs(raw - raw[0] - step * place) < 0.25 * step + _TIME_COLUMN_ROUNDING
        if np.all(np.diff(place) > 0) and near.all():
            break
    else:
        markers, unseen = resampled(names, xyz, axis)
        return (markers.time, markers.xyz), [axis.said, *unseen]
    warnings = []
    rate = declared
    if abs(1 / (step * declared) - 1) > _TIME_COLUMN_ROUNDING / duration + 1e-6:
        rate = 1 / step
        warnings.append(f"DataRate says {declared:g} Hz, the time column {rate:.6g} Hz; the time column was used.")
    full = np.full((int(place[-1]) + 1, *xyz.shape[1:]), np.nan)
    full[place] = xyz
    if len(full) > raw.size:
        warnings.append(f"{len(full) - raw.size} frames are left out in the file; they count as not seen.")
    return (raw[0] + np.arange(len(full)) / rate, full), warnings


def _is_z_up(markers: Markers) -> bool:
    """Return whether z is up in the file: by the labels of high and low markers, else by where the cloud is tall."""
    axis = axis_to_head(markers, recognise(markers.names))
    return body_is_tall_along_z(markers.xyz) if axis is None or axis[0] else bool(axis[2])
