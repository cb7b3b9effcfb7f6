"""The HOAP-3 humanoid robot of the paper: 12 segments, 21 joints, 7.9 kg, built from the maker's own geometry and mass
table; and any robot's body in the axes of a standing person, with its dynamically similar model (Froude 1861): the body
of another size at which the same angles are the same movement.

Whoever designs a dance wants root and feet with x forwards, y up, z right while the feet are flat (ISB, as in the human
body). Frames of robots lie as their makers like; they are turned here, and what is written in them (parameters with
covariance, boxes, soles, markers, joints that hang on them) is turned along, so that it is the same robot. HOAP-3's
are the manual's modified Denavit-Hartenberg frames, except pelvis (ISB) and trunk (x forwards, y left, z up); at zero
angles its legs are straight and its arms point forwards.

Under gravity two bodies of the same shape and mass distribution move alike where times go with the square root of
lengths: lengths times L, masses times M; angles, friction and balance are then the same, forces go with M, moments with
M L, speeds of joints with 1 / sqrt(L). So a dance may be designed for a body of convenient size and danced, exactly, by
its small or large similar model.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.body import parts
from biodance.body.body import Body
from biodance.body.changes import place_at_zero, written_in
from biodance.body.human.skeleton import SEGMENTS
from biodance.body.tables.anthropometry import TableRow, read_table, row_numbers
from biodance.errors import BiodanceError
from biodance.records import SIDES, Array, Sip
from biodance.spatial import elementary_rotation


def standing_frames(body: Body) -> Body:
    """Return ``body`` with its feet in ISB axes: y along the sole's normal, x forwards at zero angles, origin where the
    last two axes meet.

    The root must be in ISB axes already (`urdf.read_urdf` sees to it).

    Raises
    ------
    BiodanceError
        A sole is not under its foot at zero joint angles.
    """
    for side in SIDES:
        foot = body.feet[side]
        turn, _ = place_at_zero(body, body.segment_joint[foot.segment])
        up = turn @ sole_normal(foot)
        if not up[1] > np.cos(np.radians(30.0)):
            away = np.degrees(np.arccos(np.clip(up[1], -1, 1)))
            raise BiodanceError(
                f"{body.name}: at zero joint angles the {side} sole faces {away:.0f} degrees away from the ground; the "
                "feet must be flat within 30 degrees. Give the joints zeros at which the robot stands."
            )
        # Gram-Schmidt: forwards square to the sole.
        ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
        ahead /= np.linalg.norm(ahead)
        axes = np.stack([ahead, up, np.cross(ahead, up)], axis=1)
        body = reframed(body, foot.segment, turn.T @ axes, _ankle(body, foot.segment))
    return body


def sole_normal(foot: parts.Foot) -> Array:
    """Return the unit normal (3,) of a flat sole upwards, in the frame of the foot."""
    edges = foot.outline - foot.outline.mean(axis=0)
    # Sum of cross products round the outline: twice its area vector, upwards if counter-clockwise.
    normal = np.cross(edges, np.roll(edges, -1, axis=0)).sum(axis=0)
    return np.asarray(normal / np.linalg.norm(normal))


def reframed(body: Body, segment: int, turn: Array, shift: Array) -> Body:
    """Return the body with the frame of one segment turned by ``turn`` (3, 3) = old_R_new, its origin at ``shift`` (3,)
    m in the old one.

    For segments on a joint the shift must lie along the joint's axis. The lab pose of a root that is turned changes by
    the same turn.
    """
    body, carrier = written_in(body, segment, turn, shift), body.segment_joint[segment]
    if carrier < 0:
        return body
    joints, joint = list(body.joints), body.joints[carrier]
    place = joint.translation + joint.rotation @ shift
    # The joint's angle turns before the segment's new axes: its axis is written in them.
    joints[carrier] = replace(joint, rotation=joint.rotation @ turn, translation=place, axis=turn.T @ joint.axis)
    return replace(body, joints=tuple(joints))


def _ankle(body: Body, segment: int) -> Array:
    """Return the point (3,) m, in the segment's frame, on its joint's axis that is nearest to the axis before it."""
    last = body.joints[body.segment_joint[segment]]
    if last.parent < 0:
        return np.zeros(3)
    before = last.rotation.T @ body.joints[last.parent].axis
    origin, across = -last.rotation.T @ last.translation, np.cross(last.axis, before)
    if across @ across < 1e-6:
        return np.zeros(3)
    # Nearest point to a second axis: (origin x before).(a x before) / |a x before|² along the own one.
    return np.asarray((np.cross(origin, before) @ across / (across @ across)) * last.axis)


@dataclass(frozen=True)
class SimilarityScale:
    """``length`` and ``mass``: factors from a body to its similar model."""

    length: float
    mass: float

    @property
    def time(self) -> float:
        """Factor of times."""
        return float(np.sqrt(self.length))


def similar_body(body: Body, to: SimilarityScale) -> Body:
    """Return the body of the same shape with lengths, masses, strengths and speeds changed by the factors of ``to``."""
    length, mass, limits = to.length, to.mass, body.limits
    # Mass, first moments, inertia: M, M L, M L².
    units: Array = mass * np.tile([1.0, *[length] * 3, *[length**2] * 6], len(body.segments))
    return replace(
        body,
        joints=tuple(replace(joint, translation=length * joint.translation) for joint in body.joints),
        sip=Sip(body.segments, units * body.sip.phi, np.outer(units, units) * body.sip.covariance),
        limits=replace(
            limits,
            velocity=limits.velocity / to.time,
            torque_lower=mass * length * limits.torque_lower,
            torque_upper=mass * length * limits.torque_upper,
        ),
        markers=replace(body.markers, position=length * body.markers.position),
        boxes=length * body.boxes,
        com_boxes=length * body.com_boxes,
        feet={side: replace(foot, outline=length * foot.outline) for side, foot in body.feet.items()},
    )


_RELATIVE_MASS_SD, _RELATIVE_INERTIA_SD = 0.15, 0.30
"""Of every segment: covers, cables and cards come and go (judgement; Bonnet 2016 finds 0.4 kg of 8 kg in all)."""
POINT = 1e-6
"""m: links with a smaller radius of gyration are point masses, as some files write them."""
_COM_SD = 0.2  # m of CoM per m of radius of gyration: 10 mm for the links of HOAP-3


def robot_covariance(lumps: list[parts.RigidInertia], com_sd: list[float]) -> Array:
    """Return the covariance (10N, 10N) of the parameters of independent segments, ``com_sd`` (N) m per axis."""
    out = np.zeros((10 * len(lumps), 10 * len(lumps)))
    for i, (lump, com) in enumerate(zip(lumps, com_sd, strict=True)):
        # A third of the trace: mean moment, per mass.
        size = _RELATIVE_INERTIA_SD * np.trace(lump.inertia) / lump.mass / 3
        jacobian, block = parts.parameter_jacobian(lump), slice(10 * i, 10 * i + 10)
        sd = np.diag([_RELATIVE_MASS_SD * lump.mass, *[com] * 3, *[size] * 6])
        out[block, block] = jacobian @ sd**2 @ jacobian.T
    return out


def is_point(lump: parts.RigidInertia) -> bool:
    """Whether a lump has no extension: its radius of gyration is below `POINT`."""
    # tr(I) = 2 m k² with the radius of gyration k about the CoM.
    return bool(np.trace(lump.inertia) <= 2 * lump.mass * POINT**2)


def extended(lump: parts.RigidInertia, box: Array) -> parts.RigidInertia:
    """Return the lump, or for a point mass one that fills its ``box`` (2, 3) m: what is left out is unknown."""
    return solid(lump, box) if is_point(lump) else lump


def solid(lump: parts.RigidInertia, box: Array) -> parts.RigidInertia:
    """Return a body of uniform density that fills a ``box`` (2, 3) m, with the lump's mass and centre of mass."""
    square = np.square(box[1] - box[0])
    # m / 12 (b² + c²) with full edges.
    return parts.RigidInertia(lump.mass, lump.com, lump.mass / 12 * np.diag(square.sum() - square))


