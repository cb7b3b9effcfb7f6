"""How a record shows itself in a notebook: a small table as HTML, and curves on matplotlib axes. Draws what it is
given, computes nothing.

Records are the lowest floor and may not ask the report to draw them, so what both draw lives below both.
"""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PINK = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
"""The eight colours of Okabe & Ito (2008), told apart with every common colour vision."""
GREY = "#767676"
STYLES: tuple[tuple[str, Any], ...] = (
    (BLUE, "-"),
    (RED, (0, (4, 2))),
    (GREEN, (0, (1, 1))),
    (BLACK, "-."),
    (ORANGE, "-"),
    (PINK, "--"),
)
"""Colour and line style of curve after curve: never the colour alone."""
ROWS = 12
"""Rows of a table that a notebook shows; the others are counted."""


class Interval(NamedTuple):
    """One row of `intervals`: ``before`` and ``after`` are (value, low, high); ``known`` says how much the data
    tell.
    """

    name: str
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    known: Literal["known", "partly known", "cannot be known"]


def card(title: str, table: "pd.DataFrame | None" = None, notes: Iterable[str] = ()) -> str:
    """Return HTML with a title, the first `ROWS` rows of a table, and sentences below it."""
    parts = [f"<p><b>{escape(title)}</b></p>"]
    if table is not None and len(table):
        parts.append(table.head(ROWS).to_html(float_format=lambda number: f"{number:.4g}", na_rep="-"))
        parts += [f"<p>... {len(table) - ROWS} more rows</p>"] if len(table) > ROWS else []
    return "".join([*parts, *(f"<p>{escape(note)}</p>" for note in notes)])


SHOWN_UNITS = {"m": (1000.0, "mm", 0), "rad": (57.29578, "°", 1), "s": (1000.0, "ms", 1), "1": (100.0, "%", 1)}
"""Unit of a parameter: factor, unit and digits that are shown."""


def shown_unit(unit: str) -> tuple[float, str]:
    """Return by what a number in ``unit`` is multiplied to be shown, and the unit that people say it in: mm for m."""
    return SHOWN_UNITS.get(unit, (1.0, unit, 2))[:2]


def digits(value: float, count: int) -> str:
    """Return a number with so many digits that say something, without an exponent where people write none: ``20`` for
    2e+01.
    """
    return f"{float(f'{value:.{count}g}'):g}"


def spaced(name: str) -> str:
    """Return a name as words: ``left forearm with hand``."""
    for joined, said in {"trunk_head": "trunk with head", "forearm_hand": "forearm with hand"}.items():
        name = name.replace(joined, said)
    return name.replace("_", " ")


def cause_in_words(effect: str, target: str = "") -> str:
    """Return a cause with its place: ``plate crosstalk Fz into My``."""
    return spaced(f"{effect} {target}").replace("->", " into ").strip()


def listed(names: Sequence[str]) -> str:
    """Return names as a list in words, the fourth and later ones counted only."""
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def axes_or_new(axes: "Axes | None") -> "Axes":
    """Return ``axes``, or those of a new figure."""
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


def curves(
    time: NDArray[Any], values: NDArray[Any], labels: Sequence[str], unit: str, *, axes: "Axes | None" = None
) -> "Axes":
    """Draw the columns of ``values`` (T, n) over ``time`` (T,) s, each with its label, and return the axes."""
    drawn = axes_or_new(axes)
    for k, label in enumerate(labels):
        colour, style = STYLES[k % len(STYLES)]
        drawn.plot(time, values[:, k], color=colour, linestyle=style, label=label)
    drawn.set_xlabel("time (s)")
    drawn.set_ylabel(unit)
    drawn.legend()
    return drawn


def side_by_side(
    time: NDArray[Any], measured: NDArray[Any], simulated: NDArray[Any], used: NDArray[np.bool_], titles: Sequence[str]
) -> "NDArray[Any]":
    """Draw ``measured`` and ``simulated`` (T, 6), grey where frames are not ``used`` (T,), and return the six axes."""
    import matplotlib.pyplot as plt

    _, grid = plt.subplots(3, 2, sharex=True, layout="constrained", figsize=(7.1, 5.7))
    for channel, title in enumerate(titles):
        axes = grid[channel % 3, channel // 3]
        axes.plot(time, measured[:, channel], color=BLACK, label="measured")
        axes.plot(time, simulated[:, channel], color=GREEN, linestyle=(0, (4, 2)), label="simulated")
        axes.fill_between(time, 0, 1, where=~used, transform=axes.get_xaxis_transform(), color="#EDEDED")
        axes.set_ylabel(title)
    grid[0, 0].legend()
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
    return np.concatenate([grid[:, 0], grid[:, 1]])


def intervals(rows: Sequence[Interval], *, axes: "Axes | None") -> "Axes":
    """Draw value and interval of every row, before (square) and after (circle: filled = known, pale = partly, open =
    not known).
    """
    drawn = axes_or_new(axes)
    place = np.arange(len(rows))[::-1]
    for y, row in zip(place, rows, strict=True):
        drawn.plot(row.before[1:], [y + 0.17] * 2, color=GREY, linewidth=1.0)
        drawn.plot(row.before[0], y + 0.17, marker="s", color=GREY, markersize=4, markerfacecolor="white")
        drawn.plot(
            row.after[1:], [y - 0.17] * 2, color=GREEN if row.known != "cannot be known" else BLACK, linewidth=1.8
        )
        inside = {"known": GREEN, "partly known": "#8FD1B9", "cannot be known": "white"}[row.known]
        edge = BLACK if row.known == "cannot be known" else GREEN
        drawn.plot(row.after[0], y - 0.17, marker="o", color=edge, markersize=5.5, markerfacecolor=inside)
    drawn.set_yticks(place, [spaced(row.name) for row in rows])
    drawn.set_ylim(-0.7, len(rows) - 0.3)
    drawn.grid(axis="y", visible=False)
    return drawn
