"""Figures of a session: markers to the model, quiet standing from above, measured beside simulated wrench."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from biodance.display import BLACK, GREEN, GREY, RED, SKY
from biodance.pipeline.trial_result import MarkerFit, QuietStanding, WrenchComparison
from biodance.records import CHANNELS, Array, runs
from biodance.report.figures.style import SIDE_COLOURS, figure, look

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    _DrawChannel = Callable[[Axes, int], None]


def marker_figure(fit: MarkerFit) -> "Figure":
    """Draw the RMS distance (bar) and the largest distance (short line) of every seen marker in mm, the worst first."""
    seen = np.flatnonzero(np.isfinite(fit.rms))
    order = seen[np.argsort(-fit.rms[seen], kind="stable")]
    with look():
        drawn = figure(2.0)
        axes = drawn.subplots()
        place = np.arange(order.size)
        axes.bar(
            place,
            1000 * fit.rms[order],
            width=0.75,
            color=SKY,
            edgecolor=BLACK,
            linewidth=0.5,
            label="RMS over the trial",
        )
        axes.plot(place, 1000 * fit.max[order], linestyle="", marker="_", color=BLACK, markersize=7, label="largest")
        axes.set_xticks(place, [fit.names[i] for i in order], rotation=90, fontsize=7)
        axes.set_xlim(-0.6, max(order.size, 1) - 0.4)
        axes.grid(visible=False, axis="x")
        axes.set_ylim(0.0, max(1.0, 1050 * float(np.max(fit.max[order], initial=0.0))))
        axes.set_ylabel("distance (mm)")
        axes.legend(loc="upper right", ncols=2)
    return drawn


_AROUND = 200.0
"""mm that the wide view shows around the feet."""


def _turned(points: Array, standing: QuietStanding) -> Array:
    """Return lab points (..., 2) as millimetres to the subject's right and ahead, from the mean centre of pressure."""
    ahead = standing.forward
    right = np.array([ahead[1], -ahead[0]])
    arm = points - np.nanmean(standing.cop, axis=0)
    return 1000 * np.stack([arm @ right, arm @ ahead], axis=-1)


def _path(axes: "Axes", path: Array, *, colour: str, marker: str, label: str) -> None:
    axes.plot(*path.T, color=colour, linewidth=0.6, alpha=0.6)
    axes.plot(*np.nanmean(path, axis=0), color=colour, marker=marker, markersize=7, linestyle="", label=label)


def _surroundings(axes: "Axes", standing: QuietStanding) -> None:
    for i, corners in enumerate(standing.plates):
        outline = _turned(corners[[0, 1, 2, 3, 0]], standing)
        axes.plot(*outline.T, color=GREY, linewidth=0.8, linestyle="-", label="plates" if i == 0 else None)
    for side, marker in (("left", "<"), ("right", ">")):
        chosen = [i for i, name in enumerate(standing.foot_names) if name.startswith(side)]
        if chosen:
            feet = _turned(standing.feet[chosen], standing)
            axes.plot(
                *feet.T,
                linestyle="",
                marker=marker,
                markersize=4,
                color=SIDE_COLOURS[side][0],
                label=f"{side} foot markers",
            )


def standing_figure(standing: QuietStanding) -> "Figure":
    """Draw centre of pressure, centre of mass, feet and plates in the subject's own axes; on the right the middle,
    enlarged.
    """
    with look():
        drawn = figure(3.4)
        wide, near = drawn.subplots(1, 2)
        for axes in (wide, near):
            _path(axes, _turned(standing.cop, standing), colour=BLACK, marker="o", label="centre of pressure (plates)")
            if standing.com.size:
                _path(axes, _turned(standing.com, standing), colour=GREEN, marker="D", label="centre of mass (table)")
            axes.set_aspect("equal")
            axes.set_xlabel("to the subject's right (mm)" if standing.com.size else "along lab −y (mm)")
        _surroundings(wide, standing)
        shown = _turned(np.concatenate([standing.feet, standing.cop]), standing)
        (left, back), (right, front) = np.nanmin(shown, axis=0) - _AROUND, np.nanmax(shown, axis=0) + _AROUND
        wide.set_xlim(left, right)
        wide.set_ylim(back, front)
        wide.set_ylabel("ahead (mm)" if standing.com.size else "along lab x (mm)")
        reach = 1.4 * max(
            20.0, *(np.nanmax(np.abs(_turned(p, standing))) for p in (standing.cop, standing.com) if p.size)
        )
        near.set_xlim(-reach, reach)
        near.set_ylim(-reach, reach)
        near.axhline(0.0, color=GREY, linewidth=0.6)
        near.axvline(0.0, color=GREY, linewidth=0.6)
        handles, labels = wide.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=3)
    return drawn