def is_possible(lump: parts.RigidInertia) -> bool:
    """Whether some body has this mass, centre and inertia."""
    moments = np.linalg.eigvalsh(lump.inertia)
    # Triangle inequality: the largest moment at most the sum of the others.
    # Less a ten-thousandth of the largest, by which numbers of a file are rounded.
    return bool(lump.mass > 0 and moments.sum() - 2 * moments[-1] >= -1e-4 * moments[-1])


def com_deviation(lump: parts.RigidInertia) -> float:
    """Return the standard deviation m per axis of the CoM of a lump of which only the data sheet is known."""
    return float(_COM_SD * np.sqrt(np.trace(lump.inertia) / (2 * lump.mass)))


_CARRIES = {
    "hip_pitch": "thigh",
    "knee_pitch": "shank",
    "ankle_roll": "foot",
    "shoulder_yaw": "upper_arm",
    "elbow_pitch": "forearm_hand",
}
"""The last joint before each segment."""
_CENTRE_SD = 0.010  # m, prior standard deviation of every centre of mass; the others in `robot_prior`


def hoap3() -> Body:
    """Return the robot in configuration B (no battery, no wireless card): free root, nq = 28, nv = 27, no markers."""
    joints = _joints()
    # lab_R_segment at zero angles, lab axes x forwards, y left, z up.
    turns, chain = {"pelvis": parts.UPRIGHT}, list[Array]()
    for joint in joints:
        chain.append((parts.UPRIGHT if joint.parent < 0 else chain[joint.parent]) @ joint.rotation)
        if joint.segment >= 0:
            turns[SEGMENTS[joint.segment]] = chain[-1]
    lumps = [_lump(read_table("robots", "hoap3_segments").row(segment=name), turns[name]) for name in SEGMENTS]
    rows = [read_table("robots", "hoap3_joints").row(joint=joint.name) for joint in joints]
    corners = [read_table("robots", "hoap3_boxes").row(segment=segment) for segment in SEGMENTS]
    columns = "x_min y_min z_min x_max y_max z_max"
    boxes = np.array([row_numbers(row, columns) for row in corners]).reshape(-1, 2, 3)
    phi = np.concatenate([parts.inertial_parameters(lump) for lump in lumps])
    low, high, torque = np.array([row_numbers(row, "lower_deg upper_deg torque_nm") for row in rows]).T
    # 1.0 rad/s, the limit that Bonnet 2016 used for this robot
    return Body(
        "HOAP-3",
        SEGMENTS,
        joints,
        Sip(SEGMENTS, phi, robot_covariance(lumps, [_CENTRE_SD] * len(lumps))),
        parts.JointLimits(np.radians(low), np.radians(high), np.full(len(rows), 1.0), -torque, torque),
        parts.SegmentMarkers((), (), np.empty((0, 3)), np.empty(0)),
        boxes,
        boxes,
        feet={side: _sole(side) for side in SIDES},
        notes=("Fujitsu HOAP-3, configuration B, 7.942 kg; links merged to 12 segments at zero joint angles.",),
    )


