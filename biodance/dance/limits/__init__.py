"""FAMILY: one constraint per file, found automatically.

A limit has a ``NAME``, a ``UNIT``, a ``SCALE`` (a noticeable amount in that unit) and one function ``margins(state)``, which returns what
is left of it in every sample, negative where it is broken, with exact derivatives. The optimiser uses these.
"""

import importlib
import pkgutil
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from biodance.records import Array

FAR = 2.0


@dataclass(frozen=True, eq=False)
class Margins:
    """``value`` (T, m) >= 0 where the limit holds; ``slopes`` (k, T, m, n) by x, v, a in this order, k = 1, 2 or 3 as far as needed.

    Columns that are further than ``FAR`` scales from their limit in all samples may have slopes of zero.
    """

    value: Array
    slopes: Array


def limits() -> tuple[ModuleType, ...]:
    """Return all limits of this folder in alphabetical order."""
    return tuple(importlib.import_module(f"{__name__}.{info.name}") for info in pkgutil.iter_modules(__path__))


def repeated(rows: Array, frames: int) -> Array:
    """Return constant slopes (m, n) for every sample, (1, T, m, n)."""
    return np.broadcast_to(rows, (1, frames, *rows.shape))
