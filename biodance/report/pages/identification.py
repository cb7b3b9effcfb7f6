"""The pages of the report on what the body weighs: figures, tables and sentences; computes nothing."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from biodance.display import BLACK, BLUE, GREEN, GREY, PINK, Interval, spaced
from biodance.identification.identification import Identification
from biodance.identification.knowledge import QUANTITIES, known_interval
from biodance.identification.sessions import Difference, certain_changes
from biodance.identification.torques import Impact, TorqueBands
from biodance.identification.validation import TrialValidation
from biodance.motion.dynamics import Agreement
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.words import say_load
from biodance.records import CHANNEL_TITLES, AngleState
from biodance.report.figures import vector as svg
from biodance.report.figures.session import bar_list
from biodance.report.pages.template import render
from biodance.report.tables import identification as tables
from biodance.report.tables.schema import Row, Schema
from biodance.report.wording import changed, parted_gain, signed

if TYPE_CHECKING:
    from biodance.dance.expectation import PerformanceScore

ROW = 19.0
"""px of a segment's row."""
_LIGHT = 5.0
"""kg: segments below are drawn in a panel of their own, or their intervals could not be seen beside the trunk's."""
_INSIDE = {"known": "", "partly known": "#8fd1b9", "cannot be known": "#fff"}
_WORDS = ("grey ring: table", "green point: identified, known", "pale: partly known", "black ring: cannot be known")
_SHAPE = (
    *((f"com {axis}", 1000.0, f"centre of mass, {axis} (mm)") for axis in "xyz"),
    *((f"I{axis}{axis}", 1.0, f"inertia I{axis}{axis} (kg·m²)") for axis in "xyz"),
)
"""Quantity, factor and title of each panel."""
_Load = tuple[str, float] | None


def mass_figure(found: Identification, paper: Identification | None = None, load: _Load = None) -> str:
    """Return the mass of every segment (paper Fig. 8): table (grey) and identified (filled = known, pale = partly
    known, open = not known), with 95 % intervals; beside them (blue) that of the ``paper``'s programme, which has none,
    and the part of it (green) that is a ``load`` (segment, kg).
    """
    masses = _quantity(found, "mass")
    groups = ([k for k in masses if k.before[0] >= _LIGHT], [k for k in masses if k.before[0] < _LIGHT])
    drawn = [_forest(rows, _beside(paper, "mass"), "mass (kg), 95 % intervals", load) for rows in groups if rows]
    return _with_legend(drawn, paper, load)


def shape_figure(found: Identification, paper: Identification | None = None) -> str:
    """Return centre of mass (segment axes, from the proximal joint) and inertia about it, drawn as by `mass_figure`."""
    drawn = [
        _forest(_quantity(found, name, times), _beside(paper, name, times), title) for name, times, title in _SHAPE
    ]
    return _with_legend(drawn, paper, None)


def _quantity(found: Identification, name: str, times: float = 1.0) -> list[Interval]:
    return [known_interval(known, times) for known in found.known if known.quantity == name]


def _beside(paper: Identification | None, name: str, times: float = 1.0) -> dict[str, float]:
    return {one.segment: times * one.value for one in paper.known if one.quantity == name} if paper else {}


