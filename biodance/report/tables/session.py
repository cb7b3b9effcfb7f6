"""What was found in a session and its trials, what moved, and the gait of all good cycles. NaN becomes null."""

import numpy as np

from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT
from biodance.cycles.scores import GaitScores
from biodance.lab.prepare import force_filter, motion_filter
from biodance.pipeline.movement import SessionMovement, spatiotemporal_rows
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import TrialResult
from biodance.records import CHANNELS, SIDES
from biodance.report.tables.identification import (
    AGREEMENT_ROW,
    CORRECTED_ROW,
    added_mass_document,
    identification_document,
)
from biodance.report.tables.schema import Row, Schema

_SPREAD = Schema("mean sd count")
_LEFT_OUT = Schema(
    "trial=cycle.trial side=cycle.side start_s=cycle.start end_s=cycle.end quantity because=because.value"
)
_MEAN = Schema("quantity side unit count=#values mean sd")
_KEY = Schema(
    "quantity key unit difference difference_ci95=ci95 symmetry_percent=symmetry",
    {
        "middle": _SPREAD,
        "right": _SPREAD,
        "left": _SPREAD,
        "beside": lambda one: {side: _SPREAD.row(told) for side, told in one.beside.items()},
        "conventional": lambda one: {side: _SPREAD.row(told) for side, told in one.conventional.items()},
    },
)


_SCORED = ("ours", "beside", "conventional")


def gait_document(moved: SessionMovement | None) -> Row | None:
    """Return the gait of a session; None where nobody walks.

    ``runs`` whether most strides have a flight; ``cycles`` how many count, by side; ``left_out`` what counts in no
    mean, and because of what ("shared_plate", "spike", "turn"; ``quantity`` "" = all of the cycle, "loads" = its
    moments, powers and ground reaction); ``curves`` (101 values at 0 to 100 %) mean and sd between cycles, of angles
    (deg), moments (N·m/kg), powers (W/kg), ground reaction (% of body weight), centre of pressure on the sole (m);
    ``beside`` plug-in gait's own where the files hold it, ``conventional`` the same model computed here; ``difference``
    right less left; ``scores`` null without a healthy reference.
    """
    if moved is None or moved.gait is None:
        return None
    found = moved.gait
    return {
        "runs": found.runs,
        "cycles": {side: sum(one.side == side for one in found.good) for side in SIDES},
        "trials": found.trials,
        "parameters": moved.parameters,
        "mass_kg": moved.mass,
        "left_out": _LEFT_OUT.rows(found.left_out),
        "foot_off_percent": {side: _SPREAD.told(found.off(side)) for side in SIDES},
        "spatiotemporal": [
            {"quantity": name, "unit": found.units[name], "side": side, **_SPREAD.row(told)}
            for side in ("both", *SIDES)
            for name, told in found.spatiotemporal(side).items()
        ],
        "curves": _MEAN.rows(found.groups),
        "curves_beside": _MEAN.rows(found.file_groups),
        "curves_conventional": _MEAN.rows(found.conventional_groups),
        "key_values": _KEY.rows(found.keys),
        "scores": dict(zip(_SCORED, map(_scores, moved.scores), strict=True)) if moved.scores[0] else None,
    }


def _scores(one: GaitScores | None) -> Row | None:
    """Return the scores of both sides (deg; the deviation index has no unit)."""
    if one is None:
        return None
    return {
        "people": one.people,
        "gait_profile_score_deg": {"both": one.overall, **{side: _SPREAD.row(told) for side, told in one.gps.items()}},
        "gait_deviation_index": {side: _SPREAD.row(told) for side, told in one.gdi.items()},
        "movement_analysis_profile": [
            {"quantity": name, "side": side, "unit": "deg", **_SPREAD.row(told)}
            for (name, side), told in one.variables.items()
        ],
    }


CHECK_ROW = Schema("what where value limit inside advice")
STEP_ROW = Schema("step=name status reason=text")
GAP_ROW = Schema(
    "marker=label percent longest_s=longest",
    shown="marker: {marker} | not seen (%): {percent:1} | longest gap (s): {longest_s:2}",
)
_WRENCH = Schema(
    "notes",
    {
        "channels": lambda _: CHANNELS,
        "frames_used": lambda one: int(one.used.sum()),
        "frames": lambda one: one.used.size,
        "table": Schema("rms cc=correlation").row,
    },
)


TRIAL_ROW = Schema(
    "name role=trial.role status reason file=trial.source.path.name marker_set=trial.worn "
    "rate_hz=trial.markers.rate gaps_percent marker_rms_m=fit.total_rms marker_rms_by_group_m=fit.by_group "
    "marker_max_m=fit.total_max history=trial.history warnings=trial.warnings",
    {
        "frames": lambda one: one.trial.markers.time.size if one.trial.markers else 0,
        "gaps": lambda one: GAP_ROW.rows(gap for gap in one.gaps if gap.percent > 0),
        "markers": lambda one: [
            {"name": name, "rms_m": rms, "max_m": largest}
            for name, rms, largest in (zip(one.fit.names, one.fit.rms, one.fit.max, strict=True) if one.fit else ())
        ],
        "wrench": _WRENCH.at("comparison"),
        "standing": Schema(
            "trial start_s=start end_s=end mass_kg=mass mass_sd_kg=mass_sd com_ahead_of_cop_m=com_ahead "
            "com_left_of_cop_m=com_left"
        ),
        "plates": Schema("name type corners_m=corners decisions").at("trial.plates"),
        "steps": STEP_ROW,
    },
    "trial: {name} | role: {role} | state: {status} | markers RMS: {marker_rms_m:mm1 mm} | "
    "frames: {wrench[frames_used]} | Fz RMS: {wrench[table][rms][2]:1 N} | Fz cc: {wrench[table][cc][2]:3}",
)
_JOINT = Schema(
    "joint=name taken markers",
    {
        "fitted_mm": lambda gain: 1000 * gain.fitted,
        "held_out_without_mm": lambda gain: 1000 * gain.without,
        "held_out_with_mm": lambda gain: 1000 * gain.with_it,
    },
)


