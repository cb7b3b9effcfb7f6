"""What several visits have in common: cycles and masses, each quantity with its interval and its change."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import ndtr

from biodance.cycles.keys import KeyValue, key_values, leading_foot, stride_values
from biodance.errors import BiodanceError
from biodance.identification.knowledge import SIGMAS, Known
from biodance.identification.sessions import Difference, differences
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.trial_result import Weighing
from biodance.records import side_in_name
from biodance.uncertainty.visits import (
    FEWEST_STRIDES,
    KeyKind,
    VisitMean,
    change_of_mean,
    placement_sd,
    visit_mean,
)


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


_About = tuple[str, str, str]
"""Kind of cycle, name of the quantity, side."""


def cycle_quantities(visits: Sequence[SessionMovement]) -> Iterator[ComparedQuantity]:
    """Yield the key values and spatio-temporal values that the first and the last visit have in common, over all trials
    of each.
    """
    foot = leading_foot([[stride for trial in one for stride in trial.strides] for one in visits])
    seen = [_values(one, foot) for one in visits]
    for about in seen[0]:
        if about in seen[-1]:
            yield _compared(about, [one.get(about, []) for one in seen])


def _values(moved: SessionMovement, foot: str) -> dict[_About, list[KeyValue]]:
    """Return all values of each quantity in a visit, over all its trials."""
    found: dict[_About, list[KeyValue]] = {}
    for trial in moved:
        for one in (*stride_values(trial.strides, leading=foot), *key_values(trial.curves)):
            found.setdefault((one.cycle.kind, one.name, one.side), []).append(one)
    return found


def _mean(some: Sequence[KeyValue]) -> VisitMean:
    """Return what a visit says of a quantity, with what all its cycles share."""
    shared = float(np.hypot(placement_sd(_kind(some)), np.mean([one.sd for one in some])))
    return visit_mean(np.array([one.value for one in some]), systematic=shared)


def _kind(some: Sequence[KeyValue]) -> KeyKind:
    """Return what says how far placing the markers anew moves a quantity, of which these are the values in a visit."""
    rate, span, beside = np.mean([(one.rate, one.span, one.beside) for one in some], axis=0).tolist()
    return KeyKind(quantity=some[0].quantity, key=some[0].key, unit=some[0].unit, rate=rate, span=span, beside=beside)


def _compared(about: _About, seen: Sequence[Sequence[KeyValue]]) -> ComparedQuantity:
    """Return one quantity of which the first and the last visit have values."""
    one, means = seen[0][0], [_mean(some) if some else None for some in seen]
    first, last = _mean(seen[0]), _mean(seen[-1])
    change, few = change_of_mean(first, last), min(first.count, last.count) < FEWEST_STRIDES
    return ComparedQuantity(
        kind=about[0], quantity=one.quantity, key=one.key, side=about[2], unit=one.unit,
        values=tuple(mean.mean if mean else None for mean in means),
        ci95=tuple(mean.interval if mean else None for mean in means),
        counts=tuple(map(len, seen)),
        change=change.value, change_ci95=change.interval, p=change.p, placement_sd=placement_sd(_kind(seen[-1])),
        why=Untested.FEW_CYCLES if few else Untested.NO,
    )  # fmt: skip


BODY_KIND = "body"
"""Where the cycles of other quantities have their kind."""


def mass_quantities(
    visits: Sequence[tuple[SessionIdentification | None, Weighing | None]],
    refusals: Sequence[str],
    *,
    tell: Callable[[str], None],
) -> tuple[list[ComparedQuantity], list[str]]:
    """Return the masses that the first and the last visit have in common, and why others are not compared.

    ``refusals`` why a visit says nothing of the body, "" where it does. Those of the segments are what
    `biodance.compare_sessions` returns.
    """
    found, notes = [], [why for why in (refusals[0], refusals[-1]) if why]
    weighed = [one for _, one in visits]
    if weighed[0] is not None and weighed[-1] is not None:
        found.append(_whole(weighed, weighed[0], weighed[-1]))
    first, last = visits[0][0], visits[-1][0]
    if first is None or last is None:
        return found, [f"The masses of the segments are not compared: {why}" for why in notes]
    tell("comparing the bodies")
    try:
        changes = differences(first.identification, last.identification)
    except BiodanceError as why:
        return found, [f"The masses of the segments are not compared: {why}"]
    masses = [_by_segment(one) for one, _ in visits]
    found += [_segment(one, [some.get(one.segment) for some in masses]) for one in changes if one.quantity == "mass"]
    return found, []


def _by_segment(one: SessionIdentification | None) -> dict[str, Known]:
    rows = one.identification.known if one is not None else ()
    return {row.segment: row for row in rows if row.quantity == "mass"}


def _whole(weighed: Sequence[Weighing | None], first: Weighing, last: Weighing) -> ComparedQuantity:
    """Return the mass that the plates carry, each visit with its own error."""
    change, sd = last.mass - first.mass, float(np.hypot(first.sd, last.sd))
    return ComparedQuantity(
        kind=BODY_KIND, quantity="total_mass", key="", side="both", unit="kg",
        values=tuple(one.mass if one else None for one in weighed),
        ci95=tuple((one.mass - SIGMAS * one.sd, one.mass + SIGMAS * one.sd) if one else None for one in weighed),
        counts=(0,) * len(weighed),
        change=change, change_ci95=(change - SIGMAS * sd, change + SIGMAS * sd), p=float(2 * ndtr(-abs(change) / sd)),
    )  # fmt: skip


def _segment(one: Difference, known: Sequence[Known | None]) -> ComparedQuantity:
    """Return the mass of one segment; a change of which neither visit's data know anything is not tested."""
    side = side_in_name(one.segment)
    return ComparedQuantity(
        kind=BODY_KIND, quantity=f"{one.segment.removeprefix(f'{side}_')}_mass", key="", side=side, unit="kg",
        values=tuple(row.value if row else None for row in known),
        ci95=tuple(row.interval if row else None for row in known),
        counts=(0,) * len(known), change=one.value, change_ci95=one.interval if one.known else None,
        p=one.p if one.known else None, why=Untested.NO if one.known else Untested.NOT_KNOWN,
    )  # fmt: skip
