"""Observations of a session that need no model of the body, and what every cause adds to each of them."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from biodance.discovery import Chosen
from biodance.effects import DiscreteEffect, Effect, causes
from biodance.effects.axis_error import AxisError
from biodance.observations import (
    ObservableCause,
    Observation,
    SeenTrial,
    observe,
    observers,
    possible_causes,
    recording,
    sensitivities,
    sign_reversals,
    with_changed_plate,
)
from biodance.records import Array, LeftOutSpan, Session

_FAULT = 4.0
"""A fault in steps of its cause: 16 mm, 16 ms, 8 %, 8 N, 0.08 rad, 2 kg."""
_UNRESPONSIVE = 0.2
"""Standard deviations that a usual fault adds to an observation that does not respond to it."""
_HABIT = 3.0
"""Standard deviations of laboratories beyond which a norm is no habit of one."""
_REPEATED = 0.5
"""Share of the variance of one step that the strides of a trial repeat."""
_ALIKE = 0.9
"""Correlation of what two causes add from which they cannot be told apart."""
_REACH = 0.15
"""m from where it is expected that a pressure lies at most because a plate is not quite where the file says (five times
what plates are off in laboratories); what lies farther is of another foot, of plates exchanged or of a wrong sign.
"""
CONTACTS = 2
"""Contacts with a plate from which one tells what it does wrong: a single one errs by what nobody foresees."""
_EXACT = ("empty_plate", "flight", "standing_force", "standing_twist")
"""Observers of which Newton alone says what they see: plates with nobody on them; who stands still has a weight, and no
other force or turn.
"""


@dataclass(frozen=True, eq=False)
class ObservedEvidence:
    """All ``observations`` (n) of a session. ``sensitivities``: for every cause, the change of each observation per
    unit of the cause (n,). ``sign_reversed``: for every channel, value minus expectation (n,) after its sign is
    reversed, NaN where the observation is then missing, or is only shown. ``seconds``: by trial, time in single support
    on a plate. ``recorded``: the trials that were examined.
    """

    observations: tuple[Observation, ...]
    causes: Mapping[tuple[str, str], ObservableCause]
    sensitivities: Mapping[tuple[str, str], Array]
    sign_reversed: Mapping[tuple[str, str], Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    recorded: tuple[SeenTrial, ...] = ()

    @cached_property
    def counting(self) -> "ObservedEvidence":
        """Only the observations that count as evidence."""
        return self.where(np.array([one.counts for one in self.observations], dtype=bool))

    def where(self, kept: NDArray[np.bool_]) -> "ObservedEvidence":
        """Return the evidence of the observations ``kept`` (n,) alone."""
        found = tuple(one for one, here in zip(self.observations, kept, strict=True) if here)
        columns = {name: column[kept] for name, column in self.sensitivities.items()}
        turned = {name: value[kept] for name, value in self.sign_reversed.items()}
        return replace(self, observations=found, sensitivities=columns, sign_reversed=turned)

    def only(self, names: Collection[str]) -> "ObservedEvidence":
        """Return the evidence of some observations alone, by the names of their observers; signs are not asked for."""
        kept = np.array([one.observer in names for one in self.observations], dtype=bool)
        return replace(self.where(kept), sign_reversed={})

    def columns(self, effect: str, target: str, parameters: Sequence[str]) -> Array:
        """Return (n, p) what one unit of each of the ``parameters`` (p) of an effect adds to the observations; 0 where
        an observation does not respond. A row is in the unit of its observation, as ``value - expected`` is.

        ``effect``, ``target`` and ``parameters`` as in the family of effects, of others than the ``causes``, too.
        """
        key = effect, target, tuple(parameters)
        if key not in self._columns:
            self._columns[key] = _columns(self.recorded, self.observations, *key)
        return self._columns[key]

    @cached_property
    def _columns(self) -> dict[tuple[str, str, tuple[str, ...]], Array]:
        return {}

    @cached_property
    def norms(self) -> tuple[str, ...]:
        """(k) names of the errors that several observations share."""
        return tuple(dict.fromkeys(name for one in self.observations for name in one.norms))

    @cached_property
    def shared(self) -> Array:
        """(n, k) contribution of one standard deviation of each error that several observations share."""
        rows = [[one.norms.get(name, 0.0) for name in self.norms] for one in self.observations]
        return np.array(rows).reshape(len(self.observations), len(self.norms))

    @cached_property
    def in_reach(self) -> NDArray[np.bool_]:
        """(n,) observations that tell the size of a cause: no pressure far from where it should be."""
        away = np.array([abs(one.value - one.expected) if one.unit == "m" else 0.0 for one in self.observations])
        return away <= _REACH

    def contacts(self, cause: tuple[str, str] | None = None) -> int:
        """Return how many contacts with the plates there are, or tell a ``cause``; exact ones count `CONTACTS`."""
        seen = list(self.observations)
        if cause is not None:
            large = np.abs(self.causes[cause].step * _FAULT * self.sensitivities[cause])
            seen = [o for o, here, size in zip(seen, self.in_reach, large, strict=True) if here and size >= o.sd]
        exact = cause and any(one.observer in _EXACT for one in seen)
        return CONTACTS if exact else len({one.contact for one in seen if one.observer not in _EXACT})

    def strongest(self, index: int) -> tuple[str, str]:
        """Return the cause to which an observation responds most at the usual fault size; empty names if to none."""
        size = {name: abs(c.step * self.sensitivities[name][index]) for name, c in self.causes.items()}
        best = max(size, key=lambda name: size[name], default=("", ""))
        return best if size.get(best, 0.0) * _FAULT > _UNRESPONSIVE * self.observations[index].expected_sd else ("", "")

    def detected_by(self, cause: tuple[str, str]) -> tuple[str, ...]:
        """Return the observers that detect the usual fault of a cause at one standard deviation, over all their
        observations; () if none does.
        """
        size = self.causes[cause].step * _FAULT
        total: dict[str, float] = {}
        for one, column in zip(self.observations, self.sensitivities[cause], strict=True):
            # Squares in standard deviations add over independent observations.
            total[one.observer] = total.get(one.observer, 0.0) + (size * column / one.expected_sd) ** 2
        return tuple(name for name, power in total.items() if power**0.5 >= 1.0)


@dataclass(frozen=True)
class CauseVisibility:
    """How well the observers of a session determine one cause: ``sd`` of its size in ``unit`` from all of them
    (infinite if none responds), the responding ``observers``, the causes ``alike`` that they cannot distinguish from
    it, and ``would``: movements or markers, in words, that would make further observers respond.
    """

    effect: str
    target: str
    unit: str
    sd: float
    observers: tuple[str, ...]
    alike: tuple[tuple[str, str], ...]
    would: tuple[str, ...]


def cause_visibilities(evidence: ObservedEvidence) -> tuple[CauseVisibility, ...]:
    """Return how well each cause is determined by the observers, undetermined causes last."""
    counting, family = evidence.counting, observers()
    responded = {one.observer for one in evidence.observations}
    sd = np.array([one.sd for one in counting.observations])
    # Own errors on the diagonal, shared ones as outer products.
    inner = np.diag(sd**2) + counting.shared @ counting.shared.T
    # S^-1 c of every cause: c'S^-1 c is the information on its size.
    white = {name: np.linalg.solve(inner, one) if one.size else one for name, one in counting.sensitivities.items()}
    power = {name: float(counting.sensitivities[name] @ white[name]) for name in counting.sensitivities}
    found = []
    for name, cause in evidence.causes.items():
        seen = counting.detected_by(name)
        alike = tuple(
            other
            for other in evidence.causes
            if other != name
            and seen
            and abs(counting.sensitivities[other] @ white[name]) > _ALIKE * (power[other] * power[name]) ** 0.5 > 0
        )
        missing = [one for one in family.values() if cause.effect in one.responds_to and one.name not in responded]
        # Standard deviation of the size: information^-1/2.
        size = power[name] ** -0.5 if seen else float("inf")
        found.append(CauseVisibility(*name, cause.unit, size, seen, alike, tuple(one.needs for one in missing)))
    return tuple(sorted(found, key=lambda one: not one.observers))


def collect_evidence(
    session: Session,
    chosen: Chosen[Effect | DiscreteEffect] = None,
    norms: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    half: Mapping[str, tuple[LeftOutSpan, ...]] = MappingProxyType({}),
) -> ObservedEvidence:
    """Return the observations of all observers in all trials of a session except skipped ones. ``chosen`` restricts the
    causes; ``norms`` are those of the laboratory (`Tolerances.norms`); ``half`` by trial when a foot may stand partly
    beside its plate (`Contact.half`).
    """
    asked = causes(chosen)
    mass, declared = session.subject.mass, "mass" not in session.subject.guessed
    judged = [trial for trial in session.trials if trial.plates and trial.role != "skip"]
    seen = tuple(recording(trial, mass=mass, declared=declared, half=half.get(trial.name, ())) for trial in judged)
    single = all(len(one.trial.plates) == 1 for one in seen)
    known = {c.names: c for one in seen for c in possible_causes(one, single=single) if c.effect in asked}
    by_trial = [tuple(_apply_norm(o, norms) for o in _correlate_strides(observe(one))) for one in seen]
    found = tuple(one for some in by_trial for one in some)
    return ObservedEvidence(
        found,
        known,
        {names: _columns(seen, found, *names, (cause.parameter,))[:, 0] for names, cause in known.items()},
        _reversed(seen, found, norms, single=single) if AxisError.name in asked else {},
        {one.trial.name: one.seconds for one in seen},
        seen,
    )


def _columns(
    recorded: Sequence[SeenTrial], found: Sequence[Observation], effect: str, target: str, parameters: Sequence[str]
) -> Array:
    """Return (n, p) what one unit of each parameter of an effect adds to observations ``found`` in recordings."""
    out = np.zeros((len(found), len(parameters)))
    for seen in recorded:
        here = [i for i, one in enumerate(found) if one.trial == seen.trial.name]
        own = [found[i] for i in here]
        for k, parameter in enumerate(parameters):
            out[here, k] = sensitivities(seen, own, effect, target, parameter)
    return out


def _reversed(
    recorded: Sequence[SeenTrial],
    found: Sequence[Observation],
    norms: Mapping[str, tuple[float, float]],
    *,
    single: bool,
) -> dict[tuple[str, str], Array]:
    """Return by channel the value minus expectation (n,) of the observations after its sign is reversed, in trials with
    steps; NaN where an observation is then missing, or is only shown. The sign of the vertical force is gravity's, so
    that most observations change linearly; the others are made again.
    """
    plain = np.array([one.value - one.expected if one.counts else np.nan for one in found])
    out: dict[tuple[str, str], Array] = {}
    for seen in recorded:
        here = [i for i, o in enumerate(found) if o.trial == seen.trial.name and o.counts]
        again = {found[i].observer for i in here if not found[i].sensitivity.linear}
        for name, (plate, change) in sign_reversals(seen, single=single).items() if seen.steps else ():
            value = out.setdefault(name, plain.copy())
            right = observe(with_changed_plate(seen, plate, change), again) if again else ()
            after = {one.key: _apply_norm(one, norms) for one in right}
            for i in here:
                if found[i].observer not in again:
                    value[i] += found[i].sensitivity.to(plate, change)
                else:
                    one = after.get(found[i].key)
                    value[i] = one.value - one.expected if one else np.nan
    return out


def _correlate_strides(found: tuple[Observation, ...]) -> tuple[Observation, ...]:
    """Return the observations of one trial with a shared error between strides of one foot on one plate: a person
    repeats the error of a step while walking on, so that twenty equal strides are not twenty independent observations.
    """
    count = Counter(one.stride for one in found)
    # Variance split: one part repeats from stride to stride, the rest is each step's own.
    return tuple(
        one
        if count[one.stride] == 1
        else replace(
            one, sd=one.sd * (1 - _REPEATED) ** 0.5, norms=dict(one.norms) | {one.stride: one.sd * _REPEATED**0.5}
        )
        for one in found
    )


def _apply_norm(one: Observation, norms: Mapping[str, tuple[float, float]]) -> Observation:
    """Return an observation corrected by the norm of its laboratory (marker placement, filters). Of the norm, the share
    that the "laboratory" part of the expectation allows is added to the expectation; the rest stays uncertain. A norm
    beyond `_HABIT` standard deviations is ignored: it may be a plate that is wrong in all sessions.
    """
    own = [name for name in one.norms if name.startswith("laboratory")]
    value, sd = norms.get(one.kind, (0.0, float("inf")))
    usual = sum(one.norms[name] ** 2 for name in own)
    if not usual or abs(value) > _HABIT * np.sqrt(usual + sd**2):
        return one
    # Best linear estimate of the laboratory's part of the norm.
    share = usual / (usual + sd**2)
    # What stays uncertain of that part: variance 1 - share.
    left = {name: size * (np.sqrt(1 - share) if name in own else 1.0) for name, size in one.norms.items()}
    return replace(one, expected=one.expected + share * value, norms=left)
