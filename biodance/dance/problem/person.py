"""What one person can and may do (a TOML file in the words of therapists), and the body and the plan that are left:
reduced range, strength and speed, one side, no standing on one leg, only seated, a frame.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import JointLimits
from biodance.dance.limits import Limit
from biodance.dance.limits._person import LEAST_LIFT, ArmLift, FootLoad
from biodance.dance.problem.plan import LEAST_REST, Plan, finite_number, sentences, table, true_or_false
from biodance.dance.problem.stance import SEAT_TO_HIP, seat
from biodance.errors import BiodanceError, UnknownName, refuse_unknown
from biodance.library import read_toml
from biodance.records import SIDES

Shares = tuple[tuple[str, float], ...]
HALF = 0.55
"""Share of the weight that a leg must bear at least of who stands on both: half, and some for leaning."""
_SITTING = {"hip_flexion": math.radians(93.0), "knee_flexion": math.radians(82.0)}
"""rad to which whoever sits on a stool bends (the word for it in the vocabulary, and 2 degrees)."""
_ASKED = 58.0 + 7.0
"""degrees to which an arm must be liftable to be asked for anything: the 58 of the word for an arm at rest, less of
which comes too near the trunk when it errs, and the 7 by which a copy errs: it would stay at its limit throughout.
"""
_RESTING = {
    "shoulder_flexion": (0.0, "An arm must be able to hang"),
    "shoulder_adduction": (0.0, "An arm must be able to hang"),
    "hip_rotation": (math.radians(5.0), "Whoever stands or sits upright turns the hips a little"),
}
"""rad to both sides of straight that nobody can do without, and why."""
_LEAST_RANGE = math.radians(6.0)  # rad: nobody holds a joint within less
_LIMBS = {"arm": ("shoulder", "elbow"), "leg": ("hip", "knee", "ankle")}
"""What an arm and a leg are made of."""


@dataclass(frozen=True)
class PersonLimits:
    """Limits of one person beyond those of sex, age, mass and stature.

    ``ranges`` (key, lower, upper) rad, infinite where nothing is said; ``range_shares``, ``strengths`` (key, share
    0..1); ``max_speed`` rad/s; ``stand_alone_on`` the legs on which the person may stand alone; ``seated`` True where
    standing is not possible; ``holds`` the hands that stay on a frame; ``reason`` in words; ``bearing`` (side, share of
    the weight that this leg may bear); ``hands_low`` True where no hand may come over shoulder height; ``seat_height``
    m, 0 any; ``care`` sentences for cards and page; ``rest`` s of dancing after which the person rests. Keys: see
    `read_person`.
    """

    ranges: tuple[tuple[str, float, float], ...] = ()
    range_shares: Shares = ()
    strengths: Shares = ()
    max_speed: float = math.inf
    stand_alone_on: tuple[str, ...] = SIDES
    seated: bool = False
    reason: str = ""
    holds: tuple[str, ...] = ()
    bearing: Shares = ()
    hands_low: bool = False
    seat_height: float = 0.0
    care: tuple[str, ...] = ()
    rest: float = math.inf

    @property
    def alone(self) -> tuple[str, ...]:
        """The legs on which the person may stand alone and that may bear all of the weight."""
        return tuple(side for side in self.stand_alone_on if dict(self.bearing).get(side, 1.0) >= 1.0)


HEALTHY = PersonLimits()
"""No limits beyond those of sex, age, mass and stature."""


def fit_to_person(body: Body, plan: Plan, person: PersonLimits) -> tuple[Body, Plan, tuple[str, ...]]:
    """Return the body with the person's limits, the plan with those that are no joint's and without what the person may
    not do, and what was left out or corrected, in plain sentences.

    Raises
    ------
    UnknownName
        A key names no joint of this body.
    BiodanceError
        A range lies outside the joint's own, or nothing of the protocol is left; the message names the constraint that
        forbids it.
    """
    _check_standing(plan, person)
    kept = tuple(block for block in plan.blocks if _allowed(block[0], person))
    notes = [
        f"The {count} postures in {stance.replace('_', ' ')} support are left out: the person may not stand alone on "
        f"that leg."
        for stance, count in plan.blocks
        if not _allowed(stance, person)
    ]
    limits, corrected = _possible(body, limit_body(body, person), plan, person)
    notes += corrected
    holds = () if plan.seated else person.holds
    notes += ["On the stool no hand holds a frame: frames are for who stands."] if holds != person.holds else []
    plan = replace(plan, blocks=kept, alone=person.alone, holds=holds, careful=person != HEALTHY)
    cards = math.inf if person == HEALTHY else plan.cards
    care = tuple(dict.fromkeys((*plan.care, *person.care)))  # what both say once
    plan = replace(plan, care=care, rest=min(plan.rest, person.rest), cards=cards)
    if plan.seated and person.seat_height:
        least = seat(body).seat - SEAT_TO_HIP
        if person.seat_height < least:
            notes.append(
                f"The seat must be {least:.2f} m high, or the feet would touch the ground; {person.seat_height:g} m is "
                f"not kept."
            )
        plan = replace(plan, seat_height=max(least, person.seat_height))
    own = replace(body, limits=limits)
    plan = plan.with_limits(_own_limits(body, own, person))
    # arms that are lifted too little to be kept away from the trunk by people who copy imprecisely hang
    lifts = [limit for limit in plan.limits if isinstance(limit, ArmLift)]
    reach = {side: min([one.reach(side) for one in lifts], default=180.0) for side in SIDES}
    hanging = tuple(side for side in SIDES if reach[side] < _ASKED and side not in plan.holds)
    notes += [
        f"The {side} arm hangs and is asked for nothing: it is lifted by less than {_ASKED:g} degrees."
        for side in hanging
    ]
    return own, replace(plan, hanging=hanging), tuple(notes)


def _check_standing(plan: Plan, person: PersonLimits) -> None:
    """Raise BiodanceError where the person cannot be on any of the feet of a plan."""
    weak = [(side, share) for side, share in person.bearing if share < HALF]
    if weak and not plan.seated:
        raise BiodanceError(
            f"Protocol {plan.name}: is danced standing, and the {weak[0][0]} leg may bear {weak[0][1]:g} of the weight "
            f"(weight_bearing); on both feet it bears about half, {HALF:g} when leaning. Use --protocol chair."
        )
    if person.seated and not plan.seated:
        raise BiodanceError(
            f"Protocol {plan.name}: is danced standing and this person must sit (seated = true, or cannot = "
            f'["stand"]). Use --protocol chair.'
        )
    if not any(_allowed(stance, person) for stance, _ in plan.blocks):
        raise BiodanceError(
            f"Protocol {plan.name}: stands on one leg only, and this person may stand alone on "
            f"{' and '.join(person.alone) or 'neither leg'} (stand_alone_on). Use another protocol."
        )


def _allowed(stance: str, person: PersonLimits) -> bool:
    return not stance.startswith("single_") or stance.removeprefix("single_") in person.alone


def _own_limits(body: Body, own: Body, person: PersonLimits) -> list[Limit]:
    """Return this person's limits that are no joint's: how far arms are lifted, and what a foot bears."""
    lifts = dict[str, float]()
    for side in SIDES:
        names = [joint.name for joint in body.joints]
        if f"{side}_shoulder_flexion" not in names or f"{side}_shoulder_adduction" not in names:
            continue
        f, a = names.index(f"{side}_shoulder_flexion"), names.index(f"{side}_shoulder_adduction")
        forward, sideways = np.degrees([own.limits.upper[f], -own.limits.lower[a]])
        less = own.limits.upper[f] < body.limits.upper[f], own.limits.lower[a] > body.limits.lower[a]
        if any(less):
            # A direction without a limit of its own goes as far as the other one.
            forward, sideways = (forward if less[0] else sideways), (sideways if less[1] else forward)
            lifts |= {f"{side}_forward": max(LEAST_LIFT, forward), f"{side}_sideways": max(LEAST_LIFT, sideways)}
    out = list[Limit]()
    if lifts or person.hands_low:
        out.append(ArmLift(**lifts, **({"hand": 90.0} if person.hands_low else {})))
    if person.bearing:
        out.append(FootLoad(**dict(person.bearing)))
    return out


def _possible(body: Body, limits: JointLimits, plan: Plan, person: PersonLimits) -> tuple[JointLimits, tuple[str, ...]]:
    """Return the limits with what nobody can do without, and sentences on what was therefore not applied."""
    lower, upper, own, notes = limits.lower.copy(), limits.upper.copy(), body.limits, list[str]()
    for j, joint in enumerate(body.joints):
        before, bare, why = (lower[j], upper[j]), joint.name.partition("_")[2], ""
        sitting = min(_SITTING.get(bare, -math.inf), own.upper[j]) if plan.seated else -math.inf
        if bare in _RESTING and not (lower[j] <= -_RESTING[bare][0] and _RESTING[bare][0] <= upper[j]):
            around, why = _RESTING[bare]
            lower[j], upper[j] = min(lower[j], 0.0 - around), max(upper[j], around)
        if upper[j] < sitting - math.radians(3.0):  # the seat is soft enough
            upper[j], why = sitting, "Whoever sits bends hips and knees"
        if upper[j] - lower[j] < min(_LEAST_RANGE, own.upper[j] - own.lower[j]):
            middle = np.clip(
                (lower[j] + upper[j]) / 2, own.lower[j] + _LEAST_RANGE / 2, own.upper[j] - _LEAST_RANGE / 2
            )
            lower[j], upper[j] = min(lower[j], middle - _LEAST_RANGE / 2), max(upper[j], middle + _LEAST_RANGE / 2)
            why = why or "Nobody holds a joint within less than 6 degrees"
        if why:
            given, found = (
                f"{math.degrees(a):.0f} to {math.degrees(b):.0f}" for a, b in (before, (lower[j], upper[j]))
            )
            notes.append(f"{why}: {joint.name.replace('_', ' ')} reaches {found} degrees here instead of {given}.")
    return replace(limits, lower=lower, upper=upper), tuple(notes)


def limit_body(body: Body, person: PersonLimits) -> JointLimits:
    """Return the limits of the body's joints with those of the person on top; raises as `fit_to_person` does."""
    limits = body.limits
    lower, upper, strength = limits.lower.copy(), limits.upper.copy(), np.ones(len(body.joints))
    for key, share in person.range_shares:
        for j in joints(body, key):
            # Towards the resting angle, which stays legal.
            rest = min(max(0.0, lower[j]), upper[j])
            lower[j], upper[j] = rest + share * (lower[j] - rest), rest + share * (upper[j] - rest)
    for key, low, high in person.ranges:
        for j in joints(body, key):
            if math.isfinite(low) and math.isfinite(high):
                _check_range(body, j, low, high)
            # Cut to the joint's own range, so that the two never cross.
            lower[j] = min(max(lower[j], low), limits.upper[j])
            upper[j] = max(min(upper[j], high), limits.lower[j])
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
    """Return the indices of the joints that ``key`` names (`names_joint`); UnknownName where it names none."""
    names = [joint.name for joint in body.joints]
    found = [j for j, name in enumerate(names) if names_joint(key, name)]
    if not found:
        raise UnknownName.of("joint, side or group of joints", key, ("all", *SIDES, "arm", "leg", *names))
    return found


