"""The section of the report on what moved: tables, figures and sentences; computes nothing."""

from collections.abc import Sequence
from dataclasses import dataclass

from biodance.cycles.movement import TrialMovement
from biodance.cycles.steps import STRIDE_UNITS
from biodance.pipeline.movement import SessionMovement
from biodance.report.figures.movement import ANGLE_PANELS, LOAD_PANELS, movement_figure
from biodance.report.pages.template import render
from biodance.report.wording import format_number

_KINDS = {"gait": "Walking", "squat": "Squats", "sit_to_stand": "Rises from a chair"}
_DIGITS = {"m": 3, "m/s": 2, "s": 2, "%": 1, "steps/min": 0}


@dataclass(frozen=True)
class MovementPart:
    """One trial with its figures, ready to be shown."""

    moved: TrialMovement
    figures: Sequence[tuple[str, str, str]]
    values: Sequence[tuple[str, str, str, str]]


def movement_section(moved: SessionMovement) -> str:
    """Return the section as HTML text; "" where no trial holds a repetition and none has another program's angles."""
    parts = [_part(one) for one in moved if one.cycles]
    compared = [one for one in moved if one.file_angles]
    if not parts and not compared:
        return ""
    return render("movement.html.j2", parts=parts, compared=compared, moved=moved, filters={"milli": _milli})


def _part(one: TrialMovement) -> MovementPart:
    kinds = [kind for kind in _KINDS if any(cycle.kind == kind for cycle in one.cycles)]
    figures = [
        (_KINDS[kind], movement_figure(one, kind, ANGLE_PANELS), movement_figure(one, kind, LOAD_PANELS))
        for kind in kinds
    ]
    both, left, right = (one.spatiotemporal(side) for side in ("both", "left", "right"))
    values = [
        (
            f"{name.replace('_', ' ')} ({STRIDE_UNITS[name]})",
            _value(name, left),
            _value(name, right),
            _value(name, both),
        )
        for name in both
    ]
    return MovementPart(one, figures, values)


def _value(name: str, found: dict[str, tuple[float, float, int]]) -> str:
    """Return mean ± sd as text; the mean alone of one stride."""
    if name not in found:
        return "–"
    mean, sd, count = found[name]
    digits = _DIGITS[STRIDE_UNITS[name]]
    return format_number(mean, digits) + (f" ± {format_number(sd, digits)}" if count > 1 else "")


def _milli(value: float) -> str:
    return format_number(1000 * value, 0)
