"""What is left of balance and room when imprecise people dance a dance: copies of it, degrees off in every joint, late
and early, swaying.

A performer's joints err by smooth noise and the tempo wanders. Whoever stands corrects: the pelvis keeps the centre of
mass where the dance has it, but for the sway; what hurried or crooked limbs do to the zero-moment point is not
corrected. Planted feet stay where they are, and a leg errs the more the farther it is lifted. A step by which a foot
changes its place is everybody's own and not judged. The virtual laboratory performs dances by other code.
"""

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from biodance.body.body import Body
from biodance.body.inertia import rigid_inertia
from biodance.body.parts import GRAVITY, UPRIGHT
from biodance.body.pinocchio_model import load_pinocchio
from biodance.dance.dance import Dance, Phase
from biodance.dance.limits.self_collision import surface_distances
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.stance import Stance
from biodance.dance.verify import Margin
from biodance.motion.kinematics import Poses, poses
from biodance.records import Array
from biodance.threads import one_thread

SEGMENT_GAP = 0.02
"""m that segments of imprecise performers stay apart."""
OF_PERFORMERS = "of_performers"
"""End of the names of their margins."""
PERFORMER_COUNT = 200
"""Performers that a dance is tried on."""
_RATE, _PLAN_RATE = 5.0, 25.0
"""Hz at which performances are judged, and the plan is laid out."""
_WANDER, _TEMPO, _SWAY = 0.25, 0.2, 0.5
"""Hz: how fast errors, tempo and sway change."""
_STRAIGHT, _SOFT = float(np.radians(5.0)), 80.0
"""rad of a knee that counts as straight; 1/m of the soft minimum over the legs."""
_PENDULUM = 0.1
"""s²: height of the centre of mass over gravity."""
_LIFT = 1.0
"""Share of a move in which a foot leaves the ground, or comes back."""
_ROUNDS = 2
"""Corrections of the pelvis; what is left is a tenth of a millimetre a degree."""
_CARRIED = 0.85
"""m that the centre of mass goes when the pelvis goes 1 m over planted feet."""


@dataclass(frozen=True)
class Imprecision:
    """How badly people copy: ``tracking`` rad root mean square of every joint's error, ``pelvis`` the share of it that
    the pelvis' turns have, ``pace`` times the planned duration, ``timing`` root mean square of the tempo's wandering,
    ``sway`` m root mean square of the centre of pressure. The usual values are those of a restless performer.
    """

    tracking: float = float(np.radians(7.0))
    pelvis: float = 0.4
    pace: float = 1.2
    timing: float = 0.2
    sway: float = 0.006


@dataclass(frozen=True)
class Room:
    """The least room that performers left: ``worst`` m (negative: none), the ``posture`` (index) to or in which, the
    pair or support ``what``, and ``failing``, the share of performers without enough.
    """

    worst: float
    posture: int
    what: str
    failing: float


@dataclass(frozen=True)
class Rehearsed:
    """What ``count`` imprecise performers leave: ``balance`` of the zero-moment point inside the whole support,
    ``gap`` between segments; ``bad`` postures (indices) at which somebody had too little.
    """

    count: int
    balance: Room
    gap: Room
    bad: tuple[int, ...]

    def margins(self, dance: Dance) -> tuple[Margin, ...]:
        """Return what the performers leave as margins of a dance: inside the support, and beyond `SEGMENT_GAP`."""
        starts = {phase.posture: phase.start for phase in reversed(dance.phases)}
        rooms = (("balance", self.balance, 0.0), ("self_collision", self.gap, SEGMENT_GAP))
        return tuple(
            Margin(f"{name}_{OF_PERFORMERS}", room.worst - need, starts[room.posture], "m", room.what)
            for name, room, need in rooms
        )

    @property
    def safe(self) -> bool:
        """True where nobody leaves the support or comes closer than `SEGMENT_GAP` to themselves."""
        return self.balance.worst >= 0 and self.gap.worst >= SEGMENT_GAP


