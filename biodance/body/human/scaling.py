"""The human of one subject from the static trial: joint centres, lengths, constant joint tilts and every marker."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.body.human.human import assemble
from biodance.body.human.measures import Measures, StaticPosture, harrington_hip, measures, pelvis_frame, standing, unit
from biodance.body.human.skeleton import JOINTS, SEGMENTS, Skeleton, joint_limits, joint_tree, widen_limits
from biodance.body.human.static_centres import (
    LIMB_ENDS,
    UP,
    Centres,
    SegmentFrames,
    segment_frames,
    static_centres,
)
from biodance.body.parts import SegmentMarkers
from biodance.body.tables.anthropometry import proportion
from biodance.body.tables.choice import reference
from biodance.body.tables.error_sizes import error_size
from biodance.lab.markers.sets import part_of, usual_places
from biodance.lab.markers.upright import OUTWARDS
from biodance.records import SIDES, Array, Subject, Trial
from biodance.records.attention import Doubt
from biodance.settings import STANDARD_GRAVITY
from biodance.spatial import elementary_rotation, zxy_angles

_ARM = ("upper_arm", "forearm_hand")


@dataclass(frozen=True, eq=False)
class _Upright:
    """The upright frame over a standing pelvis: ``middle`` (3,) m between the hips, unit vectors ``ahead`` and
    ``right``; ``sizes`` m by normaliser of the marker sets.
    """

    middle: Array
    ahead: Array
    right: Array
    sizes: Mapping[str, float]

    def turned(self, offset: Array) -> Array:
        """Return an offset (anterior, up, right) m in the lab frame."""
        return np.asarray(offset[0] * self.ahead + offset[1] * UP + offset[2] * self.right)

    def usual(self, landmark: str) -> Array:
        """Return the usual place (3,) m of a landmark from the origin of its offset, lab frame."""
        marker = usual_places()[landmark]
        return self.turned(np.array(marker.offset) * self.sizes[marker.normaliser])


def _with_unseen_parts(posture: StaticPosture, lengths: Mapping[str, float]) -> StaticPosture:
    """Return the posture with the landmarks of shoulders and arms that have no marker, put where they usually are."""
    mark = dict(posture.landmarks)
    rotation, middle = pelvis_frame(mark["right_asis"], mark["left_asis"], mark["mid_psis"])
    width = float(np.linalg.norm(mark["right_asis"] - mark["left_asis"]))
    local = harrington_hip(width, float(np.linalg.norm(middle - mark["mid_psis"])))
    right = unit(rotation[:, 2] * [1.0, 1.0, 0.0])
    sizes = {f"{kind.removesuffix('_hand')}_length": lengths[kind] for kind in _ARM}
    sizes["trunk_length"] = lengths["trunk_head"]
    upright = _Upright(middle + rotation @ (local * [1.0, 1.0, 0.0]), np.cross(UP, right), right, sizes)
    unseen, notes = _trunk(mark, upright)
    # Arms hang on the trunk: where it is held, nobody knows where their shoulders are.
    hidden = [side for side in SIDES if _arm(mark, upright, side, held=bool(unseen))]
    # Markers of what is carried stiffly would turn what carries it.
    segments = {f"{side}_{part}" for side in hidden for part in _ARM} | ({"trunk_head"} if unseen else set())
    worn = {marker.label for marker in posture.marker_set.markers if marker.segment in segments}
    points = {label: place for label, place in posture.points.items() if label not in worn}
    if hidden and not unseen:
        notes.append(
            f"The {' and '.join(hidden)} arm{'s carry' if len(hidden) > 1 else ' carries'} no markers that "
            "place elbow and wrist: taken as hanging straight and carried by the trunk as one piece, at the mass of "
            "the table. How arms swing is not in the simulated wrench."
        )
    unseen += [f"{side}_{joint}" for side in hidden for joint in ("shoulder", "elbow")]
    return replace(posture, points=points, landmarks=mark, unseen=tuple(unseen), notes=(*posture.notes, *notes))


def _widen_unseen(body: Body, unseen: tuple[str, ...]) -> Body:
    """Return the body with wider standard deviations of where the mass of its unseen parts is."""
    sizes = {f"{side}_{part}": "arm" for side in SIDES for part in _ARM if f"{side}_elbow" in unseen}
    sizes |= {"trunk_head": "trunk_head"} if "trunk" in unseen else {}
    if not sizes:
        return body
    covariance = np.array(body.sip.covariance)
    for segment, kind in sizes.items():
        k = body.segments.index(segment)
        moments = np.arange(10 * k + 1, 10 * k + 4)
        # First moments only: mass unchanged, its place unsure by m times the standard deviation.
        covariance[moments, moments] += (body.sip.mass[k] * error_size("unseen_com", kind)) ** 2
    return replace(body, sip=replace(body.sip, covariance=covariance))


def _trunk(mark: dict[str, Array], upright: _Upright) -> tuple[list[str], list[str]]:
    """Put the acromia that are not seen; return whether the trunk's joint is held, and what that costs."""
    absent = [side for side in SIDES if f"{side}_acromion" not in mark]
    if not absent:
        return [], []
    if len(absent) == 1 and "jugular_notch" in mark:
        seen = next(side for side in SIDES if side not in absent)
        # Mirror image at the sagittal plane through the notch: the part along `right` turned round, twice.
        across = 2 * ((mark[f"{seen}_acromion"] - mark["jugular_notch"]) @ upright.right) * upright.right
        mark[f"{absent[0]}_acromion"] = mark[f"{seen}_acromion"] - across
        return [], [f"The {absent[0]} acromion has no marker: taken as the mirror image of the other."]
    thorax = [name for name in ("c7", "jugular_notch", "t10", "xiphoid") if name in mark]
    shoulders = upright.middle + upright.sizes["trunk_length"] * UP
    if thorax:
        shoulders = np.mean([mark[name] - upright.usual(name) for name in thorax], axis=0)
    for side in absent:
        mark[f"{side}_acromion"] = shoulders + upright.usual(f"{side}_acromion")
    if len(thorax) >= 3:
        return [], [f"The acromia have no markers: shoulders placed by proportion from {', '.join(thorax)}."]
    return ["trunk"], [
        "The trunk carries too few markers to be followed: trunk, head and arms are one piece of the table's "
        "size and mass that stays upright over the pelvis and faces where it goes. How they really lean, turn and "
        "swing is not in the simulated wrench, so horizontal forces and moments prove little."
    ]


