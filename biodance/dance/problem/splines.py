"""Sixth-order B-splines through via points, rest to rest (paper III.A, eq. 18).

A transition of duration D starts and ends with zero velocity and acceleration and passes through K via points at equal
distances in time. The spline is linear in its points, so a whole trajectory, its velocity and its acceleration are
constant matrices times the points.
"""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline

from biodance.dance.problem.stance import Stance
from biodance.errors import BiodanceError
from biodance.records import Array, Index, freeze

_DEGREE = 5  # Order six: continuous up to the fourth derivative
_THIRDS = np.array([0.20987654, 0.79012346])
"""Of the way at one and two thirds of the time, for least jerk (10 s³ - 15 s⁴ + 6 s⁵)."""


@dataclass(frozen=True, eq=False)
class Basis:
    """Sampled spline: ``time`` (n,) s; ``position``, ``velocity`` 1/s, ``acceleration`` 1/s² (n, K + 2) matrices that
    map the points [start, via 1 ... via K, end] of a joint to its samples.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        freeze(self, "Basis", **{one.name: (None,) * np.ndim(getattr(self, one.name)) for one in fields(self)})


def rest_to_rest(duration: float, *, via: int = 2, rate: float = 50.0) -> Basis:
    """Return the sampled basis of a rest-to-rest transition with ``via`` points; samples at ``rate`` Hz include both
    ends.

    Raises
    ------
    BiodanceError
        The duration or the rate is not positive, or there are fewer than two samples.
    """
    if duration <= 0 or rate <= 0 or duration * rate < 1:
        raise BiodanceError(
            f"A transition of {duration:g} s at {rate:g} Hz has no samples; give a longer duration or a higher rate."
        )
    time = np.linspace(0.0, duration, round(duration * rate) + 1)
    return basis_at(time, duration, via=via)


def basis_at(time: Array, duration: float, *, via: int = 2) -> Basis:
    """Return the basis of a rest-to-rest transition of ``duration`` s at instants ``time`` (n,) in [0, duration]."""
    count = via + 6  # two ends with position, velocity and acceleration each, and the via points
    # Clamped: the end knots come degree + 1 times, and count - degree - 1 lie between.
    inner = np.linspace(0, duration, count - _DEGREE + 1)[1:-1]
    knots = np.concatenate([np.zeros(_DEGREE + 1), inner, np.full(_DEGREE + 1, duration)])
    spline = BSpline(knots, np.eye(count), _DEGREE)
    stops = np.array([0.0, duration])
    through = np.linspace(0, duration, via + 2)
    # Values at all points, then first and second derivatives at both ends: as many as coefficients.
    conditions = np.concatenate([spline(through), spline(stops, nu=1), spline(stops, nu=2)])
    # Velocities and accelerations at the ends are zero: their columns of the inverse are not needed.
    coefficients = np.linalg.inv(conditions)[:, : via + 2]
    return Basis(time, *(spline(time, nu=nu) @ coefficients for nu in range(3)))


@dataclass(frozen=True)
class Phase:
    """A stretch of a dance from ``start`` to ``end`` s on the same feet; ``posture`` is held, or moved to."""

    start: float
    end: float
    kind: Literal["hold", "move"]
    stance: Stance
    posture: int


def phase_at(phases: tuple[Phase, ...], time: Array) -> Index:
    """Return which of the ``phases`` every instant (T,) s lies in."""
    starts = np.array([phase.start for phase in phases])
    return np.clip(np.searchsorted(starts, time + 1e-9, side="right") - 1, 0, None)


def straight_via(start: Array, end: Array) -> Array:
    """Return the via points (..., 2, n) of the moves of least jerk from ``start`` to ``end`` (..., n)."""
    return np.asarray(start[..., None, :] + _THIRDS[:, None] * (end - start)[..., None, :])


def path_in(phase: Phase, postures: Array, via: Array, time: Array) -> tuple[Array, Array, Array]:
    """Return coordinates (T, n) and their derivatives at instants ``time`` s of a ``phase`` of a dance through
    ``postures`` (P, n) and, between them, the points ``via`` (P - 1, 2, n); planted legs do not hold their feet yet.
    """
    if phase.kind == "hold":
        x = np.repeat(postures[None, phase.posture], len(time), axis=0)
        return x, np.zeros_like(x), np.zeros_like(x)
    move = phase.posture - 1
    points = np.stack([postures[move], *via[move], postures[move + 1]])
    basis = basis_at(np.clip(time - phase.start, 0.0, phase.end - phase.start), phase.end - phase.start)
    return basis.position @ points, basis.velocity @ points, basis.acceleration @ points
