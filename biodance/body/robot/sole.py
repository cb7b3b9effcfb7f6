"""The soles of a robot: from boxes or from the meshes of its URDF file."""

from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np

from biodance.body.solids import read_mesh
from biodance.errors import FileRefused
from biodance.records import Array

_PACKAGE = "package://"


def mesh_file(urdf: Path, name: str) -> Path:
    """Return the file that a mesh's ``filename`` means: a path beside the URDF, or ``package://NAME/PATH`` in a folder
    above it.

    The package is looked for by its name in all folders that hold the URDF, and as one of these folders itself.

    Raises
    ------
    FileRefused
        There is no such file; the message says where it was looked for.
    """
    plain = name.removeprefix("file://").removeprefix("model://")
    places = [urdf.parent / plain]
    if name.startswith(_PACKAGE):
        package, _, rest = name.removeprefix(_PACKAGE).partition("/")
        above = urdf.resolve().parents
        places = [*(one / package / rest for one in above), *(one / rest for one in above if one.name == package)]
    for place in places:
        if place.is_file():
            return place
    raise FileRefused(
        f"the mesh {name!r} is not where {urdf} says. Put it beside the URDF, or below a folder "
        f"{urdf.resolve().parent} is in"
    )


@lru_cache(maxsize=256)
def mesh_hull(path: Path, scale: tuple[float, float, float]) -> Array:
    """Return the corners (K, 3) m of the convex hull of a mesh file times ``scale`` m per unit; of a flat mesh, all its
    corners.

    Raises
    ------
    FileRefused
        The file cannot be read as a mesh.
    """
    from scipy.spatial import ConvexHull, QhullError

    corners = np.unique(np.array(read_mesh(path, scale=np.array(scale)).vertices), axis=0)
    with suppress(QhullError, ValueError):
        corners = corners[ConvexHull(corners).vertices]
    corners.setflags(write=False)
    return np.asarray(corners)


_FLAT = 0.0005
"""m: corners of a foot of boxes this near to the plane of its sole belong to it."""
LAYER = 0.002
"""m: corners of a mesh this near to its lowest plane belong to the sole; meshes have rounded edges."""
_STEEPEST = 0.5
"""Cosine of the largest angle between a sole and the ground at zero joint angles."""
CORNERS = 12
"""A sole keeps at most so many corners, those that leave it largest, all on its outline: support is not overrated."""


def sole_outline(where: str, boxes: list[Array], hulls: list[Array], axes: Array) -> Array:
    """Return the sole (P, 3) m of a foot, counter-clockwise from above: the face of its shapes that lies lowest and
    nearest to horizontal.

    Parameters
    ----------
    where
        File and foot, for messages.
    boxes, hulls
        Corners (8, 3) of boxes and (K, 3) of convex hulls of meshes, m, in the frame of the foot.
    axes
        (3, 3), rows: forwards, up and to the right at zero joint angles, in the frame of the foot.

    Raises
    ------
    FileRefused
        No face points to the ground, or the lowest layer is a point or a line.
    """
    from scipy.spatial import ConvexHull, QhullError

    (ahead, up, right), corners = axes, np.concatenate([*boxes, *hulls])
    down = _down(boxes, hulls, up)
    if -down @ up < _STEEPEST:
        raise FileRefused(
            f"{where} has no face that points to the ground at zero joint angles. Give it a collision <box>."
        )
    low = corners[corners @ down > (corners @ down).max() - (LAYER if hulls else _FLAT)]
    flat = np.stack([low @ ahead, -(low @ right)], axis=1)  # x forwards, y left: counter-clockwise is from above
    try:
        outline = ConvexHull(flat).vertices
    except (QhullError, ValueError) as error:
        raise FileRefused(f"{where} stands on a point or an edge, not on a face. Give it a collision <box>.") from error
    return np.asarray(low[_largest(flat, outline.tolist())])


def match_faces(one: Array, other: Array) -> tuple[Array, Array]:
    """Return two outlines with equally many points: the poorer one gets the middles of its longest edges."""
    most = max(len(one), len(other))
    return _refined(one, most), _refined(other, most)


def _down(boxes: list[Array], hulls: list[Array], up: Array) -> Array:
    """Return the outward normal (3,) of the most horizontal face; of meshes, of the largest one within the limit."""
    from scipy.spatial import ConvexHull, QhullError

    if not hulls:
        normals = np.concatenate([_normals(corners) for corners in boxes])
        return np.asarray(normals[np.argmax(-normals @ up)])
    points = np.concatenate([*boxes, *hulls])
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return -up  # a flat mesh is a sole by itself
    normals = hull.equations[:, :3]
    edges = points[hull.simplices]
    area = np.linalg.norm(np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]), axis=1) / 2
    alike = normals @ normals.T > np.cos(np.radians(2.0))
    face = np.where(-normals @ up > _STEEPEST, alike @ area, 0.0)
    best = int(np.argmax(face))
    mean = (alike[best] * area) @ normals
    return np.asarray(mean / np.linalg.norm(mean)) if face[best] > 0 else np.asarray(normals[np.argmax(-normals @ up)])


def _normals(corners: Array) -> Array:
    """Return the outward normals (6, 3) of a box from its corners (8, 3), ordered as `urdf_file` does."""
    axes = np.array([corners[4] - corners[0], corners[2] - corners[0], corners[1] - corners[0]])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return np.concatenate([axes, -axes])


def _largest(flat: Array, outline: list[int]) -> list[int]:
    """Return at most `CORNERS` indices of a convex ``outline`` into ``flat`` (K, 2): the least important go first."""
    while len(outline) > CORNERS:
        here, before, after = flat[outline], flat[np.roll(outline, 1)], flat[np.roll(outline, -1)]
        (ax, ay), (bx, by) = (here - before).T, (after - before).T
        outline.pop(int(np.argmin(np.abs(ax * by - ay * bx))))
    return outline


def _refined(outline: Array, count: int) -> Array:
    while len(outline) < count:
        following = np.roll(outline, -1, axis=0)
        i = int(np.argmax(np.linalg.norm(following - outline, axis=1)))
        outline = np.insert(outline, i + 1, (outline[i] + following[i]) / 2, axis=0)
    return outline
