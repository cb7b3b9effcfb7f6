"""A person who walks or runs on a belt: where each foot is, which force it takes and where, and the one stride that
these forces make of the body, found by repetition and repeated through the trial. Axes: x ahead, y left, z up; the belt
moves backwards under a person who stays at the origin.

Translation: the centre of mass moves as the sum of the forces says (a parabola in flight). Rotation: pelvis and trunk
turn so that the angular momentum of the whole body about its centre of mass follows the forces' moment (constant in
flight). Arms, spine and feet move as they are told; the legs follow from the feet.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from biodance.body.body import load_pinocchio
from biodance.body.parts import GRAVITY, UPRIGHT
from biodance.errors import BiodanceError
from biodance.motion.ik.compiled.legs import Leg
from biodance.records import SIDES, Array, Wrench
from biodance.virtual_lab.movement import GAITS, STAND, Gait, TrialPlan
from biodance.virtual_lab.movement.performance import MARGIN, Performance, motion_along
from biodance.virtual_lab.movement.posing import WIDTH, Curves, Z, septic, take_stance, turn_about, without_jumps
from biodance.virtual_lab.person import Person
from biodance.virtual_lab.person.skeleton import REALISTIC, LabTolerances, stream

G = float(np.linalg.norm(GRAVITY))
HEEL, TOE = -0.27, 0.73
"""Ends of the sole from the ankle, in lengths of the sole."""
_ROLL = {0.0: -0.19, 0.07: -0.03, 0.2: 0.16, 0.45: 0.36, 0.86: 0.62, 1.0: 0.70}
"""Where the centre of pressure is at shares of the stance, in lengths of the sole from the ankle: fast over the heel,
slow under the ball (medians of 45 recorded steps, docs/benchmarks/diagnosis.md, between them smooth)."""
_UNDER = 0.37  # The same where it is under the body, half-way through the stance
_LANDS, _STOPPED, _LIGHT = 0.3, 0.022, (0.15, 0.03)
"""m/s at which a heel comes down; s in which its pad stops it; share of the vertical force that is there after so many
s: ground and heel meet at one instant, which force and marker both show (within 5 ms in 42 recorded steps)."""


@dataclass(frozen=True, eq=False)
class Aim:
    """The point over the belt at which the ground forces aim: ``height`` m, and ahead and to the left (N, 2) m at
    ``sway`` N even instants of one ``period`` s.
    """

    height: float
    period: float
    sway: Array

    def at(self, time: Array) -> Array:
        """Return the point (T, 3) m at ``time`` (T,) s."""
        # Fourier coefficients of a real periodic curve; those beyond the mean stand for a pair of frequencies.
        spectrum = np.fft.rfft(self.sway, axis=0)[: 6 + 1] / len(self.sway)
        wave = np.exp(2j * np.pi * np.outer(time / self.period, np.arange(len(spectrum))))
        wave[:, 1:] *= 2
        return np.column_stack([(wave @ spectrum).real, np.full(time.size, self.height)])


@dataclass(frozen=True)
class BeltFoot:
    """One foot on the belt: its ``side``, ``length`` m of the sole, ``height`` m of the ankle, ``out`` rad of the toes,
    ``lead`` m by which it lands farther ahead than its centre of pressure's middle under the body.
    """

    side: str
    length: float
    height: float
    out: float
    lead: float = 0.0

    @property
    def sign(self) -> float:
        """Of y: the right foot is at negative y."""
        return -1.0 if self.side == "right" else 1.0

    def pressure(self, gait: Gait, time: Array) -> Array:
        """Return where (T, 3) m the foot presses; in swing where it last did or will."""
        s = np.clip(gait.since_strike(time, self.side) / gait.contact, 0.0, 1.0)
        along, middle = self.length * _roll(s), self.length * _UNDER
        back = -gait.speed * gait.contact * (s - 0.5)
        # The belt carries the foot back, from half its way ahead to half behind.
        x = self.lead + back + (along - middle) * np.cos(self.out)
        y = self.sign * (0.5 * gait.width + along * np.sin(self.out))
        return np.stack([x, y, 0.0 * x], axis=1)

    def force(self, gait: Gait, time: Array, mass: float, aim: Aim) -> Array:
        """Return the ground's force (T, 3) N on the foot: smooth, zero in swing, towards the point of ``aim``."""
        s = gait.since_strike(time, self.side) / gait.contact
        # Two feet share the weight: each one's impulse over a stride is half of m G times the stride.
        stance = np.linspace(0.0, 1.0, 4001)
        mean = float(np.trapezoid(_pulse(gait, stance), stance))
        vertical = 0.5 * gait.stride * mass * G / (gait.contact * mean) * _pulse(gait, s)
        # Force along (aim - pressure), its vertical part as prescribed.
        return vertical[:, None] * (aim.at(time) - self.pressure(gait, time)) / aim.height

    def path(self, gait: Gait, time: Array) -> tuple[Array, Array]:
        """Return the ankle (T, 3) m and the pitch (T,) rad of the foot, toes up positive."""
        t = gait.since_strike(time, self.side)
        s, on = t / gait.contact, t <= gait.contact
        pitch, x, z = _rolling(self, gait, np.minimum(s, 1.0))
        ends = [_end(self, gait, at) for at in (1.0, 0.0)]
        swing = gait.stride - gait.contact
        u = np.clip((t - gait.contact) / swing, 0.0, 1.0)
        # u³ (1 - u)³ has its top 1/64 in the middle, and no rate or second rate at the ends.
        bump = gait.clearance * 64 * u**3 * (1 - u) ** 3
        moved = [_hermite(u, swing, [end[k] for end in ends]) for k in range(3)]
        pitch, x, z = (np.where(on, a, b) for a, b in zip((pitch, x, z), (*moved[:2], moved[2] + bump), strict=True))
        return np.stack([x * np.cos(self.out), self.sign * (0.5 * gait.width + 0 * x), z], axis=1), pitch


