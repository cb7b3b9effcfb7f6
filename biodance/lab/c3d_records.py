"""Turn groups of parameters into the parameter section of a C3D file (Intel byte order)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from biodance.errors import BiodanceError
from biodance.lab.c3d_parameters import BLOCK, INTEL

FileValue = str | Sequence[str] | ArrayLike
FileParameters = Mapping[str, Mapping[str, FileValue]]

MOST = 255
"""The longest dimension of a parameter: one byte tells it."""


def parameter_section(groups: FileParameters) -> bytes:
    """Return the section: 4 bytes of header, every group with its parameters, padded to whole blocks.

    Text becomes a character array, whole numbers within 16 bits become integers, other numbers 32-bit floats; arrays keep their
    dimensions, first one fastest. Lists of more than 255 strings or numbers continue in NAME2, NAME3 ...

    Raises
    ------
    BiodanceError
        A value has a form that C3D cannot store, or the section grows beyond 255 blocks.
    """
    records = []
    for number, (group, values) in enumerate(groups.items(), start=1):
        records.append(_record(group, -number, b""))
        for name, value in values.items():
            for part, (tail, piece) in enumerate(_pieces(value, f"{group}:{name}")):
                records.append(_record(f"{name}{part + 1}" if part else name, number, tail + piece))
    body = b"".join(records) + b"\0\0"
    blocks = -(-(len(body) + 4) // BLOCK)
    if blocks > MOST:
        raise BiodanceError(f"The parameters need {blocks} blocks of 512 bytes, a C3D file has room for {MOST}. Store fewer parameters.")
    return (bytes([1, 0x50, blocks, INTEL]) + body).ljust(blocks * BLOCK, b"\0")


def _record(name: str, group: int, data: bytes) -> bytes:
    """Return one record without a description; ``group`` < 0 defines a group, > 0 puts a parameter into it."""
    raw = name.encode("ascii")
    return bytes([len(raw), group & 0xFF]) + raw + (len(data) + 3).to_bytes(2, "little") + data + b"\0"


def _pieces(value: FileValue, what: str) -> list[tuple[bytes, bytes]]:
    """Return (type and dimensions, data) of a value, in pieces of at most 255 entries."""
    if isinstance(value, str):
        raw = value.encode()[:MOST]
        return [(bytes([0xFF, 1, len(raw)]), raw)]
    if isinstance(value, Sequence) and all(isinstance(entry, str) for entry in value):
        rows = [str(entry).encode()[:MOST] for entry in value]
        width = max((len(row) for row in rows), default=0)
        parts = [rows[i : i + MOST] for i in range(0, len(rows), MOST)] or [[]]
        return [(bytes([0xFF, 2, width, len(part)]), b"".join(row.ljust(width) for row in part)) for part in parts]
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim > 7 or (array.ndim > 1 and max(array.shape) > MOST):
        raise BiodanceError(f"Parameter {what} has values of type {array.dtype} and shape {array.shape}; text or numbers are legal.")
    if array.ndim <= 1:
        flat = np.atleast_1d(array)
        return [_number_piece(flat[i : i + MOST]) for i in range(0, flat.size, MOST)] or [_number_piece(flat)]
    return [_number_piece(array)]


def _number_piece(array: np.ndarray[Any, Any]) -> tuple[bytes, bytes]:
    whole = array.dtype.kind in "iu" and (array.size == 0 or -32768 <= array.min() <= array.max() <= 32767)
    shape = b"" if array.shape == (1,) else bytes(array.shape)
    data = array.astype("<i2" if whole else "<f4").tobytes(order="F")
    return bytes([2 if whole else 4, len(shape)]) + shape, data
