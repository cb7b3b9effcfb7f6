"""All causes that can be hidden in a session, by name: in the files, in and around the person; asked for in words. What
acts on the person beside gravity and the plates: rails, ropes, table edges, and masses on springs.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from biodance.body.parts import GRAVITY
from biodance.errors import BiodanceError, refuse_unknown
from biodance.motion.kinematics import Poses, poses
from biodance.records import SIDES, Array, Subject
from biodance.virtual_lab.movement import Protocol
from biodance.virtual_lab.movement.performance import AppliedForce, Performance
from biodance.virtual_lab.movement.posing import septic
from biodance.virtual_lab.person import CARRIERS, MERGED, AddedLoad, Person, load_on, make_person, with_prostheses
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS, stream
from biodance.virtual_lab.recording_faults import FAULTS, Clock, axis_index
from biodance.virtual_lab.visit import FIRST_VISIT, Fault, LabVisit

GRIPS = {
    "right_forearm_hand": ("right_hand", (0.0, -0.08, 0.0)),
    "left_forearm_hand": ("left_hand", (0.0, -0.08, 0.0)),
    "right_foot": ("right_foot", (0.10, -0.05, 0.0)),
    "left_foot": ("left_foot", (0.10, -0.05, 0.0)),
    "pelvis": ("pelvis", (-0.09, 0.05, 0.0)),
    "trunk_head": ("thorax", (-0.10, 0.15, 0.0)),
    "right_thigh": ("right_thigh", (0.05, -0.30, 0.0)),
    "left_thigh": ("left_thigh", (0.05, -0.30, 0.0)),
}
"""Where something touches each part of the body: the true segment and the place in its frame, m."""
CEILING = 3.2
"""m over the floor: where ropes hang from."""
TOUCH, _GRIP = 1.6, 0.25
"""s: how long a hand stays on a rail, and how long it takes to take the load and to leave it."""


def force_at_point(force: Array, point: Array) -> Array:
    """Return forces (T, 3) at ``point`` (T, 3) as wrenches (T, 6) about the lab origin."""
    return np.concatenate([force, np.cross(point, force)], axis=1)


def true_poses(performance: Performance, time: Array) -> Poses:
    """Return the poses of the true segments at ``time``."""
    return poses(performance.person.body, performance.motion(time).q)


def grip(target: str, pose: Poses) -> Array:
    """Return where something touches the part ``target`` of the body (T, 3) m; UnknownName lists the parts."""
    refuse_unknown("part of the virtual body that something can touch", target, GRIPS)
    segment, place = GRIPS[target]
    return pose.points([TRUE_SEGMENTS.index(segment)], np.array([place]))[:, 0]


def touches(time: Array, rng: np.random.Generator, *, every: float) -> Array:
    """Return (T,) 0..1: hands that come and go, one touch in every ``every`` s of a trial, at random times."""
    out = np.zeros_like(time)
    for start in np.arange(time[0], time[-1] - every + 1e-9, every):
        begin = start + rng.uniform(0.0, every - TOUCH)
        out += septic((time - begin) / _GRIP) * septic((begin + TOUCH - time) / _GRIP)
    return out


FORCES: dict[str, Callable[..., Array]] = {}
"""Everything that pulls or pushes below, by its name: (performance, time (T,) s, target, **sizes) -> wrench (T, 6)
about the lab origin.
"""


def acting(act: Callable[..., Array]) -> Callable[..., Array]:
    """Add a force to those that are known by name."""
    FORCES[act.__name__] = act
    return act


@acting
def external_contact(performance: Performance, time: Array, target: str, force: float) -> Array:
    """Touch a rail or be held: touches of ``force`` (N), mostly from below, at a part of the body; one in every 4 s."""
    rng = stream(performance.person.seed, "touch", target, performance.plan.name)
    direction = np.array([0.35 * rng.normal(), 0.35 * rng.normal(), 1.0])
    strength = force * touches(time, rng, every=4.0) * (performance.plan.role != "static")
    pull = strength[:, None] * direction / np.linalg.norm(direction)
    return force_at_point(pull, grip(target, true_poses(performance, time)))


def _rope(performance: Performance, point: Array) -> tuple[Array, Array]:
    """Return the way (T, 3) m from ``point`` (T, 3) to the ceiling over the feet, and its length (T,) m."""
    away = np.array([*np.mean(list(performance.stance.pressure.values()), axis=0), CEILING]) - point
    return away, np.linalg.norm(away, axis=1)


@acting
def body_weight_support(performance: Performance, time: Array, target: str, force: float, stiffness: float) -> Array:
    """Hang a rope from the ceiling to the pelvis: ``force`` (N) when standing, ``stiffness`` (N/m) as it goes down."""
    if performance.plan.role == "static":
        return np.zeros((time.size, 6))
    point = grip("pelvis", true_poses(performance, time))
    away, length = _rope(performance, point)
    # Taut only: a rope does not push.
    tension = np.maximum(force + stiffness * (length - length[0]), 0.0)
    return force_at_point((tension / length)[:, None] * away, point)


@acting
def slack_harness(performance: Performance, time: Array, target: str, stiffness: float) -> Array:
    """Hang a safety rope, loose until the hips are 5 cm down, that pulls with its stretch squared (N/m²)."""
    point = grip("trunk_head", true_poses(performance, time))
    away, length = _rope(performance, point)
    stretch = np.maximum(length - length[0] - 0.05, 0.0)
    return force_at_point((stiffness * stretch**2 / length)[:, None] * away, point)


@acting
def table_edge(performance: Performance, time: Array, target: str, force: float) -> Array:
    """Let the right thigh run against furniture: horizontal pushes of ``force`` (N), one in 2 s, of either sign."""
    rng = stream(performance.person.seed, "table", performance.plan.name)
    strength = np.zeros_like(time)
    for start in np.arange(time[0], time[-1] - 2.0, 2.0):
        begin = start + rng.uniform(0.0, 1.4)
        strength += rng.choice([-1.0, 1.0]) * force * np.sin(np.pi * np.clip((time - begin) / 0.6, 0.0, 1.0)) ** 2
    point = grip("right_thigh", true_poses(performance, time))
    return force_at_point(strength[:, None] * np.array([0.8, 0.6, 0.0]), point)


@acting
def spinning_wheel(performance: Performance, time: Array, target: str, momentum: float) -> Array:
    """Carry a spinning wheel about the right-left axis of the chest: its ``momentum`` (N·m·s) resists turning."""
    turn = true_poses(performance, time).rotation[:, TRUE_SEGMENTS.index("thorax")]
    # The chest gives dL/dt to the wheel, the wheel its negative to the chest.
    return np.concatenate([np.zeros((time.size, 3)), -np.gradient(momentum * turn[:, :, 2], time, axis=0)], axis=1)


@dataclass(frozen=True)
class Spring:
    """How a loose mass hangs: ``frequency`` Hz undamped, ``damping`` ratio, ``free`` (3,) 1 = moves along x, y, z."""

    frequency: float
    damping: float
    free: tuple[float, float, float] = (1.0, 1.0, 1.0)


_FLESH = {"trunk_head": Spring(5.5, 0.3)}  # Viscera; other flesh hangs on `MUSCLE`
MUSCLE = Spring(9.0, 0.3)
LIQUID = Spring(1.3, 0.08, (1.0, 1.0, 0.0))


def swing(acceleration: Array, step: float, spring: Spring) -> tuple[Array, Array]:
    """Return z (T, 3) m and z'' (T, 3) m/s² of a mass on a spring whose foot moves with ``acceleration`` (T, 3) m/s²,
    from rest.

    ``step`` s between samples; exact for an acceleration that is linear between samples.
    """
    from scipy.signal import cont2discrete, lfilter, ss2tf

    w, damping = 2 * np.pi * spring.frequency, spring.damping
    # z'' = -w² z - 2 d w z' - a in the frame of the foot.
    A, B = np.array([[0.0, 1.0], [-w * w, -2 * damping * w]]), np.array([[0.0], [-1.0]])
    discrete = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), step, method="foh")
    numerator, denominator = ss2tf(*discrete[:4])
    z, rate = (lfilter(row, denominator, acceleration, axis=0) for row in numerator)
    # z'' from the equation itself, not by differences.
    return z, -w * w * z - 2 * damping * w * rate - acceleration


def loose(segment: str, place: Array, mass: float, spring: Spring) -> AppliedForce:
    """Return the force of ``mass`` kg, counted as fixed at ``place`` (3,) m of a true segment but on a spring there."""

    def act(performance: Performance, time: Array) -> Array:
        from scipy.interpolate import make_interp_spline

        point = true_poses(performance, time).points([TRUE_SEGMENTS.index(segment)], place[None])[:, 0]
        acceleration = make_interp_spline(time, point, k=5).derivative(2)(time)
        z, z2 = (np.array(spring.free) * curve for curve in swing(acceleration, float(time[1] - time[0]), spring))
        # Moment of the mass where it is, with its own acceleration, less that of the mass as it is counted.
        moment = np.cross(point + z, mass * (acceleration + z2 - GRAVITY)) - np.cross(
            point, mass * (acceleration - GRAVITY)
        )
        # On the person, hence the minus.
        return -np.concatenate([mass * z2, moment], axis=1)

    return act


def wobbling_mass(person: Person, target: str, mass: float) -> AppliedForce:
    """Return the force of ``mass`` kg of the flesh of one of the 12 segments that is not fixed to its bone."""
    segment = _carrier(target)
    return loose(segment, person.body.sip.com[TRUE_SEGMENTS.index(segment)], mass, _FLESH.get(target, MUSCLE))


def sloshing_load(person: Person, target: str, mass: float, sloshing: float) -> tuple[AddedLoad, AppliedForce]:
    """Carry ``mass`` kg behind one of the 12 segments, of which ``sloshing`` kg move: the load, what sloshing adds."""
    segment = _carrier(target)
    place = person.body.sip.com[TRUE_SEGMENTS.index(segment)] + np.array([-0.16, 0.0, 0.0])
    return AddedLoad(segment, mass, place, np.full(3, 0.05)), loose(segment, place, sloshing, LIQUID)


def _carrier(target: str) -> str:
    refuse_unknown("segment of the 12-segment model", target, MERGED)
    return CARRIERS.get(target, target)


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


_Change = Callable[[Hidden, Person, LabVisit], LabVisit]
"""Returns the visit with a cause in it or in the person."""
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
    refuse_unknown("effect that is made in a recording", cause.name, FAULTS)
    builder = FAULTS[cause.name]
    timed = {"clock": clock} if "clock" in builder.__annotations__ else {}
    return builder(cause.target, **cause.numbers(_parameters(builder)), **timed)


def _parameters(builder: Callable[..., object]) -> tuple[str, ...]:
    return tuple(name for name in builder.__annotations__ if name not in _GIVEN)


def _load(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
    """Put ``mass`` kg on one of the 12 segments, ``place`` (3) m in its joint frame (beside the CoM if not given)."""
    mass = cause.vector("mass", 1)[0]
    if set(cause.values) - {"mass", "place"} or mass <= 0:
        raise BiodanceError(f"Effect added_mass has mass (kg, > 0) and place (three numbers, m); got {cause.values}.")
    place = np.array(cause.vector("place", 3)) if "place" in cause.values else None
    return replace(visit, loads=(*visit.loads, load_on(person, cause.target, mass, place=place)))


def _wobble(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
    force = wobbling_mass(person, cause.target, **cause.numbers(("mass",)))
    return replace(visit, forces=(*visit.forces, force))


def _slosh(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
    load, force = sloshing_load(person, cause.target, **cause.numbers(("mass", "sloshing")))
    return replace(visit, forces=(*visit.forces, force), loads=(*visit.loads, load))


def _tilt(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
    """Turn the laboratory's axes by ``angle`` rad about lab x or y."""
    turn = np.array(visit.tilt)
    turn[axis_index(cause.target)] += cause.numbers(("angle",))["angle"]
    return replace(visit, tilt=tuple(turn))


