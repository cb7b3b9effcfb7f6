"""The truth of a virtual session as one JSON document: in the 16 true segments, and merged to the 12 segments of the reading model."""

from dataclasses import asdict
from typing import Any

import numpy as np

from biodance import __version__
from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.records import Array, Sip
from biodance.virtual_lab.flesh import of_parameters, parameters, placed
from biodance.virtual_lab.laboratory import Instruments
from biodance.virtual_lab.performance import Performance
from biodance.virtual_lab.person import Person
from biodance.virtual_lab.skeleton import SEGMENTS
from biodance.virtual_lab.soft_tissue import reference_angles

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
"""Each of the 12 segments: the true joint whose frame it is written in ("" = the root), and the true segments it consists of."""


def merged_sip(person: Person, body: Body) -> Sip:
    """Return the true parameters of ``body`` (with or without loads) in the 12 segments, each in its own true joint frame.

    Joints that the 12-segment model lacks (thorax, neck, forearm, wrist) are frozen in the posture in which the markers were glued.
    """
    q = body.neutral
    q[7:] = reference_angles(person)
    pose = poses(body, q)
    phi = []
    for joint, parts in MERGED.values():
        turn, place = pose.root_rotation[0], pose.root_position[0]
        if joint:
            turn, place = pose.joint_rotation[0, body.joint_index(joint)], pose.joint_position[0, body.joint_index(joint)]
        total = np.zeros((4, 4))
        for part in parts:
            i = SEGMENTS.index(part)
            total += placed(of_parameters(body.sip.of(part)), turn.T @ pose.rotation[0, i], turn.T @ (pose.position[0, i] - place))
        phi.append(parameters(total))
    flat = np.concatenate(phi)
    return Sip(tuple(MERGED), flat, np.zeros((flat.size, flat.size)))


def _segments(sip: Sip) -> list[dict[str, Any]]:
    """Return per segment mass, CoM and inertia [Ixx Ixy Iyy Ixz Iyz Izz] about and in the segment's joint frame."""
    return [
        {"name": name, "mass_kg": float(p[0]), "com_m": (p[1:4] / p[0]).tolist(), "inertia_kgm2": p[4:].tolist()}
        for name, p in zip(sip.segments, sip.phi.reshape(-1, 10), strict=True)
    ]


def _joint_centres(body: Body) -> dict[str, dict[str, Any]]:
    """Return where each anatomical joint sits in the frame of the true segment next to it on the side of the pelvis."""
    centres = {}
    carried = {index: segment for segment, index in zip(SEGMENTS, body.segment_joint, strict=True)}
    for joint in body.joints:
        if joint.parent in carried:
            centres[joint.name.rsplit("_", 1)[0]] = {"segment": carried[joint.parent], "place_m": joint.translation.tolist()}
    return centres


def truth(person: Person, session: int, protocol: str, instruments: Instruments, performances: list[Performance]) -> dict[str, Any]:
    """Return the whole truth of a session, ready for JSON (SI units in the key names)."""
    bare, loaded = person.body, person.loaded_body
    markers = bare.markers
    return {
        "version": __version__,
        "protocol": protocol,
        "seed": person.seed,
        "session": session,
        "subject": {"mass_kg": person.subject.mass, "height_m": person.subject.stature, "sex": person.subject.sex},
        "mass_with_loads_kg": person.mass,
        "loads": [
            {"segment": x.segment, "mass_kg": x.mass, "place_m": x.place.tolist(), "radii_of_gyration_m": x.radii.tolist()}
            for x in person.loads
        ],
        "segments_12": _segments(merged_sip(person, bare)),
        "segments_12_with_loads": _segments(merged_sip(person, loaded)),
        "segments_16": _segments(bare.sip),
        "segments_16_with_loads": _segments(loaded.sip),
        "joint_centres": _joint_centres(bare),
        "size_m": dict(person.size.size),
        "markers": {
            name: {"segment": SEGMENTS[s], "place_m": place.tolist()}
            for name, s, place in zip(markers.names, markers.segment, markers.position, strict=True)
        },
        "habits": asdict(person.habits),
        "tolerances": asdict(instruments.tolerances),
        "instruments": {"tilt": instruments.tilt.tolist(), "plates": [_plate(p.corners, p) for p in instruments.plates]},
        "trials": [
            {"name": p.plan.name, "role": p.plan.role, "duration_s": p.plan.duration, "balance_error_m": p.balance_error}
            for p in performances
        ],
    }


def _plate(corners: Array, plate: Any) -> dict[str, Any]:
    """Return how a plate truly is, against how it was surveyed."""
    return {
        "side": plate.side,
        "corners_surveyed_m": corners.tolist(),
        "true_rotation": plate.turn.tolist(),
        "true_centre_m": plate.centre.tolist(),
        "mixing": plate.mixing.tolist(),
        "offset": plate.offset.tolist(),
    }
