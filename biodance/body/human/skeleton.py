"""The joint tree of the human from its sizes: where each joint sits, how its axes turn and how far; and the joints that
a body has only where the markers of a session show them: neck, collar bones, turning forearms, wrists. The twelve
segments stay what is identified.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isnan
from typing import Literal

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import Cut, with_axis, with_part
from biodance.body.parts import Joint, JointLimits, RigidInertia, inertial_parameters
from biodance.body.tables.anthropometry import (
    KINDS,
    AnthropometricTable,
    Reference,
    proportion,
    read_segment_table,
    read_table,
    row_numbers,
)
from biodance.lab.markers.sets import MARKED_SEGMENTS, part_of
from biodance.records import SIDES, Array, Subject
from biodance.settings import STANDARD_GRAVITY

SEGMENTS = MARKED_SEGMENTS
"""The segments of a person, in Body order."""
JOINTS = (
    *("right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle", "trunk"),
    *("right_shoulder", "right_elbow", "left_shoulder", "left_elbow"),
)
"""Anatomical joints; each is one to three ``Joint`` records named ``<joint>_<movement>``."""


def upright_to(point: Array) -> Array:
    """Return the rotation (3, 3) about z that turns y towards a point (3,) in the sagittal plane."""
    # y turned onto (sin, cos): a rotation about z by -atan2(x, y).
    sine, cosine = point[:2] / np.linalg.norm(point[:2])
    return np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The sizes of one person, m.

    ``lengths`` by segment: thigh, shank, upper_arm, forearm_hand (to the wrist) between joint centres, foot heel to toe
    tip, pelvis mid hip centres to the cut, trunk_head mid hip to mid shoulder centres. ``origins`` by joint: (3,) m in
    the parent segment's frame. ``turns`` by joint: (3, 3) constant rotation parent_R_child at zero angle (varus, tibial
    torsion, carrying angle), identity if absent. ``cut`` by segment, pelvis and trunk_head: (3,) m in its frame, where
    the table of masses cuts one from the other, if not at the joint. ``ankle_height`` m over the sole and
    ``heel_behind_ankle`` m by side. ``asis_width``, ``stature`` m. ``stretched``: how many times as long as
    in the table pelvis and trunk_head are along the spine, as wide and deep as there, because their joint is no cut.
    """

    lengths: Mapping[str, float]
    origins: Mapping[str, Array]
    ankle_height: Mapping[str, float]
    heel_behind_ankle: Mapping[str, float]
    asis_width: float
    stature: float
    turns: Mapping[str, Array] = field(default_factory=dict)
    cut: Mapping[str, Array] = field(default_factory=dict)
    stretched: Mapping[str, float] = field(default_factory=dict)


def generic_skeleton(reference: Reference, subject: Subject) -> Skeleton:
    """Return the skeleton of the table's reference person at the subject's stature, widths by ``proportions.csv``."""
    stature, sex = subject.stature, subject.sex
    scale = stature / reference.stature
    kinds = {kind: scale * reference.lengths[kind] for kind in KINDS}
    half_hip, half_shoulder = (proportion(size, sex) * stature / 2 for size in ("hip_width", "shoulder_width"))
    origins = {"trunk": np.array([0.0, kinds["pelvis"], 0.0])}
    for side, sign in (("right", 1.0), ("left", -1.0)):
        origins[f"{side}_hip"] = np.array([0.0, 0.0, sign * half_hip])
        origins[f"{side}_shoulder"] = np.array([0.0, kinds["trunk_head"] - kinds["pelvis"], sign * half_shoulder])
        for joint, kind in (("knee", "thigh"), ("ankle", "shank"), ("elbow", "upper_arm")):
            origins[f"{side}_{joint}"] = np.array([0.0, -kinds[kind], 0.0])
    ankle = proportion("ankle_height", sex) * stature
    lengths = {segment: kinds[part_of(segment)] for segment in SEGMENTS}
    heel = proportion("heel_behind_ankle", sex) * kinds["foot"]
    asis = proportion("asis_width", sex) * stature
    return Skeleton(lengths, origins, dict.fromkeys(SIDES, ankle), dict.fromkeys(SIDES, heel), asis, stature)


