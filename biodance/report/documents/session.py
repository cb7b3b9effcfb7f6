"""results.json: what the pipeline found, under keys whose unit is their suffix. NaN becomes null."""

from typing import Any

import numpy as np

from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT, STRIDE_UNITS
from biodance.cycles.movement import TrialMovement
from biodance.lab.filters import force_filter, motion_filter
from biodance.motion.regressor import Agreement
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import ShownJoints, TrialResult, WrenchComparison
from biodance.records import CHANNELS
from biodance.report.documents.identification import added_mass_document, agreement, identification_document
from biodance.report.documents.plain import keyed


def movement_document(moved: SessionMovement) -> dict[str, Any]:
    """Return events, cycles, extremes of all mean curves and spatio-temporal values of every trial.

    ``parameters`` whose inertial parameters moments and powers are computed with, per ``mass_kg``; ``curves`` per
    quantity and side: extremes of the mean over ``count`` repetitions and where in the cycle; ``sd_mean`` between
    repetitions, ``parameters_sd_mean`` what the inertial parameters leave uncertain, both averaged over the cycle.
    """
    trials = [_moved(one) for one in moved.trials]
    return keyed(moved, "parameters mass_kg=mass") | {"trials": trials, "left_out": moved.left_out}


def _moved(one: TrialMovement) -> dict[str, Any]:
    strikes, leavings = one.late
    return {
        "trial": one.trial,
        "events": [keyed(event, "time_s=time side down source") for event in one.events],
        "markers_after_forces_s": {"strikes": strikes, "leavings": leavings},
        "cycles": [keyed(cycle, "kind side start_s=start end_s=end off_s=off") for cycle in one.cycles],
        "spatiotemporal": _spatiotemporal(one),
        "curves": [_curve(group) for group in one.groups],
        "file_angles": [keyed(a, "joint label offset_deg=offset sd_deg=sd cc=correlation") for a in one.file_angles],
        "file_events": [keyed(e, "down late_s=late sd_s=sd count missed") for e in one.file_events],
        "notes": one.notes,
    }


def _spatiotemporal(one: TrialMovement) -> list[dict[str, Any]]:
    rows = [(side, *row) for side in ("both", "left", "right") for row in one.spatiotemporal(side).items()]
    return [
        {"quantity": name, "unit": STRIDE_UNITS[name], "side": side, "mean": mean, "sd": sd, "count": count}
        for side, name, (mean, sd, count) in rows
    ]


def _curve(group: CurveGroup) -> dict[str, Any]:
    about = keyed(group, "kind quantity side unit") | {"count": len(group.values)}
    if not np.isfinite(group.mean).any():
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


def _wrench(comparison: WrenchComparison, identified: Agreement | None) -> dict[str, Any]:
    return {
        "channels": CHANNELS,
        "frames_used": int(comparison.used.sum()),
        "frames": comparison.used.size,
        "table": keyed(comparison, "rms cc=correlation"),
        "identified": identified and agreement(identified),
        "notes": comparison.notes,
    }


_STEP = "step=name status reason=text"
_STANDING = (
    "trial start_s=start end_s=end mass_kg=mass mass_sd_kg=mass_sd com_ahead_of_cop_m=com_ahead "
    "com_left_of_cop_m=com_left"
)


