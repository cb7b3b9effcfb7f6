"""Which known posture may follow on which: at most so many instructions, one or two parts of the body, or the mirror
image; and before feet change, only what can be undone until then. Where none follows: why, and what of the plan is
possible all the same.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from biodance.dance.cues import MIRROR_CALL, instructions
from biodance.dance.limits import Limit
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.problem.state import State
from biodance.dance.search.course import DesignContext
from biodance.dance.search.known_postures import PostureTable, Word, read_vocabulary, singular, words_for
from biodance.dance.search.posture import describe
from biodance.errors import BiodanceError
from biodance.records import Array

_PARTS = 2
"""Parts of the body that change at a time."""


@dataclass(frozen=True, eq=False)
class WordStep:
    """Posture ``s`` of a ``table``, what is ``said`` on the way to it; ``mirror`` True for the last one's
    image (a `DanceStep`).
    """

    table: PostureTable
    s: int
    said: tuple[str, ...]
    mirror: bool = False

    @property
    def x(self) -> Array:
        """(n,) coordinates."""
        return np.asarray(self.table.x[self.s])

    @property
    def stance(self) -> Stance:
        """The feet on which it is held."""
        return self.table.stance

    @property
    def words(self) -> dict[str, Word]:
        """The word of every part."""
        return self.table.words_of(self.s)

    @property
    def name(self) -> str:
        """The words of all parts that do not rest; of arms that do the same, once."""
        out = []
        for part, word in self.words.items():
            if not part.endswith(("_arm", "_hanging")) and (not word.rest or part.endswith("_lifted")):
                out.append(word.text)
        for kind in ("arm", "hanging"):
            out += _pair_words([word for part, word in self.words.items() if part.endswith(f"_{kind}")])
        return ", ".join(out) or ("sit" if self.stance.seat else "stand")

    @property
    def key(self) -> tuple[str, int]:
        """What the posture is known by, on whatever way somebody came to it."""
        return feet_key(self.stance), self.s


def _pair_words(pair: list[Word]) -> list[str]:
    """Return what the ``right`` and the left limb do, together where it is the same."""
    if not pair or all(word.rest for word in pair):
        return []
    if pair[0].key == pair[1].key:
        return [pair[0].text.format("both")]
    sides = zip(("the right", "the left"), pair, strict=True)
    return [singular(word.text.format(side)) for side, word in sides if not word.rest]


@dataclass(eq=False)
class Reachability:
    """The postures of one design and what follows on what, worked out once; ``can`` says whether this body can go from
    one step to another.
    """

    work: DesignContext
    can: Callable[[WordStep, WordStep], bool]
    _tables: dict[str, PostureTable] = field(default_factory=dict)
    _around: dict[tuple[str, int, int], NDArray[np.intp]] = field(default_factory=dict)
    _going: dict[tuple[str, int, str], bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.words = read_vocabulary()

    def table(self, stance: Stance) -> PostureTable:
        """Return all postures on the feet ``stance``."""
        key = feet_key(stance)
        if key not in self._tables:
            rng = np.random.default_rng([self.work.seed, 6])
            chain, plan = self.work.chain, self.work.plan
            words = words_for(chain.body, plan, stance, self.words, rng)
            self._tables[key] = PostureTable.of(chain, stance, words)
        return self._tables[key]

    def after(self, last: WordStep | None, table: PostureTable) -> Iterator[WordStep]:
        """Yield all postures of a table that may follow on the last one."""
        if np.isinf(self.work.plan.instructions):
            yield from (WordStep(table, s, ()) for s in range(len(table.index)))
            return
        steps = (self._called(last, table, s) for s in _near(last, table))
        yield from (step for step in steps if step is not None)

    def link(self, last: WordStep, table: PostureTable, s: int) -> WordStep | None:
        """Return posture ``s`` as it follows on the last one, None if it may not."""
        return self._called(last, table, s) if s in _near(last, table) else None

    def _called(self, last: WordStep | None, table: PostureTable, s: int) -> WordStep | None:
        body, most = self.work.chain.body, self.work.plan.instructions
        if last is not None and last.table is table and s == table.mirrored[last.s]:
            return WordStep(table, s, MIRROR_CALL, mirror=True)
        before, feet = (np.zeros(self.work.chain.size), None) if last is None else (last.x, last.stance)
        said = instructions(body, before, table.x[s], feet, table.stance)
        most += feet is None and bool(table.stance.holding)  # to take hold of the frame, before it begins
        return WordStep(table, s, said) if len(said) <= most else None

    def leads(self, table: PostureTable, s: int, goal: PostureTable, steps: int) -> bool:
        """Return whether posture ``s`` leads in at most so many ``steps`` to one of ``goal``, the arms at rest."""
        return any(self._goes(int(row), table, goal) for row in self._within(table, s, steps - 1))

    def _within(self, table: PostureTable, s: int, steps: int) -> NDArray[np.intp]:
        """Return the postures that are so many ``steps`` at most from ``s``, on the same feet, the arms at rest."""
        key = feet_key(table.stance), int(table.arms_at_rest[s]), steps
        if key not in self._around:
            found = np.array([key[1]])
            if steps:
                rows, near = np.unique(table.arms_at_rest), self._within(table, s, steps - 1)
                found = np.array([t for t in rows if t in near or any(self._steps(int(k), table, t) for k in near)])
            self._around[key] = found
        return self._around[key]

    def _steps(self, s: int, table: PostureTable, t: int) -> bool:
        return self.link(WordStep(table, s, ()), table, t) is not None

    def _goes(self, s: int, table: PostureTable, goal: PostureTable) -> bool:
        """Return whether a posture of ``goal``, the arms at rest, can follow on posture ``s`` of a table."""
        key = feet_key(table.stance), s, feet_key(goal.stance)
        if key not in self._going:
            last = WordStep(table, s, ())
            near = np.intersect1d(_near(last, goal), np.unique(goal.arms_at_rest))
            steps = (self._called(last, goal, int(t)) for t in near)
            self._going[key] = any(step is not None and self.can(last, step) for step in steps)
        return self._going[key]


def _near(last: WordStep | None, table: PostureTable) -> list[int]:
    """Return the postures that differ in few parts of the body from the last one, and its mirror image."""
    was = {part: word.key for part, word in last.words.items()} if last is not None else {}
    off = np.zeros(len(table.index), dtype=int)
    for column, part in enumerate(table.parts):
        keys = np.array([word.key for word in table.words[part]])[table.index[:, column]]
        off += keys != was.get(part, table.words[part][0].key)
    near = np.flatnonzero(off <= _PARTS).tolist()
    if last is not None and last.table is table and table.mirrored[last.s] >= 0:
        near = sorted({*near, int(table.mirrored[last.s])})
    return near


def feet_key(stance: Stance) -> str:
    """Return what a foot configuration is known by."""
    return f"{stance.name} {stance.planted} {stance.over} {stance.ankle.tobytes().hex()}"


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
