"""A folder that somebody drops on a window: a browser hands out its files, not its place, so they are copied."""

import filecmp
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path

from biodance.errors import BiodanceError
from biodance.lab.session.archive import archive_folders
from biodance.lab.session.file import FILES
from biodance.lab.session.results_folder import made_folder
from biodance.library import parse_json

_BROKEN = "What was dropped did not arrive whole, and nothing of it was kept. Drop it again."


async def received_folder(stream: AsyncIterator[bytes], out: Path) -> Path:
    """Write a dropped folder below ``out`` and return where it lies. The ``stream`` is a line of JSON with ``name`` and
    ``files``, each its path in the folder and its bytes, then the content of all of them, one after the other.

    The folder is there whole or not at all. One that was dropped before with the same recordings is returned as it
    lies, with what session.toml says by now; another one of the same name gets a number.

    Raises
    ------
    BiodanceError
        The stream broke off, a path leads out of the folder, or there is no session in it.
    OSError
        The disk is full.
    """
    head, rest = await _head(stream)
    name, files = _told(head)
    with tempfile.TemporaryDirectory(prefix=".part-", dir=made_folder(out)) as part:
        folder = Path(part) / name
        folder.mkdir()
        for path, size in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            with (folder / path).open("xb") as file:
                while size > 0:
                    rest = rest or await anext(stream, b"")
                    if not rest:
                        raise BiodanceError(_BROKEN)
                    written = file.write(rest[:size])
                    size, rest = size - written, rest[written:]
        archive_folders(folder)
        return _kept(folder, out / name, [path for path in files if path not in FILES])


async def _head(stream: AsyncIterator[bytes]) -> tuple[bytes, bytes]:
    """Return the first line of a stream, and what came with it of the rest."""
    told = b""
    async for chunk in stream:
        told += chunk
        if b"\n" in told:
            head, _, rest = told.partition(b"\n")
            return head, rest
        if len(told) > 2**20:
            break
    raise BiodanceError(_BROKEN)


def _told(head: bytes) -> tuple[str, dict[str, int]]:
    """Return the name of a dropped folder and the bytes of each of its files by path."""
    try:
        told = parse_json(head.decode("utf-8"))
        name, files = str(told["name"]), {str(path): int(size) for path, size in told["files"]}
    except (ValueError, KeyError, TypeError) as error:
        raise BiodanceError(_BROKEN) from error
    for path in (name, *files):
        # a name that begins with a point is hidden, the folder itself, or the way out of it
        if "\0" in path or any(not part or part.startswith(".") for part in path.split("/")):
            raise BiodanceError(f"{path!r} is no path in a folder. Drop the folder of a session.")
    return name.replace("/", " "), files


def _kept(folder: Path, wanted: Path, recordings: list[str]) -> Path:
    """Put a folder where it shall lie, or return the one that lies there with the same ``recordings``."""
    names = (folder.name, *(f"{folder.name} {number}" for number in range(2, 10_000)))
    for place in map(wanted.with_name, names):
        if not place.exists():
            return folder.rename(place)
        same, _, _ = filecmp.cmpfiles(folder, place, recordings, shallow=False)
        if len(same) == len(recordings):
            break
    return place
