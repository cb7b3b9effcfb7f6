"""The 3-D still as a shaded picture by pyvista, drawn in a child process: without GL libraries VTK kills the process that draws.

The child reads one still as JSON from stdin and writes a PNG to stdout. Whatever goes wrong in it, the parent gets None and the page
takes the drawing of ``still.py`` instead.
"""

import json
import subprocess
import sys
from base64 import b64encode
from importlib.util import find_spec
from typing import Any

import numpy as np

from biodance.pipeline.results import Still
from biodance.records import Array
from biodance.report.still import FORCE_SCALE, VIEWS, still_figure
from biodance.report.style import BLACK, GREEN, GREY, SIDES, svg_address

PATIENCE = 60.0
"""Seconds after which the child is given up."""

PIXELS = (1500, 900)
PNG = b"\x89PNG"


def solid_png(still: Still) -> bytes | None:
    """Return the picture of ``still`` as PNG bytes; None where pyvista or GL is missing, or the child dies or is too slow."""
    if find_spec("pyvista") is None:
        return None
    names = ("bones", "markers", "plates", "com", "force", "cop", "forward")
    question = json.dumps({"sides": still.sides, **{name: getattr(still, name).tolist() for name in names}})
    try:
        child = subprocess.run(
            [sys.executable, "-m", "biodance.report.solid"], input=question.encode(), capture_output=True, timeout=PATIENCE, check=False
        )
    except (subprocess.TimeoutExpired, OSError):
        return None
    return child.stdout if child.returncode == 0 and child.stdout.startswith(PNG) else None


def still_address(still: Still) -> str:
    """Return ``still`` as the address of an image: shaded where this machine can, else as a drawing."""
    png = solid_png(still)
    return svg_address(still_figure(still)) if png is None else "data:image/png;base64," + b64encode(png).decode("ascii")


def _scene(plotter: Any, still: dict[str, Array], sides: list[str]) -> None:
    """Put bones, markers, plates, centre of mass and ground force into the active view."""
    import pyvista as pv

    for (start, end), side in zip(still["bones"], sides, strict=True):
        if np.linalg.norm(end - start) > 1e-6:
            plotter.add_mesh(pv.Line(start, end).tube(radius=0.022, capping=True), color=SIDES[side][0])
            plotter.add_mesh(pv.Sphere(0.03, end), color=SIDES[side][0])
    for marker in still["markers"][np.isfinite(still["markers"]).all(axis=1)]:
        plotter.add_mesh(pv.Sphere(0.011, marker), color=BLACK)
    for corners in still["plates"]:
        plotter.add_mesh(pv.PolyData(corners, faces=[4, 0, 1, 2, 3]), color=GREY, opacity=0.5)
    plotter.add_mesh(pv.Sphere(0.035, still["com"]), color=GREEN)
    ends = {side: end for (_, end), side in zip(still["bones"], sides, strict=True) if side != "middle"}
    if ends:
        plotter.add_point_labels(list(ends.values()), list(ends), font_size=22, shape=None, show_points=False, always_visible=True)
    if np.isfinite(still["cop"]).all():
        plotter.add_mesh(pv.Line(still["cop"], still["cop"] + FORCE_SCALE * still["force"]).tube(radius=0.008), color=GREEN)


def _draw(question: dict[str, Any]) -> bytes:
    """Return the PNG of one still, both views beside each other."""
    from io import BytesIO

    import pyvista as pv
    from PIL import Image

    sides = question.pop("sides")
    still = {name: np.array(value, dtype=float) for name, value in question.items()}
    middle = (np.nanmin(still["bones"], axis=(0, 1)) + np.nanmax(still["bones"], axis=(0, 1))) / 2
    heading = np.arctan2(still["forward"][1], still["forward"][0])
    plotter = pv.Plotter(off_screen=True, shape=(1, len(VIEWS)), window_size=list(PIXELS), border=False)
    for column, (elevation, azimuth, _) in enumerate(VIEWS):
        plotter.subplot(0, column)
        _scene(plotter, still, sides)
        up, around = np.radians(elevation), np.radians(azimuth) + heading
        away = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        plotter.camera_position = [middle + 5.0 * away, middle, (0.0, 0.0, 1.0)]
        plotter.camera.view_angle = 24.0
    picture = BytesIO()
    Image.fromarray(plotter.screenshot(return_img=True)).save(picture, "PNG", optimize=True)
    return picture.getvalue()


if __name__ == "__main__":
    sys.stdout.buffer.write(_draw(json.load(sys.stdin)))
