"""A dance that people can follow: from posture to posture of which they know the words, one or two parts of the body at
a time.

Within reach of the last posture are those at most so many instructions away, or its mirror image. Every step takes the
one that tells most per second (`PostureInformation`), where an instruction costs time, too: the price of
``simplicity``. Whoever must change feet in so many steps is only asked for what can be undone until then (`leads`).
What a posture must keep it keeps also for people who copy it imprecisely (`PostureTable.keeps`). From where no step
leads on the search goes back; where none is possible, it says why, and what of the plan is possible all the same.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.cues import MIRROR_CALL, instructions
from biodance.dance.dance import Dance
from biodance.dance.expectation import PostureInformation, update_posterior
from biodance.dance.problem.feet import support_sequence, within_cards
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import straight_via
from biodance.dance.problem.stance import Stance, feet_in_move, stance_words
from biodance.dance.search.course import Course, DanceStep, DesignContext, move_task
from biodance.dance.search.known_postures import (
    PostureTable,
    nearest_in_words,
    read_vocabulary,
    words_for,
    words_left_out,
    words_never_kept,
)
from biodance.dance.search.move import AMPLE, ENOUGH, Move, Task, straight_move
from biodance.errors import BiodanceError
from biodance.records import Array


def _near(last: DanceStep | None, table: PostureTable) -> list[int]:
    """Return the postures that differ in few parts of the body from the last one, and its mirror image."""
    was = {part: word.key for part, word in last.table.words_of(last.s).items()} if last is not None else {}
    off = np.zeros(len(table.index), dtype=int)
    for column, part in enumerate(table.parts):
        keys = np.array([word.key for word in table.words[part]])[table.index[:, column]]
        off += keys != was.get(part, table.words[part][0].key)
    near = np.flatnonzero(off <= 2).tolist()  # parts of the body that change at a time
    if last is not None and last.table is table and table.mirrored[last.s] >= 0:
        near = sorted({*near, int(table.mirrored[last.s])})
    return near


LEAST = 2
"""Postures of a dance: between them there is one move."""
_Blocks = tuple[tuple[str, int], ...]  # Feet, and how many postures on them (`Plan.blocks`)


class NoNextPosture(BiodanceError):
    """No posture follows on the feet ``stances[number]``, and ``why``."""

    def __init__(self, why: str, stances: tuple[Stance, ...], number: int) -> None:
        here = stances[number]
        super().__init__(
            f"No posture {stance_words(here)} can be reached from posture {number}: {why}."
            if number
            else f"No posture {stance_words(here)} is possible: {why}."
        )
        self.why, self.stances, self.number = why, stances, number

    def missing(self, danced: _Blocks) -> tuple[str, int]:
        """Return of the ``danced`` blocks (each of the `stances` that is over no foot is one of their postures) the one
        that is not possible, and how many of its postures are there before; none where its feet cannot be left or not
        be reached.
        """
        number, changes = self.number, self.stances[self.number].over is not None
        names = iter([name for name, count in danced for _ in range(count)])
        owner = [next(names) if one.over is None else "" for one in self.stances]
        if changes and len(self.stances[number - 1].planted) == 1:
            return owner[number - 1], 0
        name = next(filter(None, owner[number:]), owner[0])
        return name, 0 if changes else owner[:number].count(name)

    def possible(self, blocks: _Blocks, danced: _Blocks) -> _Blocks:
        """Return the blocks of a plan, of which so many were ``danced``, without postures that are not possible; empty
        where that leaves nothing out.
        """
        name, reached = self.missing(danced)
        shorter = [(one, reached if one == name else count) for one, count in blocks]
        return tuple((one, count) for one, count in shorter if count) if tuple(shorter) != blocks else ()

    def note(self, danced: _Blocks) -> str:
        """Return in a sentence what of the ``danced`` blocks is left out, and why."""
        name, reached = self.missing(danced)
        count = dict(danced)[name]
        out = f"{count - reached} of the {count} postures" if reached else f"all {count} postures"
        return f"Left out: {out} {name.replace('_', ' ')}; {self.why}."


_INSTRUCTION = 0.5  # s that one instruction is worth at simplicity 1
_TRIES = 200  # Postures that are taken or given up before a search is
_LIFTING = 1.4  # Times as long as others that a move takes in which a foot is lifted or put down


@dataclass(eq=False)
class _Place:
    """The ``step`` and ``move`` taken to a place, the ``posterior`` there, and what is ``left`` to try after it."""

    posterior: Array
    step: DanceStep | None = None
    move: Move | None = None
    left: Iterator[tuple[DanceStep, Move | None]] | None = None


@dataclass(eq=False)
class WordSearch:
    """The search for one dance, whose postures and moves leave imprecise people ``enough`` deviations; what was worked
    out (postures, what follows on what, moves) is kept, so that another look costs little.
    """

    work: DesignContext
    enough: float = ENOUGH
    _held: dict[tuple[str, int], tuple[float, str]] = field(default_factory=dict)
    _moves: dict[tuple[bytes, bytes], Move] = field(default_factory=dict)
    _tables: dict[str, PostureTable] = field(default_factory=dict)
    _around: dict[tuple[str, int, int], NDArray[np.intp]] = field(default_factory=dict)
    _going: dict[tuple[str, int, str], bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.words = read_vocabulary()
        self.information = PostureInformation(self.work.chain, self.work.plan, centres=self.work.plan.lively)

    def course(self, stances: tuple[Stance, ...]) -> Course:
        """Return one step for each of ``stances`` and the moves between them.

        Raises
        ------
        NoNextPosture
            From some posture no other one can be reached; the message names the limit that most of them break.
        """
        self._check_feet(stances)
        path, farthest = [_Place(self.information.beforehand)], 0
        why: dict[int, dict[str, int]] = {}
        for _ in range(_TRIES):
            number, steps = len(path) - 1, [place.step for place in path if place.step is not None]
            if number == len(stances):
                return Course(tuple(steps), tuple(place.move for place in path[2:]))
            farthest = max(farthest, number)
            self.work.tell("postures", number, len(stances))
            here = path[-1]
            if here.left is None:
                broken = why.setdefault(number, {})
                here.left = islice(self.possible(steps, stances, here.posterior, broken), 5)
            found = next(here.left, None)
            if found is not None:
                path.append(_Place(self.posterior_after(here.posterior, steps, found[0]), *found))
            elif number:
                path.pop()
            else:
                break
        raise self._stuck(stances, farthest, why.get(farthest, {}))

    def _check_feet(self, stances: tuple[Stance, ...]) -> None:
        """Raise `NoNextPosture` where this body cannot change feet in any posture of trunk and legs."""
        for number, pair in enumerate(pairwise(stances), start=1):
            if pair[0].key == pair[1].key:
                continue
            was, now = (self.table(stance) for stance in pair)
            if not any(self.leads(was, int(s), now, 1) for s in np.unique(was.arms_at_rest)):
                limits = [move.limit for move in self._moves.values() if move.limit]
                raise self._stuck(stances, number, Counter(limits[-1:]))

    def postures(self, stances: tuple[Stance, ...]) -> list[DanceStep]:
        """Return one step for each of ``stances``, as `course` does, without a look at the moves between them."""
        steps, posterior = list[DanceStep](), self.information.beforehand
        for number in range(len(stances)):
            step = next((one for one in self._ranked(steps, stances, posterior) if not self._kept(one)[1]), None)
            if step is None:
                raise self._stuck(stances, number, {})
            posterior = self.posterior_after(posterior, steps, step)
            steps.append(step)
        return steps

    def posterior_after(self, posterior: Array, steps: list[DanceStep], step: DanceStep) -> Array:
        """Return what is believed (k, k) when ``step`` follows on ``steps``, before whom it was ``posterior``."""
        return update_posterior(posterior, self._rows(steps[-1] if steps else None, step))

    def possible(
        self,
        steps: list[DanceStep],
        stances: tuple[Stance, ...],
        posterior: Array,
        why: dict[str, int],
        *,
        wanted: Callable[[DanceStep], bool] = lambda _: True,
    ) -> Iterator[tuple[DanceStep, Move | None]]:
        """Yield the postures that follow and are ``wanted`` with the move to them, the best first, of a handful those
        first that imprecise people surely can; ``why`` counts the limits that others break.
        """
        last, ranked = steps[-1] if steps else None, filter(wanted, self._ranked(steps, stances, posterior))
        # of these one that imprecise people surely can is taken before others that tell more
        while some := list(islice(ranked, 12)):
            doubtful = list[tuple[float, DanceStep, Move | None]]()
            for step in some:
                room, broken, move = *self._kept(step), None
                if last is not None and not broken:
                    move = self.move(last, step)
                    room, broken = min(room, move.room), move.limit
                if broken:
                    why[broken] = why.get(broken, 0) + 1
                elif room >= AMPLE:
                    yield step, move
                else:
                    doubtful.append((room, step, move))
            yield from ((step, move) for _, step, move in sorted(doubtful, key=lambda one: -one[0]))

    def _stuck(self, stances: tuple[Stance, ...], number: int, why: dict[str, int]) -> NoNextPosture:
        """Return why there is no posture in place ``number``, of the limits that others broke counted in ``why``."""
        table, plan = self.table(stances[number]), self.work.plan
        if number == 0 or not why:
            return NoNextPosture(nearest_in_words(table, plan.limits), stances, number)
        most = max(why, key=lambda name: why[name]).replace("_", " ")
        return NoNextPosture(
            f"most of those within {plan.instructions:g} instructions exceed the limit on {most}", stances, number
        )

    def _ranked(self, steps: list[DanceStep], stances: tuple[Stance, ...], posterior: Array) -> Iterator[DanceStep]:
        """Yield the postures within reach on the next feet, the best first."""
        stance, table = stances[len(steps)], self.table(stances[len(steps)])
        last = steps[-1] if steps else None
        used, late = {step.s for step in steps if step.table is table}, self._late(len(steps), stances)
        found = [step for step in self.after(last, table) if step.s not in used]
        if not found:
            return
        if stance.over is not None:
            least = sorted(found, key=lambda step: (len(step.said), step.s))
            yield from (step for step in least if not late(step))
            return
        still = self.information.white(table.standing[[step.s for step in found]])
        # Variance removed per second.
        gains = self.information.gains(posterior, still) / self._seconds(found)
        on = (found[k] for k in np.argsort(-gains, kind="stable") if not late(found[k]))
        first = list(islice(on, 24))  # those that tell most standing still
        gains = np.array([float(self.information.gains(posterior, self._rows(last, step))) for step in first])
        yield from (first[k] for k in np.argsort(-gains / self._seconds(first), kind="stable"))
        yield from on

    def _late(self, number: int, stances: tuple[Stance, ...]) -> Callable[[DanceStep], bool]:
        """Return what says whether a posture in place ``number`` cannot be undone before the feet must change."""
        feet = stances[number].key
        left = next((k for k, one in enumerate(stances[number:]) if one.key != feet), 0)
        if not left or np.isinf(self.work.plan.instructions):
            return lambda step: False
        goal = self.table(stances[number + left])
        return lambda step: not self.leads(step.table, step.s, goal, left)

    def _seconds(self, steps: list[DanceStep]) -> Array:
        """Return what each step costs, s."""
        plan = self.work.plan
        return np.array([plan.move + plan.hold + _INSTRUCTION * plan.simplicity * len(step.said) for step in steps])

    def _kept(self, step: DanceStep) -> tuple[float, str]:
        """Return by how many deviations imprecise people keep a posture, and the limit that they break, "" if none."""
        if step.key not in self._held:
            found, limit = step.table.keeps(step.s, self.work.plan.limits)
            self._held[step.key] = found, limit if found < self.enough else ""
        return self._held[step.key]

    def table(self, stance: Stance) -> PostureTable:
        """Return all postures on the feet ``stance``."""
        key = stance.key
        if key not in self._tables:
            rng = np.random.default_rng([self.work.seed, 6])
            chain, plan = self.work.chain, self.work.plan
            words = words_for(chain.body, plan, stance, self.words, rng)
            self._tables[key] = PostureTable.of(chain, stance, words)
        return self._tables[key]

    def after(self, last: DanceStep | None, table: PostureTable) -> Iterator[DanceStep]:
        """Yield all postures of a table that may follow on the last one."""
        if np.isinf(self.work.plan.instructions):
            yield from (DanceStep(table, s) for s in range(len(table.index)))
            return
        steps = (self._called(last, table, s) for s in _near(last, table))
        yield from (step for step in steps if step is not None)

    def link(self, last: DanceStep, table: PostureTable, s: int) -> DanceStep | None:
        """Return posture ``s`` as it follows on the last one, None if it may not."""
        return self._called(last, table, s) if s in _near(last, table) else None

    def _called(self, last: DanceStep | None, table: PostureTable, s: int) -> DanceStep | None:
        body, most = self.work.chain.body, self.work.plan.instructions
        if last is not None and last.table is table and s == table.mirrored[last.s]:
            return DanceStep(table, s, MIRROR_CALL, mirror=True)
        before, feet = (np.zeros(self.work.chain.size), None) if last is None else (last.x, last.stance)
        said = instructions(body, before, table.x[s], feet, table.stance)
        most += feet is None and bool(table.stance.holding)  # to take hold of the frame, before it begins
        return DanceStep(table, s, said) if len(said) <= most else None

    def leads(self, table: PostureTable, s: int, goal: PostureTable, steps: int) -> bool:
        """Return whether posture ``s`` leads in at most so many ``steps`` to one of ``goal``, the arms at rest."""
        return any(self._goes(int(row), table, goal) for row in self._within(table, s, steps - 1))

    def _within(self, table: PostureTable, s: int, steps: int) -> NDArray[np.intp]:
        """Return the postures that are so many ``steps`` at most from ``s``, on the same feet, the arms at rest."""
        key = table.stance.key, int(table.arms_at_rest[s]), steps
        if key not in self._around:
            found = np.array([key[1]])
            if steps:
                rows, near = np.unique(table.arms_at_rest), self._within(table, s, steps - 1)
                here = [DanceStep(table, int(k)) for k in near]
                found = np.array([t for t in rows if t in near or any(self.link(one, table, t) for one in here)])
            self._around[key] = found
        return self._around[key]

    def _goes(self, s: int, table: PostureTable, goal: PostureTable) -> bool:
        """Return whether a posture of ``goal``, the arms at rest, can follow on posture ``s`` of a table."""
        key = table.stance.key, s, goal.stance.key
        if key not in self._going:
            last = DanceStep(table, s)
            near = np.intersect1d(_near(last, goal), np.unique(goal.arms_at_rest))
            steps = (self._called(last, goal, int(t)) for t in near)
            self._going[key] = any(step is not None and self.can(last, step) for step in steps)
        return self._going[key]

    def can(self, last: DanceStep, step: DanceStep) -> bool:
        """Return whether this body can go from one step to another, as imprecisely as people do."""
        return not (self._kept(last)[1] or self._kept(step)[1] or self.move(last, step).limit)

    def move(self, last: DanceStep, step: DanceStep) -> Move:
        """Return the move from one step to the next, as `straight_move` finds it."""
        key = (last.x.tobytes(), step.x.tobytes())
        if key not in self._moves:
            self._moves[key] = straight_move(self.task(last, step), (last.stance, step.stance), self.enough)
        return self._moves[key]

    def task(self, last: DanceStep, step: DanceStep) -> Task:
        """Return what a move from one step to the next must do."""
        slower = _LIFTING if last.stance.planted != step.stance.planted else 1.0
        return move_task(self.work, last, step, slower=slower)

    def _rows(self, last: DanceStep | None, step: DanceStep) -> Array:
        """Return the whitened rows (m, k) of standing in a posture and of the straight way to it."""
        still = self.information.of_posture(step.x, step.table.standing[step.s])
        if last is None:
            return still
        return np.concatenate([still, self.information.of_ways(np.array([[last.x, step.x]]))[0]])


def word_course(search: WordSearch) -> Course:
    """Return the course that a search finds; what this person cannot do of the plan is left out, and this is said:
    words, feet on which there is no posture, and postures beyond those that follow on each other.

    Raises
    ------
    NoNextPosture
        There are not even two postures on any of the feet.
    """
    body, plan, notes = search.work.chain.body, search.work.plan, list[str]()
    while True:
        short = within_cards(body, plan)
        try:
            course = search.course(support_sequence(body, short))
        except NoNextPosture as why:
            blocks = why.possible(plan.blocks, short.blocks)
            if sum(count for _, count in blocks) < LEAST:
                raise
            notes.append(why.note(short.blocks))
            plan = replace(plan, blocks=blocks)
        else:
            notes += words_left_out(body, plan, course.stances, search.words)
            if plan.careful:  # the words that a person with own limits can do on none of the feet
                tables = {one.key: search.table(one) for one in course.stances if one.over is None}
                notes += (said for one in tables.values() for said in words_never_kept(one, plan.limits))
            return replace(course, notes=tuple(dict.fromkeys(notes)))


def freer_dance(body: Body, plan: Plan, *, seed: int = 0, stances: tuple[Stance, ...] = ()) -> Dance:
    """Return the dance of as many postures of the same words on the same feet, chosen freely: no limit on instructions,
    no ``simplicity``; ``stances`` the feet, by default those of the plan. Its postures keep the limits and suit
    imprecise people; its moves go straight and nobody has looked at them, so that it only tells what it costs that a
    dance can be followed.

    Raises
    ------
    NoNextPosture
        There are not as many different ones.
    """
    free = replace(plan, instructions=np.inf, simplicity=0.0)
    stances = stances or support_sequence(body, free)
    steps = WordSearch(DesignContext.alone(body, free, seed)).postures(stances)
    x, hold = np.array([step.x for step in steps]), np.full(len(steps), plan.hold)
    via, move = straight_via(x[:-1], x[1:]), np.full(len(x) - 1, plan.move)
    feet = tuple(feet_in_move(*pair) for pair in pairwise(stances))
    return Dance(plan.name, body, x, stances, hold, via, move, feet, seed)
