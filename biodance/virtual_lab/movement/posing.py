"""From the postures of a trial to smooth curves, with the inaccuracy of a person who follows a video, and from these to
the true configuration: 46 coordinates, feet exactly where they stand.

Whoever sits does so on a stool on a force plate: the pelvis stays on its seat and rocks there, thighs do not
sink into it, legs hang. What the seat does to the person goes through the stool into the plate, which was set to zero
with the stool on it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.motion.ik.compiled.legs import LEG, Leg, soft_limit
from biodance.records import SIDES, Array
from biodance.virtual_lab.movement import FIELDS, STAND, ProtocolPosture, ProtocolStep, TrialPlan
from biodance.virtual_lab.person import Person
from biodance.virtual_lab.person.skeleton import LabTolerances, smooth_noise

_ENDS = np.cumsum([0, *map(len, FIELDS.values())]).tolist()
COLUMNS = {name: slice(*pair) for name, pair in zip(FIELDS, pairwise(_ENDS), strict=True)}
SHIFT, RAISED = COLUMNS["shift"].start, _ENDS[-1]
WIDTH = RAISED + len(SIDES)
EXACT = ("lean", "shift")
"""Fields that are the balance of the trial, not a matter of how well a posture was copied."""
WEIGHT_FIRST = 0.45
"""Fraction of a move in which the weight goes over before a foot rises (or that is left for it after landing)."""


@dataclass(frozen=True, eq=False)
class Curves:
    """``time`` (T,) s; ``values`` (T, WIDTH): the fields of a posture side by side (degrees, m, shares), then how far
    each foot is raised (0..1).
    """

    time: Array
    values: Array

    def __getitem__(self, name: str) -> Array:
        """Return the columns (T, k) of one field."""
        return self.values[:, COLUMNS[name]]

    def raised(self, side: str) -> Array:
        """Return (T,) 0 = planted exactly, 1 = free."""
        return self.values[:, RAISED + SIDES.index(side)]


def septic(x: Array) -> Array:
    """Return the rest-to-rest polynomial 35x⁴ - 84x⁵ + 70x⁶ - 20x⁷ with x clipped to 0..1."""
    x = np.clip(x, 0.0, 1.0)
    return x**4 * (35 + x * (-84 + x * (70 - 20 * x)))


def _there_and_back(time: Array, step: ProtocolStep) -> Array:
    """Return (T,) 0..1 of a step in cycles: a cosine whose pace rises and falls smoothly over one period."""
    x, count = time / step.period, step.cycles
    fine = np.linspace(0.0, count + 1.0, 400 * (count + 1) + 1)
    pace = septic(fine) * septic(count + 1.0 - fine)
    # Integral of the pace, scaled to whole cycles.
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(fine))])
    turned = CubicSpline(fine, phase * count / phase[-1])(np.clip(x, 0.0, count + 1.0))
    return 0.5 - 0.5 * np.cos(2 * np.pi * turned)


def _target(posture: ProtocolPosture, rng: np.random.Generator, sloppiness: float) -> Array:
    """Return the values (WIDTH,) of a posture as this person does it this time."""
    target = np.zeros(WIDTH)
    for name, value in posture.values.items():
        stand = np.array(STAND.values[name])
        done = (np.array(value) - stand) * (1.0 + sloppiness * rng.normal(size=len(value)))
        target[COLUMNS[name]] = value if name in EXACT else stand + done
    target[RAISED:] = [side in posture.raised for side in SIDES]
    return target


def _windows(
    previous: Array, target: Array, move: float, rng: np.random.Generator, sloppiness: float
) -> tuple[Array, Array]:
    """Return start and duration (WIDTH,) s of every column's move within a step."""
    late = np.minimum(np.abs(2.0 * sloppiness * rng.normal(size=WIDTH)), 0.3) * move
    start, duration = late, move - late
    for foot in (RAISED, RAISED + 1):
        rises = target[foot] > previous[foot]
        if rises or target[foot] < previous[foot]:
            start[[SHIFT, foot]] = (0.0, WEIGHT_FIRST * move) if rises else ((1 - WEIGHT_FIRST) * move, 0.0)
            duration[[SHIFT, foot]] = WEIGHT_FIRST * move, (1 - WEIGHT_FIRST) * move
    return start, duration


