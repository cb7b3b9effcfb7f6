"""What a session ends with: the posterior and what matters, decided once.

A cause is named where it, or a look-alike in its place, is there with at least the probability `NAMED`, and what it
does matters to a laboratory (`consequence`). Nothing is wrong where it is more probable than not that nothing is there
that matters (`well`); between the two nobody can tell. The set of a cause holds 95 % of the posterior of its place, and
whatever the data cannot tell from it, however rare it is. Its size is averaged over all sets of causes that hold it
without a look-alike. No delay is named that Newton contradicts, and no fault of a plate from one step on it: nobody can
then tell what is wrong.
"""

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from biodance.diagnosis.candidates import IN_SET, TOGETHER, changes
from biodance.diagnosis.consequence import NAMED, SUGGESTED, Adequacy, matters
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.witness_evidence import CONTACTS
from biodance.effects import ChannelEffect, InstalledPlate, MissingJoint, NamedCause, unit_at
from biodance.effects.added_mass import AddedMass
from biodance.effects.body_mass import BodyMass
from biodance.effects.time_delay import TimeDelay
from biodance.effects.toe_landmark import ToeLandmark
from biodance.inference.hypotheses import UNKNOWN, Hypothesis, Key, Posterior
from biodance.inference.rows import BODY, SOFT, Rows
from biodance.inference.scales import prior_sd
from biodance.inference.sets import Search, hypothesis
from biodance.inference.unknown import adequacy
from biodance.observations import LANDMARK, shift_per_sd
from biodance.observations.newton import Newton
from biodance.records import SIDES, Array
from biodance.uncertainty.tolerances import key_of

_COUNTED = 1e-4
"""Probability below which it is not asked whether the causes of a set are large."""
_FAR = 3.0
"""Standard deviations of the logarithm of a scale beyond which body or soft tissue are unlike people."""
_HABIT = 0.010
"""m: a marker beside the second ray, or a heel marker on a thick sole, is as anywhere."""

UNPLACED_LOAD = (AddedMass.name, "")
"""Effect and target of a load of which only the weight is known."""


@dataclass(frozen=True, eq=False)
class Place:
    """One cause of the most probable set and what may stand in its place: ``cause`` with its size averaged over all
    sets without its look-alikes; ``probability`` that any of them is there; ``shares`` of them, most probable first,
    with the log Bayes factor of each against none.
    """

    cause: NamedCause
    probability: float
    shares: tuple[tuple[Key, float, float], ...]

    @property
    def names(self) -> frozenset[Key]:
        """All that may stand in its place."""
        return frozenset(name for name, *_ in self.shares)

    @property
    def set(self) -> tuple[Alias, ...]:
        """The cause, then all that the data cannot tell from it (`TOGETHER`), and what else it takes to hold `IN_SET`
        of the posterior.
        """
        kept, sum_, own = [], 0.0, next(b for name, _, b in self.shares if name == self.cause.names)
        for name, share, bayes in self.shares:
            if sum_ < IN_SET or bayes >= own - TOGETHER:
                kept.append(Alias(*name, bayes))
            sum_ += share
        return tuple(sorted(kept, key=lambda alias: (alias.effect, alias.target) != self.cause.names))


