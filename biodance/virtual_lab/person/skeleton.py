"""The true size and skeleton of a virtual person, 16 segments, 39 joint angles - more than any model that reads the
recording has -, and where its 39 plug-in-gait markers are glued, with an error per session; and how far all else is
from the ideal between the bone and the file: the truth that is drawn from, and the reproducible random streams and
smooth random motions that draw it.

Places of markers: means of the static trials of nine adults in public recordings, moved from the 12 segments of the
reading model to the true ones. Wands (THI, TIB, UPA, FRM) sit at a different height on each side, as the guide of the
marker set asks.

Tolerances, units and sources are the rows "virtual" of ``anthropometry/uncertainty/sizes.csv``. "Prototype" there is
the set of sizes with which synthetic sessions behaved like real ones; sensor numbers are from makers' sheets and from
in-situ measurements. Every tolerance can be set to zero alone (``dataclasses.replace``); ``PERFECT`` has all of them
at zero.
"""

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any
from zlib import crc32

import numpy as np

from biodance.body.parts import Joint, SegmentMarkers
from biodance.body.tables.error_sizes import error_rows
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array, Subject


@dataclass(frozen=True)
class LabTolerances:
    """Standard deviations of what is drawn for a person, a session and a trial (SI units, radians); all >= 0."""

    # the person: drawn once from the person's seed
    segment_mass: float
    side_mass: float
    segment_shape: float
    com: float
    segment_length: float
    joint_centre: float
    joint_axis: float
    # the motion
    head_motion: float
    thorax_motion: float
    thorax_share: float
    wrist_motion: float
    clavicle_rhythm: float
    girdle_motion: float
    performance: float
    tremor: float
    sway: float
    breathing: float
    # the skin
    marker_placement: float
    soft_tissue: float
    soft_tissue_day: float
    # the cameras
    camera_noise: float
    camera_wander: float
    gaps_per_minute: float
    lab_tilt: float
    measure: float
    scale: float
    # the plate
    plate_position: float
    plate_rotation: float
    plate_gain: float
    plate_crosstalk: float
    plate_offset: float
    plate_noise: float
    plate_delay: float


REALISTIC = LabTolerances(**{row["quantity"]: float(row["sd"]) for row in error_rows(whose="virtual")})
PERFECT = LabTolerances(**{f.name: 0.0 for f in fields(LabTolerances)})


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """Return the random stream of one ``purpose``: drawing more numbers for one purpose never changes another."""
    return np.random.default_rng([seed, *(crc32(word.encode()) for word in purpose)])


def smooth_noise(rng: np.random.Generator, time: Array, *, columns: int, cutoff: float) -> Array:
    """Return smooth random curves (T, columns) of zero mean and unit expected standard deviation.

    ``time`` (T,) s, equidistant; ``cutoff`` Hz: the amplitude spectrum falls as exp(-(f / cutoff)²), so all derivatives
    exist. The number of draws depends on the duration and the cutoff, not on the sampling rate.
    """
    # Longer than the recording: no curve repeats itself in it.
    duration = 2.0 * (time[-1] - time[0]) + 1.0
    frequency = np.arange(1, int(np.ceil(3.0 * cutoff * duration)) + 1) / duration
    weight = np.exp(-((frequency / cutoff) ** 2))
    # Cosine and sine together have the variance weight² at any time.
    weight /= np.sqrt(np.sum(weight**2))
    cosine, sine = rng.normal(size=(2, frequency.size, columns)) * weight[None, :, None]
    phase = 2 * np.pi * np.outer(time, frequency)
    return np.cos(phase) @ cosine + np.sin(phase) @ sine


@cache
def virtual_people() -> dict[str, Any]:
    """Return what is true of the people of the virtual laboratory: ``anthropometry/virtual/people.toml``."""
    return read_toml(locate("anthropometry/virtual", "people"))


UPRIGHT_CHAIN = ("ankle_height", "shank", "thigh", "pelvis", "lumbar", "thorax", "head")


