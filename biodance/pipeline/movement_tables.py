"""What moved as pandas tables: one row is one event, one cycle, one stride, one per cent of one cycle."""

from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.cycles.cut import PERCENT
from biodance.cycles.movement import TrialMovement
from biodance.cycles.steps import STRIDE_UNITS
from biodance.pipeline.movement import SessionMovement

if TYPE_CHECKING:
    from pandas import DataFrame

_CYCLE = ("trial", "cycle", "kind", "cycle_side", "start_s", "end_s", "off_s")


def movement_tables(moved: SessionMovement) -> dict[str, "DataFrame"]:
    """Return ``events``, ``cycles``, ``strides`` (spatio-temporal values, unit in the column's name),
    ``cycle_curves`` (every repetition by per cent), ``mean_curves`` and ``file_angles``.
    """
    import pandas as pd

    curves = [part for one in moved for part in _curves(one)]
    return {
        "events": pd.DataFrame(
            [(one.trial, e.time, e.side, e.down, e.source) for one in moved for e in one.events],
            columns=["trial", "time_s", "side", "down", "source"],
        ),
        "cycles": pd.DataFrame(
            [(*_named(one, k), c.start, c.end, c.off) for one in moved for k, c in enumerate(one.cycles)],
            columns=list(_CYCLE),
        ),
        "strides": _strides(moved),
        "cycle_curves": pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(columns=["trial"]),
        "mean_curves": moved.table(),
        "file_angles": pd.DataFrame(
            [
                (one.trial, a.joint, a.label, a.offset, a.sd, a.correlation, a.frames)
                for one in moved
                for a in one.file_angles
            ],
            columns=["trial", "joint", "label", "offset_deg", "sd_deg", "cc", "frames"],
        ),
    }


def _named(one: TrialMovement, number: int) -> tuple[Any, ...]:
    cycle = one.cycles[number]
    return one.trial, number + 1, cycle.kind, cycle.side


def _strides(moved: SessionMovement) -> "DataFrame":
    import pandas as pd

    columns = [f"{name}_{unit.replace('/', '_per_').replace('%', 'percent')}" for name, unit in STRIDE_UNITS.items()]
    rows = [
        (one.trial, one.cycles.index(s.cycle) + 1, s.cycle.side, *(s.values.get(name, np.nan) for name in STRIDE_UNITS))
        for one in moved
        for s in one.strides
    ]
    return pd.DataFrame(rows, columns=["trial", "cycle", "side", *columns])


def _curves(one: TrialMovement) -> list["DataFrame"]:
    import pandas as pd

    numbers = {id(cycle): k for k, cycle in enumerate(one.cycles)}
    parts = []
    for curve in one.curves:
        trial, number, kind, _ = _named(one, numbers[id(curve.cycle)])
        about = {"trial": trial, "cycle": number, "kind": kind, "quantity": curve.quantity, "side": curve.side}
        parts.append(
            pd.DataFrame(
                about | {"unit": curve.unit, "percent": PERCENT, "value": curve.value, "parameters_sd": curve.sd}
            )
        )
    return parts
