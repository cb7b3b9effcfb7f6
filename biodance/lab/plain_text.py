"""Read text as laboratories write it: UTF-8 with or without a mark, UTF-16, or the Windows code page, with any line
ends, decimal points or commas; and write files where none are yet.
"""

import codecs
import hashlib
import math
import os
import re
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.library import refuse_special
from biodance.records import Array

_LARGEST = 2**31  # Bytes: an hour of 100 markers at 200 Hz and 32 channels at 2000 Hz has 2.1 GB
LARGEST_NUMBER = 1e12
"""In any unit: of what cameras and plates record nothing comes near, and squares of it can still be computed with."""
_PRESENT = "{}: exists already and is not overwritten. Choose another name or remove it."


def read_bytes(path: Path, *, most: int = -1) -> bytes:
    """Return the bytes of a file, of which ``most`` are wanted (-1 = all).

    Raises
    ------
    FileRefused
        There is no such file, it is a pipe or device or too large, it cannot be opened, or it is empty.
    """
    refuse_special(path)
    if most < 0:
        refuse_huge(path)
    try:
        with path.open("rb") as stream:
            content = stream.read(most)
    except OSError as error:
        raise FileRefused(
            f"{path}: cannot be opened ({error.strerror or error}). Check the path and the rights."
        ) from error
    if not content:
        raise FileRefused(f"{path}: is empty (0 bytes). Export the recording again.")
    return content


@contextmanager
def whole_file(path: Path, *, over: bool = False) -> Iterator[Path]:
    """Yield a path beside ``path``, of the same ending, to write to; what was written is flushed to the disk and takes
    its name in one step. What fails or is stopped leaves ``path`` as it was; a file there is replaced only ``over`` it.

    Raises
    ------
    FileRefused
        The file exists and not ``over``, or cannot be written.
    """
    part = path.with_name(f".part-{uuid.uuid4().hex}{path.suffix}")
    try:
        if not over:
            refuse_present(path)
        yield part
        flush(part)
        if over:
            part.replace(path)
        else:
            _take_name(part, path)
        flush(path.parent)
    except FileExistsError:
        raise FileRefused(_PRESENT.format(path)) from None
    except OSError as error:
        raise FileRefused(
            f"{path}: cannot be written ({error.strerror or error}). Make room, or choose a place where you may write, "
            f"and run again."
        ) from error
    finally:
        part.unlink(missing_ok=True)


def refuse_present(path: Path) -> None:
    """Raise FileRefused where there is anything of this name."""
    if os.path.lexists(path):
        raise FileRefused(_PRESENT.format(path))


def write_whole(path: Path, content: bytes, *, over: bool = False) -> Path:
    """Write a file as `whole_file` and return its path."""
    with whole_file(path, over=over) as part:
        part.write_bytes(content)
    return path


def flush(path: Path) -> None:
    """Return when a file or folder is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _take_name(part: Path, path: Path) -> None:
    """Give a finished file its name in one step; FileExistsError where another file has it."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without second names
        if os.path.lexists(path):
            raise FileExistsError from None
        part.rename(path)


def for_spreadsheet(cell: object) -> object:
    """Return a cell or heading of a CSV file that no spreadsheet takes for a formula: a text that begins with =, +, -,
    @ or a tab, as labels in files may, begins with an apostrophe instead (CWE-1236); numbers stay as they are.
    """
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(("=", "+", "-", "@", "\t", "\r")) else cell


def refuse_huge(path: Path) -> None:
    """Raise FileRefused for a file larger than any recording, which would fill the memory."""
    if path.is_file() and path.stat().st_size > _LARGEST:
        raise FileRefused(
            f"{path}: has {path.stat().st_size / 1e9:.1f} GB, a recording at most {_LARGEST / 1e9:.1f}. If it is one, "
            f"export it in shorter trials."
        )


def sha256(content: bytes) -> str:
    """Return the hexadecimal SHA-256 of the bytes, as kept in ``Source.sha256``."""
    return hashlib.sha256(content).hexdigest()


