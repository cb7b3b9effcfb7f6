"""The contract of an effect: one candidate cause of disagreement between the simulated and the measured wrench.

The author of an effect writes its parameters and ONE of two methods; the other one is derived:

- linear in its parameters: ``columns(case)``, what one unit of each parameter adds to the MEASURED wrench;
  ``transform`` adds them;
- otherwise: ``transform(case, theta)``, the case that this cause would have produced, or only the wrench ``added``;
  ``columns`` is its central difference at zero.

What the markers say about a cause is optional: ``marker_columns`` (a change of their mean residual) or ``shown`` (a
size by themselves). One that comes and goes within a trial is a `Transient`. Causes that are found by a check instead
of a fit (units, labels, clipping ...) are ``DiscreteEffect``.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import ClassVar

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.quality_check import Checked, unit_at
from biodance.errors import BiodanceError, UnknownName
from biodance.records import CHANNELS, Array
from biodance.spatial import wrench_about_origin

UNLIKE = 0.07
"""Share of its size by which every cause is unlike its model: derivatives at the samples that are looked at are no
better at the upper edge of the bands.
"""


class Care(StrEnum):
    """What a laboratory is careful in: of the causes within tolerances that go with one care, all are small together.
    Who places markers with care has no better plates.
    """

    PLATES = "plates"
    OTHER = "tolerances"


@dataclass(frozen=True)
class Parameter:
    """``name``, ``unit`` as printed, ``typical`` size in that unit and the ``source`` of that size.

    Where it is known, ``least`` the smallest size that matters to a laboratory (0: every size does), ``usual`` up to
    which size laboratories have it without calling it a fault (both by unit, or by channel, where targets differ), and
    ``alike`` the standard deviation of what careful laboratories have, so that no size is surer than that.
    """

    name: str
    unit: str
    typical: float
    source: str
    least: float | Mapping[str, float] = 0.0
    usual: float | Mapping[str, float] = 0.0
    alike: float = 0.0

    def least_at(self, target: str) -> float:
        """Return the smallest size at a target that matters."""
        return self._at(self.least, target)

    def usual_at(self, target: str) -> float:
        """Return the size at a target up to which laboratories have it without calling it a fault."""
        return self._at(self.usual, target)

    def _at(self, sizes: float | Mapping[str, float], target: str) -> float:
        if not isinstance(sizes, Mapping):
            return sizes
        unit = sizes.get(unit_at(self.unit, target), 0.0)
        return sizes.get(target.rpartition(":")[2], unit)


@dataclass(frozen=True)
class Effect(Checked):
    """One cause at one ``target``: a segment, a channel (``Fz``), a pair (``Fz->My``), a plate and axis
    (``plate1:x``), or "" for none.
    """

    target: str = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    taken_up_by_calibration: ClassVar[bool] = False
    """Whether joints that a movement placed (`motion.functional_joints`) have taken up a part of this cause before
    anybody looks.
    """
    prior: ClassVar[float] = 0.01
    """Probability that a session has it, before any data, at whichever target: judgement, told by how often
    laboratories find it."""
    care: ClassVar[Care] = Care.OTHER
    """With what care of a laboratory it is small, as long as it is no fault."""
    each_its_own: ClassVar[bool] = False
    """Whether one target may be much farther off than the others without being a fault: its tolerance has a scale of
    its own beside that of its care.
    """
    by_load: ClassVar[bool] = False
    """Whether it is in proportion to what a plate carries: one that is always empty cannot show it."""
    screened_at: ClassVar[tuple[float, ...]] = ()
    """Sizes, in typical ones, at which a cause of one parameter is looked for beside its slope at none: where it is far
    from proportion to its size.
    """
    size_error: ClassVar[float] = UNLIKE
    """Share of itself by which the size that is told errs, beyond what the rows leave open."""
    grows: ClassVar["type[Effect] | None"] = None
    """The cause that it is at every instant, from minus half of its size at the session's start to half at its end."""
    carries: ClassVar[tuple[str, ...]] = ()
    """Joints of the model that it moves along: where a movement placed them without it, nothing beside them is accused.
    """

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the legal targets in ``case``."""
        return ("",)

    def at(self, target: str, case: Case) -> "Effect":
        """Return the effect at ``target``; UnknownName lists the legal targets."""
        legal = self.targets(case)
        if target not in legal:
            raise UnknownName.of(f"target of {self.name}", target, legal)
        return replace(self, target=target).sized_for(case)

    def at_all_targets(self, case: Case) -> tuple["Effect", ...]:
        """Return the effect at every legal target in ``case``."""
        return tuple(replace(self, target=target).sized_for(case) for target in self.targets(case))

    def sized_for(self, case: Case) -> "Effect":
        """Return the effect with the sizes that are typical of the person or session of ``case``; by default the same
        everywhere.
        """
        return self

    @property
    def linear(self) -> bool:
        """Whether ``columns`` says all: what is added, and what can be removed, is in proportion to the parameters."""
        kind = type(self)
        return kind.columns is not Effect.columns and all(
            getattr(kind, name) is getattr(Effect, name) for name in ("transform", "added", "removed")
        )

    @property
    def typical(self) -> Array:
        """(p,) typical sizes, in the parameters' units."""
        return np.array([parameter.typical for parameter in self.parameters])

    @property
    def usual(self) -> Array:
        """(p,) sizes up to which laboratories have it here without calling it a fault; 0: none is usual."""
        return np.array([parameter.usual_at(self.target) for parameter in self.parameters])

    @property
    def unlike(self) -> float:
        """Share of its size by which its wrench may be unlike its model, `UNLIKE` or more."""
        return UNLIKE

    def columns(self, case: Case) -> Array:
        """Return (T, 6, p): what one unit of each parameter adds to the measured wrench minus the predicted one,
        about the lab origin.
        """
        steps = 1e-3 * np.diag(self.typical)
        # Central difference at zero: error of second order in the step.
        return np.stack([(self.added(case, s) - self.added(case, -s)) / (2 * s.max()) for s in steps], axis=2)

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case that this cause of size ``theta`` (p,) would have produced: what it ``added`` on its plate,
        the first of several for a cause that is on none.
        """
        kind, size = type(self), np.asarray(theta, dtype=float)
        if kind.added is not Effect.added:
            return case.with_added(self.plate_of(case), self.added(case, size))
        if kind.columns is Effect.columns:
            raise BiodanceError(f"Effect {self.name} defines neither columns nor transform; write one of them.")
        return case.with_added(self.plate_of(case), self.columns(case) @ size)

    def added(self, case: Case, theta: Array) -> Array:
        """Return (T, 6): what ``transform`` adds to measured minus predicted wrench."""
        return self.transform(case, np.asarray(theta, dtype=float)).residual - case.residual

    def marker_columns(self, case: Case) -> Array | None:
        """Return (K, 3, p) m per unit: what one unit adds to ``case.marker_residual``; None where the markers say
        nothing.
        """
        return None

    def shown(self, *cases: Case) -> Array | None:
        """Return (p,) the size that the markers of all ``cases`` show by themselves, without any force, NaN for a
        parameter that they do not show; None where they say nothing.
        """
        return None

    def in_body(self, case: Case) -> Array | None:
        """Return (10N,) how the parameters of the body count to the first parameter of this cause, which says what is
        there and not only how the body is unlike the table; None where none of it lies in the body.
        """
        return None

    def measured(self, theta: Array, *cases: Case) -> Array:
        """Return the size (p,) of a cause that was named with ``theta`` (p,): where the markers of all ``cases`` show
        it by themselves, that, in place of what was inferred from all rows; by default ``theta``.
        """
        return theta

    def removed(self, case: Case, theta: Array) -> Array:
        """Return (T, 6): what this cause of size ``theta`` (p,) has added to what ``case`` measured, about the lab
        origin.

        By default what it adds to the prediction; a cause that distorts time or frequency undoes itself in what was
        measured, because it distorts the person's other errors and loads as well.
        """
        return self.added(case, theta)

    def corrected(self, case: Case, theta: Array) -> Case:
        """Return the case without this cause of size ``theta`` (p,): what would have been measured, or the body that
        moves right.

        By default the plates lose what was ``removed``; a cause in the body returns another body and its motion
        instead.
        """
        return case.with_added(self.plate_of(case), -self.removed(case, theta))

    def possible(self, theta: Array) -> bool:
        """Return whether a cause of size ``theta`` (p,) can be: by default every size, either way."""
        return True

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether a cause of size ``theta`` (p,) can be in the person and laboratory of ``case``."""
        return self.possible(theta)

    def reported(self, case: Case, theta: Array, sd: Array) -> tuple[tuple[str, float, float, str], ...]:
        """Return name, value, standard deviation and unit of what a report prints for ``theta`` (p,) with ``sd``
        (p,) in ``case``.
        """
        return tuple((p.name, float(t), float(s), p.unit) for p, t, s in zip(self.parameters, theta, sd, strict=True))

    def reported_size(self, size: float) -> float:
        """Return a detection limit in reported form, from a ``size`` of the first parameter; by default the same."""
        return size

    def plate_of(self, case: Case):  # type: ignore[no-untyped-def]
        """Return the plate that the target names, or the first one."""
        name = self.target.partition(":")[0]
        return case.plate(name) if name.startswith("plate") else case.trial.plates[0]


