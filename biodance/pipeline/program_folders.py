"""A session as a folder that other programs open: an OpenSim model with its motions and forces, or BIDS motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.export import write_model
from biodance.body.export.osim import ROOT_ROTATIONS, ROOT_TRANSLATIONS
from biodance.body.parts import UPRIGHT
from biodance.body.solids import SegmentSolids, segment_solids
from biodance.errors import BiodanceError, SessionRefused, TrialRefused
from biodance.lab.plain_text import write_whole
from biodance.lab.program_tables import (
    COMPONENTS,
    BidsChannels,
    TimeTable,
    bids_label,
    external_loads,
    ground_table,
    inverse_dynamics_setup,
    write_description,
    write_events,
    write_mot,
    write_motion,
    write_participants,
)
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.results_folder import made_folder, whole_folder
from biodance.motion.contact import foot_wrenches
from biodance.motion.dynamics import joint_torques
from biodance.motion.kinematics import centre_of_mass
from biodance.motion.soles import soles_from_body
from biodance.pipeline.trial import TrialResult, contact_of, movement_of
from biodance.records import CHANNELS, Motion, Session, Trial, Wrench, longest_run, runs
from biodance.version import __version__

_DERIVED = "derivatives/biodance"
_SYSTEM = "optical"


def write_bids_folder(session: Session, trials: Sequence[TrialResult], body: Body, folder: Path) -> tuple[str, ...]:
    """Write all trials of a session; return the names of those that gave a motion.

    Raw: markers in m (lab frame, z up), the force plates as channels of their own system. Derived: joint angles in deg,
    centre of mass in m, foot events.

    Raises
    ------
    SessionRefused
        The folder holds files already, or two trials would have one name.
    TrialRefused
        No trial has markers.
    """
    raw = [trial for trial in session.trials if trial.markers is not None]
    if not raw:
        raise TrialRefused(f"{session.folder}: no trial has markers, so there is nothing to share as motion.")
    _refuse_alike({trial.name: bids_label(trial.name) for trial in raw}, folder)
    subject = bids_label(session.subject.name or session.folder.name)
    moved = [found for found in trials if found.motion is not None]
    one = session.subject
    said = {"sex": one.sex, "age": one.age, "height_m": one.stature, "mass_kg": one.mass}
    column = {"sex": "sex", "stature": "height_m", "mass": "mass_kg"}
    unknown = dict.fromkeys(column[what] for what in one.guessed)
    with whole_folder(folder) as part:
        place, derived = (made_folder(part / below / f"sub-{subject}" / "motion") for below in (".", _DERIVED))
        write_description(part, session.folder.name)
        write_description(part / _DERIVED, "biodance", derived_by={"Name": "biodance", "Version": __version__})
        write_participants(part, [{"participant_id": f"sub-{subject}", **said, **unknown}])
        for trial in raw:
            _recorded(trial, place, subject)
        for found in moved:
            _found(found, body, derived, subject)
    return tuple(found.name for found in moved)


def _refuse_alike(names: Mapping[str, str], folder: Path) -> None:
    """Raise SessionRefused where two trials (name -> file) would share a file, capitals not told apart."""
    seen: dict[str, str] = {}
    for trial, name in names.items():
        if (other := seen.setdefault(name.lower(), trial)) != trial:
            raise SessionRefused(
                f"{folder}: the trials {other} and {trial} would both be called {name} there; nothing was written. "
                f"Rename one, or choose with --trial."
            )


def _stem(subject: str, trial: str, system: str = _SYSTEM) -> str:
    return f"sub-{subject}_task-{bids_label(trial)}_tracksys-{system}"


def _recorded(trial: Trial, place: Path, subject: str) -> None:
    assert trial.markers is not None
    about = {"TrackingSystemName": _SYSTEM, "SourceFile": trial.source.path.name}
    names, xyz, time = trial.markers.names, trial.markers.xyz, trial.markers.time
    rows = [(f"{name}_{axis}", axis, "POS", name, "m", "lab") for name in names for axis in COMPONENTS]
    points = BidsChannels(time, xyz.reshape(time.size, -1), rows)
    write_motion(place, _stem(subject, trial.name), points, task=bids_label(trial.name), about=about)
    if trial.plates:
        plates = [{"Name": plate.name, "Corners_m": plate.corners.tolist()} for plate in trial.plates]
        told = about | {"TrackingSystemName": "forceplates", "Plates": plates}
        stem, units = _stem(subject, trial.name, "forceplates"), ("N",) * 3 + ("N m",) * 3
        rows = [  # the ground's wrench on the subject, about the lab origin, of every plate
            (f"{plate.name}_{channel}", channel[1], "MISC", plate.name, unit, "lab")
            for plate in trial.plates
            for channel, unit in zip(CHANNELS, units, strict=True)
        ]
        values = np.hstack([plate.wrench.value for plate in trial.plates])
        wrenches = BidsChannels(trial.plates[0].wrench.time, values, rows)
        write_motion(place, stem, wrenches, task=bids_label(trial.name), about=told)


def _found(one: TrialResult, body: Body, place: Path, subject: str) -> None:
    motion, task, stem = one.moved, bids_label(one.name), _stem(subject, one.name)
    about = {"TrackingSystemName": _SYSTEM, "Description": "joint angles and centre of mass of a tracked body"}
    about["Missing"] = " ".join(state_notes(motion)) or "none"
    # angles in deg and centre of mass in m; empty where the markers do not determine the posture
    known = np.where(motion.determined[:, None], 1.0, np.nan)
    rows = [(joint.name, "n/a", "JNTANG", joint.name, "deg", "joint") for joint in body.joints]
    rows += [(f"centre_of_mass_{axis}", axis, "POS", "centre_of_mass", "m", "lab") for axis in COMPONENTS]
    values = np.hstack([motion.known_angles, known * centre_of_mass(body, motion)])
    joints = BidsChannels(motion.time, values, rows)
    write_motion(place, f"{stem}_desc-joints", joints, task=task, about=about)
    events = [(e.time, f"{e.side}_{'strike' if e.down else 'off'}") for e in movement_of(one, body, None).events]
    write_events(place, f"{stem}_desc-feet", events)


def opensim_coordinates(body: Body, motion: Motion) -> TimeTable:
    """Return the coordinates of ``motion`` by name: rad and m, root in OpenSim's ground (y up), joints as in ``body``.

    Frames whose posture the markers do not determine are left out: the format has no word for a missing number.
    `state_notes` says which, and what is filled.

    Raises
    ------
    TrialRefused
        No frame is determined.
    """
    names, known = [joint.name for joint in body.joints], motion.determined
    if not known.any():
        raise TrialRefused(f"{body.name}: no frame's markers determine the posture, so there are no coordinates.")
    motion = motion.at(known) if not known.all() else motion
    angles = motion.q[:, body.nq - len(names) :]
    if not body.n_root:
        return TimeTable(body.name, tuple(names), motion.time, angles)
    # ground axes x, y up, z right instead of x, y left, z up: R' = U'R, and places p' = U'p (rows: p U)
    turned = UPRIGHT.T @ Rotation.from_quat(motion.q[:, 3:7]).as_matrix()
    turns = np.unwrap(Rotation.from_matrix(turned).as_euler("ZXY"), axis=0)
    root = [f"{body.segments[0]}_{word}" for word in (*ROOT_ROTATIONS, *ROOT_TRANSLATIONS)]
    return TimeTable(body.name, (*root, *names), motion.time, np.hstack([turns, motion.q[:, :3] @ UPRIGHT, angles]))


def state_notes(motion: Motion) -> tuple[str, ...]:
    """Return in sentences which frames of a motion are left out, and which angles are filled or held when."""
    out = ", ".join(f"{motion.time[a]:.3f} to {motion.time[b - 1]:.3f} s" for a, b in runs(~motion.determined))
    said = [f"Left out, because the markers do not determine the posture: {out}."] if out else []
    where: dict[str, list[str]] = {}
    for span in motion.spans():
        inside = (motion.time >= span.start) & (motion.time <= span.end)
        if motion.determined[inside].any():
            where.setdefault(f"{span.start:.3f} to {span.end:.3f} s {span.state.words}", []).append(span.joint)
    return (*said, *(f"From {when}: {', '.join(joints)}." for when, joints in where.items()))


MODEL = "model.osim"
_ENDS = (".trc", ".mot", "_forces.mot", "_ExternalLoads.xml", "_InverseDynamics.xml", "_torques.sto")
"""Of the names of a trial's files."""


