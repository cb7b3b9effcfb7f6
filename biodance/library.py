"""Find the data that biodance ships: ``anthropometry/`` and ``protocols/``.

The two folders lie at the top of a checkout and inside the package in an installed wheel; nothing else in biodance
knows that.
"""

import json
import os
import re
import tomllib
import zipfile
from pathlib import Path
from typing import Any

from biodance.errors import BiodanceError, FileRefused, UnknownName

PACKAGE = Path(__file__).resolve().parent
_LARGEST_TEXT = 2**26
"""Bytes of a TOML or JSON file: hundreds of times what biodance writes."""
_DEEPEST = 20
"""Tables and lists in each other; biodance writes five."""
_DIGITS = 40
"""Of a whole number: a run's number has fewer."""
_COMMA = re.compile(r"=\s*[-+]?\d+,\d")
"""A number with a decimal comma."""
_DEEP_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{_DEEPEST}}}""")
"""A key of so many parts that tomllib needs minutes for what `_refuse_extreme` would refuse afterwards."""


def folder(name: str) -> Path:
    """Return the path of a shipped data folder, for example ``folder("anthropometry")``.

    Raises
    ------
    BiodanceError
        The folder is neither in the package (wheel) nor beside it (checkout): the installation is damaged.
    """
    for place in (PACKAGE / name, PACKAGE.parent / name):
        if place.is_dir():
            return place
    raise BiodanceError(
        f"The data folder {name!r} is neither in {PACKAGE} nor in {PACKAGE.parent}: the installation is damaged. "
        f"Install biodance again."
    )


def names(path: str, suffix: str = ".toml") -> tuple[str, ...]:
    """Return the sorted names (file stems) of a shipped family, for example ``names("anthropometry/marker_sets")``."""
    first, _, rest = path.partition("/")
    return tuple(sorted(p.stem for p in (folder(first) / rest).glob(f"*{suffix}")))


def locate(path: str, name: str, suffix: str = ".toml") -> Path:
    """Return the file of one member of a shipped family.

    Raises
    ------
    UnknownName
        There is no such member; the message lists all of them.
    """
    first, _, rest = path.partition("/")
    found = folder(first) / rest / f"{name}{suffix}"
    if not found.is_file():
        raise UnknownName.of(f"name in {path}", name, names(path, suffix))
    return found


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; a syntax error becomes a sentence that names the file and the line.

    Raises
    ------
    FileRefused
        The file is missing, no ordinary file, too large, nested without end, or not TOML.
    """
    refuse_special(path)
    try:
        refuse_large(path, _LARGEST_TEXT)
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FileRefused(f"{path}: cannot be opened ({error.strerror}). Check the path.") from error
    except UnicodeDecodeError as error:
        raise FileRefused(f"{path}: is no text in UTF-8, so not valid TOML. Save it as UTF-8.") from error
    return parse_toml(text, path)


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Return the tables of a text that stands, or shall stand, in the file ``path``.

    Raises
    ------
    FileRefused
        It is not TOML, nested without end, or holds a whole number that no computation can take.
    """
    try:
        if _DEEP_KEY.search(text):
            raise RecursionError
        found = tomllib.loads(text)
        _refuse_extreme(found)
        return found
    except RecursionError as error:
        raise FileRefused(f"{path}: tables or lists lie in each other too deeply. Write them flat.") from error
    except tomllib.TOMLDecodeError as error:
        advice = "Write decimals with a point: 60.3." if _COMMA.search(_line(text, error)) else "Correct that line."
        raise FileRefused(f"{path}: is not valid TOML: {error}. {advice}") from error
    except ValueError as error:  # also Python's own, for digits by the thousand
        raise FileRefused(
            f"{path}: holds a whole number of more than {_DIGITS} digits, larger than anything that is counted. "
            f"Correct it."
        ) from error


def _refuse_extreme(found: Any) -> None:
    """Raise RecursionError for tables deeper than `_DEEPEST`, ValueError for a number of more than `_DIGITS` digits."""
    here = [found]
    for _ in range(_DEEPEST):
        inside = [one for some in here for one in (some.values() if isinstance(some, dict) else some)]
        if any(isinstance(one, int) and abs(one) >= 10**_DIGITS for one in inside):
            raise ValueError
        here = [one for one in inside if isinstance(one, dict | list)]
        if not here:
            return
    raise RecursionError


def parse_json(text: str) -> Any:
    """Return what a JSON text says.

    Raises
    ------
    ValueError
        It is no JSON, too long, or nested without end.
    """
    if len(text) > _LARGEST_TEXT:
        raise ValueError(f"{len(text) / 1e6:.0f} MB of text, legal are up to {_LARGEST_TEXT / 1e6:.0f}")
    try:
        return json.loads(text, parse_int=_whole)
    except RecursionError as error:
        raise ValueError("lists lie in each other too deeply") from error


def _whole(digits: str) -> int:
    """Return a whole number; ValueError for one that no computation can take."""
    if len(digits) > _DIGITS:
        raise ValueError(f"{digits[:_DIGITS]}... is larger than anything that is counted")
    return int(digits)


def refuse_large(path: Path, largest: int) -> None:
    """Raise FileRefused for a file of more than ``largest`` bytes, unpacked where it is a zip archive (.npz): it would
    fill the memory.
    """
    size = path.stat().st_size if path.is_file() else 0
    if path.is_file() and zipfile.is_zipfile(path):
        try:
            with zipfile.ZipFile(path) as packed:
                size = sum(one.file_size for one in packed.infolist())
        except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
            raise FileRefused(f"{path}: is a damaged archive ({error}). Make it again.") from error
    if size > largest:
        raise FileRefused(f"{path}: holds {size / 1e6:,.0f} MB, legal are up to {largest / 1e6:,.0f}. Check the file.")


def _line(text: str, error: tomllib.TOMLDecodeError) -> str:
    """Return the line of a text that is no TOML; "" where the error names none (its attributes are of Python 3.14)."""
    place = re.search(r"line (\d+)", str(error))
    return text.splitlines()[int(place[1]) - 1] if place else ""


def refuse_special(path: Path) -> None:
    """Raise FileRefused for a pipe, socket or device, on which reading could wait for ever, and for a name that no file
    can have.
    """
    if "\0" in str(path):
        raise FileRefused(f"{str(path)!r}: no file has such a name (it holds a NUL). Correct it.")
    if os.path.exists(path) and not path.is_file() and not path.is_dir():  # Path.exists raises for a name too long
        raise FileRefused(
            f"{path}: is a pipe, socket or device, an ordinary file is expected. Copy its content into a file."
        )
