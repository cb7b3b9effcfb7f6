"""A dance while it is designed: what all stages share and keep on disk, postures in order, and the moves that excite
the inertias, found side by side. Whatever the order of finishing, the dance is the same.
"""

import hashlib
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body, body_text
from biodance.dance.dance import Dance
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import Blocks, excitation_blocks
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import Stance, feet_in_move
from biodance.dance.search.known_postures import PostureTable
from biodance.dance.search.move import Move, Task, exciting_move
from biodance.records import Array

ROOMS = ("body", "dance", "identification", "motion", "uncertainty", "spatial.py")
"""Whose code decides what a dance becomes."""


class Checkpoint:
    """Named arrays in a folder that belongs to one body, plan, seed and state of the code; nothing without a folder."""

    def __init__(self, folder: Path | None, body: Body, plan: Plan, seed: int) -> None:
        key = hashlib.sha256(f"{code()}{body_text(body, '')}{plan!r}{seed}".encode()).hexdigest()[:16]
        self.folder = folder / f"dance_{key}" if folder else None
        if self.folder:
            self.folder.mkdir(parents=True, exist_ok=True)

    def get(self, name: str) -> dict[str, Array] | None:
        """Return what was kept under ``name``, or None; a file that was cut off while written counts as nothing."""
        path = self.folder / f"{name}.npz" if self.folder else None
        if path is None or not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as found:
                return {key: found[key] for key in found.files}
        except (OSError, ValueError, EOFError):
            return None

    def put(self, name: str, **arrays: NDArray[Any]) -> None:
        """Keep arrays under ``name``."""
        if self.folder:
            part = self.folder / f"{name}.part.npz"
            np.savez(part, allow_pickle=False, **arrays)
            part.replace(self.folder / f"{name}.npz")


@cache
def code() -> str:
    """Return a hash of the source of all `ROOMS`: what older code found does not fit what newer code finds."""
    package = Path(__file__).parents[2]
    files = sorted(file for file in package.rglob("*.py") if file.relative_to(package).parts[0] in ROOMS)
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


Tell = Callable[[str, int, int], None]
"""Told what is being done, how many parts are finished and of how many."""


@dataclass(frozen=True, eq=False)
class DesignContext:
    """One design: ``chain`` of the body, ``blocks`` that count, ``plan``, ``seed`` of all random numbers; what is
    finished goes to ``checkpoint``, ``workers`` search side by side, ``tell`` is told the progress.
    """

    chain: Chain
    blocks: Blocks
    plan: Plan
    seed: int
    checkpoint: Checkpoint
    workers: Executor
    tell: Tell

    @classmethod
    def alone(cls, body: Body, plan: Plan, seed: int) -> "DesignContext":
        """Return a design that keeps nothing, tells nobody and works on one thread."""
        parts = excitation_blocks(body)
        parts = replace(parts, weight=parts.weight * plan.emphasis(body.segments), simplicity=plan.simplicity)
        return cls(
            Chain(body), parts, plan, seed, Checkpoint(None, body, plan, seed), ThreadPoolExecutor(1), lambda *_: None
        )


@dataclass(frozen=True, eq=False)
class DanceStep:
    """Posture ``s`` of a ``table``, what is ``said`` on the way there; ``mirror`` True for the last one's image."""

    table: PostureTable
    s: int = 0
    said: tuple[str, ...] = ()
    mirror: bool = False

    @property
    def x(self) -> Array:
        """(n,) coordinates of the chain."""
        return np.asarray(self.table.x[self.s])

    @property
    def stance(self) -> Stance:
        """The feet on which it is held."""
        return self.table.stance

    @property
    def name(self) -> str:
        """What people call it; "" where they have no words for it."""
        return self.table.name_of(self.s)

    @property
    def key(self) -> tuple[str, int]:
        """What the posture is known by, on whatever way somebody came to it."""
        return self.stance.key, self.s


