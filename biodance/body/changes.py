"""The same body with one thing elsewhere: a joint, a length, a marker, or a segment cut in two by another joint, the
piece a segment of its own or a part of the whole.
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
    SegmentMarkers,
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
    # turn is parent_R_child along the chain; transposed child_R_parent.
    return np.asarray(turn.T)


_RANGE, _SPEED, _TORQUE = 1.2, 10.0, 100.0
"""rad either way, rad/s, N·m: wide enough for any joint that is put in to follow markers."""
_SPLIT = 0.2
"""Relative standard deviation of the lighter part: what a cut leaves on which side (assumed; a vertebra up or down)."""
_GRAM, _GYRATION = 1e-3, 0.03
"""kg and m: mass and radius of gyration of a part to which nothing is assigned, so that it has a centre of mass."""
_FLAT, _MOST = 1e-9, 0.95
"""Share of a pseudo-inertia's largest eigenvalue that counts as none, and of a whole that a part may take."""
_TRACE = 1e-4
"""Share of a segment's mass of a `Part` to which nothing is assigned (a collar bone): model formats refuse none."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Where ``segment`` is cut.

    The new segment ``name`` turns about ``axes`` (name -> (3,) unit vector), one after the other, through ``place``
    (3,) m; it takes the ten parameters ``phi`` (10,), the ``markers`` and the ``joints`` (indices of first axes) named.
    All in the frame of the cut segment. A segment that takes no matter (``phi`` zero) is given a gram at ``place``, so
    that it has a centre of mass.
    """

    segment: str
    name: str
    axes: dict[str, Array]
    place: Array
    phi: Array
    markers: tuple[str, ...]
    joints: tuple[int, ...] = field(default=())


def branch_off(body: Body, cut: Cut) -> Body:
    """Return the body with the cut's joint, at zero angle the same as before; the new segment keeps the frame of the
    old one.

    The new joints follow the segment's own in ``Body.joints``; the new segment is the last one.
    """
    if not cut.phi.any():
        cut = replace(cut, phi=_GRAM * inertial_parameters(RigidInertia(1.0, cut.place, _GYRATION**2 * np.eye(3))))
    old, new = body.segment_index(cut.segment), len(body.segments)
    names = (*body.segments, cut.name)
    return replace(
        _jointed(_room_for(body, cut), cut, old, new),
        segments=names,
        sip=_sip(body, cut, names),
        boxes=np.concatenate([body.boxes, body.boxes[[old]] - cut.place]),
        com_boxes=_com_boxes(body, cut),
        notes=(*body.notes, f"{cut.name} moves on {cut.segment}."),
        at_joint=None,
    )


def with_part(body: Body, cut: Cut) -> Body:
    """Return the body with the cut's joint, at zero angle the same as before; what is cut off is a `Part` of its
    segment, the last one. A part that takes no matter takes a ten-thousandth.
    """
    segment, phi = body.segment_index(cut.segment), cut.phi
    # In the part's own frame (origin at its joint), per kilogram of the whole.
    share = shift_matter(-cut.place) @ phi / body.sip.phi[10 * segment]
    if not phi.any():
        share = _TRACE * inertial_parameters(RigidInertia(1.0, np.zeros(3), _GYRATION**2 * np.eye(3)))
    jointed = _jointed(body, cut, segment, len(body.links))
    return replace(jointed, parts=(*body.parts, Part(cut.name, segment, share)))


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
            own, boxes[part.segment] = (high, low) if part.share[2] > 0 else (low, high)
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
    root = np.sqrt(np.maximum(value, _FLAT * value[-1]))
    # Share of the part in each direction: W^-1/2 P W^-1/2.
    share = (vector / root).T @ pseudo_inertia(own)[0] @ (vector / root)
    level, axes = np.linalg.eigh(share)
    # Limited to `_MOST` in each of its own directions, and back to units of mass.
    less = (vector * root) @ (axes * np.minimum(level, _MOST)) @ axes.T @ (vector * root).T
    # Ten parameters from a symmetric 4 x 4 matrix that the map can make: exact.
    left = np.linalg.lstsq(PSEUDO_INERTIA, less.ravel(), rcond=None)[0]
    phi[rows[0]] += own - left
    phi[rows[1]] = np.linalg.solve(moved, left)


