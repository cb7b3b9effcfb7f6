"""What a C3D file says, in its own unit and axes: bytes made safe, markers and model outputs told apart."""

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.c3d.declared import texts
from biodance.lab.c3d.layout import Layout, read_layout
from biodance.lab.c3d.length import metres_per_unit
from biodance.lab.c3d.numbers import Numbers, read_numbers, second_opinion
from biodance.lab.c3d.parameters import RESAVE, Parameters, read_header, read_parameters
from biodance.lab.plain_text import refuse_huge
from biodance.records import Array, any_coordinate, spread_frames

_FRAMES = 4096
"""Frames looked at at once: little memory, however long the recording."""

GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS", "MODELED_MARKERS")
"""Parameters of POINT in which the results are listed; POINT:TYPE_GROUPS may name more."""

_RESULT = re.compile(r"(Angles?|Forces?|Moments?|Powers?|GRF|Cent(re|er)OfMass(Floor)?)$")
_BONE = re.compile(r"(?P<bone>.{3,})[OALP]$")
_UNLABELLED = re.compile(r"^(\*\d*|[Uu]\d+|[Uu]nlabell?ed.*|[Uu]ncertain.*)?$")


def split_label(label: str) -> tuple[str, str]:
    """Return prefix ("" = none) and name of a label such as ``Subject:LASI``."""
    prefix, colon, name = label.rpartition(":")
    return (prefix.strip(), name.strip()) if colon else ("", label.strip())


def model_outputs(labels: Sequence[str], parameters: Parameters) -> tuple[int, ...]:
    """Return the columns that hold results of a model: listed in a group of POINT, named like one (``LKneeAngles``), or
    bone axes.

    The axes of a bone are four points whose names differ in the last letter: origin, anterior, lateral, proximal
    (``PELO``, ``PELA`` ...).
    """
    declared = {group.upper() for group in texts(parameters, "POINT", "TYPE_GROUPS")[::2]} - {"MARKERS", "LABELS"}
    listed = {label for group in declared | set(GROUPS) for label in texts(parameters, "POINT", group)}
    listed |= {split_label(label)[1] for label in listed}
    bones = Counter(match["bone"] for label in set(labels) if (match := _BONE.match(label)))
    found = []
    for column, label in enumerate(labels):
        name, bone = split_label(label)[1], _BONE.match(label)
        if {label, name} & listed or _RESULT.search(name) or (bone and bones[bone["bone"]] == 4):
            found.append(column)
    return tuple(found)


def unlabelled(labels: Sequence[str]) -> tuple[int, ...]:
    """Return the columns without a name, or with the name that software gives to unlabelled trajectories (``*115``)."""
    return tuple(column for column, label in enumerate(labels) if _UNLABELLED.match(split_label(label)[1]))


_LEAP = 1.0
"""m along one axis; no marker on a person moves further between two frames, at any rate in use."""


@dataclass(frozen=True, eq=False)
class RawC3d:
    """One C3D file as stored.

    ``points`` (T, K, 3) in file units and file axes, NaN = not seen; ``rate`` Hz, NaN = none; ``first_frame`` number of
    the first frame; ``analog`` (S, C) scaled as the file says, ``(number - OFFSET) * SCALE * GEN_SCALE``;
    ``analog_rate`` Hz, NaN = none; ``analog_units`` (C) as written ("" = none). ``parameters[GROUP][NAME]`` (upper
    case): arrays with the file's own dimensions, first dimension fastest, or lists of stripped strings. ``reader``
    names who agrees on the numbers, "biodance" or "biodance, ezc3d"; ``warnings`` say where the file contradicts itself
    or smells of a misread, and how that was decided, ``history`` what was decided without doubt; ``layout`` says how
    the numbers were stored (None = by no file).
    """

    path: Path
    sha256: str
    reader: str
    labels: tuple[str, ...]
    points: NDArray[Any]
    rate: float
    first_frame: int
    analog: NDArray[Any]
    analog_labels: tuple[str, ...]
    analog_units: tuple[str, ...]
    analog_rate: float
    parameters: Parameters
    warnings: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    layout: Layout | None = None

    @cached_property
    def split_labels(self) -> tuple[tuple[str, str], ...]:
        """Prefix ("" = none) and name of every point (`split_label`)."""
        return tuple(split_label(label) for label in self.labels)

    @cached_property
    def outputs(self) -> tuple[int, ...]:
        """The columns of points that are results of a model (`model_outputs`)."""
        return model_outputs(self.labels, self.parameters)

    @cached_property
    def nameless(self) -> frozenset[int]:
        """The columns of points without a name (`unlabelled`)."""
        return frozenset(unlabelled(self.labels))