def names_joint(key: str, joint: str) -> bool:
    """Return whether ``key`` names a joint, from coarse to fine: "all"; "left"; "arm" or "knee" (both sides);
    "left_arm" or "left_knee"; "left_knee_flexion".
    """
    side, _, bare = joint.partition("_") if joint.partition("_")[0] in SIDES else ("", "", joint)
    of, rest = next(((one, key[len(one) + 1 :]) for one in SIDES if f"{key}_".startswith(f"{one}_")), ("", key))
    if of and of != side:
        return False
    starts = _LIMBS.get(rest, (rest,))
    return key == "all" or not rest or any(f"{bare}_".startswith(f"{start}_") for start in starts)


def _check_range(body: Body, joint: int, low: float, high: float) -> None:
    own = body.limits.lower[joint], body.limits.upper[joint]
    if not low <= high or low > own[1] or high < own[0]:
        given, usual = (f"{math.degrees(a):.0f} to {math.degrees(b):.0f} degrees" for a, b in ((low, high), own))
        raise BiodanceError(
            f"Limits: {body.joints[joint].name} from {given} has nothing in common with a healthy joint's {usual}. "
            f"Correct range_deg."
        )


_TABLES = ("at_most_deg", "weight_bearing", "strength", "range_share", "range_deg")
_WORDS = ("reason", "care", "cannot", "hold_frame", "stand_alone_on", "seated")
_KEYS = (*_WORDS, "max_speed_deg_s", "seat_height_m", "rest_after_s", *_TABLES)
_OVERHEAD = "lift arms over shoulder height"
_CANNOT = ("stand", *(f"stand on {side} leg" for side in SIDES), "turn", _OVERHEAD)
GRADES = {"grade 5": 1.0, "grade 4": 0.6, "grade 3": 0.25}
"""Share of the usual strength by the grade of a manual muscle test (3 holds against nothing but gravity)."""
_RIGHT_ANGLE = math.pi / 2
_Ranges = list[tuple[str, float, float]]

