"""The finished dance, judged by code that its design did not use: is it allowed, and what is it in numbers? It is an
ordinary Motion of the body, forces come from the regressor, torques from pinocchio's inverse dynamics, distances from
coal, and the base of support is drawn anew from where the soles really are.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.limits import NOTHING, CheckedMotion, Limit, Margin
from biodance.dance.problem import excitation
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import straight_via
from biodance.dance.problem.stance import Stance
from biodance.records import Array
from biodance.threads import one_thread

EDGES = np.array([0.0025, 0.005])
"""s after the start and before the end of moves that are judged, too: a foot has just left the ground or returns."""
JUMP = 1e-6
"""rad, rad/s, rad/s²: jumps of coordinates between phases: rounding."""


_RATE = 100.0  # Hz at which a dance is judged


@one_thread()
def verify(body: Body, dance: Dance, limits: tuple[Limit, ...], *, part: slice = slice(None)) -> tuple[Margin, ...]:
    """Return the margin of every limit over the whole dance, sampled at 100 Hz, at the ends of all phases and
    close to them.

    ``body`` whose limits count (usually ``dance.body``); ``limits`` with their numbers (`Plan.limits`); ``part`` only
    these phases.
    """
    chosen = range(len(dance.phases))[part]
    return _least([_continuity(dance), *(margin for k in chosen for margin in _margins(body, dance, limits, k))])


def verify_with(workers: Executor, body: Body, dance: Dance, limits: tuple[Limit, ...]) -> tuple[Margin, ...]:
    """Return what `verify` does, found by two ``workers``: one looks at every second phase, one at the others."""
    tasks = [workers.submit(verify, body, dance, limits, part=slice(first, None, 2)) for first in range(2)]
    return _least(margin for task in tasks for margin in task.result())


def _least(margins: Iterable[Margin]) -> tuple[Margin, ...]:
    """Return the worst margin of every limit, by name; of equal ones the first in time; no number is the worst."""
    worst: dict[str, Margin] = {}
    # NaN counts as the worst.
    for margin in sorted(margins, key=lambda one: (np.nan_to_num(one.worst, nan=-np.inf), one.where_s)):
        worst.setdefault(margin.limit, margin)
    return tuple(worst[name] for name in sorted(worst))


def _margins(body: Body, dance: Dance, limits: tuple[Limit, ...], number: int) -> Iterator[Margin]:
    """Yield the worst margin of every limit in one phase."""
    motion, held = _motion(body, dance, number), dance.phases[number].kind == "hold"
    for limit in limits:
        left = limit.check(motion) if (limit.at_rest if held else limit.in_motion) else NOTHING
        if left.value.size:
            t, k = np.unravel_index(int(np.argmin(left.value)), left.value.shape)
            # What the check forgives is added, so that zero is the edge.
            worst, where = float(left.value[t, k]) + limit.rounding, float(motion.motion.time[t])
            yield Margin(limit.name, worst, where, limit.unit, left.of[k])


def broken(margins: tuple[Margin, ...]) -> tuple[Margin, ...]:
    """Return the margins that are negative."""
    return tuple(margin for margin in margins if not margin.worst >= 0)


def _motion(body: Body, dance: Dance, number: int) -> CheckedMotion:
    """Return a phase as a Motion, sampled where it is judged."""
    phase = dance.phases[number]
    inner = np.arange(np.ceil(phase.start * _RATE), np.floor(phase.end * _RATE) + 1) / _RATE
    instants = [phase.start, *(phase.start + EDGES), *inner, *(phase.end - EDGES), phase.end]
    time = np.unique(np.round(np.clip(instants, phase.start, phase.end), 9))
    time = time[:1] if phase.kind == "hold" else time  # nothing changes during a hold
    state = dance.state(phase, time)
    return CheckedMotion(body, dance.chain.motion(time, state.x, state.v, state.a), phase.stance)


def _continuity(dance: Dance) -> Margin:
    """Return what is left of the rounding that coordinates and their derivatives may jump by from phase to phase."""
    worst, where = np.inf, 0.0
    for before, after in zip(dance.phases[:-1], dance.phases[1:], strict=True):
        a, b = (dance.state(phase, np.array([before.end])) for phase in (before, after))
        # Both phases at the instant where they meet.
        jump = max(float(np.abs(getattr(a, name) - getattr(b, name)).max()) for name in ("x", "v", "a"))
        if JUMP - jump < worst:
            worst, where = JUMP - jump, before.end
    return Margin("continuity", worst, where, "rad")


_PAPER_RATE = 50.0  # Hz, of the paper's transitions
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
    parts = excitation.excitation_blocks(dance.body)
    weight = parts.weight * plan.emphasis(dance.body.segments)
    holds = [phase for phase in dance.phases if phase.kind == "hold" and phase.stance.over is None]
    ups = np.concatenate([excitation.uprights(dance.state(phase, np.array([phase.start]))) for phase in holds])
    every = list(range(len(dance.body.segments)))
    grams = excitation.static_grams(ups)
    static, _ = excitation.total(weight, grams, parts.first)
    blocks = {i: grams[i][np.ix_(parts.first[i], parts.first[i])] for i in every if parts.first[i] and weight[i] > 0}
    poor = [i for i, block in blocks.items() if excitation.condition(block)[0] > POOR]
    # Grows from move to move.
    # rad²/s³: so much is supposed before, and no condition number is infinite
    gram = np.tile(0.01 * np.eye(6), (len(every), 1, 1))
    straight = replace(dance, via=straight_via(dance.postures[:-1], dance.postures[1:]))
    dynamic, paths = [], []
    for phase in (phase for phase in dance.phases if phase.kind == "move"):
        time = np.linspace(phase.start, phase.end, round((phase.end - phase.start) * _PAPER_RATE) + 1)
        state = dance.state(phase, time)
        gram = gram + excitation.dynamic_grams(state, every) / _PAPER_RATE
        dynamic.append(excitation.total(weight, gram, parts.second)[0])
        paths.append(ZmpPath(phase.posture - 1, phase.stance, straight.state(phase, time).zmp, state.zmp))
    pairs = (zip(weight, picks, strict=True) for picks in (parts.first, parts.second))
    first, second = (float(sum(w for w, pick in pair if pick)) for pair in pairs)
    hardly = tuple(dance.body.segments[i] for i in poor)
    return DanceMetrics(static, first, np.array(dynamic), second, hardly, tuple(paths))