@dataclass(frozen=True, eq=False)
class Inferred:
    """A diagnosis with the posterior that it was decided from: ``named`` the causes of its findings, in their order;
    ``bare`` the diagnosis before any judgement of causes; ``idle`` the causes that are there, and mending them helps
    nothing.
    """

    diagnosis: Diagnosis
    search: Search
    posterior: Posterior
    bare: Diagnosis
    named: tuple[NamedCause, ...] = ()
    idle: frozenset[Key] = frozenset()

    @property
    def best(self) -> Hypothesis:
        """The most probable set of causes."""
        return self.posterior.best

    @property
    def phi(self) -> Array:
        """(10N,) most probable parameters of the body beside the named causes."""
        return hypothesis(self.search, self.named).phi if self.named else self.posterior.best.phi

    def without(self, index: int) -> "Inferred":
        """Return the session without finding ``index``, the other sizes fitted again."""
        rest = (*self.named[:index], *self.named[index + 1 :])
        findings, gone = self.diagnosis.findings, self.diagnosis.findings[index]
        told = replace(
            self.diagnosis,
            findings=(*findings[:index], *findings[index + 1 :]),
            resembles=(*self.diagnosis.resembles, gone),
        )
        fitted = hypothesis(self.search, tuple(one for one in rest if not one.course)).causes if rest else ()
        return replace(self, diagnosis=told, named=(*fitted, *(one for one in rest if one.course)))

    def refuted(self, index: int) -> "Inferred":
        """Return what the session ends with where accepting finding ``index`` makes data worse that were not used: the
        cause is not there, and another may stand in its place; where none does, nobody can tell.

        A missing joint that markers show is there, but what it does to the forces is known to a half (`Effect.unlike`):
        the simulation is better off without it, as it is without the small one that everybody has.
        """
        gone, bare = self.diagnosis.findings[index], replace(self.bare, notes=self.diagnosis.notes)
        if isinstance(self.named[index].effect, MissingJoint):
            return decide(self.search, self.posterior, bare, self.idle | {(gone.effect, gone.target)})
        bare = replace(bare, resembles=(*bare.resembles, gone))
        found = decide(self.search, self.posterior.lacking((gone.effect, gone.target)), bare, self.idle)
        told = found.diagnosis
        if not found.named:
            told = replace(told, explained=False, why={**self.diagnosis.why, **told.why, Reason.CONTRADICTED: ()})
        if self.search.rows.problem is None:  # what a body leaves of the forces was not judged with the causes
            told = replace(told, adequacy=self.diagnosis.adequacy, p_unknown=self.diagnosis.p_unknown)
        return replace(found, diagnosis=told)

    def known_tolerances(self) -> tuple[Finding, ...]:
        """Return what is no fault and yet known and matters: every tolerance of one size that is not named, whose
        posterior mean lies two standard deviations from none; surer than careful laboratories are alike, and than
        faults are like their models, is none.
        """
        best, out = self.best, []
        named = {(one.effect, one.target) for one in self.diagnosis.findings}
        for one in self.search.causes:
            where, unit = best.rows.tolerated.get(one.names, (slice(0), np.zeros((1, 0))))
            if len(unit) != 1 or not unit.size or one.names in named:
                continue
            # Coefficients are in nominal standard deviations; unit[0] turns them into the first (only) parameter.
            (parameter,), value = one.effect.parameters, float(unit[0] @ best.coefficients[where])
            sd = np.hypot(max(best.variance(where, unit[0]) ** 0.5, parameter.alike), one.effect.size_error * value)
            size = Estimate(parameter.name, value, float(sd), unit_at(parameter.unit, one.effect.target))
            if size.known and matters(one.effect, np.array([value])):
                out.append(Finding(*one.names, (size,), (), 1.0, kind=one.effect))
        return tuple(out)


def places(posterior: Posterior, prior: Mapping[Key, float]) -> tuple[Place, ...]:
    """Return the causes of the largest of the most probable sets of three, two and one that is sure as a whole, each
    with what may stand in its place, as probable as with and without an unknown cause; then what else the most probable
    set holds, as probable as it is beside them.

    Beside the others a cause may be sure, and yet all of them together no better than none, or than another one alone.
    """
    lead, best = posterior.lead, posterior.best
    every: list[tuple[Place, ...]] = []
    while best.causes:
        every.append(tuple(_place(lead, best, cause, prior) for cause in best.causes))
        if posterior.share(*(one.names for one in every[-1])) >= NAMED:
            break
        fewer = [one for one in lead.hypotheses if len(one.causes) == len(best.causes) - 1]
        best = max(fewer, key=lambda one: np.logaddexp(one.log_posterior, one.log_unknown))
    sure, rest = (every[-1] if best.causes else ()), list(every[0] if every else ())
    # Without the causes of `sure`: each takes the place of `every[0]` in which its own cause is most probable.
    for one in sure:
        rest.remove(max(rest, key=partial(_share_in, one.cause.names)))
    held = [one.names for one in sure]
    return (
        *(replace(one, probability=min(one.probability, posterior.share(one.names))) for one in sure),
        *(replace(one, probability=min(one.probability, posterior.share(*held, one.names))) for one in rest),
    )


