"""What the cycles of several visits have in common, each quantity with its interval and its change."""

from collections.abc import Iterator, Sequence

import numpy as np

from biodance.cycles.keys import KeyValue, key_values, leading_foot, stride_values
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.visit_quantity import ComparedQuantity, Untested
from biodance.uncertainty.visits import (
    FEWEST_STRIDES,
    KeyKind,
    VisitMean,
    change_of_mean,
    placement_sd,
    visit_mean,
)

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
