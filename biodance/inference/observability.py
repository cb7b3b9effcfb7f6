"""What a session can see and what it cannot, at the scales by which it was judged; of a movement that is only planned
at those of any laboratory.

With whitened rows y = X u + Z b + e, u and b unit normal (X everything that is no fault, Z the basis of one cause),
A = 1 + X'X and G = Z'Z - Z'X A^-1 X'Z, the score s = Z'y - Z'X A^-1 X'y of a cause of size a is expected to be G a, and

    log Bayes factor = -1/2 log |1 + G| + 1/2 s' (1 + G)^-1 s.

All expected log Bayes factors are quadratic in a. So the size from which a cause is seen, the size from which it is
told from every other cause, and the pairs that no size separates follow from G. What hides in the body's own parameters
or in a tolerance leaves no trace in it.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import JointError
from biodance.diagnosis.candidates import SCALE, TOGETHER, Candidate, log_priors
from biodance.diagnosis.consequence import NAMED, Unobservable, least
from biodance.effects import unit_at
from biodance.effects.joint_centre import JointCentre
from biodance.inference.hypotheses import Hypothesis
from biodance.inference.scales import Scales
from biodance.inference.sets import Search, at_scales, hypothesis
from biodance.motion.ik.functional_joints import fixed_point
from biodance.motion.ik.joint_unknowns import centre_sd
from biodance.records import Array

LARGE = 4.0
"""A cause that is not seen at this many typical sizes is listed as one that this session cannot see."""

_BELOW = 1.645
"""Standard deviations below its mean that a normal variable passes with 95 %."""
_SEARCHED, _STEPS = 300.0, 24
"""How far, and in how many steps, the limit of a cause is looked for whose effect is not in proportion to its size (a
filter takes no more than there is).
"""


@dataclass(frozen=True, eq=False)
class Visibility:
    """``causes`` (C); ``G`` (k, k) information of all bases together, ``cuts`` where each cause's basis lies in it;
    ``search`` and the hypothesis without causes, ``base``, that they are seen in.
    """

    causes: tuple[Candidate, ...]
    G: Array
    cuts: tuple[slice, ...]
    search: Search | None = None
    base: Hypothesis | None = None

    def seen(self, index: int) -> float:
        """Return the size, in units of the first parameter, from which cause ``index`` alone is named in 95 % of all
        recordings; each of several forces or masses at once in the same size: the worst of them.
        """
        one, cut = self.causes[index], self.cuts[index]
        # Log odds of `NAMED` less the prior's.
        need = float(np.log(NAMED / (1 - NAMED))) - self._prior[one.names]
        size = max(smallest_detectable(self.G[cut, cut], way, need) for way in unit_directions(one))
        if self.search is None or self.base is None or one.effect.linear or any(one.silent):
            return size
        return _really_seen(self.search, self.base, index, size, need)

    def felt(self, index: int) -> float:
        """Return the size, in units of the first parameter, from which cause ``index`` changes the wrench by what
        matters; 0 for one that the markers show, or only observations. Several forces or masses as in `seen`.
        """
        problem = None if self.search is None else self.search.rows.problem
        if problem is None or not self.causes[index].basis.any():
            return 0.0
        rows = self.causes[index].basis @ np.stack(unit_directions(self.causes[index]), axis=1).astype(float)
        with np.errstate(divide="ignore"):
            return float((1.0 / problem.felt(rows)).max())

    def separation(self, index: int) -> tuple[Array, Array]:
        """Return ``fixed``, ``growth`` (C,): log Bayes factor of cause ``index`` less that of every other one at size a
        (first parameter, its own unit) is expected to be fixed + growth a².
        """
        growth = self._growth[:, index]
        return self._fixed[index] - self._fixed, growth[index] - growth

    @cached_property
    def _growth(self) -> Array:
        """(C, C) what a unit of each cause (column) adds to the expected log Bayes factor of every one (row)."""
        ways = np.zeros((len(self.G), len(self.causes)))
        for index, (one, cut) in enumerate(zip(self.causes, self.cuts, strict=True)):
            ways[cut, index] = unit_directions(one)[0]
        pull = (self.G @ ways)[self._places]
        # 1/2 shift'(1 + G)^-1 shift, the shift that a unit of one cause gives to every score.
        return np.asarray(0.5 * np.sum((self._padded @ pull) * pull, axis=1))

    @cached_property
    def _prior(self) -> dict[tuple[str, str], float]:
        """Log prior odds of every cause."""
        return log_priors(self.causes)

    @cached_property
    def _inner(self) -> tuple[Array, ...]:
        """Posterior covariance of every cause's coefficients."""
        return tuple(np.asarray(np.linalg.inv(np.eye(c.stop - c.start) + self.G[c, c]), dtype=float) for c in self.cuts)

    @cached_property
    def _places(self) -> NDArray[np.intp]:
        """(C, w) where each cause's coefficients lie in G; what is wider than its basis points anywhere."""
        starts = np.array([c.start for c in self.cuts])[:, None]
        return np.minimum(starts + np.arange(max(c.stop - c.start for c in self.cuts)), len(self.G) - 1)

    @cached_property
    def _padded(self) -> Array:
        """(C, w, w) `_inner`, zero where a basis is narrower than the widest."""
        wide = self._places.shape[1]
        return np.stack([np.pad(one, (0, wide - len(one))) for one in self._inner])

    @cached_property
    def _fixed(self) -> Array:
        """(C,) expected log Bayes factor of every cause at size zero."""
        blocks = [self.G[c, c] for c in self.cuts]
        # At size zero E[s s'] = G: 1/2 tr((1 + G)^-1 G) - 1/2 log|1 + G|.
        return np.array(
            [
                -0.5 * np.linalg.slogdet(np.eye(len(b)) + b)[1] + 0.5 * np.trace(i @ b)
                for b, i in zip(blocks, self._inner, strict=True)
            ]
        )

    def told(self, index: int) -> float:
        """Return the size from which cause ``index`` is told from every other cause; infinite if one of them looks
        the same.
        """
        fixed, growth = self.separation(index)
        others = np.arange(len(self.causes)) != index
        need = TOGETHER - fixed[others]
        if np.any((growth[others] <= 1e-9) & (need > 0)):
            return float("inf")
        # fixed + growth a² = TOGETHER.
        size = np.sqrt(np.maximum(need, 0.0) / np.maximum(growth[others], 1e-9))
        return float(size.max(initial=0.0))


