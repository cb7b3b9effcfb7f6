"""Tables of other programs: OpenSim's over time as text (.mot, .sto: forces of the plates, joint coordinates, anything
with a time column; Cortex's .forces are read as one), with the ground forces and their set-up files for its tools; and
BIDS motion (BEP 029), https://bids-specification.readthedocs.io, version 1.10: one trial is a task of a subject;
``_motion.tsv`` (numbers without header), ``_channels.tsv`` (one row a column), ``_motion.json``, ``_events.tsv``.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from biodance.errors import BiodanceError, FileRefused, TrialRefused, known_index
from biodance.lab.plain_text import COMMAS_READ, cells, parse_number, plain_table, read_text, with_points, write_whole
from biodance.records import Array, Wrench, assign, freeze, frozen_array
from biodance.records.arrays import rate_of
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_point

Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) lab_R_file of a Y-up recording (OpenSim: x forward, y up, z right): x stays, y becomes z, z becomes -y."""


@dataclass(frozen=True, eq=False)
class TimeTable:
    """A table over time: ``columns`` (C) labels, ``time`` (T,) s, ``values`` (T, C) in the file's units.

    ``in_degrees`` says that rotational coordinates are in degrees (the file's ``inDegrees``); which columns are
    rotations only the model knows. ``name`` is the first row of the file. ``vectors`` are the labels whose cells hold
    three numbers: their columns end in _x, _y, _z. ``history`` says how it was read, ``warnings`` are what a person
    should look at.
    """

    name: str
    columns: tuple[str, ...]
    time: Array
    values: Array
    in_degrees: bool = False
    vectors: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = frozen_array(self.time, (None,), "Table.time")
        values = frozen_array(self.values, (time.size, len(self.columns)), "Table.values")
        assign(self, columns=tuple(self.columns), time=time, values=values)
        if len(set(self.columns)) != len(self.columns):
            raise BiodanceError(f"Table {self.name}: a column label occurs twice in {', '.join(self.columns)}.")

    def __getitem__(self, column: str) -> Array:
        """Return one column (T,) by its label; UnknownName lists the legal ones."""
        return self.values[:, known_index("column of this table", column, self.columns)]


def read_mot(path: str | Path) -> TimeTable:
    """Return the table of a .mot, .sto or .forces file. Time may have unequal steps; cells that hold ``nan`` stay NaN.

    Raises
    ------
    FileRefused
        No ``endheader``, no ``time`` column, rows of the wrong length, a cell that is no number, or several of which
        there are not three, a time that does not increase.
    """
    path = Path(path)
    header, labels, body, vectors, history = _parts(path)
    if not body:
        raise FileRefused(f"{path}: holds no row of numbers. Export it again.")
    table = plain_table([row for _, row in body], len(labels))
    if table is None:
        table = np.array([_numbers(row, len(labels), f"{path}, row {i}") for i, row in body])
    if "samplerate" in header:
        # of samples from 1 on, with points in mm and moments in N mm
        table = table * [1.0, *(1.0 if "_v" in label else 1e-3 for label in labels[1:])]
        table[:, 0] = (table[:, 0] - 1) / parse_number(header["samplerate"], f"{path}: SampleRate")
    time = table[:, 0]
    if np.isnan(time).any() or np.any(np.diff(time) <= 0):
        at = int(np.argmax(np.isnan(time))) if np.isnan(time).any() else int(np.argmax(np.diff(time) <= 0)) + 1
        raise FileRefused(f"{path}: the time does not increase at row {body[at][0]} ({time[at]:g} s). Export it again.")
    announced = header.get("nrows", header.get("datarows", ""))
    differs = announced.isdigit() and int(announced) != len(table)
    warnings = (f"The header announces {announced} rows, the file holds {len(table)}.",) if differs else ()
    degrees = header.get("indegrees", "no").lower() in ("yes", "true", "1")
    name = header.get("", path.stem)
    return TimeTable(name, labels[1:], time, table[:, 1:], degrees, vectors, history, warnings)


