"""A virtual laboratory and the people who come to it, drawn from a seed, and the day of a session in it: how its
instruments stand, what they record of a performance, and the files. No laboratory is the truth: parts that move by
themselves, tables, skin, cameras, plates, tolerances, restlessness, ages and methods all differ.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.c3d.write import PlateRecording
from biodance.records import Array, Markers, Role, Subject, assign, frozen_array
from biodance.virtual_lab.instruments import (
    HALF_BELT,
    HALF_SIZE,
    TISSUES,
    SoftTissue,
    TruePlate,
    digitise,
    draw_soft_tissue,
    film,
    lay_plate,
    sense_plate,
)
from biodance.virtual_lab.movement import TrialPlan
from biodance.virtual_lab.movement.gait import perform_gait
from biodance.virtual_lab.movement.performance import AppliedForce, Performance, perform
from biodance.virtual_lab.person import AddedLoad, Person
from biodance.virtual_lab.person.skeleton import MARKER_RADIUS, REALISTIC, LabTolerances, small_rotation, stream

CAMERAS = (1.0e-5, 3.0e-4)
"""m of white noise per axis: 0.013 to 0.06 mm in good public recordings, to 0.2 mm in others."""
PLATES = (0.02, 0.15)
"""N per root Hz of Fz: unloaded plates of public recordings have 0.05 to 0.12."""
_SPREAD = 0.4
"""Standard deviation of the natural logarithm of how many times the usual tolerances a laboratory has."""
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
        moment_zero=float(rng.uniform(0, 2) * 0.3),  # N·m
        segments=segments,
        tissue=str(rng.choice(list(TISSUES))),
        population=seed,
        joints=str(rng.choice(["functional", "static"], p=[0.75, 0.25])),
        children=bool(rng.random() < 0.3),
    )


def _drawn_tolerances(rng: np.random.Generator, segments: int) -> LabTolerances:
    """Draw how far everything is from the ideal: each tolerance by itself, and all unrest of people together."""
    known = {one.name for one in fields(LabTolerances)}
    # Lognormal: each by itself.
    times = {name: float(np.exp(_SPREAD * rng.normal())) for name in (*_INSTRUMENTS, *_PEOPLE)}
    times |= dict.fromkeys(_UNREST, float(np.clip(np.exp(_SPREAD * rng.normal()), 0.5, 2.5)))
    times |= {name: 0.0 for least, names in _ALONE.items() if segments < least for name in names}
    drawn = {name: factor * getattr(REALISTIC, name) for name, factor in times.items() if name in known}
    soft = REALISTIC.soft_tissue * float(np.clip(np.exp(_SPREAD * rng.normal()), 0.5, 2.0))
    # Uniform in the logarithm.
    density = float(np.exp(rng.uniform(*np.log(PLATES))))
    return replace(
        REALISTIC,
        **drawn,
        soft_tissue=soft,
        camera_noise=float(np.exp(rng.uniform(*np.log(CAMERAS)))),
        camera_wander=float(np.exp(rng.uniform(*np.log([1.0e-4, 6.0e-4])))),
        gaps_per_minute=float(np.exp(rng.uniform(*np.log([0.2, 4.0])))),
        # White noise of this density in the band up to half of 1000 Hz.
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


C3dGroups = dict[str, dict[str, list[float] | list[str] | float | str]]


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial as the instruments deliver it, before it is written; ``parameters`` of the C3D file. Faults are
    functions of this record.
    """

    name: str
    role: Role
    markers: Markers
    plates: tuple[PlateRecording, ...]
    analog_rate: float
    parameters: C3dGroups


Fault = Callable[[Recording], Recording]


@dataclass(frozen=True, eq=False)
class LabVisit:
    """The day of a session: its ``number`` (another day: markers glued, postures performed, plates zeroed and cameras
    levelled anew; the plates stay as they are installed), the ``laboratory``, the ``tolerances`` of everything (None =
    the laboratory's), and ``faults`` that change each recording (markers, raw analog samples, parameters) before it is
    written.

    ``tilt`` (3,) rad turns the laboratory's axes off the true vertical, beyond the tolerance; ``forces`` act on the
    person beside gravity and ground; ``joint_shifts`` (3,) m by joint (``right_hip``) move true joint centres in the
    parent's frame, with all that hangs on them; ``marker_shifts`` (3,) m by label move markers on their segments after
    the static trial; ``lighter_limbs`` kg by the first segment that a prosthesis replaces; ``loads`` are carried on top
    of the subject's mass.
    """

    number: int = 0
    laboratory: Laboratory = field(default_factory=Laboratory)
    tolerances: LabTolerances = None  # type: ignore[assignment]
    faults: tuple[Fault, ...] = ()
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)
    forces: tuple[AppliedForce, ...] = ()
    joint_shifts: Mapping[str, Array] = field(default_factory=dict)
    marker_shifts: Mapping[str, Array] = field(default_factory=dict)
    lighter_limbs: Mapping[str, float] = field(default_factory=dict)
    loads: tuple[AddedLoad, ...] = ()

    def __post_init__(self) -> None:
        assign(self, tolerances=self.tolerances or self.laboratory.tolerances)


FIRST_VISIT = LabVisit()
"""One plate, realistic tolerances, no fault."""


@dataclass(frozen=True, eq=False)
class Instruments:
    """What is true of a visit's instruments: plates, ``tilt`` (3, 3) of the cameras, the skin under the markers."""

    visit: LabVisit
    plates: tuple[TruePlate, ...]
    tilt: Array
    tissue: SoftTissue


