"""What one person can and may do, and the body and the plan that are left: reduced range, strength and speed, one side,
no standing on one leg, only seated, a frame. The file that says it: `person_file`.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import JointLimits
from biodance.dance.limits import Limit
from biodance.dance.limits._person import LEAST_LIFT, ArmLift, FootLoad
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import SEAT_TO_HIP, seat
from biodance.errors import BiodanceError, UnknownName
from biodance.records import SIDES

Shares = tuple[tuple[str, float], ...]
HALF = 0.55
"""Share of the weight that a leg must bear at least of who stands on both: half, and some for leaning."""
_SITTING = {"hip_flexion": math.radians(93.0), "knee_flexion": math.radians(82.0)}
"""rad to which whoever sits on a stool bends (the word for it in the vocabulary, and 2 degrees)."""
_ASKED = 58.0
"""degrees that the word for an arm at rest takes: one that is lifted less comes too near the trunk when it errs."""
_RESTING = {
    "shoulder_flexion": (0.0, "An arm must be able to hang"),
    "shoulder_adduction": (0.0, "An arm must be able to hang"),
    "hip_rotation": (math.radians(5.0), "Whoever stands or sits upright turns the hips a little"),
}
"""rad to both sides of straight that nobody can do without, and why."""
_FITS = math.radians(3.0)
"""rad less at which the seat is soft enough."""
_LEAST_RANGE = math.radians(6.0)
"""rad: nobody holds a joint within less."""
_LIMBS = {"arm": ("shoulder", "elbow"), "leg": ("hip", "knee", "ankle")}
"""What an arm and a leg are made of."""


@dataclass(frozen=True)
class PersonLimits:
    """Limits of one person beyond those of sex, age, mass and stature.

    ``ranges`` (key, lower, upper) rad, infinite where nothing is said; ``range_shares``, ``strengths`` (key, share
    0..1); ``max_speed`` rad/s; ``stand_alone_on`` the legs on which the person may stand alone; ``seated`` True where
    standing is not possible; ``holds`` the hands that stay on a frame; ``reason`` in words; ``bearing`` (side, share of
    the weight that this leg may bear); ``hands_low`` True where no hand may come over shoulder height; ``seat_height``
    m, 0 any. Keys: see `person_file`.
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
    plan = replace(plan, blocks=kept, alone=person.alone, holds=person.holds, careful=person != HEALTHY)
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
    hanging = _hanging(plan)
    notes += [
        f"The {side} arm hangs and is asked for nothing: it is lifted by less than {_ASKED:g} degrees."
        for side in hanging
    ]
    return own, replace(plan, hanging=hanging), tuple(notes)


def _hanging(plan: Plan) -> tuple[str, ...]:
    """Return the arms that are lifted too little to be kept away from the trunk by people who copy imprecisely."""
    lifts = [limit for limit in plan.limits if isinstance(limit, ArmLift)]
    reach = {side: min([one.reach(side) for one in lifts], default=180.0) for side in SIDES}
    return tuple(side for side in SIDES if reach[side] < _ASKED and side not in plan.holds)


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
    """Return the limits of this person that are no joint's: how far arms are lifted (where ``own`` body reaches less
    than any ``body``, whatever the joint angle by which), and what a foot bears.
    """
    lifts = dict[str, float]()
    for side in SIDES:
        names = [joint.name for joint in body.joints]
        if f"{side}_shoulder_flexion" not in names or f"{side}_shoulder_adduction" not in names:
            continue
        f, a = names.index(f"{side}_shoulder_flexion"), names.index(f"{side}_shoulder_adduction")
        forward, sideways = np.degrees([own.limits.upper[f], -own.limits.lower[a]])
        less = own.limits.upper[f] < body.limits.upper[f], own.limits.lower[a] > body.limits.lower[a]
        if any(less):
            forward, sideways = (forward if less[0] else sideways), (sideways if less[1] else forward)
            lifts |= {f"{side}_forward": max(LEAST_LIFT, forward), f"{side}_sideways": max(LEAST_LIFT, sideways)}
    out = list[Limit]()
    if lifts or person.hands_low:
        out.append(ArmLift(**lifts, **({"hand": 90.0} if person.hands_low else {})))
    if person.bearing:
        out.append(FootLoad(**dict(person.bearing)))
    return out


def _possible(body: Body, limits: JointLimits, plan: Plan, person: PersonLimits) -> tuple[JointLimits, tuple[str, ...]]:
    """Return the limits with what nobody can do without, and what of ``person`` was therefore not applied, in
    sentences: a shoulder comes back to the hanging arm, every joint moves a little, hip and knee bend to sit.
    """
    lower, upper, own, notes = limits.lower.copy(), limits.upper.copy(), body.limits, list[str]()
    for j, joint in enumerate(body.joints):
        before, bare, why = (lower[j], upper[j]), joint.name.partition("_")[2], ""
        sitting = min(_SITTING.get(bare, -math.inf), own.upper[j]) if plan.seated else -math.inf
        if bare in _RESTING and not (lower[j] <= -_RESTING[bare][0] and _RESTING[bare][0] <= upper[j]):
            around, why = _RESTING[bare]
            lower[j], upper[j] = min(lower[j], 0.0 - around), max(upper[j], around)
        if upper[j] < sitting - _FITS:
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
            rest = min(max(0.0, lower[j]), upper[j])
            lower[j], upper[j] = rest + share * (lower[j] - rest), rest + share * (upper[j] - rest)
    for key, low, high in person.ranges:
        for j in joints(body, key):
            if math.isfinite(low) and math.isfinite(high):
                _check_range(body, j, low, high)
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