def choreograph(plan: TrialPlan, time: Array, rng: np.random.Generator, *, sloppiness: float) -> Curves:
    """Return the curves of one trial at ``time`` (T,) s; 0 is the start of the recording.

    Moves are septic rest-to-rest polynomials; a foot rises only after the weight has left it and takes weight only
    after it has landed. ``sloppiness`` is the relative error of amplitudes and of timing with which the person copies
    the postures.
    """
    start, now = plan.lead, _target(STAND, rng, sloppiness)
    values = np.tile(now, (time.size, 1))
    for step in plan.steps:
        target = _target(step.to, rng, sloppiness)
        before = now.copy()
        for side, foot in zip(SIDES, (RAISED, RAISED + 1), strict=True):
            # the angles of a raised foot stand still while they do not count: before it rises and after it lands
            columns = COLUMNS[f"{side}_leg"]
            if not before[foot]:
                before[columns] = target[columns]
            elif not target[foot]:
                target[columns] = before[columns]
        values += np.where(time[:, None] >= start, before - now, 0.0)
        if step.cycles:
            depth = 1.0 + sloppiness * smooth_noise(rng, time, columns=1, cutoff=0.4)
            values += depth * _there_and_back(time - start, step)[:, None] * (target - before)
            now = before
        else:
            begin, duration = _windows(before, target, step.move, rng, sloppiness)
            values += septic((time[:, None] - start - begin) / duration) * (target - before)
            now = target
        start += step.duration
    return Curves(time, values)


_X, _Y, Z = np.eye(3)
_SHARPNESS = 250.0
"""1/m: the height of the pelvis turns from one leg's limit to the other's within some millimetres."""
CLEARANCE = np.radians([18.0, 0.0, 0.0, 34.0, 12.0, 0.0])
"""Extra leg angles halfway up and down, so that the toes clear the ground (order of ``legs.LEG``)."""
STRAIGHT = np.radians(9.0)
"""Least knee flexion of a planted leg: nobody is asked to lock the knees."""


@dataclass(frozen=True, eq=False)
class FootStance:
    """Where the feet stand in one trial: ``heading`` rad from lab x; per side ``ankle`` (3,) m, ``foot_turn`` (3, 3),
    ``pressure`` (2,) m where the foot presses when it carries the weight.
    """

    heading: float
    ankle: dict[str, Array]
    foot_turn: dict[str, Array]
    pressure: dict[str, Array]


def take_stance(person: Person, kind: str, centre: Array, heading: float, rng: np.random.Generator) -> FootStance:
    """Return the feet of a trial around ``centre`` (2,) m: parallel, or the right foot 0.1 m in front; re-placed by
    about 5 mm and 1 degree.
    """
    heading = heading + float(np.radians(1.0) * rng.normal())
    forward, left = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    ahead = {"right": 0.05, "left": -0.05} if kind == "right_forward" else dict.fromkeys(SIDES, 0.0)
    ankle, turn, pressure = {}, {}, {}
    for side, sign, out in zip(SIDES, (-1.0, 1.0), person.habits.toe_out, strict=True):
        xy = (
            centre
            + (ahead[side] - 0.23 * person.size["sole"]) * forward
            + sign * 0.5 * person.habits.stance * left
            + 0.005 * rng.normal(size=2)
        )
        yaw = heading + sign * out
        ankle[side] = np.array([*xy, person.size["ankle_height"]])
        turn[side] = turn_about(Z, np.array([yaw]))[0] @ UPRIGHT
        pressure[side] = xy + 0.19 * person.size["sole"] * np.array([np.cos(yaw), np.sin(yaw)])
    return FootStance(heading, ankle, turn, pressure)


@dataclass(frozen=True, eq=False)
class Pose:
    """What is known before feet and balance: ``q`` (T, 46) of upper body and pelvis turn, ``pelvis_turn`` (T, 3, 3)."""

    q: Array
    pelvis_turn: Array