def set_up(person: Person, visit: LabVisit) -> Instruments:
    """Set up the instruments of one visit: plates as installed, zeros and level of the cameras as of the day."""
    laboratory, tolerances = visit.laboratory, visit.tolerances
    (_, installed), (tilt, today) = (_draw(person, visit, day) for day in (FIRST_VISIT.number, visit.number))
    return Instruments(
        visit,
        tuple(replace(plate, offset=one.offset) for plate, one in zip(installed, today, strict=True)),
        frozen_array(small_rotation(tilt), (3, 3), "tilt"),
        draw_soft_tissue(person, visit.number, tolerances, laboratory.tissue),
    )


def _draw(person: Person, visit: LabVisit, day: int) -> tuple[Array, tuple[TruePlate, ...]]:
    """Return the cameras' level (3,) rad and the plates as they are drawn for one day."""
    laboratory, tolerances = visit.laboratory, visit.tolerances
    rng = stream(person.seed, "instruments", str(day))
    # No turn about the vertical: cameras are levelled, the heading is free.
    tilt = np.array([*(tolerances.lab_tilt * rng.normal(size=2)), 0.0]) + np.array(visit.tilt)
    plates = tuple(
        lay_plate(place, laboratory.heading, side, tolerances, rng, moment_zero=laboratory.moment_zero, half=half)
        for side, place, half in _places(laboratory)
    )
    return tilt, plates


def _places(laboratory: Laboratory) -> list[tuple[str, Array, Array]]:
    """Return of every plate whose foot it carries, its centre (3,) m and half its sides (2,) m."""
    middle = np.array([*laboratory.centre, 0.0])
    half = HALF_BELT if laboratory.belts else HALF_SIZE
    # Half sides: neighbours touch.
    ahead = np.array([np.cos(laboratory.heading), np.sin(laboratory.heading), 0.0]) * half[1]
    leftward = np.array([-np.sin(laboratory.heading), np.cos(laboratory.heading), 0.0]) * half[0]
    apart = laboratory.belts == 2 if laboratory.belts else laboratory.plates > 1
    places = [("right", -leftward), ("left", leftward)] if apart else [("both", 0 * ahead)]
    if not laboratory.belts and laboratory.plates > 2:
        places += [("none", 2 * ahead), ("none", -2 * ahead)][: laboratory.plates - 2]
    return [(side, middle + place, half) for side, place in places]


def perform_in(instruments: Instruments, person: Person, plan: TrialPlan) -> Performance:
    """Let the person perform one trial where the plates are, with the visit's forces and moved markers."""
    visit = instruments.visit
    lab = visit.laboratory
    if plan.role != "static":
        person = person.with_markers_moved(visit.marker_shifts)
    moved = perform_gait if plan.gait else perform
    done = moved(
        person, plan, visit.number, tolerances=visit.tolerances, centre=np.array(lab.centre), heading=lab.heading
    )
    return replace(done, forces=visit.forces)


def record(performance: Performance, instruments: Instruments) -> Recording:
    """Return what the instruments deliver: markers at the camera rate, plates at ``samples`` times that rate."""
    visit, plan, seed = instruments.visit, performance.plan, performance.person.seed
    lab, tolerances, session = visit.laboratory, visit.tolerances, visit.number
    frames = round(plan.duration * lab.camera_rate) + 1
    time = np.arange(frames) / lab.camera_rate
    analog_rate = lab.camera_rate * lab.samples
    fine = np.arange(frames * lab.samples) / analog_rate
    sight, noise = (stream(seed, what, str(session), plan.name) for what in ("cameras", "plates"))
    markers = film(performance, instruments.tissue, time, instruments.tilt, tolerances, sight)
    sensed = [sense_plate(performance, one, fine, instruments.tilt, tolerances, noise) for one in instruments.plates]
    pairs = zip(sensed, instruments.plates, strict=True)
    plates = tuple(digitise(channels, one, kind=lab.plate_type, bits=lab.bits) for channels, one in pairs)
    typed = measurements(performance.person, session, tolerances)
    return Recording(plan.name, plan.role, markers, plates, analog_rate, typed)


def measurements(person: Person, session: int, tolerances: LabTolerances) -> C3dGroups:
    """Return the C3D groups with the subject's typed measurements as Vicon stores them (mm, kg), errors included."""
    rng = stream(person.seed, "measurements", str(session))
    size = person.size
    sided = {
        "LegLength": size["thigh"] + size["shank"] + 0.054 * size["stature"],
        "KneeWidth": size["knee_width"],
        "AnkleWidth": size["ankle_width"],
        "ShoulderOffset": 0.0335 * size["stature"],
        "ElbowWidth": size["elbow_width"],
        "WristWidth": size["wrist_width"],
        "HandThickness": size["hand_thickness"],
    }
    processing: dict[str, list[float] | list[str] | float | str] = {
        "Bodymass": scale_reading(person, session, tolerances),
        "Height": 1000.0 * person.subject.stature,
        "InterAsisDistance": 1000.0 * size["asis"] + 1000.0 * tolerances.measure * rng.normal(),
        "MarkerDiameter": 2000.0 * MARKER_RADIUS,
    }
    for name, true in sided.items():
        error = tolerances.measure * rng.normal(size=2) * (1.0 if name == "LegLength" else 0.5)
        processing |= {letter + name: 1000.0 * (true + e) for letter, e in zip("RL", error, strict=True)}
    return {"PROCESSING": processing, "SUBJECTS": {"NAMES": [person.subject.name or "virtual"]}}


def scale_reading(person: Person, session: int, tolerances: LabTolerances) -> float:
    """Return the body mass kg that the scale showed, in steps of 0.1 kg, without loads."""
    error = tolerances.scale * stream(person.seed, "scale", str(session)).normal()
    return round(person.subject.mass + error, 1) if tolerances.scale else person.subject.mass
