"""Design a dance: postures in order (words that people know, or optimised ones) and the moves between them. Where an
imprecise performer comes too near a limit, another move, another posture or none is tried at that place, and the same
people dance it again. Checked at the end by other code; the result depends on body, plan and seed only.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from itertools import combinations, islice
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.limits import Limit, Margin
from biodance.dance.limits._person import ArmLift
from biodance.dance.performers import OF_PERFORMERS, PERFORMER_COUNT, PerformersResult, try_performers
from biodance.dance.problem.plan import Plan
from biodance.dance.search.course import Checkpoint, Course, DanceStep, DesignContext, Tell
from biodance.dance.search.move import AMPLE, ENOUGH, other_moves
from biodance.dance.search.optimised_course import optimised_course
from biodance.dance.search.word_course import LEAST, NoNextPosture, WordSearch, word_course
from biodance.dance.verify import broken, verify_with
from biodance.errors import BiodanceError
from biodance.threads import one_thread

_ROUNDS = 6  # Times that all performers dance the whole dance at most
_OTHERS = 6  # Postures that are tried in the place of one
_FEW = 40  # Performers of a first look


_Other = tuple[Course, tuple[int, ...]]  # A course, and the postures where it differs


def safe_course(work: DesignContext) -> tuple[Course, PerformersResult]:
    """Return a course as all performers can dance it, and what they leave of the limits.

    People who tire (a gentle plan) or whose arms stay near the body are first asked only for what leaves imprecise
    people `AMPLE` room, others where a course with `ENOUGH` could not be repaired; both where less than a third of the
    plan is left. If none is safe, the longest stretch of it is danced at which nobody comes too near a limit; if there
    is none, the course as it is.

    Raises
    ------
    NoNextPosture
        There is no course.
    """
    found, missing = list[tuple[Course, PerformersResult]](), list[NoNextPosture]()
    plan = work.plan
    near = plan.holds or plan.hanging or any(isinstance(limit, ArmLift) for limit in plan.limits)
    for enough in (AMPLE, ENOUGH) if plan.gentle or near else (ENOUGH, AMPLE):
        search = WordSearch(work, enough)
        try:
            found.append(repaired_course(search, word_course(search), work.workers))
        except NoNextPosture as why:
            missing.append(why)
        else:
            if found[-1][1].safe and len(found[-1][0].steps) >= plan.count / 3:
                return found[-1]
    if not found:
        raise missing[0]
    if safe := [one for one in found if one[1].safe]:
        return max(safe, key=lambda one: len(one[0].steps))
    shorter = safe_stretch(*found[0])
    return found[0] if shorter is None else repaired_course(WordSearch(work), shorter, work.workers)


def safe_stretch(course: Course, found: PerformersResult) -> Course | None:
    """Return the longest part of a course at no posture of which somebody came too near a limit, from both feet to both
    feet; None where not even two postures follow on each other.
    """
    bad, feet = {p for p, _ in found.bad}, course.stances
    ends = [len(one.planted) != 1 and one.over is None for one in feet]
    parts = [
        (first, last)
        for first, last in combinations(range(len(feet)), LEAST)
        if ends[first] and ends[last] and not bad.intersection(range(first, last + 1))
    ]
    if not parts:
        return None
    first, last = max(parts, key=lambda part: part[1] - part[0])
    limits = " and ".join(sorted({limit.replace("_", " ") for _, limit in found.bad}))
    note = (
        f"Left out: {len(feet) - (last + 1 - first)} of {len(feet)} postures, so that nobody who copies the "
        f"dance imprecisely comes too near the limit on {limits}."
    )
    steps = replace(course.steps[first], mirror=False), *course.steps[first + 1 : last + 1]
    return Course(steps, course.moves[first:last], (*course.notes, note))


def repaired_course(search: WordSearch, course: Course, workers: Executor) -> tuple[Course, PerformersResult]:
    """Return the course as all performers can dance it, and what they leave of the limits; if it could not be repaired,
    as well as it could be.
    """
    for number in range(_ROUNDS):
        search.work.tell("performers", number, 0)
        danced = course
        found = try_performers(danced.dance(search.work), search.work.plan.limits, workers=workers)
        for p in sorted({p for p, _ in found.bad}, reverse=True):  # what is left out moves no earlier place
            course = _repaired_at(search, course, p, found, workers)
        if found.safe or course is danced:
            break
    return danced, found


def _repaired_at(search: WordSearch, course: Course, p: int, found: PerformersResult, workers: Executor) -> Course:
    """Return the course with another move to posture ``p`` or another posture there that is safe or nearest to it."""
    best, most = course, _room(search, course, (p,), found.failed, workers)
    for other, only in _others(search, course, p, found):
        room = _room(search, other, only, found.failed, workers)
        if room >= 0:
            return other
        if room > most:
            best, most = other, room
    return best


def _room(
    search: WordSearch, course: Course, only: tuple[int, ...], first: tuple[int, ...], workers: Executor
) -> float:
    """Return how far, in scales, the worst performer stays from what is demanded in postures ``only``."""
    limits, dance, room = search.work.plan.limits, course.dance(search.work), float("inf")
    scale = {f"{limit.name}_{OF_PERFORMERS}": limit.scale for limit in limits}
    others = tuple(k for k in range(PERFORMER_COUNT) if k not in first)
    for who in (first, others[:_FEW], others[_FEW:]):
        found = try_performers(dance, limits, who=who, only=only, workers=workers)
        room = min(room, *(one.worst / scale[one.limit] for one in found.margins))
        if room < 0:
            break
    return room


def _others(search: WordSearch, course: Course, p: int, found: PerformersResult) -> Iterator[_Other]:
    """Yield what else may be done at posture ``p`` or just before, what changes least first."""
    yield from _by_other_moves(search, course, p, slower=False)
    last = min(p + 1, len(course.steps) - 1)
    yield from ((one, tuple(range(p, last + 1))) for one in islice(_exchanged(search, course, p), _OTHERS))
    yield from _by_other_moves(search, course, p, slower=True)
    if p:
        yield from ((one, (p - 1, p)) for one in islice(_exchanged(search, course, p - 1), _OTHERS))
    without = _without(search, course, p, found)
    if without is not None:
        yield without, (p,)


def _by_other_moves(search: WordSearch, course: Course, p: int, *, slower: bool) -> Iterator[_Other]:
    """Yield courses with another move to posture ``p``."""
    last = course.moves[p - 1] if p else None
    if last is not None:
        for move in other_moves(search.task(course.steps[p - 1], course.steps[p]), last, slower=slower):
            yield course.spliced(p, p, (), (move,)), (p,)


def _exchanged(search: WordSearch, course: Course, q: int) -> Iterator[Course]:
    """Yield courses with another posture in place ``q``, the best first."""
    before, after = [*course.steps[:q]], next(iter(course.steps[q + 1 :]), None)
    posterior, taken = search.information.beforehand, {step.key for step in course.steps}
    for number, step in enumerate(before):
        posterior = search.posterior_after(posterior, before[:number], step)

    def on_from(step: DanceStep) -> DanceStep | None:
        return None if after is None else search.link(step, after.table, after.s)

    def fits(step: DanceStep) -> bool:
        return step.key not in taken and (after is None or on_from(step) is not None)

    for step, move in search.possible(before, course.stances, posterior, {}, wanted=fits):
        to, on = () if move is None else (move,), on_from(step)
        if on is None:
            yield course.spliced(q, q + 1, (step,), to)
        elif not (way := search.move(step, on)).limit:
            yield course.spliced(q, q + 2, (step, on), (*to, way, *course.moves[q + 1 : q + 2]))


def _without(search: WordSearch, course: Course, p: int, found: PerformersResult) -> Course | None:
    """Return the course without posture ``p``, None where its neighbours need it."""
    steps = course.steps
    if not 0 < p < len(steps) - 1 or steps[p].stance.over is not None:
        return None
    on = search.link(steps[p - 1], steps[p + 1].table, steps[p + 1].s)
    if on is None or (way := search.move(steps[p - 1], on)).limit:
        return None
    limits = " and ".join(limit.replace("_", " ") for at, limit in found.bad if at == p)
    note = f"Left out: {steps[p].name}; whoever copies it imprecisely comes too near the limit on {limits}."
    shorter = course.spliced(p, p + 2, (on,), (way, *course.moves[p + 1 : p + 2]))
    return replace(shorter, notes=(*course.notes, note))


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
        with ProcessPoolExecutor(2) as pool:
            return design(body, plan, limits=limits, seed=seed, tell=tell, resume=resume, workers=pool)
    plan = plan.with_limits(limits)
    alone = DesignContext.alone(body, plan, seed)
    checkpoint = Checkpoint(resume, body, plan, seed)
    work = replace(alone, checkpoint=checkpoint, workers=workers, tell=tell or alone.tell)
    danced: tuple[Margin, ...] = ()
    if np.isfinite(plan.instructions):
        course, found = safe_course(work)
        danced = found.margins
        dance = replace(course.dance(work), unsafe=broken(danced))
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
