"""The header and the parameter section of a C3D file, byte by byte, read trusting nothing.

Layout: header of 512 bytes; parameter section of groups and parameters, each ``name length, group id, name, offset to
the next record``; data section. Three byte orders: Intel (84), DEC (85) and SGI/MIPS (86). Source: C3D user guide
(www.c3d.org/docs), "parameter format".
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused

C3D_BLOCK = 512
INTEL, DEC, MIPS = 84, 85, 86
_PROCESSORS = {INTEL: "Intel", DEC: "DEC", MIPS: "SGI/MIPS"}
_SCALES, _RATES = (1e-9, 1e6), (1e-3, 1e6)
"""Believable magnitudes of the header's scale and rate (Hz): numbers of the wrong processor type are outside by far."""

_NEEDED = {
    "POINT": {"USED", "SCALE", "RATE", "DATA_START", "FRAMES", "LONG_FRAMES", "LABELS", "UNITS"},
    "ANALOG": {"USED", "LABELS", "GEN_SCALE", "SCALE", "OFFSET", "UNITS", "FORMAT", "RATE"},
    "TRIAL": {"ACTUAL_START_FIELD", "ACTUAL_END_FIELD"},
    "FORCE_PLATFORM": {"USED", "TYPE", "CHANNEL", "CORNERS", "ORIGIN", "ZERO", "CAL_MATRIX", "MATRIX_STORE"},
}
"""Parameters without which numbers or plates of a file cannot be read; all others may be left out."""
RESAVE = "Export the trial again from the recording software, or copy the file again from its source."

ParameterValue = NDArray[Any] | list[str]
Parameters = Mapping[str, Mapping[str, ParameterValue]]


@dataclass(frozen=True)
class Header:
    """The counts of the first 512 bytes of a C3D file; ``parameter_start`` and ``data_start`` are byte positions."""

    processor: int
    points: int
    analog_values: int
    first_frame: int
    last_frame: int
    scale: float
    analog_samples: int
    rate: float
    parameter_start: int
    data_start: int


def integers(content: bytes | memoryview, processor: int, kind: str = "u2") -> NDArray[Any]:
    """Return the bytes as integers of ``kind`` (``u2`` or ``i2``) in the byte order of the processor."""
    return np.frombuffer(content, dtype=(">" if processor == MIPS else "<") + kind)


def floats(content: bytes | memoryview, processor: int) -> NDArray[Any]:
    """Return the bytes as 32-bit floats (n,) in the processor's number format; DEC (VAX F) becomes IEEE."""
    if processor != DEC:
        return np.frombuffer(content, dtype=">f4" if processor == MIPS else "<f4")
    # VAX F has its two words the other way round and an exponent that is larger by two: a quarter of the IEEE value.
    words = np.frombuffer(content, dtype="<u2").reshape(-1, 2).astype(np.uint32)
    exponent = (words[:, 0] >> 7) & 0xFF  # 0: the value zero, or with a sign no number
    ieee = ((words[:, 0] << 16) | words[:, 1]).view(np.float32)
    with np.errstate(invalid="ignore"):
        reserved = np.where(words[:, 0] >> 15, np.float32(np.nan), np.float32(0))
        return np.where(exponent == 0, reserved, ieee * np.float32(0.25))


