"""Checks that run before any statistics: a cause that a look at the recording settles is named here, and never fitted.

Units, signs, swapped labels, clipping, hum and clocks are wrong or right, not a little of both. The author of a discrete effect writes
ONE method, ``look``: what it checked, whether that is well, and in one plain sentence what it saw. A check that cannot judge a recording
(no plate, no body) returns nothing.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from biodance.effects._base.case import Case
from biodance.records import Session


@dataclass(frozen=True)
class Gate:
    """One check: ``check`` what was looked at, ``ok``, ``text`` one plain sentence of what was seen; where it is not well the cause:
    ``effect`` and ``target`` as in the family, and the ``size`` of its ``quantity`` in ``unit`` (NaN = no number); ``advice`` how the
    effect is mended (filled in by `gates`).
    """

    check: str
    ok: bool
    text: str
    effect: str = ""
    target: str = ""
    size: float = float("nan")
    quantity: str = "size"
    unit: str = ""
    advice: str = ""


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the checks look at: the ``session`` as read, and the tracked ``cases`` (none where no body could be scaled)."""

    session: Session
    cases: tuple[Case, ...] = ()


class DiscreteEffect(ABC):
    """One cause that is there or not; the checks that find it are its ``look``, and a file without it is refused when it is found."""

    name: ClassVar[str] = ""
    separated_by: ClassVar[str] = ""
    """The movement or measurement that settles it, in words for the analyst."""
    advice: ClassVar[str] = ""
    """How it is mended."""

    @classmethod
    @abstractmethod
    def look(cls, recorded: Recorded) -> tuple[Gate, ...]:
        """Return the checks that could be made on the recording."""


def unit_of(target: str) -> str:
    """Return the unit of the channel that a target names last: N or N·m."""
    return "N·m" if target.rpartition(":")[2].startswith("M") else "N"
