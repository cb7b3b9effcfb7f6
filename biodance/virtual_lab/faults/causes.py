"""All causes that can be hidden in a session, by name: in the files, in and around the person; asked for in words."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from biodance.errors import BiodanceError, UnknownName
from biodance.records import SIDES, Subject
from biodance.virtual_lab.faults import forces
from biodance.virtual_lab.faults import recording_faults as made
from biodance.virtual_lab.faults.forces import sloshing_load, wobbling_mass
from biodance.virtual_lab.faults.recording_faults import Builder, Clock, axis_index
from biodance.virtual_lab.movement.performance import AppliedForce
from biodance.virtual_lab.movement.protocol import Protocol
from biodance.virtual_lab.person.person import AddedLoad, Person, make_person
from biodance.virtual_lab.person.prosthesis import with_prostheses
from biodance.virtual_lab.recording.visit import FIRST_VISIT, Fault, LabVisit
from biodance.virtual_lab.truth import load_on


@dataclass(frozen=True)
class Hidden:
    """One cause to hide: its ``name``, where (``target``) and how large (``values`` by parameter, SI units; a place has
    three numbers).
    """

    name: str
    target: str
    values: dict[str, tuple[float, ...]]

    def numbers(self, legal: tuple[str, ...]) -> dict[str, float]:
        """Return the values, one number each; BiodanceError unless they are exactly the ``legal`` ones."""
        if sorted(self.values) != sorted(legal):
            raise BiodanceError(
                f"Effect {self.name} has the parameters {', '.join(legal) or 'none'}; got "
                f"{', '.join(self.values) or 'none'}."
            )
        return {name: self.vector(name, 1)[0] for name in legal}

    def vector(self, name: str, count: int) -> tuple[float, ...]:
        """Return one value of ``count`` numbers; BiodanceError if it is missing or has another count."""
        if name not in self.values or len(self.values[name]) != count:
            raise BiodanceError(
                f"Effect {self.name}: {name} needs {count} number{'s' * (count > 1)}, got {self.values.get(name)}. "
                f"Example: 0.05;0;0"
            )
        return self.values[name]


@dataclass(frozen=True, eq=False)
class Scene:
    """What a cause may change: the ``visit``, and the ``loads`` of the ``person`` in the trials of ``protocol``."""

    person: Person
    protocol: Protocol
    visit: LabVisit
    loads: tuple[AddedLoad, ...] = ()


def clock_of(protocol: Protocol) -> Clock:
    """Return from and to where in the session (0 to 1) every trial lies, the trials one after another."""
    ends = np.cumsum([trial.duration for trial in protocol.trials])
    starts = ends - [trial.duration for trial in protocol.trials]
    return {
        t.name: (float(a / ends[-1]), float(b / ends[-1]))
        for t, a, b in zip(protocol.trials, starts, ends, strict=True)
    }


FAULTS: dict[str, Builder] = {
    f.__name__: f
    for f in (
        *(made.plate_offset, made.plate_gain, made.plate_crosstalk, made.plate_drift, made.plate_position),
        *(made.plate_rotation, made.plate_hysteresis, made.plate_creep, made.plate_bending, made.object_on_plate),
        *(made.axis_error, made.clipping, made.mains_hum, made.loose_connection, made.saturating),
        *(made.time_delay, made.clock_drift, made.trigger_jitter, made.frame_rate, made.filter_mismatch),
        *(made.body_mass, made.unit_error, made.labels_swapped, made.dropped_frames, made.swaying_cameras),
    )
}
FORCES: dict[str, Callable[..., AppliedForce]] = {
    f.__name__: f
    for f in (
        *(forces.external_contact, forces.body_weight_support, forces.slack_harness),
        *(forces.table_edge, forces.spinning_wheel),
    )
}
_GIVEN = ("target", "clock", "channel", "wrench", "recording", "performance", "time", "return")
"""What a builder, or the function behind it, takes beside the sizes of a cause."""


def fault_of(cause: Hidden, clock: Clock) -> Fault:
    """Return the change of a recording that a cause makes; ``clock`` says from and to where in the session each trial
    lies.

    Raises
    ------
    UnknownName
        The cause is not made in the recording, or its target does not exist.
    BiodanceError
        A parameter is missing or has a wrong name.
    """
    if cause.name not in FAULTS:
        raise UnknownName.of("effect that is made in a recording", cause.name, tuple(FAULTS))
    builder = FAULTS[cause.name]
    timed = {"clock": clock} if "clock" in builder.__annotations__ else {}
    return builder(cause.target, **cause.numbers(_parameters(builder)), **timed)


def _parameters(builder: Callable[..., object]) -> tuple[str, ...]:
    return tuple(name for name in builder.__annotations__ if name not in _GIVEN)


def _load(cause: Hidden, scene: Scene) -> Scene:
    """Put ``mass`` kg on one of the 12 segments, ``place`` (3) m in its joint frame (beside the CoM if not given)."""
    mass = cause.vector("mass", 1)[0]
    if set(cause.values) - {"mass", "place"} or mass <= 0:
        raise BiodanceError(f"Effect added_mass has mass (kg, > 0) and place (three numbers, m); got {cause.values}.")
    place = np.array(cause.vector("place", 3)) if "place" in cause.values else None
    return replace(scene, loads=(*scene.loads, load_on(scene.person, cause.target, mass, place=place)))


def _wobble(cause: Hidden, scene: Scene) -> Scene:
    force = wobbling_mass(scene.person, cause.target, **cause.numbers(("mass",)))
    return replace(scene, visit=replace(scene.visit, forces=(*scene.visit.forces, force)))


def _slosh(cause: Hidden, scene: Scene) -> Scene:
    load, force = sloshing_load(scene.person, cause.target, **cause.numbers(("mass", "sloshing")))
    return replace(scene, loads=(*scene.loads, load), visit=replace(scene.visit, forces=(*scene.visit.forces, force)))


def _tilt(cause: Hidden, scene: Scene) -> Scene:
    """Turn the laboratory's axes by ``angle`` rad about lab x or y."""
    turn = np.array(scene.visit.tilt)
    turn[axis_index(cause.target)] += cause.numbers(("angle",))["angle"]
    return replace(scene, visit=replace(scene.visit, tilt=tuple(turn)))


