"""Perform a trial: the true motion and the true ground wrench of a virtual person, by pinocchio's own dynamics.

The path of the pelvis is what keeps the balance: the zero-moment point of the full body is brought to where the posture
asks for it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.parts import GRAVITY
from biodance.body.pinocchio_model import load_pinocchio
from biodance.records import Array, Motion, Wrench
from biodance.virtual_lab.movement.posing import (
    Curves,
    FootStance,
    Height,
    Pose,
    choreograph,
    pelvis_height,
    stand_on_feet,
    take_stance,
    upper_body,
)
from biodance.virtual_lab.movement.protocol import TrialPlan
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.tolerances import REALISTIC, LabTolerances, smooth_noise, stream

NODE_RATE = 100.0
"""Hz of the nodes of the motion's spline; the instruments sample the spline at their own rates."""
MARGIN = 0.1
"""s of motion before and after the recording, for late force samples."""
_ROUNDS = 12
"""Largest number of balance corrections; 5 to 8 suffice."""
SETTLED = 0.004
"""m: the balance is settled when the zero-moment point is everywhere this close to the place wanted."""


@dataclass(frozen=True, eq=False)
class Performance:
    """One trial as it truly happened: the motion is a quintic spline through ``nodes`` (T, 46) at ``node_time`` (T,) s.

    ``plan`` what was asked; ``stance`` where the feet stood; ``curves`` the postures; ``balance_error`` m: the farthest
    that the zero-moment point was from the place wanted. ``forces`` act on the person beside gravity and the ground: a
    hand on a rail, a rope.
    """

    plan: TrialPlan
    person: Person
    stance: FootStance
    curves: Curves
    node_time: Array
    nodes: Array
    balance_error: float = 0.0
    forces: "tuple[AppliedForce, ...]" = ()

    @cached_property
    def _splines(self) -> tuple[Any, Any, Any]:
        return _splines(self.node_time, self.nodes)

    def motion(self, time: Array) -> Motion:
        """Return the true q, v, a at ``time`` (T,) s, of the true body with its 16 segments."""
        return _motion(self._splines, time)

    @cached_property
    def _wrench_spline(self) -> Any:
        from scipy.interpolate import make_interp_spline

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
        share = self.share_right(time)[:, None]
        pressure, stance = wrench.cop(threshold=1.0), self.stance
        middle = share * stance.pressure["right"] + (1 - share) * stance.pressure["left"]
        weight = share if side == "right" else 1 - share
        place = np.zeros_like(pressure)
        place[:, :2] = stance.pressure[side] + pressure[:, :2] - middle
        twist = wrench.moment - np.cross(pressure, wrench.force)
        return np.concatenate([weight * wrench.force, weight * (np.cross(place, wrench.force) + twist)], axis=1)

    def share_right(self, time: Array) -> Array:
        """Return the share (T,) of the weight on the right foot."""
        return np.clip(np.interp(time, self.curves.time, self.curves["shift"][:, 0]), 0.0, 1.0)


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
    curves = choreograph(plan, time, rng, sloppiness=tolerances.performance)
    stance = take_stance(person, plan.stance, centre, heading, rng)
    pose = upper_body(person, curves, stance, tolerances, rng)
    target = wanted_pressure(curves, stance) + tolerances.sway * smooth_noise(rng, time, columns=2, cutoff=0.5)
    nodes, error = keep_balance(person, pose, curves, stance, target)
    return Performance(plan, person, stance, curves, time, nodes, error)


def wanted_pressure(curves: Curves, stance: FootStance) -> Array:
    """Return where the centre of pressure should be (T, 2) m: between the feet by share of weight, plus lean."""
    right = curves["shift"]
    forward, sideways = curves["lean"][:, :1], curves["lean"][:, 1:]
    ahead = np.array([np.cos(stance.heading), np.sin(stance.heading)])
    rightwards = np.array([np.sin(stance.heading), -np.cos(stance.heading)])
    middle = right * stance.pressure["right"] + (1 - right) * stance.pressure["left"]
    return middle + forward * ahead + sideways * rightwards


