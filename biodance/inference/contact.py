"""Contacts that come and go, such as a touch of a rail or a helping hand: one more kind of cause, with a course of its
own in every trial, sought where the steady causes leave an unknown one.

Three of the six channels remain unconstrained by a force at one point, so that it cannot explain everything. A touch
keeps to one side of its main direction, and takes hold and lets go quickly: what swells and creeps back is none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve

from biodance.diagnosis.candidates import local_basis
from biodance.effects import Case, NamedCause, Transient
from biodance.inference.hypotheses import Hypothesis
from biodance.inference.rows import Rows
from biodance.inference.scales import fit, posterior, prior_sd, products
from biodance.inference.sets import Search, at_scales, unlike_models
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
class _Touch:
    """One contact: whitened unit columns ``Z`` (r, k), ``score``, ``information``, and its most probable ``size``."""

    effect: Transient
    Z: Array
    score: Array
    information: Array
    size: float
    log_bayes_factor: float

    @property
    def spread(self) -> Array:
        """(k, k) posterior covariance of the course, per unit of its size."""
        # Unit-normal coefficients b of the columns size * Z: posterior covariance (1 + size^2 G)^-1.
        return np.asarray(np.linalg.inv(np.eye(len(self.score)) + self.size**2 * self.information))

    @property
    def course(self) -> Array:
        """(k,) posterior mean of the course."""
        # Course = size * b and score of the scaled columns = size * s: hence size twice.
        return np.asarray(self.size**2 * self.spread @ self.score)


def with_contacts(search: Search, base: Hypothesis, kinds: Sequence[Transient]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses that add a contact to ``base``: of each of the ``kinds`` that is touched as hands and feet
    touch, the most probable one with its course.
    """
    found = [one for kind in kinds if (one := _touch_of(search, base, kind)) is not None]
    likely = sorted(found, key=lambda one: -one.log_bayes_factor)
    best = next((one for one in likely[:2] if _is_touch(search.rows, one)), None)
    if best is None or best.log_bayes_factor <= 0:
        return ()
    loud = _named(search, base, best, len(kinds))
    quiet = at_scales(search, base, loud.fit.scales)  # beside the contact the session is not as loud as without
    again = _touch_of(search, quiet, best.effect)
    return (
        (loud,) if again is None or not _is_touch(search.rows, again) else (_named(search, quiet, again, len(kinds)),)
    )


def _columns(rows: Rows, effect: Transient) -> Array | None:
    """Return the whitened columns (r, k) of a contact; None where it does not come and go."""
    assert rows.problem is not None
    own = local_basis(rows.problem, effect)
    if own is None:
        return None
    simulated = np.zeros((rows.simulated, own.shape[1]))
    simulated[: len(own)] = own
    # A contact acts on the plates only: it adds nothing to markers and observations.
    return np.concatenate([rows.white(simulated), np.zeros((len(rows.y) - rows.simulated, own.shape[1]))])


def _touch_of(search: Search, base: Hypothesis, effect: Transient) -> _Touch | None:
    """Return a contact with its most probable size."""
    Z = _columns(search.rows, effect)
    if Z is None:
        return None
    s, G = search.score(base, Z)

    def bayes(size: float) -> float:
        inner = np.eye(len(s)) + size**2 * G
        # Integral over b ~ N(0, 1): log BF = 1/2 size^2 s'(1 + size^2 G)^-1 s - 1/2 log|1 + size^2 G|.
        return float(0.5 * size**2 * s @ solve(inner, s, assume_a="pos") - 0.5 * np.linalg.slogdet(inner)[1])

    value, size = max((bayes(size), size) for size in SIZES)
    return _Touch(effect, Z, s, G, size, value)


def _is_touch(rows: Rows, one: _Touch) -> bool:
    """Return whether a contact's course is that of something touched: on one side of zero or, as the plate's zero and
    the body's weight take the mean of a trial from a foot, of where it lies most of the time in its trial, if it is
    quick.
    """
    # Coefficients lie instant by instant, the parameters of one instant together.
    count = len(one.effect.parameters)
    if one_sided(one.course.reshape(-1, count)):
        return True
    by_trial = [part.reshape(-1, count) for part in _by_trial(rows, one.effect, one.course).values()]
    beside = [part - np.median(part, axis=0) for part in by_trial]
    inner = [part[_END:-_END] for part in beside]  # nobody judges the ends of a trial: there the course is open
    return one_sided(np.concatenate(inner)) and quick(inner)


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
    # The first right singular vector: the direction that holds most of the squares, without mean removed.
    _, _, directions = np.linalg.svd(course, full_matrices=False)
    along = course @ directions[0]
    sides = np.sum(np.maximum(along, 0) ** 2), np.sum(np.minimum(along, 0) ** 2)
    return bool(min(sides) <= OTHER_SIDE * sum(sides))