def decode(content: bytes, path: Path) -> str:
    """Return the text of ``content``: UTF-16 by its mark, else UTF-8, else Windows-1252 (every byte of it has a
    meaning, so it comes last).

    All line ends become the Unix one.

    Raises
    ------
    FileRefused
        The bytes are not text.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = content.decode("utf-16", errors="replace")
    elif b"\x00" in content[:4096]:
        raise FileRefused(
            f"{path}: holds binary data where text is expected. Check what the file is; its extension does not fit."
        )
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_text(path: Path) -> str:
    """Return the text of a file; FileRefused if it is missing, empty or binary."""
    return decode(read_bytes(path), path)


COMMAS_READ = "Numbers are written with decimal commas and were read so."
_COMMA = re.compile(r"(?<![^\s;])([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)(?![^\s;])")
_POINT = re.compile(r"(?<![^\s;])[-+]?\d*\.\d+(?:[eE][-+]?\d+)?(?![^\s;])")


def with_points(text: str) -> tuple[str, bool]:
    """Return the text with decimal commas turned into points, and whether it has any.

    A comma is one where tabs, blanks or semicolons part the cells of a row, it is the only comma of its cell, and no
    row with one has a decimal point as well (a comma may part thousands there, and the text stays as it is).
    """
    rows = [line for line in text.split("\n") if "," in line and _COMMA.search(line)]
    if not rows or any(_POINT.search(row) or len(re.split(r"[\s;]+", row.strip())) < 2 for row in rows):
        return text, False
    return _COMMA.sub(r"\1.\2", text), True


def cells(line: str) -> list[str]:
    """Return the cells of one row: between tabs where there are any (a cell may be empty), else between blanks."""
    return [cell.strip() for cell in line.rstrip("\r\n").split("\t")] if "\t" in line else line.split()


def parse_number(cell: str, where: str) -> float:
    """Return the number in a cell; an empty cell, nan and inf are NaN: not known.

    Raises
    ------
    FileRefused
        It is no number, or larger than any that is recorded: says ``where``. Python's own 1_0 and digits of other
        scripts are none.
    """
    if not cell:
        return math.nan
    try:
        value = float(cell) if cell.isascii() and "_" not in cell else None
    except ValueError:
        value = None
    if value is None:
        raise FileRefused(f"{where}: {cell[:40]!r} is not a number. Correct that cell or export the file again.")
    if abs(value) > LARGEST_NUMBER and not cell.strip("+-")[:1].isalpha():
        raise FileRefused(
            f"{where}: {cell[:40]!r} is larger than anything that is recorded ({LARGEST_NUMBER:g}). Export the file "
            f"again."
        )
    return value if math.isfinite(value) else math.nan


_BLANKS = re.compile(r" *([\t\n]) *")
_EMPTY = re.compile(r"(?<![^\t\n])(?![^\t\n])")  # Between two tabs or ends of line: no sign before, none behind


def plain_table(lines: Sequence[str], width: int) -> Array | None:
    """Return the numbers (T, ``width``) of lines all at once, cells as of `cells`, numbers as of `parse_number`; None
    where a line has other cells or one is odd: then it is for the reader to look at the lines one by one.
    """
    text = "\n".join(lines)
    tabs = "\t" in text
    rows = _BLANKS.sub(r"\1", text).strip(" ").split("\n") if tabs and " " in text else text.split("\n")
    if tabs and {row.count("\t") for row in rows} == {width}:  # one more behind the last cell
        rows = [row.removesuffix("\t") for row in rows]
    text = "\n".join(rows)
    # `float` knows more than `parse_number`: 1_0, digits of other scripts.
    odd = not text.isascii() or "_" in text or (tabs and " " in text)
    if odd or {row.count("\t") + 1 if tabs else len(row.split()) for row in rows} != {width}:
        return None
    numbers = text.split()
    if len(numbers) < width * len(rows):
        numbers = _EMPTY.sub("nan", text).split()
    try:
        values = np.fromiter(map(float, numbers), float, len(numbers)).reshape(len(rows), width)
    except ValueError:
        return None
    return None if (np.abs(values) > LARGEST_NUMBER).any() else values
