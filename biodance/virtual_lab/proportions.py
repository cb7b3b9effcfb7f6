"""The true size of a virtual person: segment lengths, breadths and joint centres drawn around published proportions.

Lengths: Dumas & Wojtusch 2018 (statures 1.61 m and 1.77 m). Ankle height, foot and knee measures: Winter 2009. Hip and shoulder distances:
means of the static trials of nine adults in public recordings. All lengths are in fractions of stature.
"""

from dataclasses import dataclass

from biodance.records import Array, Subject
from biodance.virtual_lab.randomness import stream

FEMALE = {"thigh": 0.2354, "shank": 0.2410, "pelvis": 0.0640, "lumbar": 0.0776, "thorax": 0.2000, "head": 0.1509}
MALE = {"thigh": 0.2441, "shank": 0.2446, "pelvis": 0.0525, "lumbar": 0.0853, "thorax": 0.1887, "head": 0.1571}
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
    """``size`` m by name (the keys of this module's tables); ``centre_shift`` (16, 3) m moves the joint centres off the ideal anatomy,
    ``axis_tilt`` (16, 3) rad turns the joint axes off it; rows in the order of ``skeleton.SEGMENTS``.
    """

    size: dict[str, float]
    centre_shift: Array
    axis_tilt: Array

    def __getitem__(self, name: str) -> float:
        """Return one size, m."""
        return self.size[name]


def draw_proportions(subject: Subject, seed: int, *, length_sd: float, centre_sd: float, tilt_sd: float) -> Proportions:
    """Draw a person's true proportions: the upright chain from sole to vertex adds up to the stature exactly.

    ``length_sd`` relative standard deviation of every length; ``centre_sd`` m and ``tilt_sd`` rad per axis for joint centres and axes.
    """
    rng = stream(seed, "proportions")
    female = subject.sex == "F"
    mean = (FEMALE if female else MALE) | (FEMALE_ARM if female else MALE_ARM) | BREADTHS
    size = {name: fraction * subject.stature * (1 + length_sd * rng.normal()) for name, fraction in mean.items()}
    stretch = subject.stature / sum(size[name] for name in UPRIGHT_CHAIN)
    size |= {name: size[name] * stretch for name in UPRIGHT_CHAIN} | {"stature": subject.stature}
    return Proportions(size, centre_sd * rng.normal(size=(16, 3)), tilt_sd * rng.normal(size=(16, 3)))
