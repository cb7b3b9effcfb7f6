"""What a URDF file says: links and joints, checked and in SI units, with nothing left out in silence.

Read are <link> (inertial, collision and visual boxes, cylinders, spheres and meshes) and <joint> (revolute, continuous,
fixed) with their placements and limits. Transmissions, sensors and colours do not matter here. Format:
wiki.ros.org/urdf/XML.
"""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np

from biodance.body.parts import RigidInertia, turn_inertia
from biodance.body.solids import read_mesh
from biodance.errors import FileRefused
from biodance.library import refuse_special
from biodance.records import Array
from biodance.spatial import axis_rotation, elementary_rotation

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
        if os.path.isfile(place):  # Path.is_file raises for a name too long
            return place
    raise FileRefused(
        f"the mesh {name!r} is not where {urdf} says. Put it beside the URDF, or below a folder "
        f"{urdf.resolve().parent} is in"
    )


@lru_cache(maxsize=256)
def _mesh_hull(path: Path, scale: tuple[float, float, float]) -> Array:
    """Return the corners (K, 3) m of the convex hull of a mesh times ``scale`` m; of a flat one, all corners."""
    from scipy.spatial import ConvexHull, QhullError

    corners = np.unique(np.array(read_mesh(path, scale=np.array(scale)).vertices), axis=0)
    with suppress(QhullError, ValueError):
        corners = corners[ConvexHull(corners).vertices]
    corners.setflags(write=False)
    return np.asarray(corners)


_STEEPEST = 0.5  # Cosine of the largest angle between a sole and the ground at zero joint angles
CORNERS = 12
"""A sole keeps at most so many corners, those that leave it largest, all on its outline: support is not overrated."""


def sole_outline(where: str, boxes: Sequence[Array], hulls: Sequence[Array], axes: Array) -> Array:
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
    # m: corners this near to the plane of the sole belong to it; meshes have rounded edges
    low = corners[corners @ down > (corners @ down).max() - (0.002 if hulls else 0.0005)]
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


def _down(boxes: Sequence[Array], hulls: Sequence[Array], up: Array) -> Array:
    """Return the outward normal (3,) of the most horizontal face; of meshes, of the largest one within the limit."""
    from scipy.spatial import ConvexHull, QhullError

    if not hulls:
        # Outward normals of each box, along its edges and against them; its corners are ordered as in `_shapes`.
        edges = np.concatenate([corners[[4, 2, 1]] - corners[0] for corners in boxes])
        edges /= np.linalg.norm(edges, axis=1, keepdims=True)
        normals = np.stack([edges.reshape(-1, 3, 3), -edges.reshape(-1, 3, 3)], axis=1).reshape(-1, 3)
        return np.asarray(normals[np.argmax(-normals @ up)])
    points = np.concatenate([*boxes, *hulls])
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return -up  # a flat mesh is a sole by itself
    normals = hull.equations[:, :3]
    edges = points[hull.simplices]
    area = np.linalg.norm(np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]), axis=1) / 2
    # Faces whose normals lie within 2 degrees are one face of a meshed sole.
    alike = normals @ normals.T > np.cos(np.radians(2.0))
    face = np.where(-normals @ up > _STEEPEST, alike @ area, 0.0)
    best = int(np.argmax(face))
    # Mean normal, weighted with the areas.
    mean = (alike[best] * area) @ normals
    return np.asarray(mean / np.linalg.norm(mean)) if face[best] > 0 else np.asarray(normals[np.argmax(-normals @ up)])


def _largest(flat: Array, outline: list[int]) -> list[int]:
    """Return at most `CORNERS` indices of a convex ``outline`` into ``flat`` (K, 2): the least important go first."""
    while len(outline) > CORNERS:
        here, before, after = flat[outline], flat[np.roll(outline, 1)], flat[np.roll(outline, -1)]
        # Twice the area of the triangle that a corner makes with its neighbours: what the sole loses without it.
        (ax, ay), (bx, by) = (here - before).T, (after - before).T
        outline.pop(int(np.argmin(np.abs(ax * by - ay * bx))))
    return outline


