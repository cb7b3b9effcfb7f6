"""A 3-D still: the measured markers and the body that was fitted to them."""

from typing import TYPE_CHECKING, cast

import numpy as np

from biodance.display import BLACK, GREEN, GREY, YELLOW
from biodance.pipeline.results import Still
from biodance.report.figures.style import SIDE_COLOURS, figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

FORCE_SCALE = 0.001
"""Length of the drawn force, m per N."""

RESIDUAL_SCALE = 0.01
"""Length of the drawn residual force, m per N: ten times the measured force's."""

VIEWS = ((12.0, -35.0, "from the front, right"), (0.0, -90.0, "from the right"))
"""Elevation and azimuth in degrees, the latter from where the subject looks, and title of each view."""


def _frame(axes: "Axes3D", still: Still) -> None:
    """Give all three axes one scale around the body, which stands in the middle."""
    points = np.concatenate([still.bones.reshape(-1, 3), still.markers.reshape(-1, 3)])
    low, high = np.nanmin(points, axis=0) - 0.05, np.nanmax(points, axis=0) + 0.05
    reach = np.max((high - low)[:2]) / 2 + 0.1
    middle = (low + high) / 2
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach, middle[1] + reach)
    axes.set_zlim(low[2], high[2])
    axes.set_box_aspect((2 * reach, 2 * reach, high[2] - low[2]), zoom=1.12)
    axes.set_proj_type("ortho")
    axes.set(xticklabels=[], yticklabels=[], xlabel="x", ylabel="y", zlabel="z (m)")
    axes.xaxis.labelpad = axes.yaxis.labelpad = -12.0
    axes.tick_params(labelsize=6.5)


def _body(axes: "Axes3D", still: Still) -> None:
    for side, (colour, line) in SIDE_COLOURS.items():
        for i in (i for i, own in enumerate(still.sides) if own == side):
            axes.plot(*still.bones[i].T, color=colour, linestyle=line, linewidth=2.2)
    axes.plot(*still.markers.T, linestyle="", marker="o", markersize=2.2, color=BLACK)
    axes.plot(*still.com, linestyle="", marker="D", markersize=5, color=GREEN)
    if np.isfinite(still.residual).all():
        axes.plot(*np.stack([still.com, still.com + RESIDUAL_SCALE * still.residual]).T, color=BLACK, linewidth=2.2)
    if np.isfinite(still.load).all():
        axes.plot(*still.load, linestyle="", marker="o", markersize=9, color=YELLOW, markeredgecolor=BLACK)


def _plates(axes: "Axes3D", still: Still) -> None:
    for corners in still.plates:
        axes.plot(*corners[[0, 1, 2, 3, 0]].T, color=GREY, linewidth=0.9)
    if np.isfinite(still.cop).all():
        axes.plot(*np.stack([still.cop, still.cop + FORCE_SCALE * still.force]).T, color=GREEN, linewidth=1.6)


def still_figure(still: Still) -> "Figure":
    """Draw the body, its markers, the plates and the ground force from two sides, all axes to one scale (grid lines
    in m).
    """
    from matplotlib.lines import Line2D

    with look():
        drawn = figure(4.8)
        for i, (elevation, azimuth, title) in enumerate(VIEWS):
            axes = cast("Axes3D", drawn.add_subplot(1, 2, i + 1, projection="3d"))
            _body(axes, still)
            _plates(axes, still)
            _frame(axes, still)
            axes.view_init(elevation, azimuth + np.degrees(np.arctan2(still.forward[1], still.forward[0])))
            axes.set_title(title, y=1.03)
        handles = [
            Line2D([], [], color=colour, linestyle=line, linewidth=2.2, label=side)
            for side, (colour, line) in SIDE_COLOURS.items()
        ]
        handles.append(Line2D([], [], linestyle="", marker="o", markersize=3, color=BLACK, label="measured marker"))
        handles.append(Line2D([], [], linestyle="", marker="D", color=GREEN, label="centre of mass"))
        drawn.legend(handles=handles, loc="outside lower center", ncols=5)
    return drawn
