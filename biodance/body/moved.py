"""The same body with a joint or a marker elsewhere: what a wrong joint centre, length or marker means."""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body, SegmentMarkers
from biodance.body.inertia import PSEUDO_INERTIA
from biodance.records import Array, Sip


def move_joint(body: Body, joint: int, shift: Array) -> Body:
    """Return the body with the origin of ``joint`` (an index) moved by ``shift`` (3,) m in its parent's frame; all that hangs on it goes
    along.
    """
    joints = list(body.joints)
    joints[joint] = replace(joints[joint], translation=joints[joint].translation + np.asarray(shift))
    return replace(body, joints=tuple(joints))


def recentre_joint(body: Body, joint: int, shift: Array) -> Body:
    """Return the body whose ``joint`` turns about a point ``shift`` (3,) m away (in its parent's frame), while in the neutral posture
    matter, markers and all other joints stay where they are.
    """
    segment, back = carried_by(body, joint), -neutral_turn(body, joint) @ np.asarray(shift)
    moved = move_joint(body, joint, shift)
    last = body.segment_joint[segment]
    joints = tuple(replace(j, translation=j.translation + back) if j.parent == last else j for j in moved.joints)
    on = np.array(body.markers.segment) == segment
    markers = replace(body.markers, position=body.markers.position + np.where(on[:, None], back, 0.0))
    ten, table = slice(10 * segment, 10 * segment + 10), np.eye(body.sip.phi.size)
    table[ten, ten] = displaced(back)
    sip = Sip(body.segments, table @ body.sip.phi, table @ body.sip.covariance @ table.T)
    here = (np.arange(len(body.segments)) == segment)[:, None, None]
    boxes, com_boxes = (np.where(here, box + back, box) for box in (body.boxes, body.com_boxes))
    feet = {side: replace(foot, outline=foot.outline + back) if foot.segment == segment else foot for side, foot in body.feet.items()}
    return replace(moved, joints=joints, markers=markers, sip=sip, boxes=boxes, com_boxes=com_boxes, feet=feet)


def move_marker(body: Body, name: str, shift: Array) -> Body:
    """Return the body with the marker ``name`` moved by ``shift`` (3,) m in the axes of its segment."""
    place = np.array(body.markers.position)
    place[body.markers.names.index(name)] += shift
    return replace(body, markers=SegmentMarkers(body.markers.names, body.markers.segment, place, body.markers.weight))


def carried_by(body: Body, joint: int) -> int:
    """Return the segment that the compound joint beginning with ``joint`` carries."""
    while body.joints[joint].segment < 0:
        joint = next(i for i, other in enumerate(body.joints) if other.parent == joint)
    return body.joints[joint].segment


def neutral_turn(body: Body, joint: int) -> Array:
    """Return child_R_parent (3, 3) of the compound joint beginning with ``joint``, at zero angles."""
    turn, last = body.joints[joint].rotation, body.segment_joint[carried_by(body, joint)]
    while joint != last:
        joint = next(i for i, other in enumerate(body.joints) if other.parent == joint)
        turn = turn @ body.joints[joint].rotation
    return np.asarray(turn.T)


def displaced(shift: Array) -> Array:
    """Return the map (10, 10) of the ten parameters when all matter moves by ``shift`` (3,) m in the segment's frame."""
    move = np.eye(4)
    move[:3, 3] = shift
    return np.asarray(np.linalg.lstsq(PSEUDO_INERTIA, np.kron(move, move) @ PSEUDO_INERTIA, rcond=None)[0])