def keep_balance(
    person: Person, pose: Pose, curves: Curves, stance: FootStance, target: Array, *, height: Height = pelvis_height
) -> tuple[Array, float]:
    """Return the configurations (T, 46) whose zero-moment point follows ``target`` (T, 2) m, and the largest distance
    left, m.

    Each round moves the pelvis by the bounded solution of  d - h d'' = -(error), the linear pendulum with h = height of
    the centre of mass over (g + its vertical acceleration); the legs, the arms' momentum and all else are in the error.
    """
    time = curves.time
    xy = target.copy()
    q = stand_on_feet(person, pose, curves, stance, xy, height=height)
    for _ in range(_ROUNDS):
        motion = _motion(_splines(time, q), time)
        value = true_wrench(person, motion).value
        vertical = value[:, 2]
        error = np.stack([-value[:, 4], value[:, 3]], axis=1) / vertical[:, None] - target
        if np.abs(error).max() < SETTLED:
            break
        pendulum = person.mass * 0.56 * person.subject.stature / vertical
        xy = xy - 0.95 * _without_ripple(_pendulum(error, pendulum, 1.0 / NODE_RATE))
        q = stand_on_feet(person, pose, curves, stance, xy, height=height)
    return q, float(np.abs(error).max())


def _pendulum(right: Array, h: Array, step: float) -> Array:
    """Solve d - h d'' = right (T, 2) for d with d' = 0 at both ends; ``h`` (T,) s², ``step`` s."""
    from scipy.linalg import solve_banded

    k = h / step**2
    bands = np.stack([np.roll(-k, 1), 1 + 2 * k, np.roll(-k, -1)])
    bands[0, 1], bands[2, -2] = -2 * k[0], -2 * k[-1]
    return solve_banded((1, 1), bands, right)


def _without_ripple(path: Array) -> Array:
    """Return a path (T, 2) without what alternates from node to node: 50 Hz, which rounds would build up and a plate
    would show as hum.

    Cubics pass unchanged.
    """
    from scipy.ndimage import correlate1d

    return np.asarray(correlate1d(path, np.array([-1.0, 4.0, 10.0, 4.0, -1.0]) / 16.0, axis=0, mode="nearest"))


def _splines(time: Array, q: Array) -> tuple[Any, Any, Any]:
    """Return the quintic spline through q and its first two derivatives."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(time, q, k=5)
    return spline, spline.derivative(1), spline.derivative(2)


def motion_through(node_time: Array, nodes: Array, time: Array) -> Motion:
    """Return the motion at ``time`` (T,) s of the quintic spline through ``nodes`` (N, 46) at ``node_time`` (N,) s."""
    return _motion(_splines(node_time, nodes), time)


def _motion(splines: tuple[Any, Any, Any], time: Array) -> Motion:
    """Return the motion of splines through [position, quaternion, angles]; velocities of the root in its own frame."""
    value, rate, rate2 = (spline(time) for spline in splines)
    norm = np.linalg.norm(value[:, 3:7], axis=1, keepdims=True)
    quaternion = value[:, 3:7] / norm
    turn = np.swapaxes(Rotation.from_quat(quaternion).as_matrix(), 1, 2)
    angular = _twice_conjugate_times(quaternion, rate[:, 3:7] / norm)
    angular_rate = _twice_conjugate_times(quaternion, rate2[:, 3:7] / norm)
    linear = np.einsum("tij,tj->ti", turn, rate[:, :3])
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
    root = np.array([pin.rnea(model, data, q, v, a)[:6] for q, v, a in zip(motion.q, motion.v, motion.a, strict=True)])
    turn = Rotation.from_quat(motion.q[:, 3:7]).as_matrix()
    force, moment = np.einsum("tij,tj->ti", turn, root[:, :3]), np.einsum("tij,tj->ti", turn, root[:, 3:])
    return Wrench(motion.time, np.concatenate([force, moment + np.cross(motion.q[:, :3], force)], axis=1))