TITLES = ("Fx (N)", "Fy (N)", "Fz (N)", "Mx (N·m)", "My (N·m)", "Mz (N·m)")

LEAST = (10.0, 10.0, 10.0, 4.0, 4.0, 4.0)
"""N, N·m: the least that an axis spans, so that the noise of quiet standing is not blown up."""


def _shade(axes: "Axes", comparison: WrenchComparison) -> None:
    """Hatch the frames that are left out of every number."""
    for first, stop in runs(np.logical_not(comparison.used)):
        axes.axvspan(
            comparison.time[first],
            comparison.time[stop - 1],
            facecolor="#EDEDED",
            edgecolor="#C4C4C4",
            hatch="////",
            linewidth=0,
        )


def _curves(axes: "Axes", comparison: WrenchComparison, channel: int) -> None:
    time, used = comparison.time, comparison.used
    _shade(axes, comparison)
    axes.plot(time, comparison.measured[:, channel], color=BLACK, linestyle="-")
    axes.plot(time, comparison.simulated[:, channel], color=RED, linestyle=(0, (4, 2)))
    shown = np.concatenate(
        [comparison.measured[:, channel], comparison.simulated[used, channel] if used.any() else np.empty(0)]
    )
    limit_channel(axes, channel, shown)


def limit_channel(axes: "Axes", channel: int, shown: Array) -> None:
    """Let the axes of a channel hold all values ``shown``, no closer than `LEAST`."""
    low, high = np.nanmin(shown), np.nanmax(shown)
    half = max(0.56 * (high - low), LEAST[channel] / 2)
    axes.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)
    axes.set_ylabel(TITLES[channel])
    axes.tick_params(labelbottom=False)


def limit_difference(axes: "Axes", channel: int, largest: float) -> None:
    """Let the axes of a channel's difference hold its ``largest`` size, zero in the middle."""
    half = max(1.15 * largest, LEAST[channel] / 4)
    axes.set_ylim(-half, half)
    axes.set_ylabel("diff.", fontsize=7.5)


def over_differences(
    size: float,
    time: Array,
    curves: "_DrawChannel",
    differences: "_DrawChannel",
    *,
    share: float,
    lines: "list[Artist]",
) -> "Figure":
    """Draw six channels in two columns (forces left, moments right) over ``time`` (T,) s, each over its difference.

    ``curves`` and ``differences`` draw one channel into the axes given; ``size`` inches is the height of the figure,
    ``share`` that of a difference, ``lines`` the legend.
    """
    drawn = figure(size)
    grid = drawn.subplots(6, 2, sharex=True, height_ratios=[3, share] * 3)
    for channel in range(len(CHANNELS)):
        row, column = 2 * (channel % 3), channel // 3
        curves(grid[row, column], channel)
        differences(grid[row + 1, column], channel)
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
        axes.set_xlim(time[0], time[-1])
    drawn.legend(handles=lines, loc="outside upper center", ncols=3)
    drawn.align_ylabels()
    return drawn


def _residual(axes: "Axes", comparison: WrenchComparison, channel: int) -> None:
    difference = np.where(comparison.used, comparison.measured[:, channel] - comparison.simulated[:, channel], np.nan)
    _shade(axes, comparison)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.plot(comparison.time, difference, color=BLACK, linestyle="-", linewidth=0.9)
    largest = np.nanmax(np.abs(difference)) if comparison.used.any() else 0.0
    limit_difference(axes, channel, largest)


def wrench_figure(comparison: WrenchComparison) -> "Figure":
    """Draw six channels in two columns (forces left, moments right), each over its residual; hatched frames are left
    out.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    with look():
        lines: list[Artist] = [
            Line2D([], [], color=BLACK, linestyle="-", label="measured by the plates"),
            Line2D([], [], color=RED, linestyle=(0, (4, 2)), label="simulated with the table"),
        ]
        if not comparison.used.all():
            lines.append(
                Patch(
                    facecolor="#EDEDED",
                    edgecolor="#C4C4C4",
                    hatch="////",
                    linewidth=0,
                    label="left out: not fully measured",
                )
            )
        return over_differences(
            5.7,
            comparison.time,
            lambda axes, channel: _curves(axes, comparison, channel),
            lambda axes, channel: _residual(axes, comparison, channel),
            share=1,
            lines=lines,
        )
