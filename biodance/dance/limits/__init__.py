"""FAMILY: one constraint of a dance per file, found automatically; others come as objects or by the entry points
``biodance.limits``. With them a motion as the check of every limit sees it, nothing of the design's coordinates; what
is left of a limit; and a copy by somebody imprecise, as what a limit demands of such people sees it.

A member is a frozen dataclass that derives from `Limit`, given as ``LIMIT`` by its file: its numbers are fields
(``[limits.friction] mu = 0.4`` in a protocol), ``margins`` is for the optimiser, ``check`` judges the finished motion
by other code. Design, verification, refusal and report go through the family and know no name;
`tests/test_dance_limits.py` holds every member to its contract.
"""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import GRAVITY, rigid_inertia
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State
from biodance.discovery import Family
from biodance.errors import BiodanceError, refuse_unknown
from biodance.motion.dynamics import distribute, joint_torques, predict_wrench
from biodance.motion.kinematics import Poses, poses
from biodance.records import SIDES, Array, Motion, Wrench, assign

FAR = 2.0
"""Scales from its limit beyond which the slopes of a margin do not count."""


@dataclass(frozen=True, eq=False)
class Margins:
    """``value`` (T, m) >= 0 where the limit holds; ``slopes`` (k, T, m, n) by x, v, a in this order, k = 1, 2 or 3 as
    far as needed.

    Columns that are further than ``FAR`` scales from their limit in all samples may have slopes of zero.
    """

    value: Array
    slopes: Array


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
        # Centres of mass of the segments, lab frame.
        centre = pose.position + np.einsum("tnij,nj->tni", pose.rotation, sip.com)
        # a - g: what the ground must give per kg.
        pull, change = np.broadcast_to(-np.array(GRAVITY), centre.shape), np.zeros_like(centre)
        if not self.still:
            step, turn, acceleration, spin = (
                float(self.time[1] - self.time[0]),
                pose.rotation,
                *np.zeros((2, *centre.shape)),
            )
            # Second central difference.
            acceleration[1:-1] = (centre[2:] - 2 * centre[1:-1] + centre[:-2]) / step**2
            # angular velocity from the rotation over two steps; the change of I w is the moment about the centre
            spin[1:-1] = _vector(turn[2:] @ np.swapaxes(turn[:-2], -1, -2)) / (2 * step)
            own = np.array([rigid_inertia(sip.of(name)).inertia for name in self.body.segments])
            # I_lab = R I R'.
            inertia = turn @ own @ np.swapaxes(turn, -1, -2)
            pull = pull + acceleration
            change = np.asarray(np.gradient((inertia @ spin[..., None])[..., 0], step, axis=0))
        # Newton and Euler about the lab origin: sum of c x m (a - g) + d(I w)/dt.
        moment = (np.cross(centre, sip.mass[:, None] * pull) + change).sum(axis=1)
        force = (sip.mass[:, None] * pull).sum(axis=1)
        # Where the moment has no horizontal part.
        return np.asarray(np.stack([-moment[:, 1], moment[:, 0]], axis=1) / force[:, 2:])


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


def bounded(default: float, low: float, high: float, unit: str = "", *, imprecise: bool = False) -> Any:
    """Return a number of a limit: its ``default`` and the legal range from ``low`` to ``high`` in ``unit``;
    ``imprecise`` True where it says what imprecise people must keep (`Limit.for_imprecise`), and nothing else.
    """
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "imprecise": imprecise})


