"""Postures in between, which carry the weight from one foot configuration to the next: simple, near their neighbours."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.chain import Chain
from biodance.dance.exchange import Posture
from biodance.dance.limits import Limit
from biodance.dance.postures import ATTEMPTS, KEPT, refuse, solve, start
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.records import Array

ITERATIONS = 30
MILD = 0.3
"""Share of the neighbours' joint angles that a posture in between keeps: it is a rest."""


@dataclass(frozen=True, eq=False)
class Near:
    """Objective: mean squared distance (rad, m) of the coordinates from ``target`` (n,)."""

    target: Array

    def __call__(self, state: State) -> tuple[float, Array]:
        """Return the objective and its slopes by x."""
        gap, by = state.x - self.target, np.zeros((3, *state.x.shape))
        by[0] = 2 * gap / len(self.target)
        return float(np.mean(gap**2)), by


def middle_posture(
    chain: Chain, stance: Stance, neighbours: Array, limits: tuple[Limit, ...], *, seed: list[int], mild: float = MILD
) -> Posture:
    """Return a posture on the feet ``stance`` between ``neighbours`` (K, n) coordinates; ``mild`` share of whose angles is the aim.

    Raises
    ------
    BiodanceError
        There is none within the limits; the message names the limit.
    """
    rng, tried = np.random.default_rng(seed), list[Array]()
    begin = start(chain, stance, rng)
    begin[3:] = mild * neighbours[:, 3:].mean(axis=0)
    for _ in range(ATTEMPTS):
        found = solve(chain, stance, begin, Near(begin), limits, iterations=ITERATIONS)
        if found.violation <= KEPT:
            return found
        tried.append(begin)
        begin = start(chain, stance, rng)
    refuse(chain, stance, tried, limits)