@dataclass(frozen=True, eq=False)
class Course:
    """The ``steps`` (P) of a dance, those in between included, the ``moves`` (P - 1) between them, None where they are
    not found yet, and in sentences what differs from the plan.
    """

    steps: tuple[DanceStep, ...]
    moves: tuple[Move | None, ...]
    notes: tuple[str, ...] = ()

    @property
    def x(self) -> Array:
        """(P, n) coordinates."""
        return np.array([step.x for step in self.steps])

    @property
    def stances(self) -> tuple[Stance, ...]:
        """(P,) feet."""
        return tuple(step.stance for step in self.steps)

    def spliced(
        self, first: int, last: int, steps: tuple[DanceStep, ...], moves: tuple[Move | None, ...] | None = None
    ) -> "Course":
        """Return the course with ``steps`` in place of those from ``first`` up to ``last`` (not included), and with the
        ``moves`` to, between and from them; without these they are yet to be found.
        """
        every = (*self.steps[:first], *steps, *self.steps[last:])
        before, after = self.moves[: max(0, first - 1)], self.moves[last:]
        if moves is None:
            moves = (None,) * (len(every) - 1 - len(before) - len(after))
        return replace(self, steps=every, moves=(*before, *moves, *after))

    def dance(self, work: DesignContext) -> Dance:
        """Return the dance; stops on the way are not held."""
        plan, start = work.plan, self.steps[0]
        rows, stances, hold, feet = [start.x], [start.stance], [plan.hold_on(start.stance)], list[Stance]()
        via, seconds = [np.empty((0, 2, start.x.size))], [np.empty(0)]
        for (before, after), move in zip(pairwise(self.steps), self.moves, strict=True):
            assert move is not None
            ground, stops = feet_in_move(before.stance, after.stance), len(move.stops)
            rows += [*move.stops, after.x]
            stances += [*[ground] * stops, after.stance]
            hold += [*[0.0] * stops, plan.hold_on(after.stance)]
            feet += [ground] * len(move.via)
            via.append(move.via)
            seconds.append(move.duration)
        names = tuple(step.name for step in self.steps)
        return Dance(
            plan.name,
            work.chain.body,
            np.array(rows),
            tuple(stances),
            np.array(hold),
            np.concatenate(via),
            np.concatenate(seconds),
            tuple(feet),
            work.seed,
            self.notes,
            names=names if all(names) else (),
            mirrored=tuple(p for p, step in enumerate(self.steps) if step.mirror),
        )


def move_task(work: DesignContext, before: DanceStep, after: DanceStep, *, slower: float = 1.0) -> Task:
    """Return what the move between two steps must do, ``slower`` times as long as the plan's."""
    feet, ends = feet_in_move(before.stance, after.stance), np.array([before.x, after.x])
    return Task(work.chain, work.blocks, feet, ends, slower * work.plan.move, work.plan.limits)


_KEPT = ("via", "duration", "gram", "violation", "limit", "stops")  # What a checkpoint keeps of a move


def with_exciting_moves(work: DesignContext, course: Course, attempt: int = 0) -> Course:
    """Return the course with those moves found that it lacks; ``attempt`` numbers the courses of one design. A move
    that breaks a limit says so (``Move.limit``); those after it are found all the same.

    Moves on the same planted feet are found one after the other, as each excites what those before it did not; of
    other feet side by side.
    """
    moves, tasks = [*course.moves], [move_task(work, *pair) for pair in pairwise(course.steps)]

    def on_feet(planted: tuple[int, ...]) -> Iterator[Future[Move]]:
        """Yield the search for one open move after the other; the next is asked for when it is done."""
        own = [k for k, task in enumerate(tasks) if task.stance.planted == planted]
        history = np.zeros((len(work.chain.body.segments), 6, 6))
        for known in (moves[k] for k in own):
            history = history if known is None else history + known.gram
        for k in [k for k in own if moves[k] is None]:
            name = f"move_{attempt}_{k:03d}"
            kept = work.checkpoint.get(name)
            if kept is None:
                seed = [work.seed, 3, k, *([attempt] if attempt else [])]
                yield (search := work.workers.submit(exciting_move, tasks[k], history, seed))
                move = search.result()
                work.checkpoint.put(name, **{one: np.array(getattr(move, one)) for one in _KEPT})
            else:
                via, duration, gram, violation, limit, stops = (kept[one] for one in _KEPT)
                move = Move(via, duration, gram, float(violation), str(limit), stops)
            moves[k] = move
            history = history if move.limit else history + move.gram
            work.tell("moves", sum(move is not None for move in moves), len(tasks))

    running = dict[Future[Move], Iterator[Future[Move]]]()
    going = [on_feet(planted) for planted in dict.fromkeys(task.stance.planted for task in tasks)]
    while going:
        running |= {search: one for one in going if (search := next(one, None)) is not None}
        going = [running.pop(search) for search in wait(running, return_when=FIRST_COMPLETED).done]
    return replace(course, moves=tuple(moves))