def _roll(s: Array) -> Array:
    """Return where (T,) the centre of pressure is at shares ``s`` (T,) of the stance, in lengths of the sole."""
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator([*_ROLL], [*_ROLL.values()])(s))


def _pulse(gait: Gait, s: Array) -> Array:
    """Return the shape (T,) of the vertical force over the stance ``s`` (T,): zero outside 0..1, C² at the ends."""
    on = (s > 0) & (s < 1)
    s = np.clip(s, 0.0, 1.0)
    if gait.dip == 0:
        return np.where(on, np.sin(np.pi * s) ** 2, 0.0)
    rise = 1.2 * (1 - 0.5 / gait.stance)
    share, quick = _LIGHT[0], _LIGHT[1] / gait.contact
    # Slow and quick rise in their shares, at the beginning and mirrored at the end.
    grows, falls = ((1 - share) * septic(x / rise) + share * septic(x / quick) for x in (s, 1 - s))
    return np.where(on, grows * falls * (1 - gait.dip * np.cos(4 * np.pi * (s - 0.5))), 0.0)


def _rolling(foot: BeltFoot, gait: Gait, s: Array) -> tuple[Array, Array, Array]:
    """Return pitch (T,) rad, x and z (T,) m of the ankle in stance: over the heel, flat, over the toes on the belt."""
    first, last = gait.flat
    over = np.maximum(s - last, 0.0) / (1 - last)
    pitch = gait.strike * (1 - septic(s / first)) - gait.push * over**3 * (2 - over)
    end = np.where(pitch > 0, HEEL, TOE) * foot.length
    c, w = np.cos(pitch), np.sin(pitch)
    # The ankle at (-end, height) from the end of the sole that it turns about, turned by the pitch.
    x = end - end * c - foot.height * w
    pad = _hermite(
        np.clip(s * gait.contact / _STOPPED, 0.0, 1.0), _STOPPED, [(0.5 * _LANDS * _STOPPED, -_LANDS, 0.0), (0.0,) * 3]
    )
    z = -end * w + foot.height * c + pad
    middle = foot.length * _UNDER
    return pitch, foot.lead - middle - gait.speed * gait.contact * (s - 0.5) + x, z


