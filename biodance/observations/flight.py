"""Flight: nobody touches anything, so every plate reads exactly zero and gravity is the only force."""

import numpy as np

from biodance.effects.plate_drift import PlateDrift
from biodance.effects.plate_offset import PlateOffset
from biodance.motion.contact import falls_freely
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, of_mean
from biodance.records import runs

_HIGH = 0.06
"""m above their lowest place in the trial that both markers of a foot in flight are."""
_LEVEL = 0.05
"""m between plates: on stairs a high foot may stand."""
_SHORTEST = 0.06
"""s of flight."""
_OWN = {"Fx": 1.5, "Fy": 1.5, "Fz": 4.0}
"""N: how exactly zero a plate reads so soon after a load."""


class Flight(Observer):
    """Mean force (N) of every plate while both feet are in the air."""

    name = "flight"
    responds_to = (PlateOffset.name, PlateDrift.name)
    needs = "A run or a jump on the plates; foot markers."
    source = "Free flight: nothing touches the plates."

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return three observations of each plate that was loaded in the trial, over all its flight."""
        heights = [plate.height for plate in seen.trial.plates]
        if not seen.feet or not heights or max(heights) - min(heights) > _LEVEL:
            return ()
        spans = _in_air(seen)
        found = []
        for plate in seen.trial.plates:
            wrench = plate.wrench
            inside = np.zeros(wrench.time.size, dtype=bool)
            for start, stop in spans:
                inside |= (wrench.time >= start) & (wrench.time <= stop)
            if not inside.any() or wrench.force[:, 2].max() < 100.0:
                continue
            lost = [wrench.force[a] - wrench.force[b - 1] for a, b in runs(inside)]
            # d/dd of the mean of F(t - d): what every stretch loses from its beginning to its
            # end, over its duration.
            late = np.sum(lost, axis=0) / np.count_nonzero(inside) * wrench.rate
            for axis, (channel, sd) in enumerate(_OWN.items()):
                value, what = float(wrench.force[inside, axis].mean()), f"{plate.name} {channel} in flight"
                plates = {plate.name: of_mean(wrench.value[inside], axis)}
                responds = Sensitivity(plates, delay=float(late[axis]))
                found.append(
                    Observation(self.name, what, seen.trial.name, value, sd, 0.0, "N", plate.name, sensitivity=responds)
                )
        return tuple(found)


def _in_air(seen: SeenTrial) -> list[tuple[float, float]]:
    """Return first and last time s of every flight: both feet are high, and the body falls (feet of who sits hang)."""
    paths = [path[:, 2] for foot in seen.feet for path in (foot.heel, foot.toe)]
    # The lowest of all markers above its own lowest place; one that is not seen is not high.
    above = np.min([np.nan_to_num(path - np.nanmin(path), nan=-np.inf) for path in paths], axis=0)
    time, rate = seen.feet[0].time, seen.feet[0].rate
    long = [(a, b) for a, b in runs(above > _HIGH) if b - a >= max(2, _SHORTEST * rate)]
    return [(time[a], time[b - 1]) for a, b in long if falls_freely(seen.trial, a, b)]


OBSERVER = Flight
