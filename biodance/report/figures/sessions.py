"""Figures across what was planned, earlier and now: changes since another session, planned and reached excitation."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.display import BLACK, BLUE, GREY, RED
from biodance.report.figures.style import figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from biodance.dance.scoring import PerformanceScore
    from biodance.identification.sessions import Difference

_PANELS = (("mass", 1.0, "mass (kg)"), ("com y", 1000.0, "centre of mass along the segment (mm)"))
"""Quantity, factor and title of each panel of the changes."""


def changes_figure(changes: "tuple[Difference, ...]", certain: "tuple[Difference, ...]") -> "Figure":
    """Draw what changed in every segment, later less earlier, with 95 % intervals: red what is ``certain``, open where
    nothing is known.
    """
    segments = list(dict.fromkeys(row.segment for row in changes))
    place = np.arange(len(segments))[::-1]
    with look():
        drawn = figure(0.8 + 0.22 * len(segments))
        for axes, (quantity, factor, title) in zip(drawn.subplots(1, 2, sharey=True), _PANELS, strict=True):
            for y, row in zip(place, (row for row in changes if row.quantity == quantity), strict=True):
                colour = RED if row in certain else BLUE if row.known else GREY
                axes.plot(factor * np.array(row.interval), [y, y], color=colour, linewidth=1.6)
                axes.plot(factor * row.value, y, "o", color=colour, markerfacecolor=colour if row.known else "white")
            axes.axvline(0.0, color=BLACK, linewidth=0.7)
            axes.set_yticks(place, [name.replace("_", " ") for name in segments])
            axes.grid(axis="y", visible=False)
            axes.set_xlabel(title)
    return drawn


def excitation_figure(found: "PerformanceScore") -> "Figure":
    """Draw the share of the table's variance that a dance removes, planned (line) and reached (bar), by segment."""
    place = np.arange(len(found.excitation))[::-1]
    with look():
        drawn = figure(0.7 + 0.22 * len(place))
        axes = drawn.subplots()
        axes.barh(place, [100 * row.reached for row in found.excitation], 0.6, color=BLUE, label="reached")
        for y, row in zip(place, found.excitation, strict=True):
            axes.plot([100 * row.planned] * 2, [y - 0.4, y + 0.4], color=BLACK, linewidth=1.8)
        axes.plot([], [], color=BLACK, linewidth=1.8, label="planned")
        axes.set_yticks(place, [row.segment.replace("_", " ") for row in found.excitation])
        axes.grid(axis="y", visible=False)
        axes.set_xlim(0, 100)
        axes.set_xlabel("share of the table\u2019s variance removed (%)")
        drawn.legend(loc="outside upper center", ncols=2)
    return drawn
