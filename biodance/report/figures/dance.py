"""Figures of a dance (paper Figs. 3, 5, 6; expected accuracy), and its film from MuJoCo, as .gif or .mp4."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.dance.playback import Rehearsal
from biodance.display import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, RED, SKY, spaced
from biodance.errors import BiodanceError, MissingLibrary
from biodance.lab.plain_text import whole_file
from biodance.motion.kinematics import poses
from biodance.pipeline.still import bone_lines, silhouettes
from biodance.records import Array, side_in_name
from biodance.report.figures.style import FIGURE_WIDTH, SIDE_COLOURS, figure, look
from biodance.report.files import refuse_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL.Image import Image

    from biodance.dance.expectation import Expectation
    from biodance.dance.verify import ZmpPath


_COLUMNS = 10


def postures_figure(body: Body, q: Array, titles: tuple[str, ...]) -> "Figure":
    """Draw postures ``q`` (P, nq) in rows of ten, titled, to one scale; right is blue, left red and dashed."""
    lines, sides = bone_lines(body, poses(body, q))
    # oblique, from the front and right: lab x, y, z to the page's right and up
    flat = lines @ np.array([[0.80, -0.60, 0.0], [0.18, 0.24, 0.95]]).T
    # each posture about its own middle, heights as they are
    flat = flat - np.stack([flat[..., 0].mean(axis=(1, 2)), np.zeros(len(flat))], axis=1)[:, None, None]
    low, high = flat.min(axis=(0, 1, 2)), flat.max(axis=(0, 1, 2))
    rows = -(-len(q) // _COLUMNS)
    with look():
        drawn = figure(rows * FIGURE_WIDTH / _COLUMNS * 1.15 * max(1.0, (high[1] - low[1]) / (high[0] - low[0])))
        panels = drawn.subplots(rows, _COLUMNS, squeeze=False).ravel()
        for panel in panels:
            panel.set_axis_off()
        for panel, posture, title in zip(panels, flat, titles, strict=False):
            for line, side in zip(posture, sides, strict=True):
                colour, style = SIDE_COLOURS[side]
                panel.plot(*line.T, color=colour, linestyle=style, linewidth=1.3, solid_capstyle="round")
            panel.set(xlim=(low[0] - 0.05, high[0] + 0.05), ylim=(low[1] - 0.05, high[1] + 0.05), aspect="equal")
            panel.set_title(title, fontsize=6, pad=1)
    return drawn


def criterion_figure(values: Array, bound: float) -> "Figure":
    """Draw the criterion (K,) after each transition, above the smallest value that it can have."""
    from matplotlib.ticker import MaxNLocator

    with look():
        drawn = figure(2.6)
        axes = drawn.subplots()
        look_of = {"color": BLUE, "marker": "o", "markersize": 3, "label": "after the transition"}
        axes.semilogy(np.arange(1, len(values) + 1), values, **look_of)
        axes.axhline(bound, color=GREEN, linestyle="--", label=f"bound {bound:.3g}")
        axes.set(xlabel="transition", ylabel="sum of M cond(W_bi), kg")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend()
    return drawn


def zmp_figure(paths: "Sequence[ZmpPath]") -> "Figure":
    """Draw the zero-moment point of every move: below on the straight way, above in the dance; a column a stance."""
    names = list(dict.fromkeys(path.stance.name for path in paths))
    with look():
        drawn = figure(4.0)
        panels = drawn.subplots(2, len(names), sharex=True, sharey=True, squeeze=False)
        for column, name in enumerate(names):
            mine = [path for path in paths if path.stance.name == name]
            feet = mine[0].stance
            # the base of support shrunk about its centre
            usable = feet.centre + feet.share * (feet.support - feet.centre)
            for axes, colour, what in zip(panels[:, column], (BLUE, ORANGE), ("designed", "straight"), strict=True):
                _outline(axes, feet.support, BLACK, "-", "base of support")
                _outline(axes, usable, GREY, "--", "part that may be used")
                for k, path in enumerate(mine):
                    label = f"zero-moment point, {what} way" if k == 0 else None
                    axes.plot(*getattr(path, what).T, color=colour, linewidth=0.7, label=label)
                axes.set_aspect("equal")
            panels[0, column].set_title(spaced(name))
            panels[1, column].set_xlabel("lab x, m")
        low, high = (edge(np.concatenate([path.stance.support for path in paths]), axis=0) for edge in (np.min, np.max))
        panels[0, 0].set(xlim=(low[0] - 0.1, high[0] + 0.1), ylim=(low[1] - 0.1, high[1] + 0.1))
        for axes in panels[:, 0]:
            axes.set_ylabel("lab y, m")
        pairs = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in panels[:, 0])
        handles = {label: handle for some in pairs for handle, label in some}
        drawn.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2)
    return drawn


def expectation_figure(expectation: "Expectation") -> "Figure":
    """Draw the expected standard deviations of mass and centre of mass by duration, as shares of the table's."""
    kinds = [name.removeprefix("right_") for name in expectation.segments if not name.startswith("left_")]
    colours = (BLACK, ORANGE, SKY, GREEN, BLUE, RED, PINK, GREY)
    with look():
        drawn = figure(2.9)
        left, right = drawn.subplots(1, 2, sharex=True, sharey=True)
        for axes, values, title in ((left, expectation.mass, "mass"), (right, expectation.com, "centre of mass")):
            for number, kind in enumerate(kinds):  # both sides of a segment in one curve
                bare = [name.removeprefix("right_").removeprefix("left_") for name in expectation.segments]
                mine = [i for i, name in enumerate(bare) if name == kind]
                share = 100 * (values[:, mine] / values[0, mine]).mean(axis=1)
                style, colour = ("-", "--", ":")[number // len(colours) % 3], colours[number % len(colours)]
                axes.plot(expectation.duration, share, style, color=colour, label=spaced(kind))
            axes.set(title=title, xlabel="duration of the dance, s", ylim=(0, 105))
        left.set_ylabel("expected sd, % of the table's")
        drawn.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=min(len(kinds), 4))
    return drawn


