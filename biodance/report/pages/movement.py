"""The section of the report on what moved: tables, figures and sentences; computes nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.cycles.curves import CurveGroup, NormalCurve
from biodance.cycles.cut import PERCENT, STRIDE_UNITS
from biodance.cycles.key_values import ANGLE_PANELS, LOAD_PANELS
from biodance.cycles.movement import TrialMovement
from biodance.display import GREY, spaced
from biodance.identification.knowledge import SIGMAS
from biodance.pipeline.movement import SessionMovement
from biodance.report.figures.vector import LEFT_SIDE, MIDDLE_SIDE, RIGHT_SIDE, Curve, CurveFigure, Strip, Stroke
from biodance.report.pages.template import render
from biodance.report.tables.schema import Row, Schema
from biodance.report.tables.session import FILE_ANGLE_ROW
from biodance.report.wording import format_number

_LOOKS = {"left": LEFT_SIDE, "right": RIGHT_SIDE, "middle": MIDDLE_SIDE}
_NORMAL = Stroke(GREY, "1 3", 0.8)
_THIN = 0.4
"""px of one repetition."""
_MOST = 12
"""Repetitions of a side that are drawn; the mean is over all."""
LEAST_SPANS = {"deg": 10.0, "N·m/kg": 0.2, "W/kg": 0.5, "m": 0.05}
"""What an axis spans at least, by unit."""
POSITIVE: Mapping[str, str] = {
    "pelvis_tilt": "forwards +",
    "pelvis_obliquity": "own side up +",
    "pelvis_rotation": "own side forwards +",
    "hip_rotation": "inwards +",
    "foot_progression": "inwards +",
    "trunk_bending": "own side down +",
    "trunk_rotation": "own side forwards +",
}
"""The positive sense where the name does not say it, in a gait cycle."""
_BOTH: Mapping[str, str] = {
    "pelvis_obliquity": "right side up +",
    "pelvis_rotation": "right side forwards +",
    "trunk_bending": "to the right +",
    "trunk_rotation": "to the left +",
}
"""The same where both sides move alike."""
CYCLE_AXES = {"gait": "% of the gait cycle", "squat": "% of the squat", "sit_to_stand": "% of the rise"}


def movement_figure(
    one: TrialMovement, kind: str, quantities: Sequence[str], normal: Sequence[NormalCurve] = ()
) -> str:
    """Return one panel for each quantity of the cycles of a ``kind``, before the ``normal`` bands of the laboratory's
    own people; "" where none is known.

    Bands of angles are one sd between repetitions; of moments and powers the 95 % that the inertial parameters leave
    uncertain in the mean.
    """
    groups = [group for group in one.groups if group.kind == kind and np.isfinite(group.mean).any()]
    cells = []
    for quantity in quantities:
        same = [group for group in groups if group.quantity == quantity]
        if same:
            behind = [n for n in normal if (n.kind, n.quantity, n.unit) == (kind, quantity, same[0].unit)]
            usual = [Curve(f"normal, {one.people} people", one.mean, _NORMAL, one.sd) for one in behind]
            curves = [*usual, *_curves(same)]
            cells.append([Strip(curve_title(same[0]), curves, least=LEAST_SPANS.get(same[0].unit, 0.0))])
    if not cells:
        return ""
    loads = quantities == LOAD_PANELS
    about = f"{'Moments and powers' if loads else 'Angles'} of trial {one.trial}, left beside right"
    band = "95 %, inertial parameters" if loads else "± 1 sd, repetitions"
    if any(n.kind == kind for n in normal):
        band += "; grey: ± 1 sd, people"
    return CurveFigure(PERCENT, cells, about, label=CYCLE_AXES[kind], band=band).html()


def curve_title(group: CurveGroup) -> str:
    """Return what a panel of curves shows: quantity, unit, and which way is positive where the name does not say it."""
    name = spaced(group.quantity)
    sense = (POSITIVE if group.kind == "gait" else {**POSITIVE, **_BOTH}).get(group.quantity)
    return f"{name} ({group.unit}{f', {sense}' if sense else ''})"


def _curves(groups: Sequence[CurveGroup]) -> list[Curve]:
    """Return the repetitions of each side, thin, then its mean with the band."""
    curves = []
    for group in groups:
        look = _LOOKS[group.side]
        thin = Stroke(look.colour, look.dash, _THIN)
        half = group.sd if group.unit in ("deg", "m") else SIGMAS * group.parameters_sd
        if len(group.values) > 1:
            curves += [Curve(group.side, values, thin, kind="each") for values in group.values[:_MOST]]
        curves.append(Curve(group.side, group.mean, look, half if np.isfinite(half).any() else None))
    return curves


CYCLE_KINDS = {"gait": "Walking", "squat": "Squats", "sit_to_stand": "Rises from a chair"}
_DIGITS = {"m": 3, "m/s": 2, "s": 2, "%": 1, "steps/min": 0}


@dataclass(frozen=True)
class MovementPart:
    """One trial with its figures, ready to be shown."""

    moved: TrialMovement
    figures: Sequence[tuple[str, str, str]]
    values: Sequence[Row]


def movement_section(moved: SessionMovement) -> str:
    """Return the section as HTML text; "" where no trial holds a repetition and none has another program's angles."""
    parts = [_part(one, moved.normal) for one in moved if one.cycles]
    compared = [one for one in moved if one.file_angles]
    if not parts and not compared:
        return ""
    filters = {"milli": _milli, "beside": _beside}
    angles = [row for one in compared for row in FILE_ANGLE_ROW.rows(one.file_angles, trial=one.trial)]
    return render(
        "movement.html.j2",
        filters=filters,
        schemas={"strides": _STRIDES, "file_angle": FILE_ANGLE_ROW},
        parts=parts,
        compared=compared,
        file_angles=angles,
        moved=moved,
    )


def _part(one: TrialMovement, normal: Sequence[NormalCurve]) -> MovementPart:
    kinds = [kind for kind in CYCLE_KINDS if any(cycle.kind == kind for cycle in one.cycles)]
    figures = [
        (
            CYCLE_KINDS[kind],
            movement_figure(one, kind, ANGLE_PANELS, normal),
            movement_figure(one, kind, LOAD_PANELS, normal),
        )
        for kind in kinds
    ]
    both, left, right = (one.spatiotemporal(side) for side in ("both", "left", "right"))
    values = [
        {
            "value": f"{spaced(name)} ({STRIDE_UNITS[name]})",
            "left": _value(name, left),
            "right": _value(name, right),
            "both": _value(name, both),
        }
        for name in both
    ]
    return MovementPart(one, figures, values)


_STRIDES = Schema("", shown="value: {value} | left: {left} | right: {right} | both: {both}")


def _value(name: str, found: dict[str, tuple[float, float, int]]) -> str:
    """Return mean ± sd as text; the mean alone of one stride."""
    if name not in found:
        return "–"
    mean, sd, count = found[name]
    digits = _DIGITS[STRIDE_UNITS[name]]
    return format_number(mean, digits) + (f" ± {format_number(sd, digits)}" if count > 1 else "")


def _milli(value: float) -> str:
    return format_number(1000 * value, 0)


def _beside(late: float) -> str:
    """Return how much later than the file's ours are: ``6 ms earlier``."""
    return f"{_milli(abs(late))} ms {'later' if late > 0 else 'earlier'}"