def _really_seen(search: Search, base: Hypothesis, index: int, size: float, need: float) -> float:
    """Return the size from which a cause not in proportion to its size surely passes ``need``; infinite if none."""
    effect, Z = search.causes[index].effect, search.Z[:, search.cuts[index]]
    first = np.eye(effect.typical.size)[0]
    for grown in size * np.geomspace(1.0, _SEARCHED, _STEPS) if np.isfinite(size) else ():
        added = search.rows.added(effect, grown * first)
        # Products of what is added with the basis, beside everything that is no fault: the shift of the score.
        _, G = search.score(base, np.column_stack([Z, added]))
        if surely_reached(G[:-1, :-1], G[:-1, -1]) >= need:
            return float(grown)
    return float("inf")


def surely_reached(G: Array, shift: Array) -> float:
    """Return the log Bayes factor that a cause passes in 95 % of all recordings if it adds ``shift`` (k,) to the score.

    With s ~ N(shift, G) and W = (1 + G)^-1 the factor has mean m and variance v, and is taken as normal:

        m = 1/2 shift' W shift + 1/2 tr(W G) - 1/2 log |1 + G|,   v = shift' W G W shift + 1/2 tr(W G W G).
    """
    growth, bend, chance, spread = _moments(G, shift)
    return growth + chance - _BELOW * float(np.sqrt(bend + spread))


def _moments(G: Array, shift: Array) -> tuple[float, float, float, float]:
    """Return what the shift adds to mean and variance of `surely_reached`, and what chance does."""
    inner = np.linalg.inv(np.eye(len(G)) + G)
    pull, share = inner @ shift, inner @ G
    # At size zero E[s s'] = G: mean of the log factor 1/2 tr(G (1 + G)^-1) - 1/2 log|1 + G|.
    chance = 0.5 * float(np.trace(share) - np.linalg.slogdet(np.eye(len(G)) + G)[1])
    return 0.5 * float(shift @ pull), float(pull @ G @ pull), chance, 0.5 * float(np.trace(share @ share))