def _outline(axes: "Axes", corners: Array, colour: str, style: str, label: str) -> None:
    axes.plot(*np.vstack([corners, corners[:1]]).T, color=colour, linestyle=style, linewidth=0.9, label=label)


_RATE = 25.0  # Pictures per second
_SIZE, _FLOOR = (290, 480), 450  # Of one view, px; row of the floor
_MARGIN = 8.0  # px beside the widest posture
_SCALE = 170.0  # px per metre of a person's height
_VIEWS = (("from the front", (1.0, 0.0)), ("from the right", (0.0, -1.0)))
"""Title and horizontal direction of the eye."""
_FINE = 2  # Times as fine a picture is drawn before it is made smaller, so that edges are smooth
_INK = {"right": (0, 114, 178), "left": (213, 94, 0), "middle": (110, 120, 130)}
_FORMATS = (".gif", ".mp4")


def film_path(out: Path, *, force: bool = False) -> Path:
    """Return the path of a film that can be written.

    Raises
    ------
    BiodanceError
        The name ends otherwise than .gif or .mp4, or the file exists and ``force`` was not given.
    MissingLibrary
        An .mp4 is asked for and ffmpeg is not installed.
    """
    if out.suffix.lower() not in _FORMATS:
        raise BiodanceError(f"{out}: a film ends in {' or '.join(_FORMATS)}. Choose another --out.")
    if out.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise MissingLibrary(f"{out}: an .mp4 needs the program ffmpeg, which is not installed. Choose a .gif.")
    refuse_file(out, force=force)
    return out


