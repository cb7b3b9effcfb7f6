"""Transient external contacts, such as a touch of a rail or a helping hand; sought only if no steady cause explains the
session.

Each trial has its own time course of the force, hence hundreds of columns. Three of the six channels remain
unconstrained by it, so that such a force cannot explain everything.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve, solve_triangular

from biodance.diagnosis.adequacy import LIMIT, adequacy, largest_z
from biodance.diagnosis.by_trial import ByTrial
from biodance.diagnosis.candidates import local_basis
from biodance.diagnosis.consequence import matters
from biodance.diagnosis.evidence import Evidence, evidence, linear_posterior, visible
from biodance.diagnosis.joint_fit import log_bayes_factor_between
from biodance.diagnosis.model import Model, NamedCause
from biodance.diagnosis.naming import Naming, Round, is_significant, required_evidence
from biodance.diagnosis.screening import ScoredCandidate
from biodance.discovery import Chosen
from biodance.effects import Effect, Transient, effects
from biodance.records import Array

SIZES = (2.0, 8.0, 30.0)
"""Standard deviations of the course before the data (units of the parameter): the most probable one is taken."""
OTHER_SIDE = 0.2
"""Share of its squares that a touch may lie on the other side."""
_QUICK, _END = 0.2, 2
"""Share of its squares that the steps between values 0.4 s apart hold at least in a touch, and values at the ends of a
trial that are not asked. A touch of d seconds has 0.8 s / d where it takes hold at once, half of that where it takes
0.8 s; what creeps back with a time constant T has (0.4 s / T)². Seen: touches of 1.6 s 0.57 to 0.69, creep 0.04 to
0.08.
"""
_BESIDE = 0.1
"""m, standard deviation before the data of the place of a touch from the far end of its segment: a hand's length."""
_STEPS = 2
"""Gauss-Newton steps of a place and the course of the force together."""


@dataclass(frozen=True, eq=False)
class _TransientContact:
    """One transient contact: whitened unit columns ``white``, their ``score`` (k,) and ``information`` (k, k), its
    ``log_bayes_factor`` at the best ``size``, and the ``length`` of the columns (`Model.length`).
    """

    effect: Transient
    white: ByTrial
    score: Array
    information: Array
    size: float
    log_bayes_factor: float
    length: float

    @cached_property
    def found(self) -> Evidence:
        """Its evidence at its size."""
        squared = self.size**2
        return evidence(self.size * self.score, squared * self.information, squared * self.length)

    @property
    def visible(self) -> float:
        """Share of it that remains when all tolerances adapt."""
        return visible(self.information, self.length)


def with_transient_contact(naming: Naming, chosen: Chosen[Effect] = None) -> Naming:
    """Return the naming with a transient contact added if the steady causes leave too large a residual and the contact
    leaves a smaller one; otherwise unchanged.

    The contact is tried in place of the named causes, if it is more probable than all of them, and in addition to them;
    the more probable of both namings is kept, under one noise: more causes leave less, true or not.
    """
    worst = largest_z(adequacy(naming.found))
    if worst <= LIMIT:
        return naming
    bare = naming.bare.under(naming.found.tolerances)
    steady = log_bayes_factor_between(naming.found, bare)
    tried = [(_with(naming, naming.bare, (), chosen, than=steady), bare, 0.0)]
    if naming.found.named:
        tried += [(_with(naming, naming.found, naming.accepted, chosen, than=0.0), naming.found, steady)]
    best = [(one, base, bayes) for one, base, bayes in tried if one and largest_z(adequacy(one.found)) < worst]
    if len(best) > 1:
        best.sort(key=lambda pair: -pair[2] - _log_bayes_factor_of_contact(pair[1], pair[0]))
    return best[0][0] if best else naming


def _log_bayes_factor_of_contact(base: Model, naming: Naming) -> float:
    """Return the log Bayes factor of the contact named last, against the model ``base`` without it."""
    contact = naming.accepted[-1].suspects[0].effect
    sized = _best_size(base, contact) if isinstance(contact, Transient) else None
    return sized.log_bayes_factor if sized else -np.inf


