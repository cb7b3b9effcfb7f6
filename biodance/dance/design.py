"""Design a dance: postures, their order, postures in between, moves; checked at the end by other code, and never returned if it fails.

Two processes work side by side: the searches for postures, then the moves, where those that excite the same segments follow each other and
all others do not wait for them. The result depends on body, plan and seed only, not on who was faster or how often it was interrupted.
"""

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.dance.between import middle_posture
from biodance.dance.chain import Chain
from biodance.dance.dance import Dance
from biodance.dance.excitation import Blocks, blocks
from biodance.dance.ledger import Ledger
from biodance.dance.order import walk
from biodance.dance.plan import Plan
from biodance.dance.postures import find_postures
from biodance.dance.selection import choose
from biodance.dance.sequence import sequence, under
from biodance.dance.stance import Stance
from biodance.dance.transitions import Task
from biodance.dance.verify import broken, verify
from biodance.dance.ways import Way, find_way
from biodance.errors import BiodanceError
from biodance.records import Array

WORKERS = 2
SHORT = 1.0
"""s that postures in between are held."""
Tell = Callable[[str, int, int], None]
"""Told what is being done, how many parts are finished and of how many."""


@dataclass(frozen=True, eq=False)
class _Work:
    """What all stages need."""

    chain: Chain
    blocks: Blocks
    plan: Plan
    seed: int
    ledger: Ledger
    workers: Executor
    tell: Tell


def design(
    body: Body, plan: Plan, *, seed: int = 0, tell: Tell | None = None, resume: Path | None = None, workers: Executor | None = None
) -> Dance:
    """Return the dance of ``body`` (its limits count) after ``plan``; every limit holds on a grid of 100 Hz (`verify`).

    ``tell`` is told the progress; with ``resume``, a folder, an interrupted design of the same body, plan and seed goes on; ``workers``
    run the searches (default: two processes).

    Raises
    ------
    BiodanceError
        There is no such dance: the message names the posture or move and the limit that forbids it.
    """
    if workers is None:
        with ProcessPoolExecutor(WORKERS) as pool:
            return design(body, plan, seed=seed, tell=tell, resume=resume, workers=pool)
    chain, parts = Chain(body), blocks(body)
    parts = replace(parts, weight=parts.weight * plan.emphasis(body.segments), simplicity=plan.simplicity)
    work = _Work(chain, parts, plan, seed, Ledger(resume, body, plan, seed), workers, tell or (lambda what, done, of: None))
    x, stances = _postures(work)
    dance = _joined(work, x, stances, _ways(work, x, stances))
    wrong = broken(verify(body, dance, plan))
    if wrong:
        told = "; ".join(f"{m.limit.replace('_', ' ')} by {-m.worst:.3g} {m.unit} at {m.where_s:.2f} s {m.what}" for m in wrong)
        raise BiodanceError(
            f"The designed dance breaks limits when it is checked: {told}. Try another seed or a longer move in the protocol."
        )
    return dance


def _postures(work: _Work) -> tuple[Array, list[Stance]]:
    """Return all postures (P, n) in the order of the dance, those in between included, and their stances."""
    plan, chain = work.plan, work.chain
    counted = [s for s in sequence(chain.body, plan) if s.over is None]
    kept = work.ledger.get("postures")
    if kept is None:
        work.tell("postures", 0, len(counted))
        found = find_postures(chain, work.blocks, tuple(counted), seed=work.seed, workers=work.workers)
        kept = {"x": found.x}
        work.ledger.put("postures", **kept)
    work.tell("postures", len(counted), len(counted))
    x, names = kept["x"], [s.name for s in counted]
    chosen = range(len(x)) if np.isinf(plan.budget) else choose(chain, x, tuple(names), plan).order
    groups = [[p for p in chosen if names[p] == name] for name in dict.fromkeys(names)]
    order = walk(x, [group for group in groups if group])
    blocks_ = tuple((name, len(group)) for name, group in zip(dict.fromkeys(names), groups, strict=True) if group)
    stances = list(sequence(chain.body, replace(plan, blocks=blocks_)))
    rows, walked = np.full((len(stances), chain.size), np.nan), iter(order)
    for k, stance in enumerate(stances):
        if stance.over is None:
            rows[k] = x[next(walked)]
    known = np.flatnonzero(~np.isnan(rows[:, 0]))
    for k in sorted(set(range(len(stances))) - set(known)):
        near = [known[known < k][-1], *known[known > k][:1]]
        rows[k] = middle_posture(chain, stances[k], rows[near], seed=[work.seed, 2, k]).x
    return rows, stances


