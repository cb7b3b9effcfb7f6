"""What a C3D file says, in its own units and axes: bytes made safe, nothing interpreted yet."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.c3d_layout import read_layout, texts
from biodance.lab.c3d_numbers import read_numbers
from biodance.lab.c3d_parameters import Parameters, read_header, read_parameters
from biodance.lab.model_outputs import model_outputs, unlabelled


@dataclass(frozen=True, eq=False)
class RawC3d:
    """One C3D file as stored.

    ``points`` (T, K, 3) in file units and file axes, NaN = not seen; ``rate`` Hz, NaN = none; ``first_frame`` number of the first frame;
    ``analog`` (S, C) scaled as the file says, ``(number - OFFSET) * SCALE * GEN_SCALE``; ``analog_rate`` Hz, NaN = none;
    ``analog_units`` (C) as written ("" = none). ``parameters[GROUP][NAME]`` (upper case): arrays with the file's own dimensions, first
    dimension fastest, or lists of stripped strings. ``reader`` names the library that read the numbers, ``notes`` why it was chosen;
    ``warnings`` say where the file contradicts itself and how that was decided.
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
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def read_raw(path: str | Path) -> RawC3d:
    """Read the bytes of a C3D file (Intel, DEC, SGI/MIPS; integer and float) without interpreting units, axes or plates.

    Raises
    ------
    FileRefused
        The path is no readable file, no C3D file, or a C3D file that is damaged, cut off or contradicts itself.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except IsADirectoryError as error:
        raise FileRefused(f"{path}: this is a folder, not a C3D file. Name one file, or inspect the folder as a session.") from error
    except FileNotFoundError as error:
        raise FileRefused(f"{path}: there is no such file. Check the path.") from error
    except OSError as error:
        raise FileRefused(f"{path}: the file cannot be opened ({error.strerror}). Check the permissions.") from error
    header = read_header(content, str(path))
    parameters = read_parameters(content, header, str(path))
    layout = read_layout(len(content), header, parameters, str(path))
    metre = {"m": 1.0, "cm": 100.0}.get("".join(texts(parameters, "POINT", "UNITS")[:1]).lower(), 1000.0)
    labels = _fit(texts(parameters, "POINT", "LABELS"), layout.points)
    no_markers = {*model_outputs(labels, parameters), *unlabelled(labels)}
    judged = tuple(column for column in range(layout.points) if column not in no_markers)
    reading = read_numbers(path, layout, judged=judged, metre=metre)
    for values in (reading.points, reading.analog):
        values.setflags(write=False)
    return RawC3d(
        path=path,
        sha256=hashlib.sha256(content).hexdigest(),
        reader=reading.reader,
        labels=labels,
        points=reading.points,
        rate=layout.rate,
        first_frame=layout.first_frame,
        analog=reading.analog,
        analog_labels=_fit(texts(parameters, "ANALOG", "LABELS"), layout.channels),
        analog_units=_fit(texts(parameters, "ANALOG", "UNITS"), layout.channels),
        analog_rate=layout.analog_rate,
        parameters=parameters,
        notes=reading.notes,
        warnings=(*layout.notes, *reading.warnings),
    )


def _fit(names: list[str], count: int) -> tuple[str, ...]:
    """Return exactly ``count`` names: surplus ones dropped, missing ones empty."""
    return tuple(names[:count] + [""] * (count - len(names)))
