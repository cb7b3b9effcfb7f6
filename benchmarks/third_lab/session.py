"""A session: person, room, faults, trials."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from benchmarks.third_lab.faults import Array, Fault, draw_fault
from benchmarks.third_lab.markers import Places, film, name_markers, place_markers, see
from benchmarks.third_lab.movement import realize
from benchmarks.third_lab.people import Person, draw_person
from benchmarks.third_lab.plates import draw_plates, measure, spoil_plates
from benchmarks.third_lab.skeleton import add_mass
from benchmarks.third_lab.tissue import Tissue, draw_tissue, slide_skin
from benchmarks.third_lab.trials import DANCES, plan_trial
from benchmarks.third_lab.weigh import weigh_trial
from benchmarks.third_lab.write import UP_Y, UP_Z, Room, stand_true, write_c3d, write_session_file, write_truth

TRIALS = (
    ("static01", "stand"),
    ("stand01", "stand"),
    *((f"dance_{kind}", kind) for kind in DANCES),
    ("squat01", "squat"),
    ("squat02", "squat"),
)  # name, movement
LENGTHS = {"static01": 4.0, "stand01": 8.0}  # s
USUAL = 10.0  # s, of all other trials


def make_session(
    folder: Path,
    seed: int,
    kind: str = "none",
    only: tuple[str, ...] = (),
) -> Fault:
    """Make a session of one person in one laboratory, with its truth beside it.

    Parameters
    ----------
    folder : Path
        Made if missing. FOLDER.truth.json is written beside it.
    seed : int
        Person, room, movements. The same with and without a fault.
    kind : str
        "none" or one of FAULTS.
    only : tuple of str
        Trials to write; all where empty.

    Returns
    -------
    fault : Fault
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 2026])
    person, tissue = draw_person(rng), draw_tissue(rng)
    room, plates = _draw_room(rng), draw_plates(rng, str(rng.choice(["amti", "kistler"])))
    room = replace(room, make=plates[0].make)
    where, width = place_markers(rng, person), rng.uniform(0.22, 0.32)
    fault = draw_fault(np.random.default_rng([seed, sum(map(ord, kind))]), kind)
    spoiled = spoil_plates(plates, fault)
    loaded = _load(person, fault)
    leaning = fault.size * np.eye(3)["xyz".index(fault.axis)] if fault.kind == "lab_tilt" else np.zeros(3)
    tilt = Rotation.from_rotvec(leaning).as_matrix()
    standing: dict[str, object] = {}
    for number, (name, movement) in enumerate(TRIALS):
        if only and name not in only:
            continue
        length = LENGTHS.get(name, USUAL)
        own = np.random.default_rng([seed, 7, number])
        plan = plan_trial(own, loaded, movement, length, width)
        path = realize(loaded, plan)
        markers = _film_trial(own, loaded, tissue, path, length, room, _move(where, fault, name), seed)
        wrenches = weigh_trial(own, loaded, tissue, path, plan, room, fault, name)
        read = [measure(own, plate, *wrench, room.analog_rate) for plate, wrench in zip(spoiled, wrenches, strict=True)]
        labels = _exchange(name_markers(room.marker_set), fault, name)
        seen = {label: markers[place] @ tilt.T for place, label in labels.items()}
        write_c3d(folder / f"{name}.c3d", room, seen, plates, read)
        if name == "static01":
            standing = stand_true(loaded, path, plan.times, seen)
    write_session_file(folder, person, person.mass + (fault.size if fault.kind == "wrong_mass" else 0.0))
    markers_m = {label: where[place] for place, label in name_markers(room.marker_set).items()}
    beside = folder.with_name(folder.name + ".truth.json")
    more = {"seed": seed, "tissue_hz": tissue.frequency, "static": standing, "markers_m": markers_m}
    write_truth(beside, person, loaded, room, spoiled, fault, **more)
    return fault


def _draw_room(rng: np.random.Generator) -> Room:
    """Draw cameras of 0.05 to 0.8 mm, 100 or 120 Hz, axes and marker set."""
    axes, up = ((UP_Z, "z"), (UP_Y, "y"), (np.diag([-1.0, -1.0, 1.0]), "z"))[rng.integers(3)]
    rate, times = ((100.0, 10), (120.0, 10), (200.0, 5))[rng.integers(3)]
    noise = 5e-5 * 16.0 ** rng.uniform()
    drawn = str(rng.choice(["pig", "isb", "cgm2"]))
    return Room("", axes, up, rate, rate * times, noise, rng.uniform(0, 0.5), drawn)


def _load(person: Person, fault: Fault) -> Person:
    """Hang the fault's load on the person: at the middle of the limb, outside, or before the chest."""
    if not fault.kind.startswith("load_"):
        return person
    side = 1 if fault.target.startswith("left") else -1
    place = {"load_forearm": [0.0, side * 0.05, -0.15], "load_thigh": [0.03, side * 0.09, -0.2],
             "load_trunk": [0.14, 0.0, 0.15]}[fault.kind]  # fmt: skip
    return add_mass(person, fault.target, fault.size, np.array(place))


def _move(where: Places, fault: Fault, trial: str) -> Places:
    """Place the markers as in this trial: a knee marker is misplaced in all, or moved after the static trial."""
    if fault.kind == "knee_misplaced" or (fault.kind == "knee_moved" and not trial.startswith("static")):
        segment, place = where[fault.target]
        return where | {fault.target: (segment, place + np.array([fault.size, 0, 0]))}
    return where


def _exchange(labels: dict[str, str], fault: Fault, trial: str) -> dict[str, str]:
    """Name the markers as the operator did: both of one wrist exchanged in the dances."""
    if fault.kind != "labels_exchanged" or not trial.startswith("dance"):
        return labels
    one, other = f"{fault.target}_radial", f"{fault.target}_ulnar"
    return labels | {one: labels[other], other: labels[one]}


def _film_trial(
    rng: np.random.Generator,
    person: Person,
    tissue: Tissue,
    path: BSpline,
    seconds: float,
    room: Room,
    where: Places,
    seed: int,
) -> dict[str, Array]:
    """Film a trial: what the cameras see, by landmark, world, m."""
    times = np.arange(round(seconds * room.camera_rate)) / room.camera_rate
    slid = slide_skin(seed, person, tissue, path, times, where)
    return see(rng, film(person, path(times), where, slid), room.camera_noise, room.gaps)
