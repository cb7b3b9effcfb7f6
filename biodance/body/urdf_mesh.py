"""The meshes that a URDF file names: where they are, and the corners of their convex hulls."""

from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np

from biodance.body.solids import read_mesh
from biodance.errors import FileRefused
from biodance.records import Array

PACKAGE = "package://"


def mesh_file(urdf: Path, name: str) -> Path:
    """Return the file that a mesh's ``filename`` means: a path beside the URDF, or ``package://NAME/PATH`` in a folder above it.

    The package is looked for by its name in all folders that hold the URDF, and as one of these folders itself.

    Raises
    ------
    FileRefused
        There is no such file; the message says where it was looked for.
    """
    plain = name.removeprefix("file://").removeprefix("model://")
    if not name.startswith(PACKAGE):
        places = [urdf.parent / plain]
    else:
        package, _, rest = name.removeprefix(PACKAGE).partition("/")
        above = urdf.resolve().parents
        places = [folder / package / rest for folder in above] + [folder / rest for folder in above if folder.name == package]
    for place in places:
        if place.is_file():
            return place
    raise FileRefused(
        f"the mesh {name!r} is not where {urdf} says. Put it beside the URDF, or below a folder {urdf.resolve().parent} is in"
    )


@lru_cache(maxsize=256)
def mesh_hull(path: Path, scale: tuple[float, float, float]) -> Array:
    """Return the corners (K, 3) m of the convex hull of a mesh file times ``scale`` m per unit; of a flat mesh, all its corners.

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
