"""A dance that people can follow: a walk from posture to posture in which one or two parts of the body change.

Every step takes, of all postures within reach of the last one - at most so many instructions away, or its mirror image
- the one that tells most per second (`problem.information`), where an instruction costs time, too: the price of
`simplicity`. Where the feet must change, only postures count from which they can in time (`reach`). What a posture must
keep it keeps also for people who copy it imprecisely (`catalogue`).
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.followable.catalogue import Catalogue
from biodance.dance.followable.plain import AMPLE, ENOUGH, plain_move
from biodance.dance.followable.reach import DanceStep, Reach, feet_key, name_of
from biodance.dance.followable.vocabulary import rest_cut_short
from biodance.dance.performers import deviations_of_copies
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.problem.information import PostureInformation, update_posterior
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import Stance, stance_words, under
from biodance.dance.transitions.context import DesignContext
from biodance.dance.transitions.move import Move, Task, straight_way
from biodance.errors import BiodanceError
from biodance.records import Array

_INSTRUCTION = 0.5
"""s that one instruction is worth at simplicity 1."""
_TRIES = 200
"""Postures that are taken or given up before a walk is."""
_WAYS_ON = 5
"""Postures that are tried after another one before that one is given up."""
_AT_ONCE = 12
"""Postures of which one that imprecise people surely can is taken before others that tell more."""
_BETWEEN = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Shares of a move at which imprecise people must have room, too."""
_SHORTLY = 0.2
"""s of standing still before and after a move that is looked at alone."""
_LIFTING = 1.4
"""Times as long as others that a move takes in which a foot is lifted or put down."""
_LOOKED_AT = 24
"""Postures that tell most standing still, whose ways are judged, too."""


class NoWay(BiodanceError):
    """No posture follows on the feet ``stances[number]``; ``stance``, of what is danced, needs that change of feet."""

    def __init__(self, message: str, stances: tuple[Stance, ...], number: int) -> None:
        super().__init__(message)
        before, after = stances[:number][-1:], [one for one in stances[number:] if one.over is None]
        alone = [one for one in before if len(one.planted) == 1 and stances[number].over is not None]
        self.stance = (alone or after or stances[:1])[0].name


@dataclass(eq=False)
class _Place:
    """A place in the walk: the postures ``left`` to try after it, the ``posterior`` there, what was ``taken`` to it."""

    left: Iterator[tuple[DanceStep, Move | None]] | None
    posterior: Array
    taken: tuple[DanceStep, Move | None] = None  # type: ignore[assignment]


