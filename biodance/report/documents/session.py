"""results.json: what the pipeline found, under keys whose unit is their suffix. NaN becomes null."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT, STRIDE_UNITS, Cycle
from biodance.cycles.movement import TrialMovement
from biodance.motion.quiet_standing import QuietStanding
from biodance.motion.regressor import Agreement
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import ShownJoints, TrialResult, WrenchComparison
from biodance.records import CHANNELS, Plate
from biodance.report.documents.identification import added_mass_document, agreement, identification_document


def movement_document(moved: SessionMovement) -> dict[str, Any]:
    """Return events, cycles, extremes of all mean curves and spatio-temporal values of every trial.

    ``parameters`` whose inertial parameters moments and powers are computed with, per ``mass_kg``; ``curves`` per
    quantity and side: extremes of the mean over ``count`` repetitions and where in the cycle; ``sd_mean`` between
    repetitions, ``parameters_sd_mean`` what the inertial parameters leave uncertain, both averaged over the cycle.
    """
    return {
        "parameters": moved.parameters,
        "mass_kg": moved.mass,
        "trials": [_moved(one) for one in moved.trials],
        "left_out": moved.left_out,
    }


def _moved(one: TrialMovement) -> dict[str, Any]:
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
    about: dict[str, Any] = {"kind": group.kind, "quantity": group.quantity}
    about |= {"side": group.side, "unit": group.unit}
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


def plain_values(value: object) -> Any:
    """Return ``value`` made of dict, list, str, int, float, bool and None only; a number that is not finite becomes
    None.
    """
    if isinstance(value, float) and not isinstance(value, np.generic):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain_values(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain_values(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_values(item) for item in value]
    if isinstance(value, np.generic):
        return plain_values(value.item())
    return value if value is None or isinstance(value, str | int | bool) else str(value)


def to_text(document: object) -> str:
    """Return one JSON document as text (indented, keys in their order, newline at the end)."""
    return json.dumps(plain_values(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _plate(plate: Plate) -> dict[str, Any]:
    return {"name": plate.name, "type": plate.type, "corners_m": plate.corners, "decisions": plate.decisions}


def _wrench(comparison: WrenchComparison, identified: Agreement | None) -> dict[str, Any]:
    return {
        "channels": CHANNELS,
        "frames_used": int(comparison.used.sum()),
        "frames": comparison.used.size,
        "table": {"rms": comparison.rms, "cc": comparison.correlation},
        "identified": None if identified is None else agreement(identified),
        "notes": comparison.notes,
    }


def _standing(standing: QuietStanding) -> dict[str, Any]:
    return {
        "trial": standing.trial,
        "start_s": standing.start,
        "end_s": standing.end,
        "mass_kg": standing.mass,
        "mass_sd_kg": standing.mass_sd,
        "com_ahead_of_cop_m": standing.com_ahead,
        "com_left_of_cop_m": standing.com_left,
    }


def _trial(result: TrialResult, identified: Agreement | None) -> dict[str, Any]:
    trial, fit = result.trial, result.fit
    return {
        "name": trial.name,
        "role": trial.role,
        "status": result.status,
        "reason": result.reason,
        "file": trial.source.path.name,
        "marker_set": trial.worn,
        "frames": 0 if trial.markers is None else trial.markers.time.size,
        "rate_hz": None if trial.markers is None else trial.markers.rate,
        "gaps_percent": result.gaps_percent,
        "gaps": [
            {"marker": g.label, "percent": g.percent, "longest_s": g.longest} for g in result.gaps if g.percent > 0
        ],
        "marker_rms_m": None if fit is None else fit.total_rms,
        "marker_rms_by_group_m": None if fit is None else dict(fit.by_group),
        "marker_max_m": None if fit is None else fit.total_max,
        "markers": []
        if fit is None
        else [{"name": n, "rms_m": r, "max_m": m} for n, r, m in zip(fit.names, fit.rms, fit.max, strict=True)],
        "wrench": None if result.comparison is None else _wrench(result.comparison, identified),
        "standing": None if result.standing is None else _standing(result.standing),
        "plates": [_plate(plate) for plate in trial.plates],
        "steps": [{"step": s.name, "status": s.status, "reason": s.text} for s in result.steps],
        "history": trial.history,
        "warnings": trial.warnings,
    }


def _mass_check(result: SessionResult) -> dict[str, Any]:
    standing = result.standing
    return {
        "trial": standing.trial if standing else None,
        "mass_on_plates_kg": standing.mass if standing else None,
        "mass_on_plates_sd_kg": standing.mass_sd if standing else None,
        "declared_mass_kg": result.declared_mass,
        "difference_percent": result.mass_difference,
    }


def _optional_joints(shown: ShownJoints) -> dict[str, Any]:
    """Return what each joint beyond the 23 axes brings: to its markers (mm), and all to the vertical force (N)."""
    return {
        "optional_joints": [
            {
                "joint": gain.name,
                "taken": gain.taken,
                "markers": gain.markers,
                "fitted_mm": 1000 * gain.fitted,
                "held_out_without_mm": 1000 * gain.without,
                "held_out_with_mm": 1000 * gain.with_it,
            }
            for gain in shown.gains
        ],
        "optional_joints_force": [
            {"trial": one.trial, "rms_without_N": one.without, "rms_with_N": one.with_them} for one in shown.forces
        ],
    }


def results_document(result: SessionResult, provenance: Provenance) -> dict[str, Any]:
    """Return all of ``result`` as one JSON document; null where a step was refused or does not exist in this
    version.
    """
    subject, found = result.subject, result.identification
    return {
        "session": result.session.folder.name,
        "subject": {
            "name": subject.name,
            "mass_kg": subject.mass,
            "height_m": subject.stature,
            "sex": subject.sex,
            "age": subject.age,
            "guessed": subject.guessed,
        },
        "trials": [_trial(trial, found.agreements.get(trial.trial.name) if found else None) for trial in result.trials],
        "refused": dict(result.session.refused),
        "notes": result.session.notes,
        "body": {
            "source": result.body_source,
            "notes": result.body.notes if result.body else (),
            **_optional_joints(result.shown_joints),
        },
        "steps": [{"step": s.name, "status": s.status, "reason": s.text} for s in result.steps],
        "checks": [vars(check) for check in result.all_checks],
        "mass_check": _mass_check(result),
        "identification": None if found is None else identification_document(found),
        "added_mass": None if found is None else added_mass_document(found.search),
        "diagnosis": None,
        "provenance": provenance.as_dict(),
    }
