"""3-D stills as shaded pictures by pyvista, drawn in a child process: without GL libraries VTK kills the process that
draws.

The child reads stills as JSON from stdin and writes PNGs, as JSON, to stdout. Whatever goes wrong in it, the parent
gets None and the page takes the drawings of ``still.py`` instead.
"""

import json
import subprocess
import sys
from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import fields
from importlib.util import find_spec
from typing import Any

import numpy as np

from biodance.body.solids import box_solid
from biodance.display import BLACK, GREEN, GREY, YELLOW
from biodance.pipeline.results import Still
from biodance.records import Array
from biodance.report.figures.still import FORCE_SCALE, RESIDUAL_SCALE, VIEWS, still_figure
from biodance.report.figures.style import SIDE_COLOURS, svg_address

_PATIENCE = 60.0
"""Seconds after which the child is given up."""

PIXELS = (1500, 900)
TILE, _COLUMNS = (300, 420), 6
"""Size of one posture in a sheet of postures, px, and how many stand beside each other."""
PNG = b"\x89PNG"
SKIN = 0.3
"""Opacity of the segments, through which bones and markers are seen."""


def solid_pngs(stills: Sequence[Still], *, sheet: bool = False) -> list[bytes] | None:
    """Return the pictures of ``stills`` as PNG bytes, or one ``sheet`` of all of them, each titled by its ``trial``.

    None where pyvista or GL is missing, or the child dies or is too slow.
    """
    if find_spec("pyvista") is None or not stills:
        return None
    question = json.dumps({"sheet": sheet, "stills": [_plain(still) for still in stills]})
    try:
        child = subprocess.run(
            [sys.executable, "-m", "biodance.report.figures.solid"],
            input=question.encode(),
            capture_output=True,
            timeout=_PATIENCE,
            check=False,
        )
        pictures = [b64decode(text) for text in json.loads(child.stdout)] if child.returncode == 0 else []
    except (subprocess.TimeoutExpired, OSError, ValueError, TypeError):
        return None
    whole = len(pictures) == (1 if sheet else len(stills)) and all(picture.startswith(PNG) for picture in pictures)
    return pictures if whole else None


def still_addresses(stills: Sequence[Still]) -> list[str]:
    """Return ``stills`` as addresses of images: shaded where this machine can, else as drawings."""
    pngs = solid_pngs(stills)
    if pngs is None:
        return [svg_address(still_figure(still)) for still in stills]
    return ["data:image/png;base64," + b64encode(png).decode("ascii") for png in pngs]


def _plain(still: Still) -> dict[str, Any]:
    values = {field.name: getattr(still, field.name) for field in fields(still)}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def _record(answer: dict[str, Any]) -> Still:
    """Return the still that `_plain` took apart."""
    shapes = {
        "bones": (-1, 2, 3),
        "markers": (-1, 3),
        "plates": (-1, 4, 3),
        "boxes": (-1, 2, 3),
        "rotations": (-1, 3, 3),
        "positions": (-1, 3),
    }
    found: dict[str, Any] = {}
    for name, value in answer.items():
        texts = (
            isinstance(value, list)
            and all(isinstance(entry, str) for entry in value)
            and name in ("sides", "box_sides")
        )
        found[name] = (
            tuple(value)
            if texts
            else np.array(value, dtype=float).reshape(shapes.get(name, -1))
            if isinstance(value, list)
            else value
        )
    return Still(**found)


def _body(plotter: Any, still: Still) -> None:
    """Put the segments, through which the bones are seen, and the centre of mass into the active view."""
    import pyvista as pv

    for box, turn, place, side in zip(still.boxes, still.rotations, still.positions, still.box_sides, strict=True):
        if np.all(box[1] > box[0]):
            solid = box_solid(box)
            skin = pv.make_tri_mesh(solid.vertices @ turn.T + place, solid.faces)
            plotter.add_mesh(skin, color=SIDE_COLOURS[side][0], opacity=SKIN, smooth_shading=True)
    thick = 0.012 if len(still.boxes) else 0.022
    for (start, end), side in zip(still.bones, still.sides, strict=True):
        if np.linalg.norm(end - start) > 1e-6:
            plotter.add_mesh(pv.Line(start, end).tube(radius=thick, capping=True), color=SIDE_COLOURS[side][0])
            plotter.add_mesh(pv.Sphere(1.3 * thick, end), color=SIDE_COLOURS[side][0])
    plotter.add_mesh(pv.Sphere(0.03, still.com), color=GREEN)


