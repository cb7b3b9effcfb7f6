"""Is the finished dance allowed? Judged instant by instant by code that its design did not use.

The design works in the coordinates of a chain, with its own closed-form forces, slopes and distances; here the dance is
an ordinary Motion of the body, forces come from the regressor, torques from pinocchio's inverse dynamics, distances
between solids from coal, and the base of support is drawn anew from where the soles really are.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import Executor

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.limits import NOTHING, CheckedMotion, Limit
from biodance.dance.limits._checked import Margin as Margin
from biodance.threads import one_thread

EDGES = np.array([0.0025, 0.005])
"""s after the start and before the end of moves that are judged, too: a foot has just left the ground or returns."""
JUMP = 1e-6
"""rad, rad/s, rad/s²: jumps of coordinates between phases: rounding."""


_RATE = 100.0
"""Hz at which a dance is judged."""


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
        jump = max(float(np.abs(getattr(a, name) - getattr(b, name)).max()) for name in ("x", "v", "a"))
        if JUMP - jump < worst:
            worst, where = JUMP - jump, before.end
    return Margin("continuity", worst, where, "rad")
