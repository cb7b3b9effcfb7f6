"""The frame of a segment: where it lies at zero angles, and the same body written in another one."""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.body.inertia import shift_matter
from biodance.records import Array, Sip


def place_at_zero(body: Body, joint: int) -> tuple[Array, Array]:
    """Return turn (3, 3) and place (3,) m of a joint's frame in the root's at zero angles."""
    turn, place = np.eye(3), np.zeros(3)
    while joint >= 0:
        one = body.joints[joint]
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
    table[ten, ten] = shift_matter(-turn.T @ shift, turn.T)
    feet = {
        side: replace(foot, outline=(foot.outline - shift) @ turn) if foot.segment == segment else foot
        for side, foot in body.feet.items()
    }
    on = (np.array(body.markers.segment, dtype=int) == segment)[:, None]
    place = np.where(on, (body.markers.position - shift) @ turn, body.markers.position)
    boxes, com_boxes = np.array(body.boxes), np.array(body.com_boxes)
    for some in (boxes, com_boxes):
        low, high = some[segment] - shift
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        some[segment] = (corners @ turn).min(axis=0), (corners @ turn).max(axis=0)
    return replace(
        body,
        joints=joints,
        sip=Sip(body.segments, table @ body.sip.phi, table @ body.sip.covariance @ table.T),
        markers=replace(body.markers, position=place),
        boxes=boxes,
        com_boxes=com_boxes,
        feet=feet,
    )