def joint_tree(skeleton: Skeleton) -> tuple[Joint, ...]:
    """Return the 23 joints of ``anthropometry/human/joints_23.csv`` placed on a skeleton, in Body order.

    A hinge (knee, elbow) keeps its axis along z of the PARENT segment, so that a constant varus does not tilt the axis.
    """
    joints: list[Joint] = []
    tip = {"pelvis": -1}
    rows = read_table("human", "joints_23").rows
    groups = [row["joint"].rsplit("_", 1)[0] for row in rows]
    for i, (row, group) in enumerate(zip(rows, groups, strict=True)):
        first, last = group not in groups[:i], group not in groups[i + 1 :]
        turn = skeleton.turns.get(group, np.eye(3)) if first else np.eye(3)
        axis = np.array(row_numbers(row, "axis_x axis_y axis_z"))
        joints.append(
            Joint(
                name=row["joint"],
                parent=tip[row["parent"]] if first else i - 1,
                # The axis is written in the child's frame, which is turned by the constant varus.
                axis=turn.T @ axis if first and last else axis,
                rotation=turn,
                translation=skeleton.origins[group] if first else np.zeros(3),
                segment=SEGMENTS.index(row["child"]) if last else -1,
                positive=row["positive"],
            )
        )
        if last:
            tip[row["child"]] = i
    return tuple(joints)


def cut_at_joint(skeleton: Skeleton) -> Skeleton:
    """Return the skeleton of which the table cuts pelvis from trunk at the joint: the trunk's matter goes along with
    the joint. The pelvis reaches up to the joint, trunk and head from there to the vertex; both are as wide and deep as
    before.
    """
    lengths = skeleton.lengths
    pelvis = float(np.linalg.norm(skeleton.origins["trunk"]))
    legs = skeleton.ankle_height["right"] + lengths["right_shank"] + lengths["right_thigh"]
    above = skeleton.stature - legs - lengths["pelvis"]
    longer = (above + float(skeleton.cut["trunk_head"][1])) / above
    stretched = {"pelvis": pelvis / lengths["pelvis"], "trunk_head": longer}
    return replace(skeleton, cut={}, lengths={**lengths, "pelvis": pelvis}, stretched=stretched)


Range = Literal["anatomical", "comfortable"]

# Anderson's joint and direction -> movement and sign in the model; the ankle flexes (dorsiflexion) upwards
_ANDERSON = {
    ("hip", "flexion"): ("hip_flexion", 1),
    ("hip", "extension"): ("hip_flexion", -1),
    ("knee", "flexion"): ("knee_flexion", 1),
    ("knee", "extension"): ("knee_flexion", -1),
    ("ankle", "flexion"): ("ankle_dorsiflexion", 1),
    ("ankle", "extension"): ("ankle_dorsiflexion", -1),
}