def upper_body(
    person: Person, curves: Curves, stance: FootStance, tolerances: LabTolerances, rng: np.random.Generator
) -> Pose:
    """Return the pose above the legs: the posture's angles over the true joints, with what no instruction asks for."""
    body, t, time = person.body, tolerances, curves.time
    angle = np.zeros((time.size, len(body.joints)))
    unasked = dict(zip(_UNASKED, smooth_noise(rng, time, columns=len(_UNASKED), cutoff=0.8).T, strict=True))
    tremor = t.tremor * smooth_noise(rng, time, columns=len(body.joints) + 3, cutoff=1.0)
    girdle = rng.spawn(1)[0]

    def add(name: str, value: Array | float) -> None:
        angle[:, body.joint_index(name)] += value

    for name, value in person.habits.angles.items():
        add(name, value)
    trunk, head = np.radians(curves["trunk"]), np.radians(curves["head"])
    for k, motion in enumerate(("flexion", "bending", "rotation")):
        add(f"lumbar_{motion}", (1 - t.thorax_share) * trunk[:, k])
        add(f"thorax_{motion}", t.thorax_share * trunk[:, k])
        add(f"neck_{motion}", head[:, k])
    for name, curve in unasked.items():
        add(name, {"neck": t.head_motion, "thorax": t.thorax_motion}.get(name.split("_")[0], t.wrist_motion) * curve)
    add("thorax_flexion", -t.breathing * np.sin(2 * np.pi * 0.25 * time + rng.uniform(0, 2 * np.pi)))
    for side in SIDES:
        arm = np.radians(curves[f"{side}_arm"])
        for name, column in zip(
            ("shoulder_flexion", "shoulder_adduction", "shoulder_rotation", "elbow_flexion"), arm.T, strict=True
        ):
            add(f"{side}_{name}", column)
        add(f"{side}_clavicle_elevation", t.clavicle_rhythm * np.sqrt(arm[:, 0] ** 2 + arm[:, 1] ** 2 + 0.01))
        shrug = t.girdle_motion * smooth_noise(girdle, time, columns=2, cutoff=0.6)
        add(f"{side}_clavicle_elevation", shrug[:, 0])
        add(f"{side}_clavicle_protraction", shrug[:, 1])
    # forward tilt, right drop and left turn
    tilt, drop, left = (np.radians(curves["pelvis"]) + tremor[:, -3:]).T
    turn = turn_about(Z, stance.heading + left) @ UPRIGHT @ turn_about(_X, drop) @ turn_about(-Z, tilt)
    upper = ~np.isin(np.arange(angle.shape[1]), [body.joint_index(f"{side}_{name}") for side in SIDES for name in LEG])
    angle[:, upper] += tremor[:, :-3][:, upper]
    q = np.zeros((time.size, body.nq))
    # Both stops: the upper one, then the lower one as an upper one of the negative angle.
    q[:, 7:] = -soft_limit(-soft_limit(angle, body.limits.upper, 0.1), -body.limits.lower, 0.1)
    q[:, 3:7] = without_jumps(Rotation.from_matrix(turn).as_quat())
    return Pose(q, turn)


_UNASKED = (
    *("neck_flexion", "neck_rotation", "thorax_flexion", "thorax_bending"),
    *(f"{side}_{name}" for side in SIDES for name in ("wrist_flexion", "wrist_deviation", "forearm_pronation")),
)


def turn_about(axis: Array, angle: Array) -> Array:
    """Return rotations (T, 3, 3) about one unit ``axis`` (3,) by ``angle`` (T,) rad: scipy's, not those of
    `biodance.spatial`.
    """
    return Rotation.from_rotvec(np.multiply.outer(angle, axis)).as_matrix()


