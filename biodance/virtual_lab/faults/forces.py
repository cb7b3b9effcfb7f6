"""What acts on the person beside gravity and the plates: rails, ropes, table edges, and masses on springs."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps

import numpy as np

from biodance.body.parts import GRAVITY
from biodance.errors import UnknownName
from biodance.motion.kinematics import Poses, poses
from biodance.records import Array
from biodance.virtual_lab.movement.performance import AppliedForce, Performance
from biodance.virtual_lab.movement.posing import septic
from biodance.virtual_lab.person.person import AddedLoad, Person
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS
from biodance.virtual_lab.tolerances import stream
from biodance.virtual_lab.truth import CARRIERS, MERGED

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
    if target not in GRIPS:
        raise UnknownName.of("part of the virtual body that something can touch", target, tuple(GRIPS))
    segment, place = GRIPS[target]
    return pose.points([TRUE_SEGMENTS.index(segment)], np.array([place]))[:, 0]


def touches(time: Array, rng: np.random.Generator, *, every: float) -> Array:
    """Return (T,) 0..1: hands that come and go, one touch in every ``every`` s of a trial, at random times."""
    out = np.zeros_like(time)
    for start in np.arange(time[0], time[-1] - every + 1e-9, every):
        begin = start + rng.uniform(0.0, every - TOUCH)
        out += septic((time - begin) / _GRIP) * septic((begin + TOUCH - time) / _GRIP)
    return out


def acting(act: Callable[..., Array]) -> Callable[..., AppliedForce]:
    """Build forces from ``act`` (performance, time (T,) s, target, **sizes) -> wrench (T, 6) about the lab origin."""

    @wraps(act)
    def build(target: str, **sizes: float) -> AppliedForce:
        return lambda performance, time: act(performance, time, target, **sizes)

    return build


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
    """Hang a rope from the ceiling to a harness at the pelvis: ``force`` (N) when standing, ``stiffness`` (N/m) as
    the person goes down.
    """
    if performance.plan.role == "static":
        return np.zeros((time.size, 6))
    point = grip("pelvis", true_poses(performance, time))
    away, length = _rope(performance, point)
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
    return np.concatenate([np.zeros((time.size, 3)), -np.gradient(momentum * turn[:, :, 2], time, axis=0)], axis=1)


@dataclass(frozen=True)
class Spring:
    """How a loose mass hangs: ``frequency`` Hz undamped, ``damping`` ratio, ``free`` (3,) 1 = moves along x, y, z."""

    frequency: float
    damping: float
    free: tuple[float, float, float] = (1.0, 1.0, 1.0)


_FLESH = {"trunk_head": Spring(5.5, 0.3)}
"""Viscera; other flesh hangs on `MUSCLE`."""
MUSCLE = Spring(9.0, 0.3)
LIQUID = Spring(1.3, 0.08, (1.0, 1.0, 0.0))


def swing(acceleration: Array, step: float, spring: Spring) -> tuple[Array, Array]:
    """Return z (T, 3) m and z'' (T, 3) m/s² of a mass on a spring whose foot moves with ``acceleration`` (T, 3) m/s²,
    from rest.

    ``step`` s between samples; exact for an acceleration that is linear between samples.
    """
    from scipy.signal import cont2discrete, lfilter, ss2tf

    w, damping = 2 * np.pi * spring.frequency, spring.damping
    A, B = np.array([[0.0, 1.0], [-w * w, -2 * damping * w]]), np.array([[0.0], [-1.0]])
    discrete = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), step, method="foh")
    numerator, denominator = ss2tf(*discrete[:4])
    z, rate = (lfilter(row, denominator, acceleration, axis=0) for row in numerator)
    return z, -w * w * z - 2 * damping * w * rate - acceleration


def loose(segment: str, place: Array, mass: float, spring: Spring) -> AppliedForce:
    """Return the force of ``mass`` kg, counted as fixed at ``place`` (3,) m of a true segment but on a spring there."""

    def act(performance: Performance, time: Array) -> Array:
        from scipy.interpolate import make_interp_spline

        point = true_poses(performance, time).points([TRUE_SEGMENTS.index(segment)], place[None])[:, 0]
        acceleration = make_interp_spline(time, point, k=5).derivative(2)(time)
        z, z2 = (np.array(spring.free) * curve for curve in swing(acceleration, float(time[1] - time[0]), spring))
        moment = np.cross(point + z, mass * (acceleration + z2 - GRAVITY)) - np.cross(
            point, mass * (acceleration - GRAVITY)
        )
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
    if target not in MERGED:
        raise UnknownName.of("segment of the 12-segment model", target, tuple(MERGED))
    return CARRIERS.get(target, target)