def smallest_detectable(G: Array, direction: Array, need: float) -> float:
    """Return the multiple a of ``direction`` (k,) from which a cause passes ``need`` in 95 % of all recordings
    (`surely_reached` with the shift a G direction, solved for a^2); infinite if it never does.
    """
    growth, bend, chance, spread = _moments(G, G @ direction)
    if growth <= 1e-12:
        return float("inf")
    # growth a^2 - lack = below sqrt(bend a^2 + spread), squared: the larger root
    lack, below = need - chance, _BELOW**2
    # In x = a²: (growth x - lack)² = below (bend x + spread), a quadratic equation.
    half = growth * lack + 0.5 * below * bend
    root = half**2 - growth**2 * (lack**2 - below * spread)
    return float(np.sqrt(max(half + np.sqrt(max(root, 0.0)), 0.0))) / growth


def unit_directions(one: Candidate) -> list[Array]:
    """Return the coefficients (k,) of one unit of each parameter that is not silent."""
    loud = np.flatnonzero(~np.array(one.silent))
    same = [k for k in loud if one.effect.parameters[k].unit == one.effect.parameters[loud[0]].unit]
    width = one.basis.shape[1]
    # A unit-normal coefficient is SCALE typical sizes.
    return [np.eye(width)[i] / (SCALE * one.effect.typical[k]) for i, k in enumerate(loud) if k in same]


def visibility(search: Search, at: Scales) -> Visibility:
    """Return what a session of these scales lets every cause of ``search`` show beside all that is no fault."""
    base = at_scales(search, hypothesis(search, ()), at)
    return Visibility(search.causes, search.score(base, search.Z)[1], search.cuts, search, base)


def after_calibration(seen: Visibility, body: Body) -> Visibility:
    """Return what is left to see after the joints of ``body`` were placed by movement (``body.joint_errors``).

    Of a wrong centre the placing leaves the share (posterior / prior standard deviation)². So these centres may vary
    here, by as much as makes that share of each visible: they take with them what looks like a wrong centre.
    """
    left = {error.joint: placing_leaves(error) for error in body.joint_errors}
    at = {
        one.effect.target: cut
        for one, cut in zip(seen.causes, seen.cuts, strict=True)
        if one.names[0] == JointCentre.name
    }
    picks = np.concatenate(
        [np.arange(at[joint].start, at[joint].stop) for joint in left if joint in at] or [np.zeros(0, dtype=int)]
    )
    share = np.repeat([left[joint] for joint in left if joint in at], 3)
    own = np.diag(seen.G)[picks]
    # A nuisance of variance size² leaves G / (1 + size² G): size² = (1 / share - 1) / G.
    size = np.sqrt((1 / share - 1) / np.maximum(own, 1e-12))
    taken = seen.G[:, picks] * size
    inner = np.eye(len(picks)) + size[:, None] * seen.G[np.ix_(picks, picks)] * size
    # Schur complement with these centres free.
    return replace(seen, G=seen.G - taken @ np.linalg.solve(inner, taken.T))


def placing_leaves(error: JointError) -> float:
    """Return the share of a wrong joint centre that placing the joint by movement has left, 0..1."""
    fixed, before = fixed_point(error.joint), centre_sd(error.joint, contradicted=error.contradicted)
    # Variance left over variance before, without what no fixed point gives.
    return float(np.clip((error.centre**2 - fixed**2) / before**2, 0.01, 1.0))


def detection_limits(seen: Visibility, body: Body) -> tuple[Unobservable, ...]:
    """Return from which size on every cause is named and told from the others, by who looks at ``body`` with its
    joints where they are; never less than what matters (`consequence.least`, `Visibility.felt`).
    """
    rows = []
    after = after_calibration(seen, body)
    for i, one in enumerate(seen.causes):
        here = after if one.effect.taken_up_by_calibration else seen
        limit = here.seen(i)
        loud = one.silent.index(False)
        first, typical = one.effect.parameters[loud], float(one.effect.typical[loud])
        limit = max(limit, least(one.effect).get(first.name, 0.0), here.felt(i))
        sizes = [one.effect.reported_size(size) for size in (limit, max(limit, here.told(i)), typical)]
        rows.append(Unobservable(*one.names, sizes[0], unit_at(first.unit, one.effect.target), *sizes[1:]))
    return tuple(rows)


def hidden(rows: tuple[Unobservable, ...]) -> tuple[Unobservable, ...]:
    """Return the causes that stay unseen at `LARGE` times their typical size."""
    return tuple(row for row in rows if row.limit > LARGE * row.typical)
