"""Figures of a body: masses, centres and inertias of its segments, table beside identified (paper Fig. 8)."""

from collections.abc import Sequence

import numpy as np

from biodance.display import BLACK, BLUE, GREEN, GREY, PINK, Interval, spaced
from biodance.identification.identification import Identification
from biodance.identification.knowledge import known_interval
from biodance.report.figures import vector as svg

ROW = 19.0
"""px of a segment's row."""
_LIGHT = 5.0
"""kg: segments below are drawn in a panel of their own, or their intervals could not be seen beside the trunk's."""
_INSIDE = {"known": "", "partly known": "#8fd1b9", "cannot be known": "#fff"}
_WORDS = ("grey ring: table", "green point: identified, known", "pale: partly known", "black ring: cannot be known")
_SHAPE = (
    *((f"com {axis}", 1000.0, f"centre of mass, {axis} (mm)") for axis in "xyz"),
    *((f"I{axis}{axis}", 1.0, f"inertia I{axis}{axis} (kg·m²)") for axis in "xyz"),
)
"""Quantity, factor and title of each panel."""
_Load = tuple[str, float] | None


def mass_figure(found: Identification, paper: Identification | None = None, load: _Load = None) -> str:
    """Return the mass of every segment: table (grey) and identified (filled = known, pale = partly known, open = not
    known), with 95 % intervals; beside them (blue) that of the ``paper``'s programme, which has none, and the part of
    it (green) that is a ``load`` (segment, kg).
    """
    masses = _quantity(found, "mass")
    groups = ([k for k in masses if k.before[0] >= _LIGHT], [k for k in masses if k.before[0] < _LIGHT])
    drawn = [_forest(rows, _beside(paper, "mass"), "mass (kg), 95 % intervals", load) for rows in groups if rows]
    return _with_legend(drawn, paper, load)


def shape_figure(found: Identification, paper: Identification | None = None) -> str:
    """Return centre of mass (segment axes, from the proximal joint) and inertia about it, drawn as by `mass_figure`."""
    drawn = [
        _forest(_quantity(found, name, times), _beside(paper, name, times), title) for name, times, title in _SHAPE
    ]
    return _with_legend(drawn, paper, None)


def _quantity(found: Identification, name: str, times: float = 1.0) -> list[Interval]:
    return [known_interval(known, times) for known in found.known if known.quantity == name]


def _beside(paper: Identification | None, name: str, times: float = 1.0) -> dict[str, float]:
    return {one.segment: times * one.value for one in paper.known if one.quantity == name} if paper else {}


def _forest(rows: Sequence[Interval], beside: dict[str, float], label: str, load: _Load = None) -> str:
    """Return one panel: a row for each segment."""
    ends = np.array([v for row in rows for v in (*row.before, *row.after, beside.get(row.name, row.after[0]))])
    room, least = 0.04 * float(np.ptp(ends)), -np.inf if ends.min() < 0 else 0.0
    x = svg.Axis(max(least, float(ends.min()) - room), float(ends.max()) + room, label)
    ticks = tuple((len(rows) - 1.0 - i, spaced(row.name)) for i, row in enumerate(rows))
    y = svg.Axis(-0.6, len(rows) - 0.4, "", ticks)
    marks = []
    for (at, _), row in zip(ticks, rows, strict=True):
        edge = BLACK if row.known == "cannot be known" else GREEN
        for up, (value, low, high), colour, inside, wide in (
            (at + 0.17, row.before, GREY, "#fff", 1.0),
            (at - 0.17, row.after, edge, _INSIDE[row.known], 1.8),
        ):
            marks.append(svg.segments(x, y, np.array([[low, up], [high, up]]), svg.Stroke(colour, "", wide)))
            marks.append(svg.points(x, y, value, up, svg.Stroke(colour), inside=inside, size=6.5))
        if load is not None and row.name == load[0]:
            ends = np.array([[row.after[0] - load[1], at - 0.4], [row.after[0], at - 0.4]])
            marks.append(svg.segments(x, y, ends, svg.Stroke(PINK, "", 2.4)))
        if row.name in beside:
            marks.append(svg.points(x, y, beside[row.name], at, svg.Stroke(BLUE)))
    frame = svg.Frame(height=ROW * len(rows), left=112.0, above=4.0)
    return svg.panel(x, y, marks, f"{label.partition(',')[0]} of every segment, table and identified", frame=frame)


def _with_legend(drawn: Sequence[str], paper: Identification | None, load: _Load) -> str:
    more = {"blue point: the paper's programme": paper is not None, "pink: load": load is not None}
    return svg.with_legend((*_WORDS, *(word for word, there in more.items() if there)), drawn)
