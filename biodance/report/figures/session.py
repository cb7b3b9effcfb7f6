"""Figures of a session: markers to the model, quiet standing, measured beside simulated wrench, a 3-D still; and of
repetitions over 0 to 100 %: angles, loads, ground reaction, and what each trial gave.
"""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from biodance.body.solids import ROUNDNESS
from biodance.cycles import EMG
from biodance.cycles.curves import CurveGroup
from biodance.cycles.cut import PERCENT
from biodance.cycles.scores import NormalCurve
from biodance.cycles.summary import Repetitions
from biodance.display import BLACK, GREEN, GREY, YELLOW, spaced
from biodance.identification.validation import TrialValidation
from biodance.motion.newton import QuietStanding
from biodance.pipeline.still import FORCE_SCALE, RESIDUAL_SCALE, Still
from biodance.pipeline.trial import MarkerFit, WrenchComparison
from biodance.records import CHANNEL_TITLES, SIDES, Array
from biodance.report.figures import vector as svg
from biodance.report.figures.style import SIDE_COLOURS
from biodance.report.wording import format_number, millimetres


def bar_list(rows: Sequence[tuple[str, float, float, str]], about: str) -> str:
    """Return bars as a list in columns: name, length of the bar and place of the tick in %, and the number as text."""
    items = "".join(
        f'<li><span>{escape(name)}</span><i style="--b:{bar:.1f}%;--t:{tick:.1f}%"></i><b>{escape(text)}</b></li>'
        for name, bar, tick, text in rows
    )
    return f'<ol class="bars" aria-label="{escape(about)}">{items}</ol>'


def marker_figure(fit: MarkerFit) -> str:
    """Return the RMS distance (bar) and the largest distance (tick) of every seen marker in mm, the worst first."""
    seen = np.flatnonzero(np.isfinite(fit.rms))
    order = seen[np.argsort(-fit.rms[seen], kind="stable")]
    full = float(np.max(fit.max[order], initial=1e-3))
    rows = [
        (fit.names[i], 100 * fit.rms[i] / full, 100 * fit.max[i] / full, f"{millimetres(fit.rms[i])} mm") for i in order
    ]
    return bar_list(rows, "Distance of every marker to the model, RMS, the worst first")


_AROUND = 200.0  # mm that the wide view shows around the feet
_SQUARE = svg.Frame(width=390.0, height=240.0, left=48.0)


def _turned(place: Array, standing: QuietStanding) -> Array:
    """Return lab points (..., 2) as millimetres to the subject's right and ahead, from the mean centre of pressure."""
    ahead = standing.forward
    # ahead turned by -90 degrees about the vertical
    right = np.array([ahead[1], -ahead[0]])
    arm = place - np.nanmean(standing.cop, axis=0)
    return 1000 * np.stack([arm @ right, arm @ ahead], axis=-1)


_COP, _COM = svg.Stroke(BLACK, "", 0.8), svg.Stroke(GREEN, "", 0.8)


def _paths(x: svg.Axis, y: svg.Axis, standing: QuietStanding) -> list[str]:
    out = []
    for path, look, inside in ((standing.cop, _COP, ""), (standing.com, _COM, "#fff")):
        if path.size:
            way = _turned(path, standing)
            right, ahead = np.nanmean(way, axis=0)[:, None]
            out += [svg.segments(x, y, way, look), svg.points(x, y, right, ahead, look, inside=inside)]
    return out


def _surroundings(x: svg.Axis, y: svg.Axis, standing: QuietStanding) -> list[str]:
    out = [
        svg.segments(x, y, _turned(corners[[0, 1, 2, 3, 0]], standing), svg.Stroke(GREY, "", 0.9))
        for corners in standing.plates
    ]
    for side, look in (("left", svg.LEFT_SIDE), ("right", svg.RIGHT_SIDE)):
        chosen = [i for i, name in enumerate(standing.foot_names) if name.startswith(side)]
        if chosen:
            inside = "#fff" if side == "left" else ""
            right, ahead = _turned(standing.feet[chosen], standing).T
            out.append(svg.points(x, y, right, ahead, look, inside=inside))
    return out