def _arm(mark: dict[str, Array], upright: _Upright, side: str, *, held: bool) -> bool:
    """Put the landmarks of an arm that is not seen, or ``held`` with its trunk, hanging straight; return whether."""
    radial, ulnar = f"{side}_wrist_radial", f"{side}_wrist_ulnar"
    wrist = [mark[name] for name in (radial, ulnar) if name in mark]
    if f"{side}_elbow_lateral" in mark and wrist and not held:
        mark |= {radial: mark.get(radial, wrist[0]), ulnar: mark.get(ulnar, wrist[0])}
        return False
    out = OUTWARDS[side] * upright.right
    under = upright.usual(f"{side}_acromion") @ UP
    elbow = mark[f"{side}_acromion"] - under * UP - upright.sizes["upper_arm_length"] * UP
    half = 0.15 * upright.sizes["upper_arm_length"]
    for name, height, across in (
        ("elbow_lateral", 0.0, half),
        ("elbow_medial", 0.0, -half),
        ("wrist_radial", upright.sizes["forearm_length"], half / 2),
        ("wrist_ulnar", upright.sizes["forearm_length"], -half / 2),
    ):
        mark[f"{side}_{name}"] = elbow - height * UP + across * out
    return True


_ANKLE_HEIGHT = (0.04, 0.12)
"""m: an ankle centre so high over z = 0 of the lab is taken to stand on that floor."""
_TILT = {"knee": 15.0, "elbow": 25.0, "ankle": 45.0}
"""deg: larger constant tilts of a joint point to a misplaced marker. Of 60 ankles of 15 public laboratories without a
fault there the largest stands 40 degrees away, of 60 elbows 24.
"""
_LENGTH_RATIO = {
    "thigh": (0.19, 0.29),
    "shank": (0.19, 0.29),
    "upper_arm": (0.12, 0.22),
    "forearm_hand": (0.10, 0.20),
    "trunk_head": (0.2, 0.36),
}
"""of stature: the lengths that adults and children have."""


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
        skeleton = _static_skeleton(frames, self.posture, self.sizes, self.subject)
        doubts = _doubts(skeleton, self.subject, self.centres)
        markers = _calibrated_markers(frames, self.posture)
        notes = (*self.notes, *doubts)
        body = assemble(self.subject, skeleton, table=self.table, markers=markers, notes=notes, gravity=self.gravity)
        return self._standing(replace(body, joint_errors=self.centres.errors), frames)

    def with_centres(self, centres: Centres) -> tuple[Body, Array]:
        """Return what a search for joint centres follows the markers with, a quarter of the work of `body`: this body
        with its joints at other ``centres``, markers calibrated anew, and its posture q (30,). What it weighs, its
        boxes, soles and notes stay those of the present centres.
        """
        frames = segment_frames(centres)
        skeleton = _static_skeleton(frames, self.posture, self.sizes, self.subject)
        markers, limits = _calibrated_markers(frames, self.posture), joint_limits(self.subject)
        joints = joint_tree(skeleton)
        return self._standing(replace(self._present, joints=joints, markers=markers, limits=limits), frames)

    @cached_property
    def _present(self) -> Body:
        return self.body()[0]

    def _standing(self, body: Body, frames: SegmentFrames) -> tuple[Body, Array]:
        """Return a body whose limits allow its static posture, unseen parts held, and that posture."""
        q = _static_posture(body, frames)
        limits, widened = widen_limits(body, q)
        body = replace(body, limits=limits, notes=(*body.notes, *widened))
        return _widen_unseen(body, self.posture.unseen).holding(self.posture.unseen, q), q


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
    posture = _with_unseen_parts(standing(static), {kind: tall * length for kind, length in lengths.items()})
    sizes = measures(posture, static, subject)
    centres = static_centres(
        posture.landmarks, sizes, hip=hip, trunk_fraction=lengths["pelvis"] / lengths["trunk_head"], flat=posture.still
    )
    scaled = f"Scaled on {'static ' * (static.role == 'static')}trial {static.name}; hip centres: {hip.capitalize()}."
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


