"""Copies of a C3D recording: with results inside, or with markers that have each other's names."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from biodance.child_process import run_python
from biodance.errors import BiodanceError, FileRefused
from biodance.lab.c3d import label_rows, read_header
from biodance.lab.c3d.layout import texts
from biodance.lab.c3d.raw import RawC3d, open_c3d, point_labels, read_raw, split_label
from biodance.lab.c3d.write import FileValue
from biodance.lab.plain_text import refuse_present, write_whole
from biodance.lab.readers.c3d import file_frame
from biodance.records import Array, assign, frozen_array

_Kind = Literal["ANGLES", "FORCES", "MOMENTS", "POWERS", "MODELED_MARKERS"]
_UNITS = {"ANGLES": "deg", "FORCES": "N", "MOMENTS": "Nm", "POWERS": "W"}
"""Unit of a kind of results where the parameter of POINT (`_unit_name`) declares none."""
_PER_SI = {"deg": 180 / np.pi, "rad": 1.0, "N": 1.0, "Nm": 1.0, "Nmm": 1000.0, "W": 1.0}
"""How many of a file's unit one SI unit is."""


@dataclass(frozen=True, eq=False)
class Output:
    """One result over the frames of the trial, as C3D stores it: a point with three components.

    ``label`` of the point; ``kind`` the parameter of POINT that lists it; ``value`` (T, 3) rad, N, N·m, W or m, NaN =
    none; ``about`` what the three components are. ``turns`` True for vectors of the lab frame, which are written in the
    file's axes.
    """

    label: str
    kind: _Kind
    value: Array
    about: str
    turns: bool = True

    def __post_init__(self) -> None:
        assign(self, value=frozen_array(self.value, (None, 3), f"Output {self.label}"))


@dataclass(frozen=True)
class Event:
    """One event: ``time`` s from the first frame of the recording, ``context`` "Right", "Left" or "General",
    ``label`` "Foot Strike" ...
    """

    time: float
    context: str
    label: str


def write_results_c3d(
    path: str | Path,
    original: str | Path,
    *,
    outputs: Sequence[Output],
    events: Sequence[Event] = (),
    parameters: Mapping[str, FileValue] | None = None,
    subject: str | None = None,
) -> Path:
    """Write a copy of the C3D file ``original`` that holds ``outputs`` and ``events`` besides, and return its path.

    Points, analog values and parameters of the original stay as they are. Positions are in the file's unit of length,
    angles, forces and moments in the units that POINT declares (without any: deg, N, N·m); ``BIODANCE:LABELS``,
    ``UNITS`` and ``COMPONENTS`` say of every output what it is, and ``parameters`` are added to that group. ``subject``
    names the person where the file holds several.

    Raises
    ------
    FileRefused
        The original cannot be read, has other frames or has such labels already; ezc3d cannot copy it; or ``path``
        exists.
    """
    path, original = Path(path), Path(original)
    refuse_present(path)
    raw = read_raw(original)
    _refuse_unfitting(raw, outputs)
    metres, turn = file_frame(raw, subject=subject)
    units = [_unit(raw, output) for output in outputs]
    scaled = []
    for output, unit in zip(outputs, units, strict=True):
        value = output.value @ turn if output.turns else output.value
        scaled.append(value / metres if output.kind == "MODELED_MARKERS" else value * _PER_SI[unit])
    labels, kinds, about = ([getattr(o, name) for o in outputs] for name in ("label", "kind", "about"))
    said: dict[str, FileValue] = {"LABELS": labels, "UNITS": units, "COMPONENTS": about, **(parameters or {})}
    first = (raw.first_frame - 1) / raw.rate
    undeclared = [kind for kind in _UNITS if kind in kinds and not texts(raw.parameters, "POINT", _unit_name(kind))]
    question = {
        "labels": labels,
        "kinds": kinds,
        "units": {_unit_name(kind): _UNITS[kind] for kind in undeclared},
        "events": [[event.time + first, event.context, event.label] for event in events],
        "parameters": {name: np.asarray(value).tolist() for name, value in said.items()},
    }
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "results.c3d"
        np.save(Path(folder) / "values.npy", np.stack(scaled, axis=1) if scaled else np.empty((len(raw.points), 0, 3)))
        _run(original, made, question)
        _refuse_changed(raw, made)
        return write_whole(path, made.read_bytes())


