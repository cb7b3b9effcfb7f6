"""A sheet of postures as a shaded picture by pyvista, drawn in a child process: without GL libraries VTK kills the
process that draws.

The child reads pickled stills from stdin and writes a PNG to stdout. Whatever goes wrong in it, the parent gets None.
"""

import pickle
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from io import BytesIO
from typing import Any

import numpy as np

from biodance.body.solids import box_solid
from biodance.child_process import run_python
from biodance.display import BLACK, GREEN
from biodance.pipeline.still import Still
from biodance.report.figures.style import SIDE_COLOURS

_PATIENCE = 60.0  # Seconds after which the child is given up

TILE, _COLUMNS = (300, 420), 6
"""Size of one posture in a sheet of postures, px, and how many stand beside each other."""
PNG = b"\x89PNG"
SKIN = 0.3
"""Opacity of the segments, through which bones and markers are seen."""


def sheet_png(stills: Sequence[Still]) -> bytes | None:
    """Return all ``stills``, titled by ``trial``, as PNG; None where pyvista or GL lacks, or the child dies."""
    if find_spec("pyvista") is None or not stills:
        return None
    try:
        child = run_python("-m", "biodance.report.figures.solid", input=pickle.dumps(list(stills)), timeout=_PATIENCE)
    except (subprocess.TimeoutExpired, OSError):
        return None
    return child.stdout if child.returncode == 0 and child.stdout.startswith(PNG) else None


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


def _camera(plotter: Any, still: Still, height: float) -> None:
    """Look at the middle of a body ``height`` m high, so that feet stand on one line, from the front, right, above."""
    points = still.bones.reshape(-1, 3)
    low = points.min(axis=0)
    middle = (low + points.max(axis=0)) / 2
    middle[2] = low[2] + height / 2
    # 12 degrees from above, 50 to the right of where the person looks
    up, around = np.radians(12.0), np.radians(-50.0) + np.arctan2(still.forward[1], still.forward[0])
    away = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    plotter.camera_position = [middle + 5.8 * away, middle, (0.0, 0.0, 1.0)]
    plotter.camera.view_angle = 24.0


def _draw_sheet(stills: Sequence[Still]) -> bytes:
    """Return the PNG of many postures, each from the front, right, with its title, all to one scale."""
    import pyvista as pv
    from PIL import Image

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
        _camera(plotter, still, height)
    picture = BytesIO()
    Image.fromarray(plotter.screenshot(return_img=True)).save(picture, "PNG", optimize=True)
    plotter.close()
    return picture.getvalue()


if __name__ == "__main__":
    sys.stdout.buffer.write(_draw_sheet(pickle.load(sys.stdin.buffer)))
