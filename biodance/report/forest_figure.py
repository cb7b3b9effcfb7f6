"""Identified segment masses beside the table, with 95 % intervals (the paper's figure 8 as a forest plot)."""

from typing import TYPE_CHECKING

from biodance.display import intervals
from biodance.identify.identification import Identification
from biodance.identify.knowledge import mass_interval
from biodance.report.style import BLACK, GREY, RED, figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIGHT = 5.0
"""kg: segments below are drawn in an axes of their own, or their intervals could not be seen beside the trunk's."""


def forest_figure(found: Identification) -> "Figure":
    """Draw the mass of every segment: table (square) and identified (circle: filled = known, pale = partly known, open = not known)."""
    from matplotlib.lines import Line2D

    masses = [known for known in found.known if known.quantity == "mass"]
    groups = [group for group in ([k for k in masses if k.table >= LIGHT], [k for k in masses if k.table < LIGHT]) if group]
    with look():
        drawn = figure(0.9 + 0.36 * len(masses))
        grid = drawn.subplots(len(groups), 1, height_ratios=[len(group) + 1 for group in groups], squeeze=False)
        for axes, group in zip(grid[:, 0], groups, strict=True):
            intervals([mass_interval(known) for known in group], axes=axes)
            axes.set_xlim(left=max(axes.get_xlim()[0], 0.0))
        grid[-1, 0].set_xlabel("mass (kg), 95 % intervals")
        handles = [
            Line2D([], [], color=GREY, marker="s", markerfacecolor="white", markersize=4, label="table"),
            Line2D([], [], color=RED, marker="o", linewidth=1.8, label="identified: known"),
            Line2D([], [], color=RED, marker="o", markerfacecolor="#F2B08A", linewidth=1.8, label="partly known"),
            Line2D([], [], color=BLACK, marker="o", markerfacecolor="white", linewidth=1.8, label="cannot be known"),
        ]
        drawn.legend(handles=handles, loc="outside upper center", ncols=4)
    return drawn
