"""Quiet standing from above: where the plates feel the weight, and where the table puts the centre of mass."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.pipeline.results import Standing
from biodance.records import Array
from biodance.report.style import BLACK, GREEN, GREY, SIDES, figure, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AROUND = 200.0
"""mm that the wide view shows around the feet."""


def _turned(points: Array, standing: Standing) -> Array:
    """Return lab points (..., 2) as millimetres to the subject's right and ahead, from the mean centre of pressure."""
    ahead = standing.forward
    right = np.array([ahead[1], -ahead[0]])
    arm = points - np.nanmean(standing.cop, axis=0)
    return 1000 * np.stack([arm @ right, arm @ ahead], axis=-1)


def _path(axes: "Axes", path: Array, *, colour: str, marker: str, label: str) -> None:
    axes.plot(*path.T, color=colour, linewidth=0.6, alpha=0.6)
    axes.plot(*np.nanmean(path, axis=0), color=colour, marker=marker, markersize=7, linestyle="", label=label)


def _surroundings(axes: "Axes", standing: Standing) -> None:
    for i, corners in enumerate(standing.plates):
        outline = _turned(corners[[0, 1, 2, 3, 0]], standing)
        axes.plot(*outline.T, color=GREY, linewidth=0.8, linestyle="-", label="plates" if i == 0 else None)
    for side, marker in (("left", "<"), ("right", ">")):
        chosen = [i for i, name in enumerate(standing.foot_names) if name.startswith(side)]
        if chosen:
            feet = _turned(standing.feet[chosen], standing)
            axes.plot(*feet.T, linestyle="", marker=marker, markersize=4, color=SIDES[side][0], label=f"{side} foot markers")


def standing_figure(standing: Standing) -> "Figure":
    """Draw centre of pressure, centre of mass, feet and plates in the subject's own axes; on the right the middle, enlarged."""
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
        (left, back), (right, front) = np.nanmin(shown, axis=0) - AROUND, np.nanmax(shown, axis=0) + AROUND
        wide.set_xlim(left, right)
        wide.set_ylim(back, front)
        wide.set_ylabel("ahead (mm)" if standing.com.size else "along lab x (mm)")
        reach = 1.4 * max(20.0, *(np.nanmax(np.abs(_turned(p, standing))) for p in (standing.cop, standing.com) if p.size))
        near.set_xlim(-reach, reach)
        near.set_ylim(-reach, reach)
        near.axhline(0.0, color=GREY, linewidth=0.6)
        near.axvline(0.0, color=GREY, linewidth=0.6)
        handles, labels = wide.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=3)
    return drawn
