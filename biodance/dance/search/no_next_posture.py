"""Why a search found no posture: in which place of the dance, on which feet, and what would have to change; and what of
the plan is possible all the same.
"""

import numpy as np

from biodance.dance.limits import Limit
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.problem.state import State
from biodance.dance.search.posture import describe
from biodance.dance.search.posture_table import PostureTable
from biodance.errors import BiodanceError

LEAST = 2
"""Postures of a dance: between them there is one move."""
_Blocks = tuple[tuple[str, int], ...]
"""Feet, and how many postures on them (`Plan.blocks`)."""


class NoNextPosture(BiodanceError):
    """No posture follows on the feet ``stances[number]``, and ``why``; ``stance``, of what is danced, needs that change
    of feet, and ``reached`` of its postures are there before it.
    """

    def __init__(self, why: str, stances: tuple[Stance, ...], number: int) -> None:
        here = stances[number]
        super().__init__(
            f"No posture {stance_words(here)} can be reached from posture {number}: {why}."
            if number
            else f"No posture {stance_words(here)} is possible: {why}."
        )
        self.why = why
        before, after = stances[:number][-1:], [one for one in stances[number:] if one.over is None]
        alone = [one for one in before if len(one.planted) == 1 and here.over is not None]
        self.stance = (alone or after or stances[:1])[0].name
        self.reached = sum(one.over is None and one.name == self.stance for one in stances[:number])
        if here.over is not None or here.name != self.stance:
            self.reached = 0  # its feet cannot be left, or not be reached

    def possible(self, blocks: _Blocks) -> _Blocks:
        """Return the blocks of a plan without those postures that are not possible; empty where these are no part of
        it.
        """
        shorter = [(name, self.reached if name == self.stance else count) for name, count in blocks]
        return tuple((name, count) for name, count in shorter if count) if tuple(shorter) != blocks else ()

    def note(self, blocks: _Blocks) -> str:
        """Return in a sentence what of the blocks of a plan is left out, and why."""
        count = dict(blocks)[self.stance]
        out = f"{count - self.reached} of the {count} postures" if self.reached else f"all {count} postures"
        return f"Left out: {out} {self.stance.replace('_', ' ')}; {self.why}."


def nearest_in_words(table: PostureTable, limits: tuple[Limit, ...]) -> str:
    """Return what forbids every posture of a table: the ``limits`` that the posture nearest to them breaks, joint and
    number, and how much more would do.
    """
    chain, asked = table.chain, [limit for limit in limits if limit.at_rest]
    state = State(chain, table.stance, table.x, *np.zeros((2, *table.x.shape)), sloped=False)
    short = np.array(
        [
            (limit.straight_reserve(table.stance) - limit.margins(state).value / limit.scale).max(axis=1, initial=-1.0)
            for limit in asked
        ]
    )
    s = int(np.maximum(short, 0.0).sum(axis=0).argmin())
    held = State(chain, table.stance, table.x[s : s + 1], *np.zeros((2, 1, chain.size)), sloped=False)
    broken = [limit for limit, one in zip(asked, short[:, s], strict=True) if one > 0]
    if not broken:
        limit = table.keeps(s, limits)[1].replace("_", " ")
        return f"imprecise people leave too little of the limit on {limit} in all of them"
    return f"the one nearest to all limits breaks that on {' and that on '.join(describe(held, one) for one in broken)}"
