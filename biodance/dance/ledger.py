"""What is already found of a dance, on disk, so that a design that was interrupted goes on where it stopped."""

import hashlib
from pathlib import Path

import numpy as np

from biodance import __version__
from biodance.body.body import Body
from biodance.body.body_file import body_text
from biodance.dance.plan import Plan
from biodance.records import Array


class Ledger:
    """Named sets of arrays in a folder that belongs to one body, plan and seed; without a folder nothing is kept."""

    def __init__(self, folder: Path | None, body: Body, plan: Plan, seed: int) -> None:
        key = hashlib.sha256(f"{__version__}{body_text(body, '')}{plan!r}{seed}".encode()).hexdigest()[:16]
        self.folder = folder / f"dance_{key}" if folder else None
        if self.folder:
            self.folder.mkdir(parents=True, exist_ok=True)

    def get(self, name: str) -> dict[str, Array] | None:
        """Return what was kept under ``name``, or None; a file that was cut off while written counts as nothing."""
        path = self.folder / f"{name}.npz" if self.folder else None
        if path is None or not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as found:
                return {key: found[key] for key in found.files}
        except (OSError, ValueError, EOFError):
            return None

    def put(self, name: str, **arrays: Array | float) -> None:
        """Keep arrays under ``name``."""
        if self.folder:
            part = self.folder / f"{name}.part.npz"
            np.savez(part, allow_pickle=False, **{key: np.asarray(value) for key, value in arrays.items()})
            part.replace(self.folder / f"{name}.npz")
