"""Movements on which every limit of a dance is judged twice: by its margins (the optimiser's) and by its check (the
judge's).
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from biodance.body.human.human import human
from biodance.dance.limits import CheckedMotion
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.stance import Stance, holding, seat, stance
from biodance.dance.problem.state import State, close_legs
from biodance.dance.search.postures import initial_guess
from biodance.records import Array, Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)
_BOWS = 2 * 9
"""Of as many movements one bows until the hands come to the floor: every second one on two feet side by side."""


@cache
def feet() -> tuple[Stance, ...]:
    """Return all kinds of stances: two feet, steps, one foot, the weight over one, hands on a frame, a stool."""
    both, ahead = stance(BODY, "parallel", share=0.6), stance(BODY, "right_forward", right=0.2, share=0.6)
    held = holding(both, BODY, ("right", "left"))
    return (
        both,
        ahead,
        both.on(0),
        both.on(1),
        replace(ahead, over=0),
        replace(both, over=1),
        held,
        held.on(0),
        seat(BODY),
    )


@cache
def movements(count: int, *, seed: int = 0) -> tuple[tuple[State, CheckedMotion], ...]:
    """Return ``count`` random movements of 3 samples each, gentle and violent ones, on all kinds of feet in turn, for
    both sides.

    Some bow to the floor. Planted knees are bent by 8.2 degrees (less bends the reach of the closed legs) to 70, palms
    are up to about 6 cm from grips; nobody jumps (100 N on the ground at least).
    """
    return tuple((state, checked(state)) for state in _movements(count, seed))


def _movements(count: int, seed: int) -> Iterator[State]:
    rng, found = np.random.default_rng(seed), 0
    while found < count:
        where, violence = feet()[found % len(feet())], 10.0 ** rng.uniform(-1.5, 0.5)
        x = initial_guess(CHAIN, where, rng) + rng.normal(0.0, 0.02, (3, CHAIN.size))
        v, a = violence * rng.normal(size=(2, 3, CHAIN.size))
        if where.seat:
            x[:, :6], v[:, :6], a[:, :6] = [0.0, 0.0, where.seat, 0.0, 0.0, 0.0], 0.0, 0.0
            x[:, [CHAIN.leg_columns[side][0] for side in (0, 1)]] = rng.uniform(1.0, 1.8, (3, 2))
        else:
            x[:, 3:6] *= 0.5
            if found % _BOWS == 0:
                x[:, 5] -= np.radians(100.0)
            x = _standing(x, where, np.radians(rng.choice([rng.uniform(8.2, 10.0, 3), rng.uniform(10.0, 70.0, 3)])))
        if np.isfinite(where.hands).all():
            where = replace(where, hands=_palms(close_legs(CHAIN, where, x, v, a))[0] + rng.normal(0.0, 0.02, (2, 3)))
        state = close_legs(CHAIN, where, x, v, a)
        if state.wrench[:, 2].min() > 100.0 and np.abs(state.a).max() < 1e3:
            found += 1
            yield state


def _standing(x: Array, where: Stance, knee: Array) -> Array:
    """Return coordinates (T, n) whose pelvis is at the height where the longest planted leg has its ``knee`` (T,) rad
    bent.
    """
    x = x.copy()
    for _ in range(20):
        turn = CHAIN.root_rotation(x)
        hips = [(side, x[:, :3] + turn @ CHAIN.legs[side].hip) for side in where.planted]
        away = np.max([np.linalg.norm(hip - where.ankle[side], axis=1) for side, hip in hips], axis=0)
        x[:, 2] += CHAIN.legs[0].length(knee) - away
    return x


def _palms(state: State) -> Array:
    """Return the places (T, 2, 3) m of both palms."""
    palms = [palm(BODY, side) for side in ("right", "left")]
    return state.placed([segment for segment, _ in palms], np.array([local for _, local in palms]))


def checked(state: State) -> CheckedMotion:
    """Return a state as the judge sees it: a Motion of the body."""
    motion = CHAIN.motion(0.01 * np.arange(len(state.x)), state.x, state.v, state.a)
    return CheckedMotion(state.chain.body, motion, state.stance)
