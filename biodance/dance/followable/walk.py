"""A dance that people can follow: a walk from posture to posture in which one or two parts of the body change.

Every step takes, of all postures within reach of the last one - at most so many instructions away, or its mirror image
- the one that tells most per second (`selection`), where an instruction costs time, too: the price of `simplicity`.
What a posture must keep it keeps also for people who copy it imprecisely (`catalogue`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from biodance.dance.cues import MIRROR_CALL, instructions
from biodance.dance.dance import Dance
from biodance.dance.followable.catalogue import Catalogue
from biodance.dance.followable.plain import plain_move
from biodance.dance.followable.vocabulary import Word, read_vocabulary, words_for
from biodance.dance.performers import lost_by_copies
from biodance.dance.postures.selection import learned
from biodance.dance.problem.splines import rest_to_rest
from biodance.dance.problem.stance import Stance, under
from biodance.dance.transitions.context import DesignContext
from biodance.dance.transitions.move import Move, Task
from biodance.errors import BiodanceError
from biodance.identification.posterior import prior_factor
from biodance.motion.regressor import regressor
from biodance.records import Array

_PARTS = 2
"""Parts of the body that change at a time."""
_INSTRUCTION = 0.5
"""s that one instruction is worth at simplicity 1."""
_FORCE, _MOMENT, _RATE = 8.0, 4.0, 4.0
"""N, N·m, Hz: error of one independent sample of a person's wrench, and how many there are (`selection`)."""
_TRIES = 200
"""Postures that are taken or given up before a walk is."""
_BETWEEN = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Shares of a move at which imprecise people must have room, too."""
_LIFTING = 1.4
"""Times as long as others that a move takes in which a foot is lifted or put down."""
_LOOKED_AT = 24
"""Postures that tell most standing still, whose ways are judged, too."""


@dataclass(frozen=True, eq=False)
class DanceStep:
    """Posture ``s`` of a ``catalogue``, what is ``said`` on the way to it; ``mirror`` True for the last one's image."""

    catalogue: Catalogue
    s: int
    said: tuple[str, ...]
    mirror: bool = False

    @property
    def x(self) -> Array:
        """(n,) coordinates."""
        return np.asarray(self.catalogue.x[self.s])

    @property
    def words(self) -> dict[str, Word]:
        """The word of every part."""
        return self.catalogue.chosen(self.s)


@dataclass(eq=False)
class _Place:
    """A place in the walk: the postures ``left`` to try after it, the ``belief`` there, what was ``taken`` to it."""

    left: Iterator[tuple[DanceStep, Move | None]] | None
    belief: Array
    taken: tuple[DanceStep, Move | None] = None  # type: ignore[assignment]


