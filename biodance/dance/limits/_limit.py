"""What every limit is: an object with its numbers, two independent formulas, and all that the design must know about it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

from biodance.dance.limits._checked import CheckedMotion, Remaining
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.errors import BiodanceError
from biodance.records import Array

FAR = 2.0


@dataclass(frozen=True, eq=False)
class Margins:
    """``value`` (T, m) >= 0 where the limit holds; ``slopes`` (k, T, m, n) by x, v, a in this order, k = 1, 2 or 3 as far as needed.

    Columns that are further than ``FAR`` scales from their limit in all samples may have slopes of zero.
    """

    value: Array
    slopes: Array


def bounded(default: float, low: float, high: float, unit: str = "") -> Any:
    """Return a number of a limit: its ``default`` and the range from ``low`` to ``high`` in ``unit`` that a protocol may give it."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit})


@dataclass(frozen=True)
class Limit(ABC):
    """One constraint of a dance. A member's numbers are its fields (`bounded`), so that a protocol can set them.

    ``name`` that of its file; ``unit`` of its margins; ``scale`` a noticeable amount in that unit.
    ``at_rest``, ``in_motion`` whether held postures and moves must keep it. ``suspicion``: where no posture is possible, limits are left
    out one after the other, the smallest number first, until there would be one; that one is named. ``rounding`` what the check forgives.
    ``move_reserve`` least share of the scale that is kept in reserve while a move is designed; ``tapers`` True where this reserve ends with
    the move, because it begins and ends at the limit.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    scale: ClassVar[float]
    at_rest: ClassVar[bool] = True
    in_motion: ClassVar[bool] = True
    suspicion: ClassVar[int] = 0
    rounding: ClassVar[float] = 0.0
    move_reserve: ClassVar[float] = 0.0
    tapers: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for one in fields(self):
            value, legal = getattr(self, one.name), one.metadata
            if legal and not legal["low"] <= value <= legal["high"]:
                said = f"limits.{self.name}.{one.name} = {value:g} {legal['unit']}".rstrip()
                raise BiodanceError(f"{said}; legal are {legal['low']:g} to {legal['high']:g}.")

    @abstractmethod
    def margins(self, state: State) -> Margins:
        """Return what is left in every sample of ``state``, with exact slopes: for the optimiser."""

    @abstractmethod
    def check(self, motion: CheckedMotion) -> Remaining:
        """Return what is left in every sample of ``motion``, by code that shares nothing with `margins`: for the judge."""

    def hold_reserve(self, stance: Stance) -> float:
        """Return the share of the scale that a held posture keeps in reserve, for the moves that begin and end there."""
        return 0.06

    @property
    def support_share(self) -> float:
        """Share of every half width of the base of support that this limit leaves; stances are laid out for it."""
        return 1.0


def repeated(rows: Array, frames: int) -> Array:
    """Return constant slopes (m, n) for every sample, (1, T, m, n)."""
    return np.broadcast_to(rows, (1, frames, *rows.shape))


def unconcerned(state: State) -> Margins:
    """Return the margins of a limit that has nothing to say about ``state``: no columns."""
    return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))
