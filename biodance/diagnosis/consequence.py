"""Which sizes of a cause matter to a laboratory: below them it lies within what any careful one tolerates, and is no
finding however well it is seen.
"""

from dataclasses import dataclass

import numpy as np

from biodance.effects import Effect, unit_of
from biodance.records import Array

LEAST_THAT_MATTERS: dict[str, dict[str, float]] = {
    "time_delay": {"s": 0.003},
    "clock_drift": {"s": 0.003},
    "plate_offset": {"N": 2.0, "N·m": 1.0},
    "plate_drift": {"N": 2.0, "N·m": 1.0},
    "plate_hysteresis": {"N": 1.0, "N·m": 0.3},
    "plate_gain": {"1": 0.005},
    "plate_crosstalk": {"1": 0.002, "m": 0.001, "1/m": 0.01},
    "plate_position": {"m": 0.003},
    "plate_rotation": {"rad": 0.005},
    "lab_tilt": {"rad": 0.005},
    "body_mass": {"kg": 0.3},
    "added_mass": {"kg": 0.1},
    "external_contact": {"N": 2.0},
    "body_weight_support": {"N": 2.0},
    "joint_centre": {"m": 0.005},
    "segment_length": {"m": 0.005},
    "marker_misplaced": {"m": 0.010},
    "wobbling_mass": {"kg": 0.5},
    "sloshing_load": {"kg": 0.1},
    "filter_mismatch": {"Hz": 0.5},
    "head_joint": {"rad": 0.05},
    "trunk_joint": {"rad": 0.05},
    "shoulder_girdle": {"rad": 0.06},
}
"""Least size that matters, by effect and unit; of an effect that is not here every size does. Time: a third of a frame
at 100 Hz. Zero and drift: what a spot check before a session tolerates (2 N are 0.3 % of an adult's weight, 1 N·m is
1.4 mm of its centre of pressure). Gain and
cross-talk: makers' accuracy, 0.2 to 0.5 % and 0.05 to 0.2 % of full scale. Place and turn of a plate: 2 to 5 mm and
0.2 degrees in laboratories that check (Collins 2009, doi:10.1016/j.gaitpost.2008.10.060). Mass: clinic scale and
clothes, 0.2 kg. Joints and lengths: who places markers twice places them 4 to 6 mm apart (Della Croce 1999,
doi:10.1007/BF02513272); one marker among forty is twice as far off in every careful laboratory. Missing joints: as much
as everybody moves them anyway (`MissingJoint.natural`). Loads: as an added mass. A filter: half a hertz below the one
that is assumed."""


def least(effect: Effect) -> dict[str, float]:
    """Return the least size of each parameter that matters, by the parameter's name; only of those that have one."""
    sizes = LEAST_THAT_MATTERS.get(effect.name, {})
    found = {one.name: sizes.get(unit_at(effect, one.unit), 0.0) for one in effect.parameters}
    return {name: size for name, size in found.items() if size > 0}


def matters(effect: Effect, theta: Array) -> bool:
    """Return whether a cause of size ``theta`` (p,) matters: its parameters of one unit, as a vector, reach their
    least size (`LEAST_THAT_MATTERS`); what has none always matters.
    """
    floors = least(effect)
    if not floors:
        return True
    values = {one.name: float(size) for one, size in zip(effect.parameters, theta, strict=True) if one.name in floors}
    return float(np.linalg.norm([values[name] / floor for name, floor in floors.items()])) >= 1.0


def unit_at(effect: Effect, unit: str) -> str:
    """Return the unit at the effect's target, where its parameter has another one at each (``N or N·m``)."""
    if " or " not in unit:
        return unit
    source, arrow, target = effect.target.rpartition("->")
    if not arrow:
        return unit_of(target)
    force = [not name.rpartition(":")[2].startswith("M") for name in (source, target)]
    return "1" if force[0] == force[1] else "m" if force[0] else "1/m"


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
            return self.size >= LEAST_THAT_MATTERS["plate_offset"][self.unit]
        return self.size >= (LEAST_MOMENT if self.channel.startswith("M") else LEAST_FORCE)