def _refuse_unfitting(raw: RawC3d, outputs: Sequence[Output]) -> None:
    for output in outputs:
        if len(output.value) != len(raw.points):
            raise FileRefused(
                f"{raw.path}: has {len(raw.points)} frames, {output.label} has {len(output.value)}. Give the trial's "
                f"own file."
            )
        if output.label in raw.labels:
            raise FileRefused(
                f"{raw.path}: has a point {output.label} already. Give the recording as it was before results were "
                f"written."
            )
    if not raw.rate > 0:
        raise FileRefused(
            f"{raw.path}: has no frame rate, so results have no place in it. Export the trial with its markers."
        )


def _unit(raw: RawC3d, output: Output) -> str:
    """Return the unit that the file declares for such results, if it is one we know, else our own."""
    if output.kind == "MODELED_MARKERS":
        return next(iter(texts(raw.parameters, "POINT", "UNITS")), "mm")
    own = _UNITS[output.kind]
    declared = next(iter(texts(raw.parameters, "POINT", _unit_name(output.kind))), own)
    declared = declared.replace(".", "").replace(" ", "")
    return declared if declared in _PER_SI else own


def _unit_name(kind: str) -> str:
    """Return the parameter of POINT that says in which unit a kind of results is, ``ANGLE_UNITS``."""
    return f"{kind.removesuffix('S')}_UNITS"


def _run(original: Path, made: Path, question: Mapping[str, Any]) -> None:
    """Have the child write the copy; whatever goes wrong in it refuses the file."""
    words, asked = ("-m", "biodance.lab.c3d.results", str(original), str(made)), json.dumps(question).encode()
    try:
        # 300.0 s after which the child is given up
        child = run_python(*words, input=asked, timeout=300.0)
    except (subprocess.TimeoutExpired, OSError) as error:
        raise FileRefused(
            f"{original}: ezc3d gives no copy of it ({error}). Export the trial again from the recording software."
        ) from error
    if child.returncode:
        lines = child.stderr.decode(errors="replace").strip().splitlines()
        why = lines[-1] if child.returncode > 0 and lines else f"it crashes, code {child.returncode}"
        raise FileRefused(
            f"{original}: ezc3d cannot copy it ({why}). Export the trial again from the recording software."
        )


def _refuse_changed(raw: RawC3d, made: Path) -> None:
    """Refuse a copy in which our reader does not find the numbers of the original."""
    copy = read_raw(made)
    count = raw.points.shape[1]
    same = (
        np.array_equal(copy.points[:, :count].astype("f4"), raw.points.astype("f4"), equal_nan=True)
        and np.array_equal(copy.analog.astype("f4"), raw.analog.astype("f4"), equal_nan=True)
        and (copy.labels[:count], copy.analog_labels, copy.rate, copy.first_frame)
        == (raw.labels, raw.analog_labels, raw.rate, raw.first_frame)
    )
    if not same:
        raise FileRefused(
            f"{raw.path}: the copy that ezc3d wrote holds other numbers, so it was thrown away. Export csv or mot "
            f"instead."
        )


