"""The moment about the vertical of who stands still: none, because nobody turns.

Standing still needs no moment about the vertical through the centre of pressure, whatever the body. What is left there
is the zero of Mz; horizontal forces, which are small, hardly enter.
"""

import numpy as np

from biodance.effects.plate_offset import PlateOffset
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, by_plate, pressure_gradient
from biodance.settings import COP_FORCE
from biodance.spatial import zero_moment_point

_OWN = 0.4
"""N·m of sway over a second or longer: 0.00 to 0.16 in eleven static trials of three laboratories."""


class StandingTwist(Observer):
    """Mean moment (N·m) of all plates about the vertical through the mean centre of pressure in quiet standing."""

    name = "standing_twist"
    responds_to = (PlateOffset.name,)
    needs = "Standing still with both feet wholly on the plates."
    source = "Newton: who stands still does not turn; 11 static trials of 3 public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return the moment of a trial in which somebody stands still on plates of one height."""
        plates, trial = [plate for plate in seen.trial.plates if plate.wrench.time.size], seen.trial
        if not plates or not seen.still or not seen.whole:
            return ()
        value, height = seen.total.value, float(np.mean([plate.height for plate in plates]))
        place = zero_moment_point(value, height=height, threshold=COP_FORCE)[:, :2]
        if not np.isfinite(place).all():
            return ()
        (x, y), mean = place.mean(axis=0), value.mean(axis=0)
        # Moment about the vertical through (x, y): Mz - (x Fy - y Fx).
        twist, lasts = float(mean[5] - x * mean[1] + y * mean[0]), float(np.ptp(seen.total.time))
        loaded = [plate.name for plate in plates if plate.wrench.force[:, 2].mean() > 0.05 * mean[2]]
        where, sd = loaded[0] if len(loaded) == 1 else "", _OWN * max(1.0, 1.0 / max(lasts, 1e-3))
        aside = np.tile([mean[1], -mean[0]], (len(value), 1))  # the twist loses this times the place of the pressure
        gradient = -pressure_gradient(value, aside, height) / len(value)
        # What Mz, Fx and Fy do to it directly.
        gradient += np.array([y, -x, 0.0, 0.0, 0.0, 1.0]) / len(value)
        responds = Sensitivity(by_plate(gradient, {plate.name: plate.wrench.value for plate in plates}), linear=False)
        return (
            Observation(
                self.name, "moment about the vertical", trial.name, twist, sd, 0.0, "N·m", where, sensitivity=responds
            ),
        )


OBSERVER = StandingTwist
