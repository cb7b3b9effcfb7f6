"""Moves between postures within all limits, rest to rest through two via points (paper eq. 18-20): those that excite
the inertias, and those that people can follow: straight, slower where that breaks a limit, at last going round.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.limits import Limit
from biodance.dance.performers import deviations_of_copies
from biodance.dance.problem import nlp
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import Blocks, condition, dynamic_grams, dynamic_slopes, effort, total
from biodance.dance.problem.splines import basis_at, straight_via
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State
from biodance.dance.search.postures import intermediate_posture
from biodance.dance.verify import verify
from biodance.errors import BiodanceError
from biodance.records import Array

GRID = 10.0
"""Hz at which limits are kept while designing; instants that turn out worse in between are added."""
CHECK = 50.0
"""Hz at which a move is judged before it is taken."""
SLOW = 4.0
"""s: longer moves, of slow robots, are judged at as many instants as one of this time: it is the same spline."""
RESERVE = 0.04
"""Share of every limit's scale that is kept in reserve for the instants in between."""
BETWEEN = 0.004
"""The same where a move is judged, for what is between those instants."""
CENTRE = 0.1
"""Worth of 1 dm² of mean squared distance of the zero-moment point from the middle, beside log cond."""


SLOWER = (1.0, 1.4)
"""Factors on the duration of a move, one after the other."""


@dataclass(frozen=True, eq=False)
class Task:
    """A move to find: from ``ends[0]`` to ``ends[1]`` (2, n) in ``duration`` s on the feet of ``stance``, within the
    ``limits``.
    """

    chain: Chain
    blocks: Blocks
    stance: Stance
    ends: Array
    duration: float
    limits: tuple[Limit, ...]

    @property
    def excited(self) -> list[int]:
        """Coordinates that excite: trunk and arms on both feet, the free leg on one (paper Table I), seated all."""
        legs = [self.chain.leg_columns[side] for side in (0, 1) if side not in self.stance.planted]
        return sorted([*([] if len(legs) == 1 else self.chain.upper), *(c for leg in legs for c in leg)])

    @property
    def segments(self) -> list[int]:
        """The segments whose inertias the excited coordinates show."""
        return [i for i, k in enumerate(self.chain.carriers) if k in self.excited]

    def straight(self) -> Array:
        """Return the via points (2, n) of the smoothest move."""
        return straight_via(*self.ends)

    def problem(
        self, via: Array, free: list[int], time: Array, *, reserve: float, objective: nlp.Objective
    ) -> nlp.NonlinearProgramme:
        """Return the problem of the via points of the ``free`` coordinates at instants ``time`` s, the others as in
        ``via`` (2, n).
        """
        basis, kept = basis_at(time, self.duration), tuple(limit for limit in self.limits if limit.in_motion)
        points = np.stack([self.ends[0], *via, self.ends[1]])
        # The points of the free coordinates are the unknowns; zero here, so that they only add.
        points[1:3, free] = 0.0
        parts = np.stack([basis.position, basis.velocity, basis.acceleration])
        s = time / self.duration
        # Least jerk: share of the way.
        way = s**3 * (10 - 15 * s + 6 * s**2)
        least = [max(reserve, limit.move_reserve) if reserve > BETWEEN else reserve for limit in kept]
        # 4 w (1 - w): zero at both ends, one in the middle.
        bell = np.where([limit.tapers for limit in kept], (4 * way * (1 - way))[:, None], 1.0)
        share = np.array(least) * bell
        # Columns 1 and 2 of the basis belong to the via points.
        return nlp.NonlinearProgramme(
            self.chain, self.stance, parts @ points, parts[:, :, 1:3], free, kept, objective, share
        )

    def grid(self, rate: float) -> Array:
        """Return the instants (T,) s between the ends at about ``rate`` Hz, of a long move fewer."""
        return np.linspace(0.0, self.duration, round(min(self.duration, SLOW) * rate) + 1)[1:-1]

    @property
    def stretch(self) -> float:
        """How much more time an instant of a long move stands for."""
        return max(1.0, self.duration / SLOW)


