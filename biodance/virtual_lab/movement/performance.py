"""Perform a trial: the true motion and the true ground wrench of a virtual person, by pinocchio's own dynamics.

The path of the pelvis is what keeps the balance: the zero-moment point of the full body is brought to where the posture
asks for it. Whoever copies a planned dance from a screen is late, slower, degrees off in every joint, but on both feet
or on a stool: the plan is a motion of the 12-segment model, the person's own bones, habits and soft parts differ, so
the copy is made joint by joint, and the path of the pelvis keeps the zero-moment point where the plan has it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.linalg import solve_banded
from scipy.ndimage import correlate1d, gaussian_filter1d
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from biodance.body.body import Body, load_pinocchio
from biodance.body.parts import GRAVITY, UPRIGHT
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Motion, Role, Wrench, freeze
from biodance.virtual_lab.movement import TrialPlan, posing
from biodance.virtual_lab.person import Person
from biodance.virtual_lab.person.skeleton import REALISTIC, LabTolerances, smooth_noise, stream

NODE_RATE = 100.0
"""Hz of the nodes of the motion's spline; the instruments sample the spline at their own rates."""
MARGIN = 0.1
"""s of motion before and after the recording, for late force samples."""
_ROUNDS = 12  # Largest number of balance corrections; 5 to 8 suffice


@dataclass(frozen=True, eq=False)
class Performance:
    """One trial as it truly happened: the motion is a quintic spline through ``nodes`` (T, 46) at ``node_time`` (T,) s.

    ``plan`` what was asked; ``stance`` where the feet stood; ``curves`` the postures; ``balance_error`` m: the farthest
    that the zero-moment point was from the place wanted. ``forces`` act on the person beside gravity and the ground: a
    hand on a rail, a rope.
    """

    plan: TrialPlan
    person: Person
    stance: posing.FootStance
    curves: posing.Curves
    node_time: Array
    nodes: Array
    balance_error: float = 0.0
    forces: "tuple[AppliedForce, ...]" = ()

    @cached_property
    def _spline(self) -> Any:
        return make_interp_spline(self.node_time, self.nodes, k=5)

    def motion(self, time: Array) -> Motion:
        """Return the true q, v, a at ``time`` (T,) s, of the true body with its 16 segments."""
        return motion_along(self._spline, time)

    @cached_property
    def _wrench_spline(self) -> Any:
        time = np.arange(self.node_time[0], self.node_time[-1] + 1e-9, 0.5 / NODE_RATE)
        time = time[time <= self.node_time[-1]]
        needed = true_wrench(self.person, self.motion(time)).value
        return make_interp_spline(time, needed - sum(force(self, time) for force in self.forces), k=5)

    def wrench(self, time: Array) -> Wrench:
        """Return the true ground wrench on the person about the lab origin at ``time`` (T,) s, all feet together: what
        the motion needs less what the ``forces`` do.
        """
        return Wrench(time, self._wrench_spline(time))

    def foot_wrench(self, time: Array, side: str) -> Array:
        """Return the true wrench (T, 6) about the lab origin under one foot.

        The weight is shared as planned; each foot's pressure lies as far from its own place as the common one from the
        place wanted.
        """
        wrench = self.wrench(time)
        # Of the weight, on the right foot.
        share = np.clip(np.interp(time, self.curves.time, self.curves["shift"][:, 0]), 0.0, 1.0)[:, None]
        pressure, stance = wrench.cop(threshold=1.0), self.stance
        # Mean of the places, weighted with the load.
        middle = share * stance.pressure["right"] + (1 - share) * stance.pressure["left"]
        weight = share if side == "right" else 1 - share
        place = np.zeros_like(pressure)
        # So the weighted mean of both places is the common pressure, and the moments add up.
        place[:, :2] = stance.pressure[side] + pressure[:, :2] - middle
        twist = wrench.moment - np.cross(pressure, wrench.force)
        return np.concatenate([weight * wrench.force, weight * (np.cross(place, wrench.force) + twist)], axis=1)


AppliedForce = Callable[[Performance, Array], Array]
"""Wrench (T, 6) N, N·m on the person about the lab origin, true vertical, at times (T,) s, equidistant."""