def _joints() -> tuple[parts.Joint, ...]:
    """Return the 21 joints in the order legs, waist, arms."""
    joints: list[parts.Joint] = []
    z, reach = np.array([0.0, 0.0, 1.0]), 0.0
    for row in read_table("robots", "hoap3_joints").rows:
        name = row["joint"]
        side, _, kind = name.partition("_")
        if name == "waist_pitch":
            carried, y = SEGMENTS.index("trunk_head"), np.array([0.0, 1.0, 0.0])
            joints.append(parts.Joint(name, -1, y, parts.UPRIGHT.T, np.zeros(3), carried, "bend forwards"))
            continue
        a, alpha, d, theta = (float(row[column]) for column in ("a_m", "alpha_deg", "d_m", "theta_deg"))
        tilt = elementary_rotation("x", np.radians(alpha))
        rotation, translation = tilt @ elementary_rotation("z", np.radians(theta)), np.array([a, 0.0, reach])
        # the length d lies behind this joint's axis: its frame stays at the proximal end
        parent, reach = len(joints) - 1, d
        if kind in ("hip_yaw", "shoulder_pitch"):
            parent, base, place = _base(kind, side, joints)
            rotation, translation = base @ rotation, place + base @ translation
        carried = SEGMENTS.index(f"{side}_{_CARRIES[kind]}") if kind in _CARRIES else -1
        joints.append(parts.Joint(name, parent, z, rotation, translation, carried))
    return tuple(joints)


def _base(kind: str, side: str, joints: list[parts.Joint]) -> tuple[int, Array, Array]:
    """Return the parent joint and the fixed frame (turn, place) at which a leg or an arm starts; legs start in ISB
    axes, arms forwards, left, up (Fujitsu, table 6.1-2), 0.111 m from the middle.
    """
    tilt = elementary_rotation("x", -np.pi / 2)
    if kind == "hip_yaw":
        return -1, tilt @ elementary_rotation("z", np.pi / 2), np.array([-0.035, -0.055, 0.0])
    waist = next(i for i, joint in enumerate(joints) if joint.name == "waist_pitch")
    return waist, tilt, [-0.035, 0.0, 0.125] + tilt @ [0.0, 0.0, 0.111 if side == "left" else -0.111]


def _lump(row: TableRow, turn: Array) -> parts.RigidInertia:
    """Return one segment of the table (lab axes at zero angles) in its own frame."""
    mass, *com = row_numbers(row, "mass_kg com_x com_y com_z")
    xx, yy, zz, xy, xz, yz = row_numbers(row, "Ixx Iyy Izz Ixy Ixz Iyz")
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return parts.turn_inertia(parts.RigidInertia(mass, np.array(com), inertia), turn.T)


def _sole(side: str) -> parts.Foot:
    """Return the sole in the foot's frame (x up, z forwards), counter-clockwise seen from above."""
    middle, heel, toe, half = 0.005 if side == "right" else -0.005, -0.040, 0.068, 0.036
    corners = [(heel, -half), (heel, half), (toe, half), (toe, -half)]
    return parts.Foot(SEGMENTS.index(f"{side}_foot"), np.array([[-0.040, middle + y, z] for z, y in corners]))