@dataclass(frozen=True, eq=False)
class Move:
    """A move through S >= 1 splines, by way of the ``stops`` (S - 1, n) where it rests for no time.

    ``via`` (S, 2, n) points, ``duration`` (S,) s; ``gram`` (N, 6, 6) its own information on the inertias, integrated
    over time; ``violation`` of the limits in their scales (feasible: 0) and of which ``limit``, "" if none; ``room``
    by how many deviations imprecise people keep its limits, minus infinity where they were not asked.
    """

    via: Array
    duration: Array
    gram: Array
    violation: float
    limit: str
    stops: Array
    room: float = -np.inf

    @property
    def seconds(self) -> float:
        """Duration of the whole move, s."""
        return float(self.duration.sum())

    def dance(self, task: Task, stances: tuple[Stance, ...], hold: Array) -> Dance:
        """Return the move alone as a dance, its ends and stops held for ``hold`` (S + 1,) s on the ``stances``."""
        rows = np.array([task.ends[0], *self.stops, task.ends[1]])
        under = (task.stance,) * len(self.via)
        return Dance("move", task.chain.body, rows, stances, hold, self.via, self.duration, under, 0)


@dataclass(frozen=True, eq=False)
class MoveObjective:
    """Mass-weighted mean log cond of the inertias after ``history`` (N, 6, 6), times ``share``, and ZMP distance."""

    task: Task
    history: Array
    share: float = 1.0

    def __call__(self, state: State) -> tuple[float, Array]:
        """Return the objective and its slopes by x, v, a."""
        gap = state.zmp - state.stance.centre
        # 100 dm² in a m².
        value = CENTRE * (100 * float(np.mean(np.sum(gap**2, axis=1))))  # dm²
        # Gradient of a mean of squares: 2 gap / T, times 100 dm².
        slope = CENTRE * (200 / len(gap) * np.einsum("tc,ktcn->ktn", gap, state.zmp_slopes))
        if self.task.blocks.simplicity:
            hard, by = effort(state)
            value, slope = value + self.task.blocks.simplicity * hard, slope + self.task.blocks.simplicity * by
        weight, picks = self.task.blocks.weight, self.task.blocks.second
        segments = [i for i in self.task.segments if picks[i] and weight[i] > 0]
        if not self.share or not segments:
            return value, slope
        # Sum over samples times dt: an integral over the time of the whole move.
        grams = (
            self.history
            + dynamic_grams(state, list(range(len(weight)))) * self.task.stretch / GRID
            + 0.01 * np.eye(6)  # s·(rad/s²)², supposed before the first move
        )
        chosen = np.zeros(len(weight))
        # Weights add up to `share`.
        chosen[segments] = self.share * weight[segments] / weight[segments].sum()
        found, by = total(chosen, grams, picks, measure=_logarithm)
        return value + found, slope + dynamic_slopes(state, segments, by[segments] * self.task.stretch / GRID)


def _logarithm(gram: Array) -> tuple[Array, Array]:
    value, slope = condition(gram)
    # d log c = dc / c.
    return np.log(value), slope / value[..., None, None]


def find_move(task: Task, history: Array, *, rng: np.random.Generator) -> Move:
    """Return the best feasible move after ``history`` (N, 6, 6); if there is none, the one that violates least."""
    best = None
    # spread (rad) about the straight move, share of excitation in the objective, iterations
    for spread, share, rounds in ((0.2, 1.0, (14, 8, 8)), (0.0, 0.2, (40, 12, 12))):
        via = task.straight()
        via[:, task.excited] += rng.normal(0, spread, (2, len(task.excited)))
        for found, beyond in improving_moves(task, via, MoveObjective(task, history, share), rounds):
            if best is None or found.violation < best.violation:
                best = found
            if best.violation == 0:
                return best
            if beyond > 0 or found.violation > 0.5:  # scales of violation
                break
    assert best is not None
    return best


def improving_moves(
    task: Task, via: Array, objective: MoveObjective, rounds: tuple[int, ...], *, free: list[int] | None = None
) -> Iterator[tuple[Move, float]]:
    """Yield the move found from ``via`` (2, n) after each of the ``rounds``, of so many iterations, and by how much it
    violates the limits on the grid without their reserve; only the coordinates ``free`` move, by default all that can.
    After a round the worst instants are added and the reserve grows by a quarter.
    """
    free = nlp.free_coordinates(task.chain, task.stance) if free is None else free
    via, time = via.copy(), task.grid(GRID)
    for k, iterations in enumerate(rounds):
        reserve = RESERVE * (1 + k / 4)
        problem = task.problem(via, free, time, reserve=reserve, objective=objective)
        y, violation = nlp.minimise(problem, via[:, free].ravel(), iterations=iterations)
        via[:, free] = y.reshape(2, -1)
        found, instants = evaluate_move(task, via.copy())
        # The violation is that of the margins less the reserve: without it, less by as much.
        yield found, violation - reserve
        # The worst instants of the fine grid join the coarse one.
        time = np.union1d(time, instants)


