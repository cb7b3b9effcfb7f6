"""What one person can and may do: reduced range, strength and speed, one side, no standing on one leg, only seated.

    reason = "stroke in March, left side"      for the record
    max_speed_deg_s = 120                      no joint turns faster
    stand_alone_on = ["right"]                 legs on which the person may stand alone; [] = never; without it: both
    seated = false                             true: only protocols on a stool
    hold_frame = ["right"]                     hands that stay on the grips of a walking frame; without it: none

    [range_deg]                                what a joint reaches, degrees
    left_shoulder_flexion = [0, 70]
    [range_share]                              or the share of the usual range, towards the upright posture
    left = 0.7
    [strength]                                 share of the usual strength
    left_knee = 0.5
    all = 0.8

A key names joints from the coarse to the fine: "all"; "left"; "knee" (both sides); "left_knee"; "left_knee_flexion".
Several that name the same joint act one after the other. Angles are positive in the anatomical direction of the name.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import JointLimits
from biodance.dance.problem.plan import Plan, finite_number, table
from biodance.errors import BiodanceError, UnknownName
from biodance.library import read_toml
from biodance.records import SIDES

_KEYS = ("reason", "max_speed_deg_s", "stand_alone_on", "seated", "hold_frame", "range_deg", "range_share", "strength")
Shares = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class PersonLimits:
    """Limits of one person beyond those of sex, age, mass and stature.

    ``ranges`` (key, lower, upper) rad; ``range_shares``, ``strengths`` (key, share 0..1); ``max_speed`` rad/s;
    ``stand_alone_on`` the legs on which the person may stand alone; ``seated`` True where standing is not possible;
    ``holds`` the hands that stay on a frame; ``reason`` in words. Keys: see the module.
    """

    ranges: tuple[tuple[str, float, float], ...] = ()
    range_shares: Shares = ()
    strengths: Shares = ()
    max_speed: float = math.inf
    stand_alone_on: tuple[str, ...] = SIDES
    seated: bool = False
    reason: str = ""
    holds: tuple[str, ...] = ()


HEALTHY = PersonLimits()
"""No limits beyond those of sex, age, mass and stature."""


def read_person(path: str | Path) -> PersonLimits:
    """Return the limits in a person's TOML file.

    Raises
    ------
    UnknownName
        A key or a leg does not exist. (Joints are looked up later, in the body.)
    BiodanceError
        The file cannot be read, or a value is not legal; the message names file, key, value and what would be legal.
    """
    path = Path(path)
    raw = read_toml(path)
    for key in raw:
        if key not in _KEYS:
            raise UnknownName.of(f"key of {path}", key, _KEYS)
    ranges = []
    for key, value in table(path, raw, "range_deg").items():
        if not isinstance(value, list) or len(value) != 2:
            raise BiodanceError(f"{path}: range_deg.{key} = {value!r}; expected [lower, upper] in degrees.")
        low, high = (math.radians(finite_number(path, f"range_deg.{key}", one)) for one in value)
        ranges.append((key, low, high))
    legs, seated = raw.get("stand_alone_on", list(SIDES)), raw.get("seated", False)
    if not isinstance(legs, list) or not isinstance(seated, bool):
        raise BiodanceError(
            f"{path}: stand_alone_on must be a list of legs and seated true or false, found {legs!r} and {seated!r}."
        )
    for leg in legs:
        if leg not in SIDES:
            raise UnknownName.of(f"leg in stand_alone_on of {path}", str(leg), SIDES)
    hands = raw.get("hold_frame", [])
    if not isinstance(hands, list) or any(hand not in SIDES for hand in hands):
        raise BiodanceError(f'{path}: hold_frame = {hands!r}; expected a list of hands, "right" and "left".')
    speed = (
        math.radians(finite_number(path, "max_speed_deg_s", raw["max_speed_deg_s"]))
        if "max_speed_deg_s" in raw
        else math.inf
    )
    if not speed > 0:
        raise BiodanceError(f"{path}: max_speed_deg_s = {raw['max_speed_deg_s']!r}; it must be positive.")
    shares, strengths = (_shares(path, table(path, raw, name), name) for name in ("range_share", "strength"))
    return PersonLimits(
        tuple(ranges), shares, strengths, speed, tuple(legs), seated, str(raw.get("reason", "")), tuple(hands)
    )


def _shares(path: Path, raw: dict[str, object], name: str) -> Shares:
    found = tuple((key, finite_number(path, f"{name}.{key}", value)) for key, value in raw.items())
    for key, value in found:
        if not 0 <= value <= 1:
            raise BiodanceError(f"{path}: {name}.{key} = {value:g}; a share lies between 0 and 1.")
    return found


def fit_to_person(body: Body, plan: Plan, person: PersonLimits) -> tuple[Body, Plan, tuple[str, ...]]:
    """Return the body with the person's limits, the plan without what the person may not do, and what was left out, in
    plain sentences.

    Raises
    ------
    UnknownName
        A key names no joint of this body.
    BiodanceError
        A range lies outside the joint's own, or nothing of the protocol is left; the message names the constraint that
        forbids it.
    """
    if person.seated and not plan.seated:
        raise BiodanceError(
            f"Protocol {plan.name}: is danced standing and this person must sit (seated = true). Use --protocol chair."
        )
    kept = tuple(block for block in plan.blocks if _allowed(block[0], person))
    if not kept:
        raise BiodanceError(
            f"Protocol {plan.name}: stands on one leg only, and this person may stand alone on "
            f"{' and '.join(person.stand_alone_on) or 'neither leg'} (stand_alone_on). Use another protocol."
        )
    notes = tuple(
        f"The {count} postures in {stance.replace('_', ' ')} support are left out: the person may not stand alone on "
        f"that leg."
        for stance, count in plan.blocks
        if not _allowed(stance, person)
    )
    limits = limit_body(body, person)
    if plan.seated:
        limits, widened = _as_seated(body, limits, person)
        notes += widened
    plan = replace(plan, blocks=kept, alone=person.stand_alone_on, holds=person.holds)
    return replace(body, limits=limits), plan, notes


_SITTING = {"hip_flexion": math.radians(93.0), "knee_flexion": math.radians(82.0)}
"""rad to which whoever sits on a stool bends (the word for it in the vocabulary, and 2 degrees)."""


def _as_seated(body: Body, limits: JointLimits, person: PersonLimits) -> tuple[JointLimits, tuple[str, ...]]:
    """Return the limits with what sitting takes, and what of ``person`` was therefore not applied, in sentences: a
    share of every range says nothing of how far the hips of somebody bend who sits; a range does.
    """
    told = {j for key, _, _ in person.ranges for j in joints(body, key)}
    upper, notes = limits.upper.copy(), list[str]()
    for j, joint in enumerate(body.joints):
        angle = min(_SITTING.get(joint.name.partition("_")[2], -math.inf), body.limits.upper[j])
        if upper[j] < angle and j not in told:
            upper[j] = angle
            name = joint.name.replace("_", " ")
            notes.append(
                f"Whoever sits bends the {name} to {math.degrees(angle):.0f} degrees, so range_share is not kept there."
            )
    return replace(limits, upper=upper), tuple(notes)


def limit_body(body: Body, person: PersonLimits) -> JointLimits:
    """Return the limits of the body's joints with those of the person on top; raises as `fitted` does."""
    limits = body.limits
    lower, upper, strength = limits.lower.copy(), limits.upper.copy(), np.ones(len(body.joints))
    for key, share in person.range_shares:
        for j in joints(body, key):
            rest = min(max(0.0, lower[j]), upper[j])
            lower[j], upper[j] = rest + share * (lower[j] - rest), rest + share * (upper[j] - rest)
    for key, low, high in person.ranges:
        for j in joints(body, key):
            _check_range(body, j, low, high)
            lower[j], upper[j] = max(lower[j], low), min(upper[j], high)
    for key, share in person.strengths:
        strength[joints(body, key)] *= share
    return JointLimits(
        lower,
        upper,
        np.minimum(limits.velocity, person.max_speed),
        strength * limits.torque_lower,
        strength * limits.torque_upper,
    )