def _square(middle: Array, reach: float, labels: tuple[str, str]) -> tuple[svg.Axis, svg.Axis]:
    """Return two axes of one scale about ``middle`` (2,) that reach at least ``reach`` to each side."""
    aspect = (_SQUARE.width - _SQUARE.left - _SQUARE.right) / _SQUARE.height
    # one mm is as long on both axes: the longer side of the panel shows more
    wide, high = reach * max(aspect, 1.0), reach * max(1.0, 1 / aspect)
    return (
        svg.Axis(middle[0] - wide, middle[0] + wide, labels[0]),
        svg.Axis(middle[1] - high, middle[1] + high, labels[1]),
    )


def standing_figure(standing: QuietStanding) -> str:
    """Return pressure, centre of mass, feet and plates in the subject's axes, and the middle, enlarged."""
    tracked = bool(standing.com.size)
    labels = ("to the subject's right (mm)", "ahead (mm)") if tracked else ("along lab −y (mm)", "along lab x (mm)")
    shown = _turned(np.concatenate([standing.feet, standing.cop]), standing)
    low, high = np.nanmin(shown, axis=0) - _AROUND, np.nanmax(shown, axis=0) + _AROUND
    x, y = _square((low + high) / 2, float(np.max(high - low)) / 2, labels)
    wide = svg.panel(x, y, [*_surroundings(x, y, standing), *_paths(x, y, standing)], "feet and plates", frame=_SQUARE)
    reach = 1.4 * max(20.0, *(np.nanmax(np.abs(_turned(p, standing))) for p in (standing.cop, standing.com) if p.size))
    x, y = _square(np.zeros(2), float(reach), labels)
    axes = [svg.rule(x, 0.0, upright=True), svg.rule(y, 0.0, upright=False)]
    near = svg.panel(x, y, [*axes, *_paths(x, y, standing)], "the middle, enlarged", frame=_SQUARE)
    words = ["black point: centre of pressure (plates)"]
    words += ["green ring: centre of mass (table)"] if tracked else []
    words += ["blue points: right foot's markers", "orange rings: left foot's"]
    return svg.with_legend(words, (wide, near))


def _channels(
    curves: list[tuple[str, Array, svg.Stroke]], measured: Array, used: NDArray[np.bool_]
) -> list[list[svg.Strip]]:
    """Return for each channel its curves, measured first, over measured minus curve; forces left, moments right."""
    cells = []
    for channel in (0, 3, 1, 4, 2, 5):
        # the noise of quiet standing is not blown up
        title, least = CHANNEL_TITLES[channel], (10.0, 10.0, 10.0, 4.0, 4.0, 4.0)[channel]
        truth, left = measured[:, channel], []
        drawn = [svg.Curve("measured", truth, svg.MEASURED)]
        for name, value, look in curves:
            known = np.where(used, value[:, channel], np.nan)
            drawn.append(svg.Curve(name, known, look))
            left.append(svg.Curve(name, truth - known, look))
        unit = title[title.index("(") :]
        cells.append(
            [svg.Strip(title, drawn, least), svg.Strip(f"measured − simulated {unit}", left, least / 2, even=True)]
        )
    return cells


def wrench_figure(comparison: WrenchComparison, trial: str = "", *, filled: NDArray[np.bool_] | None = None) -> str:
    """Return six channels, measured and by the table, over residuals; grey: left out, yellow: ``filled`` (T,)."""
    curves = [("with the table", comparison.simulated, svg.TABLE)]
    cells = _channels(curves, comparison.measured, comparison.used)
    about = "Measured and simulated ground wrench; the numbers are in the table below"
    return svg.CurveFigure(comparison.time, cells, about, comparison.used, trial, filled=filled).html()


