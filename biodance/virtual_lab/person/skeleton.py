"""The true size and skeleton of a virtual person: 16 segments, 39 joint angles - more than any model that reads the
recording has.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.parts import Joint
from biodance.records import SIDES, Array, Subject
from biodance.virtual_lab.tolerances import stream

_FEMALE = {"thigh": 0.2354, "shank": 0.2410, "pelvis": 0.0640, "lumbar": 0.0776, "thorax": 0.2000, "head": 0.1509}
_MALE = {"thigh": 0.2441, "shank": 0.2446, "pelvis": 0.0525, "lumbar": 0.0853, "thorax": 0.1887, "head": 0.1571}
FEMALE_ARM = {"upper_arm": 0.1559, "forearm": 0.1534, "hand": 0.0441}
MALE_ARM = {"upper_arm": 0.1565, "forearm": 0.1599, "hand": 0.0452}
BREADTHS = {
    "ankle_height": 0.039,
    "foot": 0.0755,
    "sole": 0.152,
    "sole_breadth": 0.055,
    "hips": 0.100,
    "asis": 0.130,
    "shoulders": 0.185,
    "shoulder_drop": 0.048,
    "knee_width": 0.060,
    "ankle_width": 0.041,
    "elbow_width": 0.040,
    "wrist_width": 0.033,
    "hand_thickness": 0.016,
}
UPRIGHT_CHAIN = ("ankle_height", "shank", "thigh", "pelvis", "lumbar", "thorax", "head")


@dataclass(frozen=True)
class Proportions:
    """``size`` m by name (the keys of this module's tables); ``centre_shift`` (16, 3) m moves the joint centres off the
    ideal anatomy, ``axis_tilt`` (16, 3) rad turns the joint axes off it; rows in the order of ``skeleton.SEGMENTS``.
    """

    size: dict[str, float]
    centre_shift: Array
    axis_tilt: Array

    def __getitem__(self, name: str) -> float:
        """Return one size, m."""
        return self.size[name]


def draw_proportions(subject: Subject, seed: int, *, length_sd: float, centre_sd: float, tilt_sd: float) -> Proportions:
    """Draw a person's true proportions: the upright chain from sole to vertex adds up to the stature exactly.

    ``length_sd`` relative standard deviation of every length; ``centre_sd`` m and ``tilt_sd`` rad per axis for joint
    centres and axes.
    """
    rng = stream(seed, "proportions")
    female = subject.sex == "F"
    mean = (_FEMALE if female else _MALE) | (FEMALE_ARM if female else MALE_ARM) | BREADTHS
    size = {name: fraction * subject.stature * (1 + length_sd * rng.normal()) for name, fraction in mean.items()}
    stretch = subject.stature / sum(size[name] for name in UPRIGHT_CHAIN)
    size |= {name: size[name] * stretch for name in UPRIGHT_CHAIN} | {"stature": subject.stature}
    return Proportions(size, centre_sd * rng.normal(size=(16, 3)), tilt_sd * rng.normal(size=(16, 3)))


ARM_AND_LEG = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
TRUE_SEGMENTS = ("pelvis", "lumbar", "thorax", "head", *(f"{side}_{part}" for side in SIDES for part in ARM_AND_LEG))
_X, _Y, _Z = np.eye(3)

LIMITS_DEGREES = {
    "hip_flexion": (-25, 125),
    "hip_adduction": (-45, 30),
    "hip_rotation": (-45, 45),
    "knee_flexion": (0, 145),
    "ankle_dorsiflexion": (-50, 38),
    "ankle_inversion": (-25, 35),
    "lumbar_flexion": (-25, 80),
    "lumbar_bending": (-35, 35),
    "lumbar_rotation": (-40, 40),
    "thorax_flexion": (-20, 35),
    "thorax_bending": (-20, 20),
    "thorax_rotation": (-25, 25),
    "neck_flexion": (-60, 60),
    "neck_bending": (-45, 45),
    "neck_rotation": (-75, 75),
    "clavicle_elevation": (-10, 30),
    "clavicle_protraction": (-20, 25),
    "shoulder_flexion": (-50, 170),
    "shoulder_adduction": (-165, 35),
    "shoulder_rotation": (-85, 75),
    "elbow_flexion": (0, 145),
    "forearm_pronation": (-10, 170),
    "wrist_flexion": (-70, 80),
    "wrist_deviation": (-25, 40),
}
"""Hard anatomical ranges, young adults (Norkin & White, AAOS/AMA tables); dorsiflexion as in the weight-bearing
lunge.
"""

TrueChain = tuple[tuple[str, Array], ...]
ROTATIONS: dict[str, TrueChain] = {
    "lumbar": (("flexion", -_Z), ("bending", _X), ("rotation", _Y)),
    "thorax": (("flexion", -_Z), ("bending", _X), ("rotation", _Y)),
    "neck": (("flexion", -_Z), ("bending", _X), ("rotation", _Y)),
    "hip": (("flexion", _Z), ("adduction", _X), ("rotation", _Y)),
    "knee": (("flexion", -_Z),),
    "ankle": (("dorsiflexion", _Z), ("inversion", _X)),
    "clavicle": (("elevation", -_X), ("protraction", _Y)),
    "shoulder": (("flexion", _Z), ("adduction", _X), ("rotation", _Y)),
    "elbow": (("flexion", _Z),),
    "forearm": (("pronation", _Y),),
    "wrist": (("flexion", _Z), ("deviation", _X)),
}
"""Rotations of every joint in order, axes for the right side; on the left the x and y axes change sign."""


def on_side(vector: Array, side: str) -> Array:
    """Return a place on the right side (3,) as the same place on ``side``."""
    return vector * np.array([1.0, 1.0, -1.0 if side == "left" else 1.0])


def small_rotation(vector: Array) -> Array:
    """Return the rotation matrix (3, 3) of a rotation vector (3,) rad."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()


class _Builder:
    """Collects the joints of a skeleton in topological order."""

    def __init__(self, proportions: Proportions) -> None:
        self.proportions = proportions
        self.joints: list[Joint] = []

    def add(self, joint: str, segment: str, parent: int, place: Array, *, side: str = "") -> int:
        """Append one anatomical joint (a chain of rotations) at ``place`` (3,) m in the parent's frame; return its
        last index.
        """
        rotations = ROTATIONS[joint]
        row = TRUE_SEGMENTS.index(segment) if segment else -1
        for k, (motion, axis) in enumerate(rotations):
            axis = axis * ([-1.0, -1.0, 1.0] if side == "left" else [1.0, 1.0, 1.0])
            turn, shift = np.eye(3), np.zeros(3)
            if k == 0:
                shift = np.array(place)
                if segment:
                    shift = shift + self.proportions.centre_shift[row]
                    turn = small_rotation(self.proportions.axis_tilt[row])
            name = f"{side}_{joint}_{motion}" if side else f"{joint}_{motion}"
            carried = row if k == len(rotations) - 1 and segment else -1
            self.joints.append(Joint(name, parent, axis, turn, shift, carried))
            parent = len(self.joints) - 1
        return parent


def build_joints(size: Proportions) -> tuple[Joint, ...]:
    """Return the 39 joints of a person of the given proportions."""
    build, stature = _Builder(size), size["stature"]
    for side in SIDES:
        hip = build.add("hip", f"{side}_thigh", -1, on_side(np.array([0, 0, size["hips"] / 2]), side), side=side)
        knee = build.add("knee", f"{side}_shank", hip, -size["thigh"] * _Y, side=side)
        build.add("ankle", f"{side}_foot", knee, -size["shank"] * _Y, side=side)
    lumbar = build.add("lumbar", "lumbar", -1, np.array([-0.012 * stature, size["pelvis"], 0]))
    thorax = build.add("thorax", "thorax", lumbar, np.array([0.004 * stature, size["lumbar"], 0]))
    build.add("neck", "head", thorax, size["thorax"] * _Y)
    for side in SIDES:
        sternum = np.array([0.025 * stature, size["thorax"] - 0.042 * stature, 0.012 * stature])
        shoulder = np.array([0.0, size["thorax"] - size["shoulder_drop"], size["shoulders"] / 2])
        clavicle = build.add("clavicle", "", thorax, on_side(sternum, side), side=side)
        arm = build.add("shoulder", f"{side}_upper_arm", clavicle, on_side(shoulder - sternum, side), side=side)
        elbow = build.add("elbow", "", arm, -size["upper_arm"] * _Y, side=side)
        forearm = build.add("forearm", f"{side}_forearm", elbow, np.zeros(3), side=side)
        build.add("wrist", f"{side}_hand", forearm, -size["forearm"] * _Y, side=side)
    return tuple(build.joints)