def _end(foot: BeltFoot, gait: Gait, at: float) -> list[tuple[float, float, float]]:
    """Return value, rate and second rate of pitch, x and z at the start (0) or the end (1) of stance."""
    step = 1e-3
    s = at + (1 - 2 * at) * step * np.arange(4.0)
    sign = (1 - 2 * at) / (step * gait.contact)
    out = []
    for curve in _rolling(foot, gait, s):
        a, b, c, d = curve
        # One-sided differences of third and second order over four points.
        rate = (-11 * a + 18 * b - 9 * c + 2 * d) / 6
        out.append((float(a), float(rate * sign), float((2 * a - 5 * b + 4 * c - d) * sign**2)))
    return out


def _hermite(u: Array, span: float, ends: list[tuple[float, float, float]]) -> Array:
    """Return the quintic (T,) over ``u`` 0..1 of ``span`` s with value, rate and second rate at both ``ends``."""
    (p0, v0, a0), (p1, v1, a1) = ((p, v * span, a * span**2) for p, v, a in ends)
    d, e, f = p1 - p0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
    # Horner: the coefficients of u³ to u⁵ solve for value, rate and second rate at u = 1.
    return p0 + u * (
        v0 + u * (a0 / 2 + u * (10 * d - 4 * e + f / 2 + u * (-15 * d + 7 * e - f + u * (6 * d - 3 * e + f / 2))))
    )


STRIDE_RATE = 200.0
"""Hz of the nodes of a stride."""
_ROUNDS, _LEARNED, _EASE = 300, 30, 0.5
"""Most rounds; rounds in which forces learn to aim; share of each correction that is made."""
_AIM = {False: 0.57, True: 0.75}
"""Of stature, height at which the ground forces aim: the centre of mass in walking, above it in running (Maus et al.
2010, doi:10.1038/ncomms1073)."""
_PAD = 12  # Nodes of the strides before and after with which a stride's derivatives are taken
_LATERAL = np.array([0.0, -1.0, 0.0])
_TURNS = np.array([0.022, 0.022, 0.005])
"""Of mass times stature squared: about how much turns with the pelvis, per axis of the belt."""


@dataclass(frozen=True, eq=False)
class FoundStride:
    """One stride of a person on a belt, in the belt's axes.

    ``q`` (N, 46) nodes at `STRIDE_RATE`; ``aim`` of the ground forces; ``twist`` m, free moment per vertical force of
    both feet; ``missed`` N·m·s, angular momentum that the motion lacks of the one that the forces make.
    """

    q: Array
    aim: Aim
    twist: float
    missed: float