def perform(
    person: Person,
    plan: TrialPlan,
    session: int,
    *,
    tolerances: LabTolerances = REALISTIC,
    centre: Array,
    heading: float = 0.0,
) -> Performance:
    """Let ``person`` perform one trial around ``centre`` (2,) m of the lab floor, facing ``heading`` rad from lab x
    (anticlockwise).

    ``session`` decides what differs from day to day and from trial to trial; the same arguments give the same motion,
    bit for bit.
    """
    rng = stream(person.seed, "performance", str(session), plan.name)
    count = round((plan.duration + 2 * MARGIN) * NODE_RATE) + 1
    time = -MARGIN + np.arange(count) / NODE_RATE
    curves = posing.choreograph(plan, time, rng, sloppiness=tolerances.performance)
    stance = posing.take_stance(person, plan.stance, centre, heading, rng)
    pose = posing.upper_body(person, curves, stance, tolerances, rng)
    # the centre of pressure: between the feet by share of weight, plus lean
    right, ahead = curves["shift"], np.array([np.cos(stance.heading), np.sin(stance.heading)])
    middle = right * stance.pressure["right"] + (1 - right) * stance.pressure["left"]
    leant = middle + curves["lean"][:, :1] * ahead + curves["lean"][:, 1:] * np.array([ahead[1], -ahead[0]])
    target = leant + tolerances.sway * smooth_noise(rng, time, columns=2, cutoff=0.5)
    nodes, error = keep_balance(person, pose, curves, stance, target)
    return Performance(plan, person, stance, curves, time, nodes, error)


def keep_balance(
    person: Person,
    pose: posing.Pose,
    curves: posing.Curves,
    stance: posing.FootStance,
    target: Array,
    *,
    height: posing.Height = posing.pelvis_height,
) -> tuple[Array, float]:
    """Return the configurations (T, 46) whose zero-moment point follows ``target`` (T, 2) m, and the largest distance
    left, m.

    Each round moves the pelvis by the bounded solution of  d - h d'' = -(error), the linear pendulum with h = height of
    the centre of mass over (g + its vertical acceleration); the legs, the arms' momentum and all else are in the error.
    """
    time = curves.time
    xy = target.copy()
    q = posing.stand_on_feet(person, pose, curves, stance, xy, height=height)
    for _ in range(_ROUNDS):
        motion = motion_along(make_interp_spline(time, q, k=5), time)
        value = true_wrench(person, motion).value
        vertical = value[:, 2]
        # Zero-moment point of the needed wrench.
        error = np.stack([-value[:, 4], value[:, 3]], axis=1) / vertical[:, None] - target
        if np.abs(error).max() < 0.004:  # m, everywhere
            break
        # Height over vertical acceleration: z m / Fz = z / (g + a).
        pendulum = person.mass * 0.56 * person.subject.stature / vertical
        # Smoothing that leaves parabolas as they are and takes off what alternates from node to node.
        moved, smooth = _pendulum(error, pendulum, 1.0 / NODE_RATE), np.array([-1.0, 4.0, 10.0, 4.0, -1.0]) / 16.0
        xy = xy - 0.95 * np.asarray(correlate1d(moved, smooth, axis=0, mode="nearest"))
        q = posing.stand_on_feet(person, pose, curves, stance, xy, height=height)
    return q, float(np.abs(error).max())


def _pendulum(right: Array, h: Array, step: float) -> Array:
    """Solve d - h d'' = right (T, 2) for d with d' = 0 at both ends; ``h`` (T,) s², ``step`` s."""
    # Central differences: -k d_(i-1) + (1 + 2 k) d_i - k d_(i+1).
    k = h / step**2
    bands = np.stack([np.roll(-k, 1), 1 + 2 * k, np.roll(-k, -1)])
    # No slope at the ends: the neighbour beyond an end is the mirror image, so k counts twice.
    bands[0, 1], bands[2, -2] = -2 * k[0], -2 * k[-1]
    return solve_banded((1, 1), bands, right)


