"""Sixty static postures that turn gravity through every segment (paper eq. 14-17), one small problem each, swept in turn."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.chain import ROOT, Chain
from biodance.dance.excitation import Blocks, static_grams, total, upright_slopes, uprights
from biodance.dance.limits import limits
from biodance.dance.programme import Programme, closed
from biodance.dance.sqp import Solution, minimise
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.records import Array

STATIC = ("balance", "foot_placement", "ground_clearance", "joint_range", "joint_torque", "seat", "self_collision")
RESERVE = 0.06
"""Share of every limit's scale that is kept in reserve, for the moves that begin and end here."""
KEPT = 0.01
"""Violation, in scales of the limits, of the reserved margins that is accepted."""


@dataclass(frozen=True, eq=False)
class Postures:
    """``x`` (P, n) coordinates, ``stances`` (P), ``criterion`` sum of M_i cond(W_bi^S), kg, and its ``bound``; ``violation`` (P,)."""

    x: Array
    stances: tuple[Stance, ...]
    criterion: float
    bound: float
    violation: Array


def free_coordinates(chain: Chain, stance: Stance) -> list[int]:
    """Return the coordinates that are free when the planted legs follow the pelvis."""
    held = {c for side in stance.planted for c in chain.leg_columns[side]} | set(range(ROOT if stance.seat else 0))
    return [c for c in range(chain.size) if c not in held]


def start(chain: Chain, stance: Stance, rng: np.random.Generator) -> Array:
    """Return the coordinates (n,) of a shallow squat over the support, arms and trunk anywhere."""
    limits_, x = chain.body.limits, np.zeros(chain.size)
    low, high = limits_.lower, limits_.upper
    x[ROOT:] = low + (high - low) * rng.uniform(0.15, 0.85, len(low))
    if stance.seat:
        x[:3] = [0.0, 0.0, stance.seat]
        return x
    reach = min(float(leg.length(np.radians(rng.uniform(15, 60)))) for leg in chain.legs)
    x[:3] = [*(stance.centre - [0.02, 0.0]), stance.ankle[0, 2] + 0.97 * reach]
    x[3:6] = rng.normal(0, 0.15, 3)
    return x


@dataclass(frozen=True, eq=False)
class _Static:
    """Objective of one posture when the Gram matrices of the ``others`` (N, 3, 3) are given; ease pulls towards mid range."""

    blocks: Blocks
    others: Array
    unit: float
    ease: float = 2e-3

    def __call__(self, state: State) -> tuple[float, Array]:
        up = uprights(state)
        grams = self.others + static_grams(up)
        value, slope = total(self.blocks.weight, grams, self.blocks.first, list(range(len(grams))))
        by_up = -2 * np.einsum("nij,tnj->tni", slope, up)
        by = np.zeros((3, *state.x.shape))
        by[0] = upright_slopes(state, by_up) / self.unit
        ends = state.chain.body.limits
        middle, half = (ends.upper + ends.lower) / 2, np.maximum((ends.upper - ends.lower) / 2, 1e-3)
        off = (state.x[:, ROOT:] - middle) / half
        by[0][:, ROOT:] += 2 * self.ease * off / half
        return value / self.unit + self.ease * float(np.sum(off**2)), by


def find_postures(chain: Chain, blocks: Blocks, stances: tuple[Stance, ...], *, rng: np.random.Generator, sweeps: int = 2) -> Postures:
    """Return one posture per entry of ``stances``, together the most exciting for all first moments.

    Every posture is solved while the others are held; a posture that is not feasible after its turn gets other starts.
    """
    x = np.array([closed(chain, s, start(chain, s, rng)[None], *np.zeros((2, 1, chain.size))).x[0] for s in stances])
    ups = np.array([_upright(chain, s, row) for s, row in zip(stances, x, strict=True)])
    violation = np.full(len(x), np.inf)
    for sweep in range(sweeps):
        for p, stance in enumerate(stances):
            others = static_grams(np.delete(ups, p, axis=0))
            unit = 0.1 * float(blocks.weight.sum()) / len(x)
            for attempt in range(6):
                begin = x[p] if attempt == 0 else start(chain, stance, rng)
                state, found = _solve(chain, stance, begin, _Static(blocks, others, unit), iterations=20 if sweep == 0 else 10)
                if found.violation <= KEPT or attempt == 5:
                    break
            x[p], ups[p], violation[p] = state.x[0], uprights(state)[0], found.violation
    value, _ = total(blocks.weight, static_grams(ups), blocks.first, list(range(len(ups[0]))))
    return Postures(x, stances, value, float(blocks.weight.sum()), violation)


def _solve(chain: Chain, stance: Stance, begin: Array, objective: _Static, *, iterations: int) -> tuple[State, Solution]:
    free = free_coordinates(chain, stance)
    base = np.zeros((3, 1, chain.size))
    base[0, 0] = begin
    base[0, 0, free] = 0.0
    basis = np.zeros((3, 1, 1))
    basis[0] = 1.0
    kept = tuple(limit for limit in limits() if limit.NAME in STATIC)
    programme = Programme(chain, stance, base, basis, free, kept, objective, np.full((1, len(kept)), RESERVE))
    found = minimise(programme.judge, begin[free], iterations=iterations)
    return programme.state(found.y), found


def _upright(chain: Chain, stance: Stance, row: Array) -> Array:
    return uprights(State(chain, stance, row[None], *np.zeros((2, 1, chain.size))))[0]
