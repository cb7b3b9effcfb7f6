"""The HOAP-3 humanoid robot of the paper: 12 segments, 21 joints, 7.9 kg, built from the maker's own geometry and mass
table.

Segment frames are the manual's modified Denavit-Hartenberg frames, except pelvis (ISB: x forwards, y up, z right) and
trunk (x forwards, y left, z up). At zero angles the legs are straight and the arms point forwards.
"""

import numpy as np

from biodance.body.body import Body
from biodance.body.inertia import RigidInertia, inertial_parameters, turn_inertia
from biodance.body.parts import UPRIGHT, Foot, Joint, JointLimits, SegmentMarkers
from biodance.body.robot.similarity import robot_covariance
from biodance.body.tables.anthropometry import TableRow, read_table, row_numbers
from biodance.records import SIDES, Array, Sip
from biodance.spatial import elementary_rotation

_SEGMENTS = (
    "pelvis", "right_thigh", "right_shank", "right_foot", "left_thigh", "left_shank", "left_foot", "trunk_head",
    "right_upper_arm", "right_forearm_hand", "left_upper_arm", "left_forearm_hand",
)  # fmt: skip
_CARRIES = {
    "hip_pitch": "thigh",
    "knee_pitch": "shank",
    "ankle_roll": "foot",
    "shoulder_yaw": "upper_arm",
    "elbow_pitch": "forearm_hand",
}
"""The last joint before each segment."""
_SPEED = 1.0  # rad/s, the limit that Bonnet 2016 used for this robot
_LEG_BASE, _ARM_BASE = np.array([-0.035, -0.055, 0.0]), np.array([-0.035, 0.0, 0.125])
"""m: where legs start in the pelvis (ISB axes) and arms in the trunk (forwards, left, up); Fujitsu, table 6.1-2."""
_SHOULDER = 0.111  # m, from the middle to either shoulder
_ANKLE_HEIGHT, _SOLE_AHEAD, _SOLE_WIDE = 0.040, (-0.040, 0.068), 0.036
"""m: sole under the ankle, from heel to toe, half its width about its middle line."""
_COM_SD = 0.010  # m, prior standard deviation of every centre of mass; the others in `robot_prior`


def hoap3() -> Body:
    """Return the robot in configuration B (no battery, no wireless card): free root, nq = 28, nv = 27, no markers."""
    joints = _joints()
    turns = _zero_posture(joints)
    lumps = [_lump(read_table("robots", "hoap3_segments").row(segment=name), turns[name]) for name in _SEGMENTS]
    rows = [read_table("robots", "hoap3_joints").row(joint=joint.name) for joint in joints]
    corners = [read_table("robots", "hoap3_boxes").row(segment=segment) for segment in _SEGMENTS]
    columns = "x_min y_min z_min x_max y_max z_max"
    boxes = np.array([row_numbers(row, columns) for row in corners]).reshape(-1, 2, 3)
    phi = np.concatenate([inertial_parameters(lump) for lump in lumps])
    low, high, torque = np.array([row_numbers(row, "lower_deg upper_deg torque_nm") for row in rows]).T
    return Body(
        "HOAP-3",
        _SEGMENTS,
        joints,
        Sip(_SEGMENTS, phi, robot_covariance(lumps, [_COM_SD] * len(lumps))),
        JointLimits(np.radians(low), np.radians(high), np.full(len(rows), _SPEED), -torque, torque),
        SegmentMarkers((), (), np.empty((0, 3)), np.empty(0)),
        boxes,
        boxes,
        feet={side: _sole(side) for side in SIDES},
        notes=("Fujitsu HOAP-3, configuration B, 7.942 kg; links merged to 12 segments at zero joint angles.",),
    )


def _joints() -> tuple[Joint, ...]:
    """Return the 21 joints in the order legs, waist, arms."""
    joints: list[Joint] = []
    z, reach = np.array([0.0, 0.0, 1.0]), 0.0
    for row in read_table("robots", "hoap3_joints").rows:
        name = row["joint"]
        side, _, kind = name.partition("_")
        if name == "waist_pitch":
            carried, y = _SEGMENTS.index("trunk_head"), np.array([0.0, 1.0, 0.0])
            joints.append(Joint(name, -1, y, UPRIGHT.T, np.zeros(3), carried, "bend forwards"))
            continue
        a, alpha, d, theta = (float(row[column]) for column in ("a_m", "alpha_deg", "d_m", "theta_deg"))
        tilt = elementary_rotation("x", np.radians(alpha))
        rotation, translation = tilt @ elementary_rotation("z", np.radians(theta)), np.array([a, 0.0, reach])
        # the length d lies behind this joint's axis: its frame stays at the proximal end
        parent, reach = len(joints) - 1, d
        if kind in ("hip_yaw", "shoulder_pitch"):
            parent, base, place = _base(kind, side, joints)
            rotation, translation = base @ rotation, place + base @ translation
        carried = _SEGMENTS.index(f"{side}_{_CARRIES[kind]}") if kind in _CARRIES else -1
        joints.append(Joint(name, parent, z, rotation, translation, carried))
    return tuple(joints)


def _base(kind: str, side: str, joints: list[Joint]) -> tuple[int, Array, Array]:
    """Return the parent joint and the fixed frame (turn, place) at which a leg or an arm starts."""
    z = np.array([0.0, 0.0, 1.0])
    tilt = elementary_rotation("x", -np.pi / 2)
    if kind == "hip_yaw":
        return -1, tilt @ elementary_rotation("z", np.pi / 2), _LEG_BASE
    waist = next(i for i, joint in enumerate(joints) if joint.name == "waist_pitch")
    return waist, tilt, _ARM_BASE + tilt @ (z * (_SHOULDER if side == "left" else -_SHOULDER))


def _zero_posture(joints: tuple[Joint, ...]) -> dict[str, Array]:
    """Return lab_R_segment (3, 3) of every segment at zero angles, lab axes x forwards, y left, z up."""
    turns = {"pelvis": UPRIGHT}
    chain: list[Array] = []
    for joint in joints:
        chain.append((UPRIGHT if joint.parent < 0 else chain[joint.parent]) @ joint.rotation)
        if joint.segment >= 0:
            turns[_SEGMENTS[joint.segment]] = chain[-1]
    return turns


def _lump(row: TableRow, turn: Array) -> RigidInertia:
    """Return one segment of the table (lab axes at zero angles) in its own frame."""
    mass, *com = row_numbers(row, "mass_kg com_x com_y com_z")
    xx, yy, zz, xy, xz, yz = row_numbers(row, "Ixx Iyy Izz Ixy Ixz Iyz")
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return turn_inertia(RigidInertia(mass, np.array(com), inertia), turn.T)


def _sole(side: str) -> Foot:
    """Return the sole in the foot's frame (x up, z forwards), counter-clockwise seen from above."""
    middle = 0.005 if side == "right" else -0.005
    heel, toe = _SOLE_AHEAD
    corners = [(heel, -_SOLE_WIDE), (heel, _SOLE_WIDE), (toe, _SOLE_WIDE), (toe, -_SOLE_WIDE)]
    return Foot(_SEGMENTS.index(f"{side}_foot"), np.array([[-_ANKLE_HEIGHT, middle + y, z] for z, y in corners]))
