"""A body with one segment cut in two by a joint that the model in use does not have: neck, thorax, clavicle."""

from dataclasses import dataclass, field, replace

import numpy as np

from biodance.body.body import Body, Joint, JointLimits
from biodance.body.inertia import Lump, parameters
from biodance.body.moved import displaced
from biodance.records import Array, Sip

RANGE, SPEED, TORQUE = 1.2, 10.0, 100.0
"""rad either way, rad/s, N·m: wide enough for any joint that is put in to follow markers."""
SPLIT = 0.2
"""Relative standard deviation of the lighter part: how well is known what a cut leaves on which side (assumed; a vertebra up or down)."""
GRAM, GYRATION = 1e-3, 0.03
"""kg and m: mass and radius of gyration of a part to which nothing is assigned, so that it has a centre of mass."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Where ``segment`` is cut.

    The new segment ``name`` turns about ``axes`` (name -> (3,) unit vector), one after the other, through ``place`` (3,) m; it takes the
    ten parameters ``phi`` (10,), the ``markers`` and the ``joints`` (indices of first axes) named. All in the frame of the cut segment.
    A segment that takes no matter (``phi`` zero) is given a gram at ``place``, so that it has a centre of mass.
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
    if not cut.phi.any():
        cut = replace(cut, phi=GRAM * parameters(Lump(1.0, cut.place, GYRATION**2 * np.eye(3))))
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
        com_boxes=_com_boxes(body, cut),
        notes=(*body.notes, f"{cut.name} moves on {cut.segment}."),
    )  # fmt: skip
    return extended


def _sip(body: Body, cut: Cut, names: tuple[str, ...]) -> Sip:
    """Return the parameters of both parts.

    If the whole is heavier than thought, both are in proportion; what else it may be off by they share by mass; and what one has more at
    the cut, the other has less. Nothing of this for a gram.
    """
    old = slice(10 * body.segment_index(cut.segment), 10 * body.segment_index(cut.segment) + 10)
    whole, moved = body.sip.phi[old], displaced(-cut.place)
    rest, part, split = whole - cut.phi, np.zeros((10, 10)), np.zeros(10)
    if cut.phi[0] > GRAM:
        share = cut.phi[0] / whole[0]
        part = share * np.eye(10) + np.outer(cut.phi - share * whole, np.eye(10)[0]) / whole[0]
        split = SPLIT * (cut.phi if cut.phi[0] < rest[0] else rest)
    spread = np.eye(body.sip.phi.size + 10, body.sip.phi.size)
    spread[old, old], spread[-10:, old] = np.eye(10) - part, moved @ part
    across = np.zeros(len(spread))
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


def _markers(body: Body, cut: Cut):  # type: ignore[no-untyped-def]
    on = np.array([name in cut.markers for name in body.markers.names])
    segment = tuple(len(body.segments) if moved else s for moved, s in zip(on, body.markers.segment, strict=True))
    return replace(body.markers, segment=segment, position=body.markers.position - np.where(on[:, None], cut.place, 0.0))
