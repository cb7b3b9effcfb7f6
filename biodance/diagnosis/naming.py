"""Stepwise selection of causes: screen all, refine the best, remove the most probable one from the residual, rebuild
the columns that depend on it, and repeat.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, ndtr

from biodance.diagnosis.adequacy import CONFLICT_LIMIT, prior_data_conflict
from biodance.diagnosis.candidates import TOGETHER, Candidate, candidates
from biodance.diagnosis.consequence import least
from biodance.diagnosis.diagnosis import Alias
from biodance.diagnosis.joint_fit import log_bayes_factor_between, settle
from biodance.diagnosis.model import Model, NamedCause, is_much_heavier, model, needs_rebuilding, with_unlike_causes
from biodance.diagnosis.problem import Problem
from biodance.diagnosis.screening import ScoredCandidate, screen
from biodance.discovery import Chosen
from biodance.effects import Effect, effects
from biodance.uncertainty.tolerances import Tolerances, key_of

_ROUNDS = 3
"""Causes named at most."""
REFINED = 6
"""Causes of the screening that are fitted with all their curvature."""
SURE = 2.0
"""A name is taken back where its size is less than so many of its standard deviations; of several parameters
together, where chance brings them as far as often.
"""
SEEN, OVERWHELMING = 0.2, 3.0
"""Where less than this share of a cause is visible beside all that is no fault, its evidence must be so many times the
threshold: it rests on the sizes of tolerances. (A gain of Fz of 5 % is visible to 2 %: the rest looks like mass. The
declared mass still makes it 25 standard deviations.)
"""


@dataclass(frozen=True, eq=False)
class Round:
    """What one round found: the ``suspects``, most probable first; those of the first cannot be told from it are its
    ``set``.
    """

    suspects: tuple[ScoredCandidate, ...]

    @property
    def set(self) -> tuple[Alias, ...]:
        """The most probable cause and those that are nearly as probable, or would be if nobody had asked about so
        many targets.
        """
        best = self.suspects[0]
        near = [min(best.score - one.score, best.log_bayes_factor - one.log_bayes_factor) for one in self.suspects]
        return tuple(one.alias for one, far in zip(self.suspects, near, strict=True) if far <= TOGETHER)


@dataclass(frozen=True, eq=False)
class Naming:
    """All rounds: ``first`` the model before any was named, with the ``screening`` of ``first_causes``; ``found`` the
    last model, with the named causes; ``bare`` the same parameters without them; ``accepted`` a round per named cause,
    in their order.
    """

    first: Model
    found: Model
    accepted: tuple[Round, ...]
    screening: Round
    first_causes: tuple[Candidate, ...]
    bare: Model


def name_causes(
    problem: Problem,
    tolerances: Tolerances,
    chosen: Chosen[Effect] = None,
    *,
    rounds: int = _ROUNDS,
    every: tuple[Candidate, ...] | None = None,
) -> Naming:
    """Return the causes that the session shows, at most ``rounds``; ``chosen`` limits or extends the family
    (`effects`). ``every`` cause with its columns, where they are known (`causes_of`).

    What a body predicts that is unlike people is not believed: causes are then not predicted again.
    """
    first, first_causes = found, causes = build_model(problem, tolerances, chosen, every)
    ranking = screening = Round(screen(found, causes))
    accepted: list[Round] = []
    if rounds and passes_threshold(screening, tolerances) and is_much_heavier(found):
        found = replace(found, problem=found.problem.with_matter(found.phi))
        found, causes = rebuild_model(found, tolerances, chosen)
        ranking = Round(screen(found, causes))
    bare = found
    for _ in range(rounds):
        if not passes_threshold(ranking, tolerances):
            break
        ranking, settled = refine(found, ranking, tolerances)
        if not passes_threshold(ranking, tolerances):
            break
        accepted.append(ranking)
        again = needs_rebuilding(settled) and prior_data_conflict(settled) <= CONFLICT_LIMIT
        found, causes = rebuild_model(settled, settled.tolerances, chosen) if again else (settled, causes)
        ranking = Round(
            tuple(one for one in screen(found, causes) if one.names not in {cause_key(n) for n in found.named})
        )
    found, kept = drop_weak_causes(found, tuple(accepted))
    if len(kept) < len(accepted):
        found = settle(with_unlike_causes(found, tolerances), found.named)
    return Naming(first, found, kept, screening, first_causes, bare)


def drop_weak_causes(found: Model, accepted: tuple[Round, ...]) -> tuple[Model, tuple[Round, ...]]:
    """Return the model and the rounds with only the causes that remain significant beside one another: all sizes are
    fitted jointly, the weakest insignificant cause is dropped, and the rest is fitted again.
    """
    while found.named:
        found = settle(found, found.named)
        evidence_of = [log_bayes_factor_between(found, _without(found, i)) for i in range(len(found.named))]
        falls = [
            i
            for i, one in enumerate(accepted)
            if evidence_of[i] - _price(one) < required_evidence(found, one.suspects[0].visible)
            or not is_significant(found, found.named[i])
        ]
        if not falls:
            break
        gone = min(falls, key=lambda i: evidence_of[i])
        found = settle(found, (*found.named[:gone], *found.named[gone + 1 :]))
        accepted = (*accepted[:gone], *accepted[gone + 1 :])
    return found, accepted


def without_cause(naming: Naming, index: int) -> Naming:
    """Return the naming without cause ``index``, with all other sizes fitted again. Beside a transient contact, whose
    time course is part of the posterior, they keep their sizes.
    """
    gone, named = naming.found.named[index], naming.found.named
    rest = (*named[:index], *named[index + 1 :])
    accepted = (*naming.accepted[:index], *naming.accepted[index + 1 :])
    if any(one.course for one in rest):
        steady = tuple(one for one in rest if not one.course)
        return replace(naming, found=replace(naming.found.without_causes(steady), named=rest), accepted=accepted)
    base = naming.bare if gone.course or not rest else naming.found
    return replace(naming, found=settle(base, rest), accepted=accepted)


def required_evidence(found: Model, visible: float) -> float:
    """Return the evidence required to name a cause of which the share ``visible`` is identifiable."""
    return found.tolerances.threshold * (1.0 if visible >= SEEN else OVERWHELMING)


def is_significant(found: Model, one: NamedCause) -> bool:
    """Return whether a cause is possible in this session and its size differs from zero, over all its parameters
    jointly, at the level of `SURE` standard deviations; these are at least as large as the tolerance of the cause.
    """
    alike = found.tolerances.size(key_of(*cause_key(one))) * one.effect.typical / one.effect.typical[0]
    sd = np.maximum(np.sqrt(np.diag(one.covariance)), alike)
    sure = bool(np.sum((one.theta / sd) ** 2) >= chdtri(sd.size, 2 * ndtr(-SURE)))
    return sure and can_be_named(found, one)


def can_be_named(found: Model, one: NamedCause) -> bool:
    """Return whether a cause can be what its name says in this session: in the person and laboratory, and by the
    parameter that tells it from a simpler cause (`Effect.distinguished_by`), which is `SURE` standard deviations and
    matters.
    """
    told = [p.name == one.effect.distinguished_by for p in one.effect.parameters]
    sd, own = np.sqrt(np.diag(one.covariance)[told]), np.abs(one.theta[told])
    itself = np.all(own >= np.maximum(SURE * sd, least(one.effect).get(one.effect.distinguished_by, 0.0)))
    return bool(itself and one.effect.possible_in(found.problem.cases[0], one.theta))


def _without(found: Model, index: int) -> Model:
    """Return the model without one named cause; the others take up what they can."""
    return settle(found, (*found.named[:index], *found.named[index + 1 :]))


def _price(one: Round) -> float:
    """Return what the first of a round paid for its number of targets."""
    return one.suspects[0].log_bayes_factor - one.suspects[0].score


def passes_threshold(ranking: Round, tolerances: Tolerances) -> bool:
    """Return whether the most probable cause passes the threshold."""
    return bool(ranking.suspects) and ranking.suspects[0].score >= tolerances.threshold


def rebuild_model(found: Model, tolerances: Tolerances, chosen: Chosen[Effect]) -> tuple[Model, tuple[Candidate, ...]]:
    """Return the model and all causes with columns predicted from the posterior mean of ``found``, its named causes
    fitted again.

    For example, a load and a delay together show in the columns of the delay only once the load is predicted.
    """
    fresh, causes = build_model(found.problem.with_parameters(found.phi), tolerances, chosen)
    return settle(fresh, found.named), causes


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


def cause_key(one: NamedCause) -> tuple[str, str]:
    """Return effect and target of a named cause."""
    return one.effect.name, one.effect.target


def refine(found: Model, ranking: Round, known: Tolerances) -> tuple[Round, Model]:
    """Return the ranking with its first causes fitted with all their curvature, and the model with the most probable
    one named. Where none of them is possible, they hide nobody: the next ones are fitted.

    No cause is quite like its model: what the most probable one leaves of its wrench for that is noise beside the
    ``known`` tolerances, and no evidence for or against a look-alike, so all are fitted again under it. The others, of
    which no evidence under it is known and less than half as much without, are no look-alikes then.
    """
    near = _near(found, ranking)
    refined, rest = _fitted(found, near), _others(ranking, near)
    while not np.isfinite(refined[0][0].score) and passes_threshold(rest, found.tolerances):
        near = [*near, *_near(found, rest)]
        refined, rest = _fitted(found, near), _others(ranking, near)
    settled = with_unlike_causes(refined[0][1], known)
    if settled is not refined[0][1]:
        refined, rest = _fitted(settle(settled, found.named), near), Round(())
    return Round((*(one for one, _ in refined), *rest.suspects)), with_unlike_causes(refined[0][1], known)


def _others(ranking: Round, tried: list[ScoredCandidate]) -> Round:
    """Return the ranking without the causes ``tried``."""
    names = {one.names for one in tried}
    return Round(tuple(one for one in ranking.suspects if one.names not in names))


def _fitted(found: Model, some: list[ScoredCandidate]) -> list[tuple[ScoredCandidate, Model]]:
    """Return the causes as `_refined`, most probable first."""
    return sorted((_refined(found, one) for one in some), key=lambda pair: -pair[0].score)


def _refined(found: Model, one: ScoredCandidate) -> tuple[ScoredCandidate, Model]:
    """Return a cause with its evidence where it is most probable, none where it is not possible there, and the model
    with it named.
    """
    settled = settle(found, (*found.named, NamedCause(one.effect, one.start, np.empty((0, 0)))))
    possible = can_be_named(found, settled.named[-1])
    bayes = log_bayes_factor_between(settled, found) if possible else -np.inf
    return replace(one, log_bayes_factor=bayes, score=bayes + one.score - one.log_bayes_factor), settled


def _near(found: Model, ranking: Round) -> list[ScoredCandidate]:
    """Return the causes worth fitting: the first ones of the screening, as far as it suspects them. Far from proportion
    one finds in noise what nobody suspected: cameras of 0.3 mm look like a filter of 6 Hz.
    """
    least = max(ranking.suspects[0].score * 0.5, found.tolerances.threshold)
    return [one for one in ranking.suspects[:REFINED] if one.score >= least]
