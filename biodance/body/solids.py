"""Closed meshes of segments: made of their boxes, of their markers, or read from a file.

All meshes are `trimesh.Trimesh` in m, in the axes of their segment (x anterior, y up, z right; origin at the proximal
joint).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.errors import FileRefused
from biodance.records import Array, grouped

if TYPE_CHECKING:
    from trimesh import Trimesh

SegmentSolids = Mapping[str, "Trimesh"]
"""A closed mesh by the name of its segment."""
_MESHES = (".stl", ".obj", ".ply", ".off", ".glb", ".dae")
"""Mesh files that are read, by the ending of their name."""
ROUNDNESS = 4.0
"""Exponent of the solid in a box, |x/a|^p + |y/b|^p + |z/c|^p = 1: 2 is an ellipsoid, infinity the box."""


def box_solid(box: Array) -> "Trimesh":
    """Return a rounded solid that fills a ``box`` (2, 3) m: a superellipsoid that touches all six faces."""
    from trimesh.creation import icosphere

    sphere = icosphere(subdivisions=3)
    # On the superellipsoid sum |x|^p = 1: divided by the p-norm.
    size = (np.abs(sphere.vertices) ** ROUNDNESS).sum(axis=1, keepdims=True) ** (1 / ROUNDNESS)
    low, high = np.asarray(box)
    sphere.vertices = (low + high) / 2 + (high - low) / 2 * sphere.vertices / size
    return sphere


def shape_parts(body: Body) -> list[tuple[int, Array]]:
    """Return the boxes (2, 3) m that segments are drawn as, each with the index of its segment: one each, but trunk and
    head apart.

    The head takes 0.7 of what is above the shoulders, in the proportions of a person (Winter 2009); segments without
    a box have none.
    """
    parts, alone = [], "head" not in body.segments
    for index, box in enumerate(body.boxes):
        if not np.all(box[1] > box[0]):
            continue
        arms = [joint.translation[1] for joint in body.joints if joint.parent == body.segment_joint[index]]
        if body.segments[index] == "head":
            parts.append((index, _head_in(box, box[1, 1] - box[0, 1])))
        elif body.segments[index] == "trunk_head" and alone and arms and box[0, 1] < np.mean(arms) < box[1, 1]:
            low = np.array(box)
            # Of the height over the shoulders: how far the trunk reaches up, and the head down from the vertex.
            above = box[1, 1] - np.mean(arms)
            low[1, 1] = np.mean(arms) + 0.3 * above
            parts += [(index, low), (index, _head_in(box, 0.7 * above))]
        else:
            parts.append((index, box))
    return parts


def _head_in(box: Array, height: float) -> Array:
    """Return the box (2, 3) m of a head of some ``height`` (m) at the top of a ``box``."""
    middle, half = (box[0] + box[1]) / 2, height * np.array([0.85, 1.0, 0.68]) / 2
    head = np.stack([middle - half, middle + half])
    head[:, 1] = box[1, 1] - height, box[1, 1]
    return head


def read_mesh(path: str | Path, *, scale: float | Array = 1.0) -> "Trimesh":
    """Return the mesh in a file, all its parts as one, times ``scale`` (one number or (3,): m per unit of the file).

    Raises
    ------
    FileRefused
        The file is missing, of no known format, damaged, or holds no triangles.
    """
    import trimesh

    path = Path(path)
    if path.suffix.lower() not in _MESHES:
        raise FileRefused(f"{path}: is no mesh that is read. Legal are {', '.join(_MESHES)}.")
    if not path.is_file():
        raise FileRefused(f"{path}: there is no such file. Check the path.")
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # the parsers of six formats raise what they like
        raise FileRefused(
            f"{path}: is damaged ({type(error).__name__}: {str(error)[:120]}). Export the mesh again."
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise FileRefused(f"{path}: holds no triangles with finite corners. Export a surface mesh.")
    mesh.apply_transform(np.diag([*np.broadcast_to(np.asarray(scale, dtype=float), 3), 1.0]))
    return mesh


def segment_solids(body: Body, folder: str | Path | None = None) -> dict[str, "Trimesh"]:
    """Return a mesh of every segment: the file of its name in ``folder`` (``right_thigh.stl``), else the solids in its
    `shape_parts`.

    Segments whose box is empty have none.

    Raises
    ------
    FileRefused
        The folder is missing, holds a mesh that is named like no segment or two for one, or a mesh cannot be read.
    """
    from trimesh.util import concatenate

    given = {} if folder is None else _mesh_files(body, Path(folder))
    parts = grouped((body.segments[index], box_solid(box)) for index, box in shape_parts(body))
    made = {name: several[0] if len(several) == 1 else concatenate(several) for name, several in parts.items()}
    return {
        name: read_mesh(given[name]) if name in given else made[name]
        for name in body.segments
        if name in given or name in made
    }


def _mesh_files(body: Body, folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise FileRefused(
            f"{folder}: is no folder. Give the folder that holds one mesh a segment, named like right_thigh.stl."
        )
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in _MESHES:
            continue
        if path.stem not in body.segments:
            raise FileRefused(f"{path}: is named like no segment. Legal are {', '.join(body.segments)}.")
        if path.stem in found:
            raise FileRefused(f"{path}: {found[path.stem].name} is a mesh of this segment, too. Keep one.")
        found[path.stem] = path
    return found