def doubles(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return the values as 64-bit floats; bits that are no number become NaN without a warning."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def read_header(content: bytes, where: str) -> Header:
    """Return the counts of the header.

    Raises
    ------
    FileRefused
        The bytes are no C3D header, or point outside the file.
    """
    if not content:
        raise FileRefused(f"{where}: the file is empty (0 bytes). {RESAVE}")
    if len(content) < 2 * C3D_BLOCK or content[1] != 0x50:
        short = len(content) < 2 * C3D_BLOCK
        seen = f"has {len(content)} bytes, and not 1024 at least" if short else "does not begin as one"
        raise FileRefused(
            f"{where}: this is not a C3D file: it {seen}. Check that it is a C3D export and not another format with "
            f"that name."
        )
    # Blocks are counted from 1.
    start = (content[0] - 1) * C3D_BLOCK
    if start < C3D_BLOCK or start + 4 > len(content):
        raise FileRefused(
            f"{where}: the header puts the parameter section into block {content[0]}, outside the file. {RESAVE}"
        )
    processor = content[start + 3]
    if processor not in _PROCESSORS:
        raise FileRefused(
            f"{where}: processor type {processor} is unknown (84 Intel, 85 DEC and 86 SGI/MIPS are legal). {RESAVE}"
        )
    words = [int(w) for w in integers(content[:24], processor)]
    scale, rate = (float(floats(content[at : at + 4], processor)[0]) for at in (12, 20))
    data_start = (words[8] - 1) * C3D_BLOCK
    if not start < data_start <= len(content):
        raise FileRefused(
            f"{where}: the header puts the data into block {words[8]}, but the file has only "
            f"{len(content) // C3D_BLOCK} blocks: it is damaged or was cut off. {RESAVE}"
        )
    if not (_SCALES[0] < abs(scale) < _SCALES[1] and (rate == 0 or _RATES[0] < rate < _RATES[1])):
        raise FileRefused(
            f"{where}: read as {_PROCESSORS[processor]} numbers, the header has a scale of {scale:g} and a rate of "
            f"{rate:g} Hz, which no lab has: it is damaged or its processor type is wrong. {RESAVE}"
        )
    return Header(processor, words[1], words[2], words[3], words[4], scale, words[9], rate, start, data_start)


def read_parameters(content: bytes, header: Header, where: str) -> tuple[Parameters, tuple[str, ...]]:
    """Return all parameters as ``parameters[GROUP][NAME]``, names in upper case as the standard asks, and a sentence
    for each that stands there twice with different values and was left out, because nothing needs it; of two of which
    one is zero, as what was never measured is, the other is kept.

    Text is a list of stripped strings; numbers are arrays with the dimensions of the file, first dimension fastest (so
    that ``CORNERS[i, j, plate]`` is coordinate i of corner j), a scalar has shape (1,).

    Raises
    ------
    FileRefused
        A record reaches beyond the section, overlaps the next one or skips bytes: a damaged section cannot be trusted.
        A parameter that is needed (counts, scales, labels, plates) stands there twice with different values.
    """
    names: dict[int, str] = {}
    records: list[tuple[int, str, ParameterValue]] = []
    for _, number, name, value in _records(content, header, where):
        if value is None:
            names[number] = name
        else:
            records.append((number, name, value))
    groups: dict[str, dict[str, ParameterValue]] = {name: {} for name in names.values()}
    twice: dict[tuple[str, str], list[ParameterValue]] = {}
    for number, name, value in records:
        group_name = names.get(number, f"GROUP {number}")
        first = groups.setdefault(group_name, {}).setdefault(name, value)
        if not _same(first, value):
            twice.setdefault((group_name, name), [first]).append(value)
    said = [_left_out(groups[group], group, name, values, where) for (group, name), values in twice.items()]
    return MappingProxyType({name: MappingProxyType(group) for name, group in groups.items()}), tuple(said)


def _left_out(known: dict[str, ParameterValue], group: str, name: str, values: list[ParameterValue], where: str) -> str:
    """Settle in its group, which is ``known``, a parameter with several ``values``; return the sentence about it."""
    listed = [value if isinstance(value, list) else np.ravel(value, order="F") for value in values]
    short = (", ".join(str(one) for one in some[:4]) for some in listed)
    twice = f"parameter {group}:{name} is there twice, as {' and as '.join(short)}"
    if name.rstrip("0123456789") in _NEEDED.get(group, ()):
        raise FileRefused(
            f"{where}: {twice}, and the file cannot be read without it. Delete the wrong one, for example in Mokka or "
            f"with ezc3d, or export the trial again from the recording software."
        )
    filled = [value for value in values if isinstance(value, list) or value.any()]
    del known[name]
    if len(filled) == 1:
        known[name] = filled[0]
        return f"{twice[0].upper()}{twice[1:]}; the one that is not zero was taken."
    return f"{twice[0].upper()}{twice[1:]}; neither was taken, and the file is read without it."


def _same(one: ParameterValue, other: ParameterValue) -> bool:
    if isinstance(one, list) or isinstance(other, list):
        return isinstance(one, list) and isinstance(other, list) and one == other
    return one.dtype.kind == other.dtype.kind and np.array_equal(one, other)


def label_rows(content: bytes, header: Header, where: str) -> list[tuple[int, int]]:
    """Return byte position and width of every label of a point: POINT:LABELS and its continuations LABELS2,
    LABELS3 ...

    Raises
    ------
    FileRefused
        As `read_parameters`.
    """
    records = list(_records(content, header, where))
    points = [number for _, number, name, value in records if value is None and name == "POINT"]
    rows = []
    for at, number, name, value in records:
        if number not in points or not isinstance(value, list) or name.rstrip("0123456789") != "LABELS":
            continue
        kind = at + 2 + abs(int(np.int8(np.uint8(content[at])))) + 2  # byte of the type, then that of the dimensions
        first = kind + 2 + content[kind + 1]
        width, *counts = content[kind + 2 : first] or (0,)
        rows += [(first + i * width, width) for i in range(math.prod(counts))] if content[kind + 1] else []
    return rows


def _records(content: bytes, header: Header, where: str) -> Iterator[tuple[int, int, str, ParameterValue | None]]:
    """Yield byte position, group number, name and value (None = a group) of every record of the parameter section."""
    section, at = content[: header.data_start], header.parameter_start + 4
    while at and at + 2 <= header.data_start and section[at] != 0 and section[at + 1] != 0:
        here = at
        at, number, name, value = _record(section, here, header.processor, where)
        yield here, number, name, value


def _record(section: bytes, at: int, processor: int, where: str) -> tuple[int, int, str, ParameterValue | None]:
    """Return the next record's place (0 = none), group number, name and value (None = a group) of one record."""
    length, group = (int(byte) for byte in np.frombuffer(section[at : at + 2], dtype=np.int8))
    body = at + 2 + abs(length)
    name = section[at + 2 : body].decode("utf-8", "replace").strip().upper()
    damaged = FileRefused(f"{where}: the parameter section is damaged at byte {at} (record {name!r}). {RESAVE}")
    if body + 3 > len(section):
        raise damaged
    offset = int(integers(section[body : body + 2], processor)[0])
    value: ParameterValue | None = None
    end = body + 2
    if group > 0:
        value, end = _value(section, body + 2, processor, damaged)
    if end >= len(section):
        raise damaged
    # Behind the value: the length of the description in a byte, and the description.
    end += 1 + section[end]
    following = body + offset if offset else 0
    # The two bytes of the pointer the other way round.
    swapped = (offset >> 8) | ((offset & 0xFF) << 8)  # so some software writes the last pointer of a MIPS file
    if processor == MIPS and following > len(section) and body + swapped == end:
        following = 0 if not any(section[end:]) else end
    if end > len(section) or (following and not (end <= following <= len(section) and not any(section[end:following]))):
        raise damaged
    return following, abs(group), name, value


def _value(section: bytes, at: int, processor: int, damaged: FileRefused) -> tuple[ParameterValue, int]:
    """Return the value of the parameter whose type byte is at ``at``, and the position after it."""
    kind = int(np.frombuffer(section[at : at + 1], dtype=np.int8)[0])
    first = at + 2 + (section[at + 1] if at + 1 < len(section) else 255)
    shape = tuple(section[at + 2 : first])
    count = math.prod(shape)
    end = first + count * abs(kind)
    if kind not in (-1, 1, 2, 4) or len(shape) > 7 or end > len(section):
        raise damaged
    raw = section[first:end]
    if kind == -1:
        width = shape[0] if shape else 1
        rows = [raw[i : i + width] for i in range(0, len(raw), width)] if width else []
        return [_text(row) for row in rows], end
    if kind == 1:
        numbers: NDArray[Any] = np.frombuffer(raw, dtype=np.int8).astype(np.int64)
    elif kind == 2:
        numbers = integers(raw, processor, "i2").astype(np.int64)
    else:
        numbers = doubles(floats(raw, processor))
    numbers = numbers.reshape(shape or (1,), order="F")
    numbers.setflags(write=False)
    return numbers, end


def _text(row: bytes) -> str:
    row = row.split(b"\0")[0]
    try:
        return row.decode("utf-8").strip()
    except UnicodeDecodeError:
        return row.decode("latin-1").strip()