def _measured(plotter: Any, still: Still) -> None:
    """Put markers, plates, forces and a load into the active view."""
    import pyvista as pv

    for marker in still.markers[np.isfinite(still.markers).all(axis=1)]:
        plotter.add_mesh(pv.Sphere(0.011, marker), color=BLACK)
    for corners in still.plates:
        plotter.add_mesh(pv.PolyData(corners, faces=[4, 0, 1, 2, 3]), color=GREY, opacity=0.5)
    _arrow(plotter, still.cop, FORCE_SCALE * still.force, GREEN, 0.010)
    _arrow(plotter, still.com, RESIDUAL_SCALE * still.residual, BLACK, 0.014)
    if np.isfinite(still.load).all():
        plotter.add_mesh(pv.Sphere(0.06, still.load), color=YELLOW)


def _arrow(plotter: Any, start: Array, along: Array, colour: str, radius: float) -> None:
    """Draw an arrow with a head of the same size whatever its length; nothing where it is not known or shorter than
    its head.
    """
    import pyvista as pv

    length = float(np.linalg.norm(along))
    if not (np.isfinite(start).all() and length > 6 * radius):
        return
    head = 6 * radius / length
    arrow = pv.Arrow(
        start,
        along,
        tip_length=head,
        tip_radius=2.5 * radius / length,
        shaft_radius=radius / length,
        scale=length,
        tip_resolution=40,
    )
    plotter.add_mesh(arrow, color=colour, smooth_shading=False)


def _names(plotter: Any, still: Still) -> None:
    """Write left and right beside the ends of the arms: seen from the front, the right arm is on the left of the
    picture.
    """
    for side, justified in (("left", "left"), ("right", "right")):
        ends = [end for (_, end), own in zip(still.bones, still.sides, strict=True) if own == side]
        if ends:
            word = f"   {side}   "
            look = {
                "font_size": 22,
                "shape": None,
                "show_points": False,
                "always_visible": True,
                "text_color": SIDE_COLOURS[side][0],
            }
            plotter.add_point_labels(
                [ends[-1]], [word], justification_horizontal=justified, justification_vertical="center", **look
            )


def _camera(
    plotter: Any, still: Still, view: tuple[float, float], *, distance: float, height: float | None = None
) -> None:
    """Look at the middle of the body; ``height`` m: as if it were so high, so that feet stand on one line."""
    points = still.bones.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    middle[2] = low[2] + (high[2] - low[2] if height is None else height) / 2
    heading = np.arctan2(still.forward[1], still.forward[0])
    up, around = np.radians(view[0]), np.radians(view[1]) + heading
    away = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    plotter.camera_position = [middle + distance * away, middle, (0.0, 0.0, 1.0)]
    plotter.camera.view_angle = 24.0


def _png(plotter: Any) -> bytes:
    from io import BytesIO

    from PIL import Image

    picture = BytesIO()
    Image.fromarray(plotter.screenshot(return_img=True)).save(picture, "PNG", optimize=True)
    plotter.close()
    return picture.getvalue()


def _draw(still: Still) -> bytes:
    """Return the PNG of one still, both views beside each other."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, shape=(1, len(VIEWS)), window_size=list(PIXELS), border=False)
    for column, (elevation, azimuth, _) in enumerate(VIEWS):
        plotter.subplot(0, column)
        _body(plotter, still)
        _measured(plotter, still)
        if column == 0:
            _names(plotter, still)
        _camera(plotter, still, (elevation, azimuth), distance=5.0)
    return _png(plotter)


def _draw_sheet(stills: Sequence[Still]) -> bytes:
    """Return the PNG of many postures, each from the front, right, with its title, all to one scale."""
    import pyvista as pv

    columns = min(_COLUMNS, len(stills))
    rows = -(-len(stills) // columns)
    plotter = pv.Plotter(
        off_screen=True, shape=(rows, columns), window_size=[TILE[0] * columns, TILE[1] * rows], border=False
    )
    height = max(float(np.ptp(still.bones[..., 2])) for still in stills)
    for i, still in enumerate(stills):
        plotter.subplot(i // columns, i % columns)
        _body(plotter, still)
        plotter.add_text(still.trial, position="upper_left", font_size=8, color=BLACK)
        _camera(plotter, still, (12.0, -50.0), distance=5.8, height=height)
    return _png(plotter)


def _answer(question: dict[str, Any]) -> list[str]:
    stills = [_record(one) for one in question["stills"]]
    pictures = [_draw_sheet(stills)] if question["sheet"] else [_draw(still) for still in stills]
    return [b64encode(picture).decode("ascii") for picture in pictures]


if __name__ == "__main__":
    sys.stdout.write(json.dumps(_answer(json.load(sys.stdin))))