def read_raw(path: str | Path) -> RawC3d:
    """Read the bytes of a C3D file (Intel, DEC, SGI/MIPS; integer and float) without interpreting units, axes or
    plates.

    Raises
    ------
    FileRefused
        The path is no readable file, no C3D file, or a C3D file that is damaged, cut off or contradicts itself.
    """
    path = Path(path)
    content, parameters, layout, history = open_c3d(path)
    points, analog = numbers = read_numbers(content, layout)
    labels = point_labels(parameters, layout)
    smells, reader = _smells(numbers, labels, layout, parameters, path)
    for values in numbers:
        values.setflags(write=False)
    return RawC3d(
        path=path,
        sha256=hashlib.sha256(content).hexdigest(),
        reader=reader,
        labels=labels,
        points=points,
        rate=layout.rate,
        first_frame=layout.first_frame,
        analog=analog,
        analog_labels=_fit(texts(parameters, "ANALOG", "LABELS"), layout.channels),
        analog_units=_fit(texts(parameters, "ANALOG", "UNITS"), layout.channels),
        analog_rate=layout.analog_rate,
        parameters=parameters,
        warnings=(*layout.notes, *layout.remarks, *smells),
        history=history,
        layout=layout,
    )


def open_c3d(path: Path) -> tuple[bytes, Parameters, Layout, tuple[str, ...]]:
    """Return the bytes of a C3D file, its parameters, where its numbers lie, none of which is read yet, and what was
    decided about parameters that stand there twice.

    Raises
    ------
    FileRefused
        As `read_raw`.
    """
    refuse_huge(path)
    try:
        content = path.read_bytes()
    except IsADirectoryError as error:
        raise FileRefused(
            f"{path}: this is a folder, not a C3D file. Name one file, or inspect the folder as a session."
        ) from error
    except FileNotFoundError as error:
        raise FileRefused(f"{path}: there is no such file. Check the path.") from error
    except OSError as error:
        raise FileRefused(f"{path}: the file cannot be opened ({error.strerror}). Check the permissions.") from error
    header = read_header(content, str(path))
    parameters, said = read_parameters(content, header, str(path))
    poses = segment_poses(parameters)
    if poses and not header.points and not header.analog_values:
        raise FileRefused(f"{path}: {poses}")
    return content, parameters, read_layout(content, header, parameters, str(path)), said


def segment_poses(parameters: Parameters) -> str:
    """Return the sentence about the segment poses (group ROTATION) of a file without points; "" where it has none."""
    poses = [label.removesuffix("_4X4") for label in texts(parameters, "ROTATION", "LABELS") if label]
    if not poses:
        return ""
    return (
        f"holds {len(poses)} segment poses ({', '.join(poses[:4])} ...), as markerless systems (Theia) write them, and "
        f"no markers. The file is sound, but biodance follows markers and does not read poses: record markers, or let "
        f"the markerless software write its landmarks as points, too."
    )


def point_labels(parameters: Parameters, layout: Layout) -> tuple[str, ...]:
    """Return the label of every point as written, "" = none."""
    return _fit(texts(parameters, "POINT", "LABELS"), layout.points)


def _smells(
    numbers: Numbers, labels: tuple[str, ...], layout: Layout, parameters: Parameters, path: Path
) -> tuple[tuple[str, ...], str]:
    """Have suspicious numbers judged by a second reader; return its judgement and who agrees, or refuse."""
    no_markers = {*model_outputs(labels, parameters), *unlabelled(labels)}
    markers = [column for column in range(layout.points) if column not in no_markers]
    leaps = _leaps(numbers[0], markers, parameters)
    if not leaps and not layout.notes:
        return (), "biodance"
    opinion = second_opinion(path, numbers, layout)
    jump = f"Markers jump by more than {_LEAP:g} m between two frames in {leaps} places"
    smell = jump if leaps else "Header and parameters disagree"
    if opinion == "refuted":
        raise FileRefused(
            f"{path}: {smell[0].lower()}{smell[1:]}, and ezc3d reads other numbers than biodance. {RESAVE}"
        )
    if opinion == "confirmed":
        return (f"{smell}; ezc3d finds the same numbers.",), "biodance, ezc3d"
    return (f"{smell}; {opinion}, so only biodance has read these numbers.",), "biodance"


def _leaps(points: Array, markers: list[int], parameters: Parameters) -> int:
    """Return how often a marker, one of these columns of ``points``, moves by more than a metre between two frames in
    which it is seen; 0 if the unit is not known.
    """
    try:
        metre = 1.0 / metres_per_unit(parameters, spread_frames(points)[:, markers], where="")[0]
    except FileRefused:
        return 0
    found = 0
    for start in range(0, len(points), _FRAMES):
        step = np.abs(np.diff(points[start : start + _FRAMES + 1, markers], axis=0))
        found += int(np.count_nonzero(any_coordinate(step > _LEAP * metre)))
    return found


def _fit(names: list[str], count: int) -> tuple[str, ...]:
    """Return exactly ``count`` names: surplus ones dropped, missing ones empty."""
    return tuple(names[:count] + [""] * (count - len(names)))
