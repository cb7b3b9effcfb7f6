"""A dance that people can follow: a walk from posture to posture in which one or two parts of the body change.

Every step takes, of all postures within reach of the last one - at most so many instructions away, or its mirror image
- the one that tells most per second (`selection`), where an instruction costs time, too: the price of `simplicity`.
Where the feet must change, only postures count from which they can in time (`reach`). What a posture must keep it keeps
also for people who copy it imprecisely (`catalogue`).
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise

import numpy as np
from scipy.linalg import block_diag

from biodance.dance.dance import Dance
from biodance.dance.followable.centres import CENTRES, told_of_centres
from biodance.dance.followable.plain import AMPLE, ENOUGH, plain_move
from biodance.dance.followable.reach import DanceStep, Reach, feet_key, name_of
from biodance.dance.followable.vocabulary import rest_cut_short
from biodance.dance.performers import deviations_of_copies
from biodance.dance.postures.ordering import learned
from biodance.dance.problem.splines import rest_to_rest
from biodance.dance.problem.stance import Stance, stance_words, under
from biodance.dance.transitions.context import DesignContext
from biodance.dance.transitions.move import Move, Task
from biodance.errors import BiodanceError
from biodance.identification.posterior import prior_factor
from biodance.motion.regressor import regressor
from biodance.records import Array

_INSTRUCTION = 0.5
"""s that one instruction is worth at simplicity 1."""
_FORCE, _MOMENT, _RATE = 8.0, 4.0, 4.0
"""N, N·m, Hz: error of one independent sample of a person's wrench, and how many there are (`selection`)."""
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
_SHORT = 1.0
"""s that postures in between are held."""


class NoWay(BiodanceError):
    """No posture follows on the feet ``stances[number]``; ``stance``, of what is danced, needs that change of feet."""

    def __init__(self, message: str, stances: tuple[Stance, ...], number: int) -> None:
        super().__init__(message)
        before, after = stances[:number][-1:], [one for one in stances[number:] if one.over is None]
        alone = [one for one in before if len(one.planted) == 1 and stances[number].over is not None]
        self.stance = (alone or after or stances[:1])[0].name


@dataclass(eq=False)
class _Place:
    """A place in the walk: the postures ``left`` to try after it, the ``belief`` there, what was ``taken`` to it."""

    left: Iterator[tuple[DanceStep, Move | None]] | None
    belief: Array
    taken: tuple[DanceStep, Move | None] = None  # type: ignore[assignment]


