"""All criteria on one body: each designs one trajectory, each scores all of them, and what would be known afterwards is
beside it.

Every criterion gets the same seeded starts and the winners of the others as further starts, so that a difference
between rows comes from what the criteria want and not from where they began.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from criteria import CRITERIA
from via_points import Excitation, design

from biodance.records import Array, frozen_array


@dataclass(frozen=True, eq=False)
class Comparison:
    """``score[i, j]`` (C, C) is what criterion ``names[j]`` says of the design of ``names[i]``: smaller is better,
    columns have own units.

    ``points`` (C, k, joints) rad of the designs; ``sd_before`` (10N,) standard deviations of the SIP in the table and
    ``sd_after`` (C, 10N) those expected after each design, for independent wrench samples with 1 N and 1 N·m of noise;
    kg, kg·m, kg·m².
    """

    names: tuple[str, ...]
    points: Array
    score: Array
    sd_before: Array
    sd_after: Array

    def __post_init__(self) -> None:
        count = len(self.names)
        object.__setattr__(self, "score", frozen_array(self.score, (count, count), "Comparison.score"))
        object.__setattr__(
            self, "sd_after", frozen_array(self.sd_after, (count, len(self.sd_before)), "Comparison.sd_after")
        )

    @property
    def lost(self) -> Array:
        """(C, C) how much worse each design is than the best of its column: ratio for condition numbers, difference for
        logarithms.
        """
        best = self.score.min(axis=0)
        plain = np.array([name in ("condition", "mass_weighted") for name in self.names])
        return np.where(plain, self.score / np.where(plain, best, 1.0), self.score - best)

    def table(self) -> str:
        """Return the scores as text: a row per design, a column per judge, the best of each column starred."""
        wide = max(len(name) for name in self.names) + 1
        lines = [" " * wide + "".join(f"{name:>{wide}}" for name in self.names)]
        best = self.score.argmin(axis=0)
        for i, name in enumerate(self.names):
            cells = (f"{value:.4g}{'*' if best[j] == i else ' '}" for j, value in enumerate(self.score[i]))
            lines.append(f"{name:<{wide}}" + "".join(f"{cell:>{wide}}" for cell in cells))
        return "\n".join(lines)


def compare_criteria(
    problem_of: Callable[[str], Excitation], starts: tuple[Array, ...], *, movable: slice, names: tuple[str, ...] = ()
) -> Comparison:
    """Return the comparison of the criteria ``names`` (default: all) on the problems ``problem_of(name)``, which differ
    in nothing else.

    ``starts`` are points (k, joints) rad; only ``movable`` points are designed.
    """
    chosen = names or tuple(CRITERIA)
    problems = [problem_of(name) for name in chosen]
    empty = np.zeros((problems[0].target.prior_factor.shape[0],) * 2)

    def best(problem: Excitation, tries: list[Array]) -> Array:
        found = [design(problem, start, empty, movable=movable, iterations=60) for start in tries]
        return min(found, key=lambda p: problem.criterion(problem.extend(empty, p), problem.target)[0])

    first = [best(problem, list(starts)) for problem in problems]
    pool = [best_of(problem, first, empty) for problem in problems]
    points = [best(problem, [own, other]) for problem, own, other in zip(problems, first, pool, strict=True)]
    triangles = [problem.extend(empty, p) for problem, p in zip(problems, points, strict=True)]
    score = np.array([[judge.criterion(R, judge.target)[0] for judge in problems] for R in triangles])
    S = problems[0].target.prior_factor
    after = np.array([_posterior_sd(R, S) for R in triangles])
    return Comparison(chosen, np.array(points), score, np.linalg.norm(S, axis=1), after)


def best_of(problem: Excitation, designs: list[Array], history: Array) -> Array:
    """Return the design that the problem's own criterion judges best, together with ``history``."""
    return min(designs, key=lambda p: problem.criterion(problem.extend(history, p), problem.target)[0])


def _posterior_sd(triangle: Array, S: Array) -> Array:
    """Return the standard deviations (p,) after data with Gram matrix R'R, for a table covariance S S'."""
    known = triangle @ S
    U = np.asarray(np.linalg.qr(np.vstack([known, np.eye(S.shape[1])]), mode="r"))
    return np.asarray(np.linalg.norm(S @ np.linalg.inv(U), axis=1))