def _refined(outline: Array, count: int) -> Array:
    while len(outline) < count:
        following = np.roll(outline, -1, axis=0)
        i = int(np.argmax(np.linalg.norm(following - outline, axis=1)))
        outline = np.insert(outline, i + 1, (outline[i] + following[i]) / 2, axis=0)
    return outline


_KINDS = ("revolute", "continuous", "fixed")  # Types of joints that a body can have
_TURN = np.pi  # rad: range of a continuous joint to either side
_X = np.array([1.0, 0.0, 0.0])  # Axis of a joint that names none


@dataclass(frozen=True, eq=False)
class Link:
    """One link, or one that moves with all that is fixed to it: ``lumps``, none without mass; of its collision (else
    visual) shapes ``boxes``, corners (8, 3) m around those that are no meshes, and ``hulls``, corners (K, 3) m of the
    convex hulls of those that are, all in the link's frame; ``unread`` why meshes could not be read; ``joint`` index
    of what moves it, -1 for the root.
    """

    name: str
    lumps: tuple[RigidInertia, ...] = ()
    boxes: tuple[Array, ...] = ()
    hulls: tuple[Array, ...] = ()
    unread: tuple[str, ...] = ()
    joint: int = -1

    @property
    def corners(self) -> Array:
        """(K, 3) m, corners of all shapes; empty without any."""
        return np.concatenate([np.empty((0, 3)), *self.boxes, *self.hulls])

    def holding(self, other: "Link", turn: Array, place: Array) -> "Link":
        """Return the link with ``other`` fixed to it, whose frame is at ``turn`` (3, 3) and ``place`` (3,) m."""
        # Lumps in the frame of this link: turned, then moved.
        turned = (turn_inertia(lump, turn) for lump in other.lumps)
        lumps = (replace(lump, com=lump.com + place) for lump in turned)
        boxes, hulls = ([corners @ turn.T + place for corners in some] for some in (other.boxes, other.hulls))
        unread = (*self.unread, *other.unread)
        return Link(self.name, (*self.lumps, *lumps), (*self.boxes, *boxes), (*self.hulls, *hulls), unread, self.joint)


@dataclass(frozen=True, eq=False)
class Connection:
    """One joint: ``rotation`` (3, 3) and ``translation`` (3,) m of the child's frame in the parent's; ``axis`` (3,)
    unit vector in the child's; ``lower``, ``upper`` rad, ``velocity`` rad/s, ``effort`` N·m (all 0 for a fixed one);
    ``frozen`` why it is held where it is at zero: "mimic" follows another joint, "idle" has neither speed nor torque.
    """

    name: str
    kind: str
    parent: str
    child: str
    rotation: Array
    translation: Array
    axis: Array = field(default_factory=_X.copy)
    lower: float = 0.0
    upper: float = 0.0
    velocity: float = 0.0
    effort: float = 0.0
    frozen: str = ""


@dataclass(frozen=True, eq=False)
class UrdfFile:
    """A robot as its file says it: ``links`` by name, ``connections`` in the order of the file."""

    path: Path
    name: str
    links: dict[str, Link]
    connections: tuple[Connection, ...]