def _copy(original: str, made: str, question: dict[str, Any]) -> None:
    """Write the copy: the child's part. Results become points; where there is none the residual is -1."""
    import ezc3d

    file = ezc3d.c3d(original)
    point = file["parameters"]["POINT"]
    continued = {f"{name}{tail}": name for name in ("LABELS", "UNITS", "DESCRIPTIONS") for tail in range(2, 100)}
    taken = {key: point.pop(key, {"value": []})["value"] for key in continued}  # ezc3d writes continuations anew
    labels = [*point["LABELS"]["value"], *(text for key in taken if continued[key] == "LABELS" for text in taken[key])]
    point["LABELS"]["value"] = [*labels, *question["labels"]]
    values = np.load(Path(made).with_name("values.npy"))
    data, seen = file["data"], np.isfinite(values).all(axis=2).T
    added = np.ones((4, *seen.shape))
    added[:3] = np.where(seen, np.moveaxis(values, (2, 1, 0), (0, 1, 2)), 0.0)
    meta = data["meta_points"]
    data["points"] = np.concatenate([data["points"], added], axis=1)
    meta["residuals"] = np.concatenate([meta["residuals"], np.where(seen, 0.0, -1.0)[None]], axis=1)
    meta["camera_masks"] = np.concatenate([meta["camera_masks"], np.zeros((7, *seen.shape), dtype=bool)], axis=1)
    for kind in dict.fromkeys(question["kinds"]):
        new = [label for label, own in zip(question["labels"], question["kinds"], strict=True) if own == kind]
        file.add_parameter("POINT", kind, [*(point[kind]["value"] if kind in point else []), *new])
    for name, unit in question["units"].items():
        file.add_parameter("POINT", name, [unit])
    for name, value in question["parameters"].items():
        file.add_parameter("BIODANCE", name, value)
    _add_events(file, question["events"])
    file.write(made)


def _add_events(file: Any, events: list[Any]) -> None:
    """Add the events that the file does not have yet."""
    group = file["parameters"].get("EVENT", {})
    known = []
    if "TIMES" in group and np.size(group["TIMES"]["value"]):
        minutes, seconds = np.reshape(group["TIMES"]["value"], (2, -1))
        known = list(zip(60 * minutes + seconds, group["CONTEXTS"]["value"], group["LABELS"]["value"], strict=False))
    elif events and group:
        del file["parameters"]["EVENT"]  # a group without any event, often without the parameters that events need
    for time, context, label in events:
        if not any(abs(time - when) < 0.1 and (context, label) == (side, name) for when, side, name in known):
            file.add_event([float(time // 60), float(time % 60)], context=context, label=label, description="biodance")


def write_exchanged(source: Path, target: Path, exchanged: Mapping[tuple[str, str], Sequence[tuple[int, int]]]) -> Path:
    """Write ``source`` to ``target`` with the two markers of each pair of labels ``exchanged`` in frames (start, stop),
    stop excluded; return the path. Every other byte is as in the recording.

    Where all frames are exchanged the labels change places (the subject's prefix stays), else the points do.

    Raises
    ------
    FileRefused
        The source is no C3D file or lacks a label, or the target exists or cannot be written.
    """
    content, parameters, layout, _ = open_c3d(source)
    columns = {split_label(label)[1]: column for column, label in enumerate(point_labels(parameters, layout))}
    changed, names = bytearray(content), dict[str, str]()
    word = 4 if layout.floating else 2
    row = word * (4 * layout.points + layout.channels * layout.samples)
    # every frame as bytes, in the place where it lies
    frames = np.frombuffer(changed, dtype=np.uint8, count=layout.frames * row, offset=layout.start)
    frames = frames.reshape(layout.frames, row)
    for pair, spans in exchanged.items():
        if absent := [label for label in pair if label not in columns]:
            raise FileRefused(
                f"{source}: holds no point {absent[0]}, so it cannot be exchanged. Name one of its points."
            )
        if tuple(spans) == ((0, layout.frames),):
            names |= {pair[0]: pair[1], pair[1]: pair[0]}
        else:
            # coordinates and residual of both
            one, other = (frames[:, 4 * word * columns[label] : 4 * word * (columns[label] + 1)] for label in pair)
            for start, stop in spans:
                one[start:stop], other[start:stop] = other[start:stop].copy(), one[start:stop].copy()
    for start, width in label_rows(content, read_header(content, str(source)), str(source)):
        prefix, name = split_label(content[start : start + width].decode("latin-1").split("\0")[0])
        if name in names:
            label = f"{prefix}:{names[name]}" if prefix else names[name]
            changed[start : start + width] = label.encode("latin-1").ljust(width)[:width]
    target.parent.mkdir(parents=True, exist_ok=True)
    return write_whole(target, bytes(changed))


if __name__ == "__main__":
    try:
        _copy(sys.argv[1], sys.argv[2], json.load(sys.stdin))
    except (BiodanceError, ArithmeticError, LookupError, TypeError, ValueError, RuntimeError, OSError) as error:
        sys.exit(" ".join(str(error).split())[:200] or type(error).__name__)