def _calibrated_markers(frames: SegmentFrames, posture: StaticPosture) -> SegmentMarkers:
    """Return every marker of the set that was seen and counts, at its place in its segment."""
    worn = [one for one in posture.marker_set.markers if one.label in posture.points and one.weight > 0]
    local = [frames.rotation[m.segment].T @ (posture.points[m.label] - frames.origin[m.segment]) for m in worn]
    return SegmentMarkers(
        tuple(m.label for m in worn),
        tuple(SEGMENTS.index(m.segment) for m in worn),
        np.array(local),
        np.array([m.weight for m in worn]),
    )


def _static_skeleton(frames: SegmentFrames, posture: StaticPosture, sizes: Measures, subject: Subject) -> Skeleton:
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
    if part_of(child) == "foot":
        # Ry: R20 = -sin, R00 = cos.
        return elementary_rotation("y", np.arctan2(-relative[2, 0], relative[0, 0]))
    # R = Rz(flexion) Rx(varus): R21 = sin(varus), whatever the flexion.
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


def _static_posture(body: Body, frames: SegmentFrames) -> Array:
    """Return q (30,) of the body in the static trial."""
    from scipy.spatial.transform import Rotation

    q = np.zeros(body.nq)
    q[:3], q[3:7] = frames.origin["pelvis"], Rotation.from_matrix(frames.rotation["pelvis"]).as_quat()
    for group in JOINTS:
        chain = [i for i, joint in enumerate(body.joints) if joint.name.rsplit("_", 1)[0] == group]
        first, last = body.joints[chain[0]], body.joints[chain[-1]]
        above = body.segments[body.joints[first.parent].segment if first.parent >= 0 else 0]
        # joint_R_child: from the parent's pose, the frame of the joint and the child's pose.
        relative = first.rotation.T @ frames.rotation[above].T @ frames.rotation[body.segments[last.segment]]
        q[7 + np.array(chain)] = chain_angles(relative, np.array([body.joints[i].axis for i in chain]))
    return q


