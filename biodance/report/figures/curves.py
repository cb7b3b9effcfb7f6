"""Curves over time as light figures that zoom, are read, and whose curves are switched on and off (``curves.js``)."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from biodance.records import Array, runs
from biodance.report.figures.vector import STEPS, Axis, Frame, Stroke, around, band, curve_line, panel, rule, shade

_MUCH = 0.7
"""Share of used frames below which a figure begins with these."""
_NARROW, _TALL = 46.0, 110.0
"""px of the height of a difference and of a curve."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve: ``name`` as in the legend, ``values`` (T,), NaN where it is broken; ``half_width`` (T,) of the band
    about it, or None; ``kind`` "line" is read at the cursor, "each" is one repetition of the curve of the same name.
    """

    name: str
    values: Array
    look: Stroke
    half_width: Array | None = None
    kind: str = "line"


@dataclass(frozen=True, eq=False)
class Strip:
    """Curves that share one y axis: ``title`` says what it is, with its unit; ``least`` what the axis spans at least;
    ``even`` puts zero in the middle (a difference); ``shown`` (T,) True where values decide what the axis spans.
    """

    title: str
    curves: Sequence[Curve]
    least: float = 0.0
    even: bool = False
    shown: NDArray[np.bool_] | None = None

    @property
    def axis(self) -> Axis:
        """The y axis that holds all its curves and bands."""
        held = [
            one.values + sign * (0.0 if one.half_width is None else one.half_width)
            for one in self.curves
            for sign in (-1.0, 1.0)
        ]
        values = np.concatenate([v if self.shown is None else v[self.shown] for v in held] or [np.empty(0)])
        if self.even:
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            half = max(1.15 * largest, self.least / 2) or 1.0
            return Axis(-half, half, self.title)
        return around(values, least=self.least, label=self.title)


@dataclass(frozen=True, eq=False)
class CurveFigure:
    """Panels over one time axis: ``cells`` of strips that stand over each other, the cells in columns.

    ``time`` (T,); ``about`` what it shows, one sentence; ``used`` (T,) False where frames are left out (grey);
    ``trial`` makes the cursor go with the replay of that trial; ``label`` of the time axis; ``band`` what bands mean;
    ``filled`` (T,) True where angles rest on markers that were put into a gap (yellow).
    """

    time: Array
    cells: Sequence[Sequence[Strip]]
    about: str
    used: NDArray[np.bool_] | None = None
    trial: str = ""
    label: str = "time (s)"
    band: str = "95 % interval"
    filled: NDArray[np.bool_] | None = None

    def html(self) -> str:
        """Return the figure as HTML: legend of switches, panels, and a line that tells the values at the cursor."""
        x = Axis(float(self.time[0]), float(self.time[-1]), self.label)
        left_out = [] if self.used is None else runs(np.logical_not(self.used))
        filled = [] if self.filled is None else runs(self.filled)
        shades = [shade(x, float(self.time[a]), float(self.time[b - 1])) for a, b in left_out]
        shades += [shade(x, float(self.time[a]), float(self.time[b - 1]), kind="filled") for a, b in filled]
        cells = "".join(f'<div class="cell">{self._cell(x, strips, shades)}</div>' for strips in self.cells)
        trial = f' data-trial="{escape(self.trial)}"' if self.trial else ""
        trial += self._first_view(x)
        return (
            f'<div class="curves" role="group" aria-label="{escape(self.about)}"{trial}>'
            f'<div class="legend">{self._legend(bool(left_out), bool(filled))}</div><p class="reading"></p>'
            f'<div class="cells">{cells}</div></div>'
        )

    def _first_view(self, x: Axis) -> str:
        """Return the steps that are seen first, as an attribute: where much is left out, the rest with its
        surroundings; "" for all.
        """
        if self.used is None or not 0 < self.used.mean() < _MUCH:
            return ""
        first, last = x.steps(self.time[np.flatnonzero(self.used)[[0, -1]]]).tolist()
        room = max((last - first) // 4, STEPS // 100)
        return f' data-view="{max(0, first - room)} {min(STEPS, last + room)}"'

    def _cell(self, x: Axis, strips: Sequence[Strip], shades: list[str]) -> str:
        out = []
        for i, strip in enumerate(strips):
            y = strip.axis
            marks = list(shades) + ([rule(y, 0.0, upright=False)] if y.low < 0 < y.high else [])
            for one in strip.curves:
                if one.half_width is not None:
                    low, high = one.values - one.half_width, one.values + one.half_width
                    marks.append(band(x, y, self.time, low, high, one.look.colour, name=one.name))
                marks.append(curve_line(x, y, self.time, one.values, one.look, name=one.name, kind=one.kind))
            height, last = _NARROW if strip.even else _TALL, i == len(strips) - 1
            about = f"{strip.title}: {', '.join(dict.fromkeys(one.name for one in strip.curves))}"
            out.append(panel(x, y, marks, about, frame=Frame(height=height), numbers=last))
        return "".join(out)

    def _legend(self, left_out: bool, filled: bool) -> str:
        looks = {one.name: one for cell in self.cells for strip in cell for one in strip.curves}
        buttons = "".join(
            f'<button type="button" aria-pressed="true" data-name="{escape(name)}">{swatch(one.look)}'
            f"{escape(name)}</button>"
            for name, one in looks.items()
        )
        banded = any(one.half_width is not None for one in looks.values())
        grey = '<span><i class="swatch out"></i>left out: not fully measured</span>' if left_out else ""
        grey += '<span><i class="swatch filled"></i>filled: markers put into a gap</span>' if filled else ""
        return buttons + (f'<span><i class="swatch in"></i>{escape(self.band)}</span>' if banded else "") + grey


def swatch(look: Stroke) -> str:
    """Return a short piece of a line, for a legend."""
    return f'<svg class="swatch" viewBox="0 0 26 8" aria-hidden="true"><path {look.attributes} d="M0 4h26"/></svg>'