def _share_in(name: Key, place: Place) -> float:
    """Return how probable a cause is in a place."""
    return next((share for key, share, _ in place.shares if key == name), 0.0)


def _place(posterior: Posterior, best: Hypothesis, cause: NamedCause, prior: Mapping[Key, float]) -> Place:
    """Return one cause of a set, with what may stand in its place beside the others."""
    total = {one.names: float(np.logaddexp(one.log_posterior, one.log_unknown)) for one in posterior.hypotheses}
    rest, wide = best.names - {cause.names}, len(best.names)
    # Sets that differ from the best in this one cause only: rest and one more.
    here = {next(iter(names - rest)): v for names, v in total.items() if len(names) == wide and rest < names}
    none, some = total.get(rest, -np.inf), float(logsumexp(list(here.values())))
    # Set minus rest minus its prior log odds leaves the log Bayes factor of that cause beside the rest.
    shares = [(name, float(np.exp(v - some)), v - none - prior.get(name, 0.0)) for name, v in here.items()]
    place = Place(cause, float(1 / (1 + np.exp(none - some))), tuple(sorted(shares, key=lambda one: -one[1])))
    alike = {(alias.effect, alias.target) for alias in place.set[1:]}
    return replace(place, cause=_averaged(posterior, cause, alike))


def _averaged(posterior: Posterior, cause: NamedCause, alike: Set[Key]) -> NamedCause:
    """Return a cause with mean and covariance of its size over all hypotheses that hold it, and none of what looks
    ``alike``: of two that share one effect each has the smaller part.
    """
    if cause.course:
        return cause
    found = [
        (weight, one.whole(own), one.whole_covariance(own))
        for one, weight in zip(posterior.hypotheses, posterior.weights.sum(axis=1), strict=True)
        for own in one.causes
        if own.names == cause.names and weight > 0 and alike.isdisjoint(one.names)
    ]
    weight = np.array([one[0] for one in found])
    weight /= weight.sum()
    size = np.array([one[1] for one in found])
    mean = weight @ size
    # Law of total variance: mean of the covariances plus covariance of the means over the hypotheses.
    spread = np.einsum("h,hi,hj->ij", weight, size - mean, size - mean)
    return replace(cause, theta=mean, covariance=np.einsum("h,hij->ij", weight, [one[2] for one in found]) + spread)


_Told = tuple[Place, Finding]


def decide(search: Search, posterior: Posterior, bare: Diagnosis, idle: frozenset[Key] = frozenset()) -> Inferred:
    """Return what a session ends with; ``bare`` its diagnosis before any judgement of causes, ``idle`` causes that are
    no fault although they are there.
    """
    rows, best = search.rows, posterior.best
    every = places(posterior, search.prior)
    likely = [(place, _finding(place, rows, best)) for place in every if place.probability >= SUGGESTED]
    large = [one for one in likely if one[0].cause.names not in idle and _is_large(rows, one[0].cause)]
    sure = [one for one in large if one[0].probability >= NAMED]
    named = [one for one in sure if not _is_forbidden(rows, one[0].cause)]
    resembled = [one for one in large if one not in named]
    left = adequacy(posterior.unexplained, rows)
    p_clean, reasons = _ends(posterior, rows, left, idle, sure=bool(sure), forbidden=len(named) < len(sure))
    findings = _with_look_alikes(named, best, rows)
    told = replace(
        bare,
        explained=not any((*reasons.values(), named and resembled)),
        why={**bare.why, **_why(posterior, rows, reasons, named=bool(named))},
        findings=(*findings, *_habit(best, rows, findings)),
        resembles=(*bare.resembles, *(finding for _, finding in resembled)),
        tolerated=tuple(one[1] for one in likely if one not in large),
        adequacy=left,
        candidates=tuple(Alias(s.effect.name, s.effect.target, s.gain) for s in posterior.screened),
        p_clean=p_clean,
        p_unknown=posterior.unknown,
    )
    return Inferred(told, search, posterior, bare, tuple(place.cause for place, _ in named), idle)


