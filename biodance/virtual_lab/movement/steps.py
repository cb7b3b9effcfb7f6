"""What the feet do on a belt: where each foot is, which force it takes and where, over one stride that repeats itself.

Axes here: x ahead, y to the left, z up; the belt moves backwards under a person who stays at the origin. Prescribed are
the forces; the body's motion follows from them (`gait`), so that nothing carries a runner in flight.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.parts import GRAVITY
from biodance.records import Array
from biodance.virtual_lab.movement.choreography import septic
from biodance.virtual_lab.movement.protocol import Gait

G = float(np.linalg.norm(GRAVITY))
HEEL, TOE = -0.27, 0.73
"""Ends of the sole from the ankle, in lengths of the sole."""
_ROLL = {0.0: -0.19, 0.07: -0.03, 0.2: 0.16, 0.45: 0.36, 0.86: 0.62, 1.0: 0.70}
"""Where the centre of pressure is at shares of the stance, in lengths of the sole from the ankle: fast over the heel,
slow under the ball (medians of 45 recorded steps, docs/benchmarks/diagnosis.md, between them smooth)."""
_UNDER = 0.37
"""The same where it is under the body, half-way through the stance."""
_LANDS, _PAD, _LIGHT = 0.3, 0.022, (0.15, 0.03)
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
        spectrum = np.fft.rfft(self.sway, axis=0)[: HARMONICS + 1] / len(self.sway)
        wave = np.exp(2j * np.pi * np.outer(time / self.period, np.arange(len(spectrum))))
        wave[:, 1:] *= 2
        return np.column_stack([(wave @ spectrum).real, np.full(time.size, self.height)])


HARMONICS = 6
"""Of the stride, in the sway of the point at which forces aim."""


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
        x = self.lead + back + (along - middle) * np.cos(self.out)
        y = self.sign * (0.5 * gait.width + along * np.sin(self.out))
        return np.stack([x, y, 0.0 * x], axis=1)

    def force(self, gait: Gait, time: Array, mass: float, aim: Aim) -> Array:
        """Return the ground's force (T, 3) N on the foot: smooth, zero in swing, towards the point of ``aim``."""
        s = gait.since_strike(time, self.side) / gait.contact
        vertical = 0.5 * gait.stride * mass * G / (gait.contact * _mean_pulse(gait)) * _pulse(gait, s)
        return vertical[:, None] * (aim.at(time) - self.pressure(gait, time)) / aim.height

    def path(self, gait: Gait, time: Array) -> tuple[Array, Array]:
        """Return the ankle (T, 3) m and the pitch (T,) rad of the foot, toes up positive."""
        t = gait.since_strike(time, self.side)
        s, on = t / gait.contact, t <= gait.contact
        pitch, x, z = _rolling(self, gait, np.minimum(s, 1.0))
        ends = [_end(self, gait, at) for at in (1.0, 0.0)]
        swing = gait.stride - gait.contact
        u = np.clip((t - gait.contact) / swing, 0.0, 1.0)
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
    grows, falls = ((1 - share) * septic(x / rise) + share * septic(x / quick) for x in (s, 1 - s))
    return np.where(on, grows * falls * (1 - gait.dip * np.cos(4 * np.pi * (s - 0.5))), 0.0)


def _mean_pulse(gait: Gait) -> float:
    s = np.linspace(0.0, 1.0, 4001)
    return float(np.trapezoid(_pulse(gait, s), s))


def _rolling(foot: BeltFoot, gait: Gait, s: Array) -> tuple[Array, Array, Array]:
    """Return pitch (T,) rad, x and z (T,) m of the ankle in stance: turning over the heel, flat, over the toes, while
    the belt carries it back.
    """
    first, last = gait.flat
    over = np.maximum(s - last, 0.0) / (1 - last)
    pitch = gait.strike * (1 - septic(s / first)) - gait.push * over**3 * (2 - over)
    end = np.where(pitch > 0, HEEL, TOE) * foot.length
    c, w = np.cos(pitch), np.sin(pitch)
    x = end - end * c - foot.height * w
    pad = _hermite(np.clip(s * gait.contact / _PAD, 0.0, 1.0), _PAD, [(0.5 * _LANDS * _PAD, -_LANDS, 0.0), (0.0,) * 3])
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
        rate = (-11 * a + 18 * b - 9 * c + 2 * d) / 6
        out.append((float(a), float(rate * sign), float((2 * a - 5 * b + 4 * c - d) * sign**2)))
    return out


def _hermite(u: Array, span: float, ends: list[tuple[float, float, float]]) -> Array:
    """Return the quintic (T,) over ``u`` 0..1 of ``span`` s with value, rate and second rate at both ``ends``."""
    (p0, v0, a0), (p1, v1, a1) = ((p, v * span, a * span**2) for p, v, a in ends)
    d, e, f = p1 - p0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
    return p0 + u * (
        v0 + u * (a0 / 2 + u * (10 * d - 4 * e + f / 2 + u * (-15 * d + 7 * e - f + u * (6 * d - 3 * e + f / 2))))
    )
