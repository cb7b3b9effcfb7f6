"""Design a dance: postures in order (words that people know, or optimised ones) and the moves between them, repaired
where a limit is broken; checked at the end by other code, and never returned if it fails.

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
from biodance.dance.limits import Limit
from biodance.dance.problem.plan import Plan
from biodance.dance.search.context import Checkpoint, DesignContext, Tell
from biodance.dance.search.optimised_course import optimised_course
from biodance.dance.search.repair import safe_course
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
        dance = optimised_course(work).dance(work)
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
    """Return a dance that people can follow, and what imprecise performers leave."""
    course, found = safe_course(work)
    dance = course.dance(work)
    margins = found.margins(dance)
    return replace(dance, unsafe=broken(margins)), margins
