"""What acts on the person beside gravity and the plates: rails, ropes, table edges, a spinning wheel.

Every builder returns a `Force`: the wrench (T, 6) on the person about the lab origin, along the true motion of the true body. Written
without the formulas of ``effects``; where a force grips is a point of the true segments.
"""

import numpy as np

from biodance.errors import UnknownName
from biodance.motion.kinematics import Poses, poses
from biodance.records import Array
from biodance.virtual_lab.choreography import septic
from biodance.virtual_lab.performance import Force, Performance
from biodance.virtual_lab.randomness import stream
from biodance.virtual_lab.skeleton import SEGMENTS

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
TOUCH, GRIP = 1.6, 0.25
"""s: how long a hand stays on a rail, and how long it takes to take the load and to leave it."""


def at_point(force: Array, point: Array) -> Array:
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
    return pose.points([SEGMENTS.index(segment)], np.array([place]))[:, 0]


def touches(time: Array, rng: np.random.Generator, *, every: float) -> Array:
    """Return (T,) 0..1: hands that come and go, one touch in every ``every`` s of a trial, at random times."""
    out = np.zeros_like(time)
    for start in np.arange(time[0], time[-1] - every + 1e-9, every):
        begin = start + rng.uniform(0.0, every - TOUCH)
        out += septic((time - begin) / GRIP) * septic((begin + TOUCH - time) / GRIP)
    return out


def external_contact(target: str, force: float) -> Force:
    """Touch a rail or be held by a helper: touches of ``force`` (N), mostly from below, at a part of the body; one in every 4 s."""

    def act(performance: Performance, time: Array) -> Array:
        rng = stream(performance.person.seed, "touch", target, performance.plan.name)
        direction = np.array([0.35 * rng.normal(), 0.35 * rng.normal(), 1.0])
        strength = force * touches(time, rng, every=4.0) * (performance.plan.role != "static")
        return at_point(strength[:, None] * direction / np.linalg.norm(direction), grip(target, true_poses(performance, time)))

    return act


def body_weight_support(target: str, force: float, stiffness: float) -> Force:
    """Hang a rope from the ceiling to a harness at the pelvis: ``force`` (N) when standing, ``stiffness`` (N/m) as the person goes down."""

    def act(performance: Performance, time: Array) -> Array:
        if performance.plan.role == "static":
            return np.zeros((time.size, 6))
        point = grip("pelvis", true_poses(performance, time))
        away = np.array([*np.mean(list(performance.stance.pressure.values()), axis=0), CEILING]) - point
        length = np.linalg.norm(away, axis=1)
        tension = np.maximum(force + stiffness * (length - length[0]), 0.0)
        return at_point((tension / length)[:, None] * away, point)

    return act


def slack_harness(target: str, stiffness: float) -> Force:
    """Hang a safety rope that is loose until the hips are 5 cm down, then pulls with the square of its stretch (N = stiffness m²)."""

    def act(performance: Performance, time: Array) -> Array:
        point = grip("trunk_head", true_poses(performance, time))
        away = np.array([*np.mean(list(performance.stance.pressure.values()), axis=0), CEILING]) - point
        length = np.linalg.norm(away, axis=1)
        stretch = np.maximum(length - length[0] - 0.05, 0.0)
        return at_point((stiffness * stretch**2 / length)[:, None] * away, point)

    return act


def table_edge(target: str, force: float) -> Force:
    """Let the right thigh run against furniture: short horizontal pushes of ``force`` (N), one in every 2 s, of either sign."""

    def act(performance: Performance, time: Array) -> Array:
        rng = stream(performance.person.seed, "table", performance.plan.name)
        strength = np.zeros_like(time)
        for start in np.arange(time[0], time[-1] - 2.0, 2.0):
            begin = start + rng.uniform(0.0, 1.4)
            strength += rng.choice([-1.0, 1.0]) * force * np.sin(np.pi * np.clip((time - begin) / 0.6, 0.0, 1.0)) ** 2
        return at_point(strength[:, None] * np.array([0.8, 0.6, 0.0]), grip("right_thigh", true_poses(performance, time)))

    return act


def spinning_wheel(target: str, momentum: float) -> Force:
    """Carry a wheel that spins in a rucksack about the right-left axis of the chest: its angular ``momentum`` (N·m·s) resists turning."""

    def act(performance: Performance, time: Array) -> Array:
        turn = true_poses(performance, time).rotation[:, SEGMENTS.index("thorax")]
        spin = momentum * turn[:, :, 2]
        return np.concatenate([np.zeros((time.size, 3)), -np.gradient(spin, time, axis=0)], axis=1)

    return act