def _named(search: Search, base: Hypothesis, one: _Touch, kinds: int) -> Hypothesis:
    """Return the hypothesis with the contact where its segment explains most; its size is the force while it acts."""
    rows, effect, Z = search.rows, *_placed(search, base, one)
    own = np.concatenate([base.Z, one.size * Z], axis=1)
    columns, sd, sure, touched = search.columns, prior_sd(rows), base.sure, base
    for _ in range(_STEPS):
        found = fit(products(columns, own, base.y, sure), sd, touched.fit.scales, least=search.least)
        # No cause of its own here: the touch and the causes of `base` are both in the columns Z.
        touched = Hypothesis((), columns, found, -np.inf, own, base.y, sure)
        added = one.size * Z @ found.last(Z.shape[1])[0]
        sure = base.sure * unlike_models(touched, (one.effect,), (added,))
    wide = np.concatenate([base.Z, SIZES[-1] * Z], axis=1)  # the most probable size would shrink short peaks
    # Under the same scales, with the widest prior of the course.
    open_ = posterior(products(columns, wide, base.y, touched.sure), sd, found.scales)
    course, count = SIZES[-1] * open_.last(Z.shape[1])[0], len(effect.parameters)
    values = course.reshape(-1, count)
    square = np.sum(values**2, axis=1)
    order = np.argsort(square)
    # Ascending squares: the first value at which those up to it hold half of the sum.
    k = int(order[np.searchsorted(np.cumsum(square[order]), 0.5 * square.sum())])
    spread = SIZES[-1] ** 2 * np.diag(open_.last(Z.shape[1])[1]).reshape(-1, count)[k]
    touch = NamedCause(effect, values[k], np.diag(spread), _by_trial(rows, effect, course))
    # One size of three is taken as the best: the prior is shared by the kinds and by the sizes.
    prior = effect.prior / kinds / len(SIZES)
    # log_posterior = log_evidence + log_sure + prior; what is left is the prior and `base.log_sure`, taken off below.
    before = base.log_posterior - base.fit.log_evidence  # prior of the causes beside it
    value = found.log_evidence + touched.log_sure - base.log_sure + before + float(np.log(prior / (1 - prior)))
    causes = (*(c for c in base.causes if c.names != touch.names), touch)
    return replace(touched, causes=causes, log_posterior=value)


def _in_trials(rows: Rows, effect: Transient) -> Iterator[tuple[Case, Array]]:
    """Yield every trial with the columns (T, 6, k) of a contact that comes and goes in it (`_columns`)."""
    for case in rows.problem.cases if rows.problem else ():
        columns = effect.local(case)
        assert columns is not None
        yield case, columns


def _by_trial(rows: Rows, effect: Transient, course: Array) -> dict[str, Array]:
    """Return the ``course`` (k,) cut by trials."""
    trials = list(_in_trials(rows, effect))
    ends = np.cumsum([columns.shape[2] for _, columns in trials])
    return {case.trial.name: part for (case, _), part in zip(trials, np.split(course, ends[:-1]), strict=True)}


def _placed(search: Search, base: Hypothesis, one: _Touch) -> tuple[Transient, Array]:
    """Return the contact where its segment explains most, by Gauss-Newton of point and course, with its columns."""
    effect, Z, place, wide = one.effect, one.Z, np.zeros(3), SIZES[-1]
    for _ in range(_STEPS):
        course = wide * _mean(search, base, wide * Z, np.zeros(Z.shape[1]))
        # The product Z(place) course is bilinear: beside the columns of the course, its slope by the place.
        both = np.concatenate([wide * Z, _BESIDE * _slopes(search.rows, effect, place, course)], axis=1)
        # Linearised about the present place, with prior N(0, _BESIDE^2) about the far end: target y + slope * place.
        place = _BESIDE * _mean(search, base, both, np.append(np.zeros(Z.shape[1]), place / _BESIDE))[-3:]
        there = effect.at_full_rate().beside(place)
        columns = _columns(search.rows, there)
        if columns is not None:
            effect, Z = there, columns
    return effect, Z


def _mean(search: Search, base: Hypothesis, Z: Array, there: Array) -> Array:
    """Return the posterior mean (k,) of unit-normal coefficients of ``Z``, linearised about ``there`` (k,)."""
    s, G = search.score(base, Z)
    # Target moved by Z there: its score is s + G there, while the prior stays centred at zero.
    return np.asarray(solve(np.eye(len(s)) + G, s + G @ there, assume_a="pos"))


def _slopes(rows: Rows, effect: Transient, place: Array, course: Array) -> Array:
    """Return the whitened derivatives (r, 3) of a contact of ``course`` (k,) by its ``place``."""
    # np.eye(4, 3, -1): no step, then 1 m along each axis; a difference is the exact slope of a linear function.
    here, *there = (_felt(rows, effect.beside(place + step), course) for step in np.eye(4, 3, -1))
    simulated = rows.white(np.stack([one - here for one in there], axis=1))
    return np.concatenate([simulated, np.zeros((len(rows.y) - rows.simulated, 3))])


def _felt(rows: Rows, effect: Transient, course: Array) -> Array:
    """Return (r,): the rows of a contact with time course ``course`` (k,), split by trial."""
    assert rows.problem is not None
    samples = []
    for _, columns in _in_trials(rows, effect):
        samples.append(columns @ course[: columns.shape[2], None])
        course = course[columns.shape[2] :]
    return rows.problem.padded(rows.problem.spectrum.rows(tuple(samples))[:, :, 0])
