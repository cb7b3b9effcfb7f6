"""In which order postures are danced, and where the weight must be carried in between (paper III.E).

Each posture goes to one that is near, so that moves are short, smooth and balanced. Feet change in small steps only:
weight is shifted with both feet down, then one foot is lifted, moved or set down while the other bears everything. So
between two foot configurations there are postures in between, both feet down, the weight over one of them.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.footprint import feet_on_plate
from biodance.dance.problem.information import PostureInformation, update_posterior
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import SINGLE, Stance, holding, seat, stance
from biodance.errors import BiodanceError
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Choice:
    """``order`` (K,) indices of the chosen postures in the order of the dance; ``spread`` (K + 1,) what is not known
    yet after each pick, in the order in which they were ``picked`` (K,): root mean square of posterior over table
    standard deviation, weighted; ``duration`` s.
    """

    order: tuple[int, ...]
    picked: tuple[int, ...]
    spread: Array
    duration: float


def choose(chain: Chain, x: Array, stances: tuple[str, ...], plan: Plan) -> Choice:
    """Return which of the postures ``x`` (P, n), on the feet ``stances`` (P), are danced within the plan's budget, and
    in which order.

    Blocks of one stance stay together in the order of the plan; within a block the postures come in the order in which
    they were picked.
    """
    information, last = PostureInformation(chain, plan), dict[str, int]()
    still, ways = information.white(information.standing(x)), _Ways(information, x, stances)
    posterior, left, picked, spent = information.beforehand, set(range(len(x))), list[int](), 0.0
    total = [float(np.sum(information.scale**2))]
    while payable := sorted(p for p in left if spent + _cost(plan, stances[p], last) <= plan.budget):
        rows = {p: np.concatenate([still[p], ways.to(p, last.get(stances[p]))]) for p in payable}
        p = max(payable, key=lambda p: float(information.gains(posterior, rows[p])))
        spent += _cost(plan, stances[p], last)
        posterior = update_posterior(posterior, rows[p])
        total.append(float(np.sum((information.scale @ posterior) * information.scale)))
        last[stances[p]] = p
        left.discard(p)
        picked.append(p)
    order = tuple(p for stance, _ in plan.blocks for p in picked if stances[p] == stance)
    return Choice(order, tuple(picked), np.sqrt(np.array(total) / information.weight.sum()), spent)


def _cost(plan: Plan, stance: str, last: dict[str, int]) -> float:
    """Return the seconds of one more posture; feet not used yet cost two moves through postures in between."""
    return plan.move + plan.hold + (2 * plan.move if stance not in last else 0.0)


@dataclass(frozen=True, eq=False)
class _Ways:
    """What going straight between postures ``x`` (P, n) on the same feet ``stances`` (P) tells, worked out once."""

    information: PostureInformation
    x: Array
    stances: tuple[str, ...]
    _known: dict[int, dict[int, Array]] = field(default_factory=dict)

    def to(self, goal: int, origin: int | None) -> Array:
        """Return the rows (m, k) of the way to the posture ``goal``; from None: from any other on the same feet."""
        same = [p for p, stance in enumerate(self.stances) if stance == self.stances[goal]]
        if origin is None:
            origin = next((p for p in same if p != goal), goal)
        if origin not in self._known:
            ends = np.stack([np.broadcast_to(self.x[origin], self.x[same].shape), self.x[same]], axis=1)
            self._known[origin] = dict(zip(same, self.information.of_ways(ends), strict=True))
        return self._known[origin][goal]


METRE = 3.0
"""rad that a metre of the root counts."""


def order_postures(x: Array, groups: list[list[int]]) -> list[int]:
    """Return the rows of ``x`` (P, n) in an order in which neighbours are near; groups stay together, in turn."""
    scaled = x.copy()
    scaled[:, :3] *= METRE
    apart = np.linalg.norm(scaled[:, None] - scaled[None], axis=2)
    out: list[int] = []
    for group in groups:
        starts: list[int | None] = [None] if out else [*group]
        before = out[-1] if out else None
        paths = [_shortened(_greedy(apart, group, first, before), apart, before) for first in starts]
        lengths = [_length(path, apart) for path in paths]
        out += paths[int(np.argmin(lengths))]
    return out


def _length(path: list[int], apart: Array) -> float:
    return float(sum(apart[a, b] for a, b in pairwise(path)))


def _greedy(apart: Array, group: list[int], first: int | None, before: int | None) -> list[int]:
    left = set(group)
    path = [first if first is not None else min(sorted(left), key=lambda p: apart[before, p])]
    left.discard(path[0])
    while left:
        path.append(min(sorted(left), key=lambda p: apart[path[-1], p]))
        left.discard(path[-1])
    return path


def _shortened(path: list[int], apart: Array, before: int | None) -> list[int]:
    """Return the path with stretches turned round (2-opt) until none helps; ``before`` is where it comes from."""
    table: NDArray[np.float64] = np.pad(apart, ((0, 1), (0, 1)))
    nowhere = len(apart)  # at distance zero from everything
    ends = [nowhere if before is None else before, *path, nowhere]
    better = True
    while better:
        better = False
        for i in range(1, len(ends) - 1):
            for j in range(i + 1, len(ends) - 1):
                a, b, c, d = ends[i - 1], ends[i], ends[j], ends[j + 1]
                if table[a, c] + table[b, d] < table[a, b] + table[c, d] - 1e-9:
                    ends[i : j + 1] = ends[i : j + 1][::-1]
                    better = True
    return ends[1:-1]


RIGHT, LEFT = 0, 1


def support_sequence(body: Body, plan: Plan) -> tuple[Stance, ...]:
    """Return the stance of every posture of a plan in order, those in between (``over`` one foot) included; it ends on
    both feet.

    Where the person may not stand alone on the left leg nobody steps: all double support is danced on the first pair of
    feet.

    Raises
    ------
    BiodanceError
        The plan changes between standing and sitting.
    """
    names = [name for name, _ in plan.blocks]
    if "seated" in names and len(names) > 1:
        raise BiodanceError(
            f"Plan {plan.name}: blocks {', '.join(names)} mix sitting and standing, and nobody can be planned onto a "
            "stool; make two plans, one seated and one standing."
        )
    doubles = [name for name in names if name in ("parallel", "right_forward")] or ["parallel"]
    feet, out = _double(body, plan, doubles[0]), list[Stance]()
    for name, count in plan.blocks:
        if name in doubles and "left" in plan.alone:
            feet = _double(body, plan, name)
        target = (
            seat(body, share=plan.share) if name == "seated" else feet.on(*SINGLE[name]) if name in SINGLE else feet
        )
        out += [*(weight_shifts(out[-1], target) if out else ()), *[target] * count]
    if len(out[-1].planted) == 1:
        out.append(_over(out[-1], out[-1].planted[0]))
    return tuple(out)


def _double(body: Body, plan: Plan, name: str) -> Stance:
    wide, forward = feet_on_plate(body, plan)
    feet = stance(body, name, right=forward if name == "right_forward" else 0.0, share=plan.share, wide=wide)
    return holding(feet, body, plan.holds)


def _over(feet: Stance, side: int) -> Stance:
    """Return the stance with both feet down and the weight over one."""
    return replace(feet.on(RIGHT, LEFT), over=side)


def weight_shifts(last: Stance, goal: Stance) -> list[Stance]:
    """Return the postures in between from one stance to another: set down, shift, step with the right foot, shift."""
    over = last.planted[0] if len(last.planted) == 1 else None
    out = [_over(last, over)] if over is not None and goal.planted != last.planted else []
    if not np.array_equal(last.ankle, goal.ankle):
        out += [_over(last, LEFT)] if over != LEFT else []
        out.append(_over(goal, over := LEFT))
    if len(goal.planted) == 1 and goal.planted != last.planted and over != goal.planted[0]:
        out.append(_over(goal, goal.planted[0]))
    return out
