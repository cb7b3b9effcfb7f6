"""Six channels of one trial: measured, with the table, with the identified parameters (the paper's figure 9), differences below."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.identify.validation import TrialValidation
from biodance.lab.filters import runs
from biodance.records import CHANNELS
from biodance.report.style import BLACK, BLUE, GREY, RED, figure, look
from biodance.report.wrench_figure import LEAST, TITLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TABLE, IDENTIFIED = (0, (4, 2)), (0, (1, 1))
"""Line styles, so that the curves differ without colour."""


def _curves(axes: "Axes", trial: TrialValidation, channel: int) -> None:
    time, used = trial.measured.time, trial.use
    for first, stop in runs(np.logical_not(used)):
        axes.axvspan(time[first], time[stop - 1], facecolor="#EDEDED", linewidth=0)
    measured = trial.measured.value[:, channel]
    axes.plot(time, measured, color=BLACK)
    for wrench, colour, style in ((trial.table, BLUE, TABLE), (trial.identified, RED, IDENTIFIED)):
        axes.plot(time, np.where(used, wrench.value[:, channel], np.nan), color=colour, linestyle=style)
    shown = np.concatenate([w.value[used, channel] for w in (trial.measured, trial.table, trial.identified)])
    middle, half = (shown.max() + shown.min()) / 2, max(0.56 * np.ptp(shown), LEAST[channel] / 2)
    axes.set_ylim(middle - half, middle + half)
    axes.set_ylabel(TITLES[channel])
    axes.tick_params(labelbottom=False)


def _differences(axes: "Axes", trial: TrialValidation, channel: int) -> None:
    time, used, largest = trial.measured.time, trial.use, 0.0
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    for wrench, colour, style in ((trial.table, BLUE, TABLE), (trial.identified, RED, "-")):
        difference = np.where(used, trial.measured.value[:, channel] - wrench.value[:, channel], np.nan)
        axes.plot(time, difference, color=colour, linestyle=style, linewidth=0.9)
        largest = max(largest, float(np.nanmax(np.abs(difference))))
    half = max(1.15 * largest, LEAST[channel] / 4)
    axes.set_ylim(-half, half)
    axes.set_ylabel("diff.", fontsize=7.5)


def validation_figure(trial: TrialValidation) -> "Figure":
    """Draw six channels in two columns (forces left, moments right), each over its differences; grey frames are left out."""
    from matplotlib.lines import Line2D

    with look():
        drawn = figure(6.2)
        grid = drawn.subplots(6, 2, sharex=True, height_ratios=[3, 1.2] * 3)
        for channel in range(len(CHANNELS)):
            row, column = 2 * (channel % 3), channel // 3
            _curves(grid[row, column], trial, channel)
            _differences(grid[row + 1, column], trial, channel)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
            axes.set_xlim(trial.measured.time[0], trial.measured.time[-1])
        lines = [
            Line2D([], [], color=BLACK, label="measured by the plates"),
            Line2D([], [], color=BLUE, linestyle=TABLE, label="with the table"),
            Line2D([], [], color=RED, linestyle=IDENTIFIED, label="with the identified parameters"),
        ]
        drawn.legend(handles=lines, loc="outside upper center", ncols=3)
        drawn.align_ylabels()
    return drawn
