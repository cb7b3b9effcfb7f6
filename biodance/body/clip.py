"""A closed surface cut by planes, exactly: every cut is closed again by triangles in the plane, and what is left is
again a closed surface whose volume, centroid and inertia are sums over its triangles.
"""

from typing import NamedTuple

import numpy as np

from biodance.records import Array

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
    one, two = edges[count[_crossed(count)] == 1], edges[count[_crossed(count)] == 2]
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
    crossed = _crossed((height > 0).sum(axis=1))
    triangles, height = triangles[crossed], height[crossed]
    single = (height > 0).sum(axis=1) == 1
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


def _crossed(count: Array) -> Array:
    return (count == 1) | (count == 2)


def _first(values: Array, marked: Array) -> Array:
    """Return the corners of every triangle turned round so that the marked one is the first."""
    index = (np.argmax(marked, axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(values, index[..., None], axis=1)
