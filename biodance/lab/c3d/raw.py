"""What a C3D file says, in its own unit and axes: bytes made safe, markers and model outputs told apart."""

import hashlib
import io
import math
import re
import subprocess
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.child_process import run_python
from biodance.errors import FileRefused
from biodance.lab.c3d import MIPS, RESAVE, Parameters, doubles, floats, read_header, read_parameters
from biodance.lab.c3d.layout import Layout, parameter_numbers, read_layout, texts
from biodance.lab.markers.upright import METRES, PERSON_SPAN, extents, likely_unit
from biodance.lab.plain_text import refuse_huge
from biodance.records import Array, any_coordinate, spread_frames

_Numbers = tuple[NDArray[Any], NDArray[Any]]
"""Points (T, K, 3) in file units with NaN = not seen, analog (T * samples, C) in units."""


def read_numbers(content: bytes, layout: Layout) -> _Numbers:
    """Return the points and analog values of the data section.

    A frame holds x, y, z and a word of residual and cameras for each point, then the analog samples, channel fastest;
    all 32-bit floats or all 16-bit integers. A point was not seen if its residual is negative, a coordinate is no
    finite number, or all three are zero. Source: C3D user guide, "3D point data" and "analog data".
    """
    words = layout.frames * (4 * layout.points + layout.channels * layout.samples)
    size = 4 if layout.floating else 2
    section = memoryview(content)[layout.start : layout.start + size * words]
    if layout.floating:
        rows = analog_rows = floats(section, layout.processor).reshape(layout.frames, -1)
    else:
        order = ">" if layout.processor == MIPS else "<"
        rows = np.frombuffer(section, dtype=order + "i2").reshape(layout.frames, -1)
        analog_rows = rows.view(order + "u2") if layout.unsigned else rows
    # x, y, z and the word of residual and cameras.
    quads = rows[:, : 4 * layout.points].reshape(layout.frames, layout.points, 4)
    points = doubles(quads[..., :3])
    if not layout.floating:
        points *= layout.scale
    seen = (quads[..., 3] >= 0) & ~any_coordinate(~np.isfinite(points)) & any_coordinate(points != 0)
    points[~seen] = np.nan
    rest = doubles(analog_rows[:, 4 * layout.points :])
    with np.errstate(invalid="ignore", over="ignore"):
        analog = rest.reshape(layout.frames * layout.samples, layout.channels) if layout.channels else np.empty((0, 0))
        # (number - offset) gain, in place.
        analog -= layout.offset
        analog *= layout.gain
    return points, analog


_PATIENCE = 60.0  # s after which the child is given up
READ = """
import io, sys, warnings
import ezc3d, numpy
warnings.simplefilter("ignore")
try:
    data = ezc3d.c3d(sys.argv[1])["data"]
except Exception as error:
    sys.exit(" ".join(str(error).split())[:120] or type(error).__name__)
points, analogs = data["points"], data["analogs"]
answer = io.BytesIO()  # not stdout itself: numpy asks a file for its position, and a pipe has none
numpy.save(answer, points[:3].transpose(2, 1, 0).astype("f4"))
numpy.save(answer, analogs[0].T.astype("f4"))
sys.stdout.buffer.write(answer.getvalue())
"""


