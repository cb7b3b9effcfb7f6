"""Figures across what was planned, earlier and now: changes since another session, planned and reached excitation."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.display import BLACK, BLUE, GREY, RED
from biodance.report.figures.session import bar_list
from biodance.report.figures.vector import Axis, Frame, Stroke, around, panel, points, rule, segments

if TYPE_CHECKING:
    from biodance.dance.scoring import PerformanceScore
    from biodance.identification.sessions import Difference

_PANELS = (("mass", 1.0, "mass (kg)"), ("com y", 1000.0, "centre of mass along the segment (mm)"))
"""Quantity, factor and title of each panel of the changes."""


def changes_figure(changes: "tuple[Difference, ...]", certain: "tuple[Difference, ...]") -> str:
    """Return what changed in every segment, later less earlier, with 95 % intervals: red what is ``certain``, open
    where nothing is known.
    """
    names = list(dict.fromkeys(row.segment for row in changes))
    ticks = tuple((len(names) - 1.0 - i, name.replace("_", " ")) for i, name in enumerate(names))
    y, drawn = Axis(-0.6, len(names) - 0.4, "", ticks), []
    for quantity, factor, title in _PANELS:
        rows = [row for row in changes if row.quantity == quantity]
        ends = factor * np.array([[*row.interval, row.value] for row in rows])
        x = around(np.append(ends, 0.0), label=title)
        marks = [rule(x, 0.0, upright=True, look=Stroke(BLACK, "", 0.8))]
        for (at, _), row in zip(ticks, rows, strict=True):
            look = Stroke(RED if row in certain else BLUE if row.known else GREY, "", 1.6)
            marks.append(segments(x, y, np.array([[factor * end, at] for end in row.interval]), look))
            inside = "" if row.known else "#fff"
            marks.append(points(x, y, np.array([factor * row.value]), np.array([at]), look, inside=inside))
        drawn.append(panel(x, y, marks, title, frame=Frame(height=17.0 * len(names), left=112.0, above=4.0)))
    return f'<div class="cells">{"".join(drawn)}</div>'


def excitation_figure(found: "PerformanceScore") -> str:
    """Return the share of the table's variance that a dance removes, planned (tick) and reached (bar), by segment."""
    rows = [
        (row.segment.replace("_", " "), 100 * row.reached, 100 * row.planned, f"{100 * row.reached:.0f} %")
        for row in found.excitation
    ]
    return bar_list(rows, "Share of the table's variance removed, reached (bar) and planned (tick)")