def validation_figure(one: TrialValidation, *, filled: NDArray[np.bool_] | None = None) -> str:
    """Return six channels, measured, by table and identified, with what skin, flesh and joints add where fitted trials
    tell it, over differences; shades as `wrench_figure`.
    """
    curves = [("with the table", one.table.value, svg.TABLE), ("identified", one.identified.value, svg.IDENTIFIED)]
    if one.extended is not None:
        curves.append(("identified, with skin and flesh", one.extended.value, svg.EXTENDED))
    about = "Measured ground wrench beside the table's and the identified body's; the numbers are in the table below"
    cells = _channels(curves, one.measured.value, one.use)
    return svg.CurveFigure(one.measured.time, cells, about, one.use, one.name, filled=filled).html()


VIEWS = ((12.0, -35.0, "from the front, right"), (0.0, -90.0, "from the right"))
"""Elevation and azimuth in degrees, the latter from where the subject looks, and title of each view."""


def _outline(points: Array, kind: str) -> str:
    from scipy.spatial import ConvexHull, QhullError

    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:
        return ""
    return f'<path d="M{_places(points)}z" {kind}/>'


def _places(points: Array) -> str:
    return " ".join(f"{x:.0f} {y:.0f}" for x, y in points.tolist())


def _line(ends: Array, kind: str) -> str:
    return f'<path d="M{_places(ends)}" fill="none" {kind}/>' if np.isfinite(ends).all() else ""


def _dot(place: Array, radius: float, kind: str) -> str:
    drawn = f'<circle cx="{place[0]:.0f}" cy="{place[1]:.0f}" r="{radius:g}" {kind}/>'
    return drawn if np.isfinite(place).all() else ""


def _body(still: Still, screen: Array) -> list[str]:
    """Return the segments' outlines, those behind first, and over them the bones."""
    skins = []
    polar, around = np.meshgrid(np.linspace(0.0, np.pi, 15), np.linspace(0.0, 2 * np.pi, 28, endpoint=False))
    ball = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], -1).reshape(-1, 3)
    # a ball in the norm sum |x|^p = 1: nearly a box, its edges round
    size = (np.abs(ball) ** ROUNDNESS).sum(axis=1, keepdims=True) ** (1 / ROUNDNESS)
    for box, turn, at, side in zip(still.boxes, still.rotations, still.positions, still.box_sides, strict=True):
        if np.all(box[1] > box[0]):
            solid = (box[0] + box[1]) / 2 + (box[1] - box[0]) / 2 * ball / size
            points = (solid @ turn.T + at) @ screen
            kind = f'fill="{SIDE_COLOURS[side][0]}" fill-opacity="0.18" stroke="none"'
            skins.append((float(points[:, 2].mean()), _outline(points[:, :2], kind)))
    bones = []
    for ends, side in zip(still.bones @ screen, still.sides, strict=True):
        colour, dash = SIDE_COLOURS[side]
        broken = ' stroke-dasharray="30 18"' if dash == "--" else ""
        bones.append(_line(ends[:, :2], f'stroke="{colour}" stroke-width="13"{broken}'))
    return [text for _, text in sorted(skins)] + bones


def _forces(still: Still, screen: Array) -> list[str]:
    """Return markers, centre of mass, ground force, residual force and a load that was found."""
    out = [_dot(place, 9, f'fill="{BLACK}"') for place in still.markers @ screen]
    ground = np.stack([still.cop, still.cop + FORCE_SCALE * still.force]) @ screen
    left = np.stack([still.com, still.com + RESIDUAL_SCALE * still.residual]) @ screen
    out.append(_line(ground[:, :2], f'stroke="{GREEN}" stroke-width="14"'))
    out.append(_line(left[:, :2], f'class="residual" stroke="{BLACK}" stroke-width="14"'))
    out.append(_dot(still.com @ screen, 24, f'fill="{GREEN}"'))
    out.append(_dot(still.load @ screen, 50, f'fill="{YELLOW}" stroke="{BLACK}" stroke-width="6"'))
    return out