def _shifted(field: Literal["joint_shifts", "marker_shifts"]) -> Callable[[Hidden, Scene], Scene]:
    """Return the change that moves a joint centre or a marker by ``shift`` (3) m."""

    def change(cause: Hidden, scene: Scene) -> Scene:
        moved = {**getattr(scene.visit, field), cause.target: np.array(cause.vector("shift", 3))}
        changes: dict[str, Any] = {field: moved}
        return replace(scene, visit=replace(scene.visit, **changes))

    return change


def _longer(cause: Hidden, scene: Scene) -> Scene:
    """Make a thigh or shank ``error`` m longer than its markers say: the joint at its end lies lower."""
    ends = {
        f"{side}_{upper}": f"{side}_{joint}"
        for side in SIDES
        for upper, joint in (("thigh", "knee"), ("shank", "ankle"))
    }
    if cause.target not in ends:
        raise UnknownName.of("segment whose length can be wrong", cause.target, tuple(ends))
    shift = np.array([0.0, -cause.numbers(("error",))["error"], 0.0])
    return replace(
        scene, visit=replace(scene.visit, joint_shifts={**scene.visit.joint_shifts, ends[cause.target]: shift})
    )


def _prosthesis(cause: Hidden, scene: Scene) -> Scene:
    """Make the limb from a segment on ``lighter`` kg: a prosthesis."""
    limbs = {**scene.visit.lighter_limbs, cause.target: cause.numbers(("lighter",))["lighter"]}
    with_prostheses(scene.person, limbs)  # refused here, before anything is simulated
    return replace(scene, visit=replace(scene.visit, lighter_limbs=limbs))


