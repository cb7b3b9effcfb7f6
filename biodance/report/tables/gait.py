"""The gait of a session for programs: all good cycles of all trials, sides beside each other. NaN becomes null."""

from collections.abc import Mapping

from biodance.cycles.curves import CurveGroup
from biodance.cycles.scores import GaitScores
from biodance.cycles.summary import Spread
from biodance.pipeline.movement import SessionMovement
from biodance.records import SIDES
from biodance.report.tables.schema import Row, Schema

_SPREAD = Schema("mean sd count")
_LEFT_OUT = Schema(
    "trial=cycle.trial side=cycle.side start_s=cycle.start end_s=cycle.end quantity because=because.value"
)
_KEY = Schema(
    "quantity key unit difference difference_ci95=ci95 symmetry_percent=symmetry",
    {
        "middle": _SPREAD,
        "right": _SPREAD,
        "left": _SPREAD,
        "beside": lambda one: {side: _SPREAD.row(told) for side, told in one.beside.items()},
    },
)


def gait_document(moved: SessionMovement | None) -> Row | None:
    """Return the gait of a session; None where nobody walks.

    ``runs`` whether most strides have a flight; ``cycles`` how many count, by side; ``left_out`` what counts in no
    mean, and because of what ("shared_plate", "spike", "turn"; ``quantity`` "" = all of the cycle, "loads" = its
    moments, powers and ground reaction); ``curves`` (101 values at 0 to 100 %) mean and sd between cycles, of angles
    (deg), moments (N·m/kg), powers (W/kg), ground reaction (% of body weight), centre of pressure on the sole (m);
    ``beside`` plug-in gait's own where the files hold it; ``difference`` right less left; ``scores`` null without a
    healthy reference.
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
        "curves": [_curve(one) for one in found.groups],
        "curves_beside": [_curve(one) for one in found.file_groups],
        "key_values": _KEY.rows(found.keys),
        "scores": dict(zip(("ours", "beside"), map(_scores, moved.scores), strict=True)) if moved.scores[0] else None,
    }


def _curve(one: CurveGroup) -> Row:
    return Schema("quantity side unit count=#values mean sd").row(one)


def _scores(one: GaitScores | None) -> Row | None:
    """Return the scores of both sides (deg; the deviation index has no unit)."""
    if one is None:
        return None
    return {
        "people": one.people,
        "gait_profile_score_deg": {"both": one.overall, **_by_side(one.gps)},
        "gait_deviation_index": _by_side(one.gdi),
        "movement_analysis_profile": [
            {"quantity": name, "side": side, "unit": "deg", **_SPREAD.row(told)}
            for (name, side), told in one.variables.items()
        ],
    }


def _by_side(found: Mapping[str, Spread]) -> Row:
    return {side: _SPREAD.row(told) for side, told in found.items()}