PLAIN_MOVEMENTS = {
    "arm_lift": ("Lift the arm, in every direction", "shoulder elevation", "shoulder_flexion -shoulder_adduction"),
    "arm_forward": ("Lift the arm forward", "shoulder flexion", "shoulder_flexion"),
    "arm_sideways": ("Lift the arm sideways", "shoulder abduction", "-shoulder_adduction"),
    "arm_backward": ("Move the arm backward", "shoulder extension", "-shoulder_flexion"),
    "arm_turn_in": ("Turn the upper arm in", "shoulder internal rotation", "shoulder_rotation"),
    "arm_turn_out": ("Turn the upper arm out", "shoulder external rotation", "-shoulder_rotation"),
    "elbow_bend": ("Bend the elbow", "elbow flexion", "elbow_flexion"),
    "hip_bend": ("Bend the hip", "hip flexion", "hip_flexion"),
    "leg_backward": ("Move the leg backward", "hip extension", "-hip_flexion"),
    "leg_sideways": ("Move the leg sideways", "hip abduction", "-hip_adduction"),
    "leg_across": ("Move the leg across the middle", "hip adduction", "hip_adduction"),
    "leg_turn_in": ("Turn the leg in", "hip internal rotation", "hip_rotation"),
    "leg_turn_out": ("Turn the leg out", "hip external rotation", "-hip_rotation"),
    "knee_bend": ("Bend the knee", "knee flexion", "knee_flexion"),
    "foot_up": ("Pull the foot up", "ankle dorsiflexion", "ankle_dorsiflexion"),
    "foot_down": ("Push the foot down", "ankle plantarflexion", "-ankle_dorsiflexion"),
    "foot_turn_in": ("Turn the sole in", "ankle inversion", "ankle_inversion"),
    "foot_turn_out": ("Turn the sole out", "ankle eversion", "-ankle_inversion"),
    "trunk_bow": ("Bow the trunk", "trunk flexion", "trunk_flexion"),
    "trunk_extension": ("", "trunk extension", "-trunk_flexion"),
    "trunk_lean": ("Lean the trunk to a side", "trunk bending", "trunk_bending -trunk_bending"),
    "trunk_turn": ("Turn the trunk", "trunk rotation", "trunk_rotation -trunk_rotation"),
}
"""Movement in plain English: what a form asks ("" nothing), what the ISB calls it, and its joints without side, with a
minus where they turn against their name.
"""