@one_thread()
def rehearse_imprecisely(
    dance: Dance, *, count: int = PERFORMER_COUNT, seed: int = 0, first: int = 0, how: Imprecision = Imprecision()
) -> Rehearsed:
    """Return what ``count`` performers leave of the room in ``dance``; performer number k from ``first`` on is the same
    whoever else dances.
    """
    plan, postures = _Planned(dance), len(dance.postures)
    found: dict[str, list[_Least]] = {"balance": [], "gap": []}
    for k in range(first, first + count):
        time, when = _clock(np.random.default_rng([seed, 7, k]), dance.duration, how)
        x, rows = plan.copied(np.random.default_rng([seed, 8, k]), time, when, how)
        pose = poses(dance.body, dance.chain.motion(time, x, *np.zeros((2, *x.shape))).q)
        inside, posture = plan.inside(rows, _zero_moment_point(dance, pose, time))[2:-2], plan.posture[rows]
        where = plan.names[rows[2 + int(inside.argmin())]]
        found["balance"].append(_Least.of(inside, posture[2:-2], postures, where))
        gap, pairs = surface_distances(dance.body, pose)
        gap[plan.stepping[rows]] = np.inf
        pair = pairs[int(gap.min(axis=0).argmin())]
        found["gap"].append(_Least.of(gap.min(axis=1), posture, postures, pair))
    return _joined(count, found)


def perform_with(workers: Executor, dance: Dance, *, count: int = PERFORMER_COUNT, seed: int = 0) -> Rehearsed:
    """Return what `rehearse_imprecisely` does, found by two ``workers`` side by side."""
    half = count // 2
    tasks = [
        workers.submit(rehearse_imprecisely, dance, count=n, seed=seed, first=f)
        for n, f in ((half, 0), (count - half, half))
    ]
    parts = [task.result() for task in tasks]
    count = sum(part.count for part in parts)

    def together(rooms: list[Room]) -> Room:
        failing = sum(part.count * room.failing for part, room in zip(parts, rooms, strict=True)) / count
        return replace(min(rooms, key=lambda room: room.worst), failing=failing)

    balance, gap = together([part.balance for part in parts]), together([part.gap for part in parts])
    return Rehearsed(count, balance, gap, tuple(sorted({p for part in parts for p in part.bad})))


def _joined(count: int, parts: dict[str, list["_Least"]]) -> Rehearsed:
    """Return the worst of all performers, for the zero-moment point and for the segments."""
    bad = set[int]()

    def worst_of(found: list["_Least"], need: float) -> Room:
        worst = min(found, key=lambda one: one.room)
        bad.update(int(p) for one in found for p in np.flatnonzero(one.each < need))
        return Room(worst.room, worst.posture, worst.what, float(np.mean([one.room < need for one in found])))

    balance, gap = parts.values()
    return Rehearsed(count, worst_of(balance, 0.0), worst_of(gap, SEGMENT_GAP), tuple(sorted(bad)))


@dataclass(frozen=True, eq=False)
class _Least:
    """The least ``room`` m of one performer, at which ``posture``, of ``what``; ``each`` (P,) that of every posture."""

    room: float
    posture: int
    what: str
    each: Array

    @classmethod
    def of(cls, left: Array, posture: NDArray[np.intp], count: int, what: str) -> "_Least":
        """Return the least of ``left`` (T,) m, on the way to and in each ``posture`` (T,) of ``count``."""
        each, worst = np.full(count, np.inf), int(left.argmin())
        np.minimum.at(each, posture, left)
        return cls(float(left[worst]), int(posture[worst]), what, each)


def _clock(rng: np.random.Generator, duration: float, how: Imprecision) -> tuple[Array, Array]:
    """Return instants (T,) s of a performance, and those of the plan (T,) s that belong to them."""
    time = np.arange(round(duration * how.pace * _RATE) + 1) / _RATE
    tempo = np.exp(how.timing * _noise(rng, time, 1, _TEMPO)[:, 0])
    done = np.concatenate([[0.0], np.cumsum((tempo[1:] + tempo[:-1]) / 2)])
    return time, duration * done / done[-1]