def joint_limits(subject: Subject, *, within: Range = "anatomical") -> JointLimits:
    """Return the limits of the 23 joints of a person.

    ``within="anatomical"`` is what a healthy adult's joint allows (for inverse kinematics), ``"comfortable"`` what he
    or she reaches without effort (for designed motions). Speed 4 rad/s (Bonnet 2016). Torques: hip flexion, knee and
    ankle dorsiflexion from Anderson 2007 (C1 * mass * g * stature) by sex and age; all others from ``joints_23.csv`` in
    proportion to body mass, times the same age factor (mean over Anderson's six torques against 18-25 years). Unknown
    age counts as 25.
    """
    table = read_table("human", "joints_23")
    low, high = {
        "anatomical": ("range_min_deg", "range_max_deg"),
        "comfortable": ("comfort_min_deg", "comfort_max_deg"),
    }[within]
    word = {"F": "woman", "M": "man"}[subject.sex]
    ranges = np.radians([row_numbers(row, f"{low} {high}") for row in table.rows])
    velocity = [float(row["velocity_rad_s"]) for row in table.rows]
    torque = np.array([row_numbers(row, f"torque_min_{word}_Nm torque_max_{word}_Nm") for row in table.rows])
    anderson = read_table("human", "anderson_2007")
    young = replace(subject, age=25.0)
    ratios = [_coefficient(anderson, subject, *one) / _coefficient(anderson, young, *one) for one in _ANDERSON]
    # kg: the bodies for which the table gives torques
    torque *= subject.mass / {"F": 65.0, "M": 75.0}[subject.sex] * float(np.mean(ratios))
    names = [row["joint"].split("_", 1)[1] for row in table.rows]
    for (joint, direction), (movement, sign) in _ANDERSON.items():
        peak = peak_torque(anderson, subject, joint, direction)
        for i, name in enumerate(names):
            if name == movement:
                torque[i, (sign + 1) // 2] = sign * peak
    return JointLimits(ranges[:, 0], ranges[:, 1], np.array(velocity), torque[:, 0], torque[:, 1])


def peak_torque(anderson: AnthropometricTable, subject: Subject, joint: str, direction: str) -> float:
    """Return the largest isometric torque, N·m > 0: C1 * mass * g * stature, C1 linear between 25, 60 and 70 years."""
    return _coefficient(anderson, subject, joint, direction) * subject.mass * STANDARD_GRAVITY * subject.stature


def _coefficient(anderson: AnthropometricTable, subject: Subject, joint: str, direction: str) -> float:
    rows = anderson.where(joint=joint, direction=direction, sex=subject.sex)
    age = 25.0 if isnan(subject.age) else subject.age
    return float(np.interp(age, [25.0, 60.0, 70.0], [float(row["C1"]) for row in rows]))


_HAND_TURN = np.radians(120.0)
"""rad either way: the model has no pronation, so with a straight elbow a turning hand is seen as a turning shoulder; a
narrower limit makes the arm jump to the other set of angles that reaches the same hand (seen in a real walk).
"""
_SPARE = np.radians(5.0)  # rad: how far a joint range is widened beyond the angle of the static trial


def widen_limits(body: Body, q: Array) -> tuple[JointLimits, tuple[str, ...]]:
    """Return the limits for tracking: counted from this person's upright pelvis, the static posture ``SPARE`` inside
    them, the shoulder turning as far as the hand does, the ankle bending as far as under load, and all but knees,
    elbows and that turn by 25 degrees more. The notes name what this posture changed.

    Clinical ranges of hip and trunk count from upright standing, ISB angles from the plane of the pelvis markers, which
    stands tilted.
    """
    angle, names, tilt = q[body.nq - len(body.joints) :], [joint.name for joint in body.joints], standing_tilt(q)

    def named(*ends: str) -> Array:
        return np.array([name.endswith(ends) for name in names], dtype=float)

    # A pelvis tilted forwards adds to hip flexion and takes from trunk flexion; ranges only grow.
    shift = tilt * (named("_hip_flexion") - named("trunk_flexion"))
    lower, upper = body.limits.lower + np.minimum(shift, 0.0), body.limits.upper + np.maximum(shift, 0.0)
    # Under body weight with a bent knee, as on stairs and in squats, an ankle bends by 40 degrees (weight-bearing
    # lunge, Bennell et al. 1998); the tables give the unloaded joint's 20 to 25.
    upper = np.where(named("_ankle_dorsiflexion"), np.maximum(upper, np.radians(40.0)), upper)
    lower, upper = (
        np.where(named("_shoulder_rotation"), *pair) for pair in ((-_HAND_TURN, lower), (_HAND_TURN, upper))
    )
    # How far a joint may pass the anatomical range of the one whose name it has: trunk and girdle bend in many places
    # where the model has one joint, marker sets turn the axes, and skin slides. Hinges do not go further, nor does the
    # shoulder's turn, as wide as the hand's.
    free = np.radians(25.0) * (1.0 - named("_knee_flexion", "_elbow_flexion", "_shoulder_rotation"))
    lower, upper = lower - free, upper + free
    low, high = np.minimum(lower, angle - _SPARE), np.maximum(upper, angle + _SPARE)
    notes = tuple(
        f"Range of {name.replace('_', ' ')} widened to {round(np.degrees(low[i]))} to {round(np.degrees(high[i]))} "
        f"degrees: {round(np.degrees(angle[i]))} degrees when standing."
        for i, name in enumerate(names)
        if low[i] < lower[i] or high[i] > upper[i]
    )
    lean = round(np.degrees(tilt))
    way = "backwards" if lean < 0 else "forwards"
    tilted = (
        f"Pelvis markers stand tilted {abs(lean)} degree{'s' * (abs(lean) != 1)} {way}: ranges of hip and trunk "
        "flexion are widened by as much."
    )
    return replace(body.limits, lower=low, upper=high), (tilted, *notes)


def with_tracking_limits(body: Body) -> Body:
    """Return a body without a static trial with the limits for tracking, counted from the neutral posture."""
    return replace(body, limits=widen_limits(body, body.neutral)[0])


def standing_tilt(q: Array) -> float:
    """Return the forward tilt, rad, of the pelvis in a posture q: how far its x axis points below the horizontal."""
    from scipy.spatial.transform import Rotation

    # R20 is the z component of the x axis: minus the sine of the tilt forwards.
    return -float(np.arcsin(Rotation.from_quat(q[3:7]).as_matrix()[2, 0]))


OPTIONAL_JOINTS = ("neck", "forearms", "wrists", "clavicles")
"""The joints that a body may have beyond its 23 axes."""


def with_optional(body: Body, name: str, landmarks: Mapping[str, tuple[tuple[str, ...], ...]]) -> Body:
    """Return the body with one of the `OPTIONAL_JOINTS`, on every side whose markers can show it; as it is without such
    markers.

    ``landmarks`` of its marker set: which labels mark the wrists.
    """
    if name == "neck":
        places = neck_and_vertex(body)
        if places is None:
            return body
        neck, vertex = places
        seen = _worn(body, "trunk_head", body.markers.position[:, 1] > neck[1])
        if len(seen) < 3:
            return body
        head = share_of_body(body, "head", top=vertex, bottom=neck)
        return _ranged(with_part(body, Cut("trunk_head", "head", _axes("neck"), neck, head, seen)))
    for side in SIDES:
        if name == "clavicles":
            body = _with_clavicle(body, side)
        elif name == "forearms":
            if _wrist(body, side, landmarks) is not None:
                ((axis_name, axis),) = _axes("elbow", side).items()
                body = _ranged(with_axis(body, f"{side}_elbow_flexion", axis_name, axis))
        else:
            body = _with_wrist(body, side, landmarks)
    return body


def neck_and_vertex(body: Body) -> tuple[Array, Array] | None:
    """Return where the head turns and where it ends, (3,) m in the trunk's frame; None for a body without shoulders."""
    middle = shoulders(body)
    if middle is None:
        return None
    vertex = np.array([middle[0], body.boxes[body.segment_index("trunk_head"), 1, 1], 0.0])
    # The head turns about the height of the angle of the jaw (de Leva 1996: 0.39 men, 0.45 women). Nodding is shared by
    # all of the neck; about its base the head's weight would move twice as far as it does in virtual persons.
    return middle + 0.41 * (vertex - middle), vertex


def collar_bone(body: Body, side: str, markers: tuple[str, ...] = ()) -> Cut:
    """Return the cut that lets a shoulder and some ``markers`` of the trunk turn about the inner end of the collar
    bone, of a body with shoulders; it takes no matter from the trunk.
    """
    middle, arm = shoulders(body), body.joint_index(f"{side}_shoulder_flexion")
    assert middle is not None
    _, shoulder = body.place_on_segment(arm)
    outwards = [1.0, 1.0, 1.0 if side == "right" else -1.0]
    # Forwards, upwards and sideways from the middle of the shoulders, in half shoulder widths.
    place = np.asarray(middle + abs(float(shoulder[2])) * np.array([0.2, 0.0, 0.12]) * outwards)
    return Cut("trunk_head", f"{side}_clavicle", _axes("clavicle", side), place, np.zeros(10), markers, (arm,))


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
    # Radii of gyration of the table's sagittal, longitudinal and transverse axes about x, y, z.
    inertia = mass * length**2 * np.diag([sagittal**2, along**2, transverse**2])
    return inertial_parameters(RigidInertia(mass, top + place * (bottom - top), inertia))


def _with_clavicle(body: Body, side: str) -> Body:
    if shoulders(body) is None:
        return body
    _, centre = body.place_on_segment(body.joint_index(f"{side}_shoulder_flexion"))
    # Within a quarter of the shoulders' width, markers of the trunk ride on the collar bone.
    near = np.linalg.norm(body.markers.position - centre, axis=1) < 0.5 * abs(centre[2])
    seen = _worn(body, "trunk_head", near)
    return _ranged(with_part(body, collar_bone(body, side, seen))) if seen else body


def _with_wrist(body: Body, side: str, landmarks: Mapping[str, tuple[tuple[str, ...], ...]]) -> Body:
    wrist, segment = _wrist(body, side, landmarks), f"{side}_forearm_hand"
    if wrist is None:
        return body
    # 0.03 m: markers of the forearm so far beyond the wrist are worn on the hand
    seen = _worn(body, segment, body.markers.position[:, 1] < wrist[1] - 0.03)
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
        row = rows.get(part_of(joint.name))
        if row is not None:
            upper[i] = np.radians(float(row["range_deg"]))
            lower[i] = -upper[i]
            joint = replace(joint, positive=row["positive"])
        joints.append(joint)
    return replace(body, joints=tuple(joints), limits=replace(body.limits, lower=lower, upper=upper))


def marker_groups(body: Body) -> tuple[str, ...]:
    """Return the group of every marker of the body (K): "legs" (with the pelvis), "trunk", "arms" or "head".

    The head's are those on a head of its own, or on the trunk above the neck.
    """
    places = neck_and_vertex(body)
    neck = np.inf if places is None else float(places[0][1])
    groups = []
    for segment, height in zip(body.markers.segment, body.markers.position[:, 1], strict=True):
        kind = part_of(body.links[segment])
        head = kind == "head" or (kind == "trunk_head" and height > neck)
        trunk, arms = kind in ("trunk_head", "clavicle"), kind in ("upper_arm", "forearm_hand", "hand")
        groups.append("head" if head else "arms" if arms else "trunk" if trunk else "legs")
    return tuple(groups)
