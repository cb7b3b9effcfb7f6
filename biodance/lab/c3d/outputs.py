"""Results of another program that a C3D file holds beside its markers: joint angles and events."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.lab.c3d.layout import texts
from biodance.lab.c3d.raw import RawC3d, read_raw, split_label
from biodance.records import Array

_SIDES = {"left": "left", "right": "right", "l": "left", "r": "right"}
_WORDS = {"foot strike": True, "foot off": False, "toe off": False, "heel strike": True}


@dataclass(frozen=True)
class FileEvent:
    """An event of the file: ``time`` s from its first frame, ``side``, ``down`` True for a strike."""

    time: float
    side: str
    down: bool


@dataclass(frozen=True, eq=False)
class FileOutputs:
    """``angles`` by label, (T, 3) deg, NaN = none; ``events`` of the feet in the order of time; ``program`` that says
    it wrote them, "" = not said.
    """

    angles: Mapping[str, Array]
    events: tuple[FileEvent, ...]
    program: str = ""


def read_outputs(path: str | Path) -> FileOutputs:
    """Return the joint angles and foot events of a C3D file; empty where it holds none.

    Raises
    ------
    FileRefused
        The file cannot be read.
    """
    raw = read_raw(path)
    listed = {split_label(label)[1] for label in texts(raw.parameters, "POINT", "ANGLES")}
    unit = next(iter(texts(raw.parameters, "POINT", "ANGLE_UNITS")), "deg")
    degrees = 180 / np.pi if unit.lower().startswith("rad") else 1.0
    angles = {}
    for column, label in enumerate(raw.labels):
        name = split_label(label)[1]
        if name in listed or name.endswith("Angles"):
            value = degrees * raw.points[:, column]
            angles[name] = np.where((value != 0).any(axis=1)[:, None], value, np.nan)
    said = [*texts(raw.parameters, "MANUFACTURER", "SOFTWARE"), *texts(raw.parameters, "MANUFACTURER", "COMPANY")]
    return FileOutputs(angles, _events(raw), " ".join(said[:1]))


def _events(raw: RawC3d) -> tuple[FileEvent, ...]:
    times = np.asarray(raw.parameters.get("EVENT", {}).get("TIMES", np.empty((2, 0))), dtype=float)
    times = times.reshape(2, -1, order="F") if times.ndim == 1 else times
    first = (raw.first_frame - 1) / raw.rate
    found = []
    words = zip(
        times.T, texts(raw.parameters, "EVENT", "CONTEXTS"), texts(raw.parameters, "EVENT", "LABELS"), strict=False
    )
    for (minutes, seconds), context, label in words:
        side, down = _SIDES.get(context.strip().lower()), _WORDS.get(label.strip().lower())
        if side is not None and down is not None:
            found.append(FileEvent(float(60 * minutes + seconds - first), side, down))
    return tuple(sorted(found, key=lambda one: one.time))
