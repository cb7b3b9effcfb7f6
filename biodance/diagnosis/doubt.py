"""Which of the causes found are no names but only what the session resembles, and why."""

from biodance.diagnosis.consequence import matters
from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.naming import SURE
from biodance.diagnosis.reasons import Reason
from biodance.uncertainty.tolerances import Tolerances

NamedFinding = tuple[NamedCause, Finding]
"""A named cause with what is told of it."""


def only_resembled(causes: list[NamedFinding], named: tuple[NamedCause, ...], known: Tolerances) -> list[NamedFinding]:
    """Return those of the ``causes`` that are only resembled: at several targets among all ``named`` though believed
    only alone, of a size that is not constant or that may not matter; and every cause of less evidence than one of
    these, which explains what a wrong model of another cause left, and is no surer than that model.
    """
    doubted = [
        pair
        for pair in causes
        if is_one_of_several(pair[0], named) or pair[1].varies_with or may_not_matter(pair[0], known)
    ]
    return _with_less_evidence(doubted, causes)


def doubt_reasons(
    causes: list[NamedFinding], named: tuple[NamedCause, ...], known: Tolerances
) -> dict[Reason, tuple[str, ...]]:
    """Return why some of the ``causes`` are only resembled, each reason with their names."""
    found = {
        Reason.SEVERAL_CROSSTALKS: [one for cause, one in causes if is_one_of_several(cause, named)],
        Reason.SIZE_VARIES: [one for _, one in causes if one.varies_with],
        Reason.MAY_NOT_MATTER: [one for cause, one in causes if may_not_matter(cause, known)],
    }
    return {why: tuple(map(_name, some)) for why, some in found.items() if some}


def is_one_of_several(one: NamedCause, named: tuple[NamedCause, ...]) -> bool:
    """Return whether a cause that is believed only alone (`Effect.single`) was named at several targets."""
    return one.effect.single and sum(other.effect.name == one.effect.name for other in named) > 1


def may_not_matter(one: NamedCause, known: Tolerances) -> bool:
    """Return whether what is there may be less than what matters, if the model of the cause errs by `SURE` of its
    standard deviations: what is found is then (1 + SURE * model error) times what is there.
    """
    most = 1.0 + SURE * known.model_error(one.effect.name)
    return not matters(one.effect, one.effect.told_size(one.theta) / most)


def _name(one: Finding) -> str:
    return f"{one.effect.replace('_', ' ')} {one.target}".strip()


def _with_less_evidence(doubted: list[NamedFinding], causes: list[NamedFinding]) -> list[NamedFinding]:
    """Return the ``doubted`` causes with every one of less evidence than the strongest of them."""
    strongest = max((finding.log_bayes_factor for _, finding in doubted), default=float("-inf"))
    return [pair for pair in causes if pair in doubted or pair[1].log_bayes_factor < strongest]