@dataclass(frozen=True, eq=False)
class _Problem:
    person: Person
    gait: Gait
    feet: tuple[BeltFoot, ...]

    @cached_property
    def time(self) -> Array:
        """(N,) s of the nodes."""
        return np.arange(round(self.gait.stride * STRIDE_RATE)) / STRIDE_RATE

    def carried(self, aim: Aim) -> tuple[Array, Array]:
        """Return the total force (N, 3) N and its moment (N, 3) N·m about the belt's middle."""
        force = [foot.force(self.gait, self.time, self.person.mass, aim) for foot in self.feet]
        places = [foot.pressure(self.gait, self.time) for foot in self.feet]
        moment = [np.cross(place, one) for place, one in zip(places, force, strict=True)]
        return np.sum(force, axis=0), np.sum(moment, axis=0)

    def aimed(self, height: float, sway: Array) -> Aim:
        """Return the aim at ``height`` m whose forces push nobody ahead or aside in the mean."""
        force, _ = self.carried(Aim(height, self.gait.stride, sway))
        # An aim that lies s aside adds s V / height to the force: solved for no mean force.
        return Aim(height, self.gait.stride, sway - height * force[:, :2].mean(axis=0) / force[:, 2].mean())

    @cached_property
    def model(self) -> tuple[Any, Any]:
        """The loaded body's model in pinocchio, and its data."""
        model = self.person.loaded_body.model
        return model, model.createData()

    @cached_property
    def soles(self) -> dict[str, tuple[Array, Array]]:
        """Rotation (N, 3, 3) and ankle (N, 3) m of each foot."""
        out = {}
        for foot in self.feet:
            ankle, pitch = foot.path(self.gait, self.time)
            yaw = turn_about(np.array([0.0, 0.0, 1.0]), np.full(pitch.size, foot.sign * foot.out))
            out[foot.side] = yaw @ turn_about(_LATERAL, pitch) @ UPRIGHT, ankle
        return out

    def demanded(self, aim: Aim, height: float) -> tuple[Array, Array, float]:
        """Return the path of the centre of mass (N, 3) m, the angular momentum (N, 3) N·m·s about it (up to a
        constant) that the forces make, and the twist m, with the centre of mass at a mean ``height`` m.
        """
        force, moment = self.carried(aim)
        weight = self.person.mass * G
        # a = F / m - g, integrated twice over a period: what repeats has no drift.
        com = _integral(_integral(force / self.person.mass - [0.0, 0.0, G], self.gait.stride), self.gait.stride)
        com[:, 2] += height
        about = (moment - np.cross(com, force)).mean(axis=0) / weight
        # Moving the centre by d changes the mean moment by -d x weight: (-d_y, d_x) times the weight.
        com[:, :2] += np.array([-about[1], about[0]])
        rate = moment - np.cross(com, force)
        twist = -rate[:, 2].mean() / weight
        # A moment in proportion to the vertical force, so that none is left in the mean.
        rate[:, 2] += twist * force[:, 2]
        return com, _integral(rate, self.gait.stride), float(twist)

    def posed(self, upper: Array, root: Array, turned: Array) -> tuple[Array, float]:
        """Return the nodes (N, 46) with the pelvis at ``root`` (N, 3) m, ``turned`` (N, 3) rad, and by how much m the
        legs are too short.
        """
        body, q = self.person.body, upper.copy()
        turn = Rotation.from_rotvec(turned).as_matrix() @ UPRIGHT
        q[:, :3] = root
        q[:, 3:7] = Rotation.from_matrix(turn).as_quat()
        short = -np.inf
        for side, (foot, ankle) in self.soles.items():
            leg = Leg.of(body, side)
            away = np.linalg.norm(root + turn @ leg.hip - ankle, axis=1)
            short = max(short, float(np.max(away - leg.length(self.gait.knee))))
            q[:, [7 + column for column in leg.columns]] = leg.solve(turn, root, foot, ankle)
        return q, short

    def moved(self, q: Array) -> tuple[Array, Array]:
        """Return the centre of mass (N, 3) m and the angular momentum (N, 3) N·m·s about it of the nodes."""
        around = np.arange(-_PAD, len(q) + _PAD)
        # Nodes of the neighbouring strides, so that the spline's ends are far from this one.
        spline = make_interp_spline(around / STRIDE_RATE, q[np.mod(around, len(q))], k=5)
        motion = motion_along(spline, self.time)
        pin, (model, data) = load_pinocchio(), self.model
        centre, spin = np.empty((len(q), 3)), np.empty((len(q), 3))
        # Angular momentum about the centre of mass, lab axes.
        for k in range(len(q)):
            spin[k] = pin.computeCentroidalMomentum(model, data, motion.q[k], motion.v[k]).angular
            centre[k] = data.com[0]
        return centre, spin

    def upper(self) -> Array:
        """Return the nodes (N, 46) with arms, trunk and head as they are told."""
        body, gait, n = self.person.body, self.gait, self.time.size
        q = np.zeros((n, body.nq))
        angle: dict[str, Array | float] = dict(self.person.habits.angles)
        angle["lumbar_flexion"] += gait.lean
        swing = np.cos(2 * np.pi * self.time / gait.stride)
        for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
            _, adduction, rotation, _ = np.radians(STAND.values[f"{side}_arm"])
            angle |= {
                f"{side}_shoulder_flexion": sign * gait.arm * swing,
                f"{side}_shoulder_adduction": adduction,
                f"{side}_shoulder_rotation": rotation,
                f"{side}_elbow_flexion": gait.elbow * (1 + 0.15 * sign * swing),
            }
        for name, value in angle.items():
            q[:, 7 + body.joint_index(name)] = value
        return q


