"""What was found in a session as pandas tables: tidy, units in the names of the columns, angles in degrees.

One row is one segment, one check, one marker of a trial, one frame of a trial, one parameter of a finding ...;
everything else is SI.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.cycles.cut import PERCENT, STRIDE_UNITS
from biodance.cycles.movement import TrialMovement
from biodance.diagnosis.diagnosis import Diagnosis
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import TrialResult
from biodance.records import CHANNELS, AngleState, Array

if TYPE_CHECKING:
    from pandas import DataFrame


_CYCLE = ("trial", "cycle", "kind", "cycle_side", "start_s", "end_s", "off_s")


def movement_tables(moved: SessionMovement) -> dict[str, "DataFrame"]:
    """Return ``events``, ``cycles``, ``strides`` (spatio-temporal values, unit in the column's name),
    ``cycle_curves`` (every repetition by per cent), ``mean_curves`` and ``file_angles``.
    """
    events = ((one.trial, e.time, e.side, e.down, e.source) for one in moved for e in one.events)
    cycles = ((*_named(one, k), c.start, c.end, c.off) for one in moved for k, c in enumerate(one.cycles))
    angles = (
        (one.trial, a.joint, a.label, a.offset, a.sd, a.correlation, a.frames) for one in moved for a in one.file_angles
    )
    return {
        "events": _frame(events, ("trial", "time_s", "side", "down", "source")),
        "cycles": _frame(cycles, _CYCLE),
        "strides": _strides(moved),
        "cycle_curves": _joined(map(_curves, moved), ("trial",)),
        "mean_curves": moved.table(),
        "file_angles": _frame(angles, ("trial", "joint", "label", "offset_deg", "sd_deg", "cc", "frames")),
    }


def _named(one: TrialMovement, number: int) -> tuple[Any, ...]:
    cycle = one.cycles[number]
    return one.trial, number + 1, cycle.kind, cycle.side


def _strides(moved: SessionMovement) -> "DataFrame":
    columns = [f"{name}_{unit.replace('/', '_per_').replace('%', 'percent')}" for name, unit in STRIDE_UNITS.items()]
    rows = (
        (one.trial, one.cycles.index(s.cycle) + 1, s.cycle.side, *(s.values.get(name, np.nan) for name in STRIDE_UNITS))
        for one in moved
        for s in one.strides
    )
    return _frame(rows, ("trial", "cycle", "side", *columns))


def _curves(one: TrialMovement) -> "DataFrame | None":
    if not one.curves:
        return None
    numbers = {id(cycle): k for k, cycle in enumerate(one.cycles)}
    rows = [(*_named(one, numbers[id(c.cycle)])[:3], c.quantity, c.side, c.unit) for c in one.curves]
    about = _frame(rows, ("trial", "cycle", "kind", "quantity", "side", "unit"))
    lasting = about.loc[about.index.repeat(len(PERCENT))].reset_index(drop=True)
    lasting["percent"] = np.tile(PERCENT, len(rows))
    lasting["value"] = np.concatenate([curve.value for curve in one.curves])
    lasting["parameters_sd"] = np.concatenate([np.broadcast_to(curve.sd, curve.value.shape) for curve in one.curves])
    return lasting


Row = tuple[Any, ...]
_UNITS = {"F": "N", "M": "Nm"}
_AXES = ("x", "y", "z")
_TENSOR = ("xx", "xy", "yy", "xz", "yz", "zz")
TRIALS = ("trial", "role", "status", "reason", "marker_rms_m", "marker_max_m", "gaps_percent", "frames_used")
CHECKS = ("what", "where", "value", "limit", "inside", "advice")
_MARKERS = ("trial", "marker", "rms_m", "max_m", "gaps_percent", "longest_gap_s")
_STATES = ("trial", "joint", "state", "start_s", "end_s")
FINDINGS = (
    "effect", "target", "parameter", "value", "sd", "unit", "probability", "visible_fraction", "log_bayes_factor",
    "gain_low", "gain_high", "advice",
)  # fmt: skip
UNSEEN = ("effect", "target", "limit", "unit", "told_from", "typical")
ADEQUACY = ("channel", "band_low_hz", "band_high_hz", "z", "trial", "second_s")


def session_tables(
    result: SessionResult, diagnosis: Diagnosis | None = None, movement: SessionMovement | None = None
) -> dict[str, "DataFrame"]:
    """Return all tables of a session by name.

    Always ``trials``, ``checks``, ``markers`` (distance to the model), ``marker_residuals`` (m by frame), ``angles``
    (deg by frame; empty where not determined), ``angle_states`` (when an angle is filled or not determined), ``wrench``
    (N, N·m by frame: measured, of the table's body, of the identified one, about the lab origin); with an
    identification ``segments``, ``moments`` (N·m by frame, of the trial whose feet are known; empty where the posture
    is not determined) and ``validation``; with a diagnosis ``findings``, ``unobservable`` and ``adequacy``; with a
    movement those of `movement_tables`. A table without rows has its columns all the same.
    """
    found = result.identification
    tables = {
        "trials": _frame(map(_trial, result.trials), TRIALS),
        "checks": _frame(map(attrgetter(*CHECKS), result.all_checks), CHECKS),
        "markers": _frame((row for one in result.trials for row in _markers(one)), _MARKERS),
        "marker_residuals": _joined(map(_residuals, result.trials)),
        "angles": _joined(_angles(result, one) for one in result.trials),
        "angle_states": _frame((row for one in result.trials for row in _states(one)), _STATES),
        "wrench": _joined(_wrench(result, one) for one in result.trials),
    }
    if found is not None:
        tables |= {"segments": _segments(found), "moments": _moments(found), "validation": _validation(found)}
    if diagnosis is not None:
        tables |= _diagnosed(diagnosis)
    if movement is not None:
        tables |= movement_tables(movement)
    return tables


def _frame(rows: Iterable[Row], columns: Sequence[str]) -> "DataFrame":
    import pandas as pd

    return pd.DataFrame(list(rows), columns=list(columns))


def _joined(parts: Iterable["DataFrame | None"], columns: Sequence[str] = ("trial", "time_s")) -> "DataFrame":
    """Return the tables of several trials below each other, with ``columns`` at least; columns that one lacks are empty
    there.
    """
    import pandas as pd

    some = [part for part in parts if part is not None]
    return pd.concat(some, ignore_index=True) if some else _frame((), columns)


def _by_frame(trial: str, time: Array, columns: Mapping[str, Any]) -> "DataFrame":
    import pandas as pd

    return pd.DataFrame({"trial": np.full(time.size, trial, dtype=object), "time_s": time, **columns})


def _trial(one: TrialResult) -> Row:
    far = (one.fit.total_rms, one.fit.total_max) if one.fit else (float("nan"), float("nan"))
    used = int(one.comparison.used.sum()) if one.comparison else 0
    return (one.trial.name, one.trial.role, one.status, one.reason, *far, one.gaps_percent, used)


def _markers(one: TrialResult) -> Iterator[Row]:
    distance = {n: (r, m) for n, r, m in zip(one.fit.names, one.fit.rms, one.fit.max, strict=True)} if one.fit else {}
    gaps = {gap.label: (gap.percent, gap.longest) for gap in one.gaps}
    nothing = (float("nan"), float("nan"))
    for name in dict.fromkeys((*gaps, *distance)):
        yield one.trial.name, name, *distance.get(name, nothing), *gaps.get(name, nothing)


def _residuals(one: TrialResult) -> "DataFrame | None":
    motion = one.motion
    if motion is None:
        return None
    return _by_frame(
        one.trial.name, motion.time, {f"{name}_m": motion.residual[:, k] for k, name in enumerate(motion.marker_names)}
    )


def _angles(result: SessionResult, one: TrialResult) -> "DataFrame | None":
    if one.motion is None or result.body is None:
        return None
    names, motion = [joint.name for joint in result.body.joints], one.motion
    state = [AngleState(one).words for one in motion.frame_state]
    columns: dict[str, Any] = {"determined": motion.determined, "state": state}
    columns |= {f"{name}_deg": motion.known_angles[:, j] for j, name in enumerate(names)}
    return _by_frame(one.trial.name, motion.time, columns)


def _states(one: TrialResult) -> Iterator[Row]:
    for span in one.motion.spans() if one.motion is not None else ():
        yield one.name, span.joint, span.state.words, span.start, span.end


def _wrench(result: SessionResult, one: TrialResult) -> "DataFrame | None":
    found = one.comparison
    if found is None or one.motion is None:
        return None
    columns: dict[str, Any] = {"used": found.used} | _six("measured", found.measured) | _six("table", found.simulated)
    if result.identification is not None:
        columns |= _six("identified", predict_wrench(result.identification.identification.identified, one.motion).value)
    return _by_frame(one.trial.name, found.time, columns)


def _six(what: str, value: Array) -> dict[str, Array]:
    return {f"{what}_{channel}_{_UNITS[channel[0]]}": value[:, k] for k, channel in enumerate(CHANNELS)}


def _segments(found: SessionIdentification) -> "DataFrame":
    names = ["mass_kg", *(f"com_{a}_m" for a in _AXES), *(f"inertia_{t}_kgm2" for t in _TENSOR)]
    columns = [f"{name}{kind}" for name in names for kind in ("", "_sd", "_table", "_table_sd", "_from_data")]
    rows = []
    for segment in found.identification.sip.segments:
        known = [one for one in found.identification.known if one.segment == segment]
        rows.append((segment, *(v for k in known for v in (k.value, k.sd, k.table, k.table_sd, k.from_data))))
    return _frame(rows, ("segment", *columns))


def _moments(found: SessionIdentification) -> "DataFrame":
    bands = found.torques
    if bands is None:
        return _joined(())
    columns: dict[str, Any] = {"used": bands.use, "state": [AngleState(one).words for one in bands.state]}
    for j, name in enumerate(bands.joints):
        columns |= {
            f"{name}_Nm": bands.torque[:, j],
            f"{name}_Nm_sd": bands.sd[:, j],
            f"{name}_Nm_table": bands.table[:, j],
        }
    return _by_frame(bands.trial, bands.time, columns)


def _validation(found: SessionIdentification) -> "DataFrame":
    columns = ("rms_table", "rms_identified", "correlation_table", "correlation_identified")
    rows = []
    for kept, trials in ((True, found.validations), (False, found.fitted)):
        for one in trials:
            table, identified = one.table_agreement, one.identified_agreement
            for k, channel in enumerate(CHANNELS):
                values = (table.rms[k], identified.rms[k], table.correlation[k], identified.correlation[k])
                rows.append((one.name, kept, channel, _UNITS[channel[0]], *values))
    return _frame(rows, ("trial", "kept", "channel", "unit", *columns))


def _diagnosed(one: Diagnosis) -> dict[str, "DataFrame"]:
    rows = []
    for finding in one.findings:
        gain = finding.gain.ci95 if finding.gain else (float("nan"), float("nan"))
        about = (finding.probability, finding.visible_fraction, finding.log_bayes_factor, *gain, finding.advice)
        rows += [(finding.effect, finding.target, p.name, p.value, p.sd, p.unit, *about) for p in finding.parameters]
    return {
        "findings": _frame(rows, FINDINGS),
        "unobservable": _frame(map(attrgetter(*UNSEEN), one.unobservable), UNSEEN),
        "adequacy": _frame(((a.channel, *a.band_hz, a.z, a.trial, a.second) for a in one.adequacy), ADEQUACY),
    }