def _noise(rng: np.random.Generator, time: Array, columns: int, cutoff: float, *, slow: float = 0.0) -> Array:
    """Return smooth random curves (T, columns) of unit standard deviation, whose amplitudes fall with exp(-(f /
    cutoff)²); ``slow`` s²: divided by 1 + slow (2 pi f)², as the mass of a pendulum moves when its support sways.
    """
    duration = 1.3 * (time[-1] - time[0]) + 1.0
    frequency = np.arange(1, int(np.ceil(2.5 * cutoff * duration)) + 1) / duration
    weight = np.exp(-((frequency / cutoff) ** 2))
    weight /= np.sqrt(np.sum(weight**2)) * (1 + slow * (2 * np.pi * frequency) ** 2)
    cosine, sine = rng.normal(size=(2, frequency.size, columns)) * weight[None, :, None]
    phase = 2 * np.pi * np.outer(time, frequency)
    return np.asarray(np.cos(phase) @ cosine + np.sin(phase) @ sine)


class _Planned:
    """The dance laid out in time: coordinates, place of the centre of mass and of the pelvis, feet of the phases."""

    def __init__(self, dance: Dance) -> None:
        self.dance, self.chain, phases = dance, dance.chain, dance.phases
        self.start, self.end = (np.array([getattr(phase, name) for phase in phases]) for name in ("start", "end"))
        self.posture = np.array([phase.posture for phase in phases])
        self.names = [phase.stance.name for phase in phases]
        self.edges = [replace(phase.stance, over=None).reduced(1.0) for phase in phases]
        before = [dance.stances[max(0, phase.posture - (phase.kind == "move"))] for phase in phases]
        after = [dance.stances[phase.posture] for phase in phases]
        self.down = np.array(
            [[_planted(s) for s in row] for row in zip(before, (p.stance for p in phases), after, strict=True)]
        )
        self.ankles = np.array([[s.ankle for s in row] for row in zip(before, after, strict=True)])
        self.stepping = np.ptp(self.ankles, axis=1).any(axis=(1, 2))
        time = np.unique(np.concatenate([_instants(phase) for phase in phases]))
        rows, x = self.phase_at(time), np.empty((len(time), self.chain.size))
        for p, phase in enumerate(phases):
            x[rows == p] = dance.state(phase, time[rows == p]).x
        up, ankle = self._feet(rows, time)
        over = x[:, 2] - self._tops(x, up, ankle)
        self.spline = CubicSpline(time, np.column_stack([x, mass_centre(self.chain, x)[:, :2], over]))

    def phase_at(self, when: Array) -> NDArray[np.intp]:
        """Return the phase (T,) at instants of the plan."""
        return np.asarray(np.clip(np.searchsorted(self.start, when + 1e-9, side="right") - 1, 0, None))

    def inside(self, rows: NDArray[np.intp], point: Array) -> Array:
        """Return how far inside the whole support of its phase each point (T, 2) m is; not asked during steps."""
        out = np.full(len(rows), np.inf)
        for p in np.unique(rows[~self.stepping[rows]]):
            normals, offsets = self.edges[p]
            out[rows == p] = (point[rows == p] @ normals.T + offsets).min(axis=1)
        return out

    def _feet(self, rows: NDArray[np.intp], when: Array) -> tuple[Array, Array]:
        """Return how far each foot is up (T, 2), 0 on the ground to 1, and where its ankle stands if it does (T, 2, 3)
        m.
        """
        way = ((when - self.start[rows]) / np.maximum(self.end[rows] - self.start[rows], 1e-9))[:, None]
        before, during, after = np.moveaxis(self.down[rows], 1, 0)
        rise = np.where(before, _eased(way / _LIFT), 1.0) * np.where(after, _eased((1 - way) / _LIFT), 1.0)
        ankle = np.where(way[..., None] < 0.5, self.ankles[rows, 0], self.ankles[rows, 1])
        return np.where(during, 0.0, rise), ankle

    def _tops(self, x: Array, up: Array, ankle: Array) -> Array:
        """Return the height (T,) m of the pelvis at which planted legs are nearly straight; a foot that is up gives
        way.
        """
        turn, tops = self.chain.root_rotation(x), []
        for side in (0, 1):
            leg = self.chain.legs[side]
            hip, reach = turn @ leg.hip, float(leg.length(_STRAIGHT))
            across = np.sum((x[:, :2] + hip[:, :2] - ankle[:, side, :2]) ** 2, axis=1)
            tops.append(ankle[:, side, 2] + np.sqrt(np.maximum(reach**2 - across, 0.01)) - hip[:, 2] + up[:, side])
        return np.asarray(-np.log(np.exp(-_SOFT * np.array(tops)).sum(axis=0)) / _SOFT)

    def copied(
        self, rng: np.random.Generator, time: Array, when: Array, how: Imprecision
    ) -> tuple[Array, NDArray[np.intp]]:
        """Return the coordinates (T, n) of a performance at ``time`` s, and the phase of the plan at every instant."""
        chain, rows = self.chain, self.phase_at(when)
        told = self.spline(when)
        x, com, over = told[:, : chain.size], told[:, chain.size : chain.size + 2], told[:, -1]
        error = how.tracking * _noise(rng, time, chain.size - 3, _WANDER)
        if self.dance.stances[0].seat:
            x[:, ROOT:] += error[:, 3:]
            return x, rows
        x[:, 3:ROOT] += how.pelvis * error[:, :3]
        x[:, ROOT:] += error[:, 3:]
        com = com + how.sway * _noise(rng, time, 2, _SWAY, slow=_PENDULUM)
        (up, ankle), wanted = self._feet(rows, when), x.copy()
        for k in range(_ROUNDS + 1):
            x[:, 2] = self._tops(x, up, ankle) + over
            x = self._standing(x, wanted, up, ankle)
            if k < _ROUNDS:
                x[:, :2] += (com - mass_centre(chain, x)[:, :2]) / _CARRIED
        return x, rows

    def _standing(self, x: Array, wanted: Array, up: Array, ankle: Array) -> Array:
        """Return x (T, n) with legs that hold their feet, as far as these are not up; then they do as ``wanted``."""
        out, turn = x.copy(), self.chain.root_rotation(x)
        flat = np.broadcast_to(UPRIGHT, turn.shape)
        for side, columns in enumerate(self.chain.leg_columns):
            held = self.chain.legs[side].solve(turn, x[:, :3], flat, ankle[:, side])
            out[:, columns] = held + up[:, side, None] * (wanted[:, columns] - held)
        return out


