"""Joint torques of one trial with the band that the parameters leave, the table's beside them."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.identify.torques import TorqueBands
from biodance.report.style import BLUE, GREY, RED, figure, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion", "trunk_flexion", "shoulder_flexion", "elbow_flexion")
"""Joints drawn, right and left in one axes."""
COLOURS = {"right": (BLUE, "-"), "left": (RED, "--"), "": (GREY, "-")}
"""Colour and line style of a side: never the colour alone."""


def _curve(axes: "Axes", bands: TorqueBands, joint: int, side: str) -> None:
    colour, style = COLOURS[side]
    torque, half, table = (np.where(bands.use, column[:, joint], np.nan) for column in (bands.torque, bands.half_width, bands.table))
    axes.fill_between(bands.time, torque - half, torque + half, color=colour, alpha=0.25, linewidth=0)
    axes.plot(bands.time, torque, color=colour, linestyle=style)
    axes.plot(bands.time, table, color=colour, linestyle=":", linewidth=0.9)


def drawn_joints(bands: TorqueBands) -> list[tuple[str, list[tuple[int, str]]]]:
    """Return what is drawn: title, and index and side ("right", "left", "") of the joints in one axes."""
    found = []
    for kind in SHOWN:
        named = [(bands.joints.index(name), side) for side in COLOURS if (name := f"{side}_{kind}".lstrip("_")) in bands.joints]
        if named:
            found.append((kind.replace("_", " "), named))
    return found


def torque_figure(bands: TorqueBands) -> "Figure":
    """Draw the torques of the large joints: line identified, band its 95 % interval, dotted the table's."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    rows = drawn_joints(bands)
    with look():
        drawn = figure(0.7 + 1.5 * ((len(rows) + 1) // 2))
        grid = drawn.subplots((len(rows) + 1) // 2, 2, sharex=True, squeeze=False)
        for axes, (title, joints) in zip(grid.flat, rows, strict=False):
            for joint, side in joints:
                _curve(axes, bands, joint, side)
            axes.set_title(title)
            axes.set_ylabel("N·m")
        for axes in grid.flat[len(rows) :]:
            axes.set_visible(False)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
        lines: list[Line2D | Patch] = [Line2D([], [], color=c, linestyle=s, label=side) for side, (c, s) in COLOURS.items() if side]
        lines += [Patch(color=GREY, alpha=0.25, label="95 % interval"), Line2D([], [], color=GREY, linestyle=":", label="with the table")]
        drawn.legend(handles=lines, loc="outside upper center", ncols=4)
    return drawn
