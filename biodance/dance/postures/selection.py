"""Which postures, and in which order: greedily by what each tells per second.

A posture tells through the wrench of standing still in it and through the way to it (straight from the last posture on
the same feet; the designed way, which is not known yet, tells more). What counts is the expected posterior variance of
the parameters given the table, log sum_k w_k C_kk / P_kk (criterion "posterior_variance"), with one independent error
per posture and per quarter of a second of moving: errors of people are slow, so that holding longer tells little more.
Adding what tells most per second is within 1 - 1/e of the best choice for information measures with diminishing returns
(Nemhauser, Wolsey & Fisher 1978). All postures of a plan take equally long, so that most per second is most per
posture; time spent on changing feet counts in the budget, not in the choice.
"""

from dataclasses import dataclass

import numpy as np

from biodance.dance.problem.chain import Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import rest_to_rest
from biodance.identification.posterior import prior_factor
from biodance.motion.regressor import regressor
from biodance.records import Array

SAMPLE_ERROR = np.array([8.0, 8.0, 8.0, 4.0, 4.0, 4.0])
"""N, N·m: error of one independent sample of the wrench of a person (residual of the paper: 7.8 N, 4.3 N·m)."""
SAMPLE_RATE = 4.0
"""Hz: independent samples per second of moving."""


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
    S = prior_factor(chain.body.sip)
    before = np.sum(S**2, axis=1)
    weight = np.repeat(plan.emphasis(chain.body.segments), 10) * (before > 0)
    scale = S * np.sqrt(weight / np.where(before > 0, before, 1.0))[:, None]
    told = _Told(chain, x, stances, plan.move, S)
    belief, left, last = np.eye(S.shape[1]), set(range(len(x))), dict[str, int]()
    picked: list[int] = []
    spent, total = 0.0, [float(np.sum(scale**2))]
    while left:
        payable = sorted(p for p in left if spent + _cost(plan, stances[p], last) <= plan.budget)
        if not payable:
            break
        changes = {p: learned(belief, told.rows(last.get(stances[p]), p)) for p in payable}
        p = max(payable, key=lambda p: float(np.sum((scale @ changes[p].T) ** 2)))
        spent += _cost(plan, stances[p], last)
        belief = belief - changes[p].T @ changes[p]
        total.append(float(np.sum((scale @ belief) * scale)))
        last[stances[p]] = p
        left.discard(p)
        picked.append(p)
    order = tuple(p for stance, _ in plan.blocks for p in picked if stances[p] == stance)
    return Choice(order, tuple(picked), np.sqrt(np.array(total) / weight.sum()), spent)


def _cost(plan: Plan, stance: str, last: dict[str, int]) -> float:
    """Return the seconds of one more posture; feet that were not used yet cost two moves through postures in
    between.
    """
    return plan.move + plan.hold + (2 * plan.move if stance not in last else 0.0)


def learned(belief: Array, rows: Array) -> Array:
    """Return Z (m, k) with new covariance = ``belief`` - Z'Z (k, k) after whitened ``rows`` (m, k) of data."""
    spread = rows @ belief
    factor = np.linalg.cholesky(np.eye(len(rows)) + spread @ rows.T)
    return np.asarray(np.linalg.solve(factor, spread))


class _Told:
    """What standing in a posture and going there tells: rows of the regressor, whitened by the error and by the
    table.
    """

    def __init__(self, chain: Chain, x: Array, stances: tuple[str, ...], move: float, S: Array) -> None:
        self.chain, self.x, self.stances, self.S = chain, x, stances, S
        samples = rest_to_rest(move, via=0, rate=SAMPLE_RATE)
        self.parts = [part[1:-1] for part in (samples.position, samples.velocity, samples.acceleration)]
        self.still = self._white(x[:, None], *np.zeros((2, len(x), 1, x.shape[1])))
        self.ways: dict[int, dict[int, Array]] = {}

    def rows(self, origin: int | None, goal: int) -> Array:
        """Return the rows (m, k) of the posture ``goal`` and of the way to it from ``origin``; None: from any posture
        on the same feet.
        """
        if origin is None:
            origin = next(
                (p for p, stance in enumerate(self.stances) if stance == self.stances[goal] and p != goal), goal
            )
        if origin not in self.ways:
            goals = [p for p, stance in enumerate(self.stances) if stance == self.stances[origin]]
            ends = np.stack([np.broadcast_to(self.x[origin], self.x[goals].shape), self.x[goals]], axis=1)
            self.ways[origin] = dict(zip(goals, self._white(*(part @ ends for part in self.parts)), strict=True))
        return np.concatenate([self.still[goal], self.ways[origin][goal]])

    def _white(self, x: Array, v: Array, a: Array) -> Array:
        """Return the rows (G, 6 T, k) of G stretches of T samples."""
        flat = [part.reshape(-1, x.shape[2]) for part in (x, v, a)]
        W = (
            regressor(self.chain.body, self.chain.motion(np.arange(len(flat[0])) / SAMPLE_RATE, *flat))
            / SAMPLE_ERROR[:, None]
        )
        return W.reshape(len(x), -1, W.shape[2]) @ self.S
