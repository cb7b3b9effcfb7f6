"""A dance while it is designed: what all stages share and keep on disk, postures in order, and the moves that excite
the inertias, found side by side. Whatever the order of finishing, the dance is the same.
"""

import hashlib
from collections.abc import Callable
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
    """
    return replace(course, moves=_Chains(work, course, attempt).found())


class _Chains:
    """The open moves in one queue for each set of planted feet, and the information of those that are found."""

    def __init__(self, work: DesignContext, course: Course, attempt: int) -> None:
        self.work, self.attempt, self.moves = work, attempt, [*course.moves]
        self.tasks = [move_task(work, *pair) for pair in pairwise(course.steps)]
        nothing = np.zeros((len(work.chain.body.segments), 6, 6))
        self.queue: dict[tuple[int, ...], list[int]] = {task.stance.planted: [] for task in self.tasks}
        self.history: dict[tuple[int, ...], Array] = dict.fromkeys(self.queue, nothing)
        for k, (task, move) in enumerate(zip(self.tasks, self.moves, strict=True)):
            if move is None:
                self.queue[task.stance.planted].append(k)
            else:
                self.history[task.stance.planted] = self.history[task.stance.planted] + move.gram

    def found(self) -> tuple[Move | None, ...]:
        """Return all moves in the order of the course."""
        running: dict[Future[Move], int] = {}
        for planted in self.queue:
            self._advance(planted, running)
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                k, move = running.pop(future), future.result()
                self.work.checkpoint.put(self._name(k), **{one: np.array(getattr(move, one)) for one in _KEPT})
                self._accept(k, move)
                self._advance(self.tasks[k].stance.planted, running)
        return tuple(self.moves)

    def _advance(self, planted: tuple[int, ...], running: dict[Future[Move], int]) -> None:
        """Take up what is kept of this chain, then submit the next of its moves."""
        work, queue = self.work, self.queue[planted]
        while queue:
            k = queue[0]
            kept = work.checkpoint.get(self._name(k))
            if kept is None:
                seed = [work.seed, 3, k, *([self.attempt] if self.attempt else [])]
                running[work.workers.submit(exciting_move, self.tasks[k], self.history[planted], seed)] = k
                return
            via, duration, gram, violation, limit, stops = (kept[name] for name in _KEPT)
            self._accept(k, Move(via, duration, gram, float(violation), str(limit), stops))

    def _accept(self, k: int, move: Move) -> None:
        planted = self.tasks[k].stance.planted
        self.queue[planted].remove(k)
        self.moves[k] = move
        if not move.limit:
            self.history[planted] = self.history[planted] + move.gram
        self.work.tell("moves", sum(move is not None for move in self.moves), len(self.tasks))

    def _name(self, k: int) -> str:
        return f"move_{self.attempt}_{k:03d}"