class ChannelEffect(Effect, ABC):
    """A cause in one channel of a plate: ``Fx`` ... for one plate, ``plate2:Fx`` ... for several."""

    care = Care.PLATES

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every channel of every plate."""
        if len(case.trial.plates) == 1:
            return CHANNELS
        return tuple(f"{plate.name}:{channel}" for plate in case.trial.plates for channel in CHANNELS)

    @property
    def channel(self) -> int:
        """Index 0..5 of the channel."""
        return CHANNELS.index(self.target.rpartition(":")[2])

    @abstractmethod
    def in_channel(self, case: Case) -> Array:
        """Return (T,): what one unit adds to the channel, about the plate's centre."""

    def columns(self, case: Case) -> Array:
        """Return what one unit adds to the channel, moved to the lab origin."""
        # One channel about the plate's centre; a force there has a moment about the lab origin.
        only = self.in_channel(case)[:, None] * np.eye(6)[self.channel]
        return wrench_about_origin(only, self.plate_of(case).centre)[:, :, None]


class Transient(Effect, ABC):
    """A cause that may also have a course of its own in each trial."""

    @abstractmethod
    def local(self, case: Case) -> Array | None:
        """Return (T, 6, k): what one unit of each of k parameters of this trial alone adds; None where it does not come
        and go. The k parameters follow one another in time, as many for each of `parameters`.
        """

    @abstractmethod
    def beside(self, place: Array) -> "Transient":
        """Return the cause where it acts ``place`` (3,) m from its usual point, in the axes of its segment."""

    @abstractmethod
    def at_full_rate(self) -> "Transient":
        """Return the cause with the finest allowed time course (`local`)."""


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