@dataclass(frozen=True)
class OpensimTrial:
    """A trial's ``files``; ``dynamics`` from and to s, where plates measure all, or None and ``why_not``."""

    trial: str
    files: tuple[str, ...]
    dynamics: tuple[float, float] | None
    why_not: str = ""


def write_opensim_folder(
    trials: tuple[TrialResult, ...],
    body: Body,
    folder: Path,
    *,
    source: str,
    solids: SegmentSolids | None = None,
) -> tuple[OpensimTrial, ...]:
    """Write ``model.osim`` with the meshes of its segments, and the files of every trial that gives a motion.

    These are ``.trc`` (markers), ``.mot`` (coordinates), ``_forces.mot`` (of each foot), ``_ExternalLoads.xml``,
    ``_InverseDynamics.xml`` over the longest span in which the plates measure all, and ``_torques.sto``, our own.

    Raises
    ------
    SessionRefused
        The folder holds files already, or files of two trials would have one name.
    TrialRefused
        No trial gives a motion.
    BiodanceError
        The body's inertia cannot exist, or OpenSim cannot hold its joints.
    """
    moving = [one for one in trials if one.motion is not None]
    if not moving:
        said = " ".join(one.reason for one in trials)
        raise TrialRefused(
            f"{folder}: no trial gives a motion, so there is nothing for OpenSim to move. {said}".strip()
        )
    _refuse_alike({f"{one.name} ({end})": f"{one.name}{end}" for one in moving for end in _ENDS}, folder)
    solids = segment_solids(body) if solids is None else solids
    with whole_folder(folder) as part:
        write_model(body, part / MODEL, format="osim", source=source, solids=solids)
        return tuple(_trial(one, body, part) for one in moving)