@dataclass(frozen=True)
class Proportions:
    """``size`` m by name (the keys of `virtual_people`); ``centre_shift`` (16, 3) m moves the joint centres off the
    ideal anatomy, ``axis_tilt`` (16, 3) rad turns the joint axes off it; rows in the order of `TRUE_SEGMENTS`.
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
    mean = virtual_people()["lengths"][subject.sex] | virtual_people()["breadths"]
    size = {name: fraction * subject.stature * (1 + length_sd * rng.normal()) for name, fraction in mean.items()}
    # One factor for the whole chain.
    stretch = subject.stature / sum(size[name] for name in UPRIGHT_CHAIN)
    size |= {name: size[name] * stretch for name in UPRIGHT_CHAIN} | {"stature": subject.stature}
    return Proportions(size, centre_sd * rng.normal(size=(16, 3)), tilt_sd * rng.normal(size=(16, 3)))


ARM_AND_LEG = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
TRUE_SEGMENTS = ("pelvis", "lumbar", "thorax", "head", *(f"{side}_{part}" for side in SIDES for part in ARM_AND_LEG))
_X, _Y, _Z = np.eye(3)

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


def build_joints(size: Proportions) -> tuple[Joint, ...]:
    """Return the 39 joints of a person of the given proportions, in topological order."""
    joints, stature = list[Joint](), size["stature"]

    def add(joint: str, segment: str, parent: int, place: Array, *, side: str = "") -> int:
        """Append one anatomical joint (rotations in turn) at ``place`` (3,) m in the parent's; return its index."""
        row = TRUE_SEGMENTS.index(segment) if segment else -1
        turn, shift = np.eye(3), np.array(place)
        if segment:
            turn, shift = small_rotation(size.axis_tilt[row]), shift + size.centre_shift[row]
        for motion, axis in ROTATIONS[joint]:
            axis = axis * ([-1.0, -1.0, 1.0] if side == "left" else [1.0, 1.0, 1.0])
            joints.append(Joint(f"{side}_{joint}_{motion}".lstrip("_"), parent, axis, turn, shift, -1))
            parent, turn, shift = len(joints) - 1, np.eye(3), np.zeros(3)
        joints[-1] = replace(joints[-1], segment=row)
        return parent

    for side in SIDES:
        hip = add("hip", f"{side}_thigh", -1, on_side(np.array([0, 0, size["hips"] / 2]), side), side=side)
        knee = add("knee", f"{side}_shank", hip, -size["thigh"] * _Y, side=side)
        add("ankle", f"{side}_foot", knee, -size["shank"] * _Y, side=side)
    lumbar = add("lumbar", "lumbar", -1, np.array([-0.012 * stature, size["pelvis"], 0]))
    thorax = add("thorax", "thorax", lumbar, np.array([0.004 * stature, size["lumbar"], 0]))
    add("neck", "head", thorax, size["thorax"] * _Y)
    for side in SIDES:
        sternum = np.array([0.025 * stature, size["thorax"] - 0.042 * stature, 0.012 * stature])
        shoulder = np.array([0.0, size["thorax"] - size["shoulder_drop"], size["shoulders"] / 2])
        clavicle = add("clavicle", "", thorax, on_side(sternum, side), side=side)
        arm = add("shoulder", f"{side}_upper_arm", clavicle, on_side(shoulder - sternum, side), side=side)
        elbow = add("elbow", "", arm, -size["upper_arm"] * _Y, side=side)
        forearm = add("forearm", f"{side}_forearm", elbow, np.zeros(3), side=side)
        add("wrist", f"{side}_hand", forearm, -size["forearm"] * _Y, side=side)
    return tuple(joints)


MARKER_RADIUS = 0.007
"""m; 14 mm markers, the plug-in-gait default."""
SKIN_PLANE = np.array([1.0, 1.0, 0.35])
"""Placement errors are along the skin; through it (z of the limbs' lateral markers) bone holds the marker."""

MarkerPlace = tuple[str, tuple[float, float, float]]