def still_figure(still: Still) -> str:
    """Return the body, its markers, the plates and the ground force from two sides as HTML, both to one scale."""
    drawn = []
    for elevation, azimuth, title in VIEWS:
        # the matrix that turns lab points into mm to the right, down and towards the eye
        e, a = np.radians(elevation), np.radians(azimuth) + np.arctan2(still.forward[1], still.forward[0])
        down = [np.sin(e) * np.cos(a), np.sin(e) * np.sin(a), -np.cos(e)]
        eye = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
        screen = 1000.0 * np.array([[-np.sin(a), np.cos(a), 0.0], down, eye]).T
        parts = [
            _line((corners[[0, 1, 2, 3, 0]] @ screen)[:, :2], f'stroke="{GREY}" stroke-width="6"')
            for corners in still.plates
        ]
        parts += [*_body(still, screen), *_forces(still, screen)]
        tips = [still.cop + FORCE_SCALE * still.force, still.com + RESIDUAL_SCALE * still.residual]
        points = np.concatenate([still.bones.reshape(-1, 3), still.markers, still.plates.reshape(-1, 3), tips])
        shown = (points[np.isfinite(points).all(axis=1)] @ screen)[:, :2]
        body = (still.bones.reshape(-1, 3) @ screen)[:, :2]
        (left, top), (right, foot) = shown.min(axis=0) - 90, shown.max(axis=0) + 90
        # plates far from the body are cut off, or it would be small
        middle, half = float(body[:, 0].mean()), 900.0
        left, right = max(left, middle - half), min(right, middle + half)
        foot = min(foot, float(body[:, 1].max()) + 500.0)
        box = f"{left:.0f} {top:.0f} {right - left:.0f} {foot - top:.0f}"
        drawn.append(
            f'<div><svg class="still" role="img" aria-label="the body {title}" viewBox="{box}">{"".join(parts)}</svg>'
            f'<p class="small">{title}</p></div>'
        )
    return f'<div class="stills">{"".join(drawn)}</div>'


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
    groups, beside = [one for one in _by_side(found.groups) if np.isfinite(one.mean).any()], _by_side(found.beside)
    # where a foot leaves the ground on average (a seat is left, a squat is lowest), in the look of its side
    offs = [(found.off(side), _LOOKS[side]) for side in (SIDES if found.kind == "gait" else ("middle",))]
    rules = [(off.mean, svg.Stroke(look.colour, look.dash, 0.8)) for off, look in offs if off is not None]
    cells = []
    for quantity in quantities:
        same = [one for one in groups if one.quantity == quantity]
        if same:
            behind = [n for n in normal if (n.kind, n.quantity, n.unit) == (found.kind, quantity, same[0].unit)]
            usual = [svg.Curve(f"normal, {one.people} people", one.mean, _NORMAL, one.sd) for one in behind]
            files = (one for one in beside if one.quantity == quantity)
            theirs = [svg.Curve(f"{one.side}, plug-in gait", one.mean, _DOTTED[one.side]) for one in files]
            least = LEAST_SPANS.get(same[0].unit, 0.0)
            curves = [*usual, *_curves(same), *theirs]
            cells.append([svg.Strip(curve_title(same[0]), curves, least=least, rules=rules)])
    if not cells:
        return ""
    people = "; grey: between people" if any(n.kind == found.kind for n in normal) else ""
    band = f"one sd between cycles{people}"
    return svg.CurveFigure(PERCENT, cells, about, label=CYCLE_AXES[found.kind], band=band, width=270.0).html()


def _by_side(groups: Sequence[CurveGroup]) -> list[CurveGroup]:
    """Return groups in the order of the sides in every legend, whichever foot came first."""
    return sorted(groups, key=lambda one: list(_LOOKS).index(one.side))


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
            # the mean where at least half of the cycles that are measured at all are known: else it is of another few
            told = [(e.mean, np.isfinite(e.values)) for e in ends]
            known = [np.where(2 * n.sum(axis=0) >= n.any(axis=1).sum(), mean, np.nan) for mean, n in told]
            if np.isfinite(known).any():
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
