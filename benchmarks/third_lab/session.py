"""A session: person, room, faults, trials."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicSpline
from scipy.spatial.transform import Rotation

from third_lab.faults import Fault, draw_fault
from third_lab.markers import film, name_markers, place_markers, see
from third_lab.movement import Plan, realize
from third_lab.people import Person, draw_person
from third_lab.plates import draw_plates, measure, spoil_plates
from third_lab.skeleton import add_mass, find_wrench, pose_segments
from third_lab.tissue import Tissue, draw_tissue, shake, slide_skin
from third_lab.trials import DANCES, plan_trial
from third_lab.write import UP_Y, UP_Z, Room, write_c3d, write_session_file, write_truth

FORCE_RATE = 250.0  # 1/s, of the mechanics; nothing in these movements is faster than 14 Hz


def make_session(
    folder: Path, seed: int, kind: str = "none", marker_set: str = "", seconds: float = 10.0, quiet: bool = False
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
    marker_set : {"", "pig", "isb", "cgm2"}
        "" draws one.
    seconds : float
        Of each dance.
    quiet : bool
        Ideal instruments, skin and tissue: what remains is the mechanics.

    Returns
    -------
    fault : Fault
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 2026])
    person, tissue = draw_person(rng), draw_tissue(rng)
    room, plates = _draw_room(rng, marker_set), draw_plates(rng, str(rng.choice(["amti", "kistler"])))
    room = replace(room, make=plates[0].make)
    where, width = place_markers(rng, person), rng.uniform(0.22, 0.32)
    fault = draw_fault(np.random.default_rng([seed, sum(map(ord, kind))]), kind)
    if quiet:
        tissue = Tissue({}, {}, 0.0)
        plates = tuple(
            replace(p, shift=np.zeros(3), yaw=0.0, response=np.eye(6), offset=np.zeros(6), noise=0.0, delay=0.0)
            for p in plates
        )
        room = replace(room, camera_noise=0.0, gaps=0.0)
    spoiled = spoil_plates(plates, fault)
    loaded = _load(person, fault)
    trials = [("static01", "stand", 4.0), ("stand01", "stand", 8.0), *((f"dance_{k}", k, seconds) for k in DANCES),
              ("squat01", "squat", seconds), ("squat02", "squat", seconds)]  # fmt: skip
    for number, (name, movement, length) in enumerate(trials):
        own = np.random.default_rng([seed, 7, number])
        plan = plan_trial(own, loaded, movement, length, width)
        path = realize(loaded, plan)
        markers = _film_trial(own, loaded, tissue, path, length, room, _move(where, fault, name), seed)
        wrenches = _weigh_trial(own, loaded, tissue, path, plan, room, fault, name)
        read = tuple(
            measure(own, plate, *wrench, room.analog_rate) for plate, wrench in zip(spoiled, wrenches, strict=True)
        )
        labels = _exchange(name_markers(room.marker_set), fault, name)
        tilt = (
            Rotation.from_rotvec(fault.size * np.eye(3)["xyz".index(fault.axis)]).as_matrix()
            if fault.kind == "lab_tilt"
            else np.eye(3)
        )
        write_c3d(
            folder / f"{name}.c3d",
            room,
            {label: markers[place] @ tilt.T for place, label in labels.items()},
            plates,
            read,
        )
    write_session_file(folder, person, person.mass + (fault.size if fault.kind == "wrong_mass" else 0.0))
    write_truth(folder.with_name(folder.name + ".truth.json"), person, loaded, room, spoiled, fault, seed=seed,
                tissue_hz=tissue.frequency, markers_m={label: where[place] for place, label in name_markers(room.marker_set).items()})  # fmt: skip
    return fault


def _draw_room(rng: np.random.Generator, marker_set: str) -> Room:
    """Draw cameras of 0.05 to 0.8 mm, 100 or 120 Hz, axes and marker set."""
    axes, up = ((UP_Z, "z"), (UP_Y, "y"), (np.diag([-1.0, -1.0, 1.0]), "z"))[rng.integers(3)]
    rate, times = ((100.0, 10), (120.0, 10), (200.0, 5))[rng.integers(3)]
    noise = 5e-5 * 16.0 ** rng.uniform()
    drawn = str(rng.choice(["pig", "isb", "cgm2"]))
    return Room("", axes, up, rate, rate * times, noise, rng.uniform(0, 0.5), marker_set or drawn)


def _load(person: Person, fault: Fault) -> Person:
    """The person with what the fault hangs on a segment, held at the middle of the limb, outside."""
    if not fault.kind.startswith("load_"):
        return person
    side = 1 if fault.target.startswith("left") else -1
    place = {"load_forearm": [0.0, side * 0.05, -0.15], "load_thigh": [0.03, side * 0.09, -0.2],
             "load_trunk": [0.14, 0.0, 0.15]}[fault.kind]  # fmt: skip
    return add_mass(person, fault.target, fault.size, np.array(place))


def _move(where: dict, fault: Fault, trial: str) -> dict:
    """Markers as they sit in this trial: a knee marker is misplaced in all, or moved after the static trial."""
    if fault.kind == "knee_misplaced" or (fault.kind == "knee_moved" and not trial.startswith("static")):
        segment, place = where[fault.target]
        return where | {fault.target: (segment, place + [fault.size, 0, 0])}
    return where


def _exchange(labels: dict[str, str], fault: Fault, trial: str) -> dict[str, str]:
    """Labels as the operator gave them: both of one wrist exchanged in the dances."""
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
    where: dict,
    seed: int,
) -> dict[str, NDArray]:
    """What the cameras see, by landmark, world, m."""
    times = np.arange(round(seconds * room.camera_rate)) / room.camera_rate
    slid = slide_skin(seed, person, tissue, path, times, where)
    return see(rng, film(person, path(times), where, slid), room.camera_noise, room.gaps)


def _weigh_trial(
    rng: np.random.Generator,
    person: Person,
    tissue: Tissue,
    path: BSpline,
    plan: Plan,
    room: Room,
    fault: Fault,
    name: str,
) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
    """Force and moment (about the origin of the world) on plate 1 and 2 at the analog rate, each of shape (n, 3).

    Looking along y the left foot stands on plate 1, which lies at negative x.
    """
    times = np.arange(0, plan.times[-1], 1 / FORCE_RATE)
    forces, moments = find_wrench(person, path, times)
    more = shake(person, tissue, path, times)
    forces, moments = forces + more[0], moments + more[1]
    if fault.kind == "rail" and name in ("dance_bend", "dance_half_squat", "dance_right_knee"):
        pull, turn = _hold_rail(person, path, times, fault)
        forces, moments = forces - pull, moments - turn
    feet = _split(rng, person, plan, times, forces, moments)
    samples = np.arange(round(times.size / FORCE_RATE * room.camera_rate) * round(room.analog_rate / room.camera_rate))
    at = samples / room.analog_rate
    return tuple(tuple(CubicSpline(times, part)(at) for part in feet[side]) for side in ("left", "right"))


def _hold_rail(person: Person, path: BSpline, times: NDArray, fault: Fault) -> tuple[NDArray, NDArray]:
    """Force and moment of a rail on a hand: comes and goes slowly, mostly upwards."""
    rotations, places = pose_segments(person, path(times))
    hand = places[fault.target] + rotations[fault.target] @ np.array([0, 0, -0.08])
    course = np.clip(1.6 * np.sin(np.pi * np.clip((times - 2) / (times[-1] - 4), 0, 1)), 0, 1)[:, None]
    pull = fault.size * course * [0.0, 0.3, 1.0]
    return pull, np.cross(hand, pull)


def _split(
    rng: np.random.Generator, person: Person, plan: Plan, times: NDArray, forces: NDArray, moments: NDArray
) -> dict[str, tuple[NDArray, NDArray]]:
    """Share the ground's wrench between the feet; they also push against each other a little.

    Both centres of pressure lie on a line through the common one, as far apart as the feet; so shares, forces and moments
    add up.
    """

    def at(values: NDArray) -> NDArray:
        return CubicSpline(plan.times, values)(times)

    share = np.clip(at(plan.share), 0, 1)[:, None]
    zmp = np.stack([-moments[:, 1], moments[:, 0]], axis=1) / forces[:, 2:]
    apart = at(plan.centres["right"] - plan.centres["left"])
    free = moments[:, 2] - (zmp[:, 0] * forces[:, 1] - zmp[:, 1] * forces[:, 0])
    inward = 4 * share * (1 - share) * rng.uniform(0.0, 0.04) * person.mass * 9.81
    direction = np.hstack([apart, np.zeros((len(times), 1))]) / np.linalg.norm(apart, axis=1, keepdims=True)
    feet = {}
    for side, part, where, sign in (
        ("right", share, zmp + (1 - share) * apart, -1),
        ("left", 1 - share, zmp - share * apart, 1),
    ):
        force = part * forces + sign * inward * direction
        point = np.hstack([where, np.zeros((len(times), 1))])
        feet[side] = force, np.cross(point, force) + np.outer(part[:, 0] * free, [0, 0, 1])
    return feet