def _with(
    naming: Naming, base: Model, accepted: tuple[Round, ...], chosen: Chosen[Effect], *, than: float
) -> Naming | None:
    """Return the naming of ``base`` with the most probable transient contact; None if its evidence is below the
    threshold or below the log Bayes factor ``than`` of the causes it replaces.
    """
    every = (one for effect in effects(chosen).values() for one in effect.at_all_targets(base.problem.cases[0]))
    kinds = [one for one in every if isinstance(one, Transient)]
    best, suspects = _screened(base, kinds)
    if best is None:
        return None
    if suspects[0].score < max(base.tolerances.threshold, than, required_evidence(base, best.visible)):
        return None
    values = _touching(base, best)
    if values is None:
        return None
    effect, white = _placed(base, best)
    wide = white.scaled(SIZES[-1])  # widest: the most probable one would shrink short peaks
    course = SIZES[-1] * _posterior_mean(base, wide, np.zeros(wide.width))
    touch = _named(base, effect, course, best, values)
    if not (is_significant(base, touch) and matters(touch.effect, touch.theta)):
        return None
    posterior = linear_posterior(
        np.concatenate([base.posterior.X, wide.whole(base.posterior.y.size)], axis=1), base.posterior.y
    )
    named = (*base.named, touch)
    model = replace(base, posterior=posterior, named=named)
    return Naming(naming.first, model, (*accepted, Round(suspects)), naming.screening, naming.first_causes, naming.bare)


def _screened(base: Model, kinds: Sequence[Transient]) -> tuple[_TransientContact | None, tuple[ScoredCandidate, ...]]:
    """Return the most probable transient contact (None if there is none), and the evidence of all of them, most
    probable first; columns are kept only for the best.
    """
    best, found = None, []
    for effect in kinds:
        one = _best_size(base, effect)
        if one is not None:
            value = one.log_bayes_factor
            found.append(ScoredCandidate(effect, value, value, np.zeros(0), one.visible))
            best = one if best is None or value > best.log_bayes_factor else best
    price = float(np.log(max(len(found), 1)))
    found.sort(key=lambda one: -one.score)
    return best, tuple(replace(one, score=one.score - price) for one in found)