def evaluate_move(task: Task, via: Array) -> tuple[Move, Array]:
    """Return the move through ``via`` as all limits judge it on the fine grid, and the worst instants s."""
    time = task.grid(CHECK)
    problem = task.problem(via, [], time, reserve=BETWEEN, objective=nlp.no_objective)
    found = nlp.Evaluation(problem, problem.state(np.empty(0)).judged)
    worst, limit = found.worst
    # Infinite beside the ends: a dip may lie there.
    left = np.pad(found.least, 1, constant_values=np.inf)
    # Local minima of what is left, where it is less than nothing.
    dips = (left[1:-1] < 0) & (left[1:-1] <= left[:-2]) & (left[1:-1] <= left[2:])
    # Integral over time: sum over samples times dt.
    gram = dynamic_grams(found.state, list(range(len(task.chain.body.segments)))) * task.stretch / CHECK
    no_stop, broken = np.empty((0, via.shape[1])), limit if worst > 0 else ""
    return Move(via[None], np.array([task.duration]), gram, max(0.0, worst), broken, no_stop), time[dips]


def exciting_move(task: Task, history: Array, seed: list[int]) -> Move:
    """Return a move that keeps all limits, by the design's own judgement and by `verify`: at once, slower, or by way of
    a posture in between; if there is none, the direct one that was tried last, with the limit it breaks.
    """
    for factor in SLOWER:
        direct = find_move(replace(task, duration=task.duration * factor), history, rng=np.random.default_rng(seed))
        broken = direct.limit or _broken_limit(task, direct)
        if not broken:
            return direct
    for attempt in range(2):  # postures in between that are tried
        try:
            stop = intermediate_posture(task.chain, task.stance, task.ends, task.limits, seed=[*seed, attempt]).x
        except BiodanceError:
            continue
        detour = _through(task, history, stop, [*seed, attempt])
        if detour is not None and not _broken_limit(task, detour):
            return detour
    return replace(direct, limit=broken)


def _broken_limit(task: Task, move: Move) -> str:
    """Return the limit that a move breaks by the independent check, "" if it breaks none."""
    count = len(move.via) + 1
    margins = verify(task.chain.body, move.dance(task, (task.stance,) * count, np.zeros(count)), task.limits)
    # the check of the whole dance samples other instants of the move
    spare = {limit.name: 0.5 * limit.rounding for limit in task.limits}
    return next((one.limit for one in margins if not one.worst >= spare.get(one.limit, 0.0)), "")


def _through(task: Task, history: Array, stop: Array, seed: list[int]) -> Move | None:
    """Return the slow move by way of ``stop`` (n,), None where one of its halves is impossible."""
    parts: list[Move] = []
    for ends in ((task.ends[0], stop), (stop, task.ends[1])):
        slow = replace(task, ends=np.array(ends), duration=task.duration * SLOWER[-1])
        part = find_move(slow, history, rng=np.random.default_rng(seed))
        if part.violation > 0:
            return None
        parts.append(part)
        history = history + part.gram
    first, second = parts
    via, duration = (np.concatenate([getattr(part, name) for part in parts]) for name in ("via", "duration"))
    return Move(via, duration, first.gram + second.gram, 0.0, "", stop[None])