@dataclass(eq=False)
class Walk:
    """The search for one dance: what was worked out is kept, so that another round with other ``banned`` postures
    (feet, number: the limit that somebody broke there) costs little.
    """

    work: DesignContext
    banned: dict[tuple[str, int], str] = field(default_factory=dict)
    _catalogues: dict[str, Catalogue] = field(default_factory=dict)
    _broken: dict[tuple[str, int], str] = field(default_factory=dict)
    _moves: dict[tuple[bytes, bytes], Move] = field(default_factory=dict)

    def __post_init__(self) -> None:
        chain, plan = self.work.chain, self.work.plan
        self.words, self.factor = read_vocabulary(), prior_factor(chain.body.sip)
        before = np.sum(self.factor**2, axis=1)
        weight = np.repeat(plan.emphasis(chain.body.segments), 10) * (before > 0)
        self.scale = self.factor * np.sqrt(weight / np.where(before > 0, before, 1.0))[:, None]
        self.samples = rest_to_rest(plan.move, via=0, rate=_RATE)

    def take(self, stances: tuple[Stance, ...]) -> tuple[list[DanceStep], list[Move]]:
        """Return one step for each of ``stances`` and the moves between them.

        Raises
        ------
        BiodanceError
            From some posture no other one can be reached; the message names the limit that most of them break.
        """
        path = [_Place(None, np.eye(self.factor.shape[1]))]
        why: dict[str, int] = {}
        for _ in range(_TRIES):
            number, taken = len(path) - 1, [place.taken for place in path[1:]]
            if number == len(stances):
                return [step for step, _ in taken], [move for _, move in taken if move is not None]
            self.work.tell("postures", number, len(stances))
            steps = [step for step, _ in taken]
            path[-1].left = path[-1].left or self._possible(steps, stances[number], path[-1].belief, why)
            found = next(path[-1].left, None)
            if found is not None:
                Z = learned(path[-1].belief, self._told(steps[-1] if steps else None, found[0]))
                path.append(_Place(None, path[-1].belief - Z.T @ Z, found))
            elif number:
                path.pop()
            else:
                break
        raise BiodanceError(self._stuck(stances[max(0, len(path) - 1)], len(path) - 1, why))

    def choose(self, stances: tuple[Stance, ...]) -> list[DanceStep]:
        """Return one step for each of ``stances``, as `take` does, without a look at the moves between them."""
        steps, belief = list[DanceStep](), np.eye(self.factor.shape[1])
        for number, stance in enumerate(stances):
            step = next((one for one in self._ranked(steps, stance, belief) if not self._wrong(one)), None)
            if step is None:
                raise BiodanceError(self._stuck(stance, number, {}))
            Z = learned(belief, self._told(steps[-1] if steps else None, step))
            belief = belief - Z.T @ Z
            steps.append(step)
        return steps

    def _possible(
        self, steps: list[DanceStep], stance: Stance, belief: Array, why: dict[str, int]
    ) -> Iterator[tuple[DanceStep, Move | None]]:
        """Yield the postures that follow on these feet with the move to them, the best first; ``why`` counts the limits
        that others break.
        """
        last = steps[-1] if steps else None
        for step in self._ranked(steps, stance, belief):
            move = None if last is None or self._wrong(step) else self._move(last, step)
            broken = self._wrong(step) or (move.limit if move is not None else "")
            if not broken:
                yield step, move
            else:
                why[broken] = why.get(broken, 0) + 1

    def _stuck(self, stance: Stance, number: int, why: dict[str, int]) -> str:
        most = max(why, key=lambda name: why[name]).replace("_", " ") if why else "number of instructions"
        return (
            f"No posture {stance.name.replace('_', ' ')} can be reached from posture {number}: most of those within "
            f"{self.work.plan.instructions:g} instructions exceed the limit on {most}. Try another seed, which "
            f"draws other postures; else widen that limit, allow more instructions, or leave this stance out of the "
            f"protocol."
        )

    def _ranked(self, steps: list[DanceStep], stance: Stance, belief: Array) -> Iterator[DanceStep]:
        """Yield the postures within reach on these feet, the best first."""
        catalogue = self._catalogue(stance)
        last = steps[-1] if steps else None
        used = {step.s for step in steps if step.catalogue is catalogue}
        found = [step for step in self._reach(last, catalogue) if step.s not in used]
        if stance.over is not None:
            yield from sorted(found, key=lambda step: (len(step.said), step.s))
            return
        cost = self._seconds(found)
        told = self._gains(belief, self._white(catalogue.standing[[step.s for step in found]]), cost)
        order = np.argsort(-told, kind="stable")
        first = [found[k] for k in order[:_LOOKED_AT]]
        worth = [
            float(np.sum((self.scale @ learned(belief, self._told(last, step)).T) ** 2)) / seconds
            for step, seconds in zip(first, self._seconds(first), strict=True)
        ]
        yield from (first[k] for k in np.argsort(-np.array(worth), kind="stable"))
        yield from (found[k] for k in order[_LOOKED_AT:])

    def _seconds(self, steps: list[DanceStep]) -> Array:
        """Return what each step costs, s."""
        plan = self.work.plan
        return np.array([plan.move + plan.hold + _INSTRUCTION * plan.simplicity * len(step.said) for step in steps])

    def _reach(self, last: DanceStep | None, catalogue: Catalogue) -> Iterator[DanceStep]:
        """Yield all postures of a catalogue that can be reached from the last one within the instructions."""
        body, most = self.work.chain.body, self.work.plan.instructions
        if np.isinf(most):
            yield from (DanceStep(catalogue, s, ()) for s in range(len(catalogue.index)))
            return
        zero = np.zeros(self.work.chain.size)
        mirror = catalogue.mirrored[last.s] if last is not None and last.catalogue is catalogue else -1
        for s in self._near(last, catalogue):
            before, feet = (zero, None) if last is None else (last.x, last.catalogue.stance)
            said = instructions(body, before[6:], catalogue.x[s, 6:], feet, catalogue.stance)
            if s == mirror:
                yield DanceStep(catalogue, s, MIRROR_CALL, mirror=True)
            elif len(said) <= most:
                yield DanceStep(catalogue, s, said)

    def _near(self, last: DanceStep | None, catalogue: Catalogue) -> list[int]:
        """Return the postures that differ in few parts of the body from the last one, and its mirror image."""
        was = {part: word.key for part, word in last.words.items()} if last is not None else {}
        off = np.zeros(len(catalogue.index), dtype=int)
        for column, part in enumerate(catalogue.parts):
            keys = np.array([word.key for word in catalogue.words[part]])[catalogue.index[:, column]]
            off += keys != was.get(part, catalogue.words[part][0].key)
        near = np.flatnonzero(off <= _PARTS).tolist()
        if last is not None and last.catalogue is catalogue and catalogue.mirrored[last.s] >= 0:
            near = sorted({*near, int(catalogue.mirrored[last.s])})
        return near

    def _catalogue(self, stance: Stance) -> Catalogue:
        key = _feet(stance)
        if key not in self._catalogues:
            rng = np.random.default_rng([self.work.seed, 6])
            chain, plan = self.work.chain, self.work.plan
            self._catalogues[key] = Catalogue.of(chain, stance, words_for(chain.body, plan, stance, self.words, rng))
        return self._catalogues[key]

    def key(self, step: DanceStep) -> tuple[str, int]:
        """Return what a posture is known by in ``banned``."""
        return _feet(step.catalogue.stance), step.s

    def _wrong(self, step: DanceStep) -> str:
        key = self.key(step)
        if key in self.banned:
            return self.banned[key]
        if key not in self._broken:
            self._broken[key] = step.catalogue.keeps(step.s, self.work.plan.limits)
        return self._broken[key]

    def _move(self, last: DanceStep, step: DanceStep) -> Move:
        key = (last.x.tobytes(), step.x.tobytes())
        if key not in self._moves:
            feet, plan = under(last.catalogue.stance, step.catalogue.stance), self.work.plan
            stances = (last.catalogue.stance, step.catalogue.stance)
            slow = _LIFTING if stances[0].planted != stances[1].planted else 1.0
            ends, duration = np.array([last.x, step.x]), slow * plan.move
            task = Task(self.work.chain, self.work.blocks, feet, ends, duration, plan.limits)
            self._moves[key] = plain_move(task, lambda move: _lost(task, stances, move))
        return self._moves[key]

    def _told(self, last: DanceStep | None, step: DanceStep) -> Array:
        """Return the whitened rows (m, k) of standing in a posture and of the straight way to it."""
        still = self._white(step.catalogue.standing[step.s : step.s + 1])[0]
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
        return np.asarray((W / error[:, None]) @ self.factor)

    def _gains(self, belief: Array, rows: Array, cost: Array) -> Array:
        """Return what each of ``rows`` (G, m, k) tells per second."""
        spread = rows @ belief
        factor = np.linalg.cholesky(np.eye(rows.shape[1]) + spread @ np.swapaxes(rows, 1, 2))
        Z = np.linalg.solve(factor, spread)
        return np.asarray(np.sum((Z @ self.scale.T) ** 2, axis=(1, 2)) / cost)