def _touching(base: Model, one: _TransientContact) -> Array | None:
    """Return the values (n, p) over time of a contact's course, if it is that of something touched: on one side of zero
    or, as the plate's zero and the body's weight take the mean of a trial from a foot, of where it lies most of the
    time in its trial, if it is quick. None for one that is neither.
    """
    values, beside, start = one.size * one.found.mean.reshape(-1, len(one.effect.parameters)), [], 0
    if one_sided(values):
        return values
    for case in base.problem.cases:
        columns = one.effect.local(case)
        stop = start + (0 if columns is None else columns.shape[2] // values.shape[1])
        beside.append(values[start:stop] - (np.median(values[start:stop], axis=0) if stop > start else 0.0))
        start = stop
    inner = [part[_END:-_END] for part in beside]  # nobody judges the ends of a trial: there the course is open
    return np.concatenate(beside) if one_sided(np.concatenate(inner)) and quick(inner) else None


def quick(courses: Sequence[Array]) -> bool:
    """Return whether forces (n, 3) over time, one of each trial, take hold and let go as a hand or foot does: what
    swells or creeps back does not.
    """
    steps = sum(float(np.sum(np.diff(course, axis=0) ** 2)) for course in courses)
    return steps >= _QUICK * sum(float(np.sum(course**2)) for course in courses)


def one_sided(course: Array) -> bool:
    """Return whether a force (n, 3) over time keeps to one side of its main direction, as what is touched does; a
    slow swell does not.
    """
    _, _, directions = np.linalg.svd(course, full_matrices=False)
    along = course @ directions[0]
    sides = np.sum(np.maximum(along, 0) ** 2), np.sum(np.minimum(along, 0) ** 2)
    return bool(min(sides) <= OTHER_SIDE * sum(sides))


def _best_size(base: Model, effect: Transient) -> _TransientContact | None:
    """Return a transient contact with its most probable size; None for effects that are not transient."""
    columns = local_basis(base.problem, effect)
    if columns is None:
        return None
    white = base.white_by_trial(columns)
    s, G = white.against(base.posterior.residual), white.information(base.posterior)
    value, size = max((_log_bayes_factor(s, G, size), size) for size in SIZES)
    return _TransientContact(effect, white, s, G, size, value, sum(base.length(p.values, p.rows) for p in white.parts))


def _log_bayes_factor(s: Array, G: Array, size: float) -> float:
    """Return the log Bayes factor (see `evidence`) of a course of one size."""
    factor = cholesky(np.eye(len(s)) + size**2 * G, lower=True, overwrite_a=True, check_finite=False)
    along = solve_triangular(factor, size * s, lower=True, check_finite=False)
    return float(0.5 * along @ along - np.sum(np.log(np.diag(factor))))


def _placed(base: Model, one: _TransientContact) -> tuple[Transient, ByTrial]:
    """Return the contact at the point of its segment that explains most, with its whitened unit columns, by
    Gauss-Newton steps of the point and the time course together. An error of a hand's length changes the moment by
    several newton metres.
    """
    effect, white, place = one.effect, one.white, np.zeros(3)
    for _ in range(_STEPS):
        wide = white.scaled(SIZES[-1])
        slopes = _slopes(base, effect, place, SIZES[-1] * _posterior_mean(base, wide, np.zeros(wide.width)))
        here = np.append(np.zeros(wide.width), place / _BESIDE)
        place = _BESIDE * _posterior_mean(base, wide.beside(_BESIDE * slopes), here)[-3:]
        there = effect.at_full_rate().beside(place)
        columns = local_basis(base.problem, there)
        if columns is not None:
            effect, white = there, base.white_by_trial(columns)
    return effect, white


def _posterior_mean(base: Model, Z: ByTrial, there: Array) -> Array:
    """Return the posterior mean (k,) of the coefficients of further columns ``Z`` with unit normal priors, linearised
    about ``there`` (k,): equal to `linear_posterior` with all columns, computed from the score alone.
    """
    s, G = Z.against(base.posterior.residual), Z.information(base.posterior)
    return np.asarray(solve(np.eye(len(s)) + G, s + G @ there, assume_a="pos"))


def _slopes(base: Model, effect: Transient, place: Array, course: Array) -> Array:
    """Return the whitened derivatives (r, 3) of a contact of ``course`` (k,) with respect to its ``place``, per metre
    and axis (the wrench is linear in it).
    """
    here, *there = (_touch(base, effect.beside(place + step), course) for step in np.eye(4, 3, -1))
    return base.white(np.stack([one - here for one in there], axis=1))


def _touch(base: Model, effect: Transient, course: Array) -> Array:
    """Return (r,): the rows of a contact with time course ``course`` (k,), split by trial."""
    samples, put = [], base.problem
    for case in put.cases:
        columns = effect.local(case)
        width = 0 if columns is None else columns.shape[2]
        samples.append(np.zeros((case.motion.time.size, 6, 1)) if columns is None else columns @ course[:width, None])
        course = course[width:]
    return put.padded(put.spectrum.rows(tuple(samples))[:, :, 0])


def _named(base: Model, effect: Transient, course: Array, sized: _TransientContact, steps: Array) -> NamedCause:
    """Return the cause with its ``course`` (k,) cut by trials; as its size, the force while it acts: half of the
    squares of its ``steps`` (n, p), as ``sized`` sees them, belong to larger ones (the largest of hundreds of values
    would be mostly noise).
    """
    count, parts, start = len(effect.parameters), {}, 0
    for case in base.problem.cases:
        columns = effect.local(case)
        width = 0 if columns is None else columns.shape[2]
        parts[case.trial.name] = course[start : start + width]
        start += width
    spread = sized.size**2 * np.diag(sized.found.covariance).reshape(-1, count)
    square = np.sum(steps**2, axis=1)
    order = np.argsort(square)
    k = int(order[np.searchsorted(np.cumsum(square[order]), 0.5 * square.sum())])
    return NamedCause(effect, steps[k], np.diag(spread[k]), parts)
