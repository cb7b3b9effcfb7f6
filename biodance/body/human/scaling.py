"""The human of one subject: joint centres, segment lengths, constant joint tilts and every marker from the static
trial.

The static posture is reached exactly by the body: whatever the joints cannot do (a knee has no varus, an ankle no
torsion, an elbow no carrying angle) becomes a constant tilt of that joint, so that in the static trial every marker and
joint centre has residual zero.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.body.human.human import assemble
from biodance.body.human.limits import joint_limits, widen_limits
from biodance.body.human.measures import Measures, measures
from biodance.body.human.skeleton import JOINTS, SEGMENTS, Skeleton, joint_tree, kind_of
from biodance.body.human.standing import StaticPosture, standing
from biodance.body.human.static_centres import LIMB_ENDS, Centres, SegmentFrames, segment_frames, static_centres
from biodance.body.human.unseen import widen_unseen, with_unseen_parts
from biodance.body.parts import SegmentMarkers
from biodance.body.tables.anthropometry import proportion
from biodance.body.tables.choice import reference
from biodance.records import SIDES, Array, Subject, Trial
from biodance.settings import STANDARD_GRAVITY
from biodance.spatial import elementary_rotation, zxy_angles

_ANKLE_HEIGHT = (0.04, 0.12)
"""m: an ankle centre so high over z = 0 of the lab is taken to stand on that floor."""
TILT = {"knee": 15.0, "elbow": 25.0, "ankle": 45.0}
"""deg: larger constant tilts of a joint point to a misplaced marker. Of 60 ankles of 15 public laboratories without a
fault there the largest stands 40 degrees away, of 60 elbows 24.
"""
LENGTH_RATIO = {
    "thigh": (0.19, 0.29),
    "shank": (0.19, 0.29),
    "upper_arm": (0.12, 0.22),
    "forearm_hand": (0.10, 0.20),
    "trunk_head": (0.2, 0.36),
}
"""of stature: the lengths that adults and children have."""

_UNEQUAL = 2.0
"""Standard deviations of the difference between a limb's sides beyond which its markers are doubted, as of any size
that is told."""


@dataclass(frozen=True, eq=False)
class Scaling:
    """All that a scaled body is made of: the standing posture, its measures, the joint centres, the ``table`` of
    masses, ``gravity`` m/s². With other ``centres`` (``dataclasses.replace``) it makes the body of the same person with
    joints elsewhere.
    """

    subject: Subject
    table: str
    posture: StaticPosture
    sizes: Measures
    centres: Centres
    notes: tuple[str, ...]
    gravity: float = STANDARD_GRAVITY

    def body(self) -> tuple[Body, Array]:
        """Return the scaled body and its posture q (30,) in the static trial, meeting all markers exactly."""
        frames = segment_frames(self.centres)
        skeleton = static_skeleton(frames, self.posture, self.sizes, self.subject)
        doubts = _doubts(skeleton, self.subject, self.centres)
        markers = calibrated_markers(frames, self.posture)
        notes = (*self.notes, *doubts)
        body = assemble(self.subject, skeleton, table=self.table, markers=markers, notes=notes, gravity=self.gravity)
        return self._standing(replace(body, joint_errors=self.centres.errors), frames)

    def with_centres(self, centres: Centres) -> tuple[Body, Array]:
        """Return what a search for joint centres follows the markers with, a quarter of the work of `body`: this body
        with its joints at other ``centres``, markers calibrated anew, and its posture q (30,). What it weighs, its
        boxes, soles and notes stay those of the present centres.
        """
        frames = segment_frames(centres)
        skeleton = static_skeleton(frames, self.posture, self.sizes, self.subject)
        markers, limits = calibrated_markers(frames, self.posture), joint_limits(self.subject)
        joints = joint_tree(skeleton)
        return self._standing(replace(self._present, joints=joints, markers=markers, limits=limits), frames)

    @cached_property
    def _present(self) -> Body:
        return self.body()[0]

    def _standing(self, body: Body, frames: SegmentFrames) -> tuple[Body, Array]:
        """Return a body whose limits allow its posture in the static trial, unseen parts held as they stand, and that
        posture.
        """
        q = static_posture(body, frames)
        limits, widened = widen_limits(body, q)
        body = replace(body, limits=limits, notes=(*body.notes, *widened))
        return widen_unseen(body, self.posture.unseen).holding(self.posture.unseen, q), q


def measure_static(subject: Subject, static: Trial) -> Scaling:
    """Return what the static trial says about the body of a subject, by the table and the regression of the hip joint
    centres that ``static.settings`` choose.

    The table gives masses, CoM, inertias and where the trunk joint lies between mid hip and mid shoulder. ``notes`` of
    the body say what was measured, assumed, contradicted and warned about. Raises as `scale` does.
    """
    subject.require("mass", "stature")
    hip, table = static.settings.hip, static.settings.table
    usual = reference(table, subject)
    lengths = usual.lengths
    tall = subject.stature / usual.stature
    posture = with_unseen_parts(standing(static), {kind: tall * length for kind, length in lengths.items()})
    sizes = measures(posture, static, subject)
    centres = static_centres(
        posture.landmarks, sizes, hip=hip, trunk_fraction=lengths["pelvis"] / lengths["trunk_head"], flat=posture.still
    )
    scaled = f"Scaled on static trial {static.name}; hip centres: {hip.capitalize()}."
    notes = (scaled, *posture.notes, *sizes.notes, *centres.notes)
    return Scaling(subject, table, posture, sizes, centres, notes, static.settings.gravity)


def scale(subject: Subject, static: Trial) -> Body:
    """Return the body of a subject, scaled on the static trial alone, with every marker calibrated in its segment.

    Parameters
    ----------
    subject : Subject
        Mass kg, stature m, sex.
    static : Trial
        Standing still, with markers of a known set; its settings choose the regression of the hip joint centres and
        the table of segment inertial parameters.

    Returns
    -------
    Body
        In the static posture every marker and joint centre has residual zero.

    Raises
    ------
    TrialRefused
        The static trial has no markers, no known marker set, or misses a landmark; all missing ones are named.
    UnknownName
        There is no such table.
    SessionRefused
        The mass or the stature of the subject is not known.

    References
    ----------
    Harrington et al. 2007, doi:10.1016/j.jbiomech.2006.02.003; Davis et al. 1991, doi:10.1016/0167-9457(91)90046-Z.

    Examples
    --------
    >>> biodance.scale(session.subject, session["static"])
    Body('visit', 12 segments, 23 joint angles, 61.9 kg)
    """
    return measure_static(subject, static).body()[0]


def calibrated_markers(frames: SegmentFrames, posture: StaticPosture) -> SegmentMarkers:
    """Return every marker of the set that was seen and counts, at its place in its segment."""
    worn = [one for one in posture.marker_set.markers if one.label in posture.points and one.weight > 0]
    local = [frames.rotation[m.segment].T @ (posture.points[m.label] - frames.origin[m.segment]) for m in worn]
    return SegmentMarkers(
        tuple(m.label for m in worn),
        tuple(SEGMENTS.index(m.segment) for m in worn),
        np.array(local),
        np.array([m.weight for m in worn]),
    )


def static_skeleton(frames: SegmentFrames, posture: StaticPosture, sizes: Measures, subject: Subject) -> Skeleton:
    """Return the sizes of the skeleton in the static trial."""

    def local(segment: str, point: Array) -> Array:
        return np.asarray(frames.rotation[segment].T @ (point - frames.origin[segment]))

    shoulders = (frames.origin["right_upper_arm"] + frames.origin["left_upper_arm"]) / 2
    origins = {"trunk": local("pelvis", frames.origin["trunk_head"])}
    cut = {segment: local(segment, frames.cut) for segment in ("pelvis", "trunk_head")}
    lengths = {
        "pelvis": float(np.linalg.norm(cut["pelvis"])),
        "trunk_head": float(np.linalg.norm(shoulders - frames.origin["pelvis"])),
    }
    turns: dict[str, Array] = {}
    height: dict[str, float] = {}
    behind: dict[str, float] = {}
    for side in SIDES:
        thigh, shank, foot, arm, forearm = (
            f"{side}_{kind}" for kind in ("thigh", "shank", "foot", "upper_arm", "forearm_hand")
        )
        for joint, parent, child in (("hip", "pelvis", thigh), ("shoulder", "trunk_head", arm)):
            origins[f"{side}_{joint}"] = local(parent, frames.origin[child])
        for joint, parent, child in (("knee", thigh, shank), ("ankle", shank, foot), ("elbow", arm, forearm)):
            origins[f"{side}_{joint}"] = local(parent, frames.origin[child])
            lengths[parent] = float(np.linalg.norm(origins[f"{side}_{joint}"]))
            turns[f"{side}_{joint}"] = _turn(frames, parent, child)
        lengths[forearm] = float(np.linalg.norm(local(forearm, frames.ends[f"{side}_wrist"])))
        lengths[foot], height[side], behind[side] = _foot(frames, posture, sizes, subject, side)
    return Skeleton(lengths, origins, height, behind, sizes.pelvis_width, subject.stature, turns, cut)


def _turn(frames: SegmentFrames, parent: str, child: str) -> Array:
    """Return the constant part of parent_R_child: a hinge's varus about x, an ankle's torsion about y."""
    relative = frames.rotation[parent].T @ frames.rotation[child]
    if kind_of(child) == "foot":
        return elementary_rotation("y", np.arctan2(-relative[2, 0], relative[0, 0]))
    return elementary_rotation("x", np.arcsin(relative[2, 1]))


def _foot(
    frames: SegmentFrames, posture: StaticPosture, sizes: Measures, subject: Subject, side: str
) -> tuple[float, float, float]:
    """Return foot length, height of the ankle over the sole, and how far the heel lies behind the ankle, m."""
    place, ankle = posture.landmarks, frames.origin[f"{side}_foot"]
    heel, toe = (frames.rotation[f"{side}_foot"].T @ (place[f"{side}_{end}"] - ankle) for end in ("heel", "toe"))
    length = float(toe[0] - heel[0]) / proportion("heel_to_toe_marker", subject.sex)
    standing_on_zero = posture.still and _ANKLE_HEIGHT[0] < ankle[2] < _ANKLE_HEIGHT[1]
    height = float(ankle[2]) if standing_on_zero else proportion("ankle_height", subject.sex) * subject.stature
    return length, height, float(-heel[0]) - sizes.marker_radius


def static_posture(body: Body, frames: SegmentFrames) -> Array:
    """Return q (30,) of the body in the static trial."""
    from scipy.spatial.transform import Rotation

    q = np.zeros(body.nq)
    q[:3], q[3:7] = frames.origin["pelvis"], Rotation.from_matrix(frames.rotation["pelvis"]).as_quat()
    for group in JOINTS:
        chain = [i for i, joint in enumerate(body.joints) if joint.name.rsplit("_", 1)[0] == group]
        first, last = body.joints[chain[0]], body.joints[chain[-1]]
        above = body.segments[body.joints[first.parent].segment if first.parent >= 0 else 0]
        relative = first.rotation.T @ frames.rotation[above].T @ frames.rotation[body.segments[last.segment]]
        q[7 + np.array(chain)] = chain_angles(relative, np.array([body.joints[i].axis for i in chain]))
    return q


def chain_angles(relative: Array, axes: Array) -> Array:
    """Return the angles, rad, about the signed axes (n, 3) of a joint whose product of rotations is ``relative`` (3,
    3).

    One axis: any. Two: z then x. Three: z then x then y.
    """
    if len(axes) == 1:
        odd = (relative - relative.T) / 2
        return np.array([np.arctan2(axes[0] @ [odd[2, 1], odd[0, 2], odd[1, 0]], (np.trace(relative) - 1) / 2)])
    if len(axes) == 2:
        angles = [np.arctan2(relative[1, 0], relative[0, 0]), np.arctan2(relative[2, 1], relative[2, 2])]
    else:
        angles = [float(angle) for angle in zxy_angles(relative)]
    return axes.sum(axis=1) * np.array(angles)


def tilted_joints(body: Body) -> tuple[str, ...]:
    """Return the hinges of a ``body`` that stand away from their axes (`TILT`) in the static trial: ``left_elbow``."""
    first = {joint.name.rsplit("_", 1)[0]: joint.rotation for joint in reversed(body.joints)}
    hinges = ((f"{side}_{joint}", most) for side in SIDES for joint, most in TILT.items())
    return tuple(name for name, most in hinges if name in first and _tilt(first[name]) > most)


def _tilt(rotation: Array) -> float:
    """Return the angle of a ``rotation`` (3, 3), deg."""
    return float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0))))


def _doubts(skeleton: Skeleton, subject: Subject, centres: Centres) -> list[str]:
    """Return warnings about lengths, sides and tilts that no person has."""
    notes = []
    for segment in SEGMENTS:
        low, high = (ratio * subject.stature for ratio in LENGTH_RATIO.get(kind_of(segment), (0.0, 1.0)))
        if not low < skeleton.lengths[segment] < high:
            notes.append(
                f"Warning: {segment} is {skeleton.lengths[segment]:.3f} m long, {low:.2f} to {high:.2f} m would be "
                f"usual at {subject.stature:.2f} m: check its markers, and the stature."
            )
        other = segment.replace("right_", "left_")
        more = skeleton.lengths[segment] - skeleton.lengths[other]
        if kind_of(segment) in LIMB_ENDS and abs(more) > _UNEQUAL * centres.sides_sd(kind_of(segment)):
            how = f"is {1e3 * abs(more):.0f} mm {'longer' if more > 0 else 'shorter'} than"
            notes.append(
                f"Warning: the {segment.replace('_', ' ')} {how} the {other.replace('_', ' ')}: check the markers."
            )
    for joint, rotation in skeleton.turns.items():
        tilt = _tilt(rotation)
        if tilt > TILT[joint.split("_")[1]]:
            notes.append(
                f"Warning: {joint.replace('_', ' ')} stands {tilt:.0f} degrees away from its axes: check the markers "
                f"beside it and the wand above it."
            )
    return notes