def without_jumps(quaternion: Array) -> Array:
    """Return quaternions (T, 4) without jumps of sign."""
    # q and -q are one rotation: a flip holds for all later frames.
    flips = np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0, -1.0, 1.0)
    return np.asarray(quaternion * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def leg_tops(body: Body, turn: Array, xy: Array, ankle: dict[str, Array]) -> tuple[Array, float]:
    """Return the heights (2, T) m of the pelvis, at ``turn`` (T, 3, 3) over ``xy`` (T, 2) m, at which each leg is
    nearly straight, and the mean length m of the legs.
    """
    tops, lengths = [], []
    for side in SIDES:
        leg = Leg.of(body, side)
        hip, reach = turn @ leg.hip, float(leg.length(STRAIGHT))
        across = np.sum((xy + hip[:, :2] - ankle[side][:2]) ** 2, axis=1)
        # Pythagoras from hip to ankle; a hip that is too far aside is still half a leg above its ankle.
        tops.append(ankle[side][2] + np.sqrt(np.maximum(reach**2 - across, (0.5 * reach) ** 2)) - hip[:, 2])
        lengths.append(reach)
    return np.array(tops), float(np.mean(lengths))


def pelvis_height(person: Person, pose: Pose, curves: Curves, stance: FootStance, xy: Array) -> Array:
    """Return the height (T,) m of the pelvis over ``xy`` (T, 2): as high as planted legs allow, less the depth."""
    tops, length = leg_tops(person.body, pose.pelvis_turn, xy, stance.ankle)
    weight = np.array([1.0 - curves.raised(side) for side in SIDES])
    # Soft minimum, weighted: a foot in the air has no say.
    height = -logsumexp(-_SHARPNESS * tops, axis=0, b=weight) / _SHARPNESS
    return height - curves["depth"][:, 0] * length


Height = Callable[[Person, Pose, Curves, FootStance, Array], Array]
"""Says how high (T,) m the pelvis is over ``xy`` (T, 2) m, as `pelvis_height` does."""


def stand_on_feet(
    person: Person, pose: Pose, curves: Curves, stance: FootStance, xy: Array, *, height: Height
) -> Array:
    """Return q (T, 46) with the pelvis over ``xy`` (T, 2) m and the legs that hold the planted feet exactly still."""
    q = pose.q.copy()
    q[:, :2], q[:, 2] = xy, height(person, pose, curves, stance, xy)
    frames = q.shape[0]
    for side in SIDES:
        leg, raised = Leg.of(person.body, side), curves.raised(side)[:, None]
        turn, ankle = (
            np.broadcast_to(stance.foot_turn[side], (frames, 3, 3)),
            np.broadcast_to(stance.ankle[side], (frames, 3)),
        )
        planted = leg.solve(pose.pelvis_turn, q[:, :3], turn, ankle)
        free = np.concatenate([np.radians(curves[f"{side}_leg"]), np.zeros((frames, 1))], axis=1)
        q[:, [7 + c for c in leg.columns]] = (
            # 4 r (1 - r): one in the middle of rising, zero when planted or free.
            (1 - raised) * planted + raised * free + 4 * raised * (1 - raised) * CLEARANCE
        )
    return q


_FLESH = 0.08  # m from the seat up to the hip centres: half a thigh
LEGS_APART, AHEAD = 0.4, 0.05
"""m between the legs of the stool, and from the hips forward to its middle."""
_SINKS = 0.03  # m by which the flesh of a thigh lets the knee down below the hip
_SOFT = 0.1  # rad within which a thigh comes to rest on the seat


def take_seat(centre: Array, heading: float, rng: np.random.Generator) -> FootStance:
    """Return how somebody sits with the middle of the stool at ``centre`` (2,) m, facing ``heading`` rad: of each side
    the hip's place on the ground where a foot would be, and where the legs of the stool press.
    """
    heading = heading + float(np.radians(1.0) * rng.normal())
    turn = turn_about(Z, np.array([heading]))[0]
    middle = centre + 0.005 * rng.normal(size=2)
    hips, rows = {}, {}
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        row = sign * LEGS_APART / 2
        rows[side] = middle + turn[:2, :2] @ np.array([0.0, row])
        hips[side] = np.array([*(middle + turn[:2, :2] @ np.array([-AHEAD, 0.0])), 0.0])
    return FootStance(heading, hips, dict.fromkeys(SIDES, turn @ UPRIGHT), rows)


def sit(person: Person, pose: Pose, curves: Curves, place: FootStance, hips: float) -> Array:
    """Return q (T, 46) of a ``person`` whose hip centres are ``hips`` m high on the seat at ``place``: the pelvis turns
    about the point under them on which it sits, and the legs do as the ``curves`` say, as far as the seat lets them.
    """
    legs = [Leg.of(person.body, side) for side in SIDES]
    under = np.mean([leg.hip for leg in legs], axis=0) - np.array([0.0, _FLESH, 0.0])
    seat = np.array([*place.ankle["right"][:2], hips - _FLESH])
    q = pose.q.copy()
    # The point under the hips stays on the seat whatever the pelvis turns by.
    q[:, :3] = seat - pose.pelvis_turn @ under
    for side, leg in zip(SIDES, legs, strict=True):
        angle = np.radians(curves[f"{side}_leg"])
        angle[:, 0] = _on_seat(angle, pose.pelvis_turn, person.size["thigh"])
        angle = np.column_stack([angle, np.zeros(len(angle))])
        own, limits = list(leg.columns), person.body.limits
        below = soft_limit(angle, limits.upper[own], _SOFT)
        q[:, [7 + c for c in own]] = -soft_limit(-below, -limits.lower[own], _SOFT)
    return q


def _on_seat(angle: Array, turn: Array, thigh: float) -> Array:
    """Return the hip's flexion (T,) rad with which a knee comes no lower than the seat lets it: thigh cos f cos a."""
    raised = np.arcsin(np.clip(turn[:, 2, 0], -1.0, 1.0))  # the pelvis' own forward axis, over the horizontal
    # cos f cos a = sinks / thigh, less what the pelvis leans itself; adduction to 60 degrees at most.
    least = np.arccos(np.clip(_SINKS / (thigh * np.maximum(np.cos(angle[:, 1]), 0.5)), -1.0, 1.0)) - raised
    # A lower stop is an upper one of the negative angle.
    return np.asarray(-soft_limit(-angle[:, 0], -least, _SOFT))