def motion_along(spline: Any, time: Array) -> Motion:
    """Return the motion at ``time`` (T,) s of a spline through nodes [position, quaternion, angles] (N, 46); velocities
    of the root in its own frame.
    """
    value, rate, rate2 = spline(time), spline.derivative(1)(time), spline.derivative(2)(time)
    # A spline through unit quaternions is not of unit length in between.
    norm = np.linalg.norm(value[:, 3:7], axis=1, keepdims=True)
    quaternion = value[:, 3:7] / norm
    turn = np.swapaxes(Rotation.from_quat(quaternion).as_matrix(), 1, 2)
    # Changes of length are along q itself: the scalar part of q* q', which is dropped.
    angular = _twice_conjugate_times(quaternion, rate[:, 3:7] / norm)
    angular_rate = _twice_conjugate_times(quaternion, rate2[:, 3:7] / norm)
    linear = np.einsum("tij,tj->ti", turn, rate[:, :3])
    # d/dt (R'u) = R'u' - w x R'u.
    linear_rate = np.einsum("tij,tj->ti", turn, rate2[:, :3]) - np.cross(angular, linear)
    q = np.concatenate([value[:, :3], quaternion, value[:, 7:]], axis=1)
    v = np.concatenate([linear, angular, rate[:, 7:]], axis=1)
    a = np.concatenate([linear_rate, angular_rate, rate2[:, 7:]], axis=1)
    return Motion(time, q, v, a)


def _twice_conjugate_times(quaternion: Array, rate: Array) -> Array:
    """Return the vector part (T, 3) of 2 q* r: angular velocity for r = q', its rate for r = q'' (unit q, xyzw)."""
    vector, scalar = quaternion[:, :3], quaternion[:, 3:]
    return 2 * (scalar * rate[:, :3] - rate[:, 3:] * vector - np.cross(vector, rate[:, :3]))


def true_wrench(person: Person, motion: Motion) -> Wrench:
    """Return the ground wrench about the lab origin that ``motion`` of the loaded true body needs, by RNEA."""
    pin = load_pinocchio()
    model = person.loaded_body.model.copy()
    model.gravity = pin.Motion(np.array(GRAVITY), np.zeros(3))
    data = model.createData()
    # First six: force and moment on the root, in its own frame.
    root = np.array([pin.rnea(model, data, q, v, a)[:6] for q, v, a in zip(motion.q, motion.v, motion.a, strict=True)])
    turn = Rotation.from_quat(motion.q[:, 3:7]).as_matrix()
    force, moment = np.einsum("tij,tj->ti", turn, root[:, :3]), np.einsum("tij,tj->ti", turn, root[:, 3:])
    # M + p x F: about the lab's origin.
    return Wrench(motion.time, np.concatenate([force, moment + np.cross(motion.q[:, :3], force)], axis=1))


ARM = ("shoulder_flexion", "shoulder_adduction", "shoulder_rotation", "elbow_flexion")
FREE_LEG = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion")
_JOINTS = {
    "trunk": ("trunk_flexion", "trunk_bending", "trunk_rotation"),
    **{f"{side}_arm": tuple(f"{side}_{joint}" for joint in ARM) for side in SIDES},
    **{f"{side}_leg": tuple(f"{side}_{joint}" for joint in FREE_LEG) for side in SIDES},
}
"""Joints of the model behind every field of a posture."""
WANDER = 0.25
"""Hz: how fast the error of a person who follows a screen changes."""
SMOOTH = 0.12
"""s: the plan's zero-moment point has corners where holds begin and end; nobody's has."""
AWAY, SOFTNESS = 0.6, 80.0
"""m by which a foot that is up no longer holds the pelvis down; 1/m of the soft minimum over the legs."""


@dataclass(frozen=True)
class Performer:
    """How well somebody copies: ``tracking`` rad, root mean square error of every joint; ``pace`` how many times the
    planned duration; ``timing`` by which share the tempo wanders about it, root mean square; ``sway`` times the usual
    sway of the centre of pressure.
    """

    tracking: float = float(np.radians(7.0))
    pace: float = 1.2
    timing: float = 0.0
    sway: float = 1.0

    def __post_init__(self) -> None:
        legal = (
            ("tracking", 0.0, 0.6, "rad"),
            ("pace", 0.5, 5.0, "times the duration"),
            ("timing", 0.0, 0.4, "of the tempo"),
            ("sway", 0.0, 4.0, "times the usual sway"),
        )
        for name, low, high, unit in legal:
            if not low <= getattr(self, name) <= high:
                raise BiodanceError(
                    f"Performer: {name} = {getattr(self, name):g}; legal are {low:g} to {high:g} {unit}."
                )

    def clock(self, rng: np.random.Generator, duration: float) -> tuple[float, Array, Array]:
        """Return the seconds (rounded to a tenth) in which this performer shows what is planned for ``duration`` s,
        and instants (N,) s of the performance with those of the plan (N,) s that belong to them.
        """
        seconds = round(duration * self.pace, 1)
        time = np.linspace(0.0, seconds, max(2, round(20 * seconds)) + 1)
        # Hz: how fast the tempo changes
        tempo = np.exp(self.timing * smooth_noise(rng, time, columns=1, cutoff=0.2)[:, 0])
        done = np.concatenate([[0.0], np.cumsum(0.5 * (tempo[1:] + tempo[:-1]))])
        return seconds, time, duration * done / done[-1]