@dataclass(eq=False)
class Walk:
    """The search for one dance; what was worked out is kept, so that another look costs little."""

    work: DesignContext
    _held: dict[tuple[str, int], tuple[float, str]] = field(default_factory=dict)
    _moves: dict[tuple[bytes, bytes], tuple[Move, float]] = field(default_factory=dict)
    _still: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        plan = self.work.plan
        self.reach = Reach(self.work, self._can)
        self.information = PostureInformation(self.work.chain, plan, centres=plan.lively)

    def take(self, stances: tuple[Stance, ...]) -> tuple[list[DanceStep], list[Move]]:
        """Return one step for each of ``stances`` and the moves between them.

        Raises
        ------
        NoWay
            From some posture no other one can be reached; the message names the limit that most of them break.
        """
        self._check_feet(stances)
        path, farthest = [_Place(None, self.information.beforehand)], 0
        why: dict[int, dict[str, int]] = {}
        for _ in range(_TRIES):
            number, steps = len(path) - 1, [place.taken[0] for place in path[1:]]
            if number == len(stances):
                return steps, [move for _, move in (place.taken for place in path[1:]) if move is not None]
            farthest = max(farthest, number)
            self.work.tell("postures", number, len(stances))
            if path[-1].left is None:
                broken = why.setdefault(number, {})
                path[-1].left = islice(self.possible(steps, stances, path[-1].posterior, broken), _WAYS_ON)
            found = next(path[-1].left, None)
            if found is not None:
                path.append(_Place(None, self.posterior_after(path[-1].posterior, steps, found[0]), found))
            elif number:
                path.pop()
            else:
                break
        raise NoWay(self._stuck(stances[farthest], farthest, why.get(farthest, {})), stances, farthest)

    def _check_feet(self, stances: tuple[Stance, ...]) -> None:
        """Raise `NoWay` where this body cannot change feet in any posture of trunk and legs."""
        for number, pair in enumerate(pairwise(stances), start=1):
            if feet_key(pair[0]) == feet_key(pair[1]):
                continue
            was, now = (self.reach.catalogue(stance) for stance in pair)
            if not any(self.reach.leads(was, int(s), now, 1) for s in np.unique(was.arms_at_rest)):
                limits = [move.limit for move, _ in self._moves.values() if move.limit]
                raise NoWay(self._stuck(pair[1], number, Counter(limits[-1:])), stances, number)

    def choose(self, stances: tuple[Stance, ...]) -> list[DanceStep]:
        """Return one step for each of ``stances``, as `take` does, without a look at the moves between them."""
        steps, posterior = list[DanceStep](), self.information.beforehand
        for number, stance in enumerate(stances):
            step = next((one for one in self._ranked(steps, stances, posterior) if not self._kept(one)[1]), None)
            if step is None:
                raise NoWay(self._stuck(stance, number, {}), stances, number)
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
        while some := list(islice(ranked, _AT_ONCE)):
            doubtful = list[tuple[float, DanceStep, Move | None]]()
            for step in some:
                room, broken, move = *self._kept(step), None
                if last is not None and not broken:
                    move, least = self._way(last, step)
                    room, broken = min(room, least), move.limit
                if broken:
                    why[broken] = why.get(broken, 0) + 1
                elif room >= AMPLE:
                    yield step, move
                else:
                    doubtful.append((room, step, move))
            yield from ((step, move) for _, step, move in sorted(doubtful, key=lambda one: -one[0]))

    def _stuck(self, stance: Stance, number: int, why: dict[str, int]) -> str:
        if cut := rest_cut_short(self.work.chain.body, stance, self.reach.words):
            return (
                f"This body cannot be {stance_words(stance)} as the dance asks: {cut}. Choose a protocol on other "
                f"feet, or widen that range if the person reaches farther."
            )
        most = max(why, key=lambda name: why[name]).replace("_", " ") if why else "number of instructions"
        return (
            f"No posture {stance.name.replace('_', ' ')} can be reached from posture {number}: most of those within "
            f"{self.work.plan.instructions:g} instructions exceed the limit on {most}. Widen that limit, allow more "
            f"instructions, or leave this stance out of the protocol."
        )

    def _ranked(self, steps: list[DanceStep], stances: tuple[Stance, ...], posterior: Array) -> Iterator[DanceStep]:
        """Yield the postures within reach on the next feet, the best first."""
        stance, catalogue = stances[len(steps)], self.reach.catalogue(stances[len(steps)])
        last = steps[-1] if steps else None
        used, late = {step.s for step in steps if step.catalogue is catalogue}, self._late(len(steps), stances)
        found = [step for step in self.reach.after(last, catalogue) if step.s not in used]
        if not found:
            return
        if stance.over is not None:
            least = sorted(found, key=lambda step: (len(step.said), step.s))
            yield from (step for step in least if not late(step))
            return
        still = self.information.white(self._standing(catalogue)[[step.s for step in found]])
        gains = self.information.gains(posterior, still) / self._seconds(found)
        on = (found[k] for k in np.argsort(-gains, kind="stable") if not late(found[k]))
        first = list(islice(on, _LOOKED_AT))
        gains = np.array([float(self.information.gains(posterior, self._rows(last, step))) for step in first])
        yield from (first[k] for k in np.argsort(-gains / self._seconds(first), kind="stable"))
        yield from on

    def _late(self, number: int, stances: tuple[Stance, ...]) -> Callable[[DanceStep], bool]:
        """Return what says whether a posture in place ``number`` cannot be undone before the feet must change."""
        feet = feet_key(stances[number])
        left = next((k for k, one in enumerate(stances[number:]) if feet_key(one) != feet), 0)
        if not left or np.isinf(self.work.plan.instructions):
            return lambda step: False
        goal = self.reach.catalogue(stances[number + left])
        return lambda step: not self.reach.leads(step.catalogue, step.s, goal, left)

    def _seconds(self, steps: list[DanceStep]) -> Array:
        """Return what each step costs, s."""
        plan = self.work.plan
        return np.array([plan.move + plan.hold + _INSTRUCTION * plan.simplicity * len(step.said) for step in steps])

    def _kept(self, step: DanceStep) -> tuple[float, str]:
        """Return by how many deviations imprecise people keep a posture, and the limit that they break, "" if none."""
        if step.key not in self._held:
            found, limit = step.catalogue.keeps(step.s, self.work.plan.limits)
            self._held[step.key] = found, limit if found < ENOUGH else ""
        return self._held[step.key]

    def _can(self, last: DanceStep, step: DanceStep) -> bool:
        return not (self._kept(last)[1] or self._kept(step)[1] or self.move(last, step).limit)

    def move(self, last: DanceStep, step: DanceStep) -> Move:
        """Return the move from one step to the next, as `plain_move` finds it."""
        return self._way(last, step)[0]

    def _way(self, last: DanceStep, step: DanceStep) -> tuple[Move, float]:
        key = (last.x.tobytes(), step.x.tobytes())
        if key not in self._moves:
            task, stances = self.task(last, step), (last.catalogue.stance, step.catalogue.stance)
            self._moves[key] = plain_move(task, lambda move: _room(task, stances, move))
        return self._moves[key]

    def task(self, last: DanceStep, step: DanceStep) -> Task:
        """Return what a move from one step to the next must do."""
        work, (was, now) = self.work, (last.catalogue.stance, step.catalogue.stance)
        slow = _LIFTING if was.planted != now.planted else 1.0
        ends, duration = np.array([last.x, step.x]), slow * work.plan.move
        return Task(work.chain, work.blocks, under(was, now), ends, duration, work.plan.limits)

    def _standing(self, catalogue: Catalogue) -> Array:
        """Return the regressors (S, 6, 10 N) of standing still in all postures of a catalogue."""
        key = feet_key(catalogue.stance)
        if key not in self._still:
            self._still[key] = self.information.standing(catalogue.x)
        return self._still[key]

    def _rows(self, last: DanceStep | None, step: DanceStep) -> Array:
        """Return the whitened rows (m, k) of standing in a posture and of the straight way to it."""
        still = self.information.of_posture(step.x, self._standing(step.catalogue)[step.s])
        if last is None:
            return still
        return np.concatenate([still, self.information.of_ways(np.array([[last.x, step.x]]))[0]])


