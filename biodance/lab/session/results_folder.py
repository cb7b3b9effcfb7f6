"""Where results go: a folder of their own, never over or among the raw recordings, there whole or not at all.

A run writes into a folder beside its place (`ResultsFolder.part`). When all is written and on the disk, the two change
places in one step: whoever looks sees the earlier results or the new ones, never a mixture.
"""

import atexit
import ctypes
import os
import platform
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from biodance.errors import SessionRefused
from biodance.lab.plain_text import flush
from biodance.lab.readers import extensions
from biodance.lab.session.manifest import MANIFEST, files_in, read_manifest, write_manifest
from biodance.lab.session.recordings import RESULTS, TEXT

_LOCK = ".biodance.lock"
_EXCHANGE, _HERE = 2, -100
"""RENAME_EXCHANGE and AT_FDCWD of renameat2(2): both names change places at once."""


@dataclass(frozen=True)
class ResultsFolder:
    """A folder of results in the making: ``part``, into which everything is written, takes the ``place``."""

    place: Path
    part: Path

    def finish(self, session: Path, inputs: Mapping[str, str]) -> Path | None:
        """Bind what was written to the recordings of a ``session`` (``inputs``: name -> SHA-256) and put it in place.

        Return the folder to which the files of an earlier run's folder went that were not biodance's; None if there
        were none.

        Raises
        ------
        SessionRefused
            The disk is full, or the place cannot be written to; what was there is as before.
        """
        with _as_before(self.place):
            write_manifest(self.part, session, inputs)
            (self.part / _LOCK).unlink(missing_ok=True)
            put_in_place(self.part, self.place)
            return _cleared(self.part, ours=files_in(self.place)) if self.part.is_dir() else None
        return None


def inputs_of(paths: Mapping[Path, str], session: Path) -> dict[str, str]:
    """Return the hashes of recordings by their name below the ``session`` folder."""
    return {os.path.relpath(path, session): sha for path, sha in paths.items() if sha}


def put_in_place(part: Path, place: Path, *, alone: bool = False) -> None:
    """Flush a finished folder to the disk and let it change places with what lies at ``place``, in one step; what lay
    there is ``part`` then. ``alone``: no file of others is there.
    """
    for path in (*part.rglob("*"), part):
        flush(path)
    if part.parent == place:  # a disk of its own: its folder cannot change its name
        earlier, new = read_manifest(place), files_in(part)
        known = files_in(place) if alone else earlier.outputs if earlier else RESULTS
        for name in (*new, *(one.name for one in part.glob(MANIFEST))):
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (part / name).replace(place / name)
        for name in set(known) - {*new, MANIFEST}:
            (place / name).unlink(missing_ok=True)
        shutil.rmtree(part)
    elif place.exists() and any(place.iterdir()):
        _exchange(part, place)
    else:
        part.replace(place)
    flush(place.parent)


