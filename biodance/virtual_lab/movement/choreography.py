"""From steps to smooth curves: every quantity of a posture over time, with the inaccuracy of a person who follows a
video.

Moves are septic rest-to-rest polynomials (velocity, acceleration and jerk vanish at both ends); a foot rises only after
the weight has left it and takes weight only after it has landed.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from biodance.records import SIDES, Array
from biodance.virtual_lab.movement.protocol import FIELDS, STAND, ProtocolPosture, ProtocolStep, TrialPlan
from biodance.virtual_lab.tolerances import smooth_noise

_ENDS = np.cumsum([0, *map(len, FIELDS.values())]).tolist()
COLUMNS = {name: slice(*pair) for name, pair in zip(FIELDS, pairwise(_ENDS), strict=True)}
SHIFT, RAISED = COLUMNS["shift"].start, _ENDS[-1]
WIDTH = RAISED + len(SIDES)
EXACT = ("lean", "shift")
"""Fields that are the balance of the trial, not a matter of how well a posture was copied."""
WEIGHT_FIRST = 0.45
"""Fraction of a move in which the weight goes over before a foot rises (or that is left for it after landing)."""


@dataclass(frozen=True, eq=False)
class Curves:
    """``time`` (T,) s; ``values`` (T, WIDTH): the fields of a posture side by side (degrees, m, shares), then how far
    each foot is raised (0..1).
    """

    time: Array
    values: Array

    def __getitem__(self, name: str) -> Array:
        """Return the columns (T, k) of one field."""
        return self.values[:, COLUMNS[name]]

    def raised(self, side: str) -> Array:
        """Return (T,) 0 = planted exactly, 1 = free."""
        return self.values[:, RAISED + SIDES.index(side)]


def septic(x: Array) -> Array:
    """Return the rest-to-rest polynomial 35x⁴ - 84x⁵ + 70x⁶ - 20x⁷ with x clipped to 0..1."""
    x = np.clip(x, 0.0, 1.0)
    return x**4 * (35 + x * (-84 + x * (70 - 20 * x)))


def _there_and_back(time: Array, step: ProtocolStep) -> Array:
    """Return (T,) 0..1 of a step in cycles: a cosine whose pace rises and falls smoothly over one period."""
    x, count = time / step.period, step.cycles
    fine = np.linspace(0.0, count + 1.0, 400 * (count + 1) + 1)
    pace = septic(fine) * septic(count + 1.0 - fine)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(fine))])
    from scipy.interpolate import CubicSpline

    turned = CubicSpline(fine, phase * count / phase[-1])(np.clip(x, 0.0, count + 1.0))
    return 0.5 - 0.5 * np.cos(2 * np.pi * turned)


def _target(posture: ProtocolPosture, rng: np.random.Generator, sloppiness: float) -> Array:
    """Return the values (WIDTH,) of a posture as this person does it this time."""
    target = np.zeros(WIDTH)
    for name, value in posture.values.items():
        stand = np.array(STAND.values[name])
        done = (np.array(value) - stand) * (1.0 + sloppiness * rng.normal(size=len(value)))
        target[COLUMNS[name]] = value if name in EXACT else stand + done
    target[RAISED:] = [side in posture.raised for side in SIDES]
    return target


def _windows(
    previous: Array, target: Array, move: float, rng: np.random.Generator, sloppiness: float
) -> tuple[Array, Array]:
    """Return start and duration (WIDTH,) s of every column's move within a step."""
    late = np.minimum(np.abs(2.0 * sloppiness * rng.normal(size=WIDTH)), 0.3) * move
    start, duration = late, move - late
    for foot in (RAISED, RAISED + 1):
        rises = target[foot] > previous[foot]
        if rises or target[foot] < previous[foot]:
            start[[SHIFT, foot]] = (0.0, WEIGHT_FIRST * move) if rises else ((1 - WEIGHT_FIRST) * move, 0.0)
            duration[[SHIFT, foot]] = WEIGHT_FIRST * move, (1 - WEIGHT_FIRST) * move
    return start, duration


def _hidden_leg(previous: Array, target: Array) -> None:
    """Let the angles of a raised foot stand still while they do not count: before it rises and after it lands."""
    for side, foot in zip(SIDES, (RAISED, RAISED + 1), strict=True):
        columns = COLUMNS[f"{side}_leg"]
        if not previous[foot]:
            previous[columns] = target[columns]
        elif not target[foot]:
            target[columns] = previous[columns]


def choreograph(plan: TrialPlan, time: Array, rng: np.random.Generator, *, sloppiness: float) -> Curves:
    """Return the curves of one trial at ``time`` (T,) s; 0 is the start of the recording.

    ``sloppiness`` is the relative error of amplitudes and of timing with which the person copies the postures.
    """
    start, now = plan.lead, _target(STAND, rng, sloppiness)
    values = np.tile(now, (time.size, 1))
    for step in plan.steps:
        target = _target(step.to, rng, sloppiness)
        before = now.copy()
        _hidden_leg(before, target)
        values += np.where(time[:, None] >= start, before - now, 0.0)
        if step.cycles:
            depth = 1.0 + sloppiness * smooth_noise(rng, time, columns=1, cutoff=0.4)
            values += depth * _there_and_back(time - start, step)[:, None] * (target - before)
            now = before
        else:
            begin, duration = _windows(before, target, step.move, rng, sloppiness)
            values += septic((time[:, None] - start - begin) / duration) * (target - before)
            now = target
        start += step.duration
    return Curves(time, values)
