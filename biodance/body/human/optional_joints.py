"""Joints that a body has only where the markers of a session show them: neck, collar bones, turning forearms, wrists.
The twelve segments stay what is identified.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import Cut, with_axis, with_part
from biodance.body.human.skeleton import kind_of
from biodance.body.inertia import RigidInertia, inertial_parameters
from biodance.body.parts import Joint
from biodance.body.tables.anthropometry import read_table, row_numbers
from biodance.body.tables.segment_data import read_segment_table
from biodance.records import SIDES, Array

_NECK = 0.41
"""Height, between shoulders and vertex, about which the head turns: the angle of the jaw (de Leva 1996: 0.39 men, 0.45
women). Nodding is shared by all of the neck; about its base the head's weight would move twice as far as it does in
virtual persons.
"""
_STERNOCLAVICULAR = np.array([0.2, 0.0, 0.12])
"""Forwards, upwards and sideways from the middle of the shoulders, in half shoulder widths."""
OPTIONAL_JOINTS = ("neck", "forearms", "wrists", "clavicles")
"""The joints that a body may have beyond its 23 axes."""
_ACROMION = 0.5
"""Half shoulder widths from the shoulder's centre: so near, markers of the trunk ride on the collar bone."""
_BEYOND_WRIST = 0.03  # m: markers of the forearm so far beyond the wrist are worn on the hand
_HEAD_MARKERS = 3


def with_optional(body: Body, name: str, landmarks: Mapping[str, tuple[tuple[str, ...], ...]]) -> Body:
    """Return the body with one of the `OPTIONAL_JOINTS`, on every side whose markers can show it; as it is without such
    markers.

    ``landmarks`` of its marker set: which labels mark the wrists.
    """
    if name == "neck":
        return _with_neck(body)
    for side in SIDES:
        if name == "clavicles":
            body = _with_clavicle(body, side)
        elif name == "forearms":
            body = _with_pronation(body, side, landmarks)
        else:
            body = _with_wrist(body, side, landmarks)
    return body


def neck_and_vertex(body: Body) -> tuple[Array, Array] | None:
    """Return where the head turns and where it ends, (3,) m in the trunk's frame; None for a body without shoulders."""
    middle = shoulders(body)
    if middle is None:
        return None
    vertex = np.array([middle[0], body.boxes[body.segment_index("trunk_head"), 1, 1], 0.0])
    return middle + _NECK * (vertex - middle), vertex


def sternoclavicular(body: Body, side: str) -> Array:
    """Return the inner end of a collar bone, (3,) m in the trunk's frame, of a body with shoulders."""
    middle = shoulders(body)
    assert middle is not None
    _, shoulder = body.place_on_segment(body.joint_index(f"{side}_shoulder_flexion"))
    return np.asarray(
        middle + abs(float(shoulder[2])) * _STERNOCLAVICULAR * [1.0, 1.0, 1.0 if side == "right" else -1.0]
    )


def shoulders(body: Body) -> Array | None:
    """Return the middle (3,) m between the shoulder joints in the trunk's frame; None for a body without them."""
    joints = [i for i, joint in enumerate(body.joints) if joint.name.endswith("shoulder_flexion")]
    if len(joints) != 2 or "trunk_head" not in body.segments:
        return None
    return np.mean([body.place_on_segment(i)[1] for i in joints], axis=0)


def share_of_body(body: Body, segment: str, *, top: Array, bottom: Array) -> Array:
    """Return the ten parameters (10,) of a part between ``bottom`` and ``top`` (3,) m, by its name in de Leva's table
    (mean of women and men), in the frame of the two points; masses in proportion to the body's.
    """
    table = read_segment_table("de_leva_1996")
    rows = [
        (
            table.value(segment, "mass", sex=sex),
            table.value(segment, "com", "longitudinal", sex=sex),
            *table.values(segment, "gyration", "sagittal transverse longitudinal", sex=sex),
        )
        for sex in ("F", "M")
    ]
    fraction, place, sagittal, transverse, along = np.mean(rows, axis=0)
    mass, length = fraction * float(body.sip.mass.sum()), float(np.linalg.norm(top - bottom))
    inertia = mass * length**2 * np.diag([sagittal**2, along**2, transverse**2])
    return inertial_parameters(RigidInertia(mass, top + place * (bottom - top), inertia))


def _with_neck(body: Body) -> Body:
    places = neck_and_vertex(body)
    if places is None:
        return body
    neck, vertex = places
    seen = _worn(body, "trunk_head", body.markers.position[:, 1] > neck[1])
    if len(seen) < _HEAD_MARKERS:
        return body
    head = share_of_body(body, "head", top=vertex, bottom=neck)
    return _ranged(with_part(body, Cut("trunk_head", "head", _axes("neck"), neck, head, seen)))


