"""Gait cycles whose curves are given, as trials of a session."""

import numpy as np

from biodance.cycles import TrialMovement
from biodance.cycles.curves import CycleCurve
from biodance.cycles.cut import Cycle
from biodance.cycles.scores import SCORE_ANGLES
from biodance.cycles.strides import Stride
from biodance.cycles.summary import Repetitions, repetitions_of


def cycle(start: float, side: str = "right", *, trial: str = "walk") -> Cycle:
    """A gait cycle of 1 s with a stance of 60 %."""
    return Cycle(trial, "gait", side, start, start + 1.0, start + 0.6)


def curve(of: Cycle, value: np.ndarray | float, quantity: str = "knee_flexion", unit: str = "deg") -> CycleCurve:
    """A curve of its own side, without uncertainty."""
    return CycleCurve(of, quantity, of.side, unit, np.broadcast_to(value, 101).astype(float), np.full(101, np.nan))


def level_gait(of: Cycle, **angles: float) -> list[CycleCurve]:
    """All nine angles of a gait vector, constant; zero but for ``angles``."""
    return [curve(of, angles.get(name, 0.0), name) for name in SCORE_ANGLES]


def trial(name: str, curves: list[CycleCurve], *, shared: tuple[Cycle, ...] = ()) -> TrialMovement:
    """A trial with these curves and the cycles they are of, each a stride of 1.2 m/s."""
    cycles = tuple(dict.fromkeys(one.cycle for one in curves))
    strides = tuple(Stride(one, {"speed": 1.2, "cadence": 120.0}) for one in cycles)
    return TrialMovement(name, (), cycles, tuple(curves), strides, (np.empty(0), np.empty(0)), shared=shared)


def walked_knees(right: float, left: float, count: int = 4) -> Repetitions:
    """Walking with so many cycles of each side, whose knees bend by about so many degrees."""
    shape = np.sin(np.linspace(0, np.pi, 101))
    curves = [curve(cycle(k), (right + k) * shape) for k in range(count)]
    curves += [curve(cycle(k, "left"), (left + k) * shape) for k in range(count)]
    return repetitions_of("gait", [trial("walk", curves)])
