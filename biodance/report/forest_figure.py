"""Identified segment masses beside the table, with 95 % intervals (the paper's figure 8 as a forest plot)."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.identify.identification import Identification
from biodance.identify.knowledge import SIGMAS, Known
from biodance.report.style import BLACK, GREY, RED, figure, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LIGHT = 5.0
"""kg: segments below are drawn in an axes of their own, or their intervals could not be seen beside the trunk's."""


def _rows(axes: "Axes", rows: list[Known]) -> None:
    place = np.arange(len(rows))[::-1]
    for y, row in zip(place, rows, strict=True):
        axes.plot([row.table - SIGMAS * row.table_sd, row.table + SIGMAS * row.table_sd], [y + 0.17] * 2, color=GREY, linewidth=1.0)
        axes.plot(row.table, y + 0.17, marker="s", color=GREY, markersize=4, markerfacecolor="white")
        axes.plot(row.interval, [y - 0.17] * 2, color=RED if row.verdict != "cannot be known" else BLACK, linewidth=1.8)
        known = {"known": RED, "partly known": "#F2B08A", "cannot be known": "white"}[row.verdict]
        edge = BLACK if row.verdict == "cannot be known" else RED
        axes.plot(row.value, y - 0.17, marker="o", color=edge, markersize=5.5, markerfacecolor=known)
    axes.set_yticks(place, [row.segment.replace("_", " ") for row in rows])
    axes.set_ylim(-0.7, len(rows) - 0.3)
    axes.grid(axis="y", visible=False)
    axes.set_xlim(left=max(axes.get_xlim()[0], 0.0))


def forest_figure(found: Identification) -> "Figure":
    """Draw the mass of every segment: table (square) and identified (circle: filled = known, pale = partly known, open = not known)."""
    from matplotlib.lines import Line2D

    masses = [known for known in found.known if known.quantity == "mass"]
    groups = [group for group in ([k for k in masses if k.table >= LIGHT], [k for k in masses if k.table < LIGHT]) if group]
    with look():
        drawn = figure(0.9 + 0.36 * len(masses))
        grid = drawn.subplots(len(groups), 1, height_ratios=[len(group) + 1 for group in groups], squeeze=False)
        for axes, group in zip(grid[:, 0], groups, strict=True):
            _rows(axes, group)
        grid[-1, 0].set_xlabel("mass (kg), 95 % intervals")
        handles = [
            Line2D([], [], color=GREY, marker="s", markerfacecolor="white", markersize=4, label="table"),
            Line2D([], [], color=RED, marker="o", linewidth=1.8, label="identified: known"),
            Line2D([], [], color=RED, marker="o", markerfacecolor="#F2B08A", linewidth=1.8, label="partly known"),
            Line2D([], [], color=BLACK, marker="o", markerfacecolor="white", linewidth=1.8, label="cannot be known"),
        ]
        drawn.legend(handles=handles, loc="outside upper center", ncols=4)
    return drawn