def _forest(rows: Sequence[Interval], beside: dict[str, float], label: str, load: _Load = None) -> str:
    """Return one panel: a row for each segment."""
    ends = np.array([v for row in rows for v in (*row.before, *row.after, beside.get(row.name, row.after[0]))])
    # some room at both ends; an axis of masses does not go below zero for it
    room, least = 0.04 * float(np.ptp(ends)), -np.inf if ends.min() < 0 else 0.0
    x = svg.Axis(max(least, float(ends.min()) - room), float(ends.max()) + room, label)
    ticks = tuple((len(rows) - 1.0 - i, spaced(row.name)) for i, row in enumerate(rows))
    y = svg.Axis(-0.6, len(rows) - 0.4, "", ticks)
    marks = []
    for (at, _), row in zip(ticks, rows, strict=True):
        edge = BLACK if row.known == "cannot be known" else GREEN
        for up, (value, low, high), colour, inside, wide in (
            (at + 0.17, row.before, GREY, "#fff", 1.0),
            (at - 0.17, row.after, edge, _INSIDE[row.known], 1.8),
        ):
            marks.append(svg.segments(x, y, np.array([[low, up], [high, up]]), svg.Stroke(colour, "", wide)))
            marks.append(svg.points(x, y, value, up, svg.Stroke(colour), inside=inside, size=6.5))
        if load is not None and row.name == load[0]:
            ends = np.array([[row.after[0] - load[1], at - 0.4], [row.after[0], at - 0.4]])
            marks.append(svg.segments(x, y, ends, svg.Stroke(PINK, "", 2.4)))
        if row.name in beside:
            marks.append(svg.points(x, y, beside[row.name], at, svg.Stroke(BLUE)))
    frame = svg.Frame(height=ROW * len(rows), left=112.0, above=4.0)
    return svg.panel(x, y, marks, f"{label.partition(',')[0]} of every segment, table and identified", frame=frame)


def _with_legend(drawn: Sequence[str], paper: Identification | None, load: _Load) -> str:
    more = {"blue point: the paper's programme": paper is not None, "pink: load": load is not None}
    return svg.with_legend((*_WORDS, *(word for word, there in more.items() if there)), drawn)


_PANELS = (("mass", 1.0, "mass (kg)"), ("com y", 1000.0, "centre of mass along the segment (mm)"))
"""Quantity, factor and title of each panel of the changes."""


def changes_figure(changes: tuple[Difference, ...], certain: tuple[Difference, ...]) -> str:
    """Return what changed in every segment, later less earlier, with intervals: green ``certain``, open unknown."""
    names = list(dict.fromkeys(row.segment for row in changes))
    ticks = tuple((len(names) - 1.0 - i, spaced(name)) for i, name in enumerate(names))
    y, drawn = svg.Axis(-0.6, len(names) - 0.4, "", ticks), []
    for quantity, factor, title in _PANELS:
        rows = [row for row in changes if row.quantity == quantity]
        ends = factor * np.array([[*row.interval, row.value] for row in rows])
        x = svg.around(np.append(ends, 0.0), label=title)
        marks = [svg.rule(x, 0.0, upright=True, look=svg.Stroke(BLACK, "", 0.8))]
        for (at, _), row in zip(ticks, rows, strict=True):
            look = svg.Stroke(GREEN if row in certain else BLACK if row.known else GREY, "", 1.6)
            marks.append(svg.segments(x, y, np.array([[factor * end, at] for end in row.interval]), look))
            inside = "" if row.known else "#fff"
            marks.append(svg.points(x, y, factor * row.value, at, look, inside=inside))
        drawn.append(svg.panel(x, y, marks, title, frame=svg.Frame(height=17.0 * len(names), left=112.0, above=4.0)))
    return f'<div class="cells">{"".join(drawn)}</div>'


def excitation_figure(found: "PerformanceScore") -> str:
    """Return the share of the table's variance that a dance removes, planned (tick) and reached (bar), by segment."""
    rows = [
        (spaced(row.segment), 100 * row.reached, 100 * row.planned, f"{100 * row.reached:.0f} %")
        for row in found.excitation
    ]
    return bar_list(rows, "Share of the table's variance removed, reached (bar) and planned (tick)")


