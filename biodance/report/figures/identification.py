"""Figures of an identification: segment masses (paper Fig. 8), joint torques with bands, validation (paper Fig. 9)."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.display import BLACK, BLUE, GREY, RED, intervals
from biodance.identification.identification import Identification
from biodance.identification.knowledge import mass_interval
from biodance.identification.torques import TorqueBands
from biodance.identification.validation import TrialValidation
from biodance.records import runs
from biodance.report.figures.session import limit_channel, limit_difference, over_differences
from biodance.report.figures.style import figure, look

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LIGHT = 5.0
"""kg: segments below are drawn in an axes of their own, or their intervals could not be seen beside the trunk's."""


def forest_figure(found: Identification) -> "Figure":
    """Draw the mass of every segment: table (square) and identified (circle: filled = known, pale = partly known,
    open = not known).
    """
    from matplotlib.lines import Line2D

    masses = [known for known in found.known if known.quantity == "mass"]
    groups = [
        group for group in ([k for k in masses if k.table >= LIGHT], [k for k in masses if k.table < LIGHT]) if group
    ]
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


_SHOWN = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion", "trunk_flexion", "shoulder_flexion", "elbow_flexion")
"""Joints drawn, right and left in one axes."""
_COLOURS = {"right": (BLUE, "-"), "left": (RED, "--"), "": (GREY, "-")}
"""Colour and line style of a side: never the colour alone."""


def _curve(axes: "Axes", bands: TorqueBands, joint: int, side: str) -> None:
    colour, style = _COLOURS[side]
    torque, half, table = (
        np.where(bands.use, column[:, joint], np.nan) for column in (bands.torque, bands.half_width, bands.table)
    )
    axes.fill_between(bands.time, torque - half, torque + half, color=colour, alpha=0.25, linewidth=0)
    axes.plot(bands.time, torque, color=colour, linestyle=style)
    axes.plot(bands.time, table, color=colour, linestyle=":", linewidth=0.9)


def drawn_joints(bands: TorqueBands) -> list[tuple[str, list[tuple[int, str]]]]:
    """Return what is drawn: title, and index and side ("right", "left", "") of the joints in one axes."""
    found = []
    for kind in _SHOWN:
        named = [
            (bands.joints.index(name), side)
            for side in _COLOURS
            if (name := f"{side}_{kind}".lstrip("_")) in bands.joints
        ]
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
        lines: list[Line2D | Patch] = [
            Line2D([], [], color=c, linestyle=s, label=side) for side, (c, s) in _COLOURS.items() if side
        ]
        lines += [
            Patch(color=GREY, alpha=0.25, label="95 % interval"),
            Line2D([], [], color=GREY, linestyle=":", label="with the table"),
        ]
        drawn.legend(handles=lines, loc="outside upper center", ncols=4)
    return drawn


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
    limit_channel(axes, channel, shown)


def _differences(axes: "Axes", trial: TrialValidation, channel: int) -> None:
    time, used, largest = trial.measured.time, trial.use, 0.0
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    for wrench, colour, style in ((trial.table, BLUE, TABLE), (trial.identified, RED, "-")):
        difference = np.where(used, trial.measured.value[:, channel] - wrench.value[:, channel], np.nan)
        axes.plot(time, difference, color=colour, linestyle=style, linewidth=0.9)
        largest = max(largest, float(np.nanmax(np.abs(difference))))
    limit_difference(axes, channel, largest)


def validation_figure(trial: TrialValidation) -> "Figure":
    """Draw six channels in two columns (forces left, moments right), each over its differences; grey frames are left
    out.
    """
    from matplotlib.lines import Line2D

    with look():
        lines: list[Artist] = [
            Line2D([], [], color=BLACK, label="measured by the plates"),
            Line2D([], [], color=BLUE, linestyle=TABLE, label="with the table"),
            Line2D([], [], color=RED, linestyle=IDENTIFIED, label="with the identified parameters"),
        ]
        return over_differences(
            6.2,
            trial.measured.time,
            lambda axes, channel: _curves(axes, trial, channel),
            lambda axes, channel: _differences(axes, trial, channel),
            share=1.2,
            lines=lines,
        )
