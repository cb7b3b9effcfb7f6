"""What was found in a session and its trials, what moved, and the gait of all good cycles: as a document for programs,
in which NaN becomes null, and as pandas tables: tidy, units in the names of the columns, angles in degrees.

One row of a table is one segment, one check, one marker of a trial, one frame of a trial, one parameter of a finding;
everything else is SI.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.cycles import TrialMovement
from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT
from biodance.cycles.scores import GaitScores
from biodance.cycles.strides import STRIDE_UNITS
from biodance.diagnosis.diagnosis import Diagnosis
from biodance.lab.prepare import force_filter, motion_filter
from biodance.lab.session.results_folder import whole_folder
from biodance.motion.dynamics import predict_wrench
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.movement import SessionMovement, spatiotemporal_rows
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import TrialResult
from biodance.records import CHANNELS, SIDES, AngleState, Array
from biodance.report.files import write_tables
from biodance.report.tables.diagnosis import LIMIT_ROW
from biodance.report.tables.identification import (
    AGREEMENT_ROW,
    CORRECTED_ROW,
    TENSOR_ORDER,
    added_mass_document,
    identification_document,
    segment_rows,
)
from biodance.report.tables.schema import Row, Schema, table_of

if TYPE_CHECKING:
    from pandas import DataFrame


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
        "scores": dict(zip(("ours", "beside", "conventional"), map(_scores, moved.scores), strict=True))
        if moved.scores[0]
        else None,
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


def movement_document(moved: SessionMovement | None) -> Row | None:
    """Return events, cycles, extremes of all mean curves and spatio-temporal values of every trial.

    ``parameters`` whose inertial parameters moments and powers are computed with, per ``mass_kg``; ``curves`` per
    quantity and side: extremes of the mean over ``count`` repetitions and where in the cycle; ``sd_mean`` between
    repetitions, ``parameters_sd_mean`` what the inertial parameters leave uncertain, both averaged over the cycle.
    """
    return Schema("parameters mass_kg=mass left_out", {"trials": _MOVED}).told(moved)


_CYCLE = Schema("cycle=0 kind=1.kind cycle_side=1.side start_s=1.start end_s=1.end off_s=1.off")
"""Of the number of a cycle in its trial, and the cycle."""
_FILE_ANGLE = Schema(f"{FILE_ANGLE_ROW.fields} frames")


def _by_trial(schema: Schema, records: Mapping[str, Iterable[Any]]) -> "DataFrame":
    """Return one table of the records of all trials, the trial in front."""
    rows = (row for trial, some in records.items() for row in schema.rows(some, trial=trial))
    return table_of(rows, ("trial", *schema.places))


def _strides(moved: SessionMovement) -> "DataFrame":
    plain = {unit: unit.replace("/", "_per_").replace("%", "percent") for unit in STRIDE_UNITS.values()}
    columns, rows = {name: f"{name}_{plain[unit]}" for name, unit in STRIDE_UNITS.items()}, []
    for one in moved:
        for stride in one.strides:
            about = {"trial": one.trial, "cycle": one.cycles.index(stride.cycle) + 1, "side": stride.cycle.side}
            rows.append(about | {column: stride.values.get(name) for name, column in columns.items()})
    return table_of(rows, ("trial", "cycle", "side", *columns.values()))


def _curves(one: TrialMovement) -> "DataFrame | None":
    if not one.curves:
        return None
    # a curve holds the very cycle of the list, so that no values need to be compared
    numbers = {id(cycle): k for k, cycle in enumerate(one.cycles, start=1)}
    about = Schema("kind=cycle.kind quantity side unit")
    rows = [{"trial": one.trial, "cycle": numbers[id(curve.cycle)], **about.row(curve)} for curve in one.curves]
    frame = table_of(rows, ("trial", "cycle", *about.places))
    # one row a curve becomes one row a per cent, its values in the same order
    lasting = frame.loc[frame.index.repeat(len(PERCENT))].reset_index(drop=True)
    lasting["percent"] = np.tile(PERCENT, len(rows))
    lasting["value"] = np.concatenate([curve.value for curve in one.curves])
    lasting["parameters_sd"] = np.concatenate([np.broadcast_to(curve.sd, curve.value.shape) for curve in one.curves])
    return lasting


_UNITS = {"F": "N", "M": "Nm"}
_TRIAL = Schema(
    "trial=name role=trial.role status reason marker_rms_m=fit.total_rms marker_max_m=fit.total_max gaps_percent "
    "frames_used",
    {"frames_used": lambda one: int(one.comparison.used.sum()) if one.comparison else 0},
)
_MARKERS = ("trial", "marker", "rms_m", "max_m", "gaps_percent", "longest_gap_s")
_VALIDATION = (
    *("trial", "kept", "channel", "unit"),
    *("rms_table", "rms_identified", "correlation_table", "correlation_identified"),
)
_STATE = Schema("joint state=state.words start_s=start end_s=end")
_FINDING = Schema(
    "effect=0.effect target=0.target parameter=1.name value=1.value sd=1.sd unit=1.unit probability=0.probability "
    "visible_fraction=0.visible_fraction log_bayes_factor=0.log_bayes_factor gain_low=0.gain.ci95.0 "
    "gain_high=0.gain.ci95.1 advice=0.advice"
)
"""Of a finding, and one of its parameters."""
_ADEQUACY = Schema("channel band_low_hz=band_hz.0 band_high_hz=band_hz.1 z trial second_s=second")


def session_tables(
    result: SessionResult, diagnosis: Diagnosis | None = None, movement: SessionMovement | None = None
) -> dict[str, "DataFrame"]:
    """Return all tables of a session by name.

    Always ``trials``, ``checks``, ``markers`` (distance to the model), ``marker_residuals`` (m by frame), ``angles``
    (deg by frame; empty where not determined), ``angle_states`` (when an angle is filled or not determined), ``wrench``
    (N, N·m by frame: measured, of the table's body, of the identified one, about the lab origin; what plates are known
    to read is in neither); with an identification ``segments``, ``moments`` (N·m by frame, of the trial whose feet are
    known; empty where the posture is not determined) and ``validation``; with a diagnosis ``findings``,
    ``unobservable`` and ``adequacy``; with a movement ``events``, ``cycles``, ``strides`` (spatio-temporal values, unit
    in the column's name), ``cycle_curves`` (every repetition by per cent), ``mean_curves`` and ``file_angles``. A table
    without rows has its columns all the same.
    """
    found = result.identification
    tables = {
        "trials": _TRIAL.frame(result.trials),
        "checks": CHECK_ROW.frame(result.all_checks),
        "markers": table_of((row for one in result.trials for row in _markers(one)), _MARKERS),
        "marker_residuals": _joined(map(_residuals, result.trials)),
        "angles": _joined(_angles(result, one) for one in result.trials),
        "angle_states": _by_trial(_STATE, {one.name: one.motion.spans() for one in result.trials if one.motion}),
        "wrench": _joined(_wrench(result, one) for one in result.trials),
    }
    if found is not None:
        tables |= {"segments": _segments(found), "moments": _moments(found), "validation": _validation(found)}
    if diagnosis is not None:
        tables |= {
            "findings": _FINDING.frame((one, size) for one in diagnosis.findings for size in one.parameters),
            "unobservable": LIMIT_ROW.frame(diagnosis.unobservable),
            "adequacy": _ADEQUACY.frame(diagnosis.adequacy),
        }
    if movement is not None:
        tables |= {
            "events": _by_trial(EVENT_ROW, {one.trial: one.events for one in movement}),
            "cycles": _by_trial(_CYCLE, {one.trial: enumerate(one.cycles, start=1) for one in movement}),
            "strides": _strides(movement),
            "cycle_curves": _joined(map(_curves, movement), ("trial",)),
            "mean_curves": movement.table(),
            "file_angles": _by_trial(_FILE_ANGLE, {one.trial: one.file_angles for one in movement}),
        }
    return tables


def write_session_tables(
    folder: Path | None,
    result: SessionResult,
    diagnosis: Diagnosis | None = None,
    *,
    movement: SessionMovement | None = None,
) -> None:
    """Write the tables of a session in the place of those that its folder holds; nothing without one."""
    if folder is not None:
        with whole_folder(folder, over=True) as part:
            write_tables(session_tables(result, diagnosis, movement), part)


def _joined(parts: Iterable["DataFrame | None"], columns: Sequence[str] = ("trial", "time_s")) -> "DataFrame":
    """Return several trials' tables below each other, with ``columns`` at least; what one lacks is empty there."""
    import pandas as pd

    some = [part for part in parts if part is not None]
    return pd.concat(some, ignore_index=True) if some else table_of((), columns)


def _by_frame(trial: str, time: Array, columns: Mapping[str, Any]) -> "DataFrame":
    import pandas as pd

    return pd.DataFrame({"trial": np.full(time.size, trial, dtype=object), "time_s": time, **columns})


def _markers(one: TrialResult) -> Iterator[Row]:
    """Yield every marker with its distance to the model and what was not seen of it."""
    fit, gaps = one.fit, {gap.label: (gap.percent, gap.longest) for gap in one.gaps}
    far = {name: (rms, most) for name, rms, most in zip(fit.names, fit.rms, fit.max, strict=True)} if fit else {}
    for name in dict.fromkeys((*gaps, *far)):
        values = (one.name, name, *far.get(name, (None, None)), *gaps.get(name, (None, None)))
        yield dict(zip(_MARKERS, values, strict=True))


def _residuals(one: TrialResult) -> "DataFrame | None":
    motion = one.motion
    if motion is None:
        return None
    columns = {f"{name}_m": motion.residual[:, k] for k, name in enumerate(motion.marker_names)}
    return _by_frame(one.name, motion.time, columns)


def _angles(result: SessionResult, one: TrialResult) -> "DataFrame | None":
    if one.motion is None or result.body is None:
        return None
    names, motion = [joint.name for joint in result.body.joints], one.motion
    state = [AngleState(one).words for one in motion.frame_state]
    columns: dict[str, Any] = {"determined": motion.determined, "state": state}
    columns |= {f"{name}_deg": motion.known_angles[:, j] for j, name in enumerate(names)}
    return _by_frame(one.name, motion.time, columns)


def _wrench(result: SessionResult, one: TrialResult) -> "DataFrame | None":
    found = one.comparison
    if found is None or one.motion is None:
        return None
    columns: dict[str, Any] = {"used": found.used} | _six("measured", found.measured) | _six("table", found.simulated)
    if result.identification is not None:
        columns |= _six("identified", predict_wrench(result.identification.identification.identified, one.motion).value)
    return _by_frame(one.name, found.time, columns)


def _six(what: str, value: Array) -> dict[str, Array]:
    return {f"{what}_{channel}_{_UNITS[channel[0]]}": value[:, k] for k, channel in enumerate(CHANNELS)}


def _segments(found: SessionIdentification) -> "DataFrame":
    names = ["mass_kg", *(f"com_{a}_m" for a in "xyz"), *(f"inertia_{t}_kgm2" for t in TENSOR_ORDER)]
    columns = [f"{name}{kind}" for name in names for kind in ("", "_sd", "_table", "_table_sd", "_from_data")]
    rows = []
    for segment in found.identification.sip.segments:
        known = segment_rows(found.identification, segment)
        values = (value for k in known for value in (k.value, k.sd, k.table, k.table_sd, k.from_data))
        rows.append({"segment": segment, **dict(zip(columns, values, strict=True))})
    return table_of(rows, ("segment", *columns))


def _moments(found: SessionIdentification) -> "DataFrame":
    bands = found.torques
    if bands is None:
        return _joined(())
    columns: dict[str, Any] = {"used": bands.use, "state": [AngleState(one).words for one in bands.state]}
    for j, name in enumerate(bands.joints):
        told = {"": bands.torque, "_sd": bands.sd, "_table": bands.table}
        columns |= {f"{name}_Nm{kind}": column[:, j] for kind, column in told.items()}
    return _by_frame(bands.trial, bands.time, columns)


def _validation(found: SessionIdentification) -> "DataFrame":
    rows = []
    for kept, trials in ((True, found.validations), (False, found.fitted)):
        for one in trials:
            agreements = (one.table_agreement, one.identified_agreement)
            for k, channel in enumerate(CHANNELS):
                sizes = (*(each.rms[k] for each in agreements), *(each.correlation[k] for each in agreements))
                values = (one.name, kept, channel, _UNITS[channel[0]], *sizes)
                rows.append(dict(zip(_VALIDATION, values, strict=True)))
    return table_of(rows, _VALIDATION)
