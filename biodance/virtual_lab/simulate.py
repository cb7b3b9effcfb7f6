"""Simulate a whole session: a folder of C3D files that passes through the same door as a real one, and its truth apart.

OUT/static.c3d, OUT/dance_1.c3d, ...   what the laboratory recorded
OUT/session.toml                       what the analyst would write down: mass, height, sex, roles
OUT/truth/truth.json                   what only the simulation knows; no other command looks into this folder
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.c3d.write import write_c3d
from biodance.lab.session.results_folder import whole_folder
from biodance.records import Array, Sip, Subject
from biodance.threads import one_thread
from biodance.version import __version__
from biodance.virtual_lab.causes import Hidden, hide, wobbling_mass
from biodance.virtual_lab.movement import Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.person import (
    CARRIERS,
    AddedLoad,
    Person,
    make_person,
    merged_sip,
    of_parameters,
    parameters_of_inertia,
    place_in_12,
    place_inertia,
    true_frames,
    with_prostheses,
)
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS
from biodance.virtual_lab.visit import (
    FIRST_VISIT,
    SWINGING,
    Instruments,
    LabVisit,
    perform_in,
    record,
    scale_reading,
    set_up,
    soft_parts,
)

TRUTH = "truth"
"""Name of the folder inside a simulated session that holds the truth."""
_LEGAL = {"mass": (30.0, 200.0, "kg"), "stature": (1.2, 2.2, "m")}


@one_thread()
def simulate_session(
    subject: Subject,
    protocol: Protocol | str | Path,
    out: Path,
    *,
    seed: int,
    hidden: tuple[Hidden, ...] = (),
    visit: LabVisit = FIRST_VISIT,
    performed: Callable[[Instruments, Person, TrialPlan], Performance] = perform_in,
    bent: Mapping[str, float] = MappingProxyType({}),
) -> Path:
    """Write a simulated session into ``out`` (made here, must be empty or absent) and return that folder.

    ``subject`` mass kg, stature m, sex. ``seed`` is the person: the same seed is the same body on every ``visit``, with
    the causes ``hidden`` in it (`hide`). Every trial is ``performed``; markers were glued on somebody with joints
    ``bent`` by so many rad. The same arguments write the same bytes.

    Raises
    ------
    BiodanceError
        The folder is not empty, the subject is outside the range that the virtual body covers, or a hidden cause lacks
        a parameter.
    UnknownName
        There is no such protocol, or no such cause or target.
    """
    plan = protocol if isinstance(protocol, Protocol) else read_protocol(protocol)
    check_simulated(subject)
    visit = hide(hidden, subject, plan, seed=seed, visit=visit)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BiodanceError(f"{out}: exists and is not an empty folder; nothing was written. Choose another --out.")
    if plan.belts:
        visit = replace(visit, laboratory=replace(visit.laboratory, belts=plan.belts))
    person = make_person(
        subject,
        seed,
        tolerances=visit.tolerances,
        loads=visit.loads,
        session=visit.number,
        joint_shifts=visit.joint_shifts,
        population=visit.laboratory.population,
    )
    person = replace(with_prostheses(person, visit.lighter_limbs), bent=bent)
    # what the flesh that swings by itself adds, in a laboratory of more than 16 segments
    swinging = {part: CARRIERS.get(part, part) for part in soft_parts(visit.laboratory)}
    masses = {part: SWINGING * person.body.sip.mass[TRUE_SEGMENTS.index(on)] for part, on in swinging.items()}
    flesh = (wobbling_mass(person, part, mass) for part, mass in masses.items())
    instruments = set_up(person, replace(visit, forces=(*visit.forces, *flesh)))
    performances, declared = [], scale_reading(person, visit.number, visit.tolerances)
    with whole_folder(out) as part:
        for trial in plan.trials:
            performances.append(performed(instruments, person, trial))
            recording = record(performances[-1], instruments)
            for fault in visit.faults:
                recording = fault(recording)
            declared = float(recording.parameters["PROCESSING"]["Bodymass"])  # type: ignore[arg-type]
            write_c3d(
                part / f"{recording.name}.c3d",
                markers=recording.markers,
                plates=recording.plates,
                analog_rate=recording.analog_rate,
                parameters=dict(recording.parameters),
            )
        (part / "session.toml").write_text(session_toml(person, plan, declared, joints=visit.laboratory.joints))
        (part / TRUTH).mkdir()
        document = truth(person, plan.name, instruments, performances)
        (part / TRUTH / "truth.json").write_text(json.dumps(document, indent=1) + "\n")
    return out


def check_simulated(subject: Subject) -> None:
    """Raise BiodanceError for a person whom the virtual body does not cover."""
    for name, (low, high, unit) in _LEGAL.items():
        value = getattr(subject, name)
        if not low <= value <= high:
            raise BiodanceError(
                f"Simulated subject: {name} = {value:g} {unit}; the virtual body covers {low:g} to {high:g} {unit}."
            )
    if subject.sex not in ("F", "M"):
        raise BiodanceError(
            f"Simulated subject: sex = {subject.sex!r}; legal are 'F' and 'M', whose proportions differ."
        )


def session_toml(person: Person, protocol: Protocol, mass: float, *, joints: str = "functional") -> str:
    """Return what an analyst would have written down about the session; ``joints`` as the setting says."""
    lines = [
        "[subject]",
        f"mass_kg = {float(mass)}",
        f"height_m = {float(person.subject.stature)}",
        f'sex = "{person.subject.sex}"',
    ]
    if np.isfinite(person.subject.age):
        lines.append(f"age = {float(person.subject.age)}")
    if joints != "functional":
        lines += ["", "[settings]", f'joints = "{joints}"']
    for trial in protocol.trials:
        lines += ["", f'[trials."{trial.name}"]', f'role = "{trial.role}"']
    return "\n".join(lines) + "\n"


def _segments(sip: Sip) -> list[dict[str, Any]]:
    """Return per segment mass, CoM and inertia [Ixx Ixy Iyy Ixz Iyz Izz] about and in the segment's joint frame."""
    return [
        {"name": name, "mass_kg": float(p[0]), "com_m": (p[1:4] / p[0]).tolist(), "inertia_kgm2": p[4:].tolist()}
        for name, p in zip(sip.segments, sip.phi.reshape(-1, 10), strict=True)
    ]


