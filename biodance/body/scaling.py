"""The human of one subject: joint centres, segment lengths, constant joint tilts and every marker from the static trial.

The static posture is reached exactly by the body: whatever the joints cannot do (a knee has no varus, an ankle no torsion, an elbow no
carrying angle) becomes a constant tilt of that joint, so that in the static trial every marker and joint centre has residual zero.
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body, Joint, JointLimits, SegmentMarkers
from biodance.body.human import DEFAULT_TABLE, assemble
from biodance.body.measures import Measures, measures
from biodance.body.reference import Reference, proportion
from biodance.body.segment_tables import reference
from biodance.body.skeleton import JOINTS, SEGMENTS, SIDES, Skeleton, kind_of
from biodance.body.standing import Standing, standing
from biodance.body.static_frames import Frames, Hip, static_frames, turn
from biodance.records import Array, Subject, Trial

ANKLE_HEIGHT = (0.04, 0.12)
"""m: an ankle centre so high over z = 0 of the lab is taken to stand on that floor."""
HAND_TURN = np.radians(120.0)
"""rad either way: the model has no pronation, so with a straight elbow a turning hand is seen as a turning shoulder; a narrower limit makes
the arm jump to the other set of angles that reaches the same hand (seen in a real walk)."""
LOADED_ANKLE = np.radians(40.0)
"""rad: dorsiflexion under body weight with a bent knee, as on stairs and in squats (weight-bearing lunge, Bennell et al. 1998); the tables
give the unloaded joint's 20 to 25 deg."""
SPARE = np.radians(5.0)
"""rad: how far a joint range is widened beyond the angle of the static trial."""
TILT = {"knee": 15.0, "elbow": 25.0, "ankle": 40.0}
"""deg: larger constant tilts of a joint point to a misplaced marker."""
LENGTH_RATIO = {
    "thigh": (0.19, 0.29),
    "shank": (0.19, 0.29),
    "upper_arm": (0.12, 0.22),
    "forearm_hand": (0.10, 0.20),
    "trunk_head": (0.2, 0.36),
}
"""of stature: the lengths that adults and children have."""


def scale(subject: Subject, static: Trial, *, hip: Hip = "harrington", table: str = DEFAULT_TABLE) -> Body:
    """Return the body of a subject, scaled on the static trial, with every marker calibrated in its segment.

    ``hip``: "harrington" (regressions on the pelvis markers) or "davis" (plug-in gait). ``table`` gives masses, CoM, inertias and where the
    trunk joint lies between mid hip and mid shoulder. ``notes`` of the body say what was measured, assumed, contradicted and warned about.

    Raises
    ------
    TrialRefused
        The static trial has no markers, no known marker set, or misses a landmark; all missing ones are named.
    UnknownName
        There is no such table.
    SessionRefused
        The mass or the stature of the subject is not known.
    """
    return scale_with_posture(subject, static, hip=hip, table=table)[0]


def scale_with_posture(subject: Subject, static: Trial, *, hip: Hip = "harrington", table: str = DEFAULT_TABLE) -> tuple[Body, Array]:
    """Return the scaled body and its posture q (30,) in the static trial, at which all calibrated markers are met exactly."""
    subject.require("mass", "stature")
    posture = standing(static)
    sizes = measures(posture, static, subject)
    model = reference(table, subject)
    fraction = model.lengths["pelvis"] / model.lengths["trunk_head"]
    frames = static_frames(posture.landmarks, sizes, hip=hip, trunk_fraction=fraction)
    skeleton = static_skeleton(frames, posture, sizes, subject)
    notes = (f"Scaled on static trial {static.name}; hip centres: {hip}.", *posture.notes, *sizes.notes, *frames.notes)
    markers = calibrated_markers(frames, posture)
    body = assemble(subject, skeleton, table=table, markers=markers, notes=(*notes, *_doubts(skeleton, subject, model)))
    q = static_posture(body, frames)
    limits, widened = widen(body, q)
    return replace(body, limits=limits, notes=(*body.notes, *widened)), q


def calibrated_markers(frames: Frames, posture: Standing) -> SegmentMarkers:
    """Return every marker of the set that was seen, at its place in its segment."""
    worn = [marker for marker in posture.marker_set.markers if marker.label in posture.points]
    local = [frames.rotation[m.segment].T @ (posture.points[m.label] - frames.origin[m.segment]) for m in worn]
    return SegmentMarkers(
        tuple(m.label for m in worn), tuple(SEGMENTS.index(m.segment) for m in worn), np.array(local), np.array([m.weight for m in worn])
    )