def _ways(work: _Work, x: Array, stances: list[Stance]) -> list[Way]:
    """Return the ways between all postures, found in chains of those that excite the same segments."""
    chain, count = work.chain, len(x) - 1
    tasks = [Task(chain, work.blocks, under(stances[k], stances[k + 1]), x[k : k + 2], work.plan.move) for k in range(count)]
    queue: dict[tuple[int, ...], list[int]] = {}
    for k, task in enumerate(tasks):
        queue.setdefault(task.stance.planted, []).append(k)
    history = {feet: np.zeros((len(chain.body.segments), 6, 6)) for feet in queue}
    found: dict[int, Way] = {}
    running: dict[Future[Way], int] = {}

    def advance(feet: tuple[int, ...]) -> None:
        """Take up what is kept of this chain, then submit the next of its moves."""
        while queue[feet]:
            k = queue[feet][0]
            kept = work.ledger.get(f"move_{k:03d}")
            if kept is None:
                running[work.workers.submit(find_way, tasks[k], work.plan, history[feet], [work.seed, 3, k])] = k
                return
            accept(k, Way(kept["via"], kept["duration"], kept["stops"], kept["gram"]))

    def accept(k: int, way: Way) -> None:
        feet = tasks[k].stance.planted
        queue[feet].remove(k)
        found[k], history[feet] = way, history[feet] + way.gram
        work.tell("moves", len(found), count)

    for feet in queue:
        advance(feet)
    while running:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            k = running.pop(future)
            way = future.result()
            if way.limit:
                raise BiodanceError(_impossible(stances, k, way))
            work.ledger.put(f"move_{k:03d}", via=way.via, duration=way.duration, stops=way.stops, gram=way.gram)
            accept(k, way)
            advance(tasks[k].stance.planted)
    return [found[k] for k in range(count)]


def _joined(work: _Work, x: Array, stances: list[Stance], ways: list[Way]) -> Dance:
    """Return the dance of postures x (P, n) and the ways between them, stops on the way included, which are not held."""
    plan = work.plan
    rows, feet, hold, under_ = [x[0]], [stances[0]], [plan.hold], list[Stance]()
    for k, way in enumerate(ways):
        ground = under(stances[k], stances[k + 1])
        under_ += [ground] * len(way.via)
        rows += [*way.stops, x[k + 1]]
        feet += [*[ground] * len(way.stops), stances[k + 1]]
        hold += [*[0.0] * len(way.stops), plan.hold if stances[k + 1].over is None else min(SHORT, plan.hold)]
    via, duration = (np.concatenate([getattr(way, name) for way in ways]) for name in ("via", "duration"))
    return Dance(plan.name, work.chain.body, np.array(rows), tuple(feet), np.array(hold), via, duration, tuple(under_), work.seed)


def _impossible(stances: list[Stance], k: int, way: Way) -> str:
    return (
        f"The move from posture {k + 1} to {k + 2} of {len(stances)} ({stances[k].name} to {stances[k + 1].name}) cannot be made: "
        f"{way.limit.replace('_', ' ')} is exceeded even slowly and by way of a posture in between. "
        "Try another seed, fewer postures on these feet, or a wider limit."
    )