def _with_clavicle(body: Body, side: str) -> Body:
    if shoulders(body) is None:
        return body
    shoulder = body.joint_index(f"{side}_shoulder_flexion")
    _, centre = body.place_on_segment(shoulder)
    seen = _worn(
        body, "trunk_head", np.linalg.norm(body.markers.position - centre, axis=1) < _ACROMION * abs(centre[2])
    )
    if not seen:
        return body
    place, axes = sternoclavicular(body, side), _axes("clavicle", side)
    return _ranged(with_part(body, Cut("trunk_head", f"{side}_clavicle", axes, place, np.zeros(10), seen, (shoulder,))))


def _with_pronation(body: Body, side: str, landmarks: Mapping[str, tuple[tuple[str, ...], ...]]) -> Body:
    if _wrist(body, side, landmarks) is None:
        return body
    ((name, axis),) = _axes("elbow", side).items()
    return _ranged(with_axis(body, f"{side}_elbow_flexion", name, axis))


def _with_wrist(body: Body, side: str, landmarks: Mapping[str, tuple[tuple[str, ...], ...]]) -> Body:
    wrist, segment = _wrist(body, side, landmarks), f"{side}_forearm_hand"
    if wrist is None:
        return body
    seen = _worn(body, segment, body.markers.position[:, 1] < wrist[1] - _BEYOND_WRIST)
    if not seen:
        return body
    table = read_segment_table("de_leva_1996")
    long, short = (
        np.mean([table.value(part, "length", sex=sex) for sex in ("F", "M")]) for part in ("forearm", "hand")
    )
    hand = share_of_body(body, "hand", top=wrist, bottom=wrist * (1 + short / long))
    return _ranged(with_part(body, Cut(segment, f"{side}_hand", _axes("wrist", side), wrist, hand, seen)))


def _wrist(body: Body, side: str, landmarks: Mapping[str, tuple[tuple[str, ...], ...]]) -> Array | None:
    """Return the wrist's centre (3,) m in the frame of the forearm, between its two markers; None without them."""
    names, places = body.markers.names, []
    for end in ("radial", "ulnar"):
        worn = [one for one in landmarks.get(f"{side}_wrist_{end}", ()) if set(one) <= set(names)]
        if not worn:
            return None
        places.append(np.mean([body.markers.position[names.index(label)] for label in worn[0]], axis=0))
    return np.asarray(np.mean(places, axis=0))


def _worn(body: Body, segment: str, where: Array) -> tuple[str, ...]:
    """Return the markers of a segment for which ``where`` (K,) is true."""
    on = where & (np.array(body.markers.segment) == body.segment_index(segment))
    return tuple(name for name, there in zip(body.markers.names, on, strict=True) if there)


def _axes(joint: str, side: str = "") -> dict[str, Array]:
    """Return the axes of a joint by name, of the left side mirrored."""
    rows = [row for row in read_table("human", "optional_joints").rows if row["joint"].split("_")[0] == joint]
    mirror = np.array([-1.0, -1.0, 1.0]) if side == "left" else np.ones(3)
    start = f"{side}_" if side else ""
    return {f"{start}{row['joint']}": mirror * row_numbers(row, "axis_x axis_y axis_z") for row in rows}


def _ranged(body: Body) -> Body:
    """Return the body whose optional joints have the ranges and the words of the table."""
    rows = {row["joint"]: row for row in read_table("human", "optional_joints").rows}
    lower, upper, joints = np.array(body.limits.lower), np.array(body.limits.upper), list[Joint]()
    for i, joint in enumerate(body.joints):
        row = rows.get(joint.name.removeprefix("right_").removeprefix("left_"))
        if row is not None:
            upper[i] = np.radians(float(row["range_deg"]))
            lower[i] = -upper[i]
            joint = replace(joint, positive=row["positive"])
        joints.append(joint)
    return replace(body, joints=tuple(joints), limits=replace(body.limits, lower=lower, upper=upper))


_ARMS = ("upper_arm", "forearm_hand", "hand")
_TRUNK = ("trunk_head", "clavicle")


def marker_groups(body: Body) -> tuple[str, ...]:
    """Return the group of every marker of the body (K): "legs" (with the pelvis), "trunk", "arms" or "head".

    The head's are those on a head of its own, or on the trunk above the neck.
    """
    places = neck_and_vertex(body)
    neck = np.inf if places is None else float(places[0][1])
    groups = []
    for segment, height in zip(body.markers.segment, body.markers.position[:, 1], strict=True):
        kind = kind_of(body.links[segment])
        head = kind == "head" or (kind == "trunk_head" and height > neck)
        groups.append("head" if head else "arms" if kind in _ARMS else "trunk" if kind in _TRUNK else "legs")
    return tuple(groups)
