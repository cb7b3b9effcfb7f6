"""Light figures as SVG text, without a figure library: axes, marks in whole steps of them, panels, and curves over time
that zoom, are read, and are switched on and off.

A panel is an SVG of its own with a plot of `STEPS` x `STEPS` steps that stretches to the panel's width; line widths
and points keep their size. ``curves.js`` zooms by looking at a part of the steps, and reads values from the paths.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.display import BLACK, BLUE, GREEN, GREY, RED
from biodance.records import Array, runs
from biodance.report.wording import format_number

STEPS = 4000
"""Steps along each axis of a plot: a value is read to 1/4000 of what the axis spans."""
_PLACES = 360
"""Places along a curve that are told apart: of longer ones each place shows the lowest and the highest value."""
_FAR = 8 * STEPS  # Steps beyond which a value outside the axes is cut


@dataclass(frozen=True)
class Stroke:
    """How a curve or a point looks: colour, dashes ("" = full line) and width in px. Never the colour alone."""

    colour: str = BLACK
    dash: str = ""
    width: float = 1.3

    @property
    def attributes(self) -> str:
        """As attributes of an SVG path."""
        dash = f' stroke-dasharray="{self.dash}"' if self.dash else ""
        return f'stroke="{self.colour}" stroke-width="{self.width:g}"{dash}'


MEASURED, TABLE, IDENTIFIED = Stroke(BLACK), Stroke(GREY, "6 3"), Stroke(GREEN, "2 2", 1.6)
EXTENDED = Stroke(GREEN)
"""No side of the body: blue is right, red left alone."""
LEFT_SIDE, RIGHT_SIDE, MIDDLE_SIDE = Stroke(RED, "5 3"), Stroke(BLUE), Stroke(GREY)
SIDE_STROKES = {"right": RIGHT_SIDE, "left": LEFT_SIDE, "middle": MIDDLE_SIDE}


@dataclass(frozen=True)
class Axis:
    """From ``low`` to ``high``; ``label`` says what, with its unit; ``ticks`` (value, text) where they are not numbers;
    ``log`` for a logarithmic one.
    """

    low: float
    high: float
    label: str = ""
    ticks: tuple[tuple[float, str], ...] | None = None
    log: bool = False

    def steps(self, values: "NDArray[Any] | Sequence[float] | float") -> NDArray[np.int64]:
        """Return where ``values`` (finite) lie, in whole steps from ``low``."""
        given = np.asarray(values, dtype=float)
        low, high = (np.log10([self.low, self.high])) if self.log else (self.low, self.high)
        share = ((np.log10(given) if self.log else given) - low) / ((high - low) or 1.0)
        return np.rint(np.clip(STEPS * share, -_FAR, _FAR + STEPS)).astype(np.int64)

    def marked(self, count: int) -> list[tuple[int, str]]:
        """Return step and text of its ticks: those given, else about ``count`` round numbers."""
        ticks = round_ticks(self.low, self.high, count) if self.ticks is None else self.ticks
        places = self.steps([value for value, _ in ticks]).tolist()
        return [(place, text) for place, (_, text) in zip(places, ticks, strict=True)]


def around(values: NDArray[Any], *, least: float = 0.0, label: str = "") -> Axis:
    """Return an axis about all finite ``values``, no shorter than ``least``; 0 to 1 where there is none."""
    seen = values[np.isfinite(values)]
    low, high = (float(seen.min()), float(seen.max())) if seen.size else (0.0, 1.0)
    # half of what it spans, and 6 % of it as room at both ends
    half = max(0.56 * (high - low), least / 2) or 0.5
    return Axis((low + high) / 2 - half, (low + high) / 2 + half, label)


def round_ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Return about ``count`` round values from ``low`` to ``high`` with their text: two, for one has no scale."""
    # the smallest of 1, 2, 5, 10 times a power of ten that makes at most ``count`` steps
    rough = (high - low) / max(count, 1)
    ten = 10.0 ** np.floor(np.log10(rough))
    coarse = (10, 5, 2, 1, 0.5, 0.2, 0.1)
    start = next(i for i in reversed(range(4)) if ten * coarse[i] >= 0.999 * rough)
    # finer while fewer than two ticks lie within
    for step in (ten * k for k in coarse[start:]):
        first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
        if last > first:
            break
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return [(k * step, format_number(k * step, digits)) for k in range(first, last + 1)]