def second_opinion(path: Path, numbers: _Numbers, layout: Layout) -> str:
    """Return "confirmed" if ezc3d reads the same numbers, "refuted" if it reads others, else why it does not read the
    file.

    ezc3d finds the layout on its own, so it also judges ours. Where header and parameters disagree it believes one of
    them without looking at the length of the file, as biodance does: no judgement. Left out are analog channels that
    ezc3d 1.7.2 is known to read wrong: those with a negative OFFSET, whose sign it loses, and unsigned integers, which
    it takes for signed ones.

    Parameters
    ----------
    path
        The file.
    numbers
        Points (T, K, 3) in file units, NaN = not seen, and analog (S, C), as biodance read them.
    layout
        How biodance understood the data section.
    """
    try:
        child = run_python("-c", READ, str(path), timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        return f"ezc3d gives no answer within {_PATIENCE:g} s"
    except OSError as error:
        return f"ezc3d cannot be started ({error.strerror})"
    if child.returncode < 0:
        return f"ezc3d crashes on the file (signal {-child.returncode})"
    if child.returncode:
        lines = child.stderr.decode(errors="replace").strip().splitlines()
        return f"ezc3d does not take the file ({lines[-1] if lines else f'exit code {child.returncode}'})"
    with io.BytesIO(child.stdout) as answer:
        points, analog = np.load(answer).astype(float), np.load(answer).astype(float)
    # without channels ezc3d still gives one row a frame
    ours = (numbers[0].shape, numbers[1].shape if numbers[1].size else (len(points), 0))
    if layout.notes and (points.shape, analog.shape) != ours:
        return (
            f"ezc3d believes the other of the two ({points.shape[1]} points, {analog.shape[1]} channels, "
            f"{len(points)} frames)"
        )
    seen = np.isfinite(numbers[0])  # where biodance saw no point, ezc3d may give any number
    same = points.shape == seen.shape and _same(numbers[0][seen], points[seen])
    judged = layout.offset >= 0
    if numbers[1].size and judged.any() and (layout.floating or not layout.unsigned):
        same = same and analog.shape == ours[1] and _same(numbers[1][:, judged], analog[:, judged])
    return "confirmed" if same else "refuted"


def _same(one: Array, other: Array) -> bool:
    size = np.abs(one[np.isfinite(one)]).max(initial=1.0)
    return np.allclose(one, other, rtol=1e-5, atol=1e-6 * size, equal_nan=True)


_METRES = {**METRES, "dm": 1e-1, "in": 0.0254}
_CORNERS = ("FORCE_PLATFORM", "CORNERS")


def metres_per_unit(
    parameters: Parameters, points: Array, *, where: str
) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """Return the length of one file unit in metres, history and warnings.

    ``points`` (T, K, 3) are the markers in file units. A missing or unknown unit, and one that would make the person or
    the plates smaller than 5 cm or larger than 4.75 m, is decided by sense among mm, cm and m, and said so.

    Raises
    ------
    FileRefused
        The unit is missing and neither markers nor plates tell it.
    """
    written = next(iter(texts(parameters, "POINT", "UNITS")), "")
    unit = re.sub(r"met(er|re)s?$", "m", written.strip(" .").casefold())
    unit = {"millim": "mm", "centim": "cm", "decim": "dm", "inch": "in", "inches": "in"}.get(unit, unit)
    size, expected, what = _size(parameters, points)
    # From the markers on a hand to a person who lies or leaps.
    if unit in _METRES and (math.isnan(size) or 0.05 <= size * _METRES[unit] <= 4.75):
        return _METRES[unit], (f"Lengths are in {unit} (POINT:UNITS).",), ()
    if math.isnan(size) and not np.isfinite(points).any() and not parameter_numbers(parameters, *_CORNERS).size:
        return _METRES["mm"], ("The file holds no lengths, so its unit of length does not matter.",), ()
    if math.isnan(size):
        raise FileRefused(
            f"{where}: POINT:UNITS is {written!r} and neither markers nor plates tell the unit of length (mm, cm or "
            "m). Write the unit into the file and read it again."
        )
    guess = likely_unit(size, expected)
    said = f"POINT:UNITS is {written!r}; {what} of {size:.4g} can only be in {guess}, so lengths are in {guess}."
    return _METRES[guess], (said,), (said + " Check the sizes in the report.",)


def _size(parameters: Parameters, points: Array) -> tuple[float, float, str]:
    """Return a length in file units, what it should be in metres, and its name; NaN if the file holds none."""
    sides = extents(spread_frames(points), 4)
    if len(sides):
        extent = float(np.median(sides.max(axis=1)))
        if 0 < extent < math.inf:
            return extent, PERSON_SPAN, "a cloud of markers"
    corners = parameter_numbers(parameters, *_CORNERS)
    if corners.size >= 12 and np.isfinite(corners).all():
        longest = float(np.linalg.norm(np.diff(corners[:12].reshape(4, 3), axis=0), axis=1).max())
        if 0 < longest < math.inf:
            # 0.6 m, the longest side of a force plate: 0.4 m to 1.2 m in the makers' sheets
            return longest, 0.6, "a plate side"
    return math.nan, PERSON_SPAN, ""


_FRAMES = 4096  # Frames looked at at once: little memory, however long the recording

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
    groups = {group.upper() for group in texts(parameters, "POINT", "TYPE_GROUPS")[::2]} - {"MARKERS", "LABELS"}
    groups |= {"ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS", "MODELED_MARKERS"}
    listed = {label for group in groups for label in texts(parameters, "POINT", group)}
    listed |= {split_label(label)[1] for label in listed}
    bones = Counter(match["bone"] for label in set(labels) if (match := _BONE.match(label)))
    found = []
    for column, label in enumerate(labels):
        name, bone = split_label(label)[1], _BONE.match(label)
        result = re.search(r"(Angles?|Forces?|Moments?|Powers?|GRF|Cent(re|er)OfMass(Floor)?)$", name)
        if {label, name} & listed or result or (bone and bones[bone["bone"]] == 4):
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
    case): arrays with the file's own dimensions, first dimension fastest, or lists of stripped strings.
    ``warnings`` say where the file contradicts itself or smells of a misread, and how that was decided, ``history``
    what was decided without doubt; ``layout`` says how the numbers were stored (None = by no file).
    """

    path: Path
    sha256: str
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
        """The columns of points without a name (`_UNLABELLED`)."""
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
    for values in numbers:
        values.setflags(write=False)
    raw = RawC3d(
        path=path,
        sha256=hashlib.sha256(content).hexdigest(),
        labels=point_labels(parameters, layout),
        points=points,
        rate=layout.rate,
        first_frame=layout.first_frame,
        analog=analog,
        analog_labels=_fit(texts(parameters, "ANALOG", "LABELS"), layout.channels),
        analog_units=_fit(texts(parameters, "ANALOG", "UNITS"), layout.channels),
        analog_rate=layout.analog_rate,
        parameters=parameters,
        warnings=(*layout.notes, *layout.remarks),
        history=history,
        layout=layout,
    )
    smell = _smell(raw, layout)
    return replace(raw, warnings=(*raw.warnings, smell)) if smell else raw


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


def _smell(raw: RawC3d, layout: Layout) -> str:
    """Have suspicious numbers judged by a second reader; return its judgement, or refuse; "" where nothing is odd."""
    no_markers = {*raw.outputs, *raw.nameless}
    markers = [column for column in range(layout.points) if column not in no_markers]
    points, leaps = raw.points, 0
    with suppress(FileRefused):  # where the unit is not known, no distance is
        metre = 1.0 / metres_per_unit(raw.parameters, spread_frames(points)[:, markers], where="")[0]
        for start in range(0, len(points), _FRAMES):
            step = np.abs(np.diff(points[start : start + _FRAMES + 1, markers], axis=0))
            leaps += int(np.count_nonzero(any_coordinate(step > _LEAP * metre)))
    if not leaps and not layout.notes:
        return ""
    opinion = second_opinion(raw.path, (points, raw.analog), layout)
    jump = f"Markers jump by more than {_LEAP:g} m between two frames in {leaps} places"
    smell = jump if leaps else "Header and parameters disagree"
    if opinion == "refuted":
        raise FileRefused(
            f"{raw.path}: {smell[0].lower()}{smell[1:]}, and ezc3d reads other numbers than biodance. {RESAVE}"
        )
    if opinion == "confirmed":
        return f"{smell}; ezc3d finds the same numbers."
    return f"{smell}; {opinion}, so only biodance has read these numbers."


def _fit(names: list[str], count: int) -> tuple[str, ...]:
    """Return exactly ``count`` names: surplus ones dropped, missing ones empty."""
    return tuple(names[:count] + [""] * (count - len(names)))
