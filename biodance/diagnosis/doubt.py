"""Which of the causes found are no names but only what the session resembles, and what is said of them."""

from biodance.diagnosis.consequence import matters
from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.naming import SURE
from biodance.uncertainty.tolerances import Tolerances

NamedFinding = tuple[NamedCause, Finding]
"""A named cause with what is told of it."""

SEVERAL_CROSSTALKS = (
    "Several channels would have to disturb each other at once. That is what a plate looks like that lies or is turned "
    "otherwise than the file says, or whose matrix is another one: none of these cross-talks is named."
)
UNUSUAL_BODY = (
    "What the plates measured fits only a body that is more unlike the table than people are: the person may be, a "
    "joint may lie elsewhere than the markers say, or a load that nobody noted, a gain or a wrong declared mass hides "
    "in it."
)
WITHOUT_RESEMBLED = "What is only resembled explains nothing: what is left is judged without it."
_VARIES = (
    "is only what this resembles: a true cause has one size in every trial, band and channel, under every load and at "
    "every place, and the size of this one hangs on"
)
_MAY_NOT_MATTER = (
    "is only what this resembles: such a cause is known so poorly that what is there may be less than what matters."
)


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


def doubt_notes(causes: list[NamedFinding], named: tuple[NamedCause, ...], known: Tolerances) -> tuple[str, ...]:
    """Return why some of the ``causes`` are only resembled, as sentences."""
    several = any(is_one_of_several(cause, named) for cause, _ in causes)
    varying = (f"{_name(one)} {_VARIES} {one.varies_with}." for _, one in causes if one.varies_with)
    small = (f"{_name(one)} {_MAY_NOT_MATTER}" for cause, one in causes if may_not_matter(cause, known))
    return (*((SEVERAL_CROSSTALKS,) if several else ()), *varying, *small)


def is_doubt(note: str) -> bool:
    """Return whether a note is one of `doubt_notes` or `WITHOUT_RESEMBLED`."""
    return note in (SEVERAL_CROSSTALKS, WITHOUT_RESEMBLED) or _VARIES in note or _MAY_NOT_MATTER in note


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