def envelope(values: Array) -> NDArray[np.int64]:
    """Return the indices (n,) that a curve of ``values`` (T,) needs: of a long one each place's lowest and highest."""
    if values.size <= 2 * _PLACES:
        return np.arange(values.size)
    # (places, size) indices; the last one of a shorter place is repeated
    edges = np.linspace(0, values.size, _PLACES + 1).astype(int)
    size = int(np.diff(edges).max())
    index = np.minimum(edges[:-1, None] + np.arange(size), edges[1:, None] - 1)
    held = values[index]
    rows = np.arange(_PLACES)
    lowest = index[rows, np.where(np.isfinite(held), held, np.inf).argmin(axis=1)]
    highest = index[rows, np.where(np.isfinite(held), held, -np.inf).argmax(axis=1)]
    return np.unique(np.concatenate([lowest, highest]))


def path(across: NDArray[np.int64], down: NDArray[np.int64]) -> str:
    """Return one line through points in steps, as an SVG path with steps from point to point."""
    # relative steps are short numbers; a minus sign needs no space before it
    moved = np.stack([np.diff(across), np.diff(down)], axis=1).ravel().tolist()
    start = f"M{across[0]} {down[0]}"
    return f"{start}l{' '.join(map(str, moved))}".replace(" -", "-") if moved else f"{start}h0"


def curve_line(x: Axis, y: Axis, at: Array, values: Array, look: Stroke, *, name: str = "", kind: str = "line") -> str:
    """Return a curve of ``values`` (T,) over ``at`` (T,), broken at NaN; ``name`` of its button, ``kind`` its class."""
    chosen = envelope(values)
    across, held = x.steps(at[chosen]), values[chosen]
    finite = np.isfinite(held)
    down = STEPS - y.steps(np.where(finite, held, 0.0))
    d = "".join(path(across[a:b], down[a:b]) for a, b in runs(finite))
    return f'<path class="{kind}" {_named(name)}{look.attributes} d="{d}"/>' if d else ""


def band(x: Axis, y: Axis, at: Array, low: Array, high: Array, colour: str, *, name: str = "") -> str:
    """Return the area between ``low`` and ``high`` (T,), left out where either is not finite."""
    chosen = np.union1d(envelope(low), envelope(high))
    across, finite = x.steps(at[chosen]), np.isfinite(low[chosen] + high[chosen])
    below, above = (STEPS - y.steps(np.where(finite, v[chosen], 0.0)) for v in (low, high))
    d = "".join(
        # along the upper edge, and back along the lower one
        path(np.concatenate([across[a:b], across[a:b][::-1]]), np.concatenate([above[a:b], below[a:b][::-1]])) + "z"
        for a, b in runs(finite)
        if b - a > 1
    )
    return f'<path class="band" {_named(name)}fill="{colour}" d="{d}"/>' if d else ""


def _named(name: str) -> str:
    return f'data-name="{escape(name)}" ' if name else ""


def shade(x: Axis, first: float, last: float, *, kind: str = "out") -> str:
    """Return a strip over the whole height from ``first`` to ``last`` of the x axis; ``kind`` is its class."""
    a, b = (int(v) for v in x.steps([first, last]))
    return f'<rect class="{kind}" x="{a}" y="0" width="{max(b - a, 1)}" height="{STEPS}"/>'


def rule(axis: Axis, value: float, *, upright: bool, look: Stroke = Stroke(GREY, "", 0.7)) -> str:
    """Return a thin line through the whole plot at ``value``; ``upright`` where the axis is x."""
    at = int(axis.steps(value))
    d = f"M{at} 0v{STEPS}" if upright else f"M0 {STEPS - at}h{STEPS}"
    return f'<path class="rule" {look.attributes} d="{d}"/>'