def _places(size: Proportions) -> tuple[dict[str, MarkerPlace], dict[str, MarkerPlace]]:
    """Return places (segment, (3,) m) of paired markers, for the right side; and those of all others."""
    s = size["stature"]
    shoulder = size["thorax"] - size["shoulder_drop"]
    r = MARKER_RADIUS
    paired: dict[str, MarkerPlace] = {
        "ASI": ("pelvis", (0.026 * s, 0.054 * s, size["asis"] / 2)),
        "PSI": ("pelvis", (-0.073 * s, 0.053 * s, 0.0294 * s)),
        "THI": ("thigh", (0.0, -0.66 * size["thigh"], 0.048 * s)),
        "KNE": ("thigh", (0.0, -size["thigh"], size["knee_width"] / 2 + r)),
        "TIB": ("shank", (0.0, -0.50 * size["shank"], 0.036 * s)),
        "ANK": ("shank", (0.0, -size["shank"], size["ankle_width"] / 2 + r)),
        "HEE": ("foot", (-0.0308 * s, -0.0191 * s, 0.0027 * s)),
        "TOE": ("foot", (0.0902 * s, -0.0200 * s, 0.0027 * s)),
        "FHD": ("head", (0.070 * s, 0.102 * s, 0.0315 * s)),
        "BHD": ("head", (-0.015 * s, 0.090 * s, 0.0400 * s)),
        "SHO": ("thorax", (-0.005 * s, shoulder + 0.0335 * s, size["shoulders"] / 2 - 0.004 * s)),
        "UPA": ("upper_arm", (-0.004 * s, -0.60 * size["upper_arm"], 0.029 * s)),
        "ELB": ("upper_arm", (0.0, -size["upper_arm"], size["elbow_width"] / 2 + r)),
        "FRM": ("forearm", (-0.022 * s, -0.50 * size["forearm"], 0.012 * s)),
        "WRA": ("forearm", (-0.012 * s, -0.99 * size["forearm"], 0.021 * s)),
        "WRB": ("forearm", (-0.012 * s, -0.98 * size["forearm"], -0.021 * s)),
        "FIN": ("hand", (-0.016 * s, -0.95 * size["hand"], 0.004 * s)),
    }
    return paired, {
        "C7": ("thorax", (-0.034 * s, shoulder + 0.046 * s, 0.0)),
        "T10": ("thorax", (-0.058 * s, shoulder - 0.106 * s, 0.0)),
        "CLAV": ("thorax", (0.041 * s, shoulder + 0.004 * s, 0.0)),
        "STRN": ("thorax", (0.066 * s, shoulder - 0.088 * s, 0.0)),
        "RBAK": ("thorax", (-0.064 * s, shoulder - 0.022 * s, 0.060 * s)),
    }


WAND_RISE = {"THI": 0.06, "TIB": 0.05, "UPA": 0.04, "FRM": 0.03}
"""Right wands higher, left wands lower than the mean by this fraction of the segment's length."""


def ideal_places(size: Proportions) -> tuple[tuple[str, ...], tuple[int, ...], Array]:
    """Return the labels (39), their true segments (39) and their ideal places (39, 3) m in the segment frames."""
    names, segments, places = list[str](), list[int](), list[Array]()
    paired, single = _places(size)
    for side, letter in (("right", "R"), ("left", "L")):
        for stem, (kind, place) in paired.items():
            point = np.array(place)
            if stem in WAND_RISE:
                point[1] += WAND_RISE[stem] * size[kind] * (1.0 if side == "right" else -1.0)
            names.append(letter + stem)
            segments.append(TRUE_SEGMENTS.index(kind if kind in TRUE_SEGMENTS else f"{side}_{kind}"))
            places.append(on_side(point, side))
    for name, (kind, place) in single.items():
        names.append(name)
        segments.append(TRUE_SEGMENTS.index(kind))
        places.append(np.array(place))
    return tuple(names), tuple(segments), np.array(places)


def glue_markers(size: Proportions, person_seed: int, session_seed: int, *, error: float) -> SegmentMarkers:
    """Return the markers as glued in one session.

    ``error`` m per axis: half of the variance belongs to the person (bony landmarks differ), half to the day.
    """
    names, segments, places = ideal_places(size)
    person, day = stream(person_seed, "anatomy of landmarks"), stream(person_seed, "placement", str(session_seed))
    # Half the variance each.
    shift = np.sqrt(0.5) * (person.normal(size=places.shape) + day.normal(size=places.shape))
    return SegmentMarkers(names, segments, places + error * SKIN_PLANE * shift, np.ones(len(names)))