def read_urdf_file(path: str | Path) -> UrdfFile:
    """Return what a URDF file says.

    Raises
    ------
    FileRefused
        The file cannot be read, is no URDF, or a link or joint lacks a value or has one that is not legal; the message
        names it.
    """
    path = Path(path)
    refuse_special(path)
    try:
        text = path.read_bytes()
    except OSError as error:
        raise FileRefused(
            f"{path}: cannot be read ({error.strerror or error}). Give the path of a URDF file."
        ) from error
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise FileRefused(
            f"{path}: declares XML entities, which a robot does not need and which can do harm. Remove the DOCTYPE."
        )
    try:
        root = fromstring(text)
    except ParseError as error:
        raise FileRefused(
            f"{path}: is not XML ({error}). Give a URDF file; xacro files must be expanded first."
        ) from error
    if root.tag != "robot":
        raise FileRefused(f"{path}: its first element is <{root.tag}>, expected <robot>. Give a URDF file.")
    links = [_link(path, element) for element in root.findall("link")]
    names = [link.name for link in links]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice or not links:
        raise FileRefused(
            f"{path}: {f'the link {twice[0]} occurs twice' if twice else 'has no <link>'}; every link needs a name of "
            f"its own."
        )
    joints = tuple(_connection(path, element, set(names)) for element in root.findall("joint"))
    return UrdfFile(path, root.get("name") or path.stem, dict(zip(names, links, strict=True)), joints)


def placement(path: Path, element: Element, what: str) -> tuple[Array, Array]:
    """Return rotation (3, 3) and translation (3,) m of the <origin> of ``element``; without one: no turn, no shift."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    roll, pitch, yaw = _numbers(path, origin, "rpy", what, 3, "0 0 0")
    # rpy: about fixed x, y, z in this order, so Rz Ry Rx.
    turn = elementary_rotation("z", yaw) @ elementary_rotation("y", pitch) @ elementary_rotation("x", roll)
    return turn, _numbers(path, origin, "xyz", what, 3, "0 0 0")


def _link(path: Path, element: Element) -> Link:
    name = element.get("name") or ""
    what = f"link {name!r}"
    lump, unread = _lump(path, element.find("inertial"), what), list[str]()
    lumps = () if lump is None else (lump,)
    for kind in ("collision", "visual"):
        boxes, hulls = _shapes(path, element.findall(kind), what, unread)
        if boxes or hulls:
            return Link(name, lumps, boxes, hulls)
    return Link(name, lumps, unread=tuple(unread))


def _lump(path: Path, inertial: Element | None, what: str) -> RigidInertia | None:
    if inertial is None:
        return None
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or tensor is None:
        raise FileRefused(
            f"{path}: the inertial of {what} lacks <{'mass' if mass is None else 'inertia'}>. Complete it, or remove "
            f"<inertial>."
        )
    value = _number(path, mass, "value", what)
    if value < 0:
        raise FileRefused(f"{path}: {what} has a mass of {value:g} kg; it must not be negative.")
    xx, xy, xz, yy, yz, zz = (_number(path, tensor, key, what) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    turn, com = placement(path, inertial, what)
    # From the axes of the inertial to those of the link, about the centre of mass.
    inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    return RigidInertia(value, com, inertia) if value > 0 else None


def _shapes(
    path: Path, elements: list[Element], what: str, unread: list[str]
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Return the corners (8, 3) m of the boxes around all shapes that are not meshes, and those (K, 3) m of the convex
    hulls of all meshes; why one cannot be read goes to ``unread``.
    """
    boxes, hulls = [], []
    for element in elements:
        shape = element.find("geometry/*")
        if shape is None:
            continue
        turn, place = placement(path, element, what)
        if shape.tag == "mesh":
            scale = _numbers(path, shape, "scale", what, 3, "1 1 1")
            try:
                hulls.append(_mesh_hull(mesh_file(path, shape.get("filename", "")), tuple(scale)) @ turn.T + place)
            except FileRefused as error:
                unread.append(str(error))
            continue
        if shape.tag == "box":
            half = _numbers(path, shape, "size", what, 3) / 2
        elif shape.tag in ("cylinder", "sphere"):
            radius = _number(path, shape, "radius", what)
            half = np.full(3, radius)
            half[2] = radius if shape.tag == "sphere" else _number(path, shape, "length", what) / 2
        else:
            raise FileRefused(f"{path}: {what} has the shape <{shape.tag}>; legal are box, cylinder, sphere and mesh.")
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        boxes.append(signs * half @ turn.T + place)
    return tuple(boxes), tuple(hulls)


