"""All evidence of a session as the rows of one linear model, and all columns that are no fault.

    y = X u + Z b + e,      u ~ N(0, diag(lambda_g^2)),   e ~ N(0, s_q^2) in plates and markers, Student in observations

Rows come from the plates by trial, band and channel, from the markers' mean residuals, from the sizes that markers
show, and from observations that need no model of the body (feet, clocks, weights). They are whitened with the nominal
tolerances; the scales ``lambda`` and ``s`` say how far this session is from the sessions they were learned on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.candidates import Candidate, removed, slopes
from biodance.diagnosis.model import marker_keys, nuisances, shown_left_out, white
from biodance.diagnosis.problem import Problem
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.effects import Care, Case, Effect, effects
from biodance.effects.filter_mismatch import FilterMismatch
from biodance.records import CHANNELS, Array
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import Tolerances, between_laboratories, key_of

_Units = Mapping[tuple[str, str], tuple[slice, Array]]

BODY, FIXED = "body", "fixed"
"""Groups of columns: the parameters of the body; errors that several observations share, and causes whose tolerance is
their spread between real laboratories (`between_laboratories`), which have no scale. Causes within other tolerances are
grouped by the care of the laboratory that they go with (`Effect.care`)."""
SOFT = ("slide", "flesh", "sag", "tilt", FilterMismatch.name)
"""Groups of soft tissue, and of the filter that noise of markers in the needed wrench looks like."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The evidence of a session.

    Parameters
    ----------
    problem : Problem or None
        Where the simulated rows come from; None where only observations judge.
    tolerances : Tolerances
        Nominal sizes under which the rows are whitened.
    evidence : ObservedEvidence or None
        Observations that count; None without any.
    X : (r, K) array
        Whitened columns of all that is no fault, per nominal standard deviation.
    y : (r,) array
        Whitened target.
    group : (K,) array of int
        Index in ``groups`` of each column: columns of one group share a scale; -1: of `FIXED` size.
    member : (K,) array of int
        Which target (marker) each column is, with a scale of its own beside that of its group; -1: none.
    block : (r,) array of int
        Noise group of each row: band times 6 + channel for the plates, then markers; -1 for observations.
    groups : tuple of str
        Names of the groups of columns.
    tolerated : mapping
        By effect and target where the columns of its tolerance lie, and (p, k) what one unit of each is in its
        parameters.
    reach : (n,) array
        1 for observations that tell the size of a cause, 0 for others.
    """

    problem: Problem | None
    tolerances: Tolerances
    evidence: ObservedEvidence | None
    X: Array
    y: Array
    group: NDArray[np.intp]
    member: NDArray[np.intp]
    block: NDArray[np.intp]
    groups: tuple[str, ...]
    tolerated: Mapping[tuple[str, str], tuple[slice, Array]] = field(default_factory=dict)
    reach: Array = field(default_factory=lambda: np.empty(0))

    @property
    def plates(self) -> int:
        """Number of rows that come from the plates, the first ones."""
        return 0 if self.problem is None else self.problem.wrench_rows

    @property
    def simulated(self) -> int:
        """Number of rows that come from plates and markers; observations follow them."""
        return 0 if self.problem is None else len(self.problem.target)

    @property
    def noises(self) -> int:
        """Number of noise groups that rows of plates and markers may have."""
        return len(CHANNELS) * len(BANDS) + 1

    def white(self, rows: Array) -> Array:
        """Return ``rows`` (r', n) of plates and markers in units of their nominal standard deviation."""
        return rows if self.problem is None else white(self.problem, self.tolerances, rows)

    def mean_square(self, rows: Array) -> Array:
        """Return (Q + 1,) the mean square of ``rows`` (r,) in each band and channel of the plates; zero in markers and
        observations.
        """
        block = self.block[: self.plates]
        # Blocks of the plates only; minlength keeps the entries of markers and observations, at zero.
        count = np.bincount(block, minlength=self.noises + 1)
        return np.bincount(block, rows[: self.plates] ** 2, self.noises + 1) / np.maximum(count, 1)

    def possible(self, effect: Effect, theta: Array) -> bool:
        """Return whether a cause of size ``theta`` (p,) can be in this session."""
        return effect.possible(theta) if self.problem is None else effect.possible_in(self.problem.cases[0], theta)

    def added(self, effect: Effect, theta: Array) -> Array:
        """Return (r,): what a cause of size ``theta`` (p,) adds to the whitened rows."""
        simulated = np.zeros(0)
        if self.problem is not None:
            simulated = self.white(removed(self.problem, effect, theta)[:, None])[:, 0]
        return np.concatenate([simulated, self.observed(effect) @ theta])

    def slopes(self, effect: Effect, theta: Array) -> Array:
        """Return (r, p): derivative of `added` at ``theta`` (p,)."""
        if effect.linear and effect in self._slopes:
            return self._slopes[effect]
        simulated = np.zeros((0, theta.size))
        if self.problem is not None:
            simulated = self.white(slopes(self.problem, effect, theta, of=effect.removed))
        found = np.concatenate([simulated, self.observed(effect)])
        if effect.linear:
            found.setflags(write=False)  # all who ask share it
            self._slopes[effect] = found
        return found

    @cached_property
    def _slopes(self) -> dict[Effect, Array]:
        """Those of linear causes, the same at every size."""
        return {}

    def observed(self, effect: Effect) -> Array:
        """Return (n, p): what one unit of each parameter adds to the observations, in units of their own standard
        deviation.
        """
        one, kind = self.evidence, effect.grows or effect
        if one is None:
            return np.zeros((0, len(kind.parameters)))
        columns = one.columns(kind.name, effect.target, [parameter.name for parameter in kind.parameters])
        grown = self._grown if effect.grows else np.ones(len(columns))
        # Per standard deviation of each observation; `reach` takes out what may not tell a size.
        return np.asarray(columns * (grown * self.reach / [o.sd for o in one.observations])[:, None])

    @cached_property
    def _grown(self) -> Array:
        """(n,) how far after the session's middle an observation's trial lies, -0.5 to 0.5; 0 if not simulated."""
        cases = self.problem.cases if self.problem else ()
        after = {case.trial.name: float(case.session_time.mean()) - 0.5 for case in cases}
        seen = self.evidence.observations if self.evidence else ()
        return np.array([after.get(one.trial, 0.0) for one in seen])


def with_observed(
    causes: Sequence[Candidate],
    evidence: ObservedEvidence,
    family: Mapping[str, object],
    problem: Problem | None = None,
    *,
    of: Case | None = None,
) -> tuple[Candidate, ...]:
    """Return the ``causes`` and those of a ``family`` that only observations judge: they leave no trace in the
    simulation of a ``problem`` (the zero of a plate is taken off where it is empty). They are sized for the person and
    session of a case, ``of`` where nothing is simulated; without one, as for an adult and a minute.
    """
    known, cases = {one.names for one in causes}, () if problem is None else problem.cases
    sized = cases[0] if cases else of
    kinds = {name: one.sized_for(sized) if sized else one for name, one in family.items() if isinstance(one, Effect)}
    simulated = 0 if problem is None else len(problem.target)
    return (
        *causes,
        *(
            Candidate(
                replace(kinds[name], target=target),
                np.zeros((simulated, kinds[name].typical.size), np.float32),
                (False,) * kinds[name].typical.size,
            )
            for name, target in evidence.counting.causes
            if name in kinds
            and (name, target) not in known
            and all(target in kinds[name].targets(case) for case in cases)
        ),
    )


def rows_of(
    problem: Problem | None,
    causes: Sequence[Candidate],
    tolerances: Tolerances,
    evidence: ObservedEvidence | None,
    *,
    everywhere: bool = False,
) -> Rows:
    """Return the evidence of a session; those of ``causes`` with a learned size are tolerances, too. A pressure out of
    reach of its foot is of another foot and tells no size, unless it counts ``everywhere``.
    """
    seen = None if evidence is None or not evidence.counting.observations else evidence.counting
    tolerated = tuple(one for one in causes if tolerances.size(key_of(*one.names)) > 0)
    care = {name: one.care for name, one in effects().items()}
    if problem is None:
        X, y = np.zeros((0, len(tolerated))), np.zeros(0)
        names = [_group(key_of(*one.names), care) for one in tolerated]
        units: _Units = {
            one.names: (slice(k, k + 1), tolerances.size(key_of(*one.names)) * one.units[:, :1])
            for k, one in enumerate(tolerated)
        }
    else:
        X, y, names, units = _simulated(problem, tolerated, tolerances, care)
    reach = np.empty(0)
    if seen is not None:
        reach = np.ones(len(seen.observations)) if everywhere else seen.in_reach.astype(float)
        X, y, names = _with_observations(X, y, names, units, seen, reach)
    groups = tuple(name for name in dict.fromkeys(names) if name != FIXED)
    return Rows(
        problem,
        tolerances,
        seen,
        X,
        y,
        np.array([-1 if name == FIXED else groups.index(name) for name in names], dtype=int),
        _members(len(names), units),
        _blocks(problem, len(y)),
        groups,
        units,
        reach,
    )


def _simulated(
    problem: Problem, tolerated: tuple[Candidate, ...], tolerances: Tolerances, care: Mapping[str, Care]
) -> tuple[Array, Array, list[str], _Units]:
    """Return columns, target and groups of the simulated rows, and `Rows.tolerated`."""
    known = nuisances(problem, tolerated)
    columns = np.concatenate(known.parts, axis=1, dtype=float) * known.scale
    # The mean of a tolerance is taken off the target, so that every column has mean zero and unit variance.
    expected = shown_left_out(columns @ np.array([tolerances.mean(key) for key in known.means]), marker_keys(problem))
    sizes = np.array([tolerances.size(key) for key in known.keys])
    columns *= sizes
    # Body's columns, tolerances and target are whitened in one pass over the rows.
    both = np.concatenate([problem.sip, columns, (problem.target - expected)[:, None]], axis=1)
    both = white(problem, tolerances, both, out=both)
    first = problem.sip.shape[1]
    units = {
        name: (slice(first + at.start, first + at.stop), unit * sizes[at]) for name, (at, unit) in known.causes.items()
    }
    return both[:, :-1], both[:, -1], [BODY] * first + [_group(key, care) for key in known.keys], units


def _with_observations(
    X: Array, y: Array, names: list[str], units: _Units, seen: ObservedEvidence, reach: Array
) -> tuple[Array, Array, list[str]]:
    """Return columns, target and groups with the observations below, in which tolerances of plates show, too."""
    own = np.array([one.sd for one in seen.observations])
    below = np.zeros((len(own), X.shape[1]))
    for name, (at, unit) in units.items():
        if name in seen.sensitivities:
            below[:, at] = np.outer(seen.sensitivities[name] / own, unit[0])
    # Errors that observations share: one unit-normal coefficient each, columns below the simulated rows only.
    shared = seen.shared / own[:, None]
    top = np.concatenate([X, np.zeros((len(X), shared.shape[1]))], axis=1)
    bottom = np.concatenate([below, shared], axis=1) * reach[:, None]
    value = reach * np.array([one.value - one.expected for one in seen.observations]) / own
    return np.concatenate([top, bottom]), np.concatenate([y, value]), [*names, *[FIXED] * shared.shape[1]]


def _group(key: str, care: Mapping[str, Care]) -> str:
    """Return the group of a key: alike in kind is as large together; learned between laboratories holds as it is."""
    if key in between_laboratories():
        return FIXED
    kind = key.removeprefix("habit ").split()[0]
    return kind if kind in SOFT else care.get(kind, Care.OTHER)


def _members(count: int, units: _Units) -> NDArray[np.intp]:
    """Return `Rows.member` of ``count`` columns: targets of effects of which each is as it is."""
    found, own = np.full(count, -1), {name for name, one in effects().items() if one.each_its_own}
    for number, at in enumerate(at for (name, _), (at, _) in units.items() if name in own):
        found[at] = number
    return found


def _blocks(problem: Problem | None, count: int) -> NDArray[np.intp]:
    """Return the noise group of every row."""
    if problem is None:
        return np.full(count, -1)
    # Rows run over coefficients first, then over the six channels, as `ravel` of (m, 6).
    plates = (6 * problem.spectrum.band[:, None] + np.arange(6)).ravel()
    markers = np.full(len(problem.target) - plates.size, 6 * len(BANDS))
    return np.concatenate([plates, markers, np.full(count - len(problem.target), -1)])