def find_stride(person: Person, gait: Gait, feet: tuple[BeltFoot, ...]) -> FoundStride:
    """Return the stride of ``person`` whose ``feet`` take the prescribed forces.

    In walking the forces first learn to aim so that the trunk neither nods nor rolls; then the pelvis turns by what
    is left. The legs are as long as the height of the centre of mass allows.

    Raises
    ------
    BiodanceError
        The repetition does not settle: no such motion was found for this person.
    """
    problem, learns = _Problem(person, gait, feet), gait.flight == 0
    upper, level = problem.upper(), 0.55 * person.subject.stature
    root, turned = np.tile([0.0, 0.0, level], (problem.time.size, 1)), np.zeros((problem.time.size, 3))
    height, sway = (_AIM[gait.flight > 0] * person.subject.stature), np.zeros((problem.time.size, 2))
    lever, missed, off = person.mass * person.subject.stature**2 * _TURNS, np.inf, np.inf
    for number in range(_ROUNDS):
        aim = problem.aimed(height, sway)
        com, spin, twist = problem.demanded(aim, level)
        q, short = problem.posed(upper, root, turned)
        centre, has = problem.moved(q)
        lacks = spin - has
        # Only up to a constant: a body that turns evenly has one, too.
        lacks = lacks - lacks.mean(axis=0)
        missed, off = float(np.abs(lacks).max()), float(np.abs(com - centre).max())
        if missed < 1e-3 and off < 1e-6 and abs(short) < 1e-3:  # N·m·s and m
            return FoundStride(q, aim, twist, missed)
        level, root = level - _EASE * short, root + _EASE * (com - centre)
        # Momentum over inertia is a rate; its integral the angle still to turn.
        step = _EASE * _integral(lacks / lever, gait.stride)
        if learns and number < _LEARNED:
            sway = sway + _EASE * _sway(lacks, problem.carried(aim)[0][:, 2], gait.stride, height / level)
            step[:, :2] = 0.0
        turned = turned + step
    raise BiodanceError(
        f"Gait {gait.name} at {gait.speed:.2f} m/s: no motion of this person was found that the ground forces carry "
        f"({missed:.3g} N·m·s of angular momentum, {off:.3g} m of the centre of mass left). Choose another seed or "
        f"speed."
    )


def _sway(lacks: Array, vertical: Array, period: float, lever: float) -> Array:
    """Return by how much (N, 2) m the forces must aim elsewhere to take off the angular momentum ``lacks`` (N, 3)."""
    spectrum = np.fft.rfft(lacks[:, :2], axis=0)
    # Derivative of a periodic curve: times i omega.
    spectrum *= 2j * np.pi * np.fft.rfftfreq(len(lacks), period / len(lacks))[:, None]
    rate = np.fft.irfft(spectrum, len(lacks), axis=0)
    # The forces make more than the motion has: their moment about the centre, (l F_y, -l F_x),
    # must fall by the rate.
    return np.asarray(lever * np.stack([rate[:, 1], -rate[:, 0]], axis=1) / vertical[:, None])


def _integral(rate: Array, period: float) -> Array:
    """Return the periodic integral (N, k) of ``rate`` (N, k) less its mean, of zero mean."""
    frequency = 2j * np.pi * np.fft.rfftfreq(len(rate), period / len(rate))
    spectrum = np.fft.rfft(rate, axis=0)
    spectrum[0] = 0.0
    # Integral: divided by i omega; the mean has none.
    return np.asarray(np.fft.irfft(spectrum / np.where(frequency == 0, 1, frequency)[:, None], len(rate), axis=0))