def _ends(
    posterior: Posterior,
    rows: Rows,
    left: tuple[Adequacy, ...],
    idle: frozenset[Key],
    *,
    sure: bool,
    forbidden: bool,
) -> tuple[float, dict[Reason, bool]]:
    """Return the probability that nothing is there that matters, and which reasons hold to say no more; ``left`` what
    is left of the forces, whether any cause is ``sure``, and one of them ``forbidden``.
    """
    left_matters = any(row.matters for row in left)
    p_clean, unknown = (
        well(rows, posterior, idle, unknown_matters=left_matters),
        posterior.unknown >= UNKNOWN and left_matters,
    )
    return p_clean, {
        Reason.FORCES_LEFT: unknown,
        Reason.CONTRADICTED: forbidden,
        Reason.NOT_SURE: p_clean < SUGGESTED and not (sure or unknown),
    }


def _with_look_alikes(named: list[_Told], best: Hypothesis, rows: Rows) -> tuple[Finding, ...]:
    """Return the findings, with what is no cause of the simulation and looks like them in their sets."""
    return tuple(
        replace(finding, set=(*finding.set, *_habit_alias(place, best, rows), *_load_alias(place, rows)))
        for place, finding in named
    )


def _why(
    posterior: Posterior, rows: Rows, reasons: Mapping[Reason, bool], *, named: bool
) -> dict[Reason, tuple[str, ...]]:
    """Return why no more is said: what is strange where anything is ``named`` or left, and those of ``reasons`` that
    hold.
    """
    found = dict.fromkeys(_strange(posterior.unexplained, rows) if reasons[Reason.FORCES_LEFT] or named else (), ())
    return {**found, **{reason: () for reason, holds in reasons.items() if holds}}


def well(rows: Rows, posterior: Posterior, idle: frozenset[Key] = frozenset(), *, unknown_matters: bool) -> float:
    """Return the probability that nothing is there that matters: of all sets none of whose causes is large, without an
    unknown cause, or beside one where what is left is too small to matter.
    """
    own = float(posterior.weights[_without_large(rows, posterior, idle), 0].sum())
    if unknown_matters:
        return own
    if posterior.louder is None:
        return own + float(posterior.weights[_without_large(rows, posterior, idle), 1].sum())
    loud = posterior.louder
    # The sets of the louder posterior already know of the unknown: they share its probability.
    return own + posterior.unknown * float(loud.weights[_without_large(rows, loud, idle)].sum())


def _without_large(rows: Rows, posterior: Posterior, idle: frozenset[Key]) -> NDArray[np.bool_]:
    """Return (H,) which sets hold no cause that is large; of those too improbable to count, none."""
    return np.array(
        [
            weight > _COUNTED and not any(cause.names not in idle and _is_large(rows, cause) for cause in one.causes)
            for one, weight in zip(posterior.hypotheses, posterior.weights.sum(axis=1), strict=True)
        ]
    )


def _is_forbidden(rows: Rows, one: NamedCause) -> bool:
    """Return whether a law forbids to name a cause, however probable it is."""
    return _is_contradicted(rows, one) or _is_of_one_step(rows, one)


def _is_large(rows: Rows, one: NamedCause) -> bool:
    """Return whether a cause is large enough to be told: it matters by all rows and by the size that is told, is larger
    than laboratories have without calling it a fault (by a standard deviation), and what it changes in this session's
    wrench matters.
    """
    if not all(matters(one.effect, size) for size in (one.theta, _told_size(rows, one))):
        return False
    if one.course:
        return True
    if not _is_unusual(one):
        return False
    if rows.problem is None:
        return True
    felt = rows.problem.felt(changes(rows.problem, one.effect, one.theta)[:, None])[0]
    return bool(felt >= 1.0 or (rows.observed(one.effect) != 0).any())