USUAL_PERFORMER = Performer()
"""Seven degrees off in every joint, a fifth slower than shown."""
PERFORMERS = {
    "steady": Performer(tracking=float(np.radians(2.0)), pace=1.1, timing=0.05, sway=0.7),
    "normal": Performer(tracking=float(np.radians(5.0)), pace=1.2, timing=0.1, sway=1.0),
    "restless": Performer(tracking=float(np.radians(7.0)), pace=1.2, timing=0.2, sway=1.5),
}
"""Performers by name: degrees off in every joint, slower than shown, tempo that wanders, sway."""


@dataclass(frozen=True, eq=False)
class Shown:
    """One stretch of a dance as it is shown, both feet staying where they are.

    ``motion`` of ``body``, resting at both ends; ``ankle`` (2, 3) m right and left; ``raised`` (T, 2) 0 = planted .. 1
    = free, right and left; ``pressure`` (T, 2) m zero-moment point; ``seat`` m height of the hip centres of a person on
    a stool, 0 standing; ``role`` of the trial.
    """

    name: str
    body: Body
    motion: Motion
    ankle: Array
    raised: Array
    pressure: Array
    seat: float = 0.0
    role: Role = "fit"

    def __post_init__(self) -> None:
        frames = self.motion.time.size
        freeze(self, "Shown", ankle=(2, 3), raised=(frames, 2), pressure=(frames, 2))

    def plan(self, seconds: float) -> TrialPlan:
        """Return the trial of a performance that takes ``seconds``."""
        return TrialPlan(self.name, self.role, "parallel", (), seconds / 2)


def copy_dance(
    person: Person,
    shown: Shown,
    session: int,
    *,
    centre: Array,
    heading: float = 0.0,
    performer: Performer,
    tolerances: LabTolerances = REALISTIC,
) -> Performance:
    """Let ``person`` copy one stretch around ``centre`` (2,) m, facing ``heading`` rad; reproducible."""
    rng = stream(person.seed, "copy", str(session), shown.name)
    duration, *clock = performer.clock(
        stream(person.seed, "tempo", str(session), shown.name), float(np.ptp(shown.motion.time))
    )
    time = -MARGIN + np.arange(round((duration + 2 * MARGIN) * NODE_RATE) + 1) / NODE_RATE
    when = shown.motion.time[0] + make_interp_spline(*clock, k=3)(np.clip(time, 0.0, duration))
    when = np.clip(when, shown.motion.time[0], shown.motion.time[-1])
    smoothed = gaussian_filter1d(shown.pressure, SMOOTH / np.diff(shown.motion.time).mean(), axis=0, mode="nearest")
    values, pressure = (make_interp_spline(shown.motion.time, what, k=5)(when) for what in (_fields(shown), smoothed))
    values[:, posing.RAISED :] = np.clip(values[:, posing.RAISED :], 0.0, 1.0)
    error = np.degrees(performer.tracking) * smooth_noise(rng, time, columns=posing.WIDTH, cutoff=WANDER)
    for field in _JOINTS:
        values[:, posing.COLUMNS[field]] += error[:, posing.COLUMNS[field]]
    # whoever stands on planted feet is held by them
    values[:, posing.COLUMNS["pelvis"]] += 0.4 * error[:, posing.COLUMNS["pelvis"]]
    if shown.seat:
        stance = posing.take_seat(centre, heading, rng)
        values[:, posing.SHIFT] = np.clip(0.5 - pressure[:, 1] / posing.LEGS_APART, 0.0, 1.0)
        curves = posing.Curves(time, values)
        nodes = posing.sit(
            person, posing.upper_body(person, curves, stance, tolerances, rng), curves, stance, shown.seat
        )
        return Performance(shown.plan(duration), person, stance, curves, time, nodes)
    stance, middle, turn = _stand(person, shown, centre, heading, rng)
    target = (
        centre
        + (pressure - middle) @ turn[:2, :2].T
        + performer.sway * tolerances.sway * smooth_noise(rng, time, columns=2, cutoff=0.5)
    )
    apart = shown.ankle[1, 1] - shown.ankle[0, 1]
    # Lever rule: all on the right foot where the pressure lies under it.
    values[:, posing.SHIFT] = np.clip((shown.ankle[1, 1] - pressure[:, 1]) / apart, 0.0, 1.0)
    curves = posing.Curves(time, values)
    pose = posing.upper_body(person, curves, stance, tolerances, rng)
    nodes, missed = keep_balance(person, pose, curves, stance, target, height=_height)
    return Performance(shown.plan(duration), person, stance, curves, time, nodes, missed)


