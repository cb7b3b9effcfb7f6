"""Design a dance: postures, their order, postures in between, moves; checked at the end by other code, and never
returned if it fails.

Two processes work side by side: the searches for postures, then the moves, where those that excite the same segments
follow each other and all others do not wait for them. The result depends on body, plan and seed only, not on who was
faster or how often it was interrupted.
"""

from collections.abc import Iterable
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.followable.mending import mended_dance
from biodance.dance.followable.vocabulary import words_left_out
from biodance.dance.followable.walk import NoWay, Walk
from biodance.dance.limits import Limit
from biodance.dance.postures.ordering import choose, order_postures, support_sequence
from biodance.dance.postures.posture import intermediate_posture
from biodance.dance.postures.search import find_postures
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import Stance, under
from biodance.dance.transitions.context import Checkpoint, Course, DesignContext, Tell
from biodance.dance.transitions.schedule import Way, replan
from biodance.dance.verify import Margin, broken, verify_with
from biodance.errors import BiodanceError
from biodance.threads import one_thread

WORKERS = 2


@one_thread()
def design(
    body: Body,
    plan: Plan,
    *,
    limits: Iterable[Limit | type[Limit]] = (),
    seed: int = 0,
    tell: Tell | None = None,
    resume: Path | None = None,
    workers: Executor | None = None,
) -> tuple[Dance, tuple[Margin, ...]]:
    """Return the dance of ``body`` (its limits count) after ``plan``, and what is left of every limit on a grid of 100
    Hz (`verify`).

    ``limits`` are kept beside those of the plan, or in place of one of the same name; ``tell`` is told the progress;
    with ``resume``, a folder, an interrupted design of the same body, plan and seed goes on; ``workers`` run the
    searches (default: two processes).

    Raises
    ------
    BiodanceError
        There is no such dance: the message names the posture or move and the limit that forbids it.
    """
    if workers is None:
        with ProcessPoolExecutor(WORKERS) as pool:
            return design(body, plan, limits=limits, seed=seed, tell=tell, resume=resume, workers=pool)
    plan = plan.with_limits(limits)
    alone = DesignContext.alone(body, plan, seed)
    checkpoint = Checkpoint(resume, body, plan, seed)
    work = replace(alone, checkpoint=checkpoint, workers=workers, tell=tell or alone.tell)
    danced: tuple[Margin, ...] = ()
    if np.isfinite(plan.instructions):
        dance, danced = _followable(work)
    else:
        dance = _joined(work, *replan(work, _postures(work)))
    work.tell("checking every limit", 0, 0)
    margins = tuple(sorted((*verify_with(workers, body, dance, plan.limits), *danced), key=lambda m: m.limit))
    if wrong := broken(tuple(m for m in margins if m not in danced)):
        told = "; ".join(
            f"{m.limit.replace('_', ' ')} by {-m.worst:.3g} {m.unit} at {m.where_s:.2f} s {m.what}" for m in wrong
        )
        raise BiodanceError(
            f"The designed dance breaks limits when it is checked: {told}. Try another seed or a longer move in the "
            f"protocol."
        )
    return dance, margins


def _followable(work: DesignContext) -> tuple[Dance, tuple[Margin, ...]]:
    """Return a dance that people can follow, and what imprecise performers leave; feet on which this person has no
    posture are left out, and this is said.
    """
    plan, notes = work.plan, list[str]()
    while True:
        walk = Walk(replace(work, plan=plan))
        try:
            steps, moves = walk.take(support_sequence(work.chain.body, plan))
            break
        except NoWay as way:
            blocks = tuple(block for block in plan.blocks if block[0] != way.stance)
            if not blocks or len(blocks) == len(plan.blocks):
                raise
            notes.append(f"Left out: all postures {way.stance.replace('_', ' ')}. {way}")
            plan = replace(plan, blocks=blocks)
    dance, found = mended_dance(walk, steps, moves, work.workers)
    lacking = words_left_out(work.chain.body, plan, tuple(step.catalogue.stance for step in steps), walk.reach.words)
    margins = found.margins(dance)
    return replace(dance, notes=(*notes, *lacking, *dance.notes), unsafe=broken(margins)), margins


def _postures(work: DesignContext) -> Course:
    """Return all postures in the order of the dance, those in between included."""
    plan, chain = work.plan, work.chain
    counted = [s for s in support_sequence(chain.body, plan) if s.over is None]
    kept = work.checkpoint.get("postures")
    if kept is None:
        work.tell("postures", 0, len(counted))
        found = find_postures(chain, work.blocks, tuple(counted), plan.limits, seed=work.seed, workers=work.workers)
        kept = {"x": found.x}
        work.checkpoint.put("postures", **kept)
    work.tell("postures", len(counted), len(counted))
    x, names = kept["x"], [s.name for s in counted]
    chosen = range(len(x)) if np.isinf(plan.budget) else choose(chain, x, tuple(names), plan).order
    groups = [[p for p in chosen if names[p] == name] for name in dict.fromkeys(names)]
    order = order_postures(x, [group for group in groups if group])
    blocks_ = tuple((name, len(group)) for name, group in zip(dict.fromkeys(names), groups, strict=True) if group)
    stances = support_sequence(chain.body, replace(plan, blocks=blocks_))
    rows, walked = np.full((len(stances), chain.size), np.nan), iter(order)
    for k, stance in enumerate(stances):
        if stance.over is None:
            rows[k] = x[next(walked)]
    known = np.flatnonzero(~np.isnan(rows[:, 0]))
    for k in sorted(set(range(len(stances))) - set(known)):
        near = [known[known < k][-1], *known[known > k][:1]]
        rows[k] = intermediate_posture(chain, stances[k], rows[near], plan.limits, seed=[work.seed, 2, k]).x
    return Course(rows, stances)


def _joined(work: DesignContext, course: Course, ways: list[Way], notes: tuple[str, ...]) -> Dance:
    """Return the dance of the postures of a course and the ways between them, stops on the way not held."""
    plan, (x, stances) = work.plan, (course.x, course.stances)
    rows, feet, hold, under_ = [x[0]], [stances[0]], [plan.hold], list[Stance]()
    for k, way in enumerate(ways):
        ground = under(stances[k], stances[k + 1])
        under_ += [ground] * len(way.via)
        rows += [*way.stops, x[k + 1]]
        feet += [*[ground] * len(way.stops), stances[k + 1]]
        hold += [*[0.0] * len(way.stops), plan.hold_on(stances[k + 1])]
    via, duration = (np.concatenate([getattr(way, name) for way in ways]) for name in ("via", "duration"))
    feet_, seed = tuple(feet), work.seed
    return Dance(
        plan.name, work.chain.body, np.array(rows), feet_, np.array(hold), via, duration, tuple(under_), seed, notes
    )