def chain_angles(relative: Array, axes: Array) -> Array:
    """Return the angles, rad, about the signed axes (n, 3) of a joint whose product of rotations is ``relative`` (3,
    3).

    One axis: any. Two: z then x. Three: z then x then y.
    """
    if len(axes) == 1:
        # (R - R')/2 as a vector is sin(angle) times the axis, (trace - 1) / 2 its cosine.
        odd = (relative - relative.T) / 2
        return np.array([np.arctan2(axes[0] @ [odd[2, 1], odd[0, 2], odd[1, 0]], (np.trace(relative) - 1) / 2)])
    if len(axes) == 2:
        angles = [np.arctan2(relative[1, 0], relative[0, 0]), np.arctan2(relative[2, 1], relative[2, 2])]
    else:
        angles = [float(angle) for angle in zxy_angles(relative)]
    # Signed axes: +1 or -1 along one coordinate each.
    return axes.sum(axis=1) * np.array(angles)


def tilted_joints(body: Body) -> tuple[str, ...]:
    """Return the hinges of a ``body`` that stand away from their axes (`_TILT`) in the static trial: ``left_elbow``."""
    first = {joint.name.rsplit("_", 1)[0]: joint.rotation for joint in reversed(body.joints)}
    hinges = ((f"{side}_{joint}", most) for side in SIDES for joint, most in _TILT.items())
    return tuple(name for name, most in hinges if name in first and _tilt(first[name]) > most)


def _tilt(rotation: Array) -> float:
    """Return the angle of a ``rotation`` (3, 3), deg."""
    # trace = 1 + 2 cos.
    return float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0))))


def _doubts(skeleton: Skeleton, subject: Subject, centres: Centres) -> list[Doubt]:
    """Return warnings about lengths, sides and tilts that no person has."""
    notes = []
    for segment in SEGMENTS:
        low, high = (ratio * subject.stature for ratio in _LENGTH_RATIO.get(part_of(segment), (0.0, 1.0)))
        if not low < skeleton.lengths[segment] < high:
            notes.append(
                Doubt(
                    f"{segment} is {skeleton.lengths[segment]:.3f} m long, {low:.2f} to {high:.2f} m would be usual at "
                    f"{subject.stature:.2f} m",
                    "Check its markers, and the stature.",
                    about=(segment,),
                )
            )
        other = segment.replace("right_", "left_")
        more = skeleton.lengths[segment] - skeleton.lengths[other]
        # Doubted beyond two standard deviations of the difference, as any size that is told.
        if part_of(segment) in LIMB_ENDS and abs(more) > 2.0 * centres.sides_sd(part_of(segment)):
            how = f"is {1e3 * abs(more):.0f} mm {'longer' if more > 0 else 'shorter'} than"
            fact = f"the {segment.replace('_', ' ')} {how} the {other.replace('_', ' ')}"
            notes.append(Doubt(fact, "Check the markers.", about=(segment, other)))
    for joint, rotation in skeleton.turns.items():
        tilt = _tilt(rotation)
        if tilt > _TILT[joint.split("_")[1]]:
            fact = f"{joint.replace('_', ' ')} stands {tilt:.0f} degrees away from its axes"
            notes.append(Doubt(fact, "Check the markers beside it and the wand above it.", about=(joint,)))
    return notes