def _fields(shown: Shown) -> Array:
    """Return the plan in the fields of a posture (T, WIDTH), without lean and shift."""
    body, q = shown.body, shown.motion.q
    angle, out = np.degrees(q[:, body.nq - len(body.joints) :]), np.zeros((len(q), posing.WIDTH))
    for field, names in _JOINTS.items():
        out[:, posing.COLUMNS[field]] = angle[:, [body.joint_index(name) for name in names]]
    # forward tilt, right drop and left turn of the pelvis, facing lab x
    turn = Rotation.from_quat(q[:, 3:7]).as_matrix()
    left, drop, back = Rotation.from_matrix(UPRIGHT.T @ turn).as_euler("YXZ").T
    out[:, posing.COLUMNS["pelvis"]] = np.degrees(np.stack([-back, drop, left], axis=1))
    if not shown.seat:
        out[:, posing.COLUMNS["depth"]] = _depth(shown)[:, None]
    out[:, posing.RAISED :] = shown.raised
    return out


def _depth(shown: Shown) -> Array:
    """Return how far (T,) the pelvis is below the highest place that the feet allow, per leg length."""
    pose = poses(shown.body, shown.motion.q)
    highest, length = _reach(
        shown.body,
        pose.rotation[:, 0],
        pose.position[:, 0, :2],
        dict(zip(SIDES, shown.ankle, strict=True)),
        shown.raised,
    )
    return np.asarray((highest - pose.position[:, 0, 2]) / length)


def _height(person: Person, pose: posing.Pose, curves: posing.Curves, stance: posing.FootStance, xy: Array) -> Array:
    """Return the height (T,) m of the pelvis of the person who copies."""
    raised = np.stack([curves.raised(side) for side in SIDES], axis=1)
    highest, length = _reach(person.body, pose.pelvis_turn, xy, stance.ankle, raised)
    return highest - curves["depth"][:, 0] * length


def _reach(body: Body, turn: Array, xy: Array, ankle: dict[str, Array], raised: Array) -> tuple[Array, float]:
    """Return the highest place (T,) m of a pelvis, and the legs' length m; a foot gives way as it rises."""
    tops, length = posing.leg_tops(body, turn, xy, ankle)
    # Soft minimum: -log(sum of exp(-k h)) / k; a raised foot is let go by metres.
    return -logsumexp(-SOFTNESS * (tops + AWAY * raised.T), axis=0) / SOFTNESS, length


def _stand(
    person: Person, shown: Shown, centre: Array, heading: float, rng: np.random.Generator
) -> tuple[posing.FootStance, Array, Array]:
    """Return where the person's feet are, the plan's middle (2,) m and the turn (3, 3) from the plan to the lab."""
    turn = posing.turn_about(posing.Z, np.array([heading]))[0]
    middle = shown.ankle[:, :2].mean(axis=0) + np.array([0.04, 0.0])
    ankle, foot = {}, {}
    for k, side in enumerate(SIDES):
        xy = centre + turn[:2, :2] @ (shown.ankle[k, :2] - middle) + 0.005 * rng.normal(size=2)
        ankle[side] = np.array([*xy, person.size["ankle_height"]])
        foot[side] = posing.turn_about(posing.Z, np.array([heading + 0.02 * rng.normal()]))[0] @ UPRIGHT
    return posing.FootStance(heading, ankle, foot, {side: ankle[side][:2] for side in SIDES}), middle, turn
