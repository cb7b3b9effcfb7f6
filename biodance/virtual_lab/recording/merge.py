"""The bridge from the 16 true segments to the 12 of the reading model: which belong together, and in whose frame."""

import numpy as np

from biodance.body.body import Body
from biodance.errors import UnknownName
from biodance.motion.kinematics import poses
from biodance.records import Array, Sip
from biodance.virtual_lab.person.flesh import of_parameters, parameters_of_inertia, place_inertia
from biodance.virtual_lab.person.person import AddedLoad, Person
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS
from biodance.virtual_lab.recording.cameras import reference_angles

MERGED: dict[str, tuple[str, tuple[str, ...]]] = {
    "pelvis": ("", ("pelvis",)),
    "right_thigh": ("right_hip_rotation", ("right_thigh",)),
    "right_shank": ("right_knee_flexion", ("right_shank",)),
    "right_foot": ("right_ankle_inversion", ("right_foot",)),
    "left_thigh": ("left_hip_rotation", ("left_thigh",)),
    "left_shank": ("left_knee_flexion", ("left_shank",)),
    "left_foot": ("left_ankle_inversion", ("left_foot",)),
    "trunk_head": ("lumbar_rotation", ("lumbar", "thorax", "head")),
    "right_upper_arm": ("right_shoulder_rotation", ("right_upper_arm",)),
    "right_forearm_hand": ("right_elbow_flexion", ("right_forearm", "right_hand")),
    "left_upper_arm": ("left_shoulder_rotation", ("left_upper_arm",)),
    "left_forearm_hand": ("left_elbow_flexion", ("left_forearm", "left_hand")),
}
"""Each of the 12 segments: the true joint in whose frame it is written ("" = the root), and its true segments."""
CARRIERS = {"trunk_head": "thorax", "right_forearm_hand": "right_forearm", "left_forearm_hand": "left_forearm"}
"""The true segment that carries a load on a merged one."""
TrueFrames = dict[str, tuple[Array, Array]]


def _frames(person: Person, body: Body, q: Array | None = None) -> tuple[TrueFrames, TrueFrames]:
    """Return the poses (3, 3), (3,) m of the 12 frames and of the 16 segments at ``q`` (46,), by default as glued."""
    if q is None:
        q = body.neutral
        q[7:] = reference_angles(person)
    pose = poses(body, q)
    merged = {}
    for segment, (joint, _) in MERGED.items():
        j = body.joint_index(joint) if joint else -1
        merged[segment] = (
            (pose.joint_rotation[0, j], pose.joint_position[0, j])
            if joint
            else (pose.root_rotation[0], pose.root_position[0])
        )
    return merged, {name: (pose.rotation[0, i], pose.position[0, i]) for i, name in enumerate(TRUE_SEGMENTS)}


def merged_sip(person: Person, body: Body) -> Sip:
    """Return the true parameters of ``body`` (with or without loads) in the 12 segments, each in its own true joint
    frame.

    Joints that the 12-segment model lacks (thorax, neck, forearm, wrist) are frozen in the posture in which the markers
    were glued.
    """
    merged, true = _frames(person, body)
    phi = []
    for segment, (_, parts) in MERGED.items():
        turn, place = merged[segment]
        total = np.zeros((4, 4))
        for part in parts:
            part_turn, part_place = true[part]
            total += place_inertia(of_parameters(body.sip.of(part)), turn.T @ part_turn, turn.T @ (part_place - place))
        phi.append(parameters_of_inertia(total))
    flat = np.concatenate(phi)
    return Sip(tuple(MERGED), flat, np.zeros((flat.size, flat.size)))


def load_on(person: Person, segment: str, mass: float, *, place: Array | None = None) -> AddedLoad:
    """Return a load of ``mass`` kg on one of the 12 segments.

    ``place`` (3,) m is its centre in that segment's true joint frame; by default 6 cm outwards of the segment's centre
    of mass (pelvis and trunk: 10 cm backwards). The forearm carries for forearm_hand, the thorax for trunk_head.

    Raises
    ------
    UnknownName
        ``segment`` is none of the 12.
    """
    if segment not in MERGED:
        raise UnknownName.of("segment of the 12-segment model", segment, tuple(MERGED))
    if place is None:
        away = {"r": (0.0, 0.0, 0.06), "l": (0.0, 0.0, -0.06)}.get(segment[0], (-0.10, 0.0, 0.0))
        place = merged_sip(person, person.body).com[tuple(MERGED).index(segment)] + np.array(away)
    carrier = CARRIERS.get(segment, segment)
    merged, true = _frames(person, person.body)
    (turn, origin), (part_turn, part_origin) = merged[segment], true[carrier]
    return AddedLoad(carrier, mass, part_turn.T @ (origin + turn @ place - part_origin))


def place_in_12(person: Person, load: AddedLoad) -> tuple[str, Array]:
    """Return on which of the 12 segments a load sits, and its place (3,) m in that segment's true joint frame."""
    segment = next(name for name, (_, parts) in MERGED.items() if load.segment in parts)
    merged, true = _frames(person, person.body)
    (turn, origin), (part_turn, part_origin) = merged[segment], true[load.segment]
    return segment, turn.T @ (part_origin + part_turn @ load.place - origin)


def poses_12(person: Person, q: Array) -> TrueFrames:
    """Return the lab poses (3, 3), (3,) m of the 12 true joint frames at the true configuration ``q`` (46,)."""
    return _frames(person, person.body, q)[0]