@dataclass(frozen=True, eq=False)
class GaitPerformance(Performance):
    """A trial on a belt: as `Performance`, its ground forces prescribed foot by foot.

    ``gait`` and ``feet`` (right, left) in the axes of the belt; ``stride`` that is repeated; ``balance_error`` N·m·s,
    angular momentum that the motion lacks.
    """

    gait: Gait = GAITS["walk"]
    feet: tuple[BeltFoot, ...] = ()
    stride: FoundStride = None  # type: ignore[assignment]

    def foot_wrench(self, time: Array, side: str) -> Array:
        """Return the true wrench (T, 6) about the lab origin under one foot, exactly zero while it is in the air."""
        asked = {foot.side: self._asked(foot, time) for foot in self.feet}
        total = np.sum([*asked.values()], axis=0)
        share = asked[side][:, 2:3] / np.maximum(total[:, 2:3], 1e-9)
        # What the motion needs beyond the prescribed forces, shared as the vertical ones.
        value = asked[side] + share * (self._wrench_spline(time) - total)
        return np.asarray(np.where(asked[side][:, 2:3] > 0, value, 0.0))

    def wrench(self, time: Array) -> Wrench:
        """Return the true ground wrench on the person about the lab origin, both feet together."""
        return Wrench(time, self.foot_wrench(time, "right") + self.foot_wrench(time, "left"))

    def _asked(self, foot: BeltFoot, time: Array) -> Array:
        """Return the prescribed wrench (T, 6) of one foot about the lab origin."""
        force = foot.force(self.gait, time, self.person.mass, self.stride.aim)
        moment = np.cross(foot.pressure(self.gait, time), force)
        moment[:, 2] += self.stride.twist * force[:, 2]
        turn = turn_about(Z, np.array([self.stance.heading]))[0]
        force, moment = force @ turn.T, moment @ turn.T
        # From the belt's middle to the lab's origin.
        return np.concatenate([force, moment + np.cross(self.middle, force)], axis=1)

    @cached_property
    def middle(self) -> Array:
        """(3,) m, where the belt's middle under the person lies in the laboratory."""
        return floor_between(self.stance.ankle)


def floor_between(ankle: dict[str, Array]) -> Array:
    """Return the place (3,) m on the floor between the ankles of a stance."""
    return np.array([*np.mean([ankle[side][:2] for side in SIDES], axis=0), 0.0])


def perform_gait(
    person: Person,
    plan: TrialPlan,
    session: int,
    *,
    tolerances: LabTolerances = REALISTIC,
    centre: Array,
    heading: float = 0.0,
) -> GaitPerformance:
    """Let ``person`` walk or run through a trial with the ``plan``'s gait at ``centre`` (2,) m, ``heading`` rad."""
    rng = stream(person.seed, "gait", str(session), plan.name)
    gait = _personal(GAITS[plan.gait], rng, tolerances, plan.speed, person.subject.stature)
    stance = take_stance(person, "parallel", centre, heading, rng)
    feet = tuple(
        BeltFoot(side, person.size["sole"], person.size["ankle_height"], out)
        for side, out in zip(SIDES, person.habits.toe_out, strict=True)
    )
    found = find_stride(person, gait, feet)
    index = np.arange(round((plan.duration + 2 * MARGIN) * STRIDE_RATE) + 1) - round(MARGIN * STRIDE_RATE)
    nodes, time = found.q[np.mod(index, len(found.q))].copy(), index / STRIDE_RATE
    turn = turn_about(Z, np.array([stance.heading]))[0]
    nodes[:, :3] = nodes[:, :3] @ turn.T + floor_between(stance.ankle)
    # R_lab,belt times the nodes' rotation.
    nodes[:, 3:7] = without_jumps((Rotation.from_matrix(turn) * Rotation.from_quat(nodes[:, 3:7])).as_quat())
    curves = Curves(time, np.zeros((time.size, WIDTH)))
    return GaitPerformance(plan, person, stance, curves, time, nodes, found.missed, gait=gait, feet=feet, stride=found)


def _personal(gait: Gait, rng: np.random.Generator, tolerances: LabTolerances, speed: float, stature: float) -> Gait:
    """Return the gait of this trial: in proportion to the ``stature``, all but the ``speed`` a little its own."""
    size = stature / 1.75  # m of the person whose gait is described by `GAITS`
    names = ("width", "strike", "push", "clearance", "arm", "elbow", "lean")
    own = {name: getattr(gait, name) * float(1 + tolerances.performance * rng.normal()) for name in names}
    own = {name: value * (size if name in ("width", "clearance") else 1) for name, value in own.items()}
    pace = np.sqrt(size) * float(1 + 0.3 * tolerances.performance * rng.normal())
    # Even number of nodes: the left foot strikes at one, too.
    stride = 2 * round(0.5 * gait.stride * pace * STRIDE_RATE) / STRIDE_RATE
    return replace(gait, speed=float(np.sqrt(size)) * (speed or gait.speed), stride=stride, **own)
