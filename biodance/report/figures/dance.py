"""Figures of a dance: postures as stick figures (paper Fig. 3), criterion by transition (Fig. 5), ZMP (Fig. 6),
expected accuracy; and the film of one that is played in MuJoCo, as .gif, or as .mp4 where ffmpeg is installed.
"""

from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.display import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, RED, SKY, spaced
from biodance.motion.kinematics import poses
from biodance.pipeline.still import bone_lines
from biodance.records import Array
from biodance.report.figures.style import FIGURE_WIDTH, SIDE_COLOURS, figure, look

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from biodance.dance.expectation import Expectation
    from biodance.dance.verify import ZmpPath
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from biodance.dance.playback import Rehearsal
from biodance.errors import BiodanceError, MissingLibrary

if TYPE_CHECKING:
    from PIL.Image import Image


_COLUMNS = 10
VIEW = np.array([[0.80, -0.60, 0.0], [0.18, 0.24, 0.95]])
"""(2, 3) oblique view from the front, right: lab x, y, z to the page's right and up."""


def postures_figure(body: Body, q: Array, titles: tuple[str, ...]) -> "Figure":
    """Draw the postures ``q`` (P, nq) in rows of ten, each with its title, all to one scale; right is blue, left red
    and dashed.
    """
    lines, sides = bone_lines(body, poses(body, q))
    flat = lines @ VIEW.T
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
        axes.semilogy(
            np.arange(1, len(values) + 1), values, color=BLUE, marker="o", markersize=3, label="after the transition"
        )
        axes.axhline(bound, color=GREEN, linestyle="--", label=f"bound {bound:.3g}")
        axes.set(xlabel="transition", ylabel="sum of M cond(W_bi), kg")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend()
    return drawn


def zmp_figure(paths: "Sequence[ZmpPath]") -> "Figure":
    """Draw the zero-moment point of every move, below on the straight way between the postures, above in the dance;
    a column a stance.
    """
    names = list(dict.fromkeys(path.stance.name for path in paths))
    with look():
        drawn = figure(4.0)
        panels = drawn.subplots(2, len(names), sharex=True, sharey=True, squeeze=False)
        for column, name in enumerate(names):
            mine = [path for path in paths if path.stance.name == name]
            feet = mine[0].stance
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
        handles = {
            label: handle
            for axes in panels[:, 0]
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        drawn.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2)
    return drawn


def expectation_figure(expectation: "Expectation") -> "Figure":
    """Draw the standard deviations of mass and centre of mass that are expected after each duration, as shares of
    the table's.
    """
    kinds = [name.removeprefix("right_") for name in expectation.segments if not name.startswith("left_")]
    colours = (BLACK, ORANGE, SKY, GREEN, BLUE, RED, PINK, GREY)
    with look():
        drawn = figure(2.9)
        left, right = drawn.subplots(1, 2, sharex=True, sharey=True)
        for axes, values, title in ((left, expectation.mass, "mass"), (right, expectation.com, "centre of mass")):
            for number, kind in enumerate(kinds):
                mine = [
                    i
                    for i, name in enumerate(expectation.segments)
                    if name.removeprefix("right_").removeprefix("left_") == kind
                ]
                share = 100 * (values[:, mine] / values[0, mine]).mean(axis=1)
                style = ("-", "--", ":")[number // len(colours) % 3]
                axes.plot(
                    expectation.duration,
                    share,
                    style,
                    color=colours[number % len(colours)],
                    label=spaced(kind),
                )
            axes.set(title=title, xlabel="duration of the dance, s", ylim=(0, 105))
        left.set_ylabel("expected sd, % of the table's")
        drawn.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=min(len(kinds), 4))
    return drawn


def _outline(axes: "Axes", corners: Array, colour: str, style: str, label: str) -> None:
    axes.plot(*np.vstack([corners, corners[:1]]).T, color=colour, linestyle=style, linewidth=0.9, label=label)


_RATE = 12.5
"""Pictures per second."""
_SIZE, _FLOOR = (420, 480), 440
"""Of one view, px; row of the floor."""
_SCALE = 190.0
"""px per metre."""
_VIEWS = ((0, 1.0, "from the right"), (1, 1.0, "from the front"))
"""Lab axis to the right of the picture, its sign, and the title of each view."""
_INK = {"planned": (190, 190, 190), "right": (0, 114, 178), "left": (213, 94, 0), "middle": (60, 60, 60)}
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
    if out.exists() and not force:
        raise BiodanceError(f"{out}: exists already and is not overwritten. Choose another --out, or --force.")
    return out


def write_film(found: Rehearsal, out: Path) -> Path:
    """Write the film of a rehearsal and return its path (see `film_path`)."""
    played, body = found.playback, found.dance.body
    rows = np.arange(0, len(played.q), max(1, round(played.wrench.rate / _RATE)))
    plan = found.dance.motion(played.wrench.rate).q[rows]
    cop = played.wrench.cop()[rows]
    frames = [
        _picture(body, planned, real, point, float(t))
        for planned, real, point, t in zip(plan, played.q[rows], cop, played.time[rows], strict=True)
    ]
    if out.suffix.lower() == ".gif":
        small = [frame.quantize(16) for frame in frames]
        small[0].save(out, save_all=True, append_images=small[1:], duration=round(1000 / _RATE), loop=0)
        return out
    words = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    words += ["-s", f"{2 * _SIZE[0]}x{_SIZE[1]}", "-r", str(_RATE), "-i", "-", "-pix_fmt", "yuv420p", str(out)]
    done = subprocess.run(words, input=b"".join(frame.tobytes() for frame in frames), capture_output=True, check=False)
    if done.returncode:
        raise BiodanceError(f"{out}: ffmpeg could not write it ({done.stderr.decode(errors='replace').strip()[:200]}).")
    return out


def _picture(body: Body, planned: Array, played: Array, cop: Array, time: float) -> "Image":
    """Return both views of one instant: the plan in grey, the played body in colour, the centre of pressure in red."""
    from PIL import Image, ImageDraw

    image = Image.new("RGB", (2 * _SIZE[0], _SIZE[1]), "white")
    draw = ImageDraw.Draw(image)
    draw.text((10, 8), f"{time:5.1f} s", fill="black")
    for number, (axis, sign, title) in enumerate(_VIEWS):
        left = number * _SIZE[0]
        draw.text((left + 10, 24), title, fill="black")
        draw.line([(left + 10, _FLOOR), (left + _SIZE[0] - 10, _FLOOR)], fill=(120, 120, 120), width=2)

        def at(point: Array, *, left: int = left, axis: int = axis, sign: float = sign) -> tuple[float, float]:
            return left + _SIZE[0] / 2 + sign * _SCALE * float(point[axis]), _FLOOR - _SCALE * float(point[2])

        for q, real in ((planned, False), (played, True)):
            lines, sides = bone_lines(body, poses(body, q))
            for (a, b), side in zip(lines[0], sides, strict=True):
                draw.line([at(a), at(b)], fill=_INK[side if real else "planned"], width=4 if real else 7)
        if np.isfinite(cop).all():
            x, y = at(cop)
            draw.ellipse([x - 5, y - 5, x + 5, y + 5], fill=(204, 0, 0))
    return image