@dataclass(eq=False)
class Walk:
    """The search for one dance; what was worked out is kept, so that another look costs little."""

    work: DesignContext
    _held: dict[tuple[str, int], tuple[float, str]] = field(default_factory=dict)
    _moves: dict[tuple[bytes, bytes], tuple[Move, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        chain, plan = self.work.chain, self.work.plan
        self.reach = Reach(self.work, self._can)
        self.factor = prior_factor(chain.body.sip)
        before = np.sum(self.factor**2, axis=1)
        weight = np.repeat(plan.emphasis(chain.body.segments), 10) * (before > 0)
        self.scale = self.factor * np.sqrt(weight / np.where(before > 0, before, 1.0))[:, None]
        if plan.lively:
            self.factor = np.pad(self.factor, ((0, 0), (0, CENTRES)))
            self.scale = block_diag(self.scale, np.eye(CENTRES))
        self.samples = rest_to_rest(plan.move, via=0, rate=_RATE)

    def take(self, stances: tuple[Stance, ...]) -> tuple[list[DanceStep], list[Move]]:
        """Return one step for each of ``stances`` and the moves between them.

        Raises
        ------
        NoWay
            From some posture no other one can be reached; the message names the limit that most of them break.
        """
        self._check_feet(stances)
        path, farthest = [_Place(None, np.eye(self.factor.shape[1]))], 0
        why: dict[int, dict[str, int]] = {}
        for _ in range(_TRIES):
            number, steps = len(path) - 1, [place.taken[0] for place in path[1:]]
            if number == len(stances):
                return steps, [move for _, move in (place.taken for place in path[1:]) if move is not None]
            farthest = max(farthest, number)
            self.work.tell("postures", number, len(stances))
            if path[-1].left is None:
                broken = why.setdefault(number, {})
                path[-1].left = islice(self.possible(steps, stances, path[-1].belief, broken), _WAYS_ON)
            found = next(path[-1].left, None)
            if found is not None:
                path.append(_Place(None, self.belief_after(path[-1].belief, steps, found[0]), found))
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
        steps, belief = list[DanceStep](), np.eye(self.factor.shape[1])
        for number, stance in enumerate(stances):
            step = next((one for one in self._ranked(steps, stances, belief) if not self._kept(one)[1]), None)
            if step is None:
                raise NoWay(self._stuck(stance, number, {}), stances, number)
            belief = self.belief_after(belief, steps, step)
            steps.append(step)
        return steps

    def belief_after(self, belief: Array, steps: list[DanceStep], step: DanceStep) -> Array:
        """Return what is believed (k, k) when ``step`` follows on ``steps``, before whom it was ``belief``."""
        Z = learned(belief, self._told(steps[-1] if steps else None, step))
        return np.asarray(belief - Z.T @ Z)

    def possible(
        self,
        steps: list[DanceStep],
        stances: tuple[Stance, ...],
        belief: Array,
        why: dict[str, int],
        *,
        wanted: Callable[[DanceStep], bool] = lambda _: True,
    ) -> Iterator[tuple[DanceStep, Move | None]]:
        """Yield the postures that follow and are ``wanted`` with the move to them, the best first, of a handful those
        first that imprecise people surely can; ``why`` counts the limits that others break.
        """
        last, ranked = steps[-1] if steps else None, filter(wanted, self._ranked(steps, stances, belief))
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

    def _ranked(self, steps: list[DanceStep], stances: tuple[Stance, ...], belief: Array) -> Iterator[DanceStep]:
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
        cost = self._seconds(found)
        told = self._gains(belief, self._white(catalogue.standing[[step.s for step in found]]), cost)
        on = (found[k] for k in np.argsort(-told, kind="stable") if not late(found[k]))
        first = list(islice(on, _LOOKED_AT))
        worth = [
            float(np.sum((self.scale @ learned(belief, self._told(last, step)).T) ** 2)) / seconds
            for step, seconds in zip(first, self._seconds(first), strict=True)
        ]
        yield from (first[k] for k in np.argsort(-np.array(worth), kind="stable"))
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

    def _told(self, last: DanceStep | None, step: DanceStep) -> Array:
        """Return the whitened rows (m, k) of standing in a posture and of the straight way to it."""
        still = self._white(step.catalogue.standing[step.s : step.s + 1])[0]
        if self.work.plan.lively:
            still = np.concatenate([still, told_of_centres(self.work.chain, step.x, still.shape[1])])
        if last is None:
            return still
        ends, chain = np.array([last.x, step.x]), self.work.chain
        parts = [
            part[1:-1] @ ends for part in (self.samples.position, self.samples.velocity, self.samples.acceleration)
        ]
        W = regressor(chain.body, chain.motion(np.arange(len(parts[0])) / _RATE, *parts))
        return np.concatenate([still, self._white(np.asarray(W).reshape(1, -1, W.shape[-1]))[0]])

    def _white(self, W: Array) -> Array:
        """Return regressors (G, 6 T, 10 N) per standard deviation of error and of the table, (G, 6 T, k)."""
        error = np.tile(np.repeat([_FORCE, _MOMENT], 3), W.shape[1] // 6)
        flat = (W / error[:, None]).reshape(-1, W.shape[2]) @ self.factor  # one product: many small ones are slow
        return np.asarray(flat.reshape(*W.shape[:2], -1))

    def _gains(self, belief: Array, rows: Array, cost: Array) -> Array:
        """Return what each of ``rows`` (G, m, k) tells per second."""
        spread = rows @ belief
        factor = np.linalg.cholesky(np.eye(rows.shape[1]) + spread @ np.swapaxes(rows, 1, 2))
        Z = np.linalg.solve(factor, spread)
        return np.asarray(np.sum((Z @ self.scale.T) ** 2, axis=(1, 2)) / cost)


def _room(task: Task, stances: tuple[Stance, Stance], move: Move) -> tuple[float, str]:
    """Return what imprecise people leave on the way, as `deviations_of_copies` does."""
    still, time = np.full(2, _SHORTLY), np.array([move.duration])
    way = Dance("", task.chain.body, task.ends, stances, still, move.via[None], time, (task.stance,), 0)
    return deviations_of_copies(way, task.limits, still[0] + move.duration * _BETWEEN)


def walked_dance(work: DesignContext, steps: list[DanceStep], moves: list[Move]) -> Dance:
    """Return the dance of ``steps`` and the ``moves`` between them."""
    plan, x = work.plan, np.array([step.x for step in steps])
    stances = tuple(step.catalogue.stance for step in steps)
    hold = np.array([plan.hold if stance.over is None else min(_SHORT, plan.hold) for stance in stances])
    feet = tuple(under(*pair) for pair in pairwise(stances))
    via = np.array([move.via for move in moves]).reshape(-1, 2, x.shape[1])
    duration, names = np.array([move.duration for move in moves]), tuple(name_of(step) for step in steps)
    dance = Dance(plan.name, work.chain.body, x, stances, hold, via, duration, feet, work.seed)
    mirrored = tuple(p for p, step in enumerate(steps) if step.mirror)
    return replace(dance, names=names, mirrored=mirrored)
