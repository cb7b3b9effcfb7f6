"""The problem under its tolerances: whitened rows, columns of all that is no fault, and the causes that were named
so far.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.human.skeleton import kind_of
from biodance.diagnosis.by_trial import ByTrial
from biodance.diagnosis.candidates import SCALE, Candidate, candidates, removed, slopes
from biodance.diagnosis.evidence import LinearPosterior, linear_posterior
from biodance.diagnosis.problem import Problem
from biodance.discovery import Chosen
from biodance.effects import Effect, effects
from biodance.motion.kinematics import chains
from biodance.records import Array
from biodance.uncertainty.joints import joint_of
from biodance.uncertainty.session_noise import with_own_noise
from biodance.uncertainty.tolerances import HABIT, Tolerances, in_state, key_of, mean_key, whitened

_HEAVIER = 0.3
"""Share of a segment's mass by which it must look heavier before its kinematic errors are computed again."""
UNLIKE = 0.07
"""Share of its size by which every cause is unlike its model at least: derivatives at the samples that are looked at
are no better at the upper edge of the bands."""
_NOTICED = 0.1
"""Share by which the noise of any channel and band must grow before it is taken for larger.
"""
_STALE = 0.03
"""Share of the predicted wrench that may change before causes are predicted again: their sizes are then right to
this share.
"""