_SLOWER = (1.0, 1.4, 1.8, 2.4)  # Factors on the duration of a straight move, one after the other
ENOUGH, AMPLE = 3.2, 4.0
"""Deviations of imprecise people that a posture or a move must leave, and that it leaves where there is a choice."""
_FROM_STOP = 0.08  # rad that a lifted leg keeps from the stops of its joints
_LIFTS = (
    (0.5, -0.1, 0.0, 0.55, 0.0, 0.0),
    (0.5, -0.2, 0.0, 0.55, 0.0, 0.0),
    (0.8, -0.2, 0.0, 0.9, 0.0, 0.0),
    (0.8, -0.3, 0.0, 0.9, 0.0, 0.0),
)
"""rad by which hip, knee and ankle of a lifted leg bend on the way, and by which it goes away from the other one."""
_SAMPLED = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Fractions of a move at which imprecise people must have room, too."""
_STANDING = 0.2  # s of standing still before and after a move that is looked at alone


def straight_move(task: Task, stances: tuple[Stance, Stance], enough: float = ENOUGH) -> Move:
    """Return the move of ``task`` between postures on ``stances`` in which nothing goes out of its way that need not
    (where its room is less than ``enough``: with the limit of which); if none keeps all limits, the one that violates
    least.
    """
    tried, eased = list[Move](), {limit.name for limit in task.limits if limit.mended_by_slowness}
    for factor in _SLOWER:
        slow = replace(task, duration=factor * task.duration)
        tried.append(_safest(slow, stances, (evaluate_move(slow, via)[0] for via in _vias(slow)), enough))
        if tried[-1].violation == 0 or tried[-1].limit not in eased:
            break
    best = min(tried, key=lambda move: move.violation)
    if best.violation == 0 or task.stance.seat:
        return best
    slow = replace(task, duration=best.seconds)
    return _safest(slow, stances, [_round_about(slow, best)], enough)


def other_moves(task: Task, last: Move, *, slower: bool) -> Iterator[Move]:
    """Yield moves of ``task`` that keep all limits and differ from the ``last`` one, which takes as long, or less where
    they are to be ``slower``.
    """
    for factor in (factor for factor in _SLOWER if (factor * task.duration > last.seconds + 1e-9) == slower):
        slow = replace(task, duration=factor * task.duration)
        for via in _vias(slow):
            move = evaluate_move(slow, via)[0]
            if not move.limit and (slower or not np.allclose(via, last.via[0])):
                yield move


def _vias(task: Task) -> list[Array]:
    """Return the via points (2, n) that are tried: straight on, on one leg also by lifts that are higher or wider, each
    with the pelvis as it is and as the weight asks for.
    """
    limits, out = task.chain.body.limits, [task.straight()]
    for lift in _LIFTS if len(task.stance.planted) == 1 else ():
        (side,) = {0, 1} - set(task.stance.planted)
        columns, via = np.array(task.chain.leg_columns[side]), task.straight()
        low, high = limits.lower[columns - ROOT] + _FROM_STOP, limits.upper[columns - ROOT] - _FROM_STOP
        via[:, columns] = np.clip(via[:, columns] + lift, np.minimum(low, via[:, columns]), high)
        out += [via, _as_balanced(task, via, out[0])]
    return out


def _as_balanced(task: Task, via: Array, straight: Array) -> Array:
    """Return ``via`` (2, n) with the pelvis moved so that the centre of mass goes as on the ``straight`` way: a leg
    that swings out carries it aside.
    """
    chain, planted, ankle = task.chain, task.stance.planted, task.stance.ankle
    place, via = chain.mass_centre(chain.plant(straight, planted, ankle)), via.copy()
    for _ in range(2):  # each leaves about a tenth of what is off
        via[:, :2] += (place - chain.mass_centre(chain.plant(via, planted, ankle)))[:, :2]
    return via


def _safest(task: Task, stances: tuple[Stance, Stance], moves: Iterable[Move], enough: float) -> Move:
    """Return the first move with `AMPLE` room, else that with most, its limit below ``enough``."""
    tried, best = list[Move](), None
    for move in moves:
        tried.append(move)
        if not move.limit:
            alone = move.dance(task, stances, np.full(2, _STANDING))
            room, limit = deviations_of_copies(alone, task.limits, _STANDING + move.seconds * _SAMPLED)
            if best is None or room > best.room:
                best = replace(move, room=room, limit=limit if room < enough else "")
            if room > AMPLE:
                break
    return min(tried, key=lambda move: move.violation) if best is None else best


def _round_about(task: Task, best: Move) -> Move:
    """Return a move in which the pelvis and a lifted leg avoid what the straight one breaks."""
    up = [c for side in (0, 1) if side not in task.stance.planted for c in task.chain.leg_columns[side]]
    objective = MoveObjective(task, np.zeros((len(task.chain.body.segments), 6, 6)), 0.0)
    for found, _ in improving_moves(task, best.via[0], objective, (12, 8), free=[*range(ROOT), *up]):
        best = min(best, found, key=lambda move: move.violation)
        if best.violation == 0:
            break
    return best
