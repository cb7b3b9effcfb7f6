"""A robot from its URDF file: links to segments, fixed joints merged, limits from the file, soles under the links that
are named as feet.

The root's frame is turned to x forwards, y up, z right (as the human pelvis) where the file has z up (ROS REP 103) or x
backwards. All other segments keep the frames of their links, so that a file that biodance wrote comes back as it was.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.body import parts
from biodance.body.body import Body
from biodance.body.changes import place_at_zero
from biodance.body.export import refuse_impossible
from biodance.body.similarity import (
    com_deviation,
    extended,
    is_point,
    is_possible,
    reframed,
    robot_covariance,
    solid,
)
from biodance.body.urdf_file import Connection, Link, UrdfFile, match_faces, read_urdf_file, sole_outline
from biodance.errors import BiodanceError, FileRefused, known_index
from biodance.records import SIDES, Array, Sip


def read_urdf(path: str | Path, *, feet: tuple[str, str], mend: bool = False) -> Body:
    """Return the robot of a URDF file as a Body with a free root; ``feet`` the links of its right and its left foot;
    ``mend`` takes, in place of a link that is no possible body, a solid box around its shapes, and notes it.

    Links without mass carry no segment. Prior standard deviations: those of a data sheet (`robot_prior`). Speeds,
    ranges and efforts are the file's. No markers.

    Raises
    ------
    UnknownName
        A foot is no link of the file.
    FileRefused
        The file says something that a body cannot be, or lacks something; the message names the link or joint and what
        would be legal.
    """
    file = read_urdf_file(path)
    for foot in feet:
        known_index(f"link of {file.path}", foot, tuple(file.links))
    joints, limits, carriers, owner = _tree(file)
    heavy = [carrier for carrier in carriers if carrier.lumps]
    if not carriers[0].lumps:
        raise FileRefused(
            f"{file.path}: the root link {carriers[0].name} has no mass, nor has what is fixed to it. Give it an "
            "<inertial>."
        )
    for foot in feet:
        if owner[foot] not in heavy or owner[foot] is carriers[0]:
            raise FileRefused(
                f"{file.path}: the foot {foot} has no mass or belongs to the root. Name the links that stand on the "
                f"ground."
            )
    body = _body(file, joints, limits, heavy, mend=mend)
    return _standing(file, body, {side: owner[foot] for side, foot in zip(SIDES, feet, strict=True)})


def _body(
    file: UrdfFile, joints: list[parts.Joint], limits: parts.JointLimits, heavy: list[Link], *, mend: bool
) -> Body:
    """Return the body without soles, its root as in the file; ``heavy`` the links that move and have mass."""
    segments = tuple(carrier.name for carrier in heavy)
    written = [parts.combine_inertias(*c.lumps) if len(c.lumps) > 1 else c.lumps[0] for c in heavy]
    carried = {carrier.joint: i for i, carrier in enumerate(heavy)}
    boxes = np.array([_box(carrier, lump) for carrier, lump in zip(heavy, written, strict=True)])
    lumps = [_possible(lump, box) for lump, box in zip(written, boxes, strict=True)] if mend else written
    com = np.array([lump.com for lump in lumps])[:, None]
    phi = np.concatenate([parts.inertial_parameters(lump) for lump in lumps])
    body = Body(
        file.name,
        segments,
        tuple(replace(joint, segment=carried.get(j, parts.NO_SEGMENT)) for j, joint in enumerate(joints)),
        Sip(segments, phi, np.zeros((phi.size, phi.size))),
        limits,
        parts.SegmentMarkers((), (), np.empty((0, 3)), np.empty(0)),
        boxes,
        np.concatenate([np.minimum(boxes[:, :1], com), np.maximum(boxes[:, 1:], com)], axis=1),
        notes=_notes(
            file,
            guessed=[carrier.name for carrier in heavy if not carrier.corners.size],
            points=[segment for segment, lump in zip(segments, lumps, strict=True) if is_point(lump)],
            mended=[segment for segment, old, new in zip(segments, written, lumps, strict=True) if new is not old],
        ),
    )
    try:
        refuse_impossible(body)
    except BiodanceError as error:
        raise FileRefused(f"{file.path}: {error} Or ask to mend it (--mend): a solid box in its place.") from error
    spread = [extended(lump, box) for lump, box in zip(lumps, boxes, strict=True)]
    return replace(body, sip=Sip(segments, phi, robot_covariance(spread, [com_deviation(lump) for lump in spread])))


def _possible(lump: parts.RigidInertia, box: Array) -> parts.RigidInertia:
    """Return the inertia, or that of a solid box in its place where no body of its mass can have it."""
    return solid(lump, box) if lump.mass > 0 and not is_possible(lump) else lump


def _tree(file: UrdfFile) -> tuple[list[parts.Joint], parts.JointLimits, list[Link], dict[str, Link]]:
    """Return joints, limits, the links that move with all that is fixed to them and, of every link, the one that
    carries it.
    """
    root = _root(file)
    moving, owner, frame = {root: Link(root)}, {root: root}, {root: (np.eye(3), np.zeros(3))}
    joints, rows, waiting = list[parts.Joint](), list[Connection](), _on(file, root)
    while waiting:
        c = waiting.pop(0)
        (turn, place), above = frame[c.parent], owner[c.parent]
        # Parent's frame times the joint's own placement.
        turn, place = turn @ c.rotation, place + turn @ c.translation
        if c.kind == "fixed":
            owner[c.child], frame[c.child] = above, (turn, place)
        else:
            joints.append(parts.Joint(c.name, moving[above].joint, c.axis, turn, place))
            rows.append(c)
            owner[c.child], frame[c.child] = c.child, (np.eye(3), np.zeros(3))
            moving[c.child] = Link(c.child, joint=len(joints) - 1)
        waiting = [*_on(file, c.child), *waiting]
    lost = [name for name in file.links if name not in owner]
    if lost:
        raise FileRefused(
            f"{file.path}: the link {lost[0]} does not hang on the root {root}. Correct the joints above it."
        )
    for name, link in file.links.items():
        moving[owner[name]] = moving[owner[name]].holding(link, *frame[name])
    table = np.array([[c.lower, c.upper, c.velocity, c.effort] for c in rows]).reshape(-1, 4)
    limits = parts.JointLimits(table[:, 0], table[:, 1], table[:, 2], -table[:, 3], table[:, 3])
    return joints, limits, [*moving.values()], {name: moving[carrier] for name, carrier in owner.items()}


def _root(file: UrdfFile) -> str:
    """Return the link that hangs on no other."""
    children = {connection.child for connection in file.connections}
    roots = [name for name in file.links if name not in children]
    if len(roots) != 1:
        raise FileRefused(
            f"{file.path}: {len(roots)} links have no parent ({', '.join(roots) or 'a ring'}); a robot has exactly "
            f"one root."
        )
    if len(children) < len(file.connections):
        raise FileRefused(f"{file.path}: a link is the child of two joints; a body is a tree without rings.")
    return roots[0]


def _on(file: UrdfFile, link: str) -> list[Connection]:
    return [connection for connection in file.connections if connection.parent == link]


def _box(carrier: Link, lump: parts.RigidInertia) -> Array:
    """Return the box (2, 3) m around the shapes of a segment; without any, one with its moments of inertia."""
    corners = carrier.corners
    if corners.size:
        return np.stack([corners.min(axis=0), corners.max(axis=0)])
    moments = np.diag(lump.inertia)
    # Of a solid box with half edge a: tr(I) - 2 I_x = 2 m a² / 3.
    half = np.sqrt(np.maximum(1.5 * (moments.sum() - 2 * moments) / lump.mass, 1e-6))
    return np.stack([lump.com - half, lump.com + half])


def _notes(file: UrdfFile, *, guessed: list[str], points: list[str], mended: list[str]) -> tuple[str, ...]:
    def joints(field: str, value: str) -> list[str]:
        return [connection.name for connection in file.connections if getattr(connection, field) == value]

    notes = {
        "No boxes in the file, taken from the inertia instead:": guessed,
        "Continuous joints are used within half a turn to either side:": joints("kind", "continuous"),
        "Joints that mimic others are held where these are at zero:": joints("frozen", "mimic"),
        "Joints without speed and torque are held at zero:": joints("frozen", "idle"),
        "Point masses in the file, of which the boxes say how sure they are:": points,
        "Mended, since no body has their mass, centre and inertia: solid boxes in place of": mended,
    }
    return tuple(f"{sentence} {', '.join(names)}." for sentence, names in notes.items() if names)


def _standing(file: UrdfFile, body: Body, feet: dict[str, Link]) -> Body:
    """Return the body with its soles, its root in ISB axes."""
    place = {side: place_at_zero(body, carrier.joint) for side, carrier in feet.items()}
    below = np.mean([position for _, position in place.values()], axis=0)
    axis = int(np.argmax(np.abs(below)))
    if axis == 0 or below[axis] > 0:
        raise FileRefused(
            f"{file.path}: at zero joint angles the feet are at {np.round(below, 3)} m from the root; the root must "
            "have x forwards and y or z up, and the robot must stand upright at zero angles."
        )
    up, ahead = np.eye(3)[axis], np.eye(3)[0]
    # the root's x axis points backwards (iCub) where along it the foot that is named right is on the left
    crossed = float((place["right"][1] - place["left"][1]) @ np.cross(ahead, up)) < 0
    one, other = (feet[side].name.lower() for side in SIDES)
    pairs = (("right", "left"), ("r_", "l_"), ("_r", "_l"))
    if crossed and any(this in one and one.replace(this, that) == other for this, that in pairs):
        ahead = -ahead
    sideways = np.cross(ahead, up)
    axes, soles = np.stack([ahead, up, sideways]), {}
    for side, carrier in feet.items():
        if not carrier.corners.size:
            why = f"of its meshes {carrier.unread[0]}" if carrier.unread else "it has no shape"
            raise FileRefused(
                f"{file.path}: the {side} foot {carrier.name} shows no sole, since {why}. Give it a collision <box>."
            )
        where = f"{file.path}: the foot {carrier.name}"
        soles[side] = sole_outline(where, carrier.boxes, carrier.hulls, axes @ place[side][0])
    soles["right"], soles["left"] = match_faces(soles["right"], soles["left"])
    right, left = (float(place[side][1] @ sideways) for side in SIDES)
    if not right > left:
        raise FileRefused(
            f"{file.path}: {feet['right'].name} stands left of {feet['left'].name}; name the right foot first, then "
            f"the left one."
        )
    standing = replace(body, feet={side: parts.Foot(body.segment_index(feet[side].name), soles[side]) for side in feet})
    return standing if np.array_equal(axes, np.eye(3)) else reframed(standing, 0, axes.T, np.zeros(3))
