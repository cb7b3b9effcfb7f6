"""Every cause of the family at every target, as columns whose coefficients are unit normal before the data.

A cause that is linear in its parameters has its own columns. One that is not (the place of a load matters only once it
weighs something) is spanned by what it does at its typical size: the columns at zero, and the differences that the
other parameters make there.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from biodance.diagnosis.problem import Problem
from biodance.discovery import Chosen
from biodance.effects import Case, Effect, Transient, effects
from biodance.records import Array

SCALE = 3.0
"""Standard deviation of a fault before the data, in typical sizes."""
IN_SET = 0.95
"""Share of the posterior of its place that the set of a cause holds."""
TOGETHER = 3.0
"""Natural logarithm: causes that are at most this much less probable than the best one are in its set."""
_EMPTY = 50.0
"""N that a plate carries at most that is always empty."""
AT_ONCE = 32
"""Causes whose columns are computed at once: little memory, however many there are."""
_NOTHING = 1e-7
"""Share of the largest column below which a column is zero."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One cause: ``basis`` (r, k) rows per unit-normal coefficient, in single precision because there are hundreds;
    ``silent`` (p,) True for parameters whose column vanishes at zero.
    """

    effect: Effect
    basis: NDArray[np.float32]
    silent: tuple[bool, ...]

    @property
    def names(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect.name, self.effect.target

    @property
    def units(self) -> Array:
        """(p, k): what each column is in the parameters, for one unit of the first; zero for silent ones."""
        loud = np.flatnonzero(~np.array(self.silent))
        out = np.zeros((len(self.silent), self.basis.shape[1]))
        # One unit of the first parameter goes with as many of the others as their typical sizes say.
        out[loud, np.arange(loud.size)] = self.effect.typical[loud] / self.effect.typical[0]
        return out

    def start(self, coefficients: Array) -> Array:
        """Return the parameters (p,) near which to begin fitting, from the coefficients (k,) of the basis."""
        typical, silent = self.effect.typical, np.array(self.silent)
        theta = np.zeros(typical.size)
        loud = np.flatnonzero(~silent)
        theta[loud] = SCALE * typical[loud] * coefficients[: loud.size]
        if silent.any():
            size = theta[loud[0]] / typical[loud[0]]
            if abs(size) > 0.05:
                # Silent columns were made at the typical size of the others: coefficient = slope times that size.
                slopes = SCALE * coefficients[loud.size : loud.size + silent.sum()]
                theta[silent] = typical[silent] * np.clip(slopes / size, -3.0, 3.0)
        return theta


def candidates(problem: Problem, chosen: Chosen[Effect] = None) -> tuple[Candidate, ...]:
    """Return all causes of the family (or those ``chosen``, see `effects`) at all their targets; those without any
    trace are left out.
    """
    empty = empty_plates(problem.cases)
    every = [one for effect in effects(chosen).values() for one in effect.at_all_targets(problem.cases[0])]
    every = [one for one in every if not (one.by_load and one.target.partition(":")[0] in empty)]
    found = [
        candidate(problem, effect, columns)
        for some in (every[start : start + AT_ONCE] for start in range(0, len(every), AT_ONCE))
        for effect, columns in zip(some, problem.columns(some), strict=True)
    ]
    return tuple(one for one in found if one.basis.shape[1])


def empty_plates(cases: tuple[Case, ...]) -> frozenset[str]:
    """Return the plates on which nobody ever stands in any of the ``cases``."""
    names = {plate.name for case in cases for plate in case.trial.plates}
    trodden = {
        plate.name
        for case in cases
        for plate in case.trial.plates
        if plate.wrench.force[:, 2].max(initial=0.0) > _EMPTY
    }
    return frozenset(names - trodden)


def candidate(problem: Problem, effect: Effect, unit: Array) -> Candidate:
    """Return one cause with its basis, from its columns (r, p) per ``unit`` of each parameter."""
    columns = unit * effect.typical
    length = np.linalg.norm(columns, axis=0)
    silent = length <= _NOTHING * length.max(initial=1e-300)
    parts = list(columns[:, ~silent].T)
    if silent.any() and not silent.all():
        parts += _differences(problem, effect, silent)
    basis = SCALE * np.array(parts).T if parts else np.empty((len(columns), 0))
    return Candidate(effect, basis.astype(np.float32), tuple(bool(s) for s in silent))


def bases_of(causes: Sequence[Candidate]) -> tuple[Array, tuple[slice, ...]]:
    """Return the columns (r, k) of all ``causes`` side by side, and where each of them lies."""
    ends = np.cumsum([0, *(one.basis.shape[1] for one in causes)]).tolist()
    return np.concatenate([one.basis for one in causes], axis=1, dtype=float), tuple(
        slice(*pair) for pair in pairwise(ends)
    )


def log_priors(causes: Sequence[Candidate]) -> dict[tuple[str, str], float]:
    """Return the log prior odds of every cause: of its effect, shared by its targets."""
    targets = Counter(one.names[0] for one in causes)
    share = {one.names: one.effect.prior / targets[one.names[0]] for one in causes}
    return {name: float(np.log(p / (1 - p))) for name, p in share.items()}


def _differences(problem: Problem, effect: Effect, silent: Array) -> list[Array]:
    """Return what the silent parameters change at the typical size of the others: first differences, then second."""
    middle, steps = np.where(silent, 0.0, effect.typical)[:, None], np.diag(effect.typical)[:, silent]
    rows = _in_rows(problem, effect, np.hstack([middle, middle + steps, middle - steps]), effect.added)
    here, up, down = np.split(rows, [1, 1 + steps.shape[1]], axis=1)
    # Odd part of the change, (up - down) / 2, and the even part, which bends.
    first, second = 0.5 * (up - down), 0.5 * (up + down) - here
    bent = np.linalg.norm(second, axis=0) > _NOTHING * np.linalg.norm(here)
    return [*first.T, *second[:, bent].T]


def local_basis(problem: Problem, effect: Transient) -> Array | None:
    """Return the columns (r, k) of the plates' rows of a cause that comes and goes, each trial its own; None where the
    cause has none.
    """
    blocks = []
    for index, case in enumerate(problem.cases):
        samples = effect.local(case)
        if samples is None:
            return None
        block = problem.spectrum.of_trial(index, samples)
        blocks.append(block.reshape(6 * len(block), block.shape[2]))
    # Block diagonal: every trial has coefficients of its own.
    return np.asarray(block_diag(*blocks))


def changes(problem: Problem, effect: Effect, theta: Array) -> Array:
    """Return (r,): what the cause of size ``theta`` (p,) adds to the rows."""
    return _in_rows(problem, effect, theta[:, None], effect.added)[:, 0]


def removed(problem: Problem, effect: Effect, theta: Array) -> Array:
    """Return (r,): what the cause of size ``theta`` (p,) has added to the rows, as far as it can be undone in what
    was measured.
    """
    return _in_rows(problem, effect, theta[:, None], effect.removed)[:, 0]


def _in_rows(problem: Problem, effect: Effect, sizes: Array, wrench: Callable[[Case, Array], Array]) -> Array:
    """Return (r, k): the rows of ``wrench`` (T, 6) of all cases, and of markers, for each of ``sizes`` (p, k)."""
    if effect.linear:
        return np.asarray(problem.unit(effect) @ sizes)
    rows = problem.spectrum.rows(np.stack([wrench(case, one) for one in sizes.T], axis=2) for case in problem.cases)
    return np.concatenate([rows.reshape(-1, sizes.shape[1]), problem.marker_rows(effect) @ sizes])


def slopes(
    problem: Problem, effect: Effect, theta: Array, *, of: Callable[[Case, Array], Array] | None = None
) -> Array:
    """Return (r, p): derivative at ``theta`` of the rows of ``of``, what the cause adds (by default) or removes; of a
    cause that is not linear by central differences.
    """
    if effect.linear:
        return problem.unit(effect)
    steps = 0.02 * np.diag(effect.typical)
    up, down = np.hsplit(
        _in_rows(problem, effect, np.concatenate([theta + steps, theta - steps]).T, of or effect.added), 2
    )
    # Central difference; each row of `steps` has one element that is not zero.
    return np.asarray((up - down) / (2 * steps.max(axis=1)))
