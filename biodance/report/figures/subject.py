"""The own body from the front, each part with its mass: a picture that stays readable in grey."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.body.solids import box_solid, shape_parts
from biodance.display import BLACK, BLUE, GREY
from biodance.motion.kinematics import poses
from biodance.records import Array
from biodance.report.figures.style import figure, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SPREAD = {"shoulder_adduction": -0.35, "hip_adduction": -0.1}
"""rad: arms and legs a little away from the body, so that no part hides another."""
_COLUMN, _STEP = 0.62, 0.13
"""m from the middle to the labels, and between two of them (a body of 1.75 m)."""


def subject_figure(body: Body, labels: Mapping[str, str], measured: frozenset[str]) -> "Figure":
    """Draw ``body`` from the front, its right side on the left; ``labels`` (segment -> text) beside it; segments in
    ``measured`` are filled, the others white with a broken outline.
    """
    from matplotlib.patches import Polygon

    outlines = _outlines(body)
    with look():
        drawn = figure(4.9)
        axes = drawn.subplots()
        for segment, outline in outlines:
            known = segment in measured
            fill, edge, line, alpha = (BLUE, BLACK, "-", 0.45) if known else ("white", GREY, "--", 1.0)
            axes.add_patch(Polygon(outline, facecolor=fill, edgecolor=edge, linestyle=line, alpha=alpha, linewidth=0.9))
        middles = {segment: outline.mean(axis=0) for segment, outline in reversed(outlines)}
        for right in (True, False):
            _label(axes, {name: at for name, at in middles.items() if name in labels}, labels, right=right)
        axes.set_xlim(-1.35, 1.35)
        axes.set_ylim(*_reach(outlines))
        axes.set_aspect("equal")
        axes.set_axis_off()
    return drawn


def _outlines(body: Body) -> list[tuple[str, Array]]:
    """Return the outline (n, 2) m of every part from the front: to the person's left, and up; from back to front."""
    from scipy.spatial import ConvexHull

    q = np.array(body.neutral)
    for i, joint in enumerate(body.joints):
        q[body.nq - len(body.joints) + i] = _SPREAD.get(joint.name.split("_", 1)[1], 0.0)
    pose, found = poses(body, q), []
    for index, box in shape_parts(body):
        points = box_solid(box).vertices @ pose.rotation[0, index].T + pose.position[0, index]
        flat = points[:, 1:]
        found.append((body.segments[index], flat[ConvexHull(flat).vertices]))
    return found


def _reach(outlines: list[tuple[str, Array]]) -> tuple[float, float]:
    heights = np.concatenate([outline[:, 1] for _, outline in outlines])
    return float(heights.min()) - 0.05, float(heights.max()) + 0.05


def _label(axes: "Axes", middles: Mapping[str, Array], labels: Mapping[str, str], *, right: bool) -> None:
    """Write the labels of one side of the body in a column, from the top down, each with a line to its part."""
    own = [name for name in middles if (name.startswith("right") or name == "trunk_head") is right]
    own.sort(key=lambda name: -middles[name][1])
    x, last = (-_COLUMN if right else _COLUMN), np.inf
    for name in own:
        last = min(float(middles[name][1]), last - _STEP)
        axes.annotate(
            labels[name],
            (float(middles[name][0]), float(middles[name][1])),
            (x, last),
            fontsize=9,
            ha="right" if right else "left",
            va="center",
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.7, "shrinkA": 2, "shrinkB": 0},
        )
