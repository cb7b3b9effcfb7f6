"""Figures of what moved: every repetition thin, the mean with its band, left beside right, over 0 to 100 %."""

from collections.abc import Mapping, Sequence

import numpy as np

from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT
from biodance.cycles.movement import TrialMovement
from biodance.identification.knowledge import SIGMAS
from biodance.report.figures.curves import Curve, CurveFigure, Strip
from biodance.report.figures.vector import LEFT_SIDE, MIDDLE_SIDE, RIGHT_SIDE, Stroke

_LOOKS = {"left": LEFT_SIDE, "right": RIGHT_SIDE, "middle": MIDDLE_SIDE}
_THIN = 0.4
"""px of one repetition."""
_MOST = 12
"""Repetitions of a side that are drawn; the mean is over all."""
_LEAST = {"deg": 10.0, "N·m/kg": 0.2, "W/kg": 0.5, "m": 0.05}
"""What an axis spans at least, by unit."""
ANGLE_PANELS = (
    *("pelvis_tilt", "pelvis_obliquity", "pelvis_rotation", "hip_flexion", "hip_adduction", "hip_rotation"),
    *("knee_flexion", "ankle_dorsiflexion", "foot_progression", "trunk_flexion", "trunk_bending", "trunk_rotation"),
)
LOAD_PANELS = (
    *("hip_flexion_moment", "knee_flexion_moment", "ankle_dorsiflexion_moment", "hip_adduction_moment"),
    *("hip_power", "knee_power", "ankle_power"),
)
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
_AXES = {"gait": "% of the gait cycle", "squat": "% of the squat", "sit_to_stand": "% of the rise"}


def movement_figure(one: TrialMovement, kind: str, quantities: Sequence[str]) -> str:
    """Return one panel for each quantity of the cycles of a ``kind``; "" where none is known.

    Bands of angles are one sd between repetitions; of moments and powers the 95 % that the inertial parameters leave
    uncertain in the mean.
    """
    groups = [group for group in one.groups if group.kind == kind and np.isfinite(group.mean).any()]
    cells = []
    for quantity in quantities:
        same = [group for group in groups if group.quantity == quantity]
        if same:
            cells.append([Strip(_title(same[0]), _curves(same), least=_LEAST.get(same[0].unit, 0.0))])
    if not cells:
        return ""
    loads = quantities == LOAD_PANELS
    about = f"{'Moments and powers' if loads else 'Angles'} of trial {one.trial}, left beside right"
    band = "95 %, from the inertial parameters" if loads else "± 1 sd between repetitions"
    return CurveFigure(PERCENT, cells, about, label=_AXES[kind], band=band).html()


def _title(group: CurveGroup) -> str:
    name = group.quantity.replace("_", " ")
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