def _all_names() -> dict[str, tuple[tuple[str, int], ...]]:
    """Return the joints and senses of movements in plain English, and by the ISB where that is no joint's name."""
    turned = {
        key: tuple((joint.lstrip("-"), -1 if joint[0] == "-" else 1) for joint in joints.split())
        for key, (_, _, joints) in PLAIN_MOVEMENTS.items()
    }
    joints = {joint for moves in turned.values() for joint, _ in moves}
    isb = {key: said.replace(" ", "_") for key, (_, said, _) in PLAIN_MOVEMENTS.items()}
    return {name: turned[key] for key in turned for name in (key, isb[key]) if name not in joints}


_MOVES = _all_names()
_JOINTS = tuple(dict.fromkeys(joint for moves in _MOVES.values() for joint, _ in moves))


def read_person(path: str | Path) -> PersonLimits:
    """Return the limits in a person's TOML file (``--limits FILE``); every key may be left out.

        reason = "stroke in March, left side"     for the record
        cannot = ["stand on left leg", "turn"]    or "stand", "stand on right leg", "lift arms over shoulder height"
        hold_frame = ["right"]                    hands that stay on the grips of a walking frame, of rails or bars
        max_speed_deg_s = 120                     no joint turns faster
        seat_height_m = 0.60                      of the stool; the feet hang
        rest_after_s = 30                         s of dancing after which the person rests: heart, breath, pain
        care = ["Stop when the shoulder hurts."]  sentences for cards and page
        stand_alone_on = ["right"]                legs on which the person may stand alone; [] = never; without it: both
        seated = false                            true: only protocols on a stool (cannot = ["stand"])

        [at_most_deg]                             how far a movement goes
        "left arm lift" = 70                      in every direction; or forward and sideways apart
        "left arm forward" = 70
        "left arm sideways" = 60
        left_hip_internal_rotation = 0            names of the ISB do as well
        [weight_bearing]                          share of the weight that a leg may bear
        left = 0.6
        [strength]                                share of the usual strength, or a grade: "grade 4" of 5
        left_arm = 0.5
        [range_share]                             share of the usual range, towards the upright posture
        left = 0.7
        [range_deg]                               what a joint reaches, from and to, also by the movement's name
        left_knee_flexion = [20, 90]

    A key of the last three names joints from the coarse to the fine: "all"; "left"; "arm", "leg" or "knee" (both
    sides); "left_arm"; "left_knee"; "left_knee_flexion". Several that name the same joint act one after the other. A
    movement is in plain English ("arm forward") or by its ISB joint ("shoulder flexion"), of one side or of both;
    spaces, dots and underscores are the same. Angles are positive in the direction of the name. What an arm is lifted
    at most holds whatever the joint angles by which (`ArmLift`); where only one direction is named it holds for both.

    Raises
    ------
    UnknownName
        A key, a leg or a movement does not exist. (Joints are looked up later, in the body.)
    BiodanceError
        The file cannot be read, or a value is not legal; the message names file, key, value and what would be legal.
    """
    return limits_in(read_toml(Path(path)), Path(path))