def static_skeleton(frames: Frames, posture: Standing, sizes: Measures, subject: Subject) -> Skeleton:
    """Return the sizes of the skeleton in the static trial."""

    def local(segment: str, point: Array) -> Array:
        return np.asarray(frames.rotation[segment].T @ (point - frames.origin[segment]))

    shoulders = (frames.origin["right_upper_arm"] + frames.origin["left_upper_arm"]) / 2
    origins = {"trunk": local("pelvis", frames.origin["trunk_head"])}
    lengths = {"pelvis": float(np.linalg.norm(origins["trunk"])), "trunk_head": float(np.linalg.norm(shoulders - frames.origin["pelvis"]))}
    turns: dict[str, Array] = {}
    height: dict[str, float] = {}
    behind: dict[str, float] = {}
    for side in SIDES:
        thigh, shank, foot, arm, forearm = (f"{side}_{kind}" for kind in ("thigh", "shank", "foot", "upper_arm", "forearm_hand"))
        for joint, parent, child in (("hip", "pelvis", thigh), ("knee", thigh, shank), ("ankle", shank, foot), ("elbow", arm, forearm)):
            origins[f"{side}_{joint}"] = local(parent, frames.origin[child])
        origins[f"{side}_shoulder"] = local("trunk_head", frames.origin[arm])
        for segment, end in ((thigh, "knee"), (shank, "ankle"), (arm, "elbow")):
            lengths[segment] = float(np.linalg.norm(origins[f"{side}_{end}"]))
        lengths[forearm] = float(np.linalg.norm(local(forearm, frames.ends[f"{side}_wrist"])))
        lengths[foot], height[side], behind[side] = _foot(frames, posture, sizes, subject, side)
        for joint, pair in (("knee", (thigh, shank)), ("ankle", (shank, foot)), ("elbow", (arm, forearm))):
            turns[f"{side}_{joint}"] = _turn(frames, *pair)
    return Skeleton(lengths, origins, height, behind, sizes.pelvis_width, subject.stature, turns)


def _turn(frames: Frames, parent: str, child: str) -> Array:
    """Return the constant part of parent_R_child: a hinge's varus about x, an ankle's torsion about y."""
    relative = frames.rotation[parent].T @ frames.rotation[child]
    if kind_of(child) == "foot":
        return turn(1, np.arctan2(-relative[2, 0], relative[0, 0]))
    return turn(0, np.arcsin(relative[2, 1]))


def _foot(frames: Frames, posture: Standing, sizes: Measures, subject: Subject, side: str) -> tuple[float, float, float]:
    """Return foot length, height of the ankle over the sole, and how far the heel lies behind the ankle, m."""
    place, ankle = posture.landmarks, frames.origin[f"{side}_foot"]
    heel, toe = (frames.rotation[f"{side}_foot"].T @ (place[f"{side}_{end}"] - ankle) for end in ("heel", "toe"))
    length = float(toe[0] - heel[0]) / proportion("heel_to_toe_marker", subject.sex)
    standing_on_zero = ANKLE_HEIGHT[0] < ankle[2] < ANKLE_HEIGHT[1]
    height = float(ankle[2]) if standing_on_zero else proportion("ankle_height", subject.sex) * subject.stature
    return length, height, float(-heel[0]) - sizes.marker_radius


def static_posture(body: Body, frames: Frames) -> Array:
    """Return q (30,) of the body in the static trial."""
    from scipy.spatial.transform import Rotation

    angles: dict[str, list[Joint]] = {}
    for joint in body.joints:
        group = joint.name.rsplit("_", 1)[0]
        angles.setdefault(group, []).append(joint)
    q = np.concatenate([frames.origin["pelvis"], Rotation.from_matrix(frames.rotation["pelvis"]).as_quat(), np.zeros(len(body.joints))])
    for group in JOINTS:
        chain = angles[group]
        child = body.segments[chain[-1].segment]
        relative = chain[0].rotation.T @ frames.rotation[_parent(child)].T @ frames.rotation[child]
        for joint, angle in zip(chain, chain_angles(relative, np.array([joint.axis for joint in chain])), strict=True):
            q[7 + body.joints.index(joint)] = angle
    return q


def _parent(segment: str) -> str:
    side = segment.split("_")[0]
    return {
        "shank": f"{side}_thigh",
        "foot": f"{side}_shank",
        "forearm_hand": f"{side}_upper_arm",
        "upper_arm": "trunk_head",
    }.get(kind_of(segment), "pelvis")