def _trial(one: TrialResult, body: Body, folder: Path) -> OpensimTrial:
    motion, name = one.moved, one.name
    table, notes = opensim_coordinates(body, motion), state_notes(motion)
    files = [write_mot(folder / f"{name}.mot", table, notes=notes).name]
    if one.trial.markers is not None:
        files.insert(0, write_trc(folder / f"{name}.trc", one.trial.markers).name)
    contact = contact_of(one, body)
    if contact is None:
        return OpensimTrial(name, tuple(files), None, "It has no force plate.")
    feet = foot_wrenches(one.trial, contact, soles_from_body(body, motion))
    # the files hold finite numbers only; no dynamics is set up where the plates tell nothing
    ground = {foot: Wrench(wrench.time, np.nan_to_num(wrench.value)) for foot, wrench in feet.items()}
    files.append(write_mot(folder / f"{name}_forces.mot", ground_table(ground, name=name)).name)
    loads = external_loads(tuple(ground), data_file=f"{name}_forces.mot")
    files.append(write_whole(folder / f"{name}_ExternalLoads.xml", loads.encode()).name)
    # The longest run of frames in which plates and markers tell all; None where it is too short.
    first, stop = longest_run(contact.measured & motion.determined)
    if stop - first < 10:  # frames
        return OpensimTrial(name, tuple(files), None, f"The plates do not measure all the ground does. {one.reason}")
    span, between = slice(first, stop), (float(motion.time[first]), float(motion.time[stop - 1]))
    setup = inverse_dynamics_setup(
        name,
        model=MODEL,
        coordinates=f"{name}.mot",
        loads=f"{name}_ExternalLoads.xml",
        between=between,
        out=f"{name}_opensim_torques.sto",
    )
    files.append(write_whole(folder / f"{name}_InverseDynamics.xml", setup.encode()).name)
    try:
        torque = joint_torques(body, motion, ground).torque[span]
    except BiodanceError as why:
        raise TrialRefused(f"Trial {name}: {why}") from why
    columns = tuple(f"{joint.name}_moment" for joint in body.joints)  # in OpenSim's names, N·m
    torques = TimeTable(f"{name} torques of biodance", columns, motion.time[span], torque)
    files.append(write_mot(folder / f"{name}_torques.sto", torques).name)
    return OpensimTrial(name, tuple(files), between)
