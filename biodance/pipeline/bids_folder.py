"""A session as a BIDS motion dataset: the markers as recorded, and as a derivative what biodance found."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.bids import (
    COMPONENTS,
    BidsChannels,
    bids_label,
    write_description,
    write_events,
    write_motion,
    write_participants,
)
from biodance.lab.session.results_folder import made_folder
from biodance.motion.kinematics import centre_of_mass
from biodance.pipeline.movement import movement_of
from biodance.pipeline.trial_result import TrialResult
from biodance.records import CHANNELS, Markers, Motion, Plate, Session, Trial
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
        The folder holds files already.
    TrialRefused
        No trial has markers.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise SessionRefused(f"{folder}: holds files already and nothing is overwritten. Give another folder.")
    raw = [trial for trial in session.trials if trial.markers is not None]
    if not raw:
        raise TrialRefused(f"{session.folder}: no trial has markers, so there is nothing to share as motion.")
    subject = bids_label(session.subject.name or session.folder.name)
    place, derived = (made_folder(folder / part / f"sub-{subject}" / "motion") for part in (".", _DERIVED))
    write_description(folder, session.folder.name)
    write_description(folder / _DERIVED, "biodance", derived_by={"Name": "biodance", "Version": __version__})
    one = session.subject
    row = {
        "participant_id": f"sub-{subject}",
        "sex": one.sex,
        "age": one.age,
        "height_m": one.stature,
        "mass_kg": one.mass,
    }
    write_participants(folder, [row])
    for trial in raw:
        _recorded(trial, place, subject)
    moved = [found for found in trials if found.motion is not None]
    for found in moved:
        _found(found, body, derived, subject)
    return tuple(found.name for found in moved)


def _stem(subject: str, trial: str, system: str = _SYSTEM) -> str:
    return f"sub-{subject}_task-{bids_label(trial)}_tracksys-{system}"


def _recorded(trial: Trial, place: Path, subject: str) -> None:
    assert trial.markers is not None
    about = {"TrackingSystemName": _SYSTEM, "SourceFile": trial.source.path.name}
    write_motion(place, _stem(subject, trial.name), _points(trial.markers), task=bids_label(trial.name), about=about)
    if trial.plates:
        told = about | {"TrackingSystemName": "forceplates", "Plates": [_plate(plate) for plate in trial.plates]}
        stem = _stem(subject, trial.name, "forceplates")
        write_motion(place, stem, _wrenches(trial.plates), task=bids_label(trial.name), about=told)


def _points(markers: Markers) -> BidsChannels:
    rows = [(f"{name}_{axis}", axis, "POS", name, "m", "lab") for name in markers.names for axis in COMPONENTS]
    return BidsChannels(markers.time, markers.xyz.reshape(markers.time.size, -1), rows)


def _plate(plate: Plate) -> dict[str, object]:
    return {"Name": plate.name, "Corners_m": plate.corners.tolist()}


def _wrenches(plates: tuple[Plate, ...]) -> BidsChannels:
    """Return the ground's wrench on the subject, about the lab origin, of every plate."""
    units = ("N",) * 3 + ("N m",) * 3
    rows = [
        (f"{plate.name}_{channel}", channel[1], "MISC", plate.name, unit, "lab")
        for plate in plates
        for channel, unit in zip(CHANNELS, units, strict=True)
    ]
    return BidsChannels(plates[0].wrench.time, np.hstack([plate.wrench.value for plate in plates]), rows)


def _found(one: TrialResult, body: Body, place: Path, subject: str) -> None:
    assert one.motion is not None
    task, stem = bids_label(one.name), _stem(subject, one.name)
    about = {"TrackingSystemName": _SYSTEM, "Description": "joint angles and centre of mass of a tracked body"}
    write_motion(place, f"{stem}_desc-joints", _joints(body, one.motion), task=task, about=about)
    events = [(e.time, f"{e.side}_{'strike' if e.down else 'off'}") for e in movement_of(one, body, None).events]
    write_events(place, f"{stem}_desc-feet", events)


def _joints(body: Body, motion: Motion) -> BidsChannels:
    angles = np.where(motion.determined[:, None], motion.angles, np.nan)
    rows = [(joint.name, "n/a", "JNTANG", joint.name, "deg", "joint") for joint in body.joints]
    rows += [(f"centre_of_mass_{axis}", axis, "POS", "centre_of_mass", "m", "lab") for axis in COMPONENTS]
    return BidsChannels(motion.time, np.hstack([angles, centre_of_mass(body, motion)]), rows)