def _exchange(one: Path, other: Path) -> None:
    """Let two folders change places; where the file system cannot do it at once, in three steps."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is not None and rename(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0:
        return
    aside = one.with_name(f"{one.name}.earlier")
    other.replace(aside)
    one.replace(other)
    aside.replace(one)


def _cleared(folder: Path, *, ours: list[str]) -> Path | None:
    """Remove the files of an earlier run; return the folder in which those that biodance did not write are kept."""
    earlier = read_manifest(folder)
    known = set(earlier.outputs) if earlier else {*ours, *RESULTS}
    for name in known | {MANIFEST, _LOCK}:
        (folder / name).unlink(missing_ok=True)
    left = files_in(folder)
    if not left:
        shutil.rmtree(folder)
        return None
    base = folder.name.removeprefix(".").removesuffix(".part")
    names = (f"{base}-kept{number}" for number in ("", *range(2, 10_000)))
    kept = next(path for path in map(folder.with_name, names) if not path.exists())
    folder.replace(kept)
    return kept


def results_folder(out: str | Path, session: str | Path, *, force: bool = False) -> ResultsFolder:
    """Return where the results of a session are written, before they take their place.

    ``force`` allows a place that holds results of an earlier run (a results.json or report.html); all of them are
    replaced, and files that are not of biodance are kept beside it.

    Raises
    ------
    SessionRefused
        Another run is writing there; the place is the session folder or one above it, is a file, holds recordings,
        holds anything at all without ``force``, or holds only files that biodance did not write.
    """
    session = Path(os.path.realpath(session))  # unlike Path.resolve, it takes a circle of links
    folder = Path(os.path.realpath(out))
    if folder == session or folder in session.parents:
        raise SessionRefused(
            f"{folder}: results must not lie among the recordings. Give another folder, for example {session}-results."
        )
    if folder.exists() and not folder.is_dir():
        raise SessionRefused(f"{folder}: is a file; the results need a folder. Choose another name.")
    files = [path for path in folder.iterdir() if not path.name.startswith(".")] if folder.is_dir() else []
    raw = [path.name for path in files if path.suffix.lower() in extensions() and path.suffix.lower() not in TEXT]
    ours = any(path.name in RESULTS for path in files)
    if raw and not ours:
        raise SessionRefused(
            f"{folder}: holds recordings ({raw[0]}); results are never written beside them. Give another folder."
        )
    if files and not force:
        raise SessionRefused(
            f"{folder}: holds files already and nothing is overwritten. Give another folder, or --force."
        )
    if files and not ours:
        raise SessionRefused(
            f"{folder}: holds files that biodance did not write ({files[0].name}). Give another folder."
        )
    part = folder / ".part" if os.path.ismount(folder) else folder.with_name(f".{folder.name}.part")
    _taken(part, folder)
    return ResultsFolder(folder, part)


def made_folder(folder: Path) -> Path:
    """Return a folder, made if missing; SessionRefused if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SessionRefused(
            f"{folder}: cannot be made ({error.strerror or error}). Choose a place where you may write."
        ) from error
    return folder


@contextmanager
def whole_folder(folder: Path, *, over: bool = False) -> Iterator[Path]:
    """Yield a folder beside ``folder`` to write into; when all is written, it is flushed to the disk and takes its
    place in one step. What fails or is stopped leaves ``folder`` as it was.

    ``folder`` must be missing or empty, unless ``over`` allows to replace all of it.

    Raises
    ------
    SessionRefused
        It holds files, is one, another run is writing there, or it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not over)):
        raise SessionRefused(f"{folder}: holds files already and nothing is overwritten. Give another folder.")
    place = Path(os.path.realpath(folder))
    part = place / ".part" if os.path.ismount(place) else place.with_name(f".{place.name}.part")
    _taken(part, place)
    try:
        with _as_before(folder):
            yield part
            (part / _LOCK).unlink(missing_ok=True)
            put_in_place(part, place, alone=True)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _as_before(place: Path) -> Iterator[None]:
    """Say of what the disk refuses that ``place`` is as it was."""
    try:
        yield
    except OSError as error:
        raise SessionRefused(
            f"{place}: cannot be written ({error.strerror or error}). What was there is as before. Make room, or "
            f"choose another place, and run again."
        ) from error


def _taken(part: Path, place: Path) -> None:
    """Make the folder ``part`` for this process, empty; SessionRefused where another one, still alive, has it."""
    lock, mine = part / _LOCK, f"{os.getpid()} {platform.node()}"
    holder = _text(lock)
    if holder and holder != mine and _is_alive(holder):
        raise SessionRefused(
            f"{place}: another run of biodance (process {holder.replace(' ', ' on ')}) is writing there. "
            f"Wait for it, or give another folder; if it is not running any more, delete {part}."
        )
    try:
        shutil.rmtree(part, ignore_errors=True)  # of a run that was killed
        made_folder(part)
        with open(lock, "x", encoding="ascii", errors="replace") as stream:
            stream.write(mine)
    except OSError as error:
        raise SessionRefused(
            f"{place}: cannot be written to ({error.strerror or error}). Choose a place where you may write."
        ) from error
    atexit.register(shutil.rmtree, part, ignore_errors=True)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""


def _is_alive(holder: str) -> bool:
    """Return whether the process that a lock names may still run: one of another machine counts as alive."""
    number, _, machine = holder.partition(" ")
    if not number.isdecimal():
        return False
    if machine != platform.node() or os.name == "nt":  # there, signal 0 is no question but Ctrl-C
        return True
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
