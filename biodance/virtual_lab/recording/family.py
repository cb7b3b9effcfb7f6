"""The family of laboratories: a virtual laboratory drawn from a seed, and the people who come to it.

No single laboratory is the truth. What a new one has is drawn from here: how many parts of the body move by themselves,
which table its people are nearest to, how soft their skin is and in which way, how quiet cameras and plates are, how
far everything is from the ideal, how restless people are, adults or children, one to four plates, joints from the
movement or from the static trial.
"""

from dataclasses import fields, replace

import numpy as np

from biodance.records import Subject
from biodance.virtual_lab.recording.cameras import TISSUES
from biodance.virtual_lab.recording.laboratory import Laboratory
from biodance.virtual_lab.tolerances import REALISTIC, LabTolerances, stream

CAMERAS = (1.0e-5, 3.0e-4)
"""m of white noise per axis: 0.013 to 0.06 mm in good public recordings, to 0.2 mm in others."""
PLATES = (0.02, 0.15)
"""N per root Hz of Fz: unloaded plates of public recordings have 0.05 to 0.12."""
_SPREAD = 0.4
"""Standard deviation of the natural logarithm of how many times the usual tolerances a laboratory has."""
_MOMENTS = 0.3
"""N·m: a laboratory's zeros of moments are drawn up to twice this."""
_SEGMENTS = (12, 14, 16, 18, 20, 22)
_ALONE = {14: ("head_motion", "thorax_motion", "thorax_share"), 16: ("wrist_motion", "clavicle_rhythm")}
"""What moves by itself from so many segments on; below, it is rigid."""
SOFT_PARTS = ("right_thigh", "left_thigh", "right_shank", "left_shank", "trunk_head", "pelvis")
"""Segments whose flesh swings on a spring from 17, 18, ... segments on."""
SWINGING = 0.1
"""Share of a segment's mass that swings then."""
_INSTRUMENTS = ("lab_tilt", "plate_position", "plate_rotation", "plate_gain", "plate_crosstalk", "plate_offset")
_PEOPLE = ("segment_mass", "side_mass", "segment_shape", "com", "segment_length", "joint_centre", "joint_axis",
           "head_motion", "thorax_motion", "wrist_motion", "breathing", "marker_placement", "measure")  # fmt: skip
_UNREST = ("performance", "tremor", "sway")


def draw_laboratory(seed: int) -> Laboratory:
    """Return laboratory number ``seed`` of the family; the same number is the same laboratory for ever."""
    rng = stream(seed, "laboratory")
    segments = int(rng.choice(_SEGMENTS))
    rate = float(rng.choice([100.0, 120.0, 200.0]))
    return Laboratory(
        centre=(float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1))),
        heading=float(rng.uniform(0, 2 * np.pi)),
        plates=int(rng.integers(1, 5)),
        plate_type=int(rng.choice([2, 4])),
        camera_rate=rate,
        samples=int(rng.choice([5, 10])),
        tolerances=_drawn_tolerances(rng, segments),
        moment_zero=float(rng.uniform(0, 2) * _MOMENTS),
        segments=segments,
        tissue=str(rng.choice(list(TISSUES))),
        population=seed,
        joints=str(rng.choice(["functional", "static"], p=[0.75, 0.25])),
        children=bool(rng.random() < 0.3),
    )


def _drawn_tolerances(rng: np.random.Generator, segments: int) -> LabTolerances:
    """Draw how far everything is from the ideal: each tolerance by itself, and all unrest of people together."""
    known = {one.name for one in fields(LabTolerances)}
    times = {name: float(np.exp(_SPREAD * rng.normal())) for name in (*_INSTRUMENTS, *_PEOPLE)}
    times |= dict.fromkeys(_UNREST, float(np.clip(np.exp(_SPREAD * rng.normal()), 0.5, 2.5)))
    times |= {name: 0.0 for least, names in _ALONE.items() if segments < least for name in names}
    drawn = {name: factor * getattr(REALISTIC, name) for name, factor in times.items() if name in known}
    soft = REALISTIC.soft_tissue * float(np.clip(np.exp(_SPREAD * rng.normal()), 0.5, 2.0))
    density = float(np.exp(rng.uniform(*np.log(PLATES))))
    return replace(
        REALISTIC,
        **drawn,
        soft_tissue=soft,
        camera_noise=float(np.exp(rng.uniform(*np.log(CAMERAS)))),
        camera_wander=float(np.exp(rng.uniform(*np.log([1.0e-4, 6.0e-4])))),
        gaps_per_minute=float(np.exp(rng.uniform(*np.log([0.2, 4.0])))),
        plate_noise=density * float(np.sqrt(1000.0 / 2)),
        plate_delay=float(rng.uniform(0.0, 0.003)),
    )


def soft_parts(laboratory: Laboratory) -> tuple[str, ...]:
    """Return the segments whose flesh swings in the people of a laboratory."""
    return SOFT_PARTS[: max(0, laboratory.segments - 16)]


def draw_visitor(laboratory: Laboratory, seed: int) -> Subject:
    """Return who comes to a laboratory: person number ``seed``, sex, stature m, mass kg and age in years."""
    rng = stream(seed, "visitor", str(laboratory.population))
    sex = "FM"[int(rng.integers(2))]
    if laboratory.children:
        age = float(rng.uniform(9, 15))
        stature = 0.82 + 0.058 * age + 0.05 * float(rng.normal())
        mass = float(np.exp(0.1 * rng.normal())) * 17.5 * stature**2
    else:
        age = float(rng.uniform(19, 60))
        stature = (1.65 if sex == "F" else 1.78) + 0.065 * float(rng.normal())
        mass = float(rng.uniform(19.5, 29.0)) * stature**2
    stature = float(np.clip(stature, 1.22, 2.1))
    return Subject(round(max(mass, 31.0), 1), round(stature, 2), sex, round(age))  # type: ignore[arg-type]