def chain_angles(relative: Array, axes: Array) -> Array:
    """Return the angles, rad, about the signed axes (n, 3) of a joint whose product of rotations is ``relative`` (3, 3).

    One axis: any. Two: z then x. Three: z then x then y.
    """
    if len(axes) == 1:
        spin = np.array([relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]]) / 2
        return np.array([np.arctan2(axes[0] @ spin, (np.trace(relative) - 1) / 2)])
    if len(axes) == 2:
        angles = [np.arctan2(relative[1, 0], relative[0, 0]), np.arctan2(relative[2, 1], relative[2, 2])]
    else:
        angles = [np.arctan2(-relative[0, 1], relative[1, 1]), np.arcsin(relative[2, 1]), np.arctan2(-relative[2, 0], relative[2, 2])]
    return axes.sum(axis=1) * np.array(angles)


def widen(body: Body, q: Array) -> tuple[JointLimits, tuple[str, ...]]:
    """Return the limits for tracking: counted from this person's upright pelvis, the static posture ``SPARE`` inside them, the shoulder
    turning as far as the hand does, the ankle bending as far as under load. The notes name what was changed.

    Clinical ranges of hip and trunk count from upright standing, ISB angles from the plane of the pelvis markers, which stands tilted.
    """
    angle, limits = q[body.nq - len(body.joints) :], body.limits
    tilt = standing_tilt(q)
    shift = np.array([tilt * (joint.name.endswith("_hip_flexion") - float(joint.name == "trunk_flexion")) for joint in body.joints])
    limits = replace(limits, lower=limits.lower + np.minimum(shift, 0.0), upper=limits.upper + np.maximum(shift, 0.0))
    turning, ankle = (
        np.array([joint.name.endswith(end) for joint in body.joints]) for end in ("_shoulder_rotation", "_ankle_dorsiflexion")
    )
    loaded = np.where(ankle, np.maximum(limits.upper, LOADED_ANKLE), limits.upper)
    limits = replace(limits, lower=np.where(turning, -HAND_TURN, limits.lower), upper=np.where(turning, HAND_TURN, loaded))
    lower, upper = np.minimum(limits.lower, angle - SPARE), np.maximum(limits.upper, angle + SPARE)
    notes = tuple(
        f"Range of {joint.name} widened to {np.degrees(lower[i]):.0f} .. {np.degrees(upper[i]):.0f} deg: "
        f"{np.degrees(angle[i]):.0f} deg when standing."
        for i, joint in enumerate(body.joints)
        if lower[i] < limits.lower[i] or upper[i] > limits.upper[i]
    )
    tilted = f"Pelvis markers stand tilted {np.degrees(tilt):.0f} deg forwards: ranges of hip and trunk flexion are widened by as much."
    return replace(limits, lower=lower, upper=upper), (tilted, *notes)


def standing_tilt(q: Array) -> float:
    """Return the forward tilt, rad, of the pelvis in a posture q: how far its x axis points below the horizontal."""
    from scipy.spatial.transform import Rotation

    return -float(np.arcsin(Rotation.from_quat(q[3:7]).as_matrix()[2, 0]))


def _doubts(skeleton: Skeleton, subject: Subject, model: Reference) -> list[str]:
    """Return warnings about lengths, sides and tilts that no person has."""
    notes = []
    for segment in SEGMENTS:
        low, high = (ratio * subject.stature for ratio in LENGTH_RATIO.get(kind_of(segment), (0.0, 1.0)))
        if not low < skeleton.lengths[segment] < high:
            notes.append(
                f"Warning: {segment} is {skeleton.lengths[segment]:.3f} m long, {low:.2f} to {high:.2f} m would be usual at "
                f"{subject.stature:.2f} m: check its markers, and the stature."
            )
        other = segment.replace("right_", "left_")
        if other != segment and abs(skeleton.lengths[segment] - skeleton.lengths[other]) > 0.02:
            more = 1e3 * (skeleton.lengths[segment] - skeleton.lengths[other])
            notes.append(f"Warning: {segment} is {more:+.0f} mm longer than {other}: check the markers.")
    for joint, rotation in skeleton.turns.items():
        tilt = np.degrees(np.arccos((np.trace(rotation) - 1) / 2))
        if tilt > TILT[joint.split("_")[1]]:
            notes.append(f"Warning: {joint} stands {tilt:.0f} deg away from its axes: check the markers beside it and the wand above it.")
    return notes
