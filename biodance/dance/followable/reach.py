"""Which known posture may follow on which: by what must be called, and by where the dance must go next.

From the last posture others are within reach if at most so many instructions lead there and one or two parts of the
body change, or if it is the mirror image. Whoever must change feet in so many steps (`leads`) is only asked for what
can be undone until then: a trunk that is twisted and a heel that is up behind need one posture more before the foot
is put down.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from biodance.dance.cues import MIRROR_CALL, instructions
from biodance.dance.followable.catalogue import Catalogue
from biodance.dance.followable.vocabulary import Word, read_vocabulary, singular, words_for
from biodance.dance.problem.stance import Stance
from biodance.dance.transitions.context import DesignContext
from biodance.records import Array

_PARTS = 2
"""Parts of the body that change at a time."""


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

    @property
    def key(self) -> tuple[str, int]:
        """What the posture is known by, on whatever way somebody came to it."""
        return feet_key(self.catalogue.stance), self.s


@dataclass(eq=False)
class Reach:
    """The postures of one design and what follows on what, worked out once; ``can`` says whether this body can go from
    one step to another.
    """

    work: DesignContext
    can: Callable[[DanceStep, DanceStep], bool]
    _catalogues: dict[str, Catalogue] = field(default_factory=dict)
    _around: dict[tuple[str, int, int], NDArray[np.intp]] = field(default_factory=dict)
    _going: dict[tuple[str, int, str], bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.words = read_vocabulary()

    def catalogue(self, stance: Stance) -> Catalogue:
        """Return all postures on the feet ``stance``."""
        key = feet_key(stance)
        if key not in self._catalogues:
            rng = np.random.default_rng([self.work.seed, 6])
            chain, plan = self.work.chain, self.work.plan
            self._catalogues[key] = Catalogue.of(chain, stance, words_for(chain.body, plan, stance, self.words, rng))
        return self._catalogues[key]

    def after(self, last: DanceStep | None, catalogue: Catalogue) -> Iterator[DanceStep]:
        """Yield all postures of a catalogue that may follow on the last one."""
        if np.isinf(self.work.plan.instructions):
            yield from (DanceStep(catalogue, s, ()) for s in range(len(catalogue.index)))
            return
        for s in _near(last, catalogue):
            step = self._called(last, catalogue, s)
            if step is not None:
                yield step

    def link(self, last: DanceStep, catalogue: Catalogue, s: int) -> DanceStep | None:
        """Return posture ``s`` as it follows on the last one, None if it may not."""
        return self._called(last, catalogue, s) if s in _near(last, catalogue) else None

    def _called(self, last: DanceStep | None, catalogue: Catalogue, s: int) -> DanceStep | None:
        body, most = self.work.chain.body, self.work.plan.instructions
        if last is not None and last.catalogue is catalogue and s == catalogue.mirrored[last.s]:
            return DanceStep(catalogue, s, MIRROR_CALL, mirror=True)
        before, feet = (np.zeros(self.work.chain.size), None) if last is None else (last.x, last.catalogue.stance)
        said = instructions(body, before, catalogue.x[s], feet, catalogue.stance)
        return DanceStep(catalogue, s, said) if len(said) <= most else None

    def leads(self, catalogue: Catalogue, s: int, goal: Catalogue, steps: int) -> bool:
        """Return whether posture ``s`` leads in at most so many ``steps`` to one of ``goal``, the arms at rest."""
        return any(self._goes(int(row), catalogue, goal) for row in self._within(catalogue, s, steps - 1))

    def _within(self, catalogue: Catalogue, s: int, steps: int) -> NDArray[np.intp]:
        """Return the postures that are so many ``steps`` at most from ``s``, on the same feet, the arms at rest."""
        key = feet_key(catalogue.stance), int(catalogue.arms_at_rest[s]), steps
        if key not in self._around:
            found = np.array([key[1]])
            if steps:
                rows, near = np.unique(catalogue.arms_at_rest), self._within(catalogue, s, steps - 1)
                found = np.array([t for t in rows if t in near or any(self._steps(int(k), catalogue, t) for k in near)])
            self._around[key] = found
        return self._around[key]

    def _steps(self, s: int, catalogue: Catalogue, t: int) -> bool:
        return self.link(DanceStep(catalogue, s, ()), catalogue, t) is not None

    def _goes(self, s: int, catalogue: Catalogue, goal: Catalogue) -> bool:
        """Return whether a posture of ``goal``, the arms at rest, can follow on posture ``s`` of a catalogue."""
        key = feet_key(catalogue.stance), s, feet_key(goal.stance)
        if key not in self._going:
            last = DanceStep(catalogue, s, ())
            near = np.intersect1d(_near(last, goal), np.unique(goal.arms_at_rest))
            steps = (self._called(last, goal, int(t)) for t in near)
            self._going[key] = any(step is not None and self.can(last, step) for step in steps)
        return self._going[key]


def _near(last: DanceStep | None, catalogue: Catalogue) -> list[int]:
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


def feet_key(stance: Stance) -> str:
    """Return what a foot configuration is known by."""
    return f"{stance.name} {stance.planted} {stance.over} {stance.ankle.tobytes().hex()}"


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
    return [singular(word.text.format(side)) for side, word in sides if not word.rest]
