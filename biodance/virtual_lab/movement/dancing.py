"""A virtual person copies a planned dance from a screen: late, slower, degrees off in every joint, but on both feet or
on the stool.

The plan is a motion of the 12-segment model with its feet and its zero-moment point. The person's own bones, habits and
soft parts differ, so the copy is made joint by joint; the path of the pelvis then keeps the zero-moment point where the
plan has it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Motion, Role, freeze
from biodance.virtual_lab.movement.performance import MARGIN, NODE_RATE, Performance, keep_balance
from biodance.virtual_lab.movement.posing import (
    COLUMNS,
    RAISED,
    SHIFT,
    WIDTH,
    Curves,
    FootStance,
    Pose,
    Z,
    leg_tops,
    turn_about,
    upper_body,
)
from biodance.virtual_lab.movement.protocol import TrialPlan
from biodance.virtual_lab.movement.sitting import LEGS_APART, sit, take_seat
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.tolerances import REALISTIC, LabTolerances, smooth_noise, stream

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
PELVIS = 0.4
"""Share of the tracking error that the pelvis has: whoever stands on planted feet is held by them."""
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
        tempo = np.exp(self.timing * smooth_noise(rng, time, columns=1, cutoff=TEMPO)[:, 0])
        done = np.concatenate([[0.0], np.cumsum(0.5 * (tempo[1:] + tempo[:-1]))])
        return seconds, time, duration * done / done[-1]


TEMPO = 0.2
"""Hz: how fast the tempo of a person who follows a screen changes."""
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
    performer: Performer = Performer(),
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
    values[:, RAISED:] = np.clip(values[:, RAISED:], 0.0, 1.0)
    error = np.degrees(performer.tracking) * smooth_noise(rng, time, columns=WIDTH, cutoff=WANDER)
    for field in _JOINTS:
        values[:, COLUMNS[field]] += error[:, COLUMNS[field]]
    values[:, COLUMNS["pelvis"]] += PELVIS * error[:, COLUMNS["pelvis"]]
    if shown.seat:
        stance = take_seat(centre, heading, rng)
        values[:, SHIFT] = np.clip(0.5 - pressure[:, 1] / LEGS_APART, 0.0, 1.0)
        curves = Curves(time, values)
        nodes = sit(person, upper_body(person, curves, stance, tolerances, rng), curves, stance, shown.seat)
        return Performance(shown.plan(duration), person, stance, curves, time, nodes)
    stance, middle, turn = _stand(person, shown, centre, heading, rng)
    target = (
        centre
        + (pressure - middle) @ turn[:2, :2].T
        + performer.sway * tolerances.sway * smooth_noise(rng, time, columns=2, cutoff=0.5)
    )
    apart = shown.ankle[1, 1] - shown.ankle[0, 1]
    values[:, SHIFT] = np.clip((shown.ankle[1, 1] - pressure[:, 1]) / apart, 0.0, 1.0)
    curves = Curves(time, values)
    pose = upper_body(person, curves, stance, tolerances, rng)
    nodes, missed = keep_balance(person, pose, curves, stance, target, height=_height)
    return Performance(shown.plan(duration), person, stance, curves, time, nodes, missed)


def _fields(shown: Shown) -> Array:
    """Return the plan in the fields of a posture (T, WIDTH), without lean and shift."""
    body, q = shown.body, shown.motion.q
    angle, out = np.degrees(q[:, body.nq - len(body.joints) :]), np.zeros((len(q), WIDTH))
    for field, names in _JOINTS.items():
        out[:, COLUMNS[field]] = angle[:, [body.joint_index(name) for name in names]]
    out[:, COLUMNS["pelvis"]] = pelvis_angles(Rotation.from_quat(q[:, 3:7]).as_matrix())
    if not shown.seat:
        out[:, COLUMNS["depth"]] = _depth(shown)[:, None]
    out[:, RAISED:] = shown.raised
    return out


def pelvis_angles(turn: Array) -> Array:
    """Return forward tilt, right drop and left turn (T, 3) degrees of lab_R_pelvis (T, 3, 3), facing lab x."""
    left, drop, back = Rotation.from_matrix(UPRIGHT.T @ turn).as_euler("YXZ").T
    return np.degrees(np.stack([-back, drop, left], axis=1))


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


def _height(person: Person, pose: Pose, curves: Curves, stance: FootStance, xy: Array) -> Array:
    """Return the height (T,) m of the pelvis of the person who copies."""
    raised = np.stack([curves.raised(side) for side in SIDES], axis=1)
    highest, length = _reach(person.body, pose.pelvis_turn, xy, stance.ankle, raised)
    return highest - curves["depth"][:, 0] * length


def _reach(body: Body, turn: Array, xy: Array, ankle: dict[str, Array], raised: Array) -> tuple[Array, float]:
    """Return the highest place (T,) m of a pelvis at ``turn`` (T, 3, 3) over ``xy`` (T, 2) m, and the legs' length m.

    A foot that is lifted gives way as it rises (`posing.pelvis_height` lets go at once, which would throw up a leaning
    body).
    """
    tops, length = leg_tops(body, turn, xy, ankle)
    return -logsumexp(-SOFTNESS * (tops + AWAY * raised.T), axis=0) / SOFTNESS, length


def _stand(
    person: Person, shown: Shown, centre: Array, heading: float, rng: np.random.Generator
) -> tuple[FootStance, Array, Array]:
    """Return where the person's feet are, the plan's middle (2,) m and the turn (3, 3) from the plan to the lab."""
    turn = turn_about(Z, np.array([heading]))[0]
    middle = shown.ankle[:, :2].mean(axis=0) + np.array([0.04, 0.0])
    ankle, foot = {}, {}
    for k, side in enumerate(SIDES):
        xy = centre + turn[:2, :2] @ (shown.ankle[k, :2] - middle) + 0.005 * rng.normal(size=2)
        ankle[side] = np.array([*xy, person.size["ankle_height"]])
        foot[side] = turn_about(Z, np.array([heading + 0.02 * rng.normal()]))[0] @ UPRIGHT
    return FootStance(heading, ankle, foot, {side: ankle[side][:2] for side in SIDES}), middle, turn
