"""A scanned standing person: the mesh of a file, checked, turned into the axes of the segments."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from biodance.body.solids import read_mesh
from biodance.errors import FileRefused, SessionRefused
from biodance.records import Array

if TYPE_CHECKING:
    from trimesh import Trimesh

_ROUNDING = 1e-12
"""m."""


class Section(NamedTuple):
    """The section of a body with a plane: ``area`` m², ``middle`` (3,) m its centroid."""

    area: float
    middle: Array


def clip_surface(triangles: Array, point: Array, normal: Array) -> Array:
    """Return the part of a closed surface on the side of a plane to which its normal points, closed in the plane.

    Parameters
    ----------
    triangles : array_like
        (n, 3, 3) m, corners counter-clockwise from outside.
    point, normal : array_like
        (3,) a point of the plane, m, and its normal of length one.

    Returns
    -------
    Array
        (m, 3, 3) m. Pieces that close the cut may overlap with opposite signs: sums over them are exact.
    """
    height = _heights(triangles, point, normal)
    above = height > 0
    count = above.sum(axis=1)
    edges = crossing_edges(triangles, point, normal)
    whole, tips, roofs = (triangles[count == n] for n in (3, 1, 2))
    apex, roof = (_first(part, above[count == n] == (n == 1)) for part, n in ((tips, 1), (roofs, 2)))
    one, two = (edges[count[(count == 1) | (count == 2)] == n] for n in (1, 2))
    tip = np.stack([apex[:, 0], one[:, 1], one[:, 0]], axis=1)
    left = np.stack([roof[:, 1], roof[:, 2], two[:, 1]], axis=1)
    right = np.stack([roof[:, 1], two[:, 1], two[:, 0]], axis=1)
    lid = np.stack([np.broadcast_to(point, (len(edges), 3)), edges[:, 0], edges[:, 1]], axis=1)
    return np.concatenate([whole, tip, left, right, lid])


def crossing_edges(triangles: Array, point: Array, normal: Array) -> Array:
    """Return where a plane cuts triangles: (c, 2, 3) m, one edge a triangle, so that what the normal points to lies
    above the lid that these edges bound.
    """
    height = _heights(triangles, point, normal)
    count = (height > 0).sum(axis=1)
    crossed = (count == 1) | (count == 2)
    triangles, height, single = triangles[crossed], height[crossed], count[crossed] == 1
    alone = (height > 0) == single[:, None]
    corner, level = _first(triangles, alone), _first(height[..., None], alone)[..., 0]
    share = (level[:, :1] / (level[:, :1] - level[:, 1:]))[..., None]
    ends = corner[:, :1] + share * (corner[:, 1:] - corner[:, :1])
    return np.asarray(np.where(single[:, None, None], ends[:, ::-1], ends))


def cut_section(triangles: Array, point: Array, normal: Array) -> Section:
    """Return the section of a closed surface (n, 3, 3) m with the plane through ``point`` (3,) m.

    An empty section has area 0 and its middle at ``point``.
    """
    arm = crossing_edges(triangles, point, normal) - point
    twice = np.cross(arm[:, 0], arm[:, 1]) @ -normal
    area = float(twice.sum()) / 2
    first = (twice @ arm.sum(axis=1)) / 6 if len(arm) else np.zeros(3)
    return Section(area, point + (first / area if area > 0 else 0.0))


def _heights(triangles: Array, point: Array, normal: Array) -> Array:
    """Return the heights (n, 3) m of the corners over a plane, those within rounding as 0: a corner has the same in
    every triangle (sums, since a matrix product rounds by place).
    """
    arm = triangles - point
    height = arm[..., 0] * normal[0] + arm[..., 1] * normal[1] + arm[..., 2] * normal[2]
    return np.where(np.abs(height) < _ROUNDING, 0.0, height)


def _first(values: Array, marked: Array) -> Array:
    """Return the corners of every triangle turned round so that the marked one is the first."""
    index = (np.argmax(marked, axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(values, index[..., None], axis=1)


_TALL = 0.06
"""Share by which a scan may be taller or smaller than the person: shoes, hair, a bent knee."""
_UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254}
_TURNED = {"z": "xyz", "y": "zxy", "x": "yzx"}
"""By the axis that points up: axes of the file in the order ahead or sideways, ahead or sideways, up."""
_FOOT, _ANKLE = 0.02, 0.07
"""Of the stature: heights through the feet, and over them."""
_AHEAD = 0.01
"""Of the stature: the feet reach ahead of the ankles by at least this much on average."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A standing person's surface: ``triangles`` (n, 3, 3) m, closed; x ahead, y up, z to the person's right; the soles
    at y = 0, the middle of the body at z = 0. ``height`` m.
    """

    triangles: Array
    height: float


@functools.lru_cache(maxsize=4)
def read_scan(path: str, stature: float, up: str = "z") -> Scan:
    """Return the scan of a person who stands upright with the arms away from the trunk.

    Parameters
    ----------
    path : str
        OBJ, STL or PLY, in m.
    stature : float
        Of the person, m.
    up : {"z", "y", "x"}
        Axis of the file that points up.

    Raises
    ------
    SessionRefused
        The file is missing or no mesh; the surface is not closed; it is not in m, lies, has no feet or is of somebody
        else's stature.
    """
    try:
        mesh = read_mesh(Path(path))
    except FileRefused as error:
        raise SessionRefused(f"[subject] scan: {error}") from error
    _refuse_open(path, mesh)
    order = [("x", "y", "z").index(axis) for axis in _TURNED[up]]
    corners = np.asarray(mesh.triangles)[:, :, order]
    corners = corners if mesh.volume > 0 else corners[:, ::-1]
    _refuse_height(path, np.ptp(corners.reshape(-1, 3), axis=0), stature, up, order)
    return _turned(path, corners - [0, 0, corners[..., 2].min()], stature)


def _refuse_open(path: str, mesh: "Trimesh") -> None:
    if mesh.is_watertight and mesh.is_winding_consistent:
        return
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    loose = int(np.sum(count != 2))
    said = f"{loose} of {len(edges)} edges have one triangle only" if loose else "its triangles face in and out"
    raise SessionRefused(
        f"[subject] scan: the surface in {path} is not closed ({said}), so it has no volume. Close the holes in the "
        "scanning program (soles and crown are the usual ones) and export again."
    )


def _refuse_height(path: str, extent: Array, stature: float, up: str, order: list[int]) -> None:
    """Refuse a scan (extents (3,) along horizontal, horizontal and up) that is not as tall as the person."""
    if abs(extent[2] / stature - 1) <= _TALL:
        return
    start = f"[subject] scan: {path} is {extent[2]:.3g} m tall along its axis {up}, the person {stature:.2f} m."
    for unit, size in _UNITS.items():
        if abs(extent[2] * size / stature - 1) <= _TALL:
            raise SessionRefused(f"{start} It looks like {unit}: export it in metres.")
    for k in (0, 1):
        if abs(extent[k] / stature - 1) <= _TALL:
            axis = "xyz"[order[k]]
            raise SessionRefused(
                f"{start} Along {axis} it is {extent[k]:.2f} m: a person who lies, or a file whose axis {axis} points "
                f'up: then write scan_up = "{axis}".'
            )
    raise SessionRefused(
        f"{start} At most {100 * _TALL:.0f} % between them are believed. Is it the same person, upright, with head and "
        "feet, and is height_m right?"
    )


def _turned(path: str, corners: Array, stature: float) -> Scan:
    """Return the scan in x ahead, y up, z right: sideways is where the body is widest, ahead where the feet point."""
    surface = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = corners.mean(axis=1)[:, :2]
    away = flat - surface @ flat / surface.sum()
    wide = np.linalg.eigh((away * surface[:, None]).T @ away)[1][:, 1]
    deep = np.array([-wide[1], wide[0]])
    z = np.array([0.0, 0.0, 1.0])
    low, high = (cut_section(corners, share * stature * z, z) for share in (_FOOT, _ANKLE))
    ahead = float((low.middle - high.middle)[:2] @ deep)
    if min(low.area, high.area) <= 0 or abs(ahead) < _AHEAD * stature:
        raise SessionRefused(
            f"[subject] scan: {path} has no feet: {100 * _FOOT:.0f} % of the stature over its lowest point the body "
            f"reaches {1000 * abs(ahead):.0f} mm ahead of the ankles (least {1000 * _AHEAD * stature:.0f}). Scan the "
            "feet as well, both flat on the floor, side by side, toes ahead."
        )
    forward = np.append(np.sign(ahead) * deep, 0.0)
    turned = corners @ np.stack([forward, z, np.cross(forward, z)]).T
    middle = cut_section(turned, np.array([0.0, 0.5 * stature, 0.0]) + turned[0, 0] * [1, 0, 1], np.array([0, 1.0, 0]))
    return Scan(turned - [0.0, 0.0, middle.middle[2]], float(corners[..., 2].max()))
