"""What a session found for one trial, written into a copy of the trial's own C3D file."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.lab.c3d.results import Event, Output, write_results_c3d
from biodance.lab.c3d.write import FileValue
from biodance.motion.contact.contact import Contact, foot_wrenches
from biodance.motion.contact.soles import soles_from_body
from biodance.motion.dynamics import joint_torques
from biodance.motion.kinematics import centre_of_mass
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.movement import contact_of, movement_of
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

    Joint angles (deg), moments (N·m, what the muscles do) and powers (W), positive as the joints of the body; measured
    and predicted wrench about the lab origin (of the prepared, filtered trial); the centre of mass; foot strikes and
    offs, of the plates where they saw one, else of the markers; in the group BIODANCE the masses of all segments.
    Wrenches only where the plates measure all that the ground does, a leg's moments and powers where they measure what
    it does to its foot.

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
    outputs = [*_angles(body, one)]
    outputs.append(Output("BodyCentreOfMass", "MODELED_MARKERS", centre_of_mass(body, one.motion), "x, y, z"))
    contact = contact_of(one.trial, one, body)
    if one.comparison is not None:
        outputs += _wrenches(body, one)
    if contact is not None:
        outputs += _loads(body, one, contact)
    events = tuple(
        Event(event.time, event.side.title(), _NAMES[event.down]) for event in movement_of(one, body, None).events
    )
    said: dict[str, FileValue] = {
        "VERSION": [__version__],
        "SOURCE": [source[:255]],
        "SEGMENTS": list(body.segments),
        "MASS": body.sip.mass,
    }
    write_results_c3d(path, one.trial.source.path, outputs=outputs, events=events, parameters=said, subject=subject)
    return path, f"The recording of trial {trial} with {len(outputs)} results and {len(events)} events. {source}"


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


def _three(values: Array) -> Array:
    """Return (T, 3): up to three columns, the rest zero."""
    some = values[:, :3]
    return np.pad(some, ((0, 0), (0, 3 - some.shape[1])))


def _angles(body: Body, one: TrialResult) -> Iterator[Output]:
    assert one.motion is not None
    angle = np.where(one.motion.determined[:, None], one.motion.q[:, -len(body.joints) :], np.nan)
    for name, columns, axes in _groups(body):
        yield Output(f"{name}Angles", "ANGLES", _three(angle[:, columns]), axes, turns=False)


def _loads(body: Body, one: TrialResult, contact: Contact) -> Iterator[Output]:
    """Yield moments and powers; NaN where nobody knows what the ground does to the leg's foot."""
    assert one.motion is not None
    motion = one.motion
    feet = foot_wrenches(one.trial, contact, soles_from_body(body, motion))
    ground = {f"{side}_foot": wrench for side, wrench in zip(SIDES, feet, strict=True)}
    torque, rate = joint_torques(body, motion, ground).torque, motion.v[:, body.n_root :]
    for name, columns, axes in _groups(body):
        told = motion.determined & _told(name, contact)
        value = np.where(told[:, None], torque[:, columns], np.nan)
        power = np.sum(value * rate[:, columns], axis=1, keepdims=True)
        yield Output(f"{name}Moments", "MOMENTS", _three(value), f"{axes}: what the muscles do", turns=False)
        yield Output(f"{name}Power", "POWERS", _three(power), "all axes of the joint", turns=False)


def _told(name: str, contact: Contact) -> NDArray[np.bool_]:
    """Return (T,) where the ground's share in a joint is known: of legs, where their foot's is; of all others."""
    leg = any(word in name for word in ("Hip", "Knee", "Ankle"))
    side = next((k for k, word in enumerate(SIDES) if name.startswith(word.title())), None)
    return contact.told[:, side] if leg and side is not None else np.ones(len(contact.told), dtype=bool)


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
