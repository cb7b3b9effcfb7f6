"""Look up what a C3D file declares: numbers and texts of its parameters, and how many frames it holds. Header,
POINT:FRAMES, POINT:LONG_FRAMES and the TRIAL group say that, each in 16 bits or more; where all stop at what 16 bits
hold, the length of the file.
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.lab.c3d.parameters import C3D_BLOCK, Header, Parameters, ParameterValue

_CLIPPED = 65535
"""What the 16-bit frame numbers hold in a recording that is longer; the full number then stands in the TRIAL group
or LONG_FRAMES, or the length of the file alone tells it.
"""


def parameter_numbers(parameters: Parameters, group: str, name: str) -> NDArray[Any]:
    """Return a numeric parameter flattened to (n,), continued in NAME2, NAME3 ... beyond 255 entries; empty if
    missing or text.
    """
    family = _continued(parameters, group, name)
    arrays = [np.ravel(value, order="F") for value in family if isinstance(value, np.ndarray)]
    return np.concatenate(arrays) if arrays else np.empty(0)


def texts(parameters: Parameters, group: str, name: str) -> list[str]:
    """Return a text parameter, continued in NAME2, NAME3 ... beyond 255 entries; empty if missing or numeric."""
    return [text for value in _continued(parameters, group, name) if isinstance(value, list) for text in value]


def _continued(parameters: Parameters, group: str, name: str) -> list[ParameterValue]:
    """Return the values of a parameter and of its continuations NAME2, NAME3 ..."""
    found = parameters.get(group, {})
    return [found[name + tail] for tail in ("", *map(str, range(2, 100))) if name + tail in found]


def scalar(parameters: Parameters, group: str, name: str) -> float:
    """Return the first number of a parameter; NaN if it is missing, empty or not finite."""
    values = parameter_numbers(parameters, group, name)
    return float(values[0]) if values.size and np.isfinite(values[0]) else math.nan


def distinct(values: Iterable[float]) -> list[int]:
    """Return the distinct finite values >= 0 as integers, in order."""
    return list(dict.fromkeys(int(v) for v in values if math.isfinite(v) and v >= 0))


def _unsigned(value: float) -> float:
    """Return a frame number that was stored in 16 bits without its sign."""
    return value + 65536 if -32768 <= value < 0 else value


def frame_counts(header: Header, parameters: Parameters) -> list[int]:
    """Return all frame counts that the file declares: header, TRIAL fields, POINT:FRAMES, POINT:LONG_FRAMES; those
    that end at the most that 16 bits hold tell nothing.
    """
    first, last = (_field(parameters, name) for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"))
    spans = ((float(header.first_frame), float(header.last_frame)), (first, last))
    declared = [to - start + 1 for start, to in spans if to != _CLIPPED]
    declared += [_unsigned(scalar(parameters, "POINT", name)) for name in ("FRAMES", "LONG_FRAMES")]
    return [count for count in distinct(declared) if count not in (0, _CLIPPED)]


def is_clipped(header: Header, parameters: Parameters) -> bool:
    """Return whether a count of frames ends at the most that 16 bits hold."""
    return header.last_frame == _CLIPPED or _unsigned(scalar(parameters, "POINT", "FRAMES")) == _CLIPPED


def frames_held(content: bytes, start: int, width: int, first: int, remarks: list[str]) -> int:
    """Return how many frames of ``width`` bytes the file holds from byte ``start`` on, at least those from number
    ``first`` on that 16 bits tell, and say in ``remarks`` that the length decided. Zeros that fill the last block are
    no frames.
    """
    size, least = len(content) - start, _CLIPPED - first + 1
    held = size // max(width, 1)
    while held > least and size - (held - 1) * width < C3D_BLOCK and not any(content[start + (held - 1) * width :]):
        held -= 1
    behind = size - held * width
    cut = f" {behind} bytes behind them were left: the file may be cut off." if behind >= C3D_BLOCK else ""
    remarks.append(
        f"Header, POINT:FRAMES and TRIAL stop at {_CLIPPED} frames, the most that 16 bits hold; the length of the file "
        f"decides: {held} frames were read.{cut}"
    )
    return max(held, least)


def _field(parameters: Parameters, name: str) -> float:
    """Return a frame number stored as two 16-bit words (low, high) in the TRIAL group; NaN if it is missing."""
    words = parameter_numbers(parameters, "TRIAL", name)
    if words.size == 0 or not np.all(np.isfinite(words)):
        return math.nan
    return _unsigned(float(words[0])) + 65536 * (_unsigned(float(words[1])) if words.size > 1 else 0)


def first_frame_number(header: Header, parameters: Parameters, frames: int, notes: list[str]) -> int:
    """Return the number of the first frame."""
    first = _field(parameters, "ACTUAL_START_FIELD")
    spans = header.last_frame - header.first_frame + 1 == frames or header.last_frame == _CLIPPED
    if int(first) == header.first_frame if math.isfinite(first) else spans:
        return header.first_frame
    if not math.isfinite(first):
        notes.append(
            f"The first frame's number, {header.first_frame} in the header, does not fit its last one, "
            f"{header.last_frame}."
        )
        return header.first_frame
    last = _field(parameters, "ACTUAL_END_FIELD")
    if last - first + 1 == frames and header.last_frame - header.first_frame + 1 != frames:
        return int(first)
    notes.append(
        f"The first frame is {header.first_frame} in the header and {first:g} in TRIAL:ACTUAL_START_FIELD; the "
        f"header's is taken."
    )
    return header.first_frame
