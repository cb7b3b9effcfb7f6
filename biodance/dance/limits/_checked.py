"""A motion as the check of every limit sees it, nothing of the design's coordinates; what is left of a limit; and a
copy by somebody imprecise, as what a limit demands of such people sees it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import GRAVITY, rigid_inertia
from biodance.dance.problem.stance import Stance, support_depth
from biodance.motion.dynamics import distribute, joint_torques, predict_wrench
from biodance.motion.kinematics import Poses, poses
from biodance.records import SIDES, Array, Motion, Wrench


@dataclass(frozen=True, eq=False)
class Remaining:
    """What is left of a limit: ``value`` (T, m) in its unit, negative if broken; ``of`` (m) joint, side or pair."""

    value: Array
    of: tuple[str, ...]


NOTHING = Remaining(np.empty((0, 0)), ())
"""Of a limit that has nothing to say about a motion."""


@dataclass(frozen=True, eq=False)
class CheckedMotion:
    """``motion`` of ``body`` on the feet of ``stance``, which do not change."""

    body: Body
    motion: Motion
    stance: Stance

    @cached_property
    def pose(self) -> Poses:
        """Where every segment is."""
        return poses(self.body, self.motion.q)

    @cached_property
    def wrench(self) -> Wrench:
        """What the motion needs from the ground, by the regressor."""
        return predict_wrench(self.body, self.motion)

    @cached_property
    def soles(self) -> tuple[Array, Array]:
        """Outlines (T, P, 3) m of the right and the left sole, lab frame, where they really are."""
        feet = (self.body.feet[side] for side in SIDES)
        right, left = (self.pose.points([foot.segment] * len(foot.outline), foot.outline) for foot in feet)
        return right, left

    @property
    def joints(self) -> tuple[str, ...]:
        """Names (n) of the joints."""
        return tuple(joint.name for joint in self.body.joints)

    @property
    def bases(self) -> tuple[tuple[int, ...], ...]:
        """Sets of feet (0 right, 1 left) each of which may be asked to bear everything."""
        return (self.stance.planted,) if self.stance.over is None else (self.stance.planted, (self.stance.over,))

    def torques(self, bearing: tuple[int, ...]) -> Array:
        """Return the joint torques (T, n) N·m, by pinocchio's inverse dynamics, when the feet ``bearing`` carry all."""
        touching = np.tile([side in bearing for side in (0, 1)], (self.motion.time.size, 1))
        loads = {}
        if bearing:
            right, left = (sole.mean(axis=1) for sole in self.soles)
            parts = distribute(self.wrench, right, left, touching)
            names = [self.body.segments[self.body.feet[side].segment] for side in SIDES]
            loads = dict(zip(names, parts, strict=True))
        return joint_torques(self.body, self.motion, loads).torque


@dataclass(frozen=True, eq=False)
class ImpreciseCopy:
    """A dance as somebody copied it: coordinates ``q`` (T, nq) of ``body`` at ``time`` (T,) s, at equal intervals; on
    the feet ``stances[on[t]]``. ``still`` True where the frames are held postures, and not one after the other.
    """

    body: Body
    time: Array
    q: Array
    stances: tuple[Stance, ...]
    on: NDArray[np.intp]
    still: bool = False

    @cached_property
    def pose(self) -> Poses:
        """Where every segment is."""
        return poses(self.body, self.q)

    @cached_property
    def zero_moment_point(self) -> Array:
        """(T, 2) m on the ground, by differences; at both ends and where the postures are held, of standing still."""
        sip, pose = self.body.sip, self.pose
        centre = pose.position + np.einsum("tnij,nj->tni", pose.rotation, sip.com)
        pull, change = np.broadcast_to(-np.array(GRAVITY), centre.shape), np.zeros_like(centre)
        if not self.still:
            step, turn, acceleration, spin = (
                float(self.time[1] - self.time[0]),
                pose.rotation,
                *np.zeros((2, *centre.shape)),
            )
            acceleration[1:-1] = (centre[2:] - 2 * centre[1:-1] + centre[:-2]) / step**2
            # angular velocity from the rotation over two steps; the change of I w is the moment about the centre
            spin[1:-1] = _vector(turn[2:] @ np.swapaxes(turn[:-2], -1, -2)) / (2 * step)
            own = np.array([rigid_inertia(sip.of(name)).inertia for name in self.body.segments])
            inertia = turn @ own @ np.swapaxes(turn, -1, -2)
            pull = pull + acceleration
            change = np.asarray(np.gradient((inertia @ spin[..., None])[..., 0], step, axis=0))
        moment = (np.cross(centre, sip.mass[:, None] * pull) + change).sum(axis=1)
        force = (sip.mass[:, None] * pull).sum(axis=1)
        return np.asarray(np.stack([-moment[:, 1], moment[:, 0]], axis=1) / force[:, 2:])

    def inside(self, share: float) -> Array:
        """Return how far (T,) m the zero-moment point lies inside the base of support of all feet on the ground, drawn
        together to ``share``.
        """
        return support_depth(self.stances, self.on, self.zero_moment_point, share)


@dataclass(frozen=True)
class ForImprecise:
    """What imprecise people must keep of a limit.

    ``left`` gives what a copy leaves, in the limit's unit, at least ``least`` of which is demanded; ``key`` is its name
    in results.json, ``words`` say what it is, after a number of cm.
    """

    left: Callable[[ImpreciseCopy], Remaining]
    least: float
    key: str
    words: str


def _vector(turn: Array) -> Array:
    """Return the rotation vectors of small rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*turn.shape[:-2], 3)


@dataclass(frozen=True)
class Margin:
    """What is left of one limit at its worst: ``worst`` in ``unit`` (negative: broken), at ``where_s`` s, of ``what``
    (a joint, a pair).
    """

    limit: str
    worst: float
    where_s: float
    unit: str
    what: str = ""