@dataclass(frozen=True, eq=False)
class NamedCause:
    """A cause of size ``theta`` (p,) with ``covariance`` (p, p); for a cause that comes and goes the force while it
    acts, and per trial the
    ``course`` of its parameters, as in `Transient.local`.
    """

    effect: Effect
    theta: Array
    covariance: Array
    course: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Model:
    """``problem`` with the parameters in use, under ``tolerances``; ``posterior`` about all that is no fault, the
    ``named`` causes and what is ``expected`` (r,) of a session without fault taken off; ``tolerated`` by effect and
    target: where the columns of its tolerance lie in the posterior, and (p, k) what one of each is in its parameters.

    ``log_likelihood`` of the target under it, up to a constant of the session.
    """

    problem: Problem
    tolerances: Tolerances
    posterior: LinearPosterior
    expected: Array
    named: tuple[NamedCause, ...] = ()
    tolerated: Mapping[tuple[str, str], tuple[slice, Array]] = field(default_factory=dict)

    def whole(self, one: NamedCause) -> Array:
        """Return the size (p,) of a named cause with what its own tolerance has taken of it: both look alike, and the
        sum is what is there (docs/decisions/2026-11-22-size-with-its-tolerance.md).
        """
        where, unit = self.tolerated.get(
            (one.effect.name, one.effect.target), (slice(0), np.zeros((one.theta.size, 0)))
        )
        return one.theta + unit @ self.posterior.mean[where]

    @property
    def log_likelihood(self) -> float:
        """-1/2 y' C^-1 y with C the covariance of the rows under everything that is no fault."""
        return -0.5 * float(self.posterior.y @ self.posterior.residual)

    @property
    def phi(self) -> Array:
        """(10N,) posterior mean of the parameters."""
        return self.problem.prior.phi + self.problem.factor @ self.posterior.mean[: self.problem.factor.shape[1]]

    @cached_property
    def named_columns(self) -> Array:
        """(r, k) whitened columns of the named causes, per prior standard deviation of a fault."""
        parts = [
            slopes(self.problem, one.effect, one.theta, of=one.effect.removed) * SCALE * one.effect.typical
            for one in self.named
        ]
        return self.white(np.concatenate(parts, axis=1)) if parts else np.empty((self.posterior.y.size, 0))

    @cached_property
    def named_score(self) -> tuple[Array, Array]:
        """Score (k,) and information (k, k) of the named causes at their current sizes."""
        return self.posterior.score(self.named_columns)

    def white(self, rows: Array, *, out: Array | None = None) -> Array:
        """Return whitened ``rows`` (r, n), in ``out`` (which may be ``rows``) or a new array."""
        return white(self.problem, self.tolerances, rows, out=out)

    def length(self, Z: Array, rows: slice = slice(None)) -> float:
        """Return the sum of squares of whitened columns ``Z`` (r, k), which are these ``rows`` of the session, had no
        plate a zero: noise is always there, but a zero is an error, which hides what looks like it.
        """
        slow = np.flatnonzero(np.repeat(self.problem.spectrum.band, 6)[rows] == 0)
        known, means = self.tolerances, Z[slow].reshape(-1, 6, Z.shape[1])
        alone, both = np.linalg.cholesky(known.noise[0] - known.zeros[0]), np.linalg.cholesky(known.noise[0])
        return float(np.sum(Z**2) - np.sum(means**2) + np.sum((np.linalg.solve(alone, both) @ means) ** 2))

    def in_newtons(self, white: Array) -> Array:
        """Return (m, 6) N, N·m: the plates' rows of whitened rows ``white`` (r,), as they were before."""
        band = self.problem.spectrum.band
        coloured = np.linalg.inv(self.tolerances.whiteners(_body_mass(self.problem)))
        return np.asarray(np.einsum("mij,mj->mi", coloured[band], white[: 6 * band.size].reshape(-1, 6)))

    def white_by_trial(self, columns: ByTrial) -> ByTrial:
        """Return the whitened ``columns`` of the plates' rows, of which every trial has its own."""
        band, mass = self.problem.spectrum.band, _body_mass(self.problem)
        parts = (
            replace(p, values=whitened(p.values, band[p.rows.start // 6 : p.rows.stop // 6], (), mass, self.tolerances))
            for p in columns.parts
        )
        return replace(columns, parts=tuple(parts))

    def under(self, tolerances: Tolerances) -> "Model":
        """Return the model with the noise of the plates as in ``tolerances``, all else as it is."""
        if tolerances is self.tolerances:
            return self
        band, mass = self.problem.spectrum.band, _body_mass(self.problem)
        turn = tolerances.whiteners(mass) @ np.linalg.inv(self.tolerances.whiteners(mass))
        both = np.concatenate([self.posterior.X, self.posterior.y[:, None]], axis=1)
        wrench = both[: 6 * band.size].reshape(band.size, 6, -1)
        for b, matrix in enumerate(turn.astype(both.dtype)):
            wrench[band == b] = matrix @ wrench[band == b]
        return replace(self, tolerances=tolerances, posterior=linear_posterior(both[:, :-1], both[:, -1]))

    def without_causes(self, named: tuple[NamedCause, ...]) -> "Model":
        """Return the model with the contributions of the causes ``named`` removed from the target."""
        y = self.problem.target - self.expected
        for one in named:
            y = y - removed(self.problem, one.effect, one.theta)
        X, factor = self.posterior.X, self.posterior.factor
        return replace(self, posterior=LinearPosterior.for_target(X, factor, self.white(y[:, None])[:, 0]), named=named)


def white(problem: Problem, tolerances: Tolerances, rows: Array, *, out: Array | None = None) -> Array:
    """Return ``rows`` (r, n) of the problem in units of their standard deviation, in ``out`` or a new array."""
    return whitened(rows, problem.spectrum.band, marker_keys(problem), _body_mass(problem), tolerances, out=out)


def _body_mass(problem: Problem) -> float:
    return float(problem.cases[0].body.sip.mass.sum())


def marker_keys(problem: Problem) -> tuple[str, ...]:
    """Return the keys of the rows that follow those of the plates."""
    body = problem.cases[0].body
    wholes = (*range(len(body.segments)), *(part.segment for part in body.parts))
    keys = tuple(f"marker {kind_of(body.segments[wholes[s]])}" for s in body.markers.segment for _ in range(3))
    return keys + tuple(f"shown {name}" for name, _ in problem.shown)


@dataclass(frozen=True, eq=False)
class Nuisances:
    """All that may be no fault: ``parts`` (r, k) of the columns (r, K), which times ``scale`` (K,) are per unit; the
    ``keys`` (K) of their sizes and ``means`` (K) of their means ("" for those that have none: the signs of slides and
    tilts are mirrored between sides and persons); ``causes`` by effect and target: its columns, and (p, k) what one
    unit of each is in its parameters.
    """

    parts: tuple[NDArray[np.floating], ...]
    scale: Array
    keys: tuple[str, ...]
    means: tuple[str, ...]
    causes: Mapping[tuple[str, str], tuple[slice, Array]]


def nuisances(problem: Problem, causes: tuple[Candidate, ...]) -> Nuisances:
    """Return the kinematic errors of a problem and the ``causes`` that are tolerances."""
    body = problem.cases[0].body
    joints = {joint_of(body, chain) for chain in chains(body)}
    parts: list[NDArray[np.floating]] = [problem.kinematics]
    keys, scale = list(problem.groups), [1.0] * problem.kinematics.shape[1]
    means = [group if group.startswith("sag ") else "" for group in problem.groups]
    tolerated = {}
    for one in causes:
        parts.append(one.basis)
        key, width = key_of(*one.names), one.basis.shape[1]
        tolerated[one.names] = slice(len(keys), len(keys) + width), one.units
        scale += [1 / (SCALE * one.effect.typical[0])] * width
        own = in_state(key, one.effect.target if one.effect.target in joints else "", body)
        loud = [p.name for p, silent in zip(one.effect.parameters, one.silent, strict=True) if not silent]
        keys += [own] * width
        means += [mean_key(*one.names, name) if own == key else "" for name in loud] + [""] * (width - len(loud))
        if one.names in problem.shown:
            parts.append(_where_not_shown(problem, one.basis))
            scale += scale[-width:]
            keys += [HABIT + key] * width
            means += [""] * width
    return Nuisances(tuple(parts), np.array(scale), tuple(keys), tuple(means), tolerated)


def _where_not_shown(problem: Problem, columns: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return ``columns`` (r, k) with zero in the rows of sizes shown: what everybody does by habit is taken off there
    already (`Effect.shown`).
    """
    out = np.array(columns)
    out[len(out) - len(problem.shown) :] = 0.0
    return out


def shown_left_out(expected: Array, marker_keys: tuple[str, ...]) -> Array:
    """Return ``expected`` (r,) with zero in the rows of sizes shown: what everybody shows is taken off there
    already.
    """
    shown = [key.startswith("shown ") for key in marker_keys]
    return np.concatenate(
        [expected[: len(expected) - len(shown)], np.where(shown, 0.0, expected[len(expected) - len(shown) :])]
    )


def model(problem: Problem, causes: tuple[Candidate, ...], tolerances: Tolerances) -> Model:
    """Return the model without any named cause; those of ``causes`` with a learned size are tolerances as well."""
    known = nuisances(problem, tuple(one for one in causes if tolerances.size(key_of(*one.names)) > 0))
    both = np.concatenate([problem.sip, *known.parts, problem.target[:, None]], axis=1)  # the largest array, made once
    columns = both[:, problem.sip.shape[1] : -1]
    columns *= known.scale
    expected = shown_left_out(columns @ np.array([tolerances.mean(key) for key in known.means]), marker_keys(problem))
    sizes = np.array([tolerances.size(key) for key in known.keys])
    columns *= sizes
    both[:, -1] -= expected
    both = white(problem, tolerances, both, out=both)
    first = problem.sip.shape[1]
    own = {n: (slice(first + c.start, first + c.stop), u * sizes[c]) for n, (c, u) in known.causes.items()}
    return Model(problem, tolerances, linear_posterior(both[:, :-1], both[:, -1]), expected, tolerated=own)


def unlike(effect: Effect) -> float:
    """Return the share of its size by which the wrench of a cause may be unlike its model: no cause is quite like it,
    and some say that they are less so (`Effect.unlike`).
    """
    return max(UNLIKE, effect.unlike)


def with_unlike_causes(found: Model, known: Tolerances) -> Model:
    """Return the model with the noise of the ``known`` tolerances and, beside it, what the named causes leave because
    no cause is quite like its model: the share `unlike` of what each adds to the wrench, per band. Causes that come and
    go have a course of their own, which fits what is there.
    """
    band = found.problem.spectrum.band
    added = np.zeros_like(known.noise)
    for one in (one for one in found.named if not one.course):
        whole = removed(found.problem, one.effect, one.effect.told_size(one.theta))
        rows = unlike(one.effect) * whole[: 6 * band.size].reshape(-1, 6)
        for b in range(1, len(added)):
            added[b] += rows[band == b].T @ rows[band == b] / max(1, np.sum(band == b))
    wider = with_own_noise(known, added, _body_mass(found.problem))
    noise = np.diagonal(found.tolerances.noise, axis1=1, axis2=2)
    grown = np.diagonal(wider.noise, axis1=1, axis2=2) / noise
    return found.under(wider) if np.abs(grown - 1).max() > _NOTICED else found


def is_much_heavier(found: Model) -> bool:
    """Return whether any segment is so much heavier than its prior that its kinematic errors grow noticeably."""
    before = found.problem.prior.mass
    return bool(np.any(found.phi[::10] - before > _HEAVIER * before))


def needs_rebuilding(found: Model) -> bool:
    """Return whether the posterior mean predicts wrenches that differ from those in use by more than `_STALE`."""
    both = np.zeros(2)
    for case in found.problem.cases:
        wrench = np.stack([case.needed(found.phi - case.phi), case.predicted], axis=2)
        both += np.sum((wrench - wrench.mean(axis=0)) ** 2, axis=(0, 1))
    return bool(both[0] > _STALE**2 * both[1])


def causes_of(problem: Problem, tolerances: Tolerances, chosen: Chosen[Effect]) -> tuple[Candidate, ...]:
    """Return all causes to search for, and those that are not searched for but keep their tolerance."""
    family = effects(chosen)
    return candidates(
        problem, {n: one for n, one in {**effects(), **family}.items() if n in family or tolerances.knows(n)}
    )


def build_model(
    problem: Problem,
    tolerances: Tolerances,
    chosen: Chosen[Effect],
    every: tuple[Candidate, ...] | None = None,
) -> tuple[Model, tuple[Candidate, ...]]:
    """Return the model without named causes, and the causes to search for; all others keep their tolerances."""
    family, every = effects(chosen), every or causes_of(problem, tolerances, chosen)
    return model(problem, every, tolerances), tuple(one for one in every if one.names[0] in family)
