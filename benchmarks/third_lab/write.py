"""C3D files through ezc3d, session.toml, and the truth beside the folder."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import ezc3d
import numpy as np
import pinocchio as pin
from scipy.interpolate import BSpline

from benchmarks.third_lab.faults import Array, Fault
from benchmarks.third_lab.people import Person
from benchmarks.third_lab.plates import Plate, find_corners, split_kistler
from benchmarks.third_lab.skeleton import NAMES, PARENTS, SIDES, pose_segments

UP_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # world (z up) to a laboratory with y up
UP_Z = np.eye(3)
AMTI = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
KISTLER = ("fx12", "fx34", "fy14", "fy23", "fz1", "fz2", "fz3", "fz4")
KINDS = {
    "pelvis": "pelvis",
    "thigh": "thigh",
    "shank": "shank",
    "foot": "foot",
    "toes": "foot",
    "upper_arm": "upper_arm",
    "forearm": "forearm_hand",
    "hand": "forearm_hand",
}


@dataclass(frozen=True)
class Room:
    """A laboratory: make of its plates, axes, rates (Hz), noise of its cameras (m), gaps a marker and marker set."""

    make: str
    axes: Array
    up: str
    camera_rate: float
    analog_rate: float
    camera_noise: float
    gaps: float
    marker_set: str


def write_c3d(
    path: Path, room: Room, markers: dict[str, Array], plates: Sequence[Plate], wrenches: Sequence[Array]
) -> None:
    """Write one trial.

    Parameters
    ----------
    path : Path
    room : Room
    markers : dict of str to array, shape (n, 3)
        By label, world, m; nan where unseen.
    plates : sequence of Plate
        Only what was surveyed of them is written.
    wrenches : sequence of array, shape (n * analog_rate / camera_rate, 6)
        Six components of each plate, N and N·m.
    """
    c3d = ezc3d.c3d()
    points = np.full((4, len(markers), len(next(iter(markers.values())))), 1.0)
    points[:3] = np.stack([1e3 * (places @ room.axes.T).T for places in markers.values()], axis=1)
    c3d["data"]["points"] = points
    c3d.add_parameter("POINT", "RATE", [room.camera_rate])
    c3d.add_parameter("POINT", "LABELS", list(markers))
    c3d.add_parameter("POINT", "UNITS", ["mm"])
    c3d.add_parameter("POINT", "X_SCREEN", ["+X"])
    c3d.add_parameter("POINT", "Y_SCREEN", ["+Y" if room.up == "y" else "+Z"])
    scaled = [1e3 ** np.repeat([0, 1], 3) * wrench for wrench in wrenches]  # N·mm as POINT:UNITS is mm
    names, units = (KISTLER, ["N"] * 8) if room.make == "kistler" else (AMTI, ["N"] * 3 + ["Nmm"] * 3)
    channels = [
        split_kistler(plate, wrench) if room.make == "kistler" else many
        for plate, wrench, many in zip(plates, wrenches, scaled, strict=True)
    ]
    per = len(names)
    c3d["data"]["analogs"] = np.hstack(channels).T[None]
    c3d.add_parameter("ANALOG", "RATE", [room.analog_rate])
    c3d.add_parameter("ANALOG", "LABELS", [f"{name}_{plate}" for plate in (1, 2) for name in names])
    c3d.add_parameter("ANALOG", "UNITS", units * 2)
    c3d.add_parameter("ANALOG", "SCALE", [1.0] * 2 * per)
    c3d.add_parameter("ANALOG", "OFFSET", [0] * 2 * per)
    c3d.add_parameter("ANALOG", "GEN_SCALE", [1.0])
    corners = np.stack([1e3 * room.axes @ find_corners(plate) for plate in plates], axis=2)
    c3d.add_parameter("FORCE_PLATFORM", "CORNERS", corners)
    c3d.add_parameter("FORCE_PLATFORM", "ORIGIN", np.stack([1e3 * plate.deep for plate in plates], axis=1))
    for name, numbers in {
        "USED": [2],
        "TYPE": [3 if room.make == "kistler" else 2] * 2,
        "ZERO": [1, 0],
        "CHANNEL": np.arange(1.0, 2 * per + 1).reshape(2, per).T,
    }.items():
        c3d.add_parameter("FORCE_PLATFORM", name, numbers)
        c3d["parameters"]["FORCE_PLATFORM"][name]["type"] = ezc3d.ezc3d.INT
    c3d.write(str(path))


def write_session_file(folder: Path, person: Person, declared: float) -> None:
    """Write session.toml: mass as declared (kg), stature, sex."""
    lines = ["[subject]", f"mass_kg = {declared:.2f}", f"height_m = {person.height:.3f}", f'sex = "{person.sex}"', ""]
    (folder / "session.toml").write_text("\n".join(lines))


def write_truth(
    path: Path, person: Person, loaded: Person, room: Room, plates: Sequence[Plate], fault: Fault, **more: object
) -> None:
    """Write what is true: person, lumps, room, plates, fault; SI, segment frames in upright standing."""
    truth = {
        "mass_kg": person.mass,
        "height_m": person.height,
        "sex": person.sex,
        "segments": {
            name: {
                "mass_kg": person.masses[name],
                "com_m": person.coms[name],
                "inertia_kgm2": person.inertias[name],
                "parent": PARENTS[name],
                "joint_in_parent_m": person.offsets[name],
            }
            for name in NAMES
        },
        "lumps": lump(person),
        "lumps_as_recorded": lump(loaded),
        "room": asdict(room),
        "plates": [asdict(plate) for plate in plates],
        "fault": asdict(fault),
        **more,
    }
    path.write_text(json.dumps(truth, default=lambda value: np.asarray(value).tolist(), indent=1))


def lump(person: Person) -> dict[str, dict[str, object]]:
    """Add segments up to the twelve of a coarser body, in upright posture (all angles zero).

    Returns
    -------
    lumps : dict of str to dict
        pelvis, trunk_head, right_thigh, ...: mass_kg, com_m and distal_m from the true proximal joint centre (pelvis:
        middle of the hips; trunk_head: lowest spinal joint, distal: middle of the shoulders), inertia_kgm2 about the
        centre of mass; axes x ahead, y left, z up.
    """
    places = {"pelvis": np.zeros(3)}
    for name, parent in PARENTS.items():
        if parent:
            places[name] = places[parent] + person.offsets[name]
    sums: dict[str, pin.Inertia] = {}
    origins: dict[str, Array] = {}
    for name in NAMES:
        key = lump_of(name)
        origins.setdefault(key, places[name])
        part = pin.Inertia(person.masses[name], places[name] + person.coms[name] - origins[key], person.inertias[name])
        sums[key] = sums[key] + part if key in sums else part
    shoulders = 0.5 * (places["right_upper_arm"] + places["left_upper_arm"])
    distal = {"trunk_head": shoulders, "pelvis": places["lumbar"]}
    for side in SIDES:
        for kind, child in {
            "thigh": "shank",
            "shank": "foot",
            "foot": "toes",
            "upper_arm": "forearm",
            "forearm_hand": "hand",
        }.items():
            distal[f"{side}_{kind}"] = places[f"{side}_{child}"]
    return {
        key: {
            "mass_kg": total.mass,
            "com_m": total.lever,
            "inertia_kgm2": total.inertia,
            "distal_m": distal[key] - origins[key],
        }
        for key, total in sums.items()
    }


def lump_of(name: str) -> str:
    """Name of the coarser segment that a segment belongs to."""
    side, _, rest = name.partition("_")
    kind = KINDS.get(rest if side in SIDES else name, "trunk_head")
    return kind if kind in ("pelvis", "trunk_head") else f"{side}_{kind}"


def stand_true(person: Person, path: BSpline, times: Array, seen: dict[str, Array]) -> dict[str, object]:
    """Say where things are in the static trial, means over time, world, m.

    Parameters
    ----------
    person : Person
    path : BSpline
    times : array, shape (n,)
        s.
    seen : dict of str to array, shape (n, 3)
        Markers by label, without the cameras' noise or with it.

    Returns
    -------
    standing : dict
        markers_m; com_m and joint_m of the lumps (of the pelvis the middle of the hips, of trunk_head the lowest spinal
        joint).
    """
    rotations, places = pose_segments(person, path(times))
    com: dict[str, Array] = {}
    weight: dict[str, float] = {}
    joint: dict[str, Array] = {}
    for name in NAMES:
        key, mass = lump_of(name), person.masses[name]
        joint.setdefault(key, places[name].mean(axis=0))
        com[key] = com.get(key, 0.0) + mass * (places[name] + rotations[name] @ person.coms[name]).mean(axis=0)
        weight[key] = weight.get(key, 0.0) + mass
    return {
        "markers_m": {label: np.nanmean(places, axis=0) for label, places in seen.items()},
        "com_m": {key: value / weight[key] for key, value in com.items()},
        "joint_m": joint,
    }