def limits_in(raw: dict[str, Any], path: Path) -> PersonLimits:
    """Return the limits that the content of such a file says, and raise as `read_person` does; ``path`` by which
    messages call it.
    """
    for key in raw:
        refuse_unknown(f"key of {path}", key, _KEYS)
    cannot = _listed(path, raw, "cannot", "movement", _CANNOT)
    barred = [side for side in SIDES if f"stand on {side} leg" in cannot]
    legs = [leg for leg in _listed(path, raw, "stand_alone_on", "leg", SIDES, usual=SIDES) if leg not in barred]
    seated = true_or_false(path, "seated", raw.get("seated", False))
    ranges = [*_at_most(path, raw), *_ranges(path, raw)]
    if "turn" in cannot:
        ranges.append(("trunk_rotation", 0.0, 0.0))
    if _OVERHEAD in cannot:
        ranges += [("shoulder_flexion", -math.inf, _RIGHT_ANGLE), ("shoulder_adduction", -_RIGHT_ANGLE, math.inf)]
    shares, strengths, bearing = (_shares(path, raw, name) for name in ("range_share", "strength", "weight_bearing"))
    for side, _ in bearing:
        refuse_unknown(f"leg in weight_bearing of {path}", side, SIDES)
    return PersonLimits(
        tuple(ranges),
        shares,
        strengths,
        math.radians(_positive(path, raw, "max_speed_deg_s", math.inf)),
        tuple(legs),
        seated or "stand" in cannot,
        str(raw.get("reason", "")),
        tuple(_listed(path, raw, "hold_frame", "hand", SIDES)),
        bearing,
        _OVERHEAD in cannot,
        _positive(path, raw, "seat_height_m", 0.0, legal=(0.3, 1.2)),  # m
        sentences(path, raw),
        _positive(path, raw, "rest_after_s", math.inf, legal=(LEAST_REST, math.inf)),
    )


def _listed(
    path: Path, raw: dict[str, Any], key: str, what: str, legal: tuple[str, ...], *, usual: tuple[str, ...] = ()
) -> list[str]:
    """Return the words of a list in the file, each naming ``what``."""
    found = raw.get(key, [*usual])
    if not isinstance(found, list):
        raise BiodanceError(f"{path}: {key} = {found!r}; expected a list of {', '.join(legal)}, as {[legal[0]]}.")
    for one in found:
        refuse_unknown(f"{what} in {key} of {path}", str(one), legal)
    return found


