"""glTF 2.0 binary (.glb): the solids of all segments and the markers on them, standing, for viewers, slides and the
web.

Units m, y up, facing x. Every segment is a node that hangs on its parent's, so that the file can be animated;
``extras`` of the scene say where the parameters come from, those of a segment its mass and centre of mass. Format:
registry.khronos.org/glTF.
"""

import numpy as np

from biodance.body.body import Body
from biodance.body.export import WORLD, segment_tree
from biodance.body.solids import SegmentSolids, segment_solids
from biodance.errors import BiodanceError
from biodance.records import side_in_name

FORMAT = "glb"
SUFFIX = ".glb"
_COLOURS = {"left": (0, 114, 178, 255), "right": (213, 94, 0, 255), "": (150, 150, 150, 255)}
"""Red, green, blue, opacity by the side that a segment's name begins with (Okabe and Ito: told apart by everybody)."""
MARKER = 0.007
"""m: radius of a marker."""
_WORLD_NODE = "world"


def data(body: Body, source: str, solids: SegmentSolids | None = None) -> bytes:
    """Return the .glb of ``body``; ``solids`` by segment instead of those in the boxes.

    Raises
    ------
    BiodanceError
        No segment has a solid.
    """
    import trimesh

    solids = segment_solids(body) if solids is None else solids
    if not solids:
        raise BiodanceError(f"{body.name}: no segment has a box or a mesh, so there is nothing to see.")
    scene = trimesh.Scene(base_frame=_WORLD_NODE)
    scene.metadata |= {"name": body.name, "source": source}
    ball = trimesh.creation.icosphere(subdivisions=1, radius=MARKER)
    for branch in segment_tree(body):
        name = body.segments[branch.segment]
        place = np.eye(4)
        if branch.parent != WORLD:
            place[:3, :3], place[:3, 3] = branch.rotation, branch.translation
        above = _WORLD_NODE if branch.parent == WORLD else body.segments[branch.parent]
        mesh = solids[name].copy() if name in solids else trimesh.Trimesh()
        mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=_COLOURS[side_in_name(name, "")])
        mesh.metadata = {"mass_kg": float(body.sip.of(name)[0]), "com_m": body.sip.com[branch.segment].tolist()}
        scene.add_geometry(mesh, node_name=name, geom_name=name, parent_node_name=above, transform=place)
    for name, segment, position in zip(body.markers.names, body.markers.segment, body.markers.position, strict=True):
        place = np.eye(4)
        place[:3, 3] = position
        scene.add_geometry(
            ball, node_name=name, geom_name="marker", parent_node_name=body.segments[segment], transform=place
        )
    return bytes(scene.export(file_type="glb"))
