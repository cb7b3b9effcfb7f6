"""Measured beside simulated wrench in six channels, the residual under each (the paper's figure 9)."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.lab.filters import runs
from biodance.pipeline.results import WrenchComparison
from biodance.records import CHANNELS
from biodance.report.style import BLACK, GREY, RED, figure, look

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = ("Fx (N)", "Fy (N)", "Fz (N)", "Mx (N·m)", "My (N·m)", "Mz (N·m)")

LEAST = (10.0, 10.0, 10.0, 4.0, 4.0, 4.0)
"""N, N·m: the least that an axis spans, so that the noise of quiet standing is not blown up."""


def _shade(axes: "Axes", comparison: WrenchComparison) -> None:
    """Hatch the frames that are left out of every number."""
    for first, stop in runs(np.logical_not(comparison.used)):
        axes.axvspan(comparison.time[first], comparison.time[stop - 1], facecolor="#EDEDED", edgecolor="#C4C4C4", hatch="////", linewidth=0)


def _curves(axes: "Axes", comparison: WrenchComparison, channel: int) -> None:
    time, used = comparison.time, comparison.used
    _shade(axes, comparison)
    axes.plot(time, comparison.measured[:, channel], color=BLACK, linestyle="-")
    axes.plot(time, comparison.simulated[:, channel], color=RED, linestyle=(0, (4, 2)))
    shown = np.concatenate([comparison.measured[:, channel], comparison.simulated[used, channel] if used.any() else np.empty(0)])
    low, high = np.nanmin(shown), np.nanmax(shown)
    half = max(0.56 * (high - low), LEAST[channel] / 2)
    axes.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)
    axes.set_ylabel(TITLES[channel])
    axes.tick_params(labelbottom=False)


def _residual(axes: "Axes", comparison: WrenchComparison, channel: int) -> None:
    difference = np.where(comparison.used, comparison.measured[:, channel] - comparison.simulated[:, channel], np.nan)
    _shade(axes, comparison)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.plot(comparison.time, difference, color=BLACK, linestyle="-", linewidth=0.9)
    largest = np.nanmax(np.abs(difference)) if comparison.used.any() else 0.0
    half = max(1.15 * largest, LEAST[channel] / 4)
    axes.set_ylim(-half, half)
    axes.set_ylabel("diff.", fontsize=7.5)


def wrench_figure(comparison: WrenchComparison) -> "Figure":
    """Draw six channels in two columns (forces left, moments right), each over its residual; hatched frames are left out."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    with look():
        drawn = figure(5.7)
        grid = drawn.subplots(6, 2, sharex=True, height_ratios=[3, 1] * 3)
        for channel in range(len(CHANNELS)):
            row, column = 2 * (channel % 3), channel // 3
            _curves(grid[row, column], comparison, channel)
            _residual(grid[row + 1, column], comparison, channel)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
            axes.set_xlim(comparison.time[0], comparison.time[-1])
        lines: list[Artist] = [
            Line2D([], [], color=BLACK, linestyle="-", label="measured by the plates"),
            Line2D([], [], color=RED, linestyle=(0, (4, 2)), label="simulated with the table"),
        ]
        if not comparison.used.all():
            lines.append(Patch(facecolor="#EDEDED", edgecolor="#C4C4C4", hatch="////", linewidth=0, label="left out: not fully measured"))
        drawn.legend(handles=lines, loc="outside upper center", ncols=3)
        drawn.align_ylabels()
    return drawn