def _positive(
    path: Path, raw: dict[str, Any], key: str, usual: float, *, legal: tuple[float, float] = (0.0, math.inf)
) -> float:
    if key not in raw:
        return usual
    value = finite_number(path, key, raw[key])
    if not (value > 0 and legal[0] <= value <= legal[1]):
        between = f" and lie between {legal[0]:g} and {legal[1]:g}" if legal[0] else ""
        raise BiodanceError(f"{path}: {key} = {raw[key]!r}; it must be positive{between}.")
    return value


def _at_most(path: Path, raw: dict[str, Any]) -> _Ranges:
    """Return the ranges (joint, lower, upper) rad of movements that go so far at most."""
    out: _Ranges = []
    for key, value in _flat(table(path, raw, "at_most_deg")).items():
        angle = finite_number(path, f"at_most_deg.{key}", value)
        if not 0 <= angle <= 180:
            raise BiodanceError(f"{path}: at_most_deg.{key} = {angle:g}; expected 0 to 180 degrees in its direction.")
        moved = named_movement(key)
        if moved is None:
            raise UnknownName.of(f"movement in at_most_deg of {path}", key, (*_MOVES, *_JOINTS))
        for joint, sense in moved:
            # A sense of -1 turns the limit round: -angle below, infinite above.
            low, high = sorted((math.radians(angle) * sense, -math.inf * sense))
            out.append((joint, low, high))
    return out


def _flat(values: dict[str, Any], before: str = "") -> dict[str, Any]:
    """Return a table of tables as one: ``left_arm.forward``."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        out |= _flat(value, f"{before}{key} ") if isinstance(value, dict) else {before + key: value}
    return out


def _ranges(path: Path, raw: dict[str, Any]) -> _Ranges:
    """Return the ranges (key, lower, upper) rad of joints or of movements with one joint and direction."""
    out: _Ranges = []
    for key, value in table(path, raw, "range_deg").items():
        if not isinstance(value, list) or len(value) != 2:
            raise BiodanceError(f"{path}: range_deg.{key} = {value!r}; expected [lower, upper] in degrees.")
        low, high = (math.radians(finite_number(path, f"range_deg.{key}", one)) for one in value)
        moved = named_movement(key)
        if moved is not None and len(moved) > 1:
            raise BiodanceError(
                f"{path}: range_deg.{key} = {value!r}; this movement has no lower end. Write {key} = {value[1]!r} "
                f"under [at_most_deg]."
            )
        joint, sense = (plain(key), 1) if moved is None else moved[0]
        out.append((joint, low, high) if sense > 0 else (joint, -high, -low))
    return out


def _shares(path: Path, raw: dict[str, Any], name: str) -> Shares:
    given, grades = dict(table(path, raw, name)), GRADES if name == "strength" else {}
    for key, value in given.items():
        if grades and isinstance(value, str) and value not in grades:
            raise BiodanceError(
                f"{path}: strength.{key} = {value!r}; expected a share from 0 to 1, or {', '.join(GRADES)}. A limb of "
                f"less does not hold itself up: say 0 of its movements under at_most_deg."
            )
        given[key] = grades[value] if grades and isinstance(value, str) else value
    found = tuple((plain(key), finite_number(path, f"{name}.{key}", value)) for key, value in given.items())
    for key, value in found:
        if not 0 <= value <= 1:
            raise BiodanceError(f"{path}: {name}.{key} = {value:g}; a share lies between 0 and 1.")
    return found


def named_movement(key: str) -> tuple[tuple[str, int], ...] | None:
    """Return the joints and senses of a movement, None if there is none of this name."""
    name = plain(key).replace("lift_", "")
    side = next((f"{one}_" for one in SIDES if name.startswith(f"{one}_")), "")
    bare = name.removeprefix(side)
    moves = ((bare, 1),) if bare in _JOINTS else _MOVES.get(bare)
    return None if moves is None else tuple((f"{side}{joint}", sense) for joint, sense in moves)


def plain(key: str) -> str:
    """Return a key with underscores only: ``left arm.forward`` -> ``left_arm_forward``."""
    return "_".join(key.replace(".", " ").split())
