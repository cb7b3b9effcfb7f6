"""Static postures that turn gravity through every segment (paper eq. 14-17): small problems in turn, then the best of
all that were found.

cond has a kink where a segment is isotropic, at which one posture after the other stands still; sweeps therefore use a
smooth condition number of growing sharpness, and after two independent runs postures are exchanged for better ones
among all that came by.
"""

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from biodance.dance.limits import Limit
from biodance.dance.postures.exchange import criterion, exchange, image_feet, mirror_posture, mirror_vectors, symmetric
from biodance.dance.postures.posture import ATTEMPTS, KEPT, Exciting, Posture, initial_guess, posture_at, refuse, solve
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import Blocks, static_grams
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.stance import Stance
from biodance.records import Array

RUNS = 2
"""Independent searches whose postures are put together."""
SWEEPS = ((4, 20), (4, 10))
"""Sharpness of the smooth condition number and iterations for every posture, of the sweeps of a run."""
FRESH, POLISH = ((8, 20),), ((8, 10), (8, 10), (16, 10), (16, 10), (32, 8))
"""The same for the sweeps after the exchange, first one from fresh starts, then from where the postures are."""


@dataclass(frozen=True, eq=False)
class Postures:
    """``x`` (P, n) coordinates, ``stances`` (P), ``criterion`` sum of M_i cond(W_bi^S), kg, and its ``bound``."""

    x: Array
    stances: tuple[Stance, ...]
    criterion: float
    bound: float


def find_postures(
    chain: Chain,
    blocks: Blocks,
    stances: tuple[Stance, ...],
    limits: tuple[Limit, ...],
    *,
    seed: int,
    workers: Executor,
) -> Postures:
    """Return one posture per entry of ``stances`` that keeps the ``limits``, together the most exciting for all first
    moments.

    Raises
    ------
    BiodanceError
        On some feet there is no posture within the limits; the message names the limit.
    """
    search, named = _Search(chain, blocks, stances, limits, seed), {stance.name: k for k, stance in enumerate(stances)}
    checked = {name: workers.submit(search.possible, k) for name, k in named.items()}
    possible = {name: task.result() for name, task in checked.items()}
    tasks = [workers.submit(search.run, run) for run in range(RUNS)]
    pool = [[p for part in parts for p in part] for parts in zip(*(task.result() for task in tasks), strict=True)]
    kept = [
        [p for p in found if p.violation <= KEPT] or [replace(possible[s.name])]
        for s, found in zip(stances, pool, strict=True)
    ]
    kept = search.with_images(kept, kept)
    chosen = exchange(blocks, stances, kept)
    for n, (sharpness, iterations) in enumerate((*FRESH, *POLISH)):
        begin = [search.anywhere(k, 100 + n) for k in range(len(stances))] if n < len(FRESH) else [p.x for p in chosen]
        halves = [list(range(k, len(stances), 2)) for k in range(2)]
        parts = [workers.submit(search.sweep, chosen, begin, half, sharpness, iterations) for half in halves]
        better = [part.result() for part in parts]
        found = [better[k % 2][k // 2] for k in range(len(stances))]
        kept = [[new, *rest] if new.violation <= KEPT else rest for new, rest in zip(found, kept, strict=True)]
        kept = search.with_images(kept, [[new] for new in found])
        before = [[old, *(p for p in rest if p is not old)] for old, rest in zip(chosen, kept, strict=True)]
        chosen = min(
            (exchange(blocks, stances, pool) for pool in (kept, before)), key=lambda some: _price(blocks, some)
        )
    return Postures(np.array([p.x for p in chosen]), stances, criterion(blocks, chosen), float(blocks.weight.sum()))


def _price(blocks: Blocks, chosen: list[Posture]) -> float:
    """Return the criterion and, where simplicity counts, how hard the postures are to take, kg."""
    return criterion(blocks, chosen) + blocks.simplicity * float(
        blocks.weight.sum() * np.mean([p.hard for p in chosen])
    )


@dataclass(frozen=True, eq=False)
class _Search:
    """What all searches share; random numbers depend on ``seed`` and the place of a posture only."""

    chain: Chain
    blocks: Blocks
    stances: tuple[Stance, ...]
    limits: tuple[Limit, ...]
    seed: int

    def anywhere(self, place: int, run: int) -> Array:
        """Return the start (n,) of one posture in one run."""
        return initial_guess(self.chain, self.stances[place], np.random.default_rng([self.seed, run, place]))

    def possible(self, place: int) -> Posture:
        """Return a posture that keeps all limits at this place, or raise the BiodanceError that names a limit."""
        begin, stance = [self.anywhere(place, run) for run in range(ATTEMPTS)], self.stances[place]
        found = (solve(self.chain, stance, x, no_objective, self.limits, iterations=30) for x in begin)
        posture = next((p for p in found if p.violation <= KEPT), None)
        return posture or refuse(self.chain, stance, begin, self.limits)

    def with_images(self, kept: list[list[Posture]], found: list[list[Posture]]) -> list[list[Posture]]:
        """Return the postures ``kept`` of every place and the images of ``found``, of a body whose sides are alike."""
        out, body = [[*some] for some in kept], self.chain.body
        for here, some in zip(self.stances, found if symmetric(body) else [], strict=False):
            goal = image_feet(here, self.stances)
            if goal is not None:
                there = self.stances[goal]
                images = (
                    replace(p, x=mirror_posture(self.chain, p.x, here, there), up=mirror_vectors(body, p.up))
                    for p in some
                )
                out[goal] += [image for image in images if image.violation <= KEPT]
        return out

    def run(self, run: int) -> list[list[Posture]]:
        """Return for every place the postures of one run, one per sweep."""
        now = [posture_at(self.chain, s, self.anywhere(k, run)) for k, s in enumerate(self.stances)]
        order = list(np.random.default_rng([self.seed, run]).permutation(len(now)))
        out: list[list[Posture]] = [[] for _ in now]
        for sharpness, iterations in SWEEPS:
            now = self.sweep(now, [p.x for p in now], order, sharpness, iterations)
            for search, posture in zip(out, now, strict=True):
                search.append(posture)
        return out

    def sweep(
        self, now: list[Posture], begin: list[Array], order: list[int], sharpness: int, iterations: int
    ) -> list[Posture]:
        """Return the postures of the places ``order``, found in turn from ``begin``, the others held, by place."""
        now, unit = list(now), 0.1 * float(self.blocks.weight.sum()) / len(now)
        for p in order:
            others = np.array([one.up for k, one in enumerate(now) if k != p]).reshape(-1, *now[p].up.shape)
            objective = Exciting(self.blocks, static_grams(others), unit, sharpness)
            x, steps = begin[p], iterations
            for attempt in range(ATTEMPTS):
                now[p] = solve(self.chain, self.stances[p], x, objective, self.limits, iterations=steps)
                if now[p].violation <= KEPT:
                    break
                x, steps = self.anywhere(p, 3 + attempt), max(iterations, 20)
        return [now[p] for p in sorted(order)]
