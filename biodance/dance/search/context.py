"""What all stages of one design share, and what of it is kept on disk, so that an interrupted design goes on."""

import hashlib
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body, body_text
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import Blocks, excitation_blocks
from biodance.dance.problem.plan import Plan
from biodance.records import Array

ROOMS = ("body", "dance", "identification", "motion", "uncertainty", "spatial.py")
"""Whose code decides what a dance becomes."""


class Checkpoint:
    """Named arrays in a folder that belongs to one body, plan, seed and state of the code; nothing without a folder."""

    def __init__(self, folder: Path | None, body: Body, plan: Plan, seed: int) -> None:
        key = hashlib.sha256(f"{code()}{body_text(body, '')}{plan!r}{seed}".encode()).hexdigest()[:16]
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

    def put(self, name: str, **arrays: NDArray[Any]) -> None:
        """Keep arrays under ``name``."""
        if self.folder:
            part = self.folder / f"{name}.part.npz"
            np.savez(part, allow_pickle=False, **arrays)
            part.replace(self.folder / f"{name}.npz")


@cache
def code() -> str:
    """Return a hash of the source of all `ROOMS`: what older code found does not fit what newer code finds."""
    package = Path(__file__).parents[2]
    files = sorted(file for file in package.rglob("*.py") if file.relative_to(package).parts[0] in ROOMS)
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


Tell = Callable[[str, int, int], None]
"""Told what is being done, how many parts are finished and of how many."""


@dataclass(frozen=True, eq=False)
class DesignContext:
    """One design: ``chain`` of the body, ``blocks`` that count, ``plan``, ``seed`` of all random numbers; what is
    finished goes to ``checkpoint``, ``workers`` search side by side, ``tell`` is told the progress.
    """

    chain: Chain
    blocks: Blocks
    plan: Plan
    seed: int
    checkpoint: Checkpoint
    workers: Executor
    tell: Tell

    @classmethod
    def alone(cls, body: Body, plan: Plan, seed: int) -> "DesignContext":
        """Return a design that keeps nothing, tells nobody and works on one thread."""
        parts = excitation_blocks(body)
        parts = replace(parts, weight=parts.weight * plan.emphasis(body.segments), simplicity=plan.simplicity)
        return cls(
            Chain(body), parts, plan, seed, Checkpoint(None, body, plan, seed), ThreadPoolExecutor(1), lambda *_: None
        )
