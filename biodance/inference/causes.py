"""How causes are told apart, and how far each may be unlike its model."""

from biodance.effects import Effect, NamedCause

UNLIKE = 0.07
"""Share of its size by which every cause is unlike its model at least: derivatives at the samples that are looked at
are no better at the upper edge of the bands."""


def cause_key(one: NamedCause) -> tuple[str, str]:
    """Return effect and target of a cause."""
    return one.effect.name, one.effect.target


def unlike(effect: Effect) -> float:
    """Return the share of its size by which the wrench of a cause may be unlike its model: no cause is quite like it,
    and some say that they are less so (`Effect.unlike`).
    """
    return max(UNLIKE, effect.unlike)
