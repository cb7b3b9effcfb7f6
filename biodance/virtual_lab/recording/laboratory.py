"""A virtual laboratory and the people who come to it, drawn from a seed. No single one is the truth: parts that move by
themselves, tables, skin, cameras, plates, tolerances, restlessness, ages and methods all differ.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from biodance.errors import BiodanceError
from biodance.records import Subject
from biodance.virtual_lab.recording.instruments import TISSUES
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


@dataclass(frozen=True)
class Laboratory:
    """A place with its instruments, its habits and its people; `draw_laboratory` draws one.

    Parameters
    ----------
    centre : tuple of float
        (2,) m where the subject stands.
    heading : float
        rad from lab x that the subject faces.
    plates : int
        1; 2 = one under each foot; 3 and 4: these two and empty ones before and behind them.
    plate_type : int
        2 or 4.
    camera_rate : float
        Hz.
    samples : int
        Of force per camera frame.
    bits : int
        Of the converter.
    tolerances : LabTolerances
        How far everything is from the ideal here.
    moment_zero : float
        N·m, standard deviation of a plate's zero in each moment, beyond what belongs to its zero in Fz.
    segments : int
        12 to 22 parts of the true body that move by themselves, see `draw_laboratory`.
    tissue : str
        Kind of soft tissue, one of `instruments.TISSUES`.
    population : int or None
        What its people have in common beside the tables (`draw_sip`); None = nothing.
    joints : str
        "functional" or "static": how the joints are placed when its sessions are read.
    children : bool
        Whether its people are children.
    belts : int
        0 = plates in the floor; 1 = one instrumented belt, 2 = a split-belt treadmill, instead of them.
    """

    centre: tuple[float, float] = (0.3, 0.2)
    heading: float = 0.0
    plates: int = 1
    plate_type: int = 2
    camera_rate: float = 100.0
    samples: int = 10
    bits: int = 16
    tolerances: LabTolerances = REALISTIC
    moment_zero: float = 0.0
    segments: int = 16
    tissue: str = "pulled"
    population: int | None = None
    joints: str = "functional"
    children: bool = False
    belts: int = 0

    def __post_init__(self) -> None:
        if self.plates not in (1, 2, 3, 4) or self.plate_type not in (2, 4):
            raise BiodanceError(
                f"Laboratory: {self.plates} plates of TYPE {self.plate_type}; legal are 1 to 4 plates of TYPE 2 or 4."
            )
        if self.belts not in (0, 1, 2):
            raise BiodanceError(f"Laboratory: {self.belts} belts; legal are 0 (none), 1 and 2 (split-belt).")
        if self.camera_rate <= 0 or self.samples < 1:
            raise BiodanceError(
                f"Laboratory: {self.camera_rate} Hz with {self.samples} force samples per frame; both must be positive."
            )
        if self.tissue not in TISSUES or not 12 <= self.segments <= 22:
            raise BiodanceError(
                f"Laboratory: tissue {self.tissue!r}, {self.segments} segments; legal are {', '.join(TISSUES)} and 12 "
                f"to 22 segments."
            )


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