def impact_figure(found: Sequence[Impact]) -> str:
    """Return the largest impacts: pull from the prior with what is left of it, and moments of knee and hip."""
    rows = list(found[:15])
    ticks = tuple((len(rows) - 1.0 - i, spaced(f"{row.segment} {row.quantity}")) for i, row in enumerate(rows))
    y = svg.Axis(-0.6, len(rows) - 0.4, "", ticks)
    far = max(2.0, *(abs(row.pull) + row.left for row in rows))
    pulled = svg.Axis(-1.05 * far, 1.05 * far, "pull from the prior (prior sd)")
    largest = max(max(row.knee, row.hip) for row in rows)
    moment = svg.Axis(0.0, 1.08 * largest, "moment that one sd left adds (N·m RMS)")
    left = [svg.shade(pulled, -1.0, 1.0, kind="certain"), svg.rule(pulled, 0.0, upright=True)]
    right = []
    for (at, _), row in zip(ticks, rows, strict=True):
        ends = np.array([[row.pull - row.left, at], [row.pull + row.left, at]])
        black, knee, hip = svg.Stroke(BLACK), at + 0.16, at - 0.16
        left += [svg.segments(pulled, y, ends, black), svg.points(pulled, y, row.pull, at, black)]
        ways = (np.array([[0.0, up], [size, up]]) for up, size in ((knee, row.knee), (hip, row.hip)))
        looks = (svg.Stroke(GREEN, "", 2.0), svg.Stroke(PINK, "4 2", 2.0))
        right += [svg.segments(moment, y, way, look) for way, look in zip(ways, looks, strict=True)]
        right.append(svg.points(moment, y, row.knee, knee, svg.Stroke(GREEN)))
        right.append(svg.points(moment, y, row.hip, hip, svg.Stroke(PINK), inside="#fff"))
    frame = svg.Frame(height=ROW * len(rows), left=138.0, above=4.0)
    pulls = svg.panel(pulled, y, left, "pull of every quantity", frame=frame)
    impacts = svg.panel(moment, y, right, "impact on knee and hip", frame=frame)
    words = ("grey: one prior standard deviation", "green point: knee flexion", "pink ring: hip flexion")
    return svg.with_legend(words, (pulls, impacts))


_SHOWN = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion", "trunk_flexion", "shoulder_flexion", "elbow_flexion")
"""Joints drawn, right and left in one panel."""
_SIDES = {"right": svg.RIGHT_SIDE, "left": svg.LEFT_SIDE, "": svg.MIDDLE_SIDE}


def drawn_joints(bands: TorqueBands) -> list[tuple[str, list[tuple[int, str]]]]:
    """Return what is drawn: title, and index and side ("right", "left", "") of the joints in one panel."""
    found = []
    for kind in _SHOWN:
        names = ((f"{side}_{kind}".lstrip("_"), side) for side in _SIDES)
        if named := [(bands.joints.index(name), side) for name, side in names if name in bands.joints]:
            found.append((spaced(kind), named))
    return found


def torque_figure(bands: TorqueBands) -> str:
    """Return the torques of the large joints: line identified, band its 95 % interval, grey the table's."""
    cells = []
    for title, joints in drawn_joints(bands):
        curves = []
        for joint, side in joints:
            torque, half, table = (
                np.where(bands.use, column[:, joint], np.nan)
                for column in (bands.torque, bands.half_width, bands.table)
            )
            look = _SIDES[side]
            curves.append(svg.Curve(f"{side or 'trunk'} identified", torque, look, half))
            curves.append(svg.Curve(f"{side or 'trunk'} with the table", table, svg.Stroke(look.colour, "1 3", 0.9)))
        cells.append([svg.Strip(f"{title} (N·m)", curves, 4.0)])
    about = "Moments of the large joints; the largest values are in the table below"
    drawn = svg.CurveFigure(bands.time, cells, about, bands.use, bands.trial, filled=bands.state == AngleState.FILLED)
    return drawn.html()


_METHODS = Schema(
    "segment table posterior paper",
    shown="segment: {segment:name} | table (kg): {table[0]:2} | posterior (kg): {posterior[0]:2} | paper (kg): "
    "{paper[0]:2} | table (mm): {table[1]:mm0} | posterior (mm): {posterior[1]:mm0} | paper (mm): {paper[1]:mm0}",
)
"""Mass (kg) and centre of mass along its segment (m) by the table, the posterior and the paper's programme."""