def _connection(path: Path, element: Element, links: set[str]) -> Connection:
    name, kind = element.get("name") or "", element.get("type") or ""
    what = f"joint {name!r}"
    mimic = element.find("mimic")
    frozen = mimic is not None and kind in (*_KINDS, "prismatic")
    if kind not in _KINDS and not frozen:
        raise FileRefused(
            f"{path}: {what} is of type {kind!r}; a body has revolute, continuous and fixed joints. Make it fixed, or "
            f"remove it."
        )
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        link = end.get("link") if end is not None else None
        if link not in links:
            raise FileRefused(f"{path}: the {tag} of {what} is {link!r}, which is no link of the file. Correct it.")
        ends.append(link)
    rotation, translation = placement(path, element, what)
    fixed = Connection(name, "fixed", ends[0], ends[1], rotation, translation)
    if kind == "fixed":
        return fixed
    given = element.find("axis")
    axis = _numbers(path, given, "xyz", what, 3) if given is not None else _X
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise FileRefused(f"{path}: the axis of {what} has no direction ({axis}). Give xyz of an axis.")
    axis = axis if abs(length - 1) < 1e-12 else axis / length
    if mimic is not None:
        offset = _number(path, mimic, "offset", what) if mimic.get("offset") else 0.0
        slide, turn = (offset, 0.0) if kind == "prismatic" else (0.0, offset)
        # At rest of the joint that it copies: turned, or moved along its axis, by the offset.
        held = rotation @ axis_rotation(axis, np.array([turn]))[0]
        place = translation + slide * rotation @ axis
        return replace(fixed, rotation=held, translation=place, axis=axis, frozen="mimic")
    limits = _limits(path, element, kind, what)
    if not limits:
        return replace(fixed, axis=axis, frozen="idle")
    return Connection(name, kind, ends[0], ends[1], rotation, translation, axis, *limits)


def _limits(path: Path, element: Element, kind: str, what: str) -> tuple[float, float, float, float] | None:
    """Return lower, upper, velocity and effort of a joint; None for one drawn and never moved."""
    limit = element.find("limit")
    if limit is None:
        raise FileRefused(
            f"{path}: {what} has no <limit>; give lower and upper (rad), velocity (rad/s) and effort (N·m)."
        )
    lower, upper = (
        (-_TURN, _TURN) if kind == "continuous" else (_number(path, limit, key, what) for key in ("lower", "upper"))
    )
    velocity, effort = (_number(path, limit, key, what) for key in ("velocity", "effort"))
    if not lower <= upper:
        raise FileRefused(f"{path}: the range of {what} is {lower:g} to {upper:g} rad; lower must not exceed upper.")
    if velocity == effort == 0 and lower <= 0 <= upper:
        return None
    for key, value, unit in (("velocity", velocity, "rad/s"), ("effort", effort, "N·m")):
        if not value > 0:
            raise FileRefused(
                f"{path}: the {key} of {what} is {value:g} {unit}, with which it cannot move; give what its motor can "
                f"do."
            )
    return lower, upper, velocity, effort


def _number(path: Path, element: Element, key: str, what: str) -> float:
    return float(_numbers(path, element, key, what, 1)[0])


def _numbers(path: Path, element: Element, key: str, what: str, count: int, default: str | None = None) -> Array:
    """Return ``count`` finite numbers of an attribute (1 or 3)."""
    text = element.get(key, default)
    if text is None:
        raise FileRefused(f"{path}: <{element.tag}> of {what} lacks {key}. Add it.")
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        expected = "a finite number" if count == 1 else "three finite numbers"
        raise FileRefused(f"{path}: {key} of <{element.tag}> of {what} is {text!r}; expected {expected}.")
    return values