def _is_unusual(one: NamedCause) -> bool:
    """Return whether a cause is larger, by a standard deviation, than laboratories have without calling it a fault: the
    parameters of which something is usual, as a vector, in units of what is usual in each: sqrt(n) for all n.
    """
    usual = one.effect.usual
    own = np.flatnonzero(usual)
    if not own.size:
        return True
    size = one.theta[own] / usual[own]
    length = float(np.linalg.norm(size))
    # Standard deviation of a vector's length: of the vector along its own direction.
    way = np.zeros(usual.size)
    way[own] = size / usual[own] / max(length, 1e-300)
    return length > own.size**0.5 + float(way @ one.covariance @ way) ** 0.5


def _is_contradicted(rows: Rows, one: NamedCause) -> bool:
    """Return whether a cause is a delay, and the total force goes with the trunk at an instant that is nearer to none
    than to it: feet are few and short, the force of all plates lasts as long as the trial.
    """
    seen = rows.evidence.observations if rows.evidence else ()
    lags = [o for o in seen if (o.observer, o.unit) == (Newton.name, "s")]
    if not isinstance(one.effect, TimeDelay) or not lags:
        return False
    # Mean with inverse variances as weights.
    share = np.array([o.sd**-2 for o in lags])
    lag = float(share @ [o.value for o in lags] / share.sum())
    return abs(lag) < abs(lag - one.theta[0])


def _is_of_one_step(rows: Rows, one: NamedCause) -> bool:
    """Return whether a cause is a plate's, and people walk over that plate once: one step errs as a whole, by what
    nobody foresees, and cannot be told from the plate.
    """
    if rows.evidence is None or not isinstance(one.effect, ChannelEffect | InstalledPlate):
        return False
    steps = [o for o in rows.evidence.observations if o.plate and o.contact[1]]
    plate = one.effect.target.partition(":")[0]
    own = {o.contact for o in steps if o.plate == plate or plate not in {p.plate for p in steps}}
    exact = rows.evidence.contacts(one.names) if one.names in rows.evidence.causes else 0
    return len(own) == 1 and exact < CONTACTS


def _finding(place: Place, rows: Rows, best: Hypothesis) -> Finding:
    """Return a cause as a finding; no size is surer than sessions without fault are alike, nor than faults are like
    their models.
    """
    one, known = place.cause, rows.tolerances
    theta, covariance = _told_size(rows, one), one.covariance
    # `alike` is learned for the first parameter: the others in proportion to their typical sizes.
    alike = known.size(key_of(one.effect.name, one.effect.target)) * one.effect.typical / one.effect.typical[0]
    units = np.array([parameter.unit for parameter in one.effect.parameters])
    # Parameters of one unit are components of one vector: its length, not each component, scales `size_error`.
    length = np.array([np.linalg.norm(theta[units == unit]) for unit in units])
    sd = np.hypot(np.maximum(np.sqrt(np.diag(covariance)), alike), one.effect.size_error * length)
    if rows.problem is None:
        reported = tuple(
            (p.name, float(t), float(s), p.unit) for p, t, s in zip(one.effect.parameters, theta, sd, strict=True)
        )
    else:
        reported = one.effect.reported(rows.problem.cases[0], theta, sd)
    sizes = tuple(Estimate(name, size, own, unit_at(unit, one.effect.target)) for name, size, own, unit in reported)
    return Finding(
        one.effect.name,
        one.effect.target,
        sizes,
        place.set,
        _visible(one, rows, best),
        advice=one.effect.advice,
        probability=place.probability,
        kind=one.effect,
    )


def _told_size(rows: Rows, one: NamedCause) -> Array:
    """Return the size (p,) of a cause that is told: where markers show it by themselves, that."""
    return one.theta if rows.problem is None or one.course else one.effect.measured(one.theta, *rows.problem.cases)


def _visible(one: NamedCause, rows: Rows, best: Hypothesis) -> float:
    """Return the share of a cause that is left when all that is no fault may adapt."""
    if one.course or not one.covariance.size:
        return 1.0
    slope = rows.slopes(one.effect, one.theta)[:, 0].copy()
    slope[: rows.plates] *= np.exp(-best.fit.scales.noise)
    # Information on the size: posterior minus that of the slab, N(0, (3 typical)^2).
    known = 1 / max(one.covariance[0, 0], 1e-300) - 1 / (3 * one.effect.typical[0]) ** 2
    # Over slope' slope, the information if all else were known: about 1 - R^2 of the slope on the other columns.
    return float(np.sqrt(np.clip(known / max(float(slope @ slope), 1e-300), 0.0, 1.0)))


