"""Which sizes of a cause matter to a laboratory: below them it lies within what any careful one tolerates, and is no
finding however well it is seen.
"""

from dataclasses import dataclass

import numpy as np

from biodance.effects import Effect
from biodance.effects.plate_offset import PlateOffset
from biodance.records import Array


def least(effect: Effect) -> dict[str, float]:
    """Return the least size of each parameter that matters, by the parameter's name; only of those that have one."""
    found = {one.name: one.least_at(effect.target) for one in effect.parameters}
    return {name: size for name, size in found.items() if size > 0}


def matters(effect: Effect, theta: Array) -> bool:
    """Return whether a cause of size ``theta`` (p,) matters: its parameters of one unit, as a vector, reach their
    least size (`Parameter.least`); what has none always matters.
    """
    floors = least(effect)
    if not floors:
        return True
    values = {one.name: float(size) for one, size in zip(effect.parameters, theta, strict=True) if one.name in floors}
    return float(np.linalg.norm([values[name] / floor for name, floor in floors.items()])) >= 1.0


NAMED, SUGGESTED = 0.85, 0.5
"""Probability from which a cause is named, and from which it is told as only resembled."""
LIMIT = 3.0
"""Standard deviations between laboratories beyond which what is left in one band of one channel is not adequate."""
LEAST_FORCE, LEAST_MOMENT = 1.0, 0.3
"""N, N·m RMS in one band: what is left below it alarms nobody. 1 N is 0.15 % of an adult's weight, half of what
plates are accurate to (0.2-0.5 %); 0.3 N·m are 0.4 mm of centre of pressure, where plates in place err by 2-5 mm
(Collins 2009, doi:10.1016/j.gaitpost.2008.10.060), and 0.004 N·m/kg in a joint moment, where the smallest
meaningful differences are some 0.05.
"""


@dataclass(frozen=True)
class Adequacy:
    """How far the residual that is left in one ``channel`` and band (Hz) is from what sessions without fault show, in
    their standard deviations, and its RMS ``size`` over the trials' time (N for forces, N·m for moments); ``trial``
    where it is largest, and the ``second`` s of its recording around which (NaN: not looked for).
    """

    channel: str
    band_hz: tuple[float, float]
    z: float
    trial: str = ""
    second: float = float("nan")
    size: float = float("inf")

    @property
    def unit(self) -> str:
        """N or N·m."""
        return "N·m" if self.channel.startswith("M") else "N"

    @property
    def matters(self) -> bool:
        """Whether it is large enough to change what a laboratory concludes: `LEAST_FORCE`, `LEAST_MOMENT`; in the means
        of trials, from 0 Hz on, what a zero of the plate must be to matter.
        """
        if self.band_hz[0] == 0:
            return self.size >= PlateOffset.parameters[0].least_at(self.channel)
        return self.size >= (LEAST_MOMENT if self.channel.startswith("M") else LEAST_FORCE)


@dataclass(frozen=True)
class Unobservable:
    """The smallest size ``limit`` (``unit``) of a cause that this session would see; infinite: it leaves no trace here.

    ``told_from`` the size from which it is also told from every other cause, infinite if one looks the same;
    ``typical`` size.
    """

    effect: str
    target: str
    limit: float
    unit: str
    told_from: float = float("nan")
    typical: float = float("nan")
