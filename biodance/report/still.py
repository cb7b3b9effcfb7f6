"""A 3-D still: the measured markers and the body that was fitted to them."""

from typing import TYPE_CHECKING, cast

import numpy as np

from biodance.pipeline.results import Still
from biodance.report.style import BLACK, GREEN, GREY, SIDES, figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

FORCE_SCALE = 0.001
"""Length of the drawn force, m per N."""

VIEWS = ((10.0, -60.0, "from the front right"), (5.0, 0.0, "along lab x"))


def _frame(axes: "Axes3D", still: Still) -> None:
    """Give all three axes one scale around the body."""
    points = np.concatenate([still.bones.reshape(-1, 3), still.markers.reshape(-1, 3)])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    middle, reach = (low + high) / 2, np.max(high - low) / 2
    for place, axis in zip(middle, "xyz", strict=True):
        axes.set(**{f"{axis}lim": (place - reach, place + reach)})
    axes.set_box_aspect((1, 1, 1))
    axes.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
    axes.tick_params(labelsize=6.5)


def _body(axes: "Axes3D", still: Still) -> None:
    for side, (colour, line) in SIDES.items():
        for i in (i for i, own in enumerate(still.sides) if own == side):
            axes.plot(*still.bones[i].T, color=colour, linestyle=line, linewidth=2.2)
    axes.plot(*still.markers.T, linestyle="", marker="o", markersize=2.2, color=BLACK)
    axes.plot(*still.com, linestyle="", marker="D", markersize=5, color=GREEN)


def _plates(axes: "Axes3D", still: Still) -> None:
    for corners in still.plates:
        axes.plot(*corners[[0, 1, 2, 3, 0]].T, color=GREY, linewidth=0.9)
    if np.isfinite(still.cop).all():
        axes.plot(*np.stack([still.cop, still.cop + FORCE_SCALE * still.force]).T, color=GREEN, linewidth=1.6)


def still_figure(still: Still) -> "Figure":
    """Draw the body, its markers, the plates and the ground force from two sides, all axes to one scale."""
    from matplotlib.lines import Line2D

    with look():
        drawn = figure(4.3)
        for i, (elevation, azimuth, title) in enumerate(VIEWS):
            axes = cast("Axes3D", drawn.add_subplot(1, 2, i + 1, projection="3d"))
            _body(axes, still)
            _plates(axes, still)
            _frame(axes, still)
            axes.view_init(elevation, azimuth)
            axes.set_title(title)
        handles = [Line2D([], [], color=colour, linestyle=line, linewidth=2.2, label=side) for side, (colour, line) in SIDES.items()]
        handles.append(Line2D([], [], linestyle="", marker="o", markersize=3, color=BLACK, label="measured marker"))
        handles.append(Line2D([], [], linestyle="", marker="D", color=GREEN, label="centre of mass"))
        drawn.legend(handles=handles, loc="outside lower center", ncols=5)
    return drawn