def _strange(best: Hypothesis, rows: Rows) -> tuple[Reason, ...]:
    """Return what had to be unlike people or laboratories for the rest to fit."""
    far = dict(zip(rows.groups, best.fit.scales.groups / prior_sd(rows), strict=True))
    body = far.get(BODY, 0.0) > _FAR
    soft = any(far.get(name, 0.0) > _FAR for name in SOFT)
    other = any(value > _FAR for name, value in far.items() if name != BODY and name not in SOFT)
    strange = {Reason.UNUSUAL_BODY: body, Reason.OUTSIDE_TOLERANCES: soft or other}
    return tuple(reason for reason, holds in strange.items() if holds)


def _landmarks(best: Hypothesis, rows: Rows) -> dict[str, tuple[float, float]]:
    """Return by shared error how far (m) the markers of both feet lie beside where they are expected, with its standard
    deviation.
    """
    if rows.evidence is None:
        return {}
    # Shared errors are the last of `columns.X`, in the order of `norms` (group -1: never turned).
    first = best.columns.X.shape[1] - len(rows.evidence.norms)
    found = {}
    for k, name in enumerate(rows.evidence.norms):
        if LANDMARK in name:
            at, per = first + k, shift_per_sd(name)
            unit = np.zeros(len(best.fit.u))
            unit[at] = best.fit.size[at]
            sd = float(np.sqrt(max(best.fit.variance(unit), 0.0)))
            found[name] = per * float(best.fit.coefficients[at]), per * sd
    return found


def _habit(best: Hypothesis, rows: Rows, findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return how far the markers of both feet lie beside where they are expected, where that is clearly shown: a habit
    of the laboratory.
    """
    shown = {name: (v, sd) for name, (v, sd) in _landmarks(best, rows).items() if abs(v) > max(_HABIT + sd, 2 * sd)}
    contacts = {
        one.contact
        for one in (rows.evidence.observations if rows.evidence else ())
        if any(LANDMARK in n for n in one.norms)
    }
    if not shown or len(contacts) < CONTACTS or any(a.effect == ToeLandmark.name for f in findings for a in f.set):
        return ()
    sizes = tuple(
        Estimate("backwards" if name.endswith("along") else "inwards", v, sd, "m") for name, (v, sd) in shown.items()
    )
    own = Alias(ToeLandmark.name, _feet(rows), float("inf"))
    return (Finding(own.effect, own.target, sizes, (own,), 1.0, advice=ToeLandmark.advice),)


def _habit_alias(place: Place, best: Hypothesis, rows: Rows) -> tuple[Alias, ...]:
    """Return the feet's markers as a look-alike of a cause that stands on feet alone and is less sure than `IN_SET`."""
    if place.probability >= IN_SET or rows.problem is not None or rows.evidence is None:
        return ()
    feet = np.array([any(LANDMARK in name for name in one.norms) for one in rows.evidence.observations])
    seen = rows.observed(place.cause.effect).any(axis=1)
    return (Alias(ToeLandmark.name, _feet(rows), 0.0),) if (feet & seen).any() else ()


def _load_alias(place: Place, rows: Rows) -> tuple[Alias, ...]:
    """Return a load on some segment as a look-alike of a body heavier than declared, where only its weight is seen."""
    heavier = isinstance(place.cause.effect, BodyMass) and place.cause.theta[0] > 0
    return (Alias(*UNPLACED_LOAD, place.shares[0][2]),) if heavier and rows.problem is None else ()


def _feet(rows: Rows) -> str:
    """Return the side of the only foot seen on plates, or both."""
    names = rows.evidence.norms if rows.evidence else ()
    seen = [side for side in SIDES if any(name.startswith(f"person {side} ") for name in names)]
    return seen[0] if len(seen) == 1 else "both"
