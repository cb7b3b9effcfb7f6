"""The joint tree of the human from its sizes: where each joint sits and how its axes turn."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from biodance.body.parts import Joint
from biodance.body.tables.anthropometry import KINDS, Reference, proportion, read_table, row_numbers
from biodance.records import SIDES, Array, Subject

SEGMENTS = (
    *("pelvis", "right_thigh", "right_shank", "right_foot", "left_thigh", "left_shank", "left_foot", "trunk_head"),
    *("right_upper_arm", "right_forearm_hand", "left_upper_arm", "left_forearm_hand"),
)
JOINTS = (
    *("right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle", "trunk"),
    *("right_shoulder", "right_elbow", "left_shoulder", "left_elbow"),
)
"""Anatomical joints; each is one to three ``Joint`` records named ``<joint>_<movement>``."""


def kind_of(segment: str) -> str:
    """Return the segment's name without its side: ``left_thigh`` -> ``thigh``."""
    return segment.removeprefix("right_").removeprefix("left_")


def side_of(segment: str) -> float:
    """Return +1 for a right or midline segment, -1 for a left one (the sign of z)."""
    return -1.0 if segment.startswith("left_") else 1.0


def upright_to(point: Array) -> Array:
    """Return the rotation (3, 3) about z that turns y towards a point (3,) in the sagittal plane."""
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
    lengths = {segment: kinds[kind_of(segment)] for segment in SEGMENTS}
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
