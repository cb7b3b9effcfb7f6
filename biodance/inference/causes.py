"""A cause with its size: what hypotheses hold, and what accepting it undoes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from biodance.effects import Effect
from biodance.records import Array

UNLIKE = 0.07
"""Share of its size by which every cause is unlike its model at least: derivatives at the samples that are looked at
are no better at the upper edge of the bands."""


@dataclass(frozen=True, eq=False)
class NamedCause:
    """A cause of size ``theta`` (p,) with ``covariance`` (p, p); for a cause that comes and goes the force while it
    acts, and per trial the ``course`` of its parameters, as in `Transient.local`.
    """

    effect: Effect
    theta: Array
    covariance: Array
    course: Mapping[str, Array] = field(default_factory=dict)


def cause_key(one: NamedCause) -> tuple[str, str]:
    """Return effect and target of a cause."""
    return one.effect.name, one.effect.target


def unlike(effect: Effect) -> float:
    """Return the share of its size by which the wrench of a cause may be unlike its model: no cause is quite like it,
    and some say that they are less so (`Effect.unlike`).
    """
    return max(UNLIKE, effect.unlike)