def columns_of(path: str | Path) -> tuple[str, ...]:
    """Return the column labels of a .mot or .sto file without ``time``; FileRefused as of `read_mot`."""
    return _parts(Path(path))[1][1:]


def write_mot(path: str | Path, table: TimeTable, *, notes: tuple[str, ...] = ()) -> Path:
    """Write a table as .mot or .sto (version 1, tabs, nine significant digits), ``notes`` in its header; return the
    path.

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
    header = [table.name or path.stem, "version=1", *counts, degrees, *notes, "endheader", labels]
    rows = ("\t".join(f"{v:.10g}" for v in (t, *values)) for t, values in zip(table.time, table.values, strict=True))
    return write_whole(path, ("\n".join([*header, *rows]) + "\n").encode())


def _parts(
    path: Path,
) -> tuple[dict[str, str], tuple[str, ...], list[tuple[int, str]], tuple[str, ...], tuple[str, ...]]:
    """Return the header (lower-case keys, the table's name under ""), column labels, numbered rows, vectors as of a
    `TimeTable`, and history.
    """
    text, commas = with_points(read_text(path))
    rows = text.splitlines()
    if rows[0].strip() == "[Force Data]":
        return _of_cortex(rows)
    start = next((i for i, row in enumerate(rows[:200]) if row.strip().lower() == "endheader"), None)
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
    vectors = _vectors(labels, body[1][1], path) if len(body) > 1 else ()
    history = [COMMAS_READ] * commas
    if vectors:
        history.append("Cells hold three numbers (Vec3): each label became three columns, _x, _y, _z.")
    return header, _columns(labels, vectors), body[1:], vectors, tuple(history)


def _of_cortex(
    rows: list[str],
) -> tuple[dict[str, str], tuple[str, ...], list[tuple[int, str]], tuple[str, ...], tuple[str, ...]]:
    """Return the parts of a .forces file: FX FY FZ, the point of pressure X Y Z and the moment MZ about it, a plate."""
    pairs = (row.split("=", 1) for row in rows[:20] if "=" in row)
    header = {key.strip().lower(): value.strip() for key, value in pairs}
    start = next((i for i, row in enumerate(rows[:20]) if row.startswith("#")), 0)
    found = [re.fullmatch(r"([FM]?)([XYZ])(\d+)", cell) for cell in cells(rows[start])[1:] if cell]
    parts = {"F": "ground_force_{}_v", "": "ground_force_{}_p", "M": "ground_torque_{}_"}
    labels = ["time", *(parts[m[1]].format(m[3]) + m[2].lower() for m in found if m)]
    body = [(i, row) for i, row in enumerate(rows[start + 1 :], start=start + 2) if row.strip()]
    header["nrows"] = header.get("numberofsamples", "")
    return header, tuple(labels), body, (), ("Forces of Cortex: points were read in mm, moments in N mm.",)


def _vectors(labels: list[str], row: str, path: Path) -> tuple[str, ...]:
    """Return the labels whose cells hold three numbers."""
    sizes = {label: cell.count(",") + 1 for label, cell in zip(labels, cells(row), strict=False)}
    odd = next((label for label, size in sizes.items() if size not in (1, 3)), None)
    if odd is not None:
        what = "orientations (quaternions)" if sizes[odd] == 4 else "quantities"
        raise FileRefused(
            f"{path}: holds {what} of {sizes[odd]} numbers in a cell ({odd}). Markers (.trc), plates and tables of "
            f"single numbers are read; export these."
        )
    return tuple(label for label, size in sizes.items() if size == 3)


def _columns(labels: list[str], vectors: tuple[str, ...]) -> tuple[str, ...]:
    """Return the labels of single numbers."""
    found: list[str] = []
    for label in labels:
        # Force, point and moment of plate N are fN, pN, mN in the tables that OpenSim makes of C3D files.
        plate = re.fullmatch(r"([fpm])(\d+)", label)
        stem = f"ground_force_{plate[2]}_{plate[1].replace('f', 'v')}" if plate else f"{label}_"
        found += [f"{stem}{axis}" for axis in "xyz"] if label in vectors else [label]
    return tuple(found)


def _numbers(row: str, width: int, where: str) -> list[float]:
    found = cells(row)
    if any("," in cell for cell in found):  # several numbers, with what some writers put around them
        found = [part for cell in found for part in re.sub(r"[~()\[\] ]", "", cell).split(",")]
    found = found[:-1] if len(found) == width + 1 and not found[-1] else found
    if len(found) != width:
        raise FileRefused(f"{where}: holds {len(found)} cells, {width} are expected. Export the file again.")
    return [parse_number(cell, where) for cell in found]


_VERSION = "40000"


def ground_table(feet: Mapping[str, Wrench], *, name: str) -> TimeTable:
    """Return the ground's force on each segment as a table, y up: nine columns a segment, its name in front.

    ``feet`` segment -> wrench of the ground on it about the lab origin. Force and torque stand at one point of the
    ground that does not move, the mean centre of pressure: a centre of pressure that jumps with every step has no
    derivative, and OpenSim draws splines through it.
    """
    columns, values = [], []
    for segment, wrench in feet.items():
        cop = wrench.cop(height=0.0, threshold=COP_FORCE)
        known = np.isfinite(cop).all(axis=1)
        middle = cop[known].mean(axis=0) if known.any() else np.zeros(3)
        point = np.broadcast_to(middle, (wrench.time.size, 3))
        torque = wrench_about_point(wrench.value, point)[:, 3:]
        columns += [f"{segment}_{part}{axis}" for part in ("force_v", "force_p", "torque_") for axis in "xyz"]
        # Rows times R are R' of each vector: from z up back to y up.
        values += [part @ Y_UP_TO_Z_UP for part in (wrench.force, point, torque)]
    return TimeTable(name, tuple(columns), next(iter(feet.values())).time, np.hstack(values))


def external_loads(segments: tuple[str, ...], *, data_file: str) -> str:
    """Return ExternalLoads.xml: the columns of `ground_table` in ``data_file`` on their segments, in the ground."""
    root = Element("OpenSimDocument", Version=_VERSION)
    loads = SubElement(root, "ExternalLoads", name="ground")
    objects = SubElement(loads, "objects")
    for segment in segments:
        force = SubElement(objects, "ExternalForce", name=f"ground_on_{segment}")
        _say(force, applied_to_body=segment, force_expressed_in_body="ground", point_expressed_in_body="ground")
        _say(force, force_identifier=f"{segment}_force_v", point_identifier=f"{segment}_force_p")
        _say(force, torque_identifier=f"{segment}_torque_", data_source_name="Unassigned")
    _say(loads, datafile=data_file)
    return _text(root)


def inverse_dynamics_setup(
    name: str, *, model: str, coordinates: str, loads: str, between: tuple[float, float], out: str
) -> str:
    """Return the set-up of OpenSim's InverseDynamicsTool: files relative to its own, times s; no filter, since the
    coordinates are smooth already.
    """
    root = Element("OpenSimDocument", Version=_VERSION)
    tool = SubElement(root, "InverseDynamicsTool", name=name)
    _say(tool, results_directory=".", model_file=model, time_range=f"{between[0]:.10g} {between[1]:.10g}")
    _say(tool, forces_to_exclude="Muscles", external_loads_file=loads, coordinates_file=coordinates)
    _say(tool, lowpass_cutoff_frequency_for_coordinates="-1", output_gen_force_file=out)
    return _text(root)


def _say(parent: Element, **values: str) -> None:
    for tag, value in values.items():
        SubElement(parent, tag).text = value


def _text(root: Element) -> str:
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


VERSION = "1.10.0"
COMPONENTS = ("x", "y", "z")

_LAB_FRAME = {
    "lab": {"Description": "x and y horizontal, z up, right-handed", "RotationRule": "right-hand"},
    "joint": {"Description": "axes of the ISB, anatomical signs", "RotationRule": "right-hand"},
}
"""Reference frames that channels name."""


@dataclass(frozen=True, eq=False)
class BidsChannels:
    """Columns of one ``_motion.tsv``: ``values`` (T, C) over ``time`` (T,) s, NaN = not known; ``rows`` (C) of name,
    component, type, tracked point, unit and reference frame.
    """

    time: Array
    values: Array
    rows: Sequence[tuple[str, str, str, str, str, str]]

    def __post_init__(self) -> None:
        if len(self.rows) != np.shape(self.values)[1]:
            raise BiodanceError(f"BidsChannels: {len(self.rows)} rows for {np.shape(self.values)[1]} columns.")
        freeze(self, "BidsChannels", values=(self.time.size, None))


def bids_label(name: str) -> str:
    """Return a name as a BIDS label: letters and digits only."""
    return re.sub(r"[^0-9A-Za-z]", "", name) or "unnamed"


def write_description(folder: Path, name: str, *, derived_by: Mapping[str, str] | None = None) -> Path:
    """Write ``dataset_description.json``; ``derived_by`` Name and Version of the program for a derivative."""
    about: dict[str, Any] = {"Name": name, "BIDSVersion": VERSION, "DatasetType": "derivative" if derived_by else "raw"}
    if derived_by:
        about["GeneratedBy"] = [dict(derived_by)]
    return _json(folder / "dataset_description.json", about)


def write_participants(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write ``participants.tsv`` with one row a participant; None and NaN are n/a."""
    lines = ["\t".join(rows[0]), *("\t".join(_cell(value) for value in row.values()) for row in rows)]
    return write_whole(folder / "participants.tsv", ("\n".join(lines) + "\n").encode())


def _cell(value: object) -> str:
    """Return a value as text; n/a where it is not known."""
    unknown = value is None or (isinstance(value, float) and np.isnan(value))
    return "n/a" if unknown else str(value)


def write_motion(folder: Path, stem: str, channels: BidsChannels, *, task: str, about: Mapping[str, Any]) -> None:
    """Write ``stem_motion.tsv``, ``_channels.tsv``, ``_channels.json`` and ``_motion.json`` into a folder that exists.

    Raises
    ------
    FileRefused
        A file exists or cannot be written.
    """
    lines = ("\t".join("n/a" if np.isnan(v) else f"{v:.7g}" for v in row) for row in channels.values)
    write_whole(folder / f"{stem}_motion.tsv", ("\n".join(lines) + "\n").encode())
    titles = ("name", "component", "type", "tracked_point", "units", "reference_frame")
    table = "\n".join("\t".join(row) for row in (titles, *channels.rows))
    write_whole(folder / f"{stem}_channels.tsv", (table + "\n").encode())
    _json(folder / f"{stem}_channels.json", {"reference_frame": {"Levels": _LAB_FRAME}})
    types = [row[2] for row in channels.rows]
    counts = {f"{kind}ChannelCount": types.count(kind) for kind in dict.fromkeys(types)}
    rate, frames = rate_of(channels.time), channels.time.size
    told = {
        "TaskName": task,
        "SamplingFrequency": rate,
        "MotionChannelCount": len(types),
        **counts,
        "TrackedPointsCount": len({row[3] for row in channels.rows}),
        "RecordingType": "continuous",
        "RecordingDuration": float(frames / rate) if frames > 1 else 0.0,
        "MissingValues": "n/a",
    }
    _json(folder / f"{stem}_motion.json", told | dict(about))


def write_events(folder: Path, stem: str, events: Sequence[tuple[float, str]]) -> Path:
    """Write ``stem_events.tsv``: onset s from the first frame, duration 0, trial type."""
    lines = ["onset\tduration\ttrial_type", *(f"{onset:.6g}\t0\t{kind}" for onset, kind in events)]
    return write_whole(folder / f"{stem}_events.tsv", ("\n".join(lines) + "\n").encode())


def _json(path: Path, content: Mapping[str, Any]) -> Path:
    return write_whole(path, (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode())
