"""FAMILY: one piece of evidence per file that needs no model of the body, found automatically.

An observer measures where the centre of pressure lies in the foot that stands there, when the force comes, what the
plates weigh over a step, what they read empty. It needs a static trial, foot markers and plates: no inverse kinematics,
no segment masses. It is given as ``OBSERVER`` by its file, others come by the entry points ``biodance.observations``.
Its author says how the value responds to the samples of the plates, to a late clock and to the declared mass
(`Sensitivity`); what a cause (a plate that lies elsewhere ...) does to the samples is known of every cause
(`sensitivities`).
"""

import inspect
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from biodance.discovery import Chosen, Family
from biodance.observations._causes import (
    ObservableCause,
    Sensitivity,
    possible_causes,
    sensitivities,
    sign_reversals,
    with_changed_plate,
)
from biodance.observations._feet import FootPath
from biodance.observations._recording import ONSET, FootStep, SeenTrial, recording
from biodance.observations._stance import LANDMARK, shift_per_sd
from biodance.records import assign

_TIME = re.compile(r" (at|from) [-\d.]+ s")
"""When a step was, as its name says it."""

__all__ = [
    "LANDMARK",
    "ONSET",
    "FootPath",
    "FootStep",
    "ObservableCause",
    "Observation",
    "Observer",
    "SeenTrial",
    "observe",
    "observers",
    "possible_causes",
    "recording",
    "sensitivities",
    "shift_per_sd",
    "sign_reversals",
    "with_changed_plate",
]


@dataclass(frozen=True)
class Observation:
    """One value that an observer measures.

    ``observer`` its name; ``what`` of which foot, plate and phase; ``trial``; ``value`` with the standard deviation
    ``sd`` of this one observation, in ``unit``; ``expected`` of a recording without fault; ``norms`` how uncertain that
    expectation is, each part with a name: observations that share a name err together ("person" parts within one
    person, "laboratory" parts in all persons of one laboratory, others with their plate). ``counts`` False: it is
    shown, and adds nothing to the evidence, because others hold it already. ``sensitivity``: how value less expectation
    responds to what may be wrong (`sensitivities`).
    """

    observer: str
    what: str
    trial: str
    value: float
    sd: float
    expected: float
    unit: str
    plate: str = ""
    norms: Mapping[str, float] = field(default_factory=dict)
    counts: bool = True
    sensitivity: Sensitivity = field(default_factory=Sensitivity, compare=False, repr=False)

    def __post_init__(self) -> None:
        assign(self, norms=MappingProxyType(dict(self.norms)))

    @property
    def key(self) -> tuple[str, str, str]:
        """Observer, trial and what: the same in an altered recording."""
        return self.observer, self.trial, self.what

    @property
    def kind(self) -> str:
        """Observer and phase: what a laboratory learns a norm of."""
        _, comma, phase = self.what.rpartition(", ")
        return f"{self.observer} {phase}" if comma else self.observer

    @property
    def stride(self) -> str:
        """Observer, trial and what, but for the time: the same in all strides of one foot on one plate in a trial."""
        return f"{self.observer}, {self.trial}, {_TIME.sub('', self.what)}"

    @property
    def contact(self) -> tuple[str, str]:
        """Trial and time of the step, or the trial alone, that it was seen in: observations of one contact err
        together in ways that nobody foresees.
        """
        when = _TIME.search(self.what)
        return self.trial, when[0] if when else ""

    @property
    def expected_sd(self) -> float:
        """Standard deviation of what is expected of one such observation in a recording without fault."""
        # The parts of the expectation's error are independent: variances add.
        return float(np.sqrt(self.sd**2 + sum(size**2 for size in self.norms.values())))

    @property
    def z(self) -> float:
        """Distance from what is expected in its standard deviations."""
        return (self.value - self.expected) / self.expected_sd


class Observer(ABC):
    """One piece of evidence: ``name`` that of its file; ``responds_to`` the effects that it is for; ``needs`` which
    movement and markers, in words for the analyst; ``source`` of what it expects.
    """

    name: ClassVar[str] = ""
    responds_to: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[str] = ""
    source: ClassVar[str] = ""

    @abstractmethod
    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return what it observes in one trial; () where the trial does not hold what it needs."""


def lacks(candidate: object) -> tuple[str, ...]:
    """Return what an object or class lacks to be an observer."""
    kind = candidate if isinstance(candidate, type) else type(candidate)
    if not issubclass(kind, Observer):
        return ("the base class Observer",)
    missing = [name for name in ("name", "responds_to", "needs", "source") if not getattr(kind, name)]
    return (*missing, *(sorted(getattr(kind, "__abstractmethods__", ())) if inspect.isabstract(kind) else ()))


FAMILY: Family[Observer | type[Observer]] = Family(
    "observer", "biodance.observations", __name__, "OBSERVER", lacks, lambda kind: kind.name
)


def observers(chosen: Chosen[Observer | type[Observer]] = None) -> Mapping[str, Observer]:
    """Return the observers by name: all, or the ``chosen`` ones (names; objects and classes join)."""
    found = FAMILY.choose(chosen)
    return MappingProxyType({name: one() if isinstance(one, type) else one for name, one in found.items()})


def observe(seen: SeenTrial, chosen: Chosen[Observer | type[Observer]] = None) -> tuple[Observation, ...]:
    """Return all observations of one trial, finite values only."""
    known: tuple[Observation, ...] | None = seen.kept.get("observations") if chosen is None else None
    if known is not None:
        return known
    each = (one for observer in observers(chosen).values() for one in observer.observe(seen))
    found = tuple(one for one in each if all(map(math.isfinite, (one.value, one.expected, one.sd))))
    if chosen is None:
        seen.kept["observations"] = found
    return found