def _compared(found: SessionIdentification) -> list[Row]:
    """Return a row for each segment where the paper's programme stands beside the posterior."""
    if found.posterior is None:
        return []
    both = (tables.segments_document(one.identification) for one in (found.posterior, found))
    return [
        {
            "segment": mine["name"],
            "table": (mine["mass_prior_kg"], mine["com_prior_m"][1]),
            "posterior": (mine["mass_kg"], mine["com_m"][1]),
            "paper": (other["mass_kg"], other["com_m"][1]),
        }
        for mine, other in zip(*both, strict=False)
    ]


def _agreements(found: SessionIdentification, trial: TrialValidation) -> list[tuple[str, Agreement]]:
    """Return how well the table, the identified parameters and, beside the paper's, those of the posterior agree."""
    if found.posterior is None:
        extended = [("with skin and flesh", trial.extended_agreement)] if trial.extended_agreement else []
        return [("table", trial.table_agreement), ("identified", trial.identified_agreement), *extended]
    every = (*found.posterior.validations, *found.posterior.fitted)
    same = [("posterior", other.identified_agreement) for other in every if other.name == trial.name]
    return [("table", trial.table_agreement), *same, ("paper", trial.identified_agreement)]


def _mass_changes(changes: Sequence[Difference]) -> list[Row]:
    rows = tables.DIFFERENCE_ROW.rows(row for row in changes if row.quantity == "mass")
    return [row if row["known"] else row | {"p": "cannot be known"} for row in rows]


def identification_section(found: SessionIdentification) -> str:
    """Return the sections as HTML text; the same argument gives the same characters."""
    from markupsafe import Markup

    one, sure = found.identification, certain_changes(found.changes)
    # beside the paper's programme the figures show the posterior, which alone has intervals
    drawn, paper = (found.posterior.identification, one) if found.posterior else (one, None)
    carried = (found.search.best.segment, found.search.best.mass) if found.search.found else None
    rows, logs = tables.segments_document(one), found.performance.logs if found.performance else ()
    return render(
        "identification.html.j2",
        filters={"spaced": spaced, "changed": changed, "signed": signed},
        schemas={
            "segment": tables.SEGMENT_ROW,
            "torque": tables.TORQUE_ROW,
            "suspect": tables.SUSPECT_ROW,
            "difference": tables.DIFFERENCE_ROW,
        },
        one=one,
        # the page shows them as a table
        notes=[note for note in found.notes if not note.startswith("Cannot be known")],
        failures=found.failures,
        girths="; ".join(f"{spaced(name)}: {spaced(', '.join(said))}" for name, said in one.body.girths.items()),
        forest=Markup(mass_figure(drawn, paper, carried)) if rows else "",
        shape=Markup(shape_figure(drawn, paper)) if rows else "",
        methods=_METHODS,
        compared=_compared(found),
        segments=rows,
        quantities=QUANTITIES,
        marks={"known": "●", "partly known": "◐", "cannot be known": "○"},
        gain=found.gain,
        trials=[(trial, "kept") for trial in found.validations] + [(trial, "fitted") for trial in found.fitted],
        parted={row["trial"]: parted_gain(row["gain"]) for row in tables.VALIDATION_ROW.rows(found.validations)},
        channels=CHANNEL_TITLES,
        agreements=partial(_agreements, found),
        ranked=Markup(impact_figure(found.impacts)) if found.impacts else "",
        torques=found.torques,
        torque_rows=(tables.torques_document(found.torques) or {}).get("joints", []),
        torque_image=Markup(torque_figure(found.torques)) if found.torques and drawn_joints(found.torques) else "",
        search=found.search,
        load=say_load(found.search),
        suspects=tables.SUSPECT_ROW.rows(found.search.suspects),
        changes=_mass_changes(found.changes),
        comparison=Markup(changes_figure(found.changes, sure)) if found.changes else "",
        certain=sure,
        total=len(found.changes),
        performance=found.performance,
        logs=[tables.log_in_words(tables.VISIT_ROW.row(log)) for log in logs],
        danced=Markup(excitation_figure(found.performance)) if found.performance else "",
    )