def write_film(found: Rehearsal, out: Path) -> Path:
    """Write the film of a rehearsal and return its path (see `film_path`)."""
    played, body = found.playback, found.dance.body
    rows = np.arange(0, len(played.q), max(1, round(played.wrench.rate / _RATE)))
    plan = found.dance.motion(played.wrench.rate).q[rows]
    seen = [silhouettes(body, q, eye) for q in (plan, played.q[rows]) for _, eye in _VIEWS]
    # the tallest posture fits into the picture, and the widest: arms overhead, a leg lifted to the side
    planned = [outline for parts in seen[: len(_VIEWS)] for _, outline, _ in parts]
    wide, tall = np.max([np.abs(outline).max(axis=(0, 1)) for outline in planned], axis=0)
    scale = min(_SCALE * 1.75 / max(tall, 0.2), (_SIZE[0] / 2 - _MARGIN) / wide)
    pictures = _pictures(seen, played.wrench.cop()[rows], played.time[rows], scale)
    with whole_file(out, over=True) as part:
        _write(pictures, part, out)
    return out


def _write(pictures: "Iterator[Image]", part: Path, out: Path) -> None:
    """Write pictures, as they come, as the film ``out`` under the name ``part``."""
    from PIL import Image

    first = next(pictures)
    if out.suffix.lower() == ".gif":
        colours = first.quantize(48)
        small = (frame.quantize(palette=colours, dither=Image.Dither.NONE) for frame in pictures)
        colours.save(part, save_all=True, append_images=small, duration=round(1000 / _RATE), loop=0)
        return
    size, form = f"{first.width}x{first.height}", "-y -loglevel error -f rawvideo -pix_fmt rgb24"
    words = ["ffmpeg", *f"{form} -s {size} -r {_RATE} -i - -pix_fmt yuv420p".split(), str(part)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        with suppress(BrokenPipeError):  # it ended before the last picture, and says why
            for picture in chain([first], pictures):
                encoder.stdin.write(picture.tobytes())
        said = encoder.communicate()[1]
    if encoder.returncode:
        raise BiodanceError(f"{out}: ffmpeg could not write it ({said.decode(errors='replace').strip()[:200]}).")


def _pictures(seen: list[list[tuple[str, Array, Array]]], cop: Array, time: Array, scale: float) -> "Iterator[Image]":
    """Yield each instant: what is ``seen`` of the plan, pale, then as played; ``scale`` px per m."""
    from PIL import Image, ImageDraw

    width, height, floor = _SIZE[0] * _FINE, _SIZE[1] * _FINE, _FINE * _FLOOR
    titles = [(title, *view) for title in ("planned", "played") for view in _VIEWS]
    middles = width * (np.arange(len(titles)) + 0.5)
    empty = Image.new("RGB", (width * len(titles), height), "white")
    draw = ImageDraw.Draw(empty)
    for (title, view, _), middle in zip(titles, middles, strict=True):
        draw.line([(middle - width / 2 + 16, floor), (middle + width / 2 - 16, floor)], fill=(120, 120, 120), width=4)
        draw.text((middle - width / 2 + 16, 16), f"{title}, {view}", fill="black", font_size=26)
    placed = [
        [
            (segment, np.array([middle, floor]) + _FINE * scale * outline * [1, -1], near)
            for segment, outline, near in parts
        ]
        for parts, middle in zip(seen, middles, strict=True)
    ]
    for t, instant in enumerate(time):
        image = empty.copy()
        draw = ImageDraw.Draw(image)
        for (title, _, eye), middle, parts in zip(titles, middles, placed, strict=True):
            pale = 0.55 if title == "planned" else 0.0  # share of white
            for segment, outline, _ in sorted(parts, key=lambda one: float(one[2][t])):
                red, green, blue = (round(one + pale * (255 - one)) for one in _INK[side_in_name(segment)])
                draw.polygon(outline[t].ravel().tolist(), fill=(red, green, blue), outline="white")
            if not pale and np.isfinite(cop[t]).all():
                x = middle + _FINE * scale * float(cop[t, :2] @ [-eye[1], eye[0]])
                draw.ellipse([x - 8, floor - 8, x + 8, floor + 8], fill=(204, 0, 0))
        draw.text((16, 50), f"{instant:5.1f} s", fill="black", font_size=26)
        yield image.reduce(_FINE)
