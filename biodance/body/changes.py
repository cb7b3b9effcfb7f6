"""The same body with one thing elsewhere: a joint, a length, a marker, or a segment of which a part moves on a joint of
its own.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import (
    PSEUDO_INERTIA,
    Joint,
    JointLimits,
    Part,
    RigidInertia,
    inertial_parameters,
    pseudo_inertia,
    shift_matter,
    smallest_eigenvalues,
)
from biodance.records import Array, Sip


def place_at_zero(body: Body, joint: int) -> tuple[Array, Array]:
    """Return turn (3, 3) and place (3,) m of a joint's frame in the root's at zero angles."""
    turn, place = np.eye(3), np.zeros(3)
    while joint >= 0:
        one = body.joints[joint]
        # From the joint inwards: each frame is written in its parent's until the root is reached.
        turn, place, joint = one.rotation @ turn, one.translation + one.rotation @ place, one.parent
    return turn, place


def written_in(body: Body, segment: int, turn: Array, shift: Array) -> Body:
    """Return the body with all that is written in the frame of one segment written in a frame with the axes ``turn``
    (3, 3) = old_R_new and the origin ``shift`` (3,) m in the old one: parameters with covariance, the joints that hang
    on it, markers, boxes, soles. Its own joint, and with it the place of all these, is the caller's.
    """
    carrier = body.segment_joint[segment]
    joints = tuple(
        replace(joint, rotation=turn.T @ joint.rotation, translation=turn.T @ (joint.translation - shift))
        if joint.parent == carrier
        else joint
        for joint in body.joints
    )
    ten, table = slice(10 * segment, 10 * segment + 10), np.eye(body.sip.phi.size)
    # Matter in the new frame: x_new = turn' (x_old - shift).
    table[ten, ten] = shift_matter(-turn.T @ shift, turn.T)
    feet = {
        side: replace(foot, outline=(foot.outline - shift) @ turn) if foot.segment == segment else foot
        for side, foot in body.feet.items()
    }
    on = (np.array(body.markers.segment, dtype=int) == segment)[:, None]
    # Rows times turn are turn' applied to each place.
    place = np.where(on, (body.markers.position - shift) @ turn, body.markers.position)
    boxes, com_boxes = np.array(body.boxes), np.array(body.com_boxes)
    for some in (boxes, com_boxes):
        low, high = some[segment] - shift
        # A box in turned axes: the smallest one around its eight corners.
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        some[segment] = (corners @ turn).min(axis=0), (corners @ turn).max(axis=0)
    return replace(
        body,
        joints=joints,
        # phi -> T phi, covariance -> T C T'.
        sip=Sip(body.segments, table @ body.sip.phi, table @ body.sip.covariance @ table.T),
        markers=replace(body.markers, position=place),
        boxes=boxes,
        com_boxes=com_boxes,
        feet=feet,
    )


def move_joint(body: Body, joint: int, shift: Array) -> Body:
    """Return the body with ``joint`` moved by ``shift`` (3,) m in its parent's frame, with all that hangs on it."""
    joints = list(body.joints)
    joints[joint] = replace(joints[joint], translation=joints[joint].translation + np.asarray(shift))
    return replace(body, joints=tuple(joints))


def recentre_joint(body: Body, joint: int, shift: Array) -> Body:
    """Return the body whose ``joint`` turns about a point ``shift`` (3,) m away (in its parent's frame), while in the
    neutral posture matter, markers and all other joints stay where they are.
    """
    # child_R_parent of the neutral posture: the joint's shift in the child's axes.
    segment, back = carried_by(body, joint), -neutral_turn(body, joint) @ np.asarray(shift)
    return written_in(move_joint(body, joint, shift), segment, np.eye(3), -back)


def move_marker(body: Body, name: str, shift: Array) -> Body:
    """Return the body with the marker ``name`` moved by ``shift`` (3,) m in the axes of its segment."""
    place = np.array(body.markers.position)
    place[body.markers.names.index(name)] += shift
    return replace(body, markers=replace(body.markers, position=place))


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
    # turn is parent_R_child along the chain; transposed child_R_parent.
    return np.asarray(turn.T)


_TRACE = 1e-4
"""Share of a segment's mass of a `Part` to which nothing is assigned (a collar bone): model formats refuse none."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Where ``segment`` is cut.

    The part ``name`` turns about ``axes`` (name -> (3,) unit vector), one after the other, through ``place`` (3,) m; it
    takes the ten parameters ``phi`` (10,), the ``markers`` and the ``joints`` (indices of first axes) named. All in the
    frame of the cut segment.
    """

    segment: str
    name: str
    axes: dict[str, Array]
    place: Array
    phi: Array
    markers: tuple[str, ...]
    joints: tuple[int, ...] = field(default=())


def with_part(body: Body, cut: Cut, *, rest_moves: bool = False) -> Body:
    """Return the body with the cut's joint, at zero angle the same as before; what is cut off is a `Part` of its
    segment, the last one. A part that takes no matter takes a ten-thousandth; where the ``rest_moves``, the parameters
    of the cut are of what stays.
    """
    segment = body.segment_index(cut.segment)
    # Per kilogram of the whole; what moves in its own frame (origin at its joint).
    share = (cut.phi if rest_moves else shift_matter(-cut.place) @ cut.phi) / body.sip.phi[10 * segment]
    if not cut.phi.any():
        # 0.03 m: radius of gyration of a part to which nothing is assigned
        share = _TRACE * inertial_parameters(RigidInertia(1.0, np.zeros(3), 0.03**2 * np.eye(3)))
    jointed = _jointed(body, cut, segment, len(body.links))
    return replace(jointed, parts=(*body.parts, Part(cut.name, segment, share, rest_moves)))