def points(
    x: Axis, y: Axis, across: Array | float, up: Array | float, look: Stroke, *, size: float = 6.0, inside: str = ""
) -> str:
    """Return round points of ``size`` px at one or (n,) places, filled with ``inside`` ("" = the look's colour)."""
    across, up = np.atleast_1d(across, up)
    finite = np.isfinite(across) & np.isfinite(up)
    if not finite.any():
        return ""
    d = "".join(f"M{a} {STEPS - b}h0" for a, b in zip(x.steps(across[finite]), y.steps(up[finite]), strict=True))
    dots = f'<path class="dot" stroke="{look.colour}" stroke-width="{size:g}" d="{d}"/>'
    return dots + (f'<path class="dot" stroke="{inside}" stroke-width="{size - 2.4:g}" d="{d}"/>' if inside else "")


def segments(x: Axis, y: Axis, way: Array, look: Stroke) -> str:
    """Return a line through the places ``way`` (n, 2), broken where one is not finite."""
    finite = np.asarray(np.isfinite(way).all(axis=1))
    held = np.where(finite[:, None], way, 1.0)
    across, down = x.steps(held[:, 0]), STEPS - y.steps(held[:, 1])
    return f'<path {look.attributes} d="{"".join(path(across[a:b], down[a:b]) for a, b in runs(finite))}"/>'


@dataclass(frozen=True)
class Frame:
    """px of a panel on a wide page: the whole ``width``, the plot's ``height``, and the room for words around it."""

    width: float = 390.0
    height: float = 110.0
    left: float = 44.0
    below: float = 16.0
    above: float = 18.0
    right: float = 8.0


def panel(x: Axis, y: Axis, marks: Iterable[str], about: str, *, frame: Frame = Frame(), numbers: bool = True) -> str:
    """Return one panel as an SVG element: ``marks`` in its plot, the y axis' label above it, the x axis' label below.

    ``about`` is what a person who cannot see it is told; without ``numbers`` the x axis has no text.
    """
    f, wide = frame, frame.width - frame.left - frame.right
    below = f.below + (13.0 if x.label else 0.0) if numbers else 5.0
    up = y.marked(3 if f.height > 60 else 2)
    grid = [f"M{at} 0v{STEPS}" for at, _ in x.marked(6)] + [f"M0 {STEPS - at}h{STEPS}" for at, _ in up]
    words = [
        f'<text x="{f.left - 4:g}" y="{f.above + f.height * (1 - at / STEPS) + 3:.1f}" text-anchor="end">{text}</text>'
        for at, text in ((at, escape(text)) for at, text in up)
    ]
    if y.label:
        words.append(f'<text class="title" x="{2 if y.ticks is None else f.left:g}" y="10">{escape(y.label)}</text>')
    foot = f.above + f.height
    if numbers:
        words += [
            f'<text class="x" x="{f.left + wide * at / STEPS:.1f}" y="{foot + 12:g}" text-anchor="middle">'
            f"{escape(text)}</text>"
            for at, text in x.marked(6)
        ]
    if numbers and x.label:
        middle = f.left + wide / 2
        words.append(f'<text x="{middle:g}" y="{foot + 26:g}" text-anchor="middle">{escape(x.label)}</text>')
    return (
        f'<svg class="panel" role="img" aria-label="{escape(about)}" viewBox="0 0 {f.width:g} {foot + below:g}"'
        f' data-x="{x.low:.9g} {x.high:.9g}" data-y="{y.low:.9g} {y.high:.9g}" data-title="{escape(y.label)}">'
        f'<svg class="plot" x="{f.left:g}" y="{f.above:g}" width="{wide:g}" height="{f.height:g}"'
        f' viewBox="0 0 {STEPS} {STEPS}" preserveAspectRatio="none"><path class="grid" d="{"".join(grid)}"/>'
        f'{"".join(marks)}</svg><g class="words">{"".join(words)}</g></svg>'
    )


