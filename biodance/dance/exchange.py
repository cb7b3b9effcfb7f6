"""The best set of postures among all that were found: exchanged one for one until nothing helps, and no two of them alike."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.dance.excitation import Blocks
from biodance.dance.stance import Stance
from biodance.records import Array

APART = np.radians(10.0)
"""rad: two postures on the same feet differ by this much in one joint at least; a smaller difference nobody would see."""


@dataclass(frozen=True, eq=False)
class Posture:
    """``x`` (n,) coordinates, ``up`` (N, 3) the vertical in the segments; ``violation`` of the reserved limits in their scales and the
    worst ``limit``; ``hard`` how hard it is to take.
    """

    x: Array
    up: Array
    violation: float = np.inf
    limit: str = ""
    hard: float = 0.0


def exchange(blocks: Blocks, stances: tuple[Stance, ...], pool: list[list[Posture]]) -> list[Posture]:
    """Return one posture for each place, no two of a stance alike (`APART`) where the pool allows: those that come first, exchanged for
    better ones of the same stance as long as any helps.
    """
    kinds = [stance.name for stance in stances]
    every: dict[str, list[Posture]] = {kind: [] for kind in kinds}
    for kind, found in zip(kinds, pool, strict=True):
        every[kind] += [posture for posture in found if posture not in every[kind]]
    grams = {kind: np.eye(3) - np.einsum("pni,pnj->pnij", *[np.array([p.up for p in found])] * 2) for kind, found in every.items()}
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
    """Return (P, P) True where two postures x (P, n) differ by less than `APART` in every coordinate; a posture is like itself."""
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
    for i, pick in enumerate(blocks.first):
        if pick and blocks.weight[i] > 0:
            value = np.linalg.eigvalsh(grams[:, i][np.ix_(range(len(grams)), pick, pick)])
            out += blocks.weight[i] * np.sqrt(value[:, -1] / np.maximum(value[:, 0], 1e-12))
    return out
