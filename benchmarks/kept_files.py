"""What benchmarks keep on disk between runs, so that a run that was stopped goes on: pickles, each whole or not there,
and in a folder at most `MOST` gigabytes of them; what was used longest ago goes first.
"""

import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

MOST = float(os.environ.get("BIODANCE_CACHE_GB", "2"))
"""Gigabytes of pickles in one folder."""


def kept(path: Path, make: Callable[[], Any]) -> Any:
    """Return what lies at ``path``, made and kept now if it is not there or of records that have moved since."""
    if path.is_file():
        os.utime(path)
        with suppress(ModuleNotFoundError, AttributeError), open(path, "rb") as stream:
            return pickle.load(stream)
    made = make()
    store(path, made)
    return made


def store(path: Path, value: object) -> None:
    """Pickle ``value`` to ``path`` at once or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}")
    with open(part, "wb") as stream:
        pickle.dump(value, stream, protocol=pickle.HIGHEST_PROTOCOL)
    os.replace(part, path)
    forget_oldest(path.parent, most=MOST)


def forget_oldest(folder: Path, *, most: float) -> None:
    """Remove the pickles of a folder that were used longest ago, until the rest are less than ``most`` gigabytes; the
    newest stays.
    """
    files = sorted(((path.stat(), path) for path in folder.glob("*.pickle")), key=lambda one: -one[0].st_mtime)
    held = 0.0
    for k, (about, path) in enumerate(files):
        held += about.st_size / 1e9
        if held > most and k:
            path.unlink(missing_ok=True)