def truth(person: Person, protocol: str, instruments: Instruments, performances: list[Performance]) -> dict[str, Any]:
    """Return the whole truth of a session, ready for JSON (SI units in the key names)."""
    bare, loaded = person.body, person.loaded_body
    markers, carried = bare.markers, dict(zip(bare.segment_joint, TRUE_SEGMENTS, strict=True))
    return {
        "version": __version__,
        "protocol": protocol,
        "seed": person.seed,
        "session": instruments.visit.number,
        "subject": {"mass_kg": person.subject.mass, "height_m": person.subject.stature, "sex": person.subject.sex},
        "mass_with_loads_kg": person.mass,
        "loads": [_load(person, load) for load in person.loads],
        "static_pose": _static_pose(person, instruments, performances),
        "segments_12": _segments(merged_sip(person, bare)),
        "segments_12_with_loads": _segments(merged_sip(person, loaded)),
        "segments_16": _segments(bare.sip),
        "segments_16_with_loads": _segments(loaded.sip),
        # each anatomical joint in the frame of the true segment next to it on the side of the pelvis
        "joint_centres": {
            joint.name.rsplit("_", 1)[0]: {"segment": carried[joint.parent], "place_m": joint.translation.tolist()}
            for joint in bare.joints
            if joint.parent in carried
        },
        "size_m": dict(person.size.size),
        "markers": {
            name: {"segment": TRUE_SEGMENTS[s], "place_m": place.tolist()}
            for name, s, place in zip(markers.names, markers.segment, markers.position, strict=True)
        },
        "habits": asdict(person.habits),
        "tolerances": asdict(instruments.visit.tolerances),
        "laboratory": {k: v for k, v in asdict(instruments.visit.laboratory).items() if k != "tolerances"},
        "instruments": {
            "tilt": instruments.tilt.tolist(),
            "plates": [
                {
                    "side": plate.side,
                    "corners_surveyed_m": plate.corners.tolist(),
                    "true_rotation": plate.turn.tolist(),
                    "true_centre_m": plate.centre.tolist(),
                    "mixing": plate.mixing.tolist(),
                    "offset": plate.offset.tolist(),
                }
                for plate in instruments.plates
            ],
        },
        "trials": [
            {
                "name": p.plan.name,
                "role": p.plan.role,
                "duration_s": p.plan.duration,
                "balance_error_m": p.balance_error,
            }
            for p in performances
        ],
    }


def _static_pose(person: Person, instruments: Instruments, performances: list[Performance]) -> dict[str, Any] | None:
    """Return where the 12 true frames were in the middle of the static trial (cameras' axes, marker time), if any."""
    static = next((p for p in performances if p.plan.role == "static"), None)
    if static is None:
        return None
    time = round(0.5 * static.plan.duration, 2)
    frames = true_frames(person, person.body, static.motion(np.array([time])).q[0])[0]
    tilt = instruments.tilt
    segments = [
        {"name": n, "rotation": (tilt @ turn).tolist(), "position_m": (tilt @ at).tolist()}
        for n, (turn, at) in frames.items()
    ]
    return {"trial": static.plan.name, "time_s": time, "segments_12": segments}


def _load(person: Person, load: AddedLoad) -> dict[str, Any]:
    """Return a load in the 12-segment model, and on the true segment that carries it."""
    segment, place = place_in_12(person, load)
    return {
        "segment": segment,
        "mass_kg": load.mass,
        "place_m": place.tolist(),
        "carried_by": load.segment,
        "place_on_carrier_m": load.place.tolist(),
        "radii_of_gyration_m": load.radii.tolist(),
    }


def sip_in_frames(document: dict[str, Any], rotation: Array, position: Array) -> Sip:
    """Return the true parameters of the 12 segments in ANOTHER model's frames: what a perfect identification of that
    model would find.

    ``document`` is a truth; ``rotation`` (12, 3, 3), ``position`` (12, 3) m are the lab poses of the other model's
    segments, in the same order, at the marker time ``document["static_pose"]["time_s"]`` of the static trial. Joint
    centres and axes differ between truth and model, so the numbers do; the body is the same.
    """
    phi = []
    for segment, pose, turn, place in zip(
        document["segments_12"], document["static_pose"]["segments_12"], rotation, position, strict=True
    ):
        own = np.array(
            [segment["mass_kg"], *(segment["mass_kg"] * np.array(segment["com_m"])), *segment["inertia_kgm2"]]
        )
        # new_R_lab lab_R_own, and the own origin in the new frame.
        there = turn.T @ np.array(pose["rotation"]), turn.T @ (np.array(pose["position_m"]) - place)
        phi.append(parameters_of_inertia(place_inertia(of_parameters(own), *there)))
    flat = np.concatenate(phi)
    return Sip(tuple(segment["name"] for segment in document["segments_12"]), flat, np.zeros((flat.size, flat.size)))