def _shifted(field: Literal["joint_shifts", "marker_shifts"]) -> _Change:
    """Return the change that moves a joint centre or a marker by ``shift`` (3) m."""

    def change(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
        moved = {**getattr(visit, field), cause.target: np.array(cause.vector("shift", 3))}
        changes: dict[str, Any] = {field: moved}
        return replace(visit, **changes)

    return change


def _longer(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
    """Make a thigh or shank ``error`` m longer than its markers say: the joint at its end lies lower."""
    ends = {
        f"{side}_{upper}": f"{side}_{joint}"
        for side in SIDES
        for upper, joint in (("thigh", "knee"), ("shank", "ankle"))
    }
    refuse_unknown("segment whose length can be wrong", cause.target, ends)
    shift = np.array([0.0, -cause.numbers(("error",))["error"], 0.0])
    return replace(visit, joint_shifts={**visit.joint_shifts, ends[cause.target]: shift})


def _prosthesis(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
    """Make the limb from a segment on ``lighter`` kg: a prosthesis."""
    limbs = {**visit.lighter_limbs, cause.target: cause.numbers(("lighter",))["lighter"]}
    with_prostheses(person, limbs)  # refused here, before anything is simulated
    return replace(visit, lighter_limbs=limbs)


def _motion(tolerance: str) -> _Change:
    """Return the change that lets the person move a joint that the model lacks by ``angle`` rad rms per axis."""

    def change(cause: Hidden, person: Person, visit: LabVisit) -> LabVisit:
        angle = cause.numbers(("angle",))["angle"]
        return replace(visit, tolerances=replace(visit.tolerances, **{tolerance: angle}))

    return change


IN_THE_PERSON: dict[str, _Change] = {
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
_KIND = "effect that the virtual laboratory can make"


def parse_cause(text: str) -> Hidden:
    """Read ``NAME:target=...,param=value,...``; a value of three numbers is written ``0.05;0;0``.

    Raises
    ------
    UnknownName
        There is no such cause.
    BiodanceError
        The text does not have that form; the message shows the part and an example.
    """
    name, _, rest = text.partition(":")
    refuse_unknown(_KIND, name, CAUSES)
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
) -> LabVisit:
    """Return the visit with the causes.

    Raises
    ------
    UnknownName
        A cause, target or channel does not exist.
    BiodanceError
        A parameter is missing or has a wrong name, or a mass is not positive.
    """
    person = make_person(subject, seed, tolerances=visit.tolerances, session=visit.number)
    ends = np.cumsum([trial.duration for trial in protocol.trials])
    # Share of the session's time.
    clock = {
        trial.name: (float((end - trial.duration) / ends[-1]), float(end / ends[-1]))
        for trial, end in zip(protocol.trials, ends, strict=True)
    }
    for cause in hidden:
        refuse_unknown(_KIND, cause.name, CAUSES)
        if cause.name in IN_THE_PERSON:
            visit = IN_THE_PERSON[cause.name](cause, person, visit)
        elif cause.name in FORCES:
            act = FORCES[cause.name]
            force = partial(act, target=cause.target, **cause.numbers(_parameters(act)))
            visit = replace(visit, forces=(*visit.forces, force))
        else:
            visit = replace(visit, faults=(*visit.faults, fault_of(cause, clock)))
    return visit