def _trial(result: TrialResult, identified: Agreement | None) -> dict[str, Any]:
    trial, fit, markers = result.trial, result.fit, result.trial.markers
    seen = zip(fit.names, fit.rms, fit.max, strict=True) if fit else ()
    return {
        **keyed(result, "name role=trial.role status reason file=trial.source.path.name marker_set=trial.worn"),
        "frames": markers.time.size if markers else 0,
        "rate_hz": markers.rate if markers else None,
        "gaps_percent": result.gaps_percent,
        "gaps": [keyed(gap, "marker=label percent longest_s=longest") for gap in result.gaps if gap.percent > 0],
        "marker_rms_m": fit and fit.total_rms,
        "marker_rms_by_group_m": fit and fit.by_group,
        "marker_max_m": fit and fit.total_max,
        "markers": [{"name": name, "rms_m": rms, "max_m": largest} for name, rms, largest in seen],
        "wrench": result.comparison and _wrench(result.comparison, identified),
        "standing": result.standing and keyed(result.standing, _STANDING),
        "plates": [keyed(plate, "name type corners_m=corners decisions") for plate in trial.plates],
        "steps": [keyed(step, _STEP) for step in result.steps],
        "history": trial.history,
        "warnings": trial.warnings,
    }


def filter_document(result: SessionResult) -> dict[str, Any]:
    """Return the cut-offs of the low-pass of joint coordinates and forces, the lowest of all moving trials and each:
    ``chosen_by`` the "settings", the "trial" itself, or "usual" where its markers do not tell.
    """
    asked = result.settings.filter.cutoff
    rows: list[dict[str, Any]] = []
    for one in (one.trial for one in result.trials if one.trial.role != "static"):
        markers, forces = motion_filter(one.settings).cutoff, force_filter(one.settings).cutoff
        by = "settings" if asked != "auto" else "usual" if one.settings.filter.cutoff == "auto" else "trial"
        rows.append({"trial": one.name, "markers_hz": markers, "forces_hz": forces, "chosen_by": by})
    lowest = min(rows, key=lambda row: row["markers_hz"], default={})
    return {key: lowest.get(key) for key in ("markers_hz", "forces_hz", "chosen_by")} | {"trials": rows}


def _mass_check(result: SessionResult) -> dict[str, Any]:
    weighed = keyed(result.weighed, "mass_on_plates_kg=mass mass_on_plates_sd_kg=sd weighed_by=by.value trials")
    first = {"trial": result.weighed.trials[0] if result.weighed else None}
    return first | weighed | keyed(result, "declared_mass_kg=declared_mass difference_percent=mass_difference")


def _optional_joints(shown: ShownJoints) -> dict[str, Any]:
    """Return what each joint beyond the 23 axes brings: to its markers (mm), and all to the vertical force (N)."""
    joints = [
        keyed(gain, "joint=name taken markers")
        | {
            "fitted_mm": 1000 * gain.fitted,
            "held_out_without_mm": 1000 * gain.without,
            "held_out_with_mm": 1000 * gain.with_it,
        }
        for gain in shown.gains
    ]
    forces = [keyed(one, "trial rms_without_N=without rms_with_N=with_them") for one in shown.forces]
    return {"optional_joints": joints, "optional_joints_force": forces}


def provenance_document(made: Provenance) -> dict[str, Any]:
    """Return which software made a result, from which files, with which settings."""
    return keyed(made, "created_utc=created commit versions blas inputs_sha256=inputs settings visit")


def results_document(result: SessionResult, provenance: Provenance) -> dict[str, Any]:
    """Return all of ``result`` as one JSON document; null where a step was refused or does not exist in this
    version.
    """
    found = result.identification
    agreements = found.agreements if found else {}
    return {
        "session": result.session.folder.name,
        "subject": keyed(result.subject, "name mass_kg=mass height_m=stature sex age guessed"),
        "trials": [_trial(trial, agreements.get(trial.name)) for trial in result.trials],
        "refused": result.session.refused,
        "notes": result.session.notes,
        "body": {
            "source": result.body_source,
            "notes": result.body.notes if result.body else (),
            **_optional_joints(result.shown_joints),
        },
        "steps": [keyed(step, _STEP) for step in result.steps],
        "checks": [vars(check) for check in result.all_checks],
        "filter": filter_document(result),
        "mass_check": _mass_check(result),
        "identification": found and identification_document(found),
        "added_mass": found and added_mass_document(found.search),
        "diagnosis": None,
        "provenance": provenance_document(provenance),
    }
