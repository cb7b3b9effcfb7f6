"""What a finished dance is, in numbers: its criteria, posture by posture and move by move, and where its zero-moment
point goes.

Counted again from the dance alone, so that the numbers hold for every dance, however it was made.
"""

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.excitation import (
    condition,
    dynamic_grams,
    excitation_blocks,
    static_grams,
    total,
    uprights,
)
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import Stance
from biodance.dance.search.move import straight_via
from biodance.records import Array

_RATE = 50.0
"""Hz, of the paper's transitions."""
_LITTLE = 0.01
"""rad²/s³: information on every inertia supposed before the first move, so that condition numbers are finite."""
POOR = 30.0
"""Condition number above which a segment was hardly tilted: gravity does not tell where along it the mass is."""


@dataclass(frozen=True, eq=False)
class ZmpPath:
    """The zero-moment point of one move, m, lab frame: ``straight`` (T, 2) on the straight way between the same
    postures, ``designed`` (T, 2) in the dance; ``stance`` the feet; ``move`` its index.
    """

    move: int
    stance: Stance
    straight: Array
    designed: Array


@dataclass(frozen=True, eq=False)
class DanceMetrics:
    """``static`` sum of w_i M_i cond(W_bi^S) of the postures that count, kg, ``dynamic`` (K,) sum of w_i M_i
    cond(W_bi^D) after each move, kg; ``static_bound``, ``dynamic_bound`` kg: what they would be if every condition
    number were 1; ``hardly`` the segments whose static condition number is above ``POOR``; ``paths`` (K) of the
    zero-moment point.
    """

    static: float
    static_bound: float
    dynamic: Array
    dynamic_bound: float
    hardly: tuple[str, ...]
    paths: tuple[ZmpPath, ...]


def longest_alone(dance: Dance) -> float:
    """Return for how long, s, a foot is up at most before it comes down again; 0 where nobody stands on one leg."""
    runs = groupby(dance.phases, lambda phase: phase.stance.planted)
    return max((sum(phase.end - phase.start for phase in run) for feet, run in runs if len(feet) == 1), default=0.0)


def dance_metrics(dance: Dance, plan: Plan) -> DanceMetrics:
    """Return the numbers of ``dance``; the weights of the segments are those of ``plan``, on top of their masses."""
    parts = excitation_blocks(dance.body)
    weight = parts.weight * plan.emphasis(dance.body.segments)
    holds = [phase for phase in dance.phases if phase.kind == "hold" and phase.stance.over is None]
    ups = np.concatenate([uprights(dance.state(phase, np.array([phase.start]))) for phase in holds])
    every = list(range(len(dance.body.segments)))
    grams = static_grams(ups)
    static, _ = total(weight, grams, parts.first)
    blocks = {i: grams[i][np.ix_(parts.first[i], parts.first[i])] for i in every if parts.first[i] and weight[i] > 0}
    poor = [i for i, block in blocks.items() if condition(block)[0] > POOR]
    gram = np.tile(_LITTLE * np.eye(6), (len(every), 1, 1))
    straight = replace(dance, via=straight_via(dance.postures[:-1], dance.postures[1:]))
    dynamic, paths = [], []
    for phase in (phase for phase in dance.phases if phase.kind == "move"):
        time = np.linspace(phase.start, phase.end, round((phase.end - phase.start) * _RATE) + 1)
        state = dance.state(phase, time)
        gram = gram + dynamic_grams(state, every) / _RATE
        dynamic.append(total(weight, gram, parts.second)[0])
        paths.append(ZmpPath(phase.posture - 1, phase.stance, straight.state(phase, time).zmp, state.zmp))
    pairs = (zip(weight, picks, strict=True) for picks in (parts.first, parts.second))
    first, second = (float(sum(w for w, pick in pair if pick)) for pair in pairs)
    hardly = tuple(dance.body.segments[i] for i in poor)
    return DanceMetrics(static, first, np.array(dynamic), second, hardly, tuple(paths))
