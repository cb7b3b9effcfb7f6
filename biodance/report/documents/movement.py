"""What moved, under keys whose unit is their suffix; the curves themselves are in the tables (``--tables``)."""

from typing import Any

import numpy as np

from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT, Cycle
from biodance.cycles.movement import TrialMovement
from biodance.cycles.steps import STRIDE_UNITS
from biodance.pipeline.movement import SessionMovement


def movement_document(moved: SessionMovement) -> dict[str, Any]:
    """Return events, cycles, extremes of all mean curves and spatio-temporal values of every trial.

    ``parameters`` whose inertial parameters moments and powers are computed with, per ``mass_kg``; ``curves`` per
    quantity and side: extremes of the mean over ``count`` repetitions and where in the cycle; ``sd_mean`` between
    repetitions, ``parameters_sd_mean`` what the inertial parameters leave uncertain, both averaged over the cycle.
    """
    return {
        "parameters": moved.parameters,
        "mass_kg": moved.mass,
        "trials": [_trial(one) for one in moved.trials],
        "left_out": moved.left_out,
    }


def _trial(one: TrialMovement) -> dict[str, Any]:
    strikes, leavings = one.late
    return {
        "trial": one.trial,
        "events": [{"time_s": e.time, "side": e.side, "down": e.down, "source": e.source} for e in one.events],
        "markers_after_forces_s": {"strikes": strikes, "leavings": leavings},
        "cycles": [_cycle(cycle) for cycle in one.cycles],
        "spatiotemporal": _spatiotemporal(one),
        "curves": [_curve(group) for group in one.groups],
        "file_angles": [
            {"joint": a.joint, "label": a.label, "offset_deg": a.offset, "sd_deg": a.sd, "cc": a.correlation}
            for a in one.file_angles
        ],
        "file_events": [
            {"down": e.down, "late_s": e.late, "sd_s": e.sd, "count": e.count, "missed": e.missed}
            for e in one.file_events
        ],
        "notes": one.notes,
    }


def _cycle(one: Cycle) -> dict[str, Any]:
    return {"kind": one.kind, "side": one.side, "start_s": one.start, "end_s": one.end, "off_s": one.off}


def _spatiotemporal(one: TrialMovement) -> list[dict[str, Any]]:
    rows = [(side, *row) for side in ("both", "left", "right") for row in one.spatiotemporal(side).items()]
    return [
        {"quantity": name, "unit": STRIDE_UNITS[name], "side": side, "mean": mean, "sd": sd, "count": count}
        for side, name, (mean, sd, count) in rows
    ]


def _curve(group: CurveGroup) -> dict[str, Any]:
    known = np.isfinite(group.mean)
    about = {"kind": group.kind, "quantity": group.quantity, "side": group.side, "unit": group.unit}
    about["count"] = len(group.values)
    if not known.any():
        return about
    low, high = int(np.nanargmin(group.mean)), int(np.nanargmax(group.mean))
    return about | {
        "min": group.mean[low],
        "min_at_percent": PERCENT[low],
        "max": group.mean[high],
        "max_at_percent": PERCENT[high],
        "sd_mean": _average(group.sd),
        "parameters_sd_mean": _average(group.parameters_sd),
    }


def _average(values: Any) -> float | None:
    return float(np.nanmean(values)) if np.isfinite(values).any() else None