@dataclass(frozen=True)
class Limit(ABC):
    """One constraint of a dance. A member's numbers are its fields (`bounded`), so that a protocol can set them.

    ``name`` that of its file; ``unit`` of its margins; ``scale`` a noticeable amount in that unit. ``at_rest``,
    ``in_motion`` whether held postures and moves must keep it. ``suspicion``: where no posture is possible, limits are
    left out one after the other, the smallest number first, until there would be one; that one is named. ``rounding``
    what the check forgives. ``move_reserve`` least share of the scale that is kept in reserve while a move is designed;
    ``tapers`` True where this reserve ends with the move, because it begins and ends at the limit.
    ``mended_by_slowness`` True where a move that breaks the limit may keep it if it takes longer.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    scale: ClassVar[float]
    at_rest: ClassVar[bool] = True
    in_motion: ClassVar[bool] = True
    suspicion: ClassVar[int] = 0
    rounding: ClassVar[float] = 0.0
    move_reserve: ClassVar[float] = 0.0
    tapers: ClassVar[bool] = False
    mended_by_slowness: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for one in fields(self):
            value, legal = getattr(self, one.name), one.metadata
            if legal and not legal["low"] <= value <= legal["high"]:
                said = f"limits.{self.name}.{one.name} = {value:g} {legal['unit']}".rstrip()
                raise BiodanceError(f"{said}; legal are {legal['low']:g} to {legal['high']:g}.")

    @abstractmethod
    def margins(self, state: State) -> Margins:
        """Return what is left in every sample of ``state``, with exact slopes: for the optimiser."""

    @abstractmethod
    def check(self, motion: CheckedMotion) -> Remaining:
        """Return what is left in every sample of ``motion``, by code that shares nothing with `margins`: to judge."""

    def hold_reserve(self, stance: Stance) -> float:
        """Return the share of the scale that a held posture keeps in reserve for the moves that begin and end there."""
        return 0.06

    def straight_reserve(self, stance: Stance) -> float:
        """Return what `hold_reserve` does where the moves to and from the posture go straight."""
        return self.hold_reserve(stance)

    def for_imprecise(self) -> ForImprecise | None:
        """Return what people who copy a dance imprecisely must keep of this limit; None where that is their own affair,
        as where they stop at the end of a joint's range.
        """
        return None

    def eased(self, angles: dict[str, float]) -> dict[str, float]:
        """Return joint ``angles`` (rad, by the joint's name) of a known posture of a limb as near to them as this limit
        lets them be; those of a limit that says nothing of limbs, as they are.
        """
        return angles

    def resized(self, length: float) -> "Limit":
        """Return the limit of a body that is ``length`` times as large: its numbers in m grow with it."""
        other = copy(self)
        for one in fields(self):
            if one.metadata.get("unit") == "m":
                assign(other, **{one.name: length * getattr(self, one.name)})
        return other

    @property
    def support_share(self) -> float:
        """Share of every half width of the base of support that this limit leaves; stances are laid out for it."""
        return 1.0


def unconcerned(state: State) -> Margins:
    """Return the margins of a limit that has nothing to say about ``state``: no columns."""
    return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))


def lacking(candidate: object) -> tuple[str, ...]:
    """Return what an object or class lacks to be a limit."""
    kind = candidate if isinstance(candidate, type) else type(candidate)
    if not issubclass(kind, Limit):
        return ("the base class Limit",)
    lacks = [name for name in ("name", "unit", "scale") if not hasattr(kind, name)]
    return (*lacks, *(sorted(getattr(kind, "__abstractmethods__", ())) if inspect.isabstract(kind) else ()))


FAMILY: Family[Limit | type[Limit]] = Family(
    "limit of a dance", "biodance.limits", __name__, "LIMIT", lacking, lambda kind: kind.name
)


def family() -> tuple[Limit, ...]:
    """Return all limits of the folder and of other packages with their usual numbers, by name.

    Raises
    ------
    BiodanceError
        A file of the folder or an entry point is no limit; the sentence says which and what to do.
    """
    return join_limits(FAMILY.members().values(), ())


def join_limits(limits: Iterable[Limit | type[Limit]], more: Iterable[Limit | type[Limit]]) -> tuple[Limit, ...]:
    """Return ``limits`` and ``more``, objects or classes, by name; where a name is in both, the one of ``more``.

    Raises
    ------
    BiodanceError
        One of ``more`` is no limit.
    """
    found: dict[str, Limit] = {}
    for one in (*limits, *more):
        if lacks := lacking(one):
            raise BiodanceError(
                f"{one!r}: lacks {', '.join(lacks)}, so it is no limit of a dance. See biodance.dance.limits.Limit."
            )
        found[one.name] = one() if isinstance(one, type) else one
    return tuple(found[name] for name in sorted(found))


def limits_with(numbers: Mapping[str, Mapping[str, float]], *, where: str) -> tuple[Limit, ...]:
    """Return the family with other ``numbers`` (limit -> field -> value), found ``where``.

    Raises
    ------
    UnknownName
        There is no such limit, or it has no such number; the message lists the legal ones.
    BiodanceError
        A number is outside its legal range.
    """
    usual = {limit.name: limit for limit in family()}
    for name, given in numbers.items():
        refuse_unknown(f"limit in {where}", name, usual)
        legal = tuple(one.name for one in fields(usual[name]))
        for key in given:
            refuse_unknown(f"number of limits.{name} in {where}", key, legal)
    return tuple(replace(limit, **numbers.get(name, {})) for name, limit in usual.items())