def _feet(stance: Stance) -> str:
    return f"{stance.name} {stance.planted} {stance.over} {stance.ankle.tobytes().hex()}"


def _lost(task: Task, stances: tuple[Stance, Stance], move: Move) -> str:
    """Return the limit of which imprecise people leave too little on the way, "" if none."""
    still, time = np.ones(2), np.array([move.duration])
    way = Dance("", task.chain.body, task.ends, stances, still, move.via[None], time, (task.stance,), 0)
    return lost_by_copies(way, task.limits, still[0] + move.duration * _BETWEEN)


def name_of(step: DanceStep) -> str:
    """Return what a posture is called: the words of all parts that do not rest; of arms that do the same, once."""
    words = step.words
    out = []
    for part, word in words.items():
        if part.endswith("_arm") or part.endswith("_hanging"):
            continue
        if not word.rest or part.endswith("_lifted"):
            out.append(word.text)
    for kind in ("arm", "hanging"):
        pair = [words[f"{side}_{kind}"] for side in ("right", "left") if f"{side}_{kind}" in words]
        out += _pair_words(pair)
    return ", ".join(out) or ("sit" if "right_hanging" in words else "stand")


def _pair_words(pair: list[Word]) -> list[str]:
    if not pair or all(word.rest for word in pair):
        return []
    if pair[0].key == pair[1].key:
        return [pair[0].text.format("both")]
    sides = zip(("the right", "the left"), pair, strict=True)
    return [_one(word.text.format(side)) for side, word in sides if not word.rest]


def _one(text: str) -> str:
    for many, one in (
        ("arms", "arm"),
        ("forearms", "forearm"),
        ("elbows", "elbow"),
        ("legs", "leg"),
        ("thighs", "thigh"),
    ):
        text = text.replace(f"{many} ", f"{one} ", 1)
    return text
