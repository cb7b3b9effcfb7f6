"""Static postures that turn gravity through every segment (paper eq. 14-17): small problems in turn, then the best of
all that were found.

cond has a kink where a segment is isotropic, at which one posture after the other stands still; sweeps therefore use a
smooth condition number of growing sharpness, and after two independent runs postures are exchanged, one for one until
nothing helps and no two alike, for better ones among all that came by and their mirror images.
"""

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.dance.limits import Limit
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import Blocks, static_grams, total
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.stance import Stance
from biodance.dance.search.posture import (
    ATTEMPTS,
    KEPT,
    Exciting,
    Posture,
    image_feet,
    initial_guess,
    mirror_posture,
    mirror_vectors,
    posture_at,
    refuse,
    solve,
    symmetric,
)
from biodance.records import Array

RUNS = 2
"""Independent searches whose postures are put together."""
SWEEPS = ((4, 20), (4, 10))
"""Sharpness of the smooth condition number and iterations for every posture, of the sweeps of a run."""
FRESH, POLISH = ((8, 20),), ((8, 10), (8, 10), (16, 10), (16, 10), (32, 8))
"""The same for the sweeps after the exchange, first one from fresh starts, then from where the postures are."""

APART = np.radians(10.0)
"""rad: two postures on the same feet differ by this much in one joint at least; less nobody would see."""


def find_postures(
    chain: Chain,
    blocks: Blocks,
    stances: tuple[Stance, ...],
    limits: tuple[Limit, ...],
    *,
    seed: int,
    workers: Executor,
) -> Array:
    """Return the coordinates (P, n) of one posture for each of ``stances`` that keeps the ``limits``, together the most
    exciting for all first moments.

    Raises
    ------
    BiodanceError
        On some feet there is no posture within the limits; the message names the limit.
    """

    def price(chosen: list[Posture]) -> float:
        """Criterion and, where simplicity counts, how hard the postures are to take, kg."""
        hard = float(blocks.weight.sum() * np.mean([p.hard for p in chosen]))
        return criterion(blocks, chosen) + blocks.simplicity * hard

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
        chosen = min((exchange(blocks, stances, pool) for pool in (kept, before)), key=price)
    return np.array([p.x for p in chosen])


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


def exchange(blocks: Blocks, stances: tuple[Stance, ...], pool: list[list[Posture]]) -> list[Posture]:
    """Return one posture for each place, no two of a stance alike (`APART`) where the pool allows: those that come
    first, exchanged for better ones of the same stance as long as any helps.
    """
    kinds = [stance.name for stance in stances]
    every: dict[str, list[Posture]] = {kind: [] for kind in kinds}
    for kind, found in zip(kinds, pool, strict=True):
        every[kind] += [posture for posture in found if posture not in every[kind]]
    grams = {
        kind: np.eye(3) - np.einsum("pni,pnj->pnij", *[np.array([p.up for p in found])] * 2)
        for kind, found in every.items()
    }
    like = {kind: alike(np.array([p.x for p in found])) for kind, found in every.items()}
    taken: dict[str, list[int]] = {kind: [] for kind in every}
    for kind, found in zip(kinds, pool, strict=True):
        order = [every[kind].index(found[0]), *range(len(every[kind]))]
        taken[kind].append(next((i for i in order if not like[kind][i, taken[kind]].any()), order[0]))
    worth = blocks.simplicity * float(blocks.weight.sum()) / len(stances)
    hard = {kind: worth * np.array([p.hard for p in found]) for kind, found in every.items()}
    whole = sum(grams[kind][picks].sum(axis=0) for kind, picks in taken.items())
    effort = sum(hard[kind][picks].sum() for kind, picks in taken.items())
    value = _values(blocks, whole[None])[0] + effort
    for kind, place in _places(taken):
        now, rest = taken[kind][place], taken[kind][:place] + taken[kind][place + 1 :]
        spare = np.flatnonzero(~like[kind][:, rest].any(axis=1))
        if spare.size:
            trial, efforts = whole - grams[kind][now] + grams[kind][spare], effort - hard[kind][now] + hard[kind][spare]
            values = _values(blocks, trial) + efforts
            if values.min() < value - 1e-6:
                value, best = values.min(), int(values.argmin())
                whole, effort, taken[kind][place] = trial[best], efforts[best], int(spare[best])
    picks = {kind: iter(chosen) for kind, chosen in taken.items()}
    return [every[kind][next(picks[kind])] for kind in kinds]


def alike(x: Array) -> NDArray[np.bool_]:
    """Return (P, P) True where two postures x (P, n) differ by less than `APART` in every coordinate."""
    return np.asarray(np.abs(x[:, None] - x[None]).max(axis=2) < APART)


def _places(taken: dict[str, list[int]]) -> Iterator[tuple[str, int]]:
    """Yield all places in turn, again and again, until a round has changed nothing."""
    before: dict[str, list[int]] = {}
    while before != taken:
        before = {kind: list(picks) for kind, picks in taken.items()}
        for kind, picks in taken.items():
            for place in range(len(picks)):
                yield kind, place


def _values(blocks: Blocks, grams: Array) -> Array:
    """Return the criterion (K,) kg of K sets of Gram matrices (K, N, 3, 3)."""
    out = np.zeros(len(grams))
    whole = [i for i, pick in enumerate(blocks.first) if len(pick) == 3 and blocks.weight[i] > 0]
    if whole:
        least, most = extremes(grams[:, whole])
        out += np.sqrt(most / np.maximum(least, 1e-12)) @ blocks.weight[whole]
    for i, pick in enumerate(blocks.first):
        if 0 < len(pick) < 3 and blocks.weight[i] > 0:
            value = np.linalg.eigvalsh(grams[:, i][np.ix_(range(len(grams)), pick, pick)])
            out += blocks.weight[i] * np.sqrt(value[:, -1] / np.maximum(value[:, 0], 1e-12))
    return out


def extremes(A: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest eigenvalue of symmetric matrices (..., 3, 3) in closed form
    (doi:10.1145/355578.366316): an exchange asks for a million of them.
    """
    mean = (A[..., 0, 0] + A[..., 1, 1] + A[..., 2, 2]) / 3
    a, b, c = (A[..., i, i] - mean for i in range(3))
    d, e, f = A[..., 0, 1], A[..., 1, 2], A[..., 0, 2]
    radius = np.sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6)
    half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2
    angle = np.arccos(np.clip(half / np.maximum(radius**3, 1e-300), -1.0, 1.0)) / 3
    return mean + 2 * radius * np.cos(angle + 2 * np.pi / 3), mean + 2 * radius * np.cos(angle)


def criterion(blocks: Blocks, chosen: list[Posture]) -> float:
    """Return the sum of M_i cond(W_bi^S), kg, of postures."""
    return total(blocks.weight, static_grams(np.array([p.up for p in chosen])), blocks.first)[0]
