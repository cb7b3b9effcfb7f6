"""The day of a session in a laboratory: how its instruments stand, what they record of a performance, and the files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.records import Array, Markers, Role, assign, frozen_array
from biodance.virtual_lab.movement.gait import perform_gait
from biodance.virtual_lab.movement.performance import AppliedForce, Performance, perform
from biodance.virtual_lab.movement.protocol import TrialPlan
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.person.skeleton import MARKER_RADIUS, small_rotation
from biodance.virtual_lab.recording.instruments import (
    HALF_BELT,
    HALF_SIZE,
    SoftTissue,
    TruePlate,
    digitise,
    draw_soft_tissue,
    film,
    lay_plate,
    sense_plate,
)
from biodance.virtual_lab.recording.laboratory import Laboratory
from biodance.virtual_lab.tolerances import LabTolerances, stream

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
    the static trial; ``lighter_limbs`` kg by the first segment that a prosthesis replaces.
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


def write(recording: Recording, folder: Path) -> Path:
    """Write one recording as ``folder/NAME.c3d`` and return the path; an existing file is never overwritten."""
    path, groups, rate = folder / f"{recording.name}.c3d", dict(recording.parameters), recording.analog_rate
    write_c3d(path, markers=recording.markers, plates=recording.plates, analog_rate=rate, parameters=groups)
    return path
