"""OpenSim 4 model (.osim): bodies, custom joints, coordinates with ranges, markers; no muscles.

OpenSim's ground has y up, as the .trc and .mot files that ``lab`` writes. The free root has six coordinates, in the
order and with the signs that OpenSim's own gait models use: <root>_tilt about z, _list about x, _rotation about y
(body-fixed, in this order), _tx, _ty, _tz. A body with a fixed root keeps the frame of its first joint, z up. Segments
are shown as their boxes, or, with ``solids``, as meshes in the folder Geometry beside the model, where OpenSim looks
for them.
"""

from xml.etree.ElementTree import Element

import numpy as np

from biodance.body.body import Body
from biodance.body.export import WORLD, Branch, add, euler_angles, plain_name, row, segment_tree, six, xml_document
from biodance.body.parts import UPRIGHT, rigid_inertia
from biodance.body.solids import SegmentSolids
from biodance.errors import BiodanceError
from biodance.records import Array

FORMAT = "osim"
SUFFIX = ".osim"
_GEOMETRY = "Geometry"  # Folder beside the model in which OpenSim looks for meshes
ROOT_ROTATIONS = ("tilt", "list", "rotation")
ROOT_TRANSLATIONS = ("tx", "ty", "tz")


def text(body: Body, source: str, solids: SegmentSolids | None = None) -> str:
    """Return the .osim of ``body``; with ``solids`` it names the meshes that ``beside`` writes.

    Raises
    ------
    BiodanceError
        The axes of one joint do not meet in one point or are more than three: OpenSim's custom joint cannot hold them.
    """
    root = Element("OpenSimDocument", Version="40000")
    model = add(root, "Model", name=plain_name(body.name))
    add(model, "credits", source or "written by biodance")
    add(model, "gravity", row(UPRIGHT.T @ body.gravity if body.n_root else body.gravity))
    bodies = add(add(model, "BodySet", name="bodyset"), "objects")
    joints = add(add(model, "JointSet", name="jointset"), "objects")
    for branch in segment_tree(body):
        _body(bodies, body, branch.segment, solids or {})
        _joint(joints, body, branch)
    markers = add(add(model, "MarkerSet", name="markerset"), "objects")
    for name, segment, position in zip(body.markers.names, body.markers.segment, body.markers.position, strict=True):
        marker = add(markers, "Marker", name=plain_name(name))
        add(marker, "socket_parent_frame", f"/bodyset/{body.segments[segment]}")
        add(marker, "location", row(position))
        add(marker, "fixed", "true")
    return xml_document(root, source)


def beside(body: Body, solids: SegmentSolids) -> dict[str, bytes]:
    """Return the meshes (STL, m) by their path beside the model."""
    return {
        f"{_GEOMETRY}/{_mesh_file(body, name)}": bytes(solids[name].export(file_type="stl"))
        for name in body.segments
        if name in solids
    }


def _mesh_file(body: Body, segment: str) -> str:
    return f"{plain_name(body.name)}_{segment}.stl"


def _body(bodies: Element, body: Body, segment: int, solids: SegmentSolids) -> None:
    name = body.segments[segment]
    lump = rigid_inertia(body.sip.of(name))
    element = add(bodies, "Body", name=name)
    low, high = body.boxes[segment]
    if name in solids:
        mesh = add(add(element, "attached_geometry"), "Mesh", name=f"{name}_mesh")
        add(mesh, "socket_frame", "..")
        add(mesh, "mesh_file", _mesh_file(body, name))
    elif np.all(high > low):
        frame = add(add(element, "components"), "PhysicalOffsetFrame", name="box")
        brick = add(add(frame, "attached_geometry"), "Brick", name=f"{name}_box")
        add(brick, "socket_frame", "..")
        add(add(brick, "Appearance"), "opacity", "0.4")
        add(brick, "half_lengths", row((high - low) / 2))
        add(frame, "socket_parent", "..")
        add(frame, "translation", row((low + high) / 2))
    add(element, "mass", row([lump.mass]))
    add(element, "mass_center", row(lump.com))
    add(element, "inertia", six(lump.inertia))


def _joint(joints: Element, body: Body, branch: Branch) -> None:
    name, on_world = body.segments[branch.segment], branch.parent == WORLD
    free = on_world and body.n_root
    element = add(joints, "CustomJoint", name=f"{name}_joint")
    add(element, "socket_parent_frame", "parent_offset")
    add(element, "socket_child_frame", f"/bodyset/{name}")
    coordinates = add(element, "coordinates")
    frame = add(add(element, "frames"), "PhysicalOffsetFrame", name="parent_offset")
    add(frame, "socket_parent", "/ground" if on_world else f"/bodyset/{body.segments[branch.parent]}")
    add(frame, "translation", row(branch.translation))
    add(frame, "orientation", row(euler_angles("XYZ", branch.rotation)))
    transform = add(element, "SpatialTransform")
    if free:
        # About z, x and y, as OpenSim names the pelvis' turns.
        turns, names = np.eye(3)[[2, 0, 1]], [f"{name}_{word}" for word in ROOT_ROTATIONS]
        shifts = [f"{name}_{word}" for word in ROOT_TRANSLATIONS]
        ranges = [(-10.0, 10.0)] * 6
    else:
        turns, shifts, hinges = _axes(body, branch), [], [hinge.joint for hinge in branch.hinges]
        names = [body.joints[joint].name for joint in hinges]
        ranges = [(body.limits.lower[joint], body.limits.upper[joint]) for joint in hinges]
    for coordinate, limits in zip((*names, *shifts), ranges, strict=True):
        _coordinate(coordinates, coordinate, limits)
    for kind, moved, axes in (("rotation", names, turns), ("translation", shifts, np.eye(3))):
        for i, axis in enumerate(axes):
            _axis(transform, f"{kind}{i + 1}", moved[i : i + 1], axis)


def _coordinate(parent: Element, name: str, limits: tuple[float, float]) -> None:
    element = add(parent, "Coordinate", name=name)
    add(element, "default_value", "0")
    add(element, "default_speed_value", "0")
    add(element, "range", row(limits))
    for word in ("clamped", "locked"):
        add(element, word, "false")


def _axis(parent: Element, name: str, coordinate: list[str], axis: Array) -> None:
    element = add(parent, "TransformAxis", name=name)
    add(element, "coordinates", "".join(coordinate))
    add(element, "axis", row(axis))
    if coordinate:
        add(add(element, "LinearFunction", name="function"), "coefficients", "1 0")
    else:
        add(add(element, "Constant", name="function"), "value", "0")


def _axes(body: Body, branch: Branch) -> Array:
    """Return three independent axes (3, 3), rows, the hinges' first; refuse what a custom joint cannot hold."""
    name = body.segments[branch.segment]
    if len(branch.hinges) > 3:
        raise BiodanceError(
            f"Segment {name} has {len(branch.hinges)} axes in one joint; an OpenSim custom joint holds three rotations."
        )
    if any(np.linalg.norm(hinge.place) > 1e-9 for hinge in branch.hinges):
        raise BiodanceError(
            f"The axes of the joint of {name} do not meet in its origin; an OpenSim custom joint cannot hold them."
        )
    axes = [hinge.axis for hinge in branch.hinges]
    while len(axes) < 3:
        spanned = np.array(axes).reshape(-1, 3)
        # Projection on what the axes so far do not span; the direction that is left whole is the next axis.
        rest = np.eye(3) - spanned.T @ np.linalg.pinv(spanned.T)
        value, vector = np.linalg.eigh(rest @ rest.T)
        axes.append(vector[:, np.argmax(value)])
    return np.array(axes)
