"""Learn from sessions without fault how large everything is that is no fault, all of them at once
(`uncertainty/learning`).

A coefficient of a nuisance is normal with the mean and the size of its key; a mean counts only where the sessions agree
on it. What a joint may err before functional calibration is the literature's, and stays.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from biodance.diagnosis.candidates import Candidate
from biodance.diagnosis.model import marker_keys, nuisances, shown_left_out
from biodance.diagnosis.problem import Problem
from biodance.diagnosis.spectrum import needed
from biodance.records import Array
from biodance.uncertainty.learning import Moments, maximise, moments_of, noise_of, sizes_of
from biodance.uncertainty.tolerances import BEFORE, REFERENCE_PERSON, Tolerances, whitened


@dataclass(frozen=True, eq=False)
class Null:
    """One session without fault: ``target`` (r,); ``columns`` (r, K) in unit size with their ``keys`` (K), "" for the
    parameters' prior (unit normal), and ``mean_keys`` (K), "" for columns without a mean; ``band`` (m,) of the 6 m
    wrench rows; ``marker_keys`` of the rows that follow; ``mass`` kg; ``movement`` (B, 6) mean square of a coefficient
    of the wrench that it needs, at `REFERENCE_PERSON`.
    """

    target: Array
    columns: Array
    keys: tuple[str, ...]
    band: NDArray[np.intp]
    marker_keys: tuple[str, ...]
    mass: float
    movement: Array
    mean_keys: tuple[str, ...] = ()


def null_of(problem: Problem, causes: tuple[Candidate, ...]) -> Null:
    """Return a session without fault as `learn` wants it; ``causes`` all of the family."""
    known = nuisances(problem, causes)
    own = ("",) * problem.sip.shape[1]
    columns = np.concatenate(known.parts, axis=1) * known.scale
    every: Array = np.concatenate([problem.sip, columns], axis=1).astype(np.float32)  # type: ignore[assignment]
    return Null(
        problem.target,
        every,
        own + known.keys,
        problem.spectrum.band,
        marker_keys(problem),
        problem.mass,
        needed(problem.cases, problem.spectrum),
        own + known.means,
    )


def learn_tolerances(nulls: Iterable[Null], start: Tolerances, *, rounds: int = 10, worth: float = 0.0) -> Tolerances:
    """Return the sizes, means and noise under which the null sessions are most probable after ``rounds`` of expectation
    maximisation, and the movement that they were learned on. Only what has a size in ``start`` is learned; ``start`` is
    believed like ``worth`` sessions more.
    """
    sessions = tuple(nulls)
    share = worth / (worth + len(sessions))

    def improved(known: Tolerances) -> Tolerances:
        fresh = _improved(sessions, known)
        # Mean squares, not deviations, are averaged by their worth in sessions.
        squares = {key: (1 - share) * size**2 + share * start.size(key) ** 2 for key, size in fresh.sizes.items()}
        sizes = {key: float(np.sqrt(square)) for key, square in squares.items()}
        return replace(fresh, sizes=sizes, noise=(1 - share) * fresh.noise + share * start.noise)

    found = maximise(start, improved, lambda known: known.noise, rounds=rounds)
    moved = np.mean([null.movement for null in sessions], axis=0)
    return replace(found, movement=(1 - share) * moved + share * start.movement)


def shown_by(nulls: Iterable[Null], found: Tolerances) -> dict[str, float]:
    """Return by key how many coefficients of its size the sessions show: 1 for each that is known far better than its
    size, 0 for one that no movement showed.
    """
    count: dict[str, float] = {}
    for null in nulls:
        some = _posterior(null, found)
        for key, variance in zip(null.keys, some.variance, strict=True):
            if key and np.isfinite(variance):
                # Share of the size's variance that the session took off.
                count[key] = count.get(key, 0.0) + max(0.0, 1 - float(variance) / found.size(key) ** 2)
    return count


@dataclass(frozen=True, eq=False)
class _Posterior:
    """What one session says of its coefficients, NaN without a size; ``spread`` (r, k) a root of what stays unsure."""

    value: Array
    variance: Array
    left: Array
    spread: Array


def _posterior(null: Null, found: Tolerances) -> _Posterior:
    """Return what one session says about all coefficients under the tolerances ``found``."""
    size = np.array([1.0 if key == "" else found.size(key) for key in null.keys])
    expected = np.array([found.mean(name) if name else 0.0 for name in null.mean_keys or null.keys])
    known = np.flatnonzero(size > 0)
    # Coefficients of unit variance: columns times the sizes, less what is expected.
    scaled = null.columns[:, known] * size[known].astype(null.columns.dtype)
    target = null.target - shown_left_out(null.columns[:, known] @ expected[known], null.marker_keys)
    X = whitened(scaled, null.band, null.marker_keys, null.mass, found)
    y = whitened(target[:, None].astype(X.dtype), null.band, null.marker_keys, null.mass, found)[:, 0]
    # A = X'X + 1: data and unit-normal prior.
    factor = cho_factor((X.T @ X).astype(float) + np.eye(known.size), lower=True)
    mean, covariance = cho_solve(factor, (X.T @ y).astype(float)), cho_solve(factor, np.eye(known.size))
    value, variance = np.full((2, size.size), np.nan)
    # Back to the units of the coefficients.
    value[known], variance[known] = expected[known] + size[known] * mean, size[known] ** 2 * np.diag(covariance)
    # scaled @ chol(covariance): a root of what the coefficients leave uncertain in the rows.
    return _Posterior(
        value, variance, target - scaled @ mean, scaled @ np.linalg.cholesky(covariance).astype(scaled.dtype)
    )


def _improved(sessions: tuple[Null, ...], found: Tolerances) -> Tolerances:
    """Return the tolerances after one round."""
    rows: list[tuple[str, str, float, float]] = []
    bands = len(found.noise)
    total = Moments(np.zeros_like(found.noise), np.zeros(bands))
    for null in sessions:
        some = _posterior(null, found)
        names = null.mean_keys or ("",) * len(null.keys)
        rows += [
            row
            for row in zip(null.keys, names, some.value, some.variance, strict=True)
            if row[0] and np.isfinite(row[2])
        ]
        wrench = 6 * null.band.size
        # E[r²]: square of the residual at the mean plus the posterior variance.
        seen = some.left[wrench:] ** 2 + (some.spread[wrench:] ** 2).sum(axis=1)
        rows += [(key, "", float(np.sqrt(square)), 0.0) for key, square in zip(null.marker_keys, seen, strict=True)]
        parts = np.concatenate([some.left[:wrench, None], some.spread[:wrench]], axis=1).reshape(null.band.size, 6, -1)
        here = moments_of(parts, null.band, bands)
        # Noise is stated for the reference person.
        total = total + replace(here, residual=here.residual * (REFERENCE_PERSON / null.mass) ** 2)
    means, sizes = sizes_of(rows)
    learned = {key: size for key, size in sizes.items() if not key.endswith(BEFORE)}
    return replace(found, sizes={**found.sizes, **learned}, noise=noise_of(total), means=means)
