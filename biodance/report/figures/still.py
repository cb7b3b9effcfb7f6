"""A 3-D still as a light drawing: the measured markers, the body that was fitted to them, plates and forces."""

import numpy as np

from biodance.body.solids import ROUNDNESS
from biodance.display import BLACK, GREEN, GREY, YELLOW
from biodance.pipeline.trial_result import Still
from biodance.records import Array
from biodance.report.figures.style import SIDE_COLOURS

FORCE_SCALE = 0.001
"""Length of the drawn force, m per N."""

RESIDUAL_SCALE = 0.01
"""Length of the drawn residual force, m per N: ten times the measured force's."""

VIEWS = ((12.0, -35.0, "from the front, right"), (0.0, -90.0, "from the right"))
"""Elevation and azimuth in degrees, the latter from where the subject looks, and title of each view."""

_MM = 1000.0


def _screen(still: Still, elevation: float, azimuth: float) -> Array:
    """Return the matrix (3, 3) that turns lab points into mm to the right, down and towards the eye."""
    e, a = np.radians(elevation), np.radians(azimuth) + np.arctan2(still.forward[1], still.forward[0])
    right = [-np.sin(a), np.cos(a), 0.0]
    up = [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]
    eye = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
    return _MM * np.array([right, [-v for v in up], eye]).T


def _rounded(box: Array) -> Array:
    """Return points (n, 3) of the rounded solid that fills a ``box`` (2, 3) m."""
    polar, around = np.meshgrid(np.linspace(0.0, np.pi, 15), np.linspace(0.0, 2 * np.pi, 28, endpoint=False))
    ball = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], -1).reshape(-1, 3)
    size = (np.abs(ball) ** ROUNDNESS).sum(axis=1, keepdims=True) ** (1 / ROUNDNESS)
    return (box[0] + box[1]) / 2 + (box[1] - box[0]) / 2 * ball / size


def _outline(points: Array, kind: str) -> str:
    from scipy.spatial import ConvexHull, QhullError

    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:
        return ""
    return f'<path d="M{_places(points)}z" {kind}/>'


def _places(points: Array) -> str:
    return " ".join(f"{x:.0f} {y:.0f}" for x, y in points.tolist())


def _line(ends: Array, kind: str) -> str:
    return f'<path d="M{_places(ends)}" fill="none" {kind}/>' if np.isfinite(ends).all() else ""


def _dot(place: Array, radius: float, kind: str) -> str:
    return (
        f'<circle cx="{place[0]:.0f}" cy="{place[1]:.0f}" r="{radius:g}" {kind}/>' if np.isfinite(place).all() else ""
    )


def _body(still: Still, screen: Array) -> list[str]:
    """Return the segments' outlines, those behind first, and over them the bones."""
    skins = []
    for box, turn, at, side in zip(still.boxes, still.rotations, still.positions, still.box_sides, strict=True):
        if np.all(box[1] > box[0]):
            points = (_rounded(box) @ turn.T + at) @ screen
            kind = f'fill="{SIDE_COLOURS[side][0]}" fill-opacity="0.18" stroke="none"'
            skins.append((float(points[:, 2].mean()), _outline(points[:, :2], kind)))
    bones = []
    for ends, side in zip(still.bones @ screen, still.sides, strict=True):
        colour, dash = SIDE_COLOURS[side]
        broken = ' stroke-dasharray="30 18"' if dash == "--" else ""
        bones.append(_line(ends[:, :2], f'stroke="{colour}" stroke-width="13"{broken}'))
    return [text for _, text in sorted(skins)] + bones


def _forces(still: Still, screen: Array) -> list[str]:
    """Return markers, centre of mass, ground force, residual force and a load that was found."""
    out = [_dot(place, 9, f'fill="{BLACK}"') for place in still.markers @ screen]
    ground = np.stack([still.cop, still.cop + FORCE_SCALE * still.force]) @ screen
    left = np.stack([still.com, still.com + RESIDUAL_SCALE * still.residual]) @ screen
    out.append(_line(ground[:, :2], f'stroke="{GREEN}" stroke-width="14"'))
    out.append(_line(left[:, :2], f'class="residual" stroke="{BLACK}" stroke-width="14"'))
    out.append(_dot(still.com @ screen, 24, f'fill="{GREEN}"'))
    out.append(_dot(still.load @ screen, 50, f'fill="{YELLOW}" stroke="{BLACK}" stroke-width="6"'))
    return out


def still_figure(still: Still) -> str:
    """Return the body, its markers, the plates and the ground force from two sides as HTML, both to one scale."""
    drawn = []
    for elevation, azimuth, title in VIEWS:
        screen = _screen(still, elevation, azimuth)
        parts = [
            _line((corners[[0, 1, 2, 3, 0]] @ screen)[:, :2], f'stroke="{GREY}" stroke-width="6"')
            for corners in still.plates
        ]
        parts += [*_body(still, screen), *_forces(still, screen)]
        tips = [still.cop + FORCE_SCALE * still.force, still.com + RESIDUAL_SCALE * still.residual]
        points = np.concatenate([still.bones.reshape(-1, 3), still.markers, still.plates.reshape(-1, 3), tips])
        shown = (points[np.isfinite(points).all(axis=1)] @ screen)[:, :2]
        body = (still.bones.reshape(-1, 3) @ screen)[:, :2]
        (left, top), (right, foot) = shown.min(axis=0) - 90, shown.max(axis=0) + 90
        middle, half = float(body[:, 0].mean()), 900.0
        left, right = max(left, middle - half), min(right, middle + half)
        foot = min(foot, float(body[:, 1].max()) + 500.0)
        box = f"{left:.0f} {top:.0f} {right - left:.0f} {foot - top:.0f}"
        drawn.append(
            f'<div><svg class="still" role="img" aria-label="the body {title}" viewBox="{box}">{"".join(parts)}</svg>'
            f'<p class="small">{title}</p></div>'
        )
    return f'<div class="stills">{"".join(drawn)}</div>'