def joints(body: Body, key: str) -> list[int]:
    """Return the indices of the joints that ``key`` names; UnknownName where it names none."""
    names = [joint.name for joint in body.joints]
    tests: tuple[Callable[[str], bool], ...] = (
        lambda name: key == "all",
        lambda name: f"{name}_".startswith(f"{key}_"),
        lambda name: f"{name.removeprefix('right_').removeprefix('left_')}_".startswith(f"{key}_"),
    )
    found = [j for j, name in enumerate(names) if any(test(name) for test in tests)]
    if not found:
        raise UnknownName.of("joint, side or group of joints", key, ("all", *SIDES, *names))
    return found


def _check_range(body: Body, joint: int, low: float, high: float) -> None:
    own = body.limits.lower[joint], body.limits.upper[joint]
    if not low <= high or low > own[1] or high < own[0]:
        given, usual = (f"{math.degrees(a):.0f} to {math.degrees(b):.0f} degrees" for a, b in ((low, high), own))
        raise BiodanceError(
            f"Limits: {body.joints[joint].name} from {given} has nothing in common with a healthy joint's {usual}. "
            f"Correct range_deg."
        )


def _allowed(stance: str, person: PersonLimits) -> bool:
    return not stance.startswith("single_") or stance.removeprefix("single_") in person.stand_alone_on