def _room(task: Task, stances: tuple[Stance, Stance], move: Move) -> tuple[float, str]:
    """Return what imprecise people leave on the way, as `deviations_of_copies` does."""
    still, time = np.full(2, _SHORTLY), np.array([move.duration])
    way = Dance("", task.chain.body, task.ends, stances, still, move.via[None], time, (task.stance,), 0)
    return deviations_of_copies(way, task.limits, still[0] + move.duration * _BETWEEN)


def walked_dance(work: DesignContext, steps: list[DanceStep], moves: list[Move]) -> Dance:
    """Return the dance of ``steps`` and the ``moves`` between them."""
    plan, x = work.plan, np.array([step.x for step in steps])
    stances = tuple(step.catalogue.stance for step in steps)
    hold = np.array([plan.hold_on(stance) for stance in stances])
    feet = tuple(under(*pair) for pair in pairwise(stances))
    via = np.array([move.via for move in moves]).reshape(-1, 2, x.shape[1])
    duration, names = np.array([move.duration for move in moves]), tuple(name_of(step) for step in steps)
    dance = Dance(plan.name, work.chain.body, x, stances, hold, via, duration, feet, work.seed)
    mirrored = tuple(p for p, step in enumerate(steps) if step.mirror)
    return replace(dance, names=names, mirrored=mirrored)


def freer_dance(body: Body, plan: Plan, *, seed: int = 0) -> Dance:
    """Return the dance of as many postures of the same words on the same feet, chosen freely: no limit on instructions,
    no ``simplicity``. Its postures keep the limits and suit imprecise people; its moves go straight and nobody has
    looked at them, so that it only tells what it costs that a dance can be followed.
    """
    free = replace(plan, instructions=np.inf, simplicity=0.0)
    stances = support_sequence(body, free)
    steps = Walk(DesignContext.alone(body, free, seed)).choose(stances)
    x, hold = np.array([step.x for step in steps]), np.full(len(steps), plan.hold)
    via, move = straight_way(x[:-1], x[1:]), np.full(len(x) - 1, plan.move)
    return Dance(plan.name, body, x, stances, hold, via, move, tuple(under(*pair) for pair in pairwise(stances)), seed)
