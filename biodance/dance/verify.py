"""Is the finished dance allowed? Judged instant by instant by code that its design did not use.

The design works in the coordinates of a chain, with its own closed-form forces, slopes and distances; here the dance is an ordinary Motion
of the body, forces come from the regressor, torques from pinocchio's inverse dynamics, distances between solids from coal, and the base of
support is drawn anew from where the soles really are.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from biodance.body.body import UPRIGHT, Body
from biodance.dance.dance import Dance
from biodance.dance.plan import Plan
from biodance.dance.shapes import palm
from biodance.dance.solid_distance import distances
from biodance.motion.dynamics import distribute, joint_torques, zmp
from biodance.motion.kinematics import Poses, poses
from biodance.motion.regressor import predict_wrench
from biodance.records import Array, Motion, Wrench

FRICTION = 0.5
STILL = 1e-6
"""m, rad: how far a planted foot may be from where it stands: rounding."""
TOUCH = 1e-9
"""m by which a sole that has just left the ground may be below it: rounding."""
STOOL = 0.03
"""m by which the knees of a seated person may hang below the hips."""
GRIP = 0.04
"""m by which the palm of a hand that holds a frame may move about the grip."""
EDGES = np.array([0.0025, 0.005])
"""s after the start and before the end of every move that are judged, too: there a foot has just left the ground or is about to return."""
JUMP = 1e-6
"""rad, rad/s, rad/s²: jumps of coordinates between phases: rounding."""


@dataclass(frozen=True)
class Margin:
    """What is left of one limit at its worst: ``worst`` in ``unit`` (negative: broken), at ``where_s`` s, of ``what`` (a joint, a pair)."""

    limit: str
    worst: float
    where_s: float
    unit: str
    what: str = ""


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A phase as a Motion, with what is needed to judge it; ``feet`` the planted ones, ``over`` the one that may be asked to bear all."""

    body: Body
    motion: Motion
    pose: Poses
    wrench: Wrench
    dance: Dance
    plan: Plan
    phase: int

    @property
    def planted(self) -> tuple[int, ...]:
        """Feet on the ground: 0 right, 1 left."""
        return self.dance.phases[self.phase].stance.planted

    def soles(self) -> tuple[Array, Array]:
        """Outlines (T, P, 3) m of the right and the left sole in the lab."""
        feet = (self.body.feet[side] for side in ("right", "left"))
        right, left = (self.pose.points([foot.segment] * len(foot.outline), foot.outline) for foot in feet)
        return right, left


def verify(body: Body, dance: Dance, plan: Plan, *, rate: float = 100.0, part: slice = slice(None)) -> tuple[Margin, ...]:
    """Return the margin of every limit over the whole dance, sampled at ``rate`` Hz, at the ends of all phases and close to them.

    ``body`` whose limits count (usually ``dance.body``); ``plan`` gives the share of the base of support that may be used; ``part`` only
    these phases.
    """
    stretches = _stretches(body, dance, plan, rate, range(len(dance.phases))[part])
    return _least([_continuity(dance), *(margin for stretch in stretches for margin in _margins(stretch))])


def verify_with(workers: Executor, body: Body, dance: Dance, plan: Plan) -> tuple[Margin, ...]:
    """Return what `verify` does, found by two ``workers`` side by side: one looks at every second phase, one at the others."""
    tasks = [workers.submit(verify, body, dance, plan, part=slice(first, None, 2)) for first in range(2)]
    return _least(margin for task in tasks for margin in task.result())


def _least(margins: Iterable[Margin]) -> tuple[Margin, ...]:
    """Return the worst margin of every limit, by name; of equal ones the first in time; one that is no number is the worst."""
    worst: dict[str, Margin] = {}
    for margin in sorted(margins, key=lambda one: (np.nan_to_num(one.worst, nan=-np.inf), one.where_s)):
        worst.setdefault(margin.limit, margin)
    return tuple(worst[name] for name in sorted(worst))


def _margins(stretch: _Stretch) -> Iterator[Margin]:
    """Yield the worst margin of every limit in one phase."""
    for limit, unit, value, what in _judge(stretch):
        if value.size:
            t, k = np.unravel_index(int(np.argmin(value)), value.shape)
            yield Margin(limit, float(value[t, k]), float(stretch.motion.time[t]), unit, what[k])


def broken(margins: tuple[Margin, ...]) -> tuple[Margin, ...]:
    """Return the margins that are negative."""
    return tuple(margin for margin in margins if not margin.worst >= 0)


def _stretches(body: Body, dance: Dance, plan: Plan, rate: float, chosen: range) -> Iterator[_Stretch]:
    for k, phase in ((k, dance.phases[k]) for k in chosen):
        inner = np.arange(np.ceil(phase.start * rate), np.floor(phase.end * rate) + 1) / rate
        instants = [phase.start, *(phase.start + EDGES), *inner, *(phase.end - EDGES), phase.end]
        time = np.unique(np.round(np.clip(instants, phase.start, phase.end), 9))
        time = time[:1] if phase.kind == "hold" else time  # nothing changes during a hold
        state = dance.state(phase, time)
        motion = dance.chain.motion(time, state.x, state.v, state.a)
        yield _Stretch(body, motion, poses(body, motion.q), predict_wrench(body, motion), dance, plan, k)


