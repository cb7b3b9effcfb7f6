"""A body with one segment cut in two by a joint that the model in use does not have: neck, thorax, clavicle."""

from dataclasses import dataclass, field, replace

import numpy as np

from biodance.body.body import Body, Joint, JointLimits
from biodance.records import Array, Sip

RANGE, SPEED, TORQUE = 1.2, 10.0, 100.0
"""rad either way, rad/s, N·m: wide enough for any joint that is put in to follow markers."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Where ``segment`` is cut.

    The new segment ``name`` turns about ``axes`` (name -> (3,) unit vector), one after the other, through ``place`` (3,) m; it takes the
    ten parameters ``phi`` (10,), the ``markers`` and the ``joints`` (indices of first axes) named. All in the frame of the cut segment.
    """

    segment: str
    name: str
    axes: dict[str, Array]
    place: Array
    phi: Array
    markers: tuple[str, ...]
    joints: tuple[int, ...] = field(default=())


def branch_off(body: Body, cut: Cut) -> Body:
    """Return the body with the cut's joint, at zero angle the same as before; the new segment keeps the frame of the old one.

    The new joints follow the segment's own in ``Body.joints``; the new segment is the last one.
    """
    old = body.segment_index(cut.segment)
    first, count = body.segment_joint[old] + 1, len(cut.axes)
    new = []
    for k, (name, axis) in enumerate(cut.axes.items()):
        place = cut.place if k == 0 else np.zeros(3)
        new.append(Joint(name, first - 1 + k, axis, np.eye(3), place, len(body.segments) if k == count - 1 else -1))
    shifted = [j if j.parent < first else replace(j, parent=j.parent + count) for j in body.joints]
    for index in cut.joints:
        moved = body.joints[index]
        shifted[index] = replace(moved, parent=first + count - 1, translation=moved.translation - cut.place)
    names, limits = (*body.segments, cut.name), body.limits
    extended = replace(
        body,
        segments=names,
        joints=(*shifted[:first], *new, *shifted[first:]),
        sip=_sip(body, cut, names),
        limits=JointLimits(
            **{
                key: np.insert(getattr(limits, key), first, np.full(count, value))
                for key, value in (
                    ("lower", -RANGE), ("upper", RANGE), ("velocity", SPEED), ("torque_lower", -TORQUE), ("torque_upper", TORQUE)
                )
            }
        ),
        markers=_markers(body, cut),
        boxes=np.concatenate([body.boxes, body.boxes[[old]] - cut.place]),
        com_boxes=np.concatenate([body.com_boxes, body.com_boxes[[old]] - cut.place]),
        notes=(*body.notes, f"{cut.name} moves on {cut.segment}."),
    )  # fmt: skip
    return extended


def _sip(body: Body, cut: Cut, names: tuple[str, ...]) -> Sip:
    from biodance.body.moved import displaced

    ten = 10 * body.segment_index(cut.segment)
    phi = np.concatenate([body.sip.phi, displaced(-cut.place) @ cut.phi])
    phi[ten : ten + 10] -= cut.phi
    covariance = np.zeros((phi.size, phi.size))
    covariance[:-10, :-10] = body.sip.covariance
    return Sip(names, phi, covariance)


def _markers(body: Body, cut: Cut):  # type: ignore[no-untyped-def]
    on = np.array([name in cut.markers for name in body.markers.names])
    segment = tuple(len(body.segments) if moved else s for moved, s in zip(on, body.markers.segment, strict=True))
    return replace(body.markers, segment=segment, position=body.markers.position - np.where(on[:, None], cut.place, 0.0))
