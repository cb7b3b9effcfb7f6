"""Figures of repetitions over 0 to 100 %: angles, loads, ground reaction, and what each trial gave."""

from collections.abc import Mapping, Sequence

import numpy as np

from biodance.cycles import EMG
from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT
from biodance.cycles.scores import NormalCurve
from biodance.cycles.summary import Repetitions
from biodance.display import GREY, spaced
from biodance.records import SIDES
from biodance.report.figures import vector as svg
from biodance.report.wording import format_number

_LOOKS = svg.SIDE_STROKES
_DOTTED = {side: svg.Stroke(look.colour, "1 2", 1.1) for side, look in _LOOKS.items()}
_NORMAL = svg.Stroke(GREY, "1 3", 0.8)
_THIN, _MOST = 0.4, 12
"""px of one repetition, and repetitions of a side that are drawn; the mean is over all."""
LEAST_SPANS = {"deg": 10.0, "N·m/kg": 0.2, "W/kg": 0.5, "m": 0.05, "%": 10.0}
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
GROUND_PANELS = ("ground_reaction_up", "ground_reaction_forward", "ground_reaction_inward")
CYCLE_AXES = {
    "gait": "% of the gait cycle",
    "squat": "% of the squat",
    "sit_to_stand": "% of the rise",
    "jump": "% of the jump, landing included",
}
_CONSISTENT = (
    *("hip_flexion_range", "knee_flexion_maximum", "ankle_dorsiflexion_maximum"),
    *("pelvis_tilt_range", "ankle_dorsiflexion_moment_minimum", "ankle_power_maximum"),
)
"""Key values of which every repetition is drawn by trial."""


def repetitions_figure(
    found: Repetitions, quantities: Sequence[str], about: str, normal: Sequence[NormalCurve] = ()
) -> str:
    """Return a panel a quantity: repetitions, mean, sd of sides, before ``normal`` bands; "" for none."""
    groups = [one for one in found.groups if np.isfinite(one.mean).any()]
    # where a foot leaves the ground on average (a seat is left, a squat is lowest), in the look of its side
    offs = [(found.off(side), _LOOKS[side]) for side in (SIDES if found.kind == "gait" else ("middle",))]
    rules = [(off.mean, svg.Stroke(look.colour, look.dash, 0.8)) for off, look in offs if off is not None]
    cells = []
    for quantity in quantities:
        same = sorted((one for one in groups if one.quantity == quantity), key=lambda one: list(_LOOKS).index(one.side))
        if same:
            behind = [n for n in normal if (n.kind, n.quantity, n.unit) == (found.kind, quantity, same[0].unit)]
            usual = [svg.Curve(f"normal, {one.people} people", one.mean, _NORMAL, one.sd) for one in behind]
            files = [one for one in found.beside if one.quantity == quantity]
            theirs = [svg.Curve(f"{one.side}, plug-in gait", one.mean, _DOTTED[one.side]) for one in files]
            least = LEAST_SPANS.get(same[0].unit, 0.0)
            curves = [*usual, *_curves(same), *theirs]
            cells.append([svg.Strip(curve_title(same[0]), curves, least=least, rules=rules)])
    if not cells:
        return ""
    people = "; grey: between people" if any(n.kind == found.kind for n in normal) else ""
    band = f"one sd between cycles{people}"
    return svg.CurveFigure(PERCENT, cells, about, label=CYCLE_AXES[found.kind], band=band, width=270.0).html()


def curve_title(group: CurveGroup) -> str:
    """Return what a panel of curves shows: quantity, unit, and which way is positive where the name does not say it."""
    name = spaced(group.quantity.removesuffix(EMG)) + " EMG" * group.quantity.endswith(EMG)
    sense = (POSITIVE if group.kind == "gait" else {**POSITIVE, **_BOTH}).get(group.quantity)
    return f"{name} ({group.unit}{f', {sense}' if sense else ''})"


def _curves(groups: Sequence[CurveGroup]) -> list[svg.Curve]:
    """Return the repetitions of each side, thin, then its mean with the band."""
    curves = []
    for group in groups:
        look = _LOOKS[group.side]
        thin = svg.Stroke(look.colour, look.dash, _THIN)
        if len(group.values) > 1:
            curves += [svg.Curve(group.side, values, thin, kind="each") for values in group.values[:_MOST]]
        curves.append(svg.Curve(group.side, group.mean, look, group.sd if np.isfinite(group.sd).any() else None))
    return curves


def pressure_figure(found: Repetitions) -> str:
    """Return the mean way of the pressure along each sole, from the heel up; "" where none is known."""
    ways = {}
    for side in SIDES:
        own = {one.quantity: one for one in found.groups if one.side == side}
        if "pressure_ahead" in own:
            ends = (own[name] for name in ("pressure_outward", "pressure_ahead"))
            # the mean where at least half of the cycles are known: elsewhere it is of another few
            known = [np.where(2 * np.isfinite(e.values).sum(axis=0) >= len(e.values), e.mean, np.nan) for e in ends]
            ways[side] = 1000 * np.stack(known, axis=1)
    if not ways:
        return ""
    every = np.concatenate(list(ways.values()))
    x = svg.around(every[:, 0], least=120.0, label="outward of the line heel to toe (mm)")
    y = svg.around(every[:, 1], least=150.0, label="centre of pressure ahead of the heel (mm)")
    marks = [svg.segments(x, y, way, _LOOKS[side]) for side, way in ways.items()]
    about, frame = "Mean way of the centre of pressure on each sole.", svg.Frame(width=270.0, height=150.0)
    return f'<div class="cell">{svg.panel(x, y, marks, about, frame=frame)}</div>'


def consistency_figure(found: Repetitions) -> str:
    """Return every repetition's key values by trial, a panel for each; "" for a single trial."""
    if len(found.trials) < 2:
        return ""
    place = {trial: float(k) for k, trial in enumerate(found.trials, 1)}
    ticks = tuple((at, format_number(at, 0)) for at in place.values())
    x, cells = svg.Axis(0.5, len(place) + 0.5, "trial", ticks), []
    for name in _CONSISTENT:
        some = [one for one in found.key_values if one.name == name]
        if some:
            label = f"{spaced(name)} ({some[0].unit})"
            y = svg.around(np.array([one.value for one in some]), least=LEAST_SPANS[some[0].unit], label=label)
            marks = []
            for side, shift in (("right", -0.12), ("left", 0.12)):
                own = [(place[one.cycle.trial] + shift, one.value) for one in some if one.side == side]
                across, up = np.array(own).reshape(-1, 2).T
                inside = "" if side == "right" else "#ffffff"
                marks.append(svg.points(x, y, across, up, _LOOKS[side], inside=inside))
            about, frame = f"{spaced(name)} of every cycle by trial, right and left.", svg.Frame(270.0, 80.0)
            cells.append(f'<div class="cell">{svg.panel(x, y, marks, about, frame=frame)}</div>')
    return f'<div class="curves"><div class="cells three">{"".join(cells)}</div></div>' if cells else ""
