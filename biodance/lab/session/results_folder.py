"""Where results go: a folder of their own, never over or among the raw recordings."""

import atexit
import os
import platform
from pathlib import Path

from biodance.errors import SessionRefused
from biodance.lab.readers import extensions
from biodance.lab.session.recordings import RESULTS, TEXT


def results_folder(out: str | Path, session: str | Path, *, force: bool = False) -> Path:
    """Return the folder for the results of a session, made if missing.

    ``force`` allows a folder that holds results of an earlier run (a results.json or report.html); they are overwritten
    one by one.

    Raises
    ------
    SessionRefused
        Another run is writing there; the folder is the session folder or one above it, is a file, holds recordings,
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
    _lock(made_folder(folder))
    return folder


def made_folder(folder: Path) -> Path:
    """Return a folder, made if missing; SessionRefused if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SessionRefused(
            f"{folder}: cannot be made ({error.strerror or error}). Choose a place where you may write."
        ) from error
    return folder


def new_folder(folder: Path) -> Path:
    """Return a folder that was missing or empty, made; SessionRefused if it holds files or cannot be made."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise SessionRefused(f"{folder}: holds files already and nothing is overwritten. Give another folder.")
    return made_folder(folder)


_LOCK = ".biodance.lock"


def _lock(folder: Path) -> None:
    """Take a folder for this process until it ends; SessionRefused where another one, still alive, has taken it."""
    lock = folder / _LOCK
    mine = f"{os.getpid()} {platform.node()}"
    for _ in range(2):
        try:
            with open(lock, "x", encoding="ascii", errors="replace") as stream:
                stream.write(mine)
        except FileExistsError:
            holder = _text(lock)
            if holder == mine:
                return
            if _is_alive(holder):
                raise SessionRefused(
                    f"{folder}: another run of biodance (process {holder.replace(' ', ' on ')}) is writing there. "
                    f"Wait for it, or give another folder; if it is not running any more, delete {lock}."
                ) from None
            lock.unlink(missing_ok=True)
        except OSError as error:
            raise SessionRefused(
                f"{folder}: cannot be written to ({error.strerror or error}). Choose a place where you may write."
            ) from error
        else:
            atexit.register(lock.unlink, missing_ok=True)
            return


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
