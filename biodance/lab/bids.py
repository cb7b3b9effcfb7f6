"""BIDS motion (BEP 029), https://bids-specification.readthedocs.io, version 1.10: one trial is a task of a subject;
``_motion.tsv`` (numbers without header), ``_channels.tsv`` (one row a column), ``_motion.json``, ``_events.tsv``.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.plain_text import write_whole
from biodance.records import Array, freeze
from biodance.records.arrays import rate_of

VERSION = "1.10.0"
COMPONENTS = ("x", "y", "z")
_LABEL = re.compile(r"[^0-9A-Za-z]")
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
    return _LABEL.sub("", name) or "unnamed"


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
