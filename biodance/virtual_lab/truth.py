"""The truth of a virtual session: how 16 true segments make the reading model's 12, and all as one JSON document."""

from dataclasses import asdict
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.errors import refuse_unknown
from biodance.motion.kinematics import poses
from biodance.records import Array, Sip
from biodance.version import __version__
from biodance.virtual_lab.instruments import reference_angles
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.person.person import AddedLoad, Person, of_parameters, parameters_of_inertia, place_inertia
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS
from biodance.virtual_lab.visit import Instruments

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
            # Second moments of all parts add in one frame.
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
    refuse_unknown("segment of the 12-segment model", segment, MERGED)
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


def _segments(sip: Sip) -> list[dict[str, Any]]:
    """Return per segment mass, CoM and inertia [Ixx Ixy Iyy Ixz Iyz Izz] about and in the segment's joint frame."""
    return [
        {"name": name, "mass_kg": float(p[0]), "com_m": (p[1:4] / p[0]).tolist(), "inertia_kgm2": p[4:].tolist()}
        for name, p in zip(sip.segments, sip.phi.reshape(-1, 10), strict=True)
    ]


def truth(person: Person, protocol: str, instruments: Instruments, performances: list[Performance]) -> dict[str, Any]:
    """Return the whole truth of a session, ready for JSON (SI units in the key names)."""
    bare, loaded = person.body, person.loaded_body
    markers, carried = bare.markers, dict(zip(bare.segment_joint, TRUE_SEGMENTS, strict=True))
    return {
        "version": __version__,
        "protocol": protocol,
        "seed": person.seed,
        "session": instruments.visit.number,
        "subject": {"mass_kg": person.subject.mass, "height_m": person.subject.stature, "sex": person.subject.sex},
        "mass_with_loads_kg": person.mass,
        "loads": [_load(person, load) for load in person.loads],
        "static_pose": _static_pose(person, instruments, performances),
        "segments_12": _segments(merged_sip(person, bare)),
        "segments_12_with_loads": _segments(merged_sip(person, loaded)),
        "segments_16": _segments(bare.sip),
        "segments_16_with_loads": _segments(loaded.sip),
        # each anatomical joint in the frame of the true segment next to it on the side of the pelvis
        "joint_centres": {
            joint.name.rsplit("_", 1)[0]: {"segment": carried[joint.parent], "place_m": joint.translation.tolist()}
            for joint in bare.joints
            if joint.parent in carried
        },
        "size_m": dict(person.size.size),
        "markers": {
            name: {"segment": TRUE_SEGMENTS[s], "place_m": place.tolist()}
            for name, s, place in zip(markers.names, markers.segment, markers.position, strict=True)
        },
        "habits": asdict(person.habits),
        "tolerances": asdict(instruments.visit.tolerances),
        "laboratory": {k: v for k, v in asdict(instruments.visit.laboratory).items() if k != "tolerances"},
        "instruments": {
            "tilt": instruments.tilt.tolist(),
            "plates": [
                {
                    "side": plate.side,
                    "corners_surveyed_m": plate.corners.tolist(),
                    "true_rotation": plate.turn.tolist(),
                    "true_centre_m": plate.centre.tolist(),
                    "mixing": plate.mixing.tolist(),
                    "offset": plate.offset.tolist(),
                }
                for plate in instruments.plates
            ],
        },
        "trials": [
            {
                "name": p.plan.name,
                "role": p.plan.role,
                "duration_s": p.plan.duration,
                "balance_error_m": p.balance_error,
            }
            for p in performances
        ],
    }


def _static_pose(person: Person, instruments: Instruments, performances: list[Performance]) -> dict[str, Any] | None:
    """Return where the 12 true frames were in the middle of the static trial (cameras' axes, marker time), if any."""
    static = next((p for p in performances if p.plan.role == "static"), None)
    if static is None:
        return None
    time = round(0.5 * static.plan.duration, 2)
    frames = _frames(person, person.body, static.motion(np.array([time])).q[0])[0]
    tilt = instruments.tilt
    segments = [
        {"name": n, "rotation": (tilt @ turn).tolist(), "position_m": (tilt @ at).tolist()}
        for n, (turn, at) in frames.items()
    ]
    return {"trial": static.plan.name, "time_s": time, "segments_12": segments}


def sip_in_frames(document: dict[str, Any], rotation: Array, position: Array) -> Sip:
    """Return the true parameters of the 12 segments in ANOTHER model's frames: what a perfect identification of that
    model would find.

    ``document`` is a truth; ``rotation`` (12, 3, 3), ``position`` (12, 3) m are the lab poses of the other model's
    segments, in the same order, at the marker time ``document["static_pose"]["time_s"]`` of the static trial. Joint
    centres and axes differ between truth and model, so the numbers do; the body is the same.
    """
    phi = []
    for segment, pose, turn, place in zip(
        document["segments_12"], document["static_pose"]["segments_12"], rotation, position, strict=True
    ):
        own = np.array(
            [segment["mass_kg"], *(segment["mass_kg"] * np.array(segment["com_m"])), *segment["inertia_kgm2"]]
        )
        # new_R_lab lab_R_own, and the own origin in the new frame.
        there = turn.T @ np.array(pose["rotation"]), turn.T @ (np.array(pose["position_m"]) - place)
        phi.append(parameters_of_inertia(place_inertia(of_parameters(own), *there)))
    flat = np.concatenate(phi)
    return Sip(tuple(segment["name"] for segment in document["segments_12"]), flat, np.zeros((flat.size, flat.size)))


def _load(person: Person, load: AddedLoad) -> dict[str, Any]:
    """Return a load in the 12-segment model, and on the true segment that carries it."""
    segment, place = place_in_12(person, load)
    return {
        "segment": segment,
        "mass_kg": load.mass,
        "place_m": place.tolist(),
        "carried_by": load.segment,
        "place_on_carrier_m": load.place.tolist(),
        "radii_of_gyration_m": load.radii.tolist(),
    }
