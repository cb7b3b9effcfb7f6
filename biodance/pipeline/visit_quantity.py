"""One quantity of several visits."""

from dataclasses import dataclass
from enum import StrEnum


class Untested(StrEnum):
    """Why a change has no interval."""

    NO = ""
    FEW_CYCLES = "few cycles"
    NOT_KNOWN = "not known"


@dataclass(frozen=True, kw_only=True)
class ComparedQuantity:
    """One quantity in two or more visits: ``kind`` of the cycles ("body" for masses), ``quantity`` with its ``key``
    ("maximum", ...; "" where it is a number by itself), ``side``.

    ``values`` in ``unit``, one a visit (None = not known there), each with its 95 % interval ``ci95`` and over how many
    cycles (``counts``; 0 of a mass). ``change``, the last less the first, with ``change_ci95`` and ``p`` of one at
    least as large if nothing had changed; None where too little is known, ``why`` says of what. ``placement_sd`` what
    placing the markers adds in the last visit (None = no part of it). ``changed`` beyond chance.
    """

    kind: str
    quantity: str
    key: str
    side: str
    unit: str
    values: tuple[float | None, ...]
    ci95: tuple[tuple[float, float] | None, ...]
    counts: tuple[int, ...]
    change: float
    change_ci95: tuple[float, float] | None
    p: float | None
    placement_sd: float | None = None
    why: Untested = Untested.NO
    changed: bool = False

    @property
    def name(self) -> str:
        """``knee_flexion_maximum``, or the quantity alone."""
        return f"{self.quantity}_{self.key}" if self.key else self.quantity

    @property
    def distance(self) -> float:
        """The change in half widths of its interval; 0 where there is none."""
        if self.change_ci95 is None:
            return 0.0
        half = (self.change_ci95[1] - self.change_ci95[0]) / 2
        return abs(self.change) / half if half > 0 else (float("inf") if self.change else 0.0)
