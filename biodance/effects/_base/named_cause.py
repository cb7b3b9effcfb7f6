"""A cause with its size: what a hypothesis holds, what a finding tells, and what accepting it undoes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from biodance.effects._base.effect import Effect
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class NamedCause:
    """A cause of size ``theta`` (p,) with ``covariance`` (p, p); for a cause that comes and goes the force while it
    acts, and per trial the ``course`` of its parameters, as in `Transient.local`.
    """

    effect: Effect
    theta: Array
    covariance: Array
    course: Mapping[str, Array] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect.name, self.effect.target