Judged = tuple[str, str, Array, list[str]]
"""Limit, unit, what is left (T, m), names (m)."""


def _judge(stretch: _Stretch) -> Iterator[Judged]:
    body, motion, limits = stretch.body, stretch.motion, stretch.body.limits
    joints, n = [joint.name for joint in body.joints], len(body.joints)
    angle = motion.q[:, -n:]
    yield "joint_range", "rad", np.minimum(angle - limits.lower, limits.upper - angle), joints
    yield "joint_speed", "rad/s", limits.velocity - np.abs(motion.v[:, -n:]), joints
    over = stretch.dance.phases[stretch.phase].stance.over
    for bearing in {stretch.planted, stretch.planted if over is None else (over,)}:
        torque = _torques(stretch, bearing)
        yield "joint_torque", "N m", np.minimum(torque - limits.torque_lower, limits.torque_upper - torque), joints
    force = stretch.wrench.force
    yield "friction", "N", FRICTION * force[:, 2:] - np.abs(force[:, :2]), ["forward", "sideways"]
    yield "balance", "m", _balance(stretch)[:, None], [stretch.dance.phases[stretch.phase].stance.name]
    yield _feet(stretch)
    yield _clearance(stretch)
    if stretch.dance.phases[stretch.phase].stance.seat:
        shanks = [body.segment_index(f"{side}_shank") for side in ("right", "left")]
        hips = stretch.dance.phases[stretch.phase].stance.seat
        yield "seat", "m", stretch.pose.position[:, shanks, 2] - hips + STOOL, ["right_knee", "left_knee"]
    held = stretch.dance.phases[stretch.phase].stance.hands
    for side in np.flatnonzero(np.isfinite(held[:, 0])):
        segment, local = palm(body, ("right", "left")[side])
        hand = stretch.pose.points([segment], local[None])[:, 0]
        yield "grip", "m", GRIP - np.linalg.norm(hand - held[side], axis=1)[:, None], [("right_hand", "left_hand")[side]]
    apart, pairs = distances(body, stretch.pose)
    yield "self_collision", "m", apart, pairs


def _torques(stretch: _Stretch, bearing: tuple[int, ...]) -> Array:
    touching = np.tile([side in bearing for side in (0, 1)], (stretch.motion.time.size, 1))
    loads = {}
    if bearing:
        right, left = (sole.mean(axis=1) for sole in stretch.soles())
        parts = distribute(stretch.wrench, right, left, touching)
        names = [stretch.body.segments[stretch.body.feet[side].segment] for side in ("right", "left")]
        loads = dict(zip(names, parts, strict=True))
    return joint_torques(stretch.body, stretch.motion, loads).torque


def _balance(stretch: _Stretch) -> Array:
    """Return how far (T,) m the zero-moment point is inside the reduced base of support, of every foot that may be asked to bear all."""
    stance, first = stretch.dance.phases[stretch.phase].stance, [sole[0, :, :2] for sole in stretch.soles()]
    point = zmp(stretch.wrench)[:, :2]
    bases = [stance.planted] + ([(stance.over,)] if stance.over is not None else [])
    return np.min(
        [_inside(point, np.concatenate([*(first[side] for side in base), stance.props]), stretch.plan.share) for base in bases], axis=0
    )


def _inside(point: Array, corners: Array, share: float) -> Array:
    """Return the distance (T,) m of points (T, 2) inside the hull of ``corners`` (K, 2), drawn together to ``share`` about its middle."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    normals, offsets = hull.equations[:, :2], hull.equations[:, 2]
    room = -(middle @ normals.T + offsets)  # from the middle to every edge
    return np.asarray((share * room - (point - middle) @ normals.T).min(axis=1))


def _feet(stretch: _Stretch) -> Judged:
    """Planted feet: flat, forward and where they stand."""
    stance, sides = stretch.dance.phases[stretch.phase].stance, list(stretch.planted)
    segments = [stretch.body.feet[("right", "left")[side]].segment for side in sides]
    moved = np.linalg.norm(stretch.pose.position[:, segments] - stance.ankle[sides], axis=2)
    turned = np.abs(stretch.pose.rotation[:, segments] - UPRIGHT).max(axis=(2, 3), initial=0.0)
    return "foot_placement", "m", STILL - np.maximum(moved, turned), [("right", "left")[side] for side in sides]


def _clearance(stretch: _Stretch) -> Judged:
    """Free feet: no corner of the sole below the ground."""
    sides = [side for side in (0, 1) if side not in stretch.planted]
    soles = stretch.soles()
    lowest = np.array([soles[side][:, :, 2].min(axis=1) for side in sides]).reshape(len(sides), len(soles[0])).T
    return "ground_clearance", "m", lowest + TOUCH, [("right", "left")[side] for side in sides]


def _continuity(dance: Dance) -> Margin:
    """Return what is left of the rounding that coordinates and their derivatives may jump by from phase to phase."""
    worst, where = np.inf, 0.0
    for before, after in zip(dance.phases[:-1], dance.phases[1:], strict=True):
        a, b = (dance.state(phase, np.array([before.end])) for phase in (before, after))
        jump = max(float(np.abs(getattr(a, name) - getattr(b, name)).max()) for name in ("x", "v", "a"))
        if JUMP - jump < worst:
            worst, where = JUMP - jump, before.end
    return Margin("continuity", worst, where, "rad")