def _room_for(body: Body, cut: Cut) -> Body:
    """Return the body with room for one more segment before its parts; parts on cut joints are its pieces."""
    count, gone = len(body.segments), float(cut.phi[0] / body.sip.phi[10 * body.segment_index(cut.segment)])
    parts = []
    for k, part in enumerate(body.parts):
        first = body.segment_joint[count + k]  # of the chain from the segment that the part hangs on
        above = body.joints[first].parent
        while above >= 0 and not 0 <= body.joints[above].segment < count:
            first, above = above, body.joints[above].parent
        moved = Part(part.name, count, part.share / gone)
        # The share was per kilogram of the whole: its whole has now this share of the old mass.
        stays = Part(part.name, part.segment, part.share / (1 - gone))
        cut_here = body.segments[part.segment] == cut.segment
        parts.append(moved if first in cut.joints else stays if cut_here else part)
    joints = tuple(replace(j, segment=j.segment + (j.segment >= count)) for j in body.joints)
    worn = tuple(s + (s >= count) for s in body.markers.segment)
    return replace(body, parts=tuple(parts), joints=joints, markers=replace(body.markers, segment=worn))


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
    wide = {"lower": -_RANGE, "upper": _RANGE, "velocity": _SPEED, "torque_lower": -_TORQUE, "torque_upper": _TORQUE}
    limits = {
        key: np.insert(getattr(body.limits, key), first, np.full(count, value, dtype=float))
        for key, value in wide.items()
    }
    joints = (*shifted[:first], *added, *shifted[first:])
    return replace(body, joints=joints, limits=JointLimits(**limits), markers=_markers(body, cut, new))


def _sip(body: Body, cut: Cut, names: tuple[str, ...]) -> Sip:
    """Return the parameters of both parts."""
    old = slice(10 * body.segment_index(cut.segment), 10 * body.segment_index(cut.segment) + 10)
    whole, moved = body.sip.phi[old], shift_matter(-cut.place)
    rest, part, split = whole - cut.phi, np.zeros((10, 10)), np.zeros(10)
    if cut.phi[0] > _GRAM:
        share = cut.phi[0] / whole[0]
        # Splits in proportion to the mass, so that part @ whole = cut.phi at the table's whole.
        part = share * np.eye(10) + np.outer(cut.phi - share * whole, np.eye(10)[0]) / whole[0]
        split = _SPLIT * (cut.phi if cut.phi[0] < rest[0] else rest)
    spread = np.eye(body.sip.phi.size + 10, body.sip.phi.size)
    # Covariance of [rest, part] = [1 - part, part] times that of the whole.
    spread[old, old], spread[-10:, old] = np.eye(10) - part, moved @ part
    across = np.zeros(len(spread))
    # What the cut itself leaves unsure goes from one side to the other: opposite signs.
    across[old], across[-10:] = -split, moved @ split
    phi = np.concatenate([body.sip.phi, moved @ cut.phi])
    phi[old] = rest
    return Sip(names, phi, spread @ body.sip.covariance @ spread.T + np.outer(across, across))


def _com_boxes(body: Body, cut: Cut) -> Array:
    """Return (N + 1, 2, 3) m: each part has the room of the whole about its own centre of mass."""
    old = body.segment_index(cut.segment)
    whole = body.sip.phi[10 * old : 10 * old + 10]
    kept, gone = (part[1:4] / part[0] - whole[1:4] / whole[0] for part in (whole - cut.phi, cut.phi))
    boxes = np.concatenate([body.com_boxes, body.com_boxes[[old]] + gone - cut.place])
    boxes[old] += kept
    return boxes


def _markers(body: Body, cut: Cut, new: int) -> SegmentMarkers:
    on = np.array([name in cut.markers for name in body.markers.names])
    segment = tuple(new if moved else s for moved, s in zip(on, body.markers.segment, strict=True))
    return replace(
        body.markers, segment=segment, position=body.markers.position - np.where(on[:, None], cut.place, 0.0)
    )