def _motion(tolerance: str) -> Callable[[Hidden, Scene], Scene]:
    """Return the change that lets the person move a joint that the model lacks by ``angle`` rad rms per axis."""

    def change(cause: Hidden, scene: Scene) -> Scene:
        angle = cause.numbers(("angle",))["angle"]
        return replace(
            scene, visit=replace(scene.visit, tolerances=replace(scene.visit.tolerances, **{tolerance: angle}))
        )

    return change


IN_THE_PERSON: dict[str, Callable[[Hidden, Scene], Scene]] = {
    "added_mass": _load,
    "wobbling_mass": _wobble,
    "sloshing_load": _slosh,
    "lab_tilt": _tilt,
    "joint_centre": _shifted("joint_shifts"),
    "marker_misplaced": _shifted("marker_shifts"),
    "segment_length": _longer,
    "unequal_limbs": _prosthesis,
    "head_joint": _motion("head_motion"),
    "trunk_joint": _motion("thorax_motion"),
    "shoulder_girdle": _motion("girdle_motion"),
}
CAUSES = (*FAULTS, *FORCES, *IN_THE_PERSON)


def conceal(cause: Hidden, scene: Scene) -> Scene:
    """Return the scene with one more cause in it.

    Raises
    ------
    UnknownName
        There is no such cause, or its target does not exist.
    BiodanceError
        A parameter is missing, has a wrong name or an impossible value.
    """
    visit = scene.visit
    if cause.name in IN_THE_PERSON:
        return IN_THE_PERSON[cause.name](cause, scene)
    if cause.name in FORCES:
        builder = FORCES[cause.name]
        force = builder(cause.target, **cause.numbers(_parameters(builder)))
        return replace(scene, visit=replace(visit, forces=(*visit.forces, force)))
    if cause.name not in FAULTS:
        raise UnknownName.of("effect that the virtual laboratory can make", cause.name, CAUSES)
    fault = fault_of(cause, clock_of(scene.protocol))
    return replace(scene, visit=replace(visit, faults=(*visit.faults, fault)))


def parse_cause(text: str) -> Hidden:
    """Read ``NAME:target=...,param=value,...``; a value of three numbers is written ``0.05;0;0``.

    Raises
    ------
    BiodanceError
        The text does not have that form; the message shows the part and an example.
    """
    name, _, rest = text.partition(":")
    values: dict[str, tuple[float, ...]] = {}
    target = ""
    for part in filter(None, rest.split(",")):
        key, equals, value = part.partition("=")
        if not equals:
            raise BiodanceError(
                f"--effect {text}: {part!r} is not parameter=value. Example: plate_gain:target=Fz,gain=0.04"
            )
        if key == "target":
            target = value
            continue
        try:
            values[key] = tuple(float(number) for number in value.split(";"))
        except ValueError as error:
            raise BiodanceError(
                f"--effect {text}: {value!r} is not a number (or three, as 0.05;0;0), for {key}. Where a cause lies is "
                f"said by target=...; `biodance effects {name}` lists its parameters."
            ) from error
    return Hidden(name, target, values)


def hide(
    hidden: tuple[Hidden, ...], subject: Subject, protocol: Protocol, *, seed: int, visit: LabVisit = FIRST_VISIT
) -> tuple[LabVisit, tuple[AddedLoad, ...]]:
    """Return the visit with the causes, and the loads that the person carries.

    Raises
    ------
    UnknownName
        A cause, target or channel does not exist.
    BiodanceError
        A parameter is missing, or a mass is not positive.
    """
    scene = Scene(make_person(subject, seed, tolerances=visit.tolerances, session=visit.number), protocol, visit)
    for cause in hidden:
        scene = conceal(cause, scene)
    return scene.visit, scene.loads
