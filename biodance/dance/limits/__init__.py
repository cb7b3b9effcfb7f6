"""FAMILY: one constraint of a dance per file, found automatically; others come as objects or by the entry points
``biodance.limits``.

A member is a frozen dataclass that derives from `Limit`, given as ``LIMIT`` by its file: its numbers are fields
(``[limits.friction] mu = 0.4`` in a protocol), ``margins`` is for the optimiser, ``check`` judges the finished motion
by other code. Design, verification, refusal and report go through the family and know no name;
`tests/test_dance_limits.py` holds every member to its contract.
"""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np

from biodance.dance.limits._checked import NOTHING as NOTHING
from biodance.dance.limits._checked import CheckedMotion as CheckedMotion
from biodance.dance.limits._checked import ForImprecise as ForImprecise
from biodance.dance.limits._checked import ImpreciseCopy as ImpreciseCopy
from biodance.dance.limits._checked import Remaining as Remaining
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import FAR as FAR
from biodance.dance.problem.state import Margins as Margins
from biodance.dance.problem.state import State
from biodance.discovery import Family
from biodance.errors import BiodanceError, refuse_unknown
from biodance.records import Array, assign


def bounded(default: float, low: float, high: float, unit: str = "", *, imprecise: bool = False) -> Any:
    """Return a number of a limit: its ``default`` and the legal range from ``low`` to ``high`` in ``unit``;
    ``imprecise`` True where it says what imprecise people must keep (`Limit.for_imprecise`), and nothing else.
    """
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "imprecise": imprecise})


@dataclass(frozen=True)
class Limit(ABC):
    """One constraint of a dance. A member's numbers are its fields (`bounded`), so that a protocol can set them.

    ``name`` that of its file; ``unit`` of its margins; ``scale`` a noticeable amount in that unit. ``at_rest``,
    ``in_motion`` whether held postures and moves must keep it. ``suspicion``: where no posture is possible, limits are
    left out one after the other, the smallest number first, until there would be one; that one is named. ``rounding``
    what the check forgives. ``move_reserve`` least share of the scale that is kept in reserve while a move is designed;
    ``tapers`` True where this reserve ends with the move, because it begins and ends at the limit.
    ``mended_by_slowness`` True where a move that breaks the limit may keep it if it takes longer.
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
    mended_by_slowness: ClassVar[bool] = False

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
        """Return what is left in every sample of ``motion``, by code that shares nothing with `margins`: to judge."""

    def hold_reserve(self, stance: Stance) -> float:
        """Return the share of the scale that a held posture keeps in reserve for the moves that begin and end there."""
        return 0.06

    def straight_reserve(self, stance: Stance) -> float:
        """Return what `hold_reserve` does where the moves to and from the posture go straight."""
        return self.hold_reserve(stance)

    def for_imprecise(self) -> ForImprecise | None:
        """Return what people who copy a dance imprecisely must keep of this limit; None where that is their own affair,
        as where they stop at the end of a joint's range.
        """
        return None

    def eased(self, angles: dict[str, float]) -> dict[str, float]:
        """Return joint ``angles`` (rad, by the joint's name) of a known posture of a limb as near to them as this limit
        lets them be; those of a limit that says nothing of limbs, as they are.
        """
        return angles

    def resized(self, length: float) -> "Limit":
        """Return the limit of a body that is ``length`` times as large: its numbers in m grow with it."""
        other = copy(self)
        for one in fields(self):
            if one.metadata.get("unit") == "m":
                assign(other, **{one.name: length * getattr(self, one.name)})
        return other

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


def lacking(candidate: object) -> tuple[str, ...]:
    """Return what an object or class lacks to be a limit."""
    kind = candidate if isinstance(candidate, type) else type(candidate)
    if not issubclass(kind, Limit):
        return ("the base class Limit",)
    lacks = [name for name in ("name", "unit", "scale") if not hasattr(kind, name)]
    return (*lacks, *(sorted(getattr(kind, "__abstractmethods__", ())) if inspect.isabstract(kind) else ()))


FAMILY: Family[Limit | type[Limit]] = Family(
    "limit of a dance", "biodance.limits", __name__, "LIMIT", lacking, lambda kind: kind.name
)


def family() -> tuple[Limit, ...]:
    """Return all limits of the folder and of other packages with their usual numbers, by name. Raises BiodanceError: a
    file of the folder or an entry point is no limit; the sentence says which and what to do.
    """
    return join_limits(FAMILY.members().values(), ())


def join_limits(limits: Iterable[Limit | type[Limit]], more: Iterable[Limit | type[Limit]]) -> tuple[Limit, ...]:
    """Return ``limits`` and ``more``, objects or classes, by name; where a name is in both, the one of ``more``. Raises
    BiodanceError: one of ``more`` is no limit.
    """
    found: dict[str, Limit] = {}
    for one in (*limits, *more):
        if lacks := lacking(one):
            raise BiodanceError(
                f"{one!r}: lacks {', '.join(lacks)}, so it is no limit of a dance. See biodance.dance.limits.Limit."
            )
        found[one.name] = one() if isinstance(one, type) else one
    return tuple(found[name] for name in sorted(found))


def limits_with(numbers: Mapping[str, Mapping[str, float]], *, where: str) -> tuple[Limit, ...]:
    """Return the family with other ``numbers`` (limit -> field -> value), found ``where``. Raises UnknownName: there is
    no such limit, or it has no such number; the message lists the legal ones. BiodanceError: a number is outside its
    legal range.
    """
    usual = {limit.name: limit for limit in family()}
    for name, given in numbers.items():
        refuse_unknown(f"limit in {where}", name, usual)
        legal = tuple(one.name for one in fields(usual[name]))
        for key in given:
            refuse_unknown(f"number of limits.{name} in {where}", key, legal)
    return tuple(replace(limit, **numbers.get(name, {})) for name, limit in usual.items())
