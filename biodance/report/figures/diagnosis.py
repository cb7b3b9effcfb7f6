"""Figures of a diagnosis: what is left before and after, where it is left, and what the session could have seen."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.diagnosis.accept import Residuals
from biodance.diagnosis.adequacy import LIMIT
from biodance.diagnosis.diagnosis import Adequacy, Unobservable
from biodance.display import BLACK, BLUE, GREY, RED
from biodance.records import CHANNELS
from biodance.report.figures.style import figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 6.0
"""s of a kept trial that are drawn."""


def left_figure(left: tuple[Residuals, Residuals]) -> "Figure":
    """Draw measured minus simulated wrench of the first kept trial in six channels: with the body in use, and with
    the findings.
    """
    before, after = (one.left[0] for one in left)
    rate, use = left[0].rate[0], left[0].use[0]
    start = int(np.argmax(use))
    cut = slice(start, start + int(_SHOWN * rate))
    time = np.arange(len(before))[cut] / rate
    with look():
        drawn = figure(3.6)
        grid = drawn.subplots(2, 3, sharex=True)
        for k, axes in enumerate(grid.ravel()):
            for value, color, style, label in (
                (before, RED, "--", "as it is"),
                (after, BLUE, "-", "findings accepted"),
            ):
                axes.plot(time, np.where(use[cut], value[cut, k], np.nan), color=color, linestyle=style, label=label)
            axes.axhline(0, color=BLACK, linewidth=0.6)
            axes.set_title(f"{CHANNELS[k]} ({'N' if k < 3 else 'N·m'})")
        for axes in grid[1]:
            axes.set_xlabel("time (s)")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside upper center", ncols=2)
    return drawn


def adequacy_figure(rows: tuple[Adequacy, ...]) -> "Figure":
    """Draw what is left per channel and speed of movement, in standard deviations of sessions without fault."""
    bands = sorted({row.band_hz for row in rows})
    table = np.zeros((6, len(bands)))
    for row in rows:
        table[CHANNELS.index(row.channel), bands.index(row.band_hz)] = row.z
    with look():
        drawn = figure(2.5, width=5.2)
        axes = drawn.subplots()
        axes.imshow(np.clip(table, 0, 2 * LIMIT), cmap="Greys", vmin=0, vmax=2 * LIMIT, aspect="auto")
        for (i, j), value in np.ndenumerate(table):
            outside = value > LIMIT
            color, weight = ("white", "bold") if outside else (BLACK, "normal")
            axes.text(j, i, f"{value:.0f}", ha="center", va="center", color=color, weight=weight)
        axes.set_yticks(range(6), CHANNELS)
        axes.set_xticks(range(len(bands)), ["rest" if low == 0 else f"{low:g}-{high:g} Hz" for low, high in bands])
        axes.grid(visible=False)
    return drawn


def limits_figure(rows: tuple[Unobservable, ...]) -> "Figure":
    """Draw per kind of cause from which size on this session sees it, in typical sizes: the best and the worst of
    its places.
    """
    kinds: dict[str, list[float]] = {}
    for row in rows:
        kinds.setdefault(row.effect, []).append(row.limit / row.typical)
    order = sorted(kinds, key=lambda name: np.median(kinds[name]))
    with look():
        drawn = figure(0.7 + 0.22 * len(order), width=6.4)
        axes = drawn.subplots()
        for y, name in enumerate(reversed(order)):
            value = np.clip(np.array(kinds[name]), 0.01, 30.0)
            axes.plot([value.min(), value.max()], [y, y], color=GREY, linewidth=2.5, solid_capstyle="round")
            axes.plot(np.median(value), y, "o", color=BLUE, markersize=5)
        axes.axvline(1.0, color=BLACK, linewidth=0.8)
        axes.set_xscale("log")
        axes.set_xlim(0.01, 30)
        axes.set_xticks([0.01, 0.1, 1, 10], ["1 %", "a tenth", "typical size", "ten times"])
        axes.set_yticks(range(len(order)), [name.replace("_", " ") for name in reversed(order)])
        axes.set_xlabel(
            "smallest size that this session would have seen (line: easiest to hardest place, point: middle)"
        )
        axes.grid(axis="y", visible=False)
    return drawn
