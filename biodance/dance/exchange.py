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
    """Return the smallest and the largest eigenvalue of symmetric matrices (..., 3, 3) in closed form (doi:10.1145/355578.366316): an
    exchange asks for a million of them.
    """
    mean = (A[..., 0, 0] + A[..., 1, 1] + A[..., 2, 2]) / 3
    a, b, c = (A[..., i, i] - mean for i in range(3))
    d, e, f = A[..., 0, 1], A[..., 1, 2], A[..., 0, 2]
    radius = np.sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6)
    half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2
    angle = np.arccos(np.clip(half / np.maximum(radius**3, 1e-300), -1.0, 1.0)) / 3
    return mean + 2 * radius * np.cos(angle + 2 * np.pi / 3), mean + 2 * radius * np.cos(angle)
