"""Why a search found no posture: in which place of the dance, on which feet, and what would have to change; and what of
the plan is possible all the same.
"""

import numpy as np

from biodance.dance.limits import Limit
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.problem.state import State
from biodance.dance.search.posture import describe
from biodance.dance.search.posture_table import PostureTable
from biodance.dance.search.vocabulary import singular
from biodance.errors import BiodanceError
from biodance.records import Array

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
    short = _short(table, limits)
    s = int(np.maximum(short, 0.0).sum(axis=0).argmin())
    broken = _broken(table, s, limits, short[:, s])
    if not broken:
        limit = table.keeps(s, limits)[1].replace("_", " ")
        return f"imprecise people leave too little of the limit on {limit} in all of them"
    return f"the one nearest to all limits breaks that on {broken}"


def words_never_kept(table: PostureTable, limits: tuple[Limit, ...]) -> tuple[str, ...]:
    """Return a sentence for every word that no posture of a table can have, with what the nearest one would break."""
    short, out = _short(table, limits), []
    worst = np.maximum(short, 0.0).sum(axis=0)
    for column, (part, words) in enumerate(table.words.items()):
        for k, word in enumerate(words[1:], start=1):
            rows = np.flatnonzero(table.index[:, column] == k)
            if (worst[rows] > 0).all():
                s = int(rows[worst[rows].argmin()])
                text = singular(word.text.format(f"the {part.partition('_')[0]}"))
                out.append(f"Left out: {text}; it would break the limit on {_broken(table, s, limits, short[:, s])}.")
    return tuple(out)


def _short(table: PostureTable, limits: tuple[Limit, ...]) -> Array:
    """Return what every posture of a table lacks of each of the limits at rest, (limits, S) in their scale, at most 0
    where it is kept.
    """
    rest = np.zeros_like(table.x)
    state, rows = State(table.chain, table.stance, table.x, rest, rest, sloped=False), list[Array]()
    for limit in (limit for limit in limits if limit.at_rest):
        reserve = limit.straight_reserve(table.stance)
        rows.append(reserve - limit.margins(state).value.min(axis=1, initial=np.inf) / limit.scale)
    return np.array(rows)


def _broken(table: PostureTable, s: int, limits: tuple[Limit, ...], short: Array) -> str:
    """Return in words which limits posture ``s`` of a table breaks, where and by how much."""
    asked, rest = [limit for limit in limits if limit.at_rest], np.zeros((1, table.chain.size))
    held = State(table.chain, table.stance, table.x[s : s + 1], rest, rest, sloped=False)
    return " and that on ".join(describe(held, limit) for limit, lack in zip(asked, short, strict=True) if lack > 0)
