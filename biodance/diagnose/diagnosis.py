"""The records of a diagnosis: what was found wrong, what it could be instead, what naming it gains, and what could not be seen.

SI units; six channels are Fx Fy Fz (N) and Mx My Mz (N·m) about the middle of where the person stands.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from biodance.records import Array, frozen_array

if TYPE_CHECKING:
    from biodance.effects import Gate

Verdict = Literal["nothing wrong", "named, complete", "named, incomplete", "unexplained"]
SIGMAS = 1.959964
"""Half width of a 95 % interval in standard deviations."""


@dataclass(frozen=True)
class Alias:
    """A cause that the data cannot tell from the one named; ``log_bayes_factor`` against "nothing wrong" (natural logarithm)."""

    effect: str
    target: str
    log_bayes_factor: float


@dataclass(frozen=True)
class Estimate:
    """One parameter of a cause: ``value`` with its standard deviation ``sd`` in ``unit``."""

    name: str
    value: float
    sd: float
    unit: str

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.value - SIGMAS * self.sd, self.value + SIGMAS * self.sd


@dataclass(frozen=True, eq=False)
class Gain:
    """What a finding gains on trials that were not used to find it, against the model in use (identified body, nominal laboratory).

    ``rms_before``, ``rms_after`` (6,) N, N·m, root mean square residual per channel; ``channels`` (6, 2) 95 % interval of the share of it
    that the finding removes (0.2 = a fifth, negative = it adds); ``ci95`` (2,) the same for all channels together, each in units of what
    the accepted model leaves of the trials that were used (excludes 0: a proven gain); ``score``, ``score_se`` change of the log
    predictive density per second, natural logarithm, with standard error; ``trials`` judged on.
    """

    rms_before: Array
    rms_after: Array
    ci95: tuple[float, float]
    trials: tuple[str, ...]
    score: float = float("nan")
    score_se: float = float("nan")
    channels: Array = field(default_factory=lambda: np.full((6, 2), np.nan))

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", frozen_array(self.channels, (6, 2), "Gain.channels"))
        for name in ("rms_before", "rms_after"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), (6,), f"Gain.{name}"))

    @property
    def proven(self) -> bool:
        """Whether the interval excludes zero."""
        return self.ci95[0] > 0


@dataclass(frozen=True, eq=False)
class Finding:
    """One cause that was named.

    ``effect`` and ``target`` as in the family `biodance.effects`; ``parameters`` with intervals; ``set`` all causes that the data cannot
    tell apart, the named one first; ``visible_fraction`` share of its effect that remains visible when the body's own parameters and
    tolerances may adapt (1 = fully visible, 0 = hides in the body); ``gain`` None without a trial to judge on; ``advice`` what settles it
    in the laboratory; ``changes`` what accepting it changes in the body, in words.
    """

    effect: str
    target: str
    parameters: tuple[Estimate, ...]
    set: tuple[Alias, ...]
    visible_fraction: float
    gain: Gain | None = None
    advice: str = ""
    changes: tuple[str, ...] = ()

    @property
    def log_bayes_factor(self) -> float:
        """Evidence of the named cause against "nothing wrong", natural logarithm."""
        return self.set[0].log_bayes_factor


@dataclass(frozen=True)
class Adequacy:
    """How far the residual that is left in one ``channel`` and band (Hz) is from what sessions without fault show, in their standard
    deviations; ``trial`` where it is largest, and the ``second`` s of its recording around which (NaN: not looked for).
    """

    channel: str
    band_hz: tuple[float, float]
    z: float
    trial: str = ""
    second: float = float("nan")


@dataclass(frozen=True)
class Unobservable:
    """The smallest size ``limit`` (``unit``) of a cause that this session would see; infinite: it leaves no trace here.

    ``told_from`` the size from which it is also told from every other cause, infinite if one looks the same; ``typical`` size.
    """

    effect: str
    target: str
    limit: float
    unit: str
    told_from: float = float("nan")
    typical: float = float("nan")


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What the simulation of a session gets wrong.

    ``verdict``; ``findings`` in the order found; ``gates`` checks before any statistics; ``adequacy`` of what is left, worst first;
    ``unobservable`` the causes that would stay unseen at their typical size; ``limits`` smallest sizes of all causes looked for; ``notes``
    for the reader; ``candidates`` every cause at the first round, most probable first.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    gates: "tuple[Gate, ...]" = ()
    adequacy: tuple[Adequacy, ...] = ()
    unobservable: tuple[Unobservable, ...] = ()
    limits: tuple[Unobservable, ...] = ()
    notes: tuple[str, ...] = ()
    candidates: tuple[Alias, ...] = field(default=())

    @property
    def worst(self) -> float:
        """Largest z of the residual that is left; 0 without any."""
        return float(np.max([a.z for a in self.adequacy], initial=0.0))