def filter_document(result: SessionResult) -> Row:
    """Return the low-pass cut-offs, the lowest and each moving trial's, and by whom they were ``chosen_by``."""
    asked = result.settings.filter.cutoff
    rows: list[Row] = []
    for one in (one.trial for one in result.trials if one.trial.role != "static"):
        markers, forces = motion_filter(one.settings).cutoff, force_filter(one.settings).cutoff
        by = "settings" if asked != "auto" else "usual" if one.settings.filter.cutoff == "auto" else "trial"
        rows.append({"trial": one.name, "markers_hz": markers, "forces_hz": forces, "chosen_by": by})
    lowest = min(rows, key=lambda row: row["markers_hz"], default={})
    return {key: lowest.get(key) for key in ("markers_hz", "forces_hz", "chosen_by")} | {"trials": rows}


_SESSION = Schema(
    "session=session.folder.name subject trials refused=session.refused notes=session.notes steps",
    {
        "subject": Schema("name mass_kg=mass height_m=stature sex age guessed prosthesis devices_kg=devices"),
        "trials": lambda one: [_trial(trial, one) for trial in one.trials],
        "steps": STEP_ROW,
        "body": Schema(
            "source=placed.source notes=body.notes",
            {
                "optional_joints": _JOINT.at("placed.gains"),
                "optional_joints_force": Schema("trial rms_without_N=without rms_with_N=with_them").at("joint_forces"),
            },
        ).row,
        "checks": CHECK_ROW.at("all_checks"),
        "filter": filter_document,
        "mass_check": Schema(
            "trial=weighed.trials.0 mass_on_plates_kg=weighed.mass mass_on_plates_sd_kg=weighed.sd "
            "weighed_by=weighed.by.value trials=weighed.trials declared_mass_kg=subject.declared_mass "
            "difference_percent=mass_difference"
        ).row,
        "identification": lambda one: one.identification and identification_document(one.identification),
        "corrected": lambda one: CORRECTED_ROW.rows(one.identification.corrected) if one.identification else [],
        "added_mass": lambda one: one.identification and added_mass_document(one.identification.search),
        "diagnosis": lambda _: None,
    },
)


def _trial(one: TrialResult, result: SessionResult) -> Row:
    row, found = TRIAL_ROW.row(one), result.identification
    if row["wrench"]:
        row["wrench"]["identified"] = AGREEMENT_ROW.told(found.agreements.get(one.name) if found else None)
    return row


def results_document(result: SessionResult, provenance: Row) -> Row:
    """Return all of ``result``; null where a step was refused or does not exist in this version."""
    return {**_SESSION.row(result), "provenance": provenance}


def _curve(group: CurveGroup) -> Row:
    about = Schema("kind quantity side unit count=#values").row(group)
    if not np.isfinite(group.mean).any():
        return about
    low, high = int(np.nanargmin(group.mean)), int(np.nanargmax(group.mean))
    spread, told = (
        float(np.nanmean(values)) if np.isfinite(values).any() else None for values in (group.sd, group.parameters_sd)
    )
    return about | {
        "min": group.mean[low],
        "min_at_percent": PERCENT[low],
        "max": group.mean[high],
        "max_at_percent": PERCENT[high],
        "sd_mean": spread,
        "parameters_sd_mean": told,
    }


EVENT_ROW = Schema("time_s=time side down source")
FILE_ANGLE_ROW = Schema(
    "joint label offset_deg=offset sd_deg=sd cc=correlation conventional_rms_deg=conventional",
    shown="trial: {trial} | joint: {joint:name} | offset (deg): {offset_deg:1} | sd (deg): {sd_deg:1} | "
    "correlation: {cc:2} | same model (deg): {conventional_rms_deg:1}",
)
_MOVED = Schema(
    "trial notes",
    {
        "events": EVENT_ROW,
        "markers_after_forces_s": lambda one: dict(zip(("strikes", "leavings"), one.late, strict=True)),
        "cycles": Schema("kind side start_s=start end_s=end off_s=off"),
        "spatiotemporal": spatiotemporal_rows,
        "curves": lambda one: [_curve(group) for group in one.groups],
        "file_angles": FILE_ANGLE_ROW,
        "file_events": Schema("down late_s=late sd_s=sd count missed"),
    },
)
_MOVEMENT = Schema("parameters mass_kg=mass left_out", {"trials": _MOVED})


def movement_document(moved: SessionMovement | None) -> Row | None:
    """Return events, cycles, extremes of all mean curves and spatio-temporal values of every trial.

    ``parameters`` whose inertial parameters moments and powers are computed with, per ``mass_kg``; ``curves`` per
    quantity and side: extremes of the mean over ``count`` repetitions and where in the cycle; ``sd_mean`` between
    repetitions, ``parameters_sd_mean`` what the inertial parameters leave uncertain, both averaged over the cycle.
    """
    return _MOVEMENT.told(moved)