def with_axis(body: Body, after: str, name: str, axis: Array) -> Body:
    """Return the body whose segment on the joint ``after`` turns, behind it, about ``axis`` (3,) through its origin,
    too: the joint ``name``, at zero angle the same as before.
    """
    k = body.joint_index(after)
    old = body.joints[k]
    jointed = _jointed(body, Cut("", "", {name: axis}, np.zeros(3), np.zeros(10), ()), old.segment, old.segment)
    joints = [j if j.parent != k or i == k + 1 else replace(j, parent=k + 1) for i, j in enumerate(jointed.joints)]
    joints[k] = replace(joints[k], segment=-1)
    return replace(jointed, joints=tuple(joints))


def parts_as_segments(body: Body) -> Body:
    """Return the same body whose parts are segments like the others, behind them, each with its own parameters; as it
    is without parts.

    Where a whole is so unlike the table that no rest could be left of it, the part has less.
    """
    table, count = body.sharing, len(body.segments)
    if table is None:
        return body
    phi = table @ body.sip.phi
    boxes, rooms = list(body.boxes), list(body.com_boxes)
    for k, part in enumerate(body.parts):
        _, origin = body.place_on_segment(body.segment_joint[count + k])
        whole, own = boxes[part.segment], np.zeros((2, 3))
        if part.share[0] > _TRACE:
            low, high = np.array(whole), np.array(whole)
            # Along the segment's y axis the joint's height divides the box between part and rest.
            low[1, 1] = high[0, 1] = np.clip(origin[1], *whole[:, 1])
            above = part.rest_moves or part.share[2] > 0
            own, boxes[part.segment] = (high, low) if above else (low, high)
            own = own - origin
        boxes.append(own)
        rooms.append(own)
        _leave_possible(phi, part.segment, count + k, shift_matter(origin))
    along = body.at_joint
    return replace(
        body,
        segments=body.links,
        parts=(),
        sip=Sip(body.links, phi, table @ body.sip.covariance @ table.T),
        at_joint=along and Sip(body.links, table @ along.phi, table @ along.covariance @ table.T),
        boxes=np.array(boxes),
        com_boxes=np.array(rooms),
    )


def _leave_possible(phi: Array, rest: int, part: int, moved: Array) -> None:
    """Take from the part what the rest of its segment lacks to be made of real mass."""
    rows = [slice(10 * i, 10 * i + 10) for i in (rest, part)]
    if smallest_eigenvalues(phi[rows[0]])[0] > 0:
        return
    own = moved @ phi[rows[1]]
    # Of W = rest + part, V and E^1/2 with W = V E V': in these units the whole is 1.
    value, vector = np.linalg.eigh(pseudo_inertia(phi[rows[0]] + own)[0])
    root = np.sqrt(np.maximum(value, 1e-9 * value[-1]))  # a smaller share of the largest is none
    # Share of the part in each direction: W^-1/2 P W^-1/2.
    share = (vector / root).T @ pseudo_inertia(own)[0] @ (vector / root)
    level, axes = np.linalg.eigh(share)
    # Limited to 95 % of the whole in each of its own directions, and back to units of mass.
    less = (vector * root) @ (axes * np.minimum(level, 0.95)) @ axes.T @ (vector * root).T
    # Ten parameters from a symmetric 4 x 4 matrix that the map can make: exact.
    left = np.linalg.lstsq(PSEUDO_INERTIA, less.ravel(), rcond=None)[0]
    phi[rows[0]] += own - left
    phi[rows[1]] = np.linalg.solve(moved, left)


def _jointed(body: Body, cut: Cut, old: int, new: int) -> Body:
    """Return the body with the cut's joints and limits, and its markers on the link ``new`` instead of ``old``."""
    first, count = body.segment_joint[old] + 1, len(cut.axes)
    added = []
    for k, (name, axis) in enumerate(cut.axes.items()):
        place = cut.place if k == 0 else np.zeros(3)
        added.append(Joint(name, first - 1 + k, axis, np.eye(3), place, new if k == count - 1 else -1))
    shifted = [j if j.parent < first else replace(j, parent=j.parent + count) for j in body.joints]
    for index in cut.joints:
        moved = body.joints[index]
        shifted[index] = replace(moved, parent=first + count - 1, translation=moved.translation - cut.place)
    # rad, rad/s, N·m: wide enough for any joint that is put in to follow markers
    wide = {"lower": -1.2, "upper": 1.2, "velocity": 10.0, "torque_lower": -100.0, "torque_upper": 100.0}
    limits = {
        key: np.insert(getattr(body.limits, key), first, np.full(count, value, dtype=float))
        for key, value in wide.items()
    }
    joints = (*shifted[:first], *added, *shifted[first:])
    on = np.array([name in cut.markers for name in body.markers.names])
    segments = tuple(new if moved else s for moved, s in zip(on, body.markers.segment, strict=True))
    places = body.markers.position - np.where(on[:, None], cut.place, 0.0)
    worn = replace(body.markers, segment=segments, position=places)
    return replace(body, joints=joints, limits=JointLimits(**limits), markers=worn)
