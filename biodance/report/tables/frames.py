"""What was found in a session as pandas tables: tidy, units in the names of the columns, angles in degrees.

One row is one segment, one check, one marker of a trial, one frame of a trial, one parameter of a finding ...;
everything else is SI.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.cycles.cut import PERCENT
from biodance.cycles.movement import TrialMovement
from biodance.cycles.strides import STRIDE_UNITS
from biodance.diagnosis.diagnosis import Diagnosis
from biodance.lab.session.results_folder import whole_folder
from biodance.motion.dynamics import predict_wrench
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import TrialResult
from biodance.records import CHANNELS, AngleState, Array
from biodance.report.files import write_tables
from biodance.report.tables.diagnosis import LIMIT_ROW
from biodance.report.tables.identification import TENSOR_ORDER, segment_rows
from biodance.report.tables.schema import Row, Schema, table_of
from biodance.report.tables.session import CHECK_ROW, EVENT_ROW, FILE_ANGLE_ROW

if TYPE_CHECKING:
    from pandas import DataFrame

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