def _planted(stance: Stance) -> list[bool]:
    return [side in stance.planted for side in (0, 1)]


def _eased(way: Array) -> Array:
    s = np.clip(way, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def _instants(phase: Phase) -> Array:
    count = max(2, round((phase.end - phase.start) * _PLAN_RATE))
    return np.round(np.linspace(phase.start, phase.end, count, endpoint=False), 9)


def mass_centre(chain: Chain, x: Array) -> Array:
    """Return the centre of mass (S, 3) m of coordinates (S, n), lab frame."""
    pin = load_pinocchio()
    return np.array([pin.centerOfMass(chain.model, chain.data, row) for row in x]).reshape(-1, 3)


def _zero_moment_point(dance: Dance, pose: Poses, time: Array) -> Array:
    """Return the zero-moment point (T, 2) m on the ground of poses at equal intervals, by differences; at both ends
    they are those of their neighbours.
    """
    sip, step = dance.body.sip, float(time[1] - time[0])
    centre = pose.position + np.einsum("tnij,nj->tni", pose.rotation, sip.com)
    pull = sip.mass[:, None] * (_second(centre, step) - np.array(GRAVITY))
    spin = np.zeros_like(centre)
    spin[1:-1] = _vector(pose.rotation[2:] @ np.swapaxes(pose.rotation[:-2], -1, -2)) / (2 * step)
    inertia = pose.rotation @ _inertias(dance.body) @ np.swapaxes(pose.rotation, -1, -2)
    change = np.gradient((inertia @ spin[..., None])[..., 0], step, axis=0)
    moment, force = (np.cross(centre, pull) + change).sum(axis=1), pull.sum(axis=1)
    return np.asarray(np.stack([-moment[:, 1], moment[:, 0]], axis=1) / force[:, 2:])


def _inertias(body: Body) -> Array:
    """Return the inertias (N, 3, 3) kg·m² of the segments about their centres of mass, in their own frames."""
    return np.array([rigid_inertia(body.sip.of(name)).inertia for name in body.segments])


def _second(values: Array, step: float) -> Array:
    out = np.zeros_like(values)
    out[1:-1] = (values[2:] - 2 * values[1:-1] + values[:-2]) / step**2
    return out


def _vector(turn: Array) -> Array:
    """Return the rotation vectors of small rotations (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*turn.shape[:-2], 3)
