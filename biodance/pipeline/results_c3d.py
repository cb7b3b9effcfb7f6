"""What a session found for one trial, written into a copy of the trial's own C3D file."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.lab.c3d.parameters import FileValue
from biodance.lab.c3d.results import Event, Output, write_results_c3d
from biodance.motion.contact.contact import Contact, foot_wrenches, ground_contact
from biodance.motion.contact.events import foot_events
from biodance.motion.contact.soles import soles_from_body
from biodance.motion.dynamics import joint_torques
from biodance.motion.kinematics import centre_of_mass
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.trial_result import TrialResult
from biodance.records import SIDES, Array, Wrench
from biodance.version import __version__

_NAMES = {True: "Foot Strike", False: "Foot Off"}


def results_into_c3d(
    one: TrialResult, body: Body, path: Path, *, source: str, subject: str | None = None
) -> tuple[Path, str]:
    """Write a copy of the C3D file of one trial with its results; return its path and one sentence on what it holds.

    ``body`` that moved, with the parameters to predict with, and ``source`` in words where they come from; ``subject``
    the person where the file holds several.

    Joint angles (deg) and joint moments (N·m, what the muscles do), positive as the joints of the body; measured and
    predicted wrench about the lab origin (of the prepared, filtered trial); the centre of mass; foot strikes and offs
    on the plates; in the group BIODANCE the masses of all segments. Moments and wrenches only where the plates measure
    all that the ground does.

    Raises
    ------
    TrialRefused
        The trial gives no motion, or comes from no C3D file.
    FileRefused
        The file cannot be copied, or ``path`` exists.
    """
    trial = one.trial.name
    if one.motion is None:
        raise TrialRefused(f"Trial {trial}: it gives no motion, so there are no results to write. {one.reason}")
    if one.trial.source.format != "C3D":
        raise TrialRefused(
            f"Trial {trial}: comes from a file of the format {one.trial.source.format}. Only a C3D file is copied as "
            f"one."
        )
    outputs, events = [*_angles(body, one)], tuple[Event, ...]()
    outputs.append(Output("BodyCentreOfMass", "MODELED_MARKERS", centre_of_mass(body, one.motion), "x, y, z"))
    contact = _contact(body, one)
    if contact is not None:
        outputs += [*_wrenches(body, one), *_moments(body, one, contact)]
        feet = foot_wrenches(one.trial, contact, soles_from_body(body, one.motion))
        events = tuple(
            Event(event.time, event.side.title(), _NAMES[event.down]) for event in foot_events(feet, contact)
        )
    said: dict[str, FileValue] = {
        "VERSION": [__version__],
        "SOURCE": [source[:255]],
        "SEGMENTS": list(body.segments),
        "MASS": body.sip.mass,
    }
    write_results_c3d(path, one.trial.source.path, outputs=outputs, events=events, parameters=said, subject=subject)
    return path, f"The recording of trial {trial} with {len(outputs)} results and {len(events)} events. {source}"


def _contact(body: Body, one: TrialResult) -> Contact | None:
    """Return the ground contact; None where measured and simulated wrench could not be compared."""
    if one.comparison is None or one.motion is None:
        return None
    try:
        return ground_contact(one.trial, soles_from_body(body, one.motion), mass=float(body.sip.mass.sum()))
    except BiodanceError:
        return None


def _groups(body: Body) -> Iterator[tuple[str, list[int], str]]:
    """Yield name (``RightHip``), indices and names of the axes (``flexion, adduction, rotation``) of every joint of
    the body.
    """
    chain: list[int] = []
    for i, joint in enumerate(body.joints):
        chain.append(i)
        if joint.segment < 0:
            continue
        names = [body.joints[j].name for j in chain]
        common, _, _ = names[0].rpartition("_")
        common = common if common and all(name.startswith(f"{common}_") for name in names) else names[0]
        axes = ", ".join(name.removeprefix(f"{common}_") for name in names)
        yield "".join(word.title() for word in common.split("_")), chain, axes
        chain = []


def _three(values: Array, columns: list[int]) -> Array:
    """Return (T, 3): up to three columns, the rest zero."""
    some = values[:, columns[:3]]
    return np.pad(some, ((0, 0), (0, 3 - some.shape[1])))


def _angles(body: Body, one: TrialResult) -> Iterator[Output]:
    assert one.motion is not None
    angle = np.where(one.motion.determined[:, None], one.motion.q[:, -len(body.joints) :], np.nan)
    for name, columns, axes in _groups(body):
        yield Output(f"{name}Angles", "ANGLES", _three(angle, columns), axes, turns=False)


def _moments(body: Body, one: TrialResult, contact: Contact) -> Iterator[Output]:
    assert one.motion is not None
    assert one.comparison is not None
    feet = foot_wrenches(one.trial, contact, soles_from_body(body, one.motion))
    ground = {f"{side}_foot": wrench for side, wrench in zip(SIDES, feet, strict=True)}
    torque = np.where(one.comparison.used[:, None], joint_torques(body, one.motion, ground).torque, np.nan)
    for name, columns, axes in _groups(body):
        yield Output(f"{name}Moments", "MOMENTS", _three(torque, columns), f"{axes}: what the muscles do", turns=False)


def _wrenches(body: Body, one: TrialResult) -> Iterator[Output]:
    assert one.motion is not None
    assert one.comparison is not None
    found = one.comparison
    predicted = predict_wrench(body, one.motion)
    for word, wrench in (
        ("Measured", Wrench(found.time, found.measured)),
        ("Predicted", replace(predicted, time=found.time)),
    ):
        value = np.where(found.used[:, None], wrench.value, np.nan)
        yield Output(f"{word}GroundForce", "FORCES", value[:, :3], "x, y, z of the ground's force on the subject")
        yield Output(f"{word}GroundMoment", "MOMENTS", value[:, 3:], "x, y, z of its moment about the lab origin")