_MUCH = 0.7  # Share of used frames below which a figure begins with these
_NARROW, _TALL = 46.0, 110.0  # px of the height of a difference and of a curve


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
    ``even`` puts zero in the middle (a difference); ``shown`` (T,) True where values decide what the axis spans;
    ``rules`` upright lines, each at a place on the x axis.
    """

    title: str
    curves: Sequence[Curve]
    least: float = 0.0
    even: bool = False
    shown: NDArray[np.bool_] | None = None
    rules: Sequence[tuple[float, Stroke]] = ()

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
    ``filled`` (T,) True where angles rest on markers that were put into a gap (yellow); ``width`` px of a panel: of
    narrow ones three stand beside each other.
    """

    time: Array
    cells: Sequence[Sequence[Strip]]
    about: str
    used: NDArray[np.bool_] | None = None
    trial: str = ""
    label: str = "time (s)"
    band: str = "95 % interval"
    filled: NDArray[np.bool_] | None = None
    width: float = 390.0

    def html(self) -> str:
        """Return the figure as HTML: legend of switches, panels, and a line that tells the values at the cursor."""
        x = Axis(float(self.time[0]), float(self.time[-1]), self.label)
        left_out = [] if self.used is None else runs(np.logical_not(self.used))
        filled = [] if self.filled is None else runs(self.filled)
        shades = [shade(x, float(self.time[a]), float(self.time[b - 1])) for a, b in left_out]
        shades += [shade(x, float(self.time[a]), float(self.time[b - 1]), kind="filled") for a, b in filled]
        cells = "".join(f'<div class="cell">{self._cell(x, strips, shades)}</div>' for strips in self.cells)
        trial = f' data-trial="{escape(self.trial)}"' if self.trial else ""
        if self.used is not None and 0 < self.used.mean() < _MUCH:  # where much is left out, the rest is seen first
            first, last = x.steps(self.time[np.flatnonzero(self.used)[[0, -1]]]).tolist()
            room = max((last - first) // 4, STEPS // 100)
            trial += f' data-view="{max(0, first - room)} {min(STEPS, last + room)}"'
        return (
            f'<div class="curves" role="group" aria-label="{escape(self.about)}"{trial}>'
            f'<div class="legend">{self._legend(bool(left_out), bool(filled))}</div><p class="reading"></p>'
            f'<div class="cells{" three" * (self.width < 300.0)}">{cells}</div></div>'  # px
        )

    def _cell(self, x: Axis, strips: Sequence[Strip], shades: list[str]) -> str:
        out = []
        for i, strip in enumerate(strips):
            y = strip.axis
            marks = list(shades) + ([rule(y, 0.0, upright=False)] if y.low < 0 < y.high else [])
            marks += [rule(x, at, upright=True, look=look) for at, look in strip.rules]
            for one in strip.curves:
                if one.half_width is not None:
                    low, high = one.values - one.half_width, one.values + one.half_width
                    marks.append(band(x, y, self.time, low, high, one.look.colour, name=one.name))
                marks.append(curve_line(x, y, self.time, one.values, one.look, name=one.name, kind=one.kind))
            height, last = _NARROW if strip.even else _TALL, i == len(strips) - 1
            about = f"{strip.title}: {', '.join(dict.fromkeys(one.name for one in strip.curves))}"
            out.append(panel(x, y, marks, about, frame=Frame(self.width, height), numbers=last))
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


def with_legend(words: Iterable[str], panels: Iterable[str]) -> str:
    """Return panels beside each other below a legend of ``words``."""
    legend = "".join(f"<span>{word}</span>" for word in words)
    return f'<div class="legend">{legend}</div><div class="cells">{"".join(panels)}</div>'


def swatch(look: Stroke) -> str:
    """Return a short piece of a line, for a legend."""
    return f'<svg class="swatch" viewBox="0 0 26 8" aria-hidden="true"><path {look.attributes} d="M0 4h26"/></svg>'
